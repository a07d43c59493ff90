"""``vrscan link`` on a board made of the twins: what it prints and writes, and what is wrong."""

import csv
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import Result
from fake_board import CLOCK_HZ, LINE_LENGTH, FakeBoard
from run_command import ended
from typer.testing import CliRunner

from vrscan.calibrate.results import write_maps
from vrscan.cli.app import app
from vrscan.cli.link_commands import link
from vrscan.cli.live import braille
from vrscan.clocked.command_executor import Outcome
from vrscan.data import link_pkg, pkg, recordings, records
from vrscan.data.arrays import Pixels
from vrscan.data.config import Config
from vrscan.data.correction_maps import COLUMNS as MAP_COLUMNS
from vrscan.data.correction_maps import ROWS, FieldMaps
from vrscan.data.correction_maps import read_maps as read_maps_of
from vrscan.data.line_files import read as read_lines
from vrscan.data.points import COLUMNS, read_csv
from vrscan.fixed import peak_fit
from vrscan.fixed.test_line import lines
from vrscan.fixed.vrscan_chain import run_fixed
from vrscan.link.selftest import CHAIN, TABLES, full_records, runs
from vrscan.registers import values
from vrscan.registers.chain_registers import Registers
from vrscan.registers.map_table import MapTable, nodes_of
from vrscan.registers.register_map import WINDOWS
from vrscan.registers.settings import TestLineSettings as Settings
from vrscan.view.playback import opened

COUNT = 200
CONFIG = {"sensor": {"line_length": LINE_LENGTH}, "geometry": {"centre_px": 511.5}}


def length_of(board: FakeBoard) -> int:
    """Return the length of its lines."""
    length = board.file.inputs["line_length"]
    assert isinstance(length, int)
    return length


def chain(board: FakeBoard) -> Registers:
    """Return what the board makes its points with."""
    held: dict[str, Any] = {
        name: board.file.values[name][0] for name in CHAIN if name not in TABLES
    }
    for field in WINDOWS["free_table"].fields:
        held[field.name] = tuple(board.file.table("free_table", field.name))
    for name in ("period_n", "window_two_pass", "window_fit", "noise_row", "even"):
        held[name] = bool(held[name])
    return Registers(pixel_width=12, line_length=length_of(board), **held)


def maps_in(board: FakeBoard) -> MapTable | None:
    """Return the maps that the board makes its points with."""
    held = {name: value[0] for name, value in board.file.ports().items() if len(value) == 1}
    if not held["map_enable"]:
        return None
    first = held["map_bank"] * WINDOWS["map_table"].entries
    words = board.file.table("map_table", "map_table_node")[first:]
    nodes, filled = nodes_of(np.array(words[: held["map_count"] * pkg.MAP_NODES]))
    return MapTable(nodes, filled, held["map_begin"], held["map_shift"], held["map_lens"])


def write_some_maps(name: str, count: int = 2, phase: float = 0.0) -> FieldMaps:
    """Write smooth maps to a file, filled in places, and return them."""
    i, j = np.meshgrid(np.arange(ROWS), np.arange(MAP_COLUMNS), indexing="ij")
    waves = np.array([np.sin(0.2 * i + 0.3 * j + k + phase) for k in range(count)])
    filled = (np.arange(waves.size) % 5 == 0).reshape(waves.shape)
    maps = FieldMaps(25.0, 1.2, 0.512, 8.0 * waves, filled, np.zeros(count))
    with Path(name).open("wb") as file:
        write_maps(maps, {}, file)
    return maps


