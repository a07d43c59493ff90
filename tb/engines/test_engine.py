"""Engines on blocks of lines and on many processes: the points are the same, and memory is not."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from scanners import EACH_SCANNER, SCANNERS

from vrscan.data import recordings
from vrscan.data.config import Config, Free, Geometry
from vrscan.data.errors import InputError
from vrscan.data.lines import Lines, part
from vrscan.data.parallel import processors, workers
from vrscan.data.points import csv_rows
from vrscan.data.table import Table
from vrscan.engines.engine import BLOCK, Engine, processes, run, streamed
from vrscan.engines.shadows import shaded
from vrscan.engines.tools import repository_root
from vrscan.scene.simulate import take

SEED = 20100301
CONFIG = Config()
MODES = {
    "one_pass": Config.model_validate({"peak": {"window": "threshold"}}),
    "two_pass": Config.model_validate({"peak": {"window": "two_pass"}}),
    **SCANNERS,  # with a fit
}


def ugly(count: int, config: Config) -> Lines:
    """Lines of a scene, and between them some that are black, white, noise or two spots."""
    rng, top = np.random.default_rng(SEED), 2**config.sensor.pixel_width - 1
    lines = take("default", count, config).lines
    pixels = lines.lines.copy()
    kind = rng.integers(0, 8, count)
    pixels[kind == 0] = 0
    pixels[kind == 1] = top
    pixels[kind == 2] = rng.integers(0, top + 1, pixels[kind == 2].shape)
    pixels[kind == 3, :20] = top - 20
    pixels[kind == 4, -9:] = top
    flags = rng.integers(0, 8, count)
    return Lines(pixels, lines.angle_rad, rng.integers(0, 65536, count), mirror_flags=flags)


def rows_in_blocks(
    engine: Engine, recording: Lines, config: Config, sizes: list[int], jobs: int = 1
) -> bytes:
    """Return the rows of points.csv of lines in blocks of the given sizes, in turns."""

    def blocks() -> Iterator[Lines]:
        start, turn = 0, 0
        while start < len(recording):
            size = sizes[turn % len(sizes)]
            yield part(recording, slice(start, start + size))
            start, turn = start + size, turn + 1

    with streamed(engine, blocks(), config, jobs) as found:
        points = Table.joined(list(found))
    assert np.array_equal(points.line, np.arange(len(recording)))
    return csv_rows(points)


def whole_rows(engine: Engine, recording: Lines, config: Config) -> bytes:
    """Return the same of lines that are computed at once."""
    return csv_rows(Table.joined(list(shaded([run(engine, recording, config)], config))))


def test_all_engines_measure_beyond_two_metres() -> None:
    """The same spots, seen by an instrument of four times the base, lie four times as far away."""
    unit_mm = 4
    large = Config(
        geometry=Geometry(base_mm=unit_mm * CONFIG.geometry.base_mm, unit_mm=unit_mm),
        free=Free(far_mm=8000.0),
    )
    recording = take("far", 96, CONFIG).lines
    tables = {engine: run(engine, recording, large) for engine in Engine}
    small = run(Engine.FIXED, recording, CONFIG)
    got = tables[Engine.FIXED]
    assert small.located.sum() > 30
    for name in ("x_mm", "z_mm", "sigma_z_mm"):
        assert np.array_equal(getattr(got, name), unit_mm * getattr(small, name))
    assert got.free_to_mm.max(initial=0.0) <= 8000.0
    assert csv_rows(tables[Engine.RTL]) == csv_rows(got)
    ideal = run(Engine.IDEAL, recording, CONFIG)
    assert tables[Engine.IDEAL].z_mm == pytest.approx(unit_mm * ideal.z_mm, rel=1e-12)
    assert small.z_mm.max() > 512.0 and got.located.sum() == small.located.sum()


@pytest.mark.parametrize("config", MODES.values(), ids=MODES)
@pytest.mark.parametrize("engine", Engine)
def test_points_do_not_depend_on_the_blocks(engine: Engine, config: Config) -> None:
    recording = ugly(100, config)  # a fit depends on 62 lines before its own
    whole = whole_rows(engine, recording, config)
    every = ([1, 64, 3], [1], [7], [99], [1000])
    for sizes in every if config.source == "defaults" else every[:1]:  # others by few starts
        assert rows_in_blocks(engine, recording, config, sizes) == whole, sizes


@EACH_SCANNER
@pytest.mark.parametrize("engine", Engine)
def test_points_do_not_depend_on_the_processes(engine: Engine, config: Config) -> None:
    recording = ugly(150, config)
    whole = whole_rows(engine, recording, config)
    assert rows_in_blocks(engine, recording, config, [1, 40], jobs=3) == whole


def test_few_lines_are_not_worth_a_process() -> None:
    for engine in Engine:
        assert processes(engine, 300, 0) == 1
        assert processes(engine, 10**9, 0) == processors()
        assert processes(engine, 10**9, 5) == 5
        assert processes(engine, 2 * BLOCK, 5) == 2  # no more than blocks


def _slowly(number: int) -> tuple[int, int]:
    time.sleep(0.02)
    return number, os.getpid()


def _fails_at_seven(number: int) -> int:
    if number == 7:
        raise InputError("the eighth of them")
    return number


def _dies_at_seven(number: int) -> int:
    if number == 7:
        os.kill(os.getpid(), signal.SIGKILL)
    return number


def alive(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    return True


@pytest.mark.parametrize("jobs", [1, 2, 3])
def test_results_come_in_order_and_few_are_in_flight(jobs: int) -> None:
    taken: list[int] = []

    def items() -> Iterator[int]:
        for number in range(60):
            taken.append(number)
            yield number

    seen: set[int] = set()
    with workers(_slowly, jobs) as do:
        for want, (number, process) in enumerate(do(items())):
            assert number == want
            if want == 5:
                time.sleep(0.3)  # whoever takes the results may be slow
            assert len(taken) <= want + 2 * jobs
            seen.add(process)
    assert len(taken) == 60
    assert len(seen) <= jobs
    if jobs > 1:
        assert os.getpid() not in seen
        assert not any(alive(process) for process in seen)


@pytest.mark.parametrize("jobs", [1, 2])
def test_what_goes_wrong_in_a_process_arrives_as_it_is(jobs: int) -> None:
    found: list[int] = []
    with workers(_fails_at_seven, jobs) as do:
        results = do(range(20))
        found.extend(next(results) for _ in range(7))
        with pytest.raises(InputError, match=r"^the eighth of them$"):
            next(results)
    assert found == list(range(7))


def test_a_killed_process_is_an_error_and_no_hang() -> None:
    with pytest.raises(InputError, match="process was killed"), workers(_dies_at_seven, 2) as do:
        list(do(range(1000)))


def test_whoever_stops_early_leaves_no_process() -> None:
    with workers(_slowly, 2) as do:
        results = do(range(10**9))
        seen = {next(results)[1] for _ in range(6)}
        assert any(alive(process) for process in seen)
    assert not any(alive(process) for process in seen)


ORPHANS = """
import os, signal
from vrscan.data.parallel import workers
def large(number): return os.getpid(), bytes(10**7)  # more than a pipe holds
with workers(large, 2) as do:
    results = do(range(1000))
    print(*{next(results)[0] for _ in range(9)}, flush=True)
    os.kill(os.getpid(), signal.SIGKILL)
