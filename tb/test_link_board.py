"""The host against the RTL of the whole instrument, on the virtual board's serial port.

The board is that of ``test_board_vrscan``, whose elaboration it shares.
"""

import csv
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from test_board_vrscan import CONFIG, SCENE
from typer.testing import CliRunner

from vrscan.board import Board
from vrscan.cli import app
from vrscan.lines import read as read_lines
from vrscan.link import selftest
from vrscan.link.device import Device
from vrscan.link.transport import LinkError, UnpluggedError

TIMEOUT_S = 60.0


@pytest.fixture(scope="module")
def board(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Board]:
    port = tmp_path_factory.mktemp("link") / "port"
    with Board(SCENE, CONFIG, port=port, swinging=True) as running:
        yield running


@pytest.fixture
def device(board: Board) -> Iterator[Device]:
    with Device(str(board.port), timeout=TIMEOUT_S) as found:
        yield found


def run(board: Board, *words: str) -> str:
    more = "--port", str(board.port), "--timeout", str(TIMEOUT_S)
    result = CliRunner().invoke(app, ["link", *words, *more])
    assert result.exit_code == 0, result.output
    return result.stdout


def test_every_bit_of_the_test_lines_points_is_the_models(device: Device) -> None:
    checks = list(selftest.SelfTest(device).checks())
    for check in checks:
        print(check)
    assert [check.difference for check in checks if check.difference] == []
    assert sum(check.lines for check in checks) > 1000
    assert sum(check.compared for check in checks) > 20_000


def test_a_wrong_setting_is_noticed(device: Device) -> None:
    test = selftest.SelfTest(device)
    with selftest.arranged(device):
        k_noise = device.read("k_noise")
        device.write("k_noise", 0x1000)  # behind the test's back
        try:
            settings = selftest.runs(device.build.line_length)["much noise"]
            check = test.run("much noise", settings, True, 0, 1000)
        finally:
            device.write("k_noise", k_noise)
    assert check.difference is not None
    assert "want" in check.difference


def test_loaded_and_started_by_the_command(board: Board, tmp_path: Path) -> None:
    config = tmp_path / "config.toml"
    config.write_text(
        f"[clock]\nfrequency_hz = {CONFIG.clock.frequency_hz}\n"
        f"[line]\nrate_hz = {CONFIG.line.rate_hz}\n"
        f"[mirror]\nsweep_span_hz = {CONFIG.mirror.sweep_span_hz}\n"
    )
    with Device(str(board.port), timeout=TIMEOUT_S) as device:
        wanted = device.settings(CONFIG)
    text = run(board, "load", "--config", str(config), "--start")
    assert "the mirror is in RUN" in text
    with Device(str(board.port), timeout=TIMEOUT_S) as device:
        assert device.read_many(wanted) == wanted
        assert device.read("mirror_state") == 3
        device.write_many([("laser_adapt", 0), ("laser_power", 20_000)])
        with pytest.raises(LinkError, match="the mirror is in RUN"):
            device.load(CONFIG)
        with pytest.raises(LinkError, match="lines run"):
            next(selftest.SelfTest(device).checks())


def test_points_by_the_command(board: Board, tmp_path: Path) -> None:
    text = run(
        board, "points", "--out", str(tmp_path / "points.csv"), "--count", "60", "--step", "5"
    )
    assert "0 lines missing, 0 dropped by the board, 0 packets lost, 0 bad frames" in text
    with (tmp_path / "points.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 60
    numbers = [int(row["line"]) for row in rows]
    assert np.all(np.diff(numbers) == 5)


def test_raw_lines_by_the_command(board: Board, tmp_path: Path) -> None:
    out = tmp_path / "lines.npz"
    run(board, "capture", "--lines", "2", "--out", str(out))
    found = read_lines(out, CONFIG)
    assert found.lines.shape == (2, CONFIG.sensor.line_length)
    with np.load(out) as raw:
        assert raw["has_point"].all()
        assert np.array_equal(raw["lines"].max(axis=1), raw["point_maximum"])


def test_watched_for_a_moment(board: Board) -> None:
    text = run(board, "watch", "--seconds", "3")
    assert "RUN" in text
    assert "Hz" in text


def test_points_and_a_line_at_once_and_one_host_after_another(board: Board) -> None:
    for _ in range(2):
        with Device(str(board.port), timeout=TIMEOUT_S) as device:
            with device.stream(False, 16) as points:
                got = device.capture()
                assert points.get(TIMEOUT_S) is not None
            assert points.account.lost == points.account.bad_frames == 0
            assert got.record is not None
            assert got.pixels.max() == got.record["maximum"][0]
            device.stream()
            device._disconnect()  # as a program that was killed
    with Device(str(board.port), timeout=TIMEOUT_S) as device:
        before = device.traffic.unasked
        for _ in range(3):
            device.ping()
        assert device.traffic.unasked == before


def test_another_rate_and_back(board: Board) -> None:
    with Device(str(board.port), timeout=TIMEOUT_S) as device:
        device.set_baud(1_000_000)
        with device.stream(False, 50) as points:
            assert points.get(TIMEOUT_S) is not None
        assert points.account.bad_frames == 0
    with Device(str(board.port), timeout=TIMEOUT_S) as device:
        device.ping()
        assert device.baud == 3_000_000
        device.set_baud(1_000_000)
        device._disconnect()  # and leaves the rate
    with Device(str(board.port), timeout=TIMEOUT_S) as device:
        assert device.baud == 3_000_000


def test_locked_until_reset(device: Device) -> None:
    device.write("mirror_enable", 0)
    device.lock("calibration")
    with pytest.raises(LinkError, match=r"k_noise = \d+: LOCKED"):
        device.write("k_noise", 5)


def test_unplugged_and_plugged_again(board: Board) -> None:
    with Device(str(board.port), timeout=TIMEOUT_S) as device:
        device.write("scratch", 77)
        board.stop()
        with pytest.raises(UnpluggedError):
            device.ping()
        with board:
            device.reconnect(TIMEOUT_S)
            assert device.read("scratch") == 0  # it was without power
            device.write("k_noise", 5)  # and is not locked
            device.ping()
