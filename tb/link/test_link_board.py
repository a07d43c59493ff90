"""The host against the RTL of the whole instrument, on the virtual board's serial port.

The board is that of ``test_board``, whose elaboration it shares.
"""

import csv
import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from documented import ROOT, commands
from harness import in_volume
from slow_board import CONFIG, SCENE
from typer.testing import CliRunner

from vrscan.cli.app import app
from vrscan.data import recordings
from vrscan.data.config import to_toml
from vrscan.data.records import Form
from vrscan.engines.board import Board
from vrscan.link import selftest
from vrscan.link.device import RUN, Device
from vrscan.link.transport import LinkError, UnpluggedError

TIMEOUT_S = 60.0
RUNS = selftest.runs
ALL = tuple(RUNS(CONFIG.sensor.line_length))
SOME = ("moving peak", "saturated", "across the edges", "nothing but noise", "spread out")


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


@pytest.mark.parametrize("seed", [2, in_volume(3), in_volume(4)])
def test_what_registers_hold_before_the_reset_changes_no_bit(
    seed: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Boards that begin with other random bits give the model's points, and no fault."""
    monkeypatch.setattr(selftest, "LINES", 10)
    port = tmp_path / "port"
    with Board(SCENE, CONFIG, port=port, seed=seed), Device(str(port), timeout=TIMEOUT_S) as device:
        assert all(device.read(name) == 0 for name in selftest.FAULTS)
        test = selftest.SelfTest(device)
        with selftest.arranged(device):
            settings = selftest.runs(device.build.line_length)["much noise"]
            check = test.run("much noise", settings, True, 0, 1000)
    assert check.difference is None
    assert check.lines == 10


@pytest.mark.parametrize(
    ("lines", "names"), [(10, SOME), in_volume(selftest.LINES, ALL)], ids=["short", "long"]
)
def test_the_readmes_commands_work_as_printed(
    lines: int,
    names: tuple[str, ...],
    board: Board,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """One after the other, with this board's configuration and less to wait for."""
    monkeypatch.setattr(selftest, "LINES", lines)  # of each run of the self-test
    monkeypatch.setattr(selftest, "runs", lambda length: {n: RUNS(length)[n] for n in names})
    monkeypatch.chdir(tmp_path)
    Path("build").mkdir()
    Path("config.toml").write_text(
        f"[clock]\nfrequency_hz = {CONFIG.clock.frequency_hz}\n"
        f"[line]\nrate_hz = {CONFIG.line.rate_hz}\n"
        f"[mirror]\nsweep_span_hz = {CONFIG.mirror.sweep_span_hz}\n"
    )
    more = {"load": ("--config", "config.toml"), "watch": ("--seconds", "1")}
    said = {}
    for group, *words in commands(ROOT / "docs" / "usage.md"):
        if group == "link":
            fewer = ["100" if word == "1000" else word for word in words]
            said[words[0]] = run(board, *fewer, *more.get(words[0], ()))
    assert list(said) == ["selftest", "load", "watch", "points", "capture"]

    found = re.search(r"(\d+) numbers of (\d+) lines", said["selftest"])
    tested = len(Form) * len(names) * lines
    assert found and int(found[1]) > 12 * tested and int(found[2]) >= tested
    assert "the mirror is in RUN" in said["load"]
    assert "RUN" in said["watch"] and "Hz" in said["watch"]

    lost = "0 lines missing, 0 dropped by the board, 0 packets lost, 0 bad frames"
    assert lost in said["points"]
    with Path("build/points.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 100
    numbers = [int(row["line"]) for row in rows]
    assert set(np.diff(numbers).tolist()) == {3}  # 9000 lines a second, and a third is carried
    assert sum(bool(row["z_mm"]) for row in rows) > 20

    assert Path("build/line.png").read_bytes().startswith(b"\x89PNG")
    (line,) = (x.split() for x in said["capture"].splitlines() if ".." in x)
    left, right = (float(px) for px in line[6].split(".."))
    assert left - 0.5 <= float(line[7]) <= right + 0.5  # a pixel's centre is its number
    assert float(line[2]) > float(line[5])  # above its threshold


def test_a_configuration_is_held_and_guarded(board: Board) -> None:
    with Device(str(board.port), timeout=TIMEOUT_S) as device:
        wanted = device.settings(CONFIG)
        assert device.read_many(wanted) == wanted
        assert device.read("mirror_state") == 3
        device.write_many([("laser_adapt", 0), ("laser_power", 20_000)])
        with pytest.raises(LinkError, match="the mirror is in RUN"):
            device.load(CONFIG)
        with pytest.raises(LinkError, match="lines run"):
            next(selftest.SelfTest(device).checks())


def test_raw_lines_by_the_command(board: Board, tmp_path: Path) -> None:
    out, own = tmp_path / "lines.mcap", tmp_path / "own.toml"
    own.write_text(to_toml(CONFIG))
    run(board, "capture", "--lines", "2", "--out", str(out), "--config", str(own))
    found = recordings.read(out)
    assert found.lines.lines.shape == (2, CONFIG.sensor.line_length)
    assert np.array_equal(found.lines.lines.max(axis=1), found.points.maximum)


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


@pytest.mark.soak
def test_another_rate_and_back(board: Board) -> None:
    with Device(str(board.port), timeout=TIMEOUT_S) as device:
        if device.read("mirror_state") != RUN:  # of the tests above none has started it
            device.load(CONFIG)
            device.start()
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
