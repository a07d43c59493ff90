"""The source of the page before a board of the twins, and before the RTL on its virtual board."""

import time
from collections.abc import Callable
from pathlib import Path

import pytest
from fake_board import FakeBoard
from slow_board import CONFIG, SCENE

from vrscan.data import recordings
from vrscan.engines.board import Board
from vrscan.view.live import LiveSource, Options

TIMEOUT_S = 4.0


def test_a_board_that_is_lost_at_a_change_of_rate_comes_back(tmp_path: Path) -> None:
    with FakeBoard(tmp_path / "port") as board:
        board.file.values["line_enable"] = [1]
        board.unplug_at_rate()
        source = LiveSource(Options(str(board.path), timeout=TIMEOUT_S, stream_baud=1_000_000))
        end = time.monotonic() + 10.0 * TIMEOUT_S

        def until(wanted: Callable[[], bool]) -> None:
            while not wanted():
                assert time.monotonic() < end, (source.state, list(source.events))
                time.sleep(0.05)

        source.begin()
        try:
            until(lambda: any("the port is gone" in text for _, text in source.events))
            board.plug()
            until(lambda: source.connected and source.display.count > 100)
        finally:
            source.close()


@pytest.mark.soak
def test_a_virtual_board_is_started_shown_and_recorded(tmp_path: Path) -> None:
    with Board(SCENE, CONFIG, port=tmp_path / "port", swinging=True) as board:
        options = Options(str(board.port), timeout=60.0, start=True, config=CONFIG, load=True)
        source, end = LiveSource(options), time.monotonic() + 500.0

        def until(there: int) -> None:
            while source.display.count < there or source.display.line is None:
                assert time.monotonic() < end, (source.state, list(source.events))
                time.sleep(0.2)

        source.begin()
        try:
            until(100)
            source.record(tmp_path / "kept.mcap")
            until(source.display.count + 300)
        finally:
            source.close()
        assert source.display.mirror[0] == pytest.approx(CONFIG.mirror.amplitude_deg, rel=0.01)
    kept = recordings.read(tmp_path / "kept.mcap")
    assert kept.complete and len(kept.points) >= 300
    assert kept.points.located.sum() > 50
    assert kept.notes["account"]["missing"] == "0"
