"""Lines per second of the engines, on one core and on all of them, and of recordings."""

import math
import os
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass

from rich.table import Table as RichTable

from vrscan.data.config import Config
from vrscan.data.lines import Lines, part
from vrscan.data.parallel import processors, workers
from vrscan.data.recordings import Writer
from vrscan.engines.engine import BLOCK, Engine, prepare, run
from vrscan.engines.tools import build_folder
from vrscan.scene.simulate import take
from vrscan.show.sheet import Column, Sheet, words

LINES = {Engine.RTL: 2_000, Engine.FIXED: 10_000, Engine.IDEAL: 10_000}  # lines measured
PAPER_LINES = 37_400.0  # lines/s of the paper's sensor
_WARM = 64  # lines before the measurement, for builds and imports
_LEAST_S = 1.0  # approximate time of a run on all cores
_BLOCK_S = 0.1  # time of a block, so that all cores end together
_TURNS = 4  # number of times that the lines are recorded
_NOISE = ["shot", "read"]  # effects that leave a packed recording large


@dataclass(frozen=True)
class Rate:
    """Lines per second of an engine."""

    engine: Engine
    lines: int  # number of lines measured on one core
    one: float  # rate on one core
    cores: int
    every: float  # rate on several cores together; NaN if not measured


@dataclass(frozen=True)
class _Again:
    """The work of a process: an engine on some of its lines, again and again."""

    engine: Engine
    recording: Lines
    config: Config

    def __call__(self, rows: slice) -> tuple[int, float]:
        """Return the number of the process, and the processor time that it took, s."""
        start = time.process_time()
        run(self.engine, part(self.recording, rows), self.config)
        return os.getpid(), time.process_time() - start


def measure(
    engine: Engine, config: Config, count: int | None = None, cores: int | None = None
) -> Rate:
    """Return the speed of an engine on lines of the default scene.

    The processors' time is used, so other programs on the machine do not count. On more cores than
    one, processes that already have the lines work on blocks of them at the same time, and share
    the memory as they do in a scan.

    Args:
        engine: The engine that is measured.
        config: The instrument.
        count: Number of lines; that of ``LINES`` if None.
        cores: Number of processes of the second measurement; one per processor if None, and none if
            1.

    Raises:
        InputError: if the engine cannot be built.
    """
    count = LINES[engine] if count is None else count
    cores = processors() if cores is None else cores
    prepare(engine, config)
    recording = take("default", count, config).lines
    run(engine, part(recording, slice(0, _WARM)), config)
    start = time.process_time()
    run(engine, recording, config)
    one = count / (time.process_time() - start)
    if cores == 1:
        return Rate(engine, count, one, 1, math.nan)
    size = min(max(round(_BLOCK_S * one), 1), BLOCK, count)
    blocks = [slice(first, first + size) for first in range(0, count - size + 1, size)]
    work = blocks * max(1, math.ceil(_LEAST_S * one * cores / (size * len(blocks))))
    with workers(_Again(engine, recording, config), cores) as do:
        ready: set[int] = set()
        while len(ready) < cores:
            ready.update(process for process, _ in do([slice(0, _WARM)] * 2 * cores))
        spent = [seconds for _, seconds in do(work)]
    every = cores * size * len(work) / sum(spent)
    return Rate(engine, count, one, cores, every)


@dataclass(frozen=True)
class Recorded:
    """What a recording of raw lines takes."""

    packed: bool
    rate: float  # lines/s until all is on the disk
    size: float  # bytes of a line


def recorded(config: Config, count: int) -> list[Recorded]:
    """Return how fast lines of the default scene, with their noise, are recorded.

    The time is that of a clock, because the disk has a part in it.

    Args:
        config: The instrument.
        count: Number of lines, each of which is written several times.
    """
    lines, found = take("default", count, config, _NOISE).lines, []
    for packed in (False, True):
        with tempfile.TemporaryFile(dir=build_folder()) as file:
            start = time.perf_counter()
            with Writer(file, config, packed=packed) as into:
                for _ in range(_TURNS):
                    into.lines(lines)
            file.flush()
            os.fsync(file.fileno())
            rate = _TURNS * count / (time.perf_counter() - start)
            found.append(Recorded(packed, rate, file.tell() / (_TURNS * count)))
    return found


def recorded_table(found: Sequence[Recorded]) -> RichTable:
    """Return the speeds of recordings as a table for the terminal."""
    columns: list[Column[Recorded]] = [
        words("recording", lambda each: "packed" if each.packed else "as they are"),
        Column("on the disk,", lambda each: each.rate, "{:.0f}", unit="lines/s"),
        Column("size,", lambda each: each.size, "{:.0f}", unit="bytes a line"),
    ]
    return Sheet(columns, found).terminal("Raw lines of the default scene, recorded")


def table(rates: Sequence[Rate]) -> RichTable:
    """Return the speeds, at least one, as a table for the terminal."""
    cores = rates[0].cores
    columns: list[Column[Rate]] = [
        words("engine", lambda rate: rate.engine.value),
        Column("one core,", lambda rate: rate.one, "{:.0f}", unit="lines/s"),
        Column(f"{cores} cores,", lambda rate: rate.every, "{:.0f}", unit="lines/s"),
        Column("times", lambda rate: rate.every / rate.one, "{:.2f}"),
    ]
    return Sheet(columns if cores > 1 else columns[:2], rates).terminal(
        "Lines of the default scene a second",
        f"the paper's sensor reads {PAPER_LINES:.0f} lines/s",
    )