class TestBoard(FakeBoard):
    """A board that has test lines, too: its twin's points of its twin's lines."""

    __test__ = False

    def spoil(self, field: str | None) -> None:
        """Make the next records of test lines wrong in a field."""
        self.spoiled = field

    def _execute(self, payload: bytes) -> Outcome:
        outcome = super()._execute(payload)
        for event in self.file.written:
            if event.name == "test_start":
                self._test_lines()
        self.file.written.clear()
        return outcome

    def _test_lines(self) -> None:
        held = {f.name: self.file.values[f"test_{f.name}"][0] for f in fields(Settings)}
        count = held["lines"] or 400
        pixels = lines(Settings(**held), count, line_length=length_of(self))
        angle, power = self.file.values["test_angle"][0], self.file.values["test_power"][0]
        # A fit knows the speckle of the lines before, whatever run they are of.
        before: Pixels = getattr(self, "before", pixels[:0])
        both = np.concatenate([before, pixels])
        self.before = both[-(peak_fit.REACH + 1) :]
        points = run_fixed(
            both, np.full(len(both), angle), np.full(len(both), power), chain(self), max_window=255,
            breaks=[len(before)] if len(before) else [], maps=maps_in(self),
        )  # fmt: skip
        made = full_records(points, 0, 0)
        # What a chain does not know: the power, bit 2, a test line, and bit 4. Bit 3 is MIXED.
        made["power"] = power
        made["bits"] = 4 + points.measured + 8 * (points.flags >> pkg.FLAG_MIXED & 1)
        made["bits"] |= (32 * (points.flags >> pkg.FLAG_MAP_FILLED & 1)).astype(np.uint8)
        made["bits"] |= 16 * self.file.inputs["configuration"]
        made = made[len(before) :]
        field = getattr(self, "spoiled", None)
        if field is not None:
            made[field][count // 2] ^= 1
        self.run_test(pixels, made)


@pytest.fixture
def board(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[TestBoard]:
    with TestBoard(tmp_path / "port") as made:
        config = Registers.from_config(Config.model_validate(CONFIG))
        count = 600
        draw = np.random.default_rng(5)
        settings = Settings(
            position=340 << pkg.POSITION_FRACTION, move=2048, step=1 << 24, height=40_000,
            pedestal=1_000, noise=300, seed=3, lines=count, period_clks=0,
        )  # fmt: skip
        made.pixels = lines(settings, count, line_length=LINE_LENGTH)
        angle = draw.integers(-(1 << 20), 1 << 20, count)
        points = run_fixed(made.pixels, angle, np.full(count, 60_000), config, max_window=255)
        made.made = full_records(points, 0, 60_000)
        made.room = 10_000
        made.file.values.update(line_enable=[1], sweep_timeout=[1_000_000_000])
        (tmp_path / "config.toml").write_text(
            f"[sensor]\nline_length = {LINE_LENGTH}\n[geometry]\ncentre_px = 511.5\n"
            "[peak]\nk_noise = 3.5\n"
        )
        # The file's own clock could have this rate, and the board's cannot.
        (tmp_path / "rate.toml").write_text(
            f"[sensor]\nline_length = {LINE_LENGTH}\n[line]\nrate_hz = 60000.0\n"
        )
        (tmp_path / "wide.toml").write_text("[peak]\nk_noise = 3.5\n")
        monkeypatch.chdir(tmp_path)
        ten = write_some_maps("ten.npz", 10)
        with Path("shape.npz").open("wb") as file:
            write_maps(replace(ten, corrections_px=ten.corrections_px[:, :5]), {}, file)
        yield made


def held(board: FakeBoard) -> dict[str, list[int]]:
    """Return what the registers hold, but for those that are events."""
    events = ("test_start", "test_stop", "commit")
    return {n: list(v) for n, v in board.file.values.items() if n not in events}


def run(*words: str) -> Result:
    return CliRunner().invoke(app, ["link", *words, "--port", "port", "--timeout", "4"])


def printed(*words: str) -> str:
    result = run(*words)
    assert result.exit_code == 0, result.output
    return result.stdout


def test_info(board: FakeBoard) -> None:
    board.file.inputs.update(mirror_state=3, mirror_settled=1, frames_crc=0, glitch_count=5)
    text = printed("info")
    for part in (
        "100 MHz",
        f"{LINE_LENGTH} px of 12 bits",
        "RUN, settled",
        "glitch_count 5",
        "nothing",
    ):
        assert part in text


def test_registers_by_name(board: FakeBoard) -> None:
    text = printed("registers", "k_noise")
    assert "0x0012" in text
    assert "640" in text
    assert "2.5" in text
    everything = printed("registers")
    for name in ("identity", "motion_a[9]", "table_amplitude[1024]", "lock_mirror"):
        assert name in everything


def test_read_and_write_in_units_and_as_integers(board: FakeBoard) -> None:
    assert printed("write", "k_noise", "3.25") == "k_noise = 3.25\n"
    assert board.file.values["k_noise"] == [832]
    assert printed("read", "k_noise", "--raw") == "k_noise = 832\n"
    assert printed("write", "trim_min", "-5", "--raw") == "trim_min = -5\n"
    assert board.file.values["trim_min"] == [-5]
    nine = [str(k) for k in range(-4, 5)]
    assert printed("write", "motion_a", *nine, "--raw") == f"motion_a = {' '.join(nine)}\n"
    assert printed("write", "scratch", "0xffffffff") == "scratch = 4294967295\n"
    word = 2**43 + 1
    assert printed("write", "ratio", str(word), "--raw") == f"ratio = {word}\n"
    shown = printed("read", "ratio").split()[2]
    assert values.from_scaled("ratio", float(shown)) == word


def test_points_as_csv_are_those_of_every_engine(board: FakeBoard) -> None:
    text = printed("points", "--out", "points.csv", "--count", str(COUNT))
    assert "0 lines missing" in text
    with Path("points.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert ",".join(rows[0]) == COLUMNS
    assert len(rows) == COUNT
    for row in rows[:: COUNT // 7]:
        want = board.made[int(row["line"]) % len(board.made)]
        if row["z_mm"]:
            assert float(row["z_mm"]) * 4096 == pytest.approx(int(want["z"]), abs=0.5)


def test_points_as_arrays(board: FakeBoard) -> None:
    printed("points", "--out", "full.npz", "--count", "100")
    printed("points", "--out", "compact.npz", "--seconds", "0.3", "--compact", "--step", "3")
    with np.load("full.npz") as full:
        place = full["line"].astype(np.int64) % len(board.made)
        assert len(place) == 100
        for name in records.FULL.names or ():
            if name != "line":
                assert np.array_equal(full[name], board.made[name][place])
        assert int(full["account_missing"]) == 0
    with np.load("compact.npz") as compact:
        assert np.all(np.diff(compact["line"].astype(np.int64)) == 3)
        place = compact["line"].astype(np.int64) % len(board.made)
        assert np.array_equal(compact["flags"], records.compact(board.made[place])["flags"])


def test_lost_points_are_status_1(board: FakeBoard) -> None:
    board.silent_lines = set(range(1_000, 10_000_000, 50))
    lossy = ("points", "--out", "points.csv", "--count", "200")
    result = run(*lossy)
    assert result.exit_code == 1
    assert "points were lost" in result.stderr
    assert Path("points.csv").exists()
    assert run(*lossy, "--allow-loss").exit_code == 0


def test_a_recording_has_the_records_and_is_filtered(board: FakeBoard) -> None:
    held = ("--config", "config.toml")
    board.file.inputs.update(mirror_state=3, missing_count=7)
    printed("points", "--out", "points.mcap", "--count", "300", *held)
    found = recordings.read(Path("points.mcap"))
    assert found.complete and found.lost == 0 and found.rows == {"records": 300, "board": 1}
    (state,) = found.board
    assert (state["mirror_state"], state["missing_count"], state["index_alive"]) == (3, 7, 0)
    assert state["time_s"] == state["uptime"] / CLOCK_HZ > 0.0
    assert found.notes["account"]["records"] >= "300" and found.about["step"]
    want = board.made[found.points.line % len(board.made)]
    assert np.array_equal(found.points.x_mm * 4096, records.points(want).x)
    printed("points", "--out", "short.mcap", "--count", "300", "--space", *held)
    short = recordings.read(Path("short.mcap"))
    assert short.complete and short.rows == {"short_records": 300, "board": 1}
    there = short.points.located
    want = board.made[short.points.line % len(board.made)]
    assert np.array_equal(there, records.located(want)) and there.any()
    assert np.array_equal(short.points.x_mm[there] * 4096, want["x"][there])
    refused = run("points", "--out", "p.mcap", "--count", "300")
    assert "sensor.line_length" in str(refused.exception) and not Path("p.mcap").exists()


def test_points_and_free_beams_as_csv(board: FakeBoard) -> None:
    """At another rate meanwhile; every line is a point or the free interval of its beam."""
    arguments = ("--out", "points.csv", "--count", "300", "--space", "--stream-baud", "4000000")
    printed("points", *arguments)
    assert "3000000" in printed("info")
    with Path("points.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 300
    points = 0
    for row in rows:
        want = board.made[int(row["line"]) % len(board.made)]
        small = records.space(want.reshape(1))[0]
        if small["flags"] & 1:
            points += 1
            assert float(row["z_mm"]) == pytest.approx(want["z"] / 4096, abs=1e-4)
            assert float(row["c_obj"]) == pytest.approx(want["c_obj"] / 255, abs=1e-3)
            assert row["angle_rad"] == row["free_from_mm"] == row["free_to_mm"] == ""
            continue
        assert row["x_mm"] == row["z_mm"] == row["c_obj"] == ""
        turn = ((int(want["angle"]) >> 8 & 0xFFFF) ^ 0x8000) - 0x8000 + 0.5
        assert float(row["angle_rad"]) == pytest.approx(turn * 2 * np.pi / 65536, abs=1e-5)
        assert float(row["c_sfm"]) == pytest.approx(want["c_sfm"] / 255, abs=1e-3)
        ends = [(int(want[name]) >> 8 & 0xFFFF) / 16 for name in ("x", "z")]
        if ends[1]:
            got = [float(row[name]) for name in ("free_from_mm", "free_to_mm")]
            assert got == pytest.approx(ends, abs=1e-4)
        else:
            assert row["free_from_mm"] == row["free_to_mm"] == ""
        assert row["inward"] == str(int(want["bits"]) >> 1 & 1)
    assert 20 < points < 280
    failed = run("points", "--out", "p.csv", "--count", "5", "--space", "--compact")
    assert failed.exit_code and "--space" in str(failed.exception) + failed.stderr


def test_compact_points_as_csv(board: FakeBoard) -> None:
    printed("points", "--out", "points.csv", "--count", "50", "--compact")
    with Path("points.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert list(rows[0]) == ["line", "x_mm", "z_mm", "c_obj", "flags"]
    assert len(rows) == 50
    for row in rows:
        want = board.made[int(row["line"]) % len(board.made)]
        located = bool(records.compact(want.reshape(1))["flags"][0] & 1)
        assert located == bool(row["z_mm"])
        if located:
            assert float(row["x_mm"]) * 4096 == pytest.approx(int(want["x"]), abs=0.5)


@pytest.mark.parametrize("form", ["--full", "--compact", "--space"])
def test_a_board_tells_its_unit_of_length(board: FakeBoard, form: str) -> None:
    """In every file z is in mm: four times the board's number of 4 mm."""
    board.file.values["length_unit"] = [4]
    some = ("--count", "60", form)
    for name, more in (("a.csv", ()), ("a.npz", ()), ("a.mcap", ("--config", "config.toml"))):
        printed("points", "--out", name, *some, *more)
    with Path("a.csv").open() as file:
        found = [(int(row["line"]), row["z_mm"]) for row in csv.DictReader(file)]
    tables = [opened(Path(name))._points for name in ("a.npz", "a.mcap")]
    for table in tables:
        rows = zip(table.line.tolist(), table.z_mm.tolist(), strict=True)
        found += [(line, str(z)) for (line, z), there in zip(rows, table.located, strict=True)
                  if there]  # fmt: skip
    located = [(line, float(z)) for line, z in found if z]
    assert len(located) > 60
    for line, z in located:
        assert z * 1024 == pytest.approx(int(board.made["z"][line % len(board.made)]), abs=0.1)


def test_captured_lines_can_be_replayed(board: FakeBoard) -> None:
    """With the board's own points beside them, and the configuration that is in it."""
    board.made["time"] = np.arange(len(board.made)) * 3000
    printed("capture", "--lines", "4", "--out", "lines.mcap", "--config", "config.toml")
    kept = recordings.read(Path("lines.mcap"))
    assert kept.complete and kept.rows == {"records": 4, "lines": 4}
    assert kept.config.peak.k_noise == 3.5 and kept.about["firmware"]
    found = read_lines(Path("lines.mcap"), kept.config)
    place = found.number % len(board.made)
    assert np.array_equal(found.number, kept.points.line)
    assert np.array_equal(found.time_s, kept.points.time_s)
    # Behind the last point the board's begin anew, which reads as a counter that turned over.
    assert found.time_s % (2**32 / CLOCK_HZ) == pytest.approx(place * 3000 / CLOCK_HZ)
    assert np.array_equal(found.lines, board.pixels[place % len(board.pixels)])
    turns = board.made["angle"][place] / 2.0**24
    assert found.angle_rad == pytest.approx(2.0 * np.pi * turns)
    words = ["replay", "lines.mcap", "--engine", "fixed", "--out", "again.csv"]
    assert CliRunner().invoke(app, words).exit_code == 0
    again = read_csv(Path("again.csv"))
    assert np.array_equal(again.maximum, kept.points.maximum)
    assert again.time_s == pytest.approx(found.time_s, abs=1e-9)
    refused = run("capture", "--out", "wide.mcap")
    assert "sensor.line_length" in str(refused.exception) and not Path("wide.mcap").exists()


def test_a_captured_line_as_text_csv_and_picture(board: FakeBoard) -> None:
    text = printed("capture")
    assert "█" in text
    assert f"{LINE_LENGTH} px" in text
    printed("capture", "--out", "line.csv", "--lines", "2")
    with Path("line.csv").open() as file:
        assert len(list(csv.reader(file))) == LINE_LENGTH + 1
    printed("capture", "--out", "line.png")
    assert Path("line.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("busy", [False, True])
def test_lines_with_a_peak_are_waited_for(board: FakeBoard, busy: bool) -> None:
    if busy:
        board.lines_per_s = 1e9
    # On a busy machine each capture is of the first of some hundred lines: of 600 places it would
    # see six at most, again and again.
    board.made = board.made[: COUNT * 3 - 1].copy()
    board.made["bits"] = np.arange(COUNT * 3 - 1) % 7 == 3
    for count in (1, 3):
        words = ("capture", "--peak", "--out", "line.mcap", "--config", "config.toml")
        printed(*words, "--lines", str(count))
        assert recordings.read(Path("line.mcap")).points.measured.tolist() == [True] * count


def test_where_there_is_no_peak_it_is_said_why(board: FakeBoard) -> None:
    board.made["bits"] = 0
    board.file.inputs.update(mirror_state=4, mirror_fault=3, laser_status=16)
    for words in (["capture", "--out", "x.png"], ["points", "--out", "x.csv", "--count", "20"]):
        result = run(*words)
        assert result.exit_code == 0, result.output
        (line,) = (x for x in result.stderr.splitlines() if x.startswith("vrscan: "))
        assert "no peak: the laser went off" in line and "FAULT (index)" in line
        Path(words[2]).unlink()
    for count in ("1", "2"):
        result = run("capture", "--peak", "--out", "x.png", "--lines", count)
        assert result.exit_code != 0
        assert "none in 50 lines: the laser went off" in str(result.exception)
        assert not Path("x.png").exists()


def test_points_that_the_serial_line_does_not_carry_are_not_asked_for(board: FakeBoard) -> None:
    board.file.inputs["mirror_word"] = round(249 / CLOCK_HZ * 2**48)
    board.file.values["ratio"] = [round(37_400 / 249 * 2**32)]
    for kind, step in (("--full", 10), ("--compact", 2)):
        text = printed("points", kind, "--out", "points.csv", "--count", "50")
        assert f"50 points in the file, of one line in {step}\n" in text
        with Path("points.csv").open() as file:
            numbers = [int(row["line"]) for row in csv.DictReader(file)]
        assert set(np.diff(numbers).tolist()) == {step}


def test_load_shows_what_changes(board: FakeBoard) -> None:
    text = printed("load", "--config", "config.toml")
    assert any(line.split() == ["k_noise", "2.5", "3.5"] for line in text.splitlines())
    assert board.file.values["k_noise"] == [896]
    again = printed("load", "--config", "config.toml")
    assert ", 0 of them changed" in " ".join(again.split())


def test_load_and_start(board: FakeBoard) -> None:
    def running() -> None:
        board.file.inputs["mirror_state"] = 3

    board.file.values["line_enable"] = [0]
    threading.Timer(1.0, running).start()
    text = printed("load", "--config", "config.toml", "--start")
    assert "the mirror is in RUN; the laser goes off" in text
    for name in ("line_enable", "laser_enable", "mirror_enable"):
        assert board.file.values[name] == [1]


def test_started_for_a_command_only(board: FakeBoard) -> None:
    def running() -> None:
        board.file.inputs["mirror_state"] = 3

    for words in (
        ["points", "--count", "20", "--out", "points.csv"],
        ["capture", "--out", "line.mcap", "--config", "config.toml"],
        ["watch", "--seconds", "0.5"],
    ):
        board.file.inputs["mirror_state"] = 1
        board.file.values.update(line_enable=[0], laser_enable=[0], mirror_enable=[0])
        threading.Timer(0.5, running).start()
        printed(*words, "--start")
        for name in ("line_enable", "laser_enable", "mirror_enable"):
            assert board.file.values[name] == [0]


def test_a_mirror_that_does_not_start_is_stopped(board: FakeBoard) -> None:
    def fault() -> None:
        board.file.inputs.update(mirror_state=4, mirror_fault=2)

    board.file.inputs["mirror_state"] = 1
    threading.Timer(0.5, fault).start()
    result = run("points", "--count", "20", "--out", "points.csv", "--start")
    assert "FAULT: settle" in str(result.exception)
    assert not Path("points.csv").exists()
    for name in ("line_enable", "laser_enable", "mirror_enable"):
        assert board.file.values[name] == [0]


def test_watch_for_a_moment(board: FakeBoard) -> None:
    board.file.inputs.update(mirror_state=3, mirror_word=round(249.0 / 100e6 * 2**48))
    text = printed("watch", "--seconds", "1.0", "--step", "5")
    assert "249.0000 Hz" in text
    assert "0 lines missing" in text
    assert any(0x2800 < ord(each) < 0x2900 for each in text)
    assert "no point" not in text and " deg, " in text
    board.file.values["scan_facet"] = [1]  # a polygon, which has no amplitude
    text = printed("watch", "--seconds", "0.5")
    assert "polygon, 249.0000 facets/s" in text and " deg" not in text


class Command:
    """``vrscan link`` as a process of its own, as signals and a port's end meet it."""

    def __init__(self, *words: str) -> None:
        self.process = subprocess.Popen(
            [sys.executable, "-m", "vrscan", "link", *words, "--port", "port", "--timeout", "4"],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )

    def end(self) -> tuple[int, str]:
        """Return the exit status and the one line of complaint."""
        _, told = self.process.communicate(timeout=60)
        (line,) = (each for each in told.splitlines() if each.startswith("vrscan: "))
        return self.process.returncode, line


def until(true: Callable[[], bool]) -> None:
    end = time.monotonic() + 30
    while not true():
        assert time.monotonic() < end
        time.sleep(0.01)


def end_by(way: str, command: Command, board: FakeBoard) -> tuple[int, str]:
    """Let a signal or the port's end come; return the status and the words that go with it."""
    if way == "port":
        board.unplug()
        return 2, "the port is gone"
    number = {"SIGINT": signal.SIGINT, "SIGTERM": signal.SIGTERM}[way]
    command.process.send_signal(number)
    return 128 + number, {"SIGINT": "interrupted", "SIGTERM": "terminated"}[way]


@pytest.mark.parametrize("form", ["--full", "--compact", "--space"])
@pytest.mark.parametrize("limit", ["--seconds", "--count"])
@pytest.mark.parametrize("way", ["port", "SIGTERM", "SIGINT"])
def test_a_recording_that_ends_early_keeps_its_points(
    board: FakeBoard, way: str, limit: str, form: str
) -> None:
    """Every point of every packet that the board sent before the end, and nothing else."""
    command = Command("points", form, "--out", "points.npz", limit, "100000", "--step", "1")
    until(lambda: board.sent_points > 500)
    least = board.sent_points
    status, why = end_by(way, command, board)
    got, told = command.end()
    assert got == status and why in told
    with np.load("points.npz") as found:
        lines = found["line"].astype(np.int64)
        assert np.array_equal(lines, np.arange(lines[0], lines[0] + len(lines)))
        made = board.made[lines % len(board.made)]
        want = {"--full": lambda r: r, "--compact": records.compact, "--space": records.space}
        assert np.array_equal(found["x"], want[form](made)["x"])
        account = int(found["account_records"])
    assert account == len(lines)
    # What a pty holds when its end goes away is lost.
    assert least - (200 if way == "port" else 0) <= len(lines) <= board.sent_points
    assert told.endswith(f"{len(lines)} points are in points.npz")
    assert [name for name in os.listdir() if name.startswith(".")] == []
    if way != "port":
        until(lambda: board.executed.get(link_pkg.COMMAND_STREAM_STOP, 0) > 1)
        assert run("info").exit_code == 0


def test_a_board_that_falls_silent_leaves_what_it_sent(board: FakeBoard) -> None:
    command = Command("points", "--out", "points.csv", "--count", "100000", "--step", "1")
    until(lambda: board.sent_points > 500)
    least = board.sent_points
    board.faults.silent = True
    status, told = command.end()
    assert status == 2 and "no answer" in told  # to why there is no point
    with Path("points.csv").open() as file:
        count = len(list(csv.DictReader(file)))
    assert count >= least and f"{count} points are in points.csv" in told


def test_an_end_before_the_first_point_leaves_no_file(board: FakeBoard) -> None:
    board.file.values["line_enable"] = [0]
    command = Command("points", "--out", "points.npz", "--seconds", "60", "--step", "1")
    until(lambda: board.executed.get(link_pkg.COMMAND_STREAM_START, 0) > 0)
    board.unplug()
    status, told = command.end()
    assert status == 2 and "the port is gone" in told
    assert not Path("points.npz").exists()


@pytest.mark.parametrize("way", ["port", "SIGTERM", "SIGINT"])
def test_captured_lines_are_kept_at_an_early_end(board: FakeBoard, way: str) -> None:
    board.lines_per_s = 100.0
    words = ("capture", "--out", "lines.mcap", "--config", "config.toml", "--lines", "10000")
    command = Command(*words)
    until(lambda: board.sent_lines > 5)
    status, why = end_by(way, command, board)
    got, told = command.end()
    assert got == status and why in told
    kept = recordings.read(Path("lines.mcap"))
    place = kept.lines.number % len(board.made)
    assert len(place) >= 3 and f"{len(place)} lines are in lines.mcap" in told
    assert np.array_equal(kept.lines.lines, board.pixels[place % len(board.pixels)])


def test_maps_are_loaded_beside_those_in_use(board: FakeBoard) -> None:
    for k in range(3):
        wanted = write_some_maps("map.npz", 2 + k % 2, float(k))
        text = printed("maps", "load", "map.npz")
        assert f"{2 + k % 2} maps, {wanted.corrections_px.size} nodes, 20 % of them filled" in text
        assert board.file.active["map_bank"] == [1 - k % 2]
        found = maps_in(board)
        assert found is not None and (found.map_begin, found.map_shift) == (2400, 10)
        assert np.array_equal(found.nodes, wanted.words())
        printed("maps", "read", "--out", "back.npz")
        back = read_maps_of(Path("back.npz"))
        assert np.array_equal(back.words(), wanted.words())
        assert np.array_equal(back.filled, wanted.filled)
        assert (back.lens_begin_mm, back.lens_step_mm) == pytest.approx((1.2, 0.512))


def test_a_configuration_brings_its_maps(board: FakeBoard) -> None:
    wanted = write_some_maps("map.npz")
    text = Path("config.toml").read_text()
    Path("mapped.toml").write_text(f'{text}[map]\nfile = "map.npz"\nfocus_mm = 500.0\n')
    assert "maps of map.npz loaded" in printed("load", "--config", "mapped.toml")
    found = maps_in(board)
    assert found is not None and np.array_equal(found.nodes, wanted.words())
    assert (found.lens, board.file.active["k_noise"]) == (2632, [896])
    printed("load", "--config", "config.toml")
    assert maps_in(board) is None


@pytest.mark.parametrize("way", ["wrong word", "refused", "port gone"])
def test_maps_that_do_not_arrive_leave_those_in_use(board: FakeBoard, way: str) -> None:
    write_some_maps("map.npz")
    printed("maps", "load", "map.npz")
    before, active = maps_in(board), {n: list(v) for n, v in board.file.active.items()}
    write_some_maps("other.npz", phase=1.0)
    first = WINDOWS["map_table"].address
    access = board.file.access

    def spoilt(kind: int, address: int, data: int = 0) -> tuple[int, int]:
        if address != first + 3000:
            return access(kind, address, data)
        if way == "refused":
            return link_pkg.STATUS_BUSY, 0
        if way == "port gone":
            board.faults.silent = True
        status, word = access(kind, address, data)
        return status, word ^ 2

    board.file.access = spoilt
    result = run("maps", "load", "other.npz")
    board.file.access = access
    assert result.exit_code != 0
    says = {
        "wrong word": "map_table_node[3000]: reads",
        "refused": "map_table_node[3000] = ",
        "port gone": "no answer",
    }
    assert says[way] in str(result.exception)
    assert "\n" not in str(result.exception)
    assert board.file.active == active
    after = maps_in(board)
    assert before is not None and after is not None
    assert np.array_equal(before.nodes, after.nodes)


def test_selftest_knows_the_maps(board: TestBoard) -> None:
    board.file.values["line_enable"] = [0]
    write_some_maps("map.npz")
    printed("maps", "load", "map.npz")
    before = held(board)
    text = printed("selftest")
    assert text.count("equal") == 3 * len(runs(LINE_LENGTH)) + 7
    assert held(board) == before


def test_selftest_finds_nothing(board: TestBoard) -> None:
    board.file.values["line_enable"] = [0]
    before = held(board)
    text = printed("selftest")
    assert text.count("equal") == 3 * len(runs(LINE_LENGTH)) + 7
    assert held(board) == before


@pytest.mark.parametrize("field", ["x", "row_variance", "c_sfm", "flags", "doubt", "bits"])
def test_selftest_finds_a_wrong_bit(board: TestBoard, field: str) -> None:
    board.file.values["line_enable"] = [0]
    board.spoil(field)
    result = run("selftest")
    assert result.exit_code == 1
    assert f"{field} is" in result.stderr
    assert "want" in result.stderr
    assert "line 20 of 40" in result.stderr


def test_selftest_finds_a_register_that_does_not_hold(board: TestBoard) -> None:
    board.file.values["line_enable"] = [0]
    access = board.file.access

    def stuck(kind: int, address: int, data: int = 0) -> tuple[int, int]:
        status, word = access(kind, address, data)
        return status, word & ~4 if address == 0x20 else word

    board.file.access = stuck
    result = run("selftest")
    assert result.exit_code == 1
    assert "centre" in result.stderr


def test_bench(board: TestBoard) -> None:
    board.file.values["line_enable"] = [0]
    text = printed("bench", "--pings", "5", "--seconds", "0.2", "--bauds", "3000000,1000000")
    assert "ping of 250 bytes" in text
    assert text.count("compact") == 2
    assert "1000000" in text


CASES = {
    "no_port": (["link", "info"], ["--port"]),
    "missing_port": (["link", "info", "--port", "none"], ["none", "No such file"]),
    "file_as_port": (["link", "info", "--port", "wide.toml"], ["wide.toml"]),
    "baud": (["link", "info", "--port", "port", "--baud", "0"], ["--baud", "(0)"]),
    "timeout": (["link", "info", "--port", "port", "--timeout", "0"], ["--timeout", "(0)"]),
    "unknown_register": (["link", "read", "k_nois", "--port", "port"], ["k_nois", "k_noise"]),
    "no_such_filter": (["link", "registers", "kk_noise", "--port", "port"], ["kk_noise"]),
    "no_number": (["link", "write", "k_noise", "x", "--port", "port"], ["k_noise", "(x)"]),
    "no_integer": (
        ["link", "write", "k_noise", "2.5", "--raw", "--port", "port"],
        ["k_noise", "(2.5)"],
    ),
    "too_large": (["link", "write", "k_noise", "300", "--port", "port"], ["k_noise", "(300)"]),
    "not_finite": (["link", "write", "k_noise", "nan", "--port", "port"], ["k_noise", "nan"]),
    "too_many": (["link", "write", "k_noise", "1", "2", "--port", "port"], ["k_noise", "(2)"]),
    "read_only": (["link", "write", "uptime", "1", "--port", "port"], ["uptime"]),
    "no_count": (["link", "points", "--out", "p.csv", "--port", "port"], ["--count"]),
    "bad_count": (
        ["link", "points", "--out", "p.csv", "--count", "0", "--port", "port"],
        ["--count", "(0)"],
    ),
    "bad_step": (
        ["link", "points", "--out", "p.csv", "--count", "1", "--step", "256", "--port", "port"],
        ["--step", "(256)"],
    ),
    "bad_ending": (
        ["link", "points", "--out", "p.txt", "--count", "1", "--port", "port"],
        ["p.txt"],
    ),
    "no_folder": (
        ["link", "points", "--out", "no/p.csv", "--count", "1", "--port", "port"],
        ["no/p.csv"],
    ),
    "bad_line": (["link", "capture", "--line", "-1", "--port", "port"], ["--line", "(-1)"]),
    "peak_and_line": (["link", "capture", "--line", "1", "--peak", "--port", "port"], ["--peak"]),
    "lines_and_line": (
        ["link", "capture", "--line", "1", "--lines", "2", "--port", "port"],
        ["--line"],
    ),
    "other_sensor": (
        ["link", "load", "--config", "wide.toml", "--port", "port"],
        ["sensor.line_length"],
    ),
    "rate": (
        ["link", "load", "--config", "rate.toml", "--port", "port"],
        ["rate.toml", "line.rate_hz = 60000", "1024 px at 100 MHz", "at most 48439 Hz"],
    ),
    "too_many_maps": (["link", "maps", "load", "ten.npz", "--port", "port"], ["10 maps", "2 to 9"]),
    "no_maps": (["link", "maps", "load", "none.npz", "--port", "port"], ["none.npz"]),
    "wrong_maps": (["link", "maps", "load", "wide.toml", "--port", "port"], ["wide.toml", "maps"]),
    "maps_shape": (
        ["link", "maps", "load", "shape.npz", "--port", "port"],
        ["shape.npz", "33, 65"],
    ),
    "maps_off": (["link", "maps", "read", "--out", "m.npz", "--port", "port"], ["map_enable = 0"]),
    "maps_ending": (["link", "maps", "read", "--out", "m.csv", "--port", "port"], ["m.csv"]),
    "missing_config": (["link", "load", "--config", "no.toml", "--port", "port"], ["no.toml"]),
    "lines_run": (["link", "selftest", "--port", "port"], ["lines run"]),
    "bad_bauds": (["link", "bench", "--bauds", "fast", "--port", "port"], ["--bauds", "fast"]),
}


@pytest.mark.parametrize("case", CASES)
def test_bad_input_is_one_line(
    board: FakeBoard, case: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    words, says = CASES[case]
    before = sorted(os.listdir())
    monkeypatch.delenv("VRSCAN_PORT", raising=False)
    assert ended(monkeypatch, *words) == 2
    complaint = capsys.readouterr().err.strip().splitlines()
    assert complaint[-1].startswith("vrscan: ")
    for part in says:
        assert part in complaint[-1]
    assert len([line for line in complaint if line.startswith("vrscan: ")]) == 1
    assert sorted(os.listdir()) == before


def test_a_mirror_that_moves_is_not_loaded(board: FakeBoard) -> None:
    board.file.inputs["mirror_state"] = 3
    result = run("load", "--config", "config.toml")
    assert result.exit_code != 0
    assert "RUN" in str(result.exception)
    assert board.file.values["k_noise"] == [640]
    assert run("load", "--config", "config.toml", "--force").exit_code == 0


def test_the_help_is_quick() -> None:
    assert {command.name or command.callback.__name__ for command in link.registered_commands} == {
        "info", "registers", "read", "write", "watch", "capture", "points", "load", "selftest",
        "bench",
    }  # fmt: skip


def test_a_picture_of_dots() -> None:
    x = np.array([0.0, 3.0])
    assert braille(x, x, 2, 1) == "\u2801\u2880"
    assert braille(np.zeros(0), np.zeros(0), 2, 1) == "\u2800\u2800"
    assert braille(np.ones(1), np.ones(1), 1, 1) != "\u2800"
