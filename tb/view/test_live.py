"""The source of the page before the RTL of the whole instrument, on the virtual board's port."""

import time
from pathlib import Path

import pytest
from slow_board import CONFIG, SCENE

from vrscan.data import recordings
from vrscan.engines.board import Board
from vrscan.view.live import LiveSource, Options

pytestmark = pytest.mark.soak


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