"""


def test_processes_whose_results_nobody_takes_end() -> None:
    done = subprocess.run([sys.executable, "-c", ORPHANS], stdout=subprocess.PIPE, text=True)
    assert done.returncode == -signal.SIGKILL
    left = [int(process) for process in done.stdout.split()]
    assert left
    deadline = time.monotonic() + 10
    while any(alive(process) for process in left) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not [process for process in left if alive(process)]


PEAK = """
from pathlib import Path
from vrscan.cli import app as cli
try:
    cli.main()
finally:
    # Not getrusage: that begins with the memory of the process that started this one.
    status = Path("/proc/self/status").read_text()
    print("peak", status.split("VmHWM:")[1].split()[0])
"""


def peak_bytes(folder: Path, *arguments: str) -> int:
    """Return the largest memory that a command had."""
    done = subprocess.run(
        [sys.executable, "-c", PEAK, *arguments],
        env=os.environ | {"PYTHONPATH": str(repository_root() / "model")},
        cwd=folder,
        capture_output=True,
        text=True,
        check=True,
    )
    return 1024 * int(done.stdout.split("peak")[-1])


FEW, MANY = 4 * BLOCK, 14 * BLOCK  # an engine holds the blocks before and behind one, too
ROOM = 0.25 * (MANY - FEW) * 2 * CONFIG.sensor.line_length  # bytes; all pixels are four times that


def test_a_scan_of_more_lines_takes_no_more_memory(tmp_path: Path) -> None:
    arguments = ["--engine", "ideal", "--fidelity", "minimal", "--jobs", "1", "--keep-lines"]
    few, many = (
        peak_bytes(tmp_path, "scan", "--out", f"out{n}", "--lines", str(n), *arguments)
        for n in (FEW, MANY)
    )
    assert many - few < ROOM, (few, many)
    assert recordings.read(tmp_path / f"out{MANY}" / "lines.mcap").rows == {"lines": MANY}


@pytest.mark.parametrize("suffix", [".npy", ".npz", ".mcap"])
def test_a_replay_of_more_lines_takes_no_more_memory(tmp_path: Path, suffix: str) -> None:
    peaks = []
    for count in (FEW, MANY):
        lines = np.full((count, CONFIG.sensor.line_length), 60, np.uint16)
        path = tmp_path / f"lines{count}{suffix}"
        if suffix == ".npy":
            np.save(path, lines)
        elif suffix == ".mcap":
            with recordings.Writer(path, CONFIG) as into:
                into.lines(Lines(lines, np.zeros(count), np.zeros(count, np.int64)))
        else:
            np.savez_compressed(path, lines=lines)
        arguments = ["--engine", "ideal", "--jobs", "1", "--out", "points.csv"]
        peaks.append(peak_bytes(tmp_path, "replay", str(path), *arguments))
    assert peaks[1] - peaks[0] < ROOM, peaks
