"""One interface to three engines: the RTL, its bit-accurate model and the float equations."""

import contextlib
import itertools
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np

from vrscan.data.config import Config
from vrscan.data.contract import checked
from vrscan.data.lines import Lines, joined, part
from vrscan.data.parallel import processors, workers
from vrscan.data.points import table
from vrscan.data.table import Table
from vrscan.engines.shadows import shaded
from vrscan.fixed import peak_fit
from vrscan.ideal import chain as ideal
from vrscan.registers.chain_registers import Registers, angle_turns
from vrscan.registers.map_table import map_table

BLOCK = 1024  # lines that go to a process together: 4 MB, one second in the RTL


class Engine(StrEnum):
    """The engine that turns lines into points."""

    RTL = "rtl"
    FIXED = "fixed"
    IDEAL = "ideal"


# Lines from which another process saves more time than its start takes, which is a second.
_WORTH = {Engine.RTL: 2048, Engine.FIXED: 32768, Engine.IDEAL: 32768}


def run(
    engine: Engine,
    recording: Lines,
    config: Config,
    progress: Callable[[int], None] | None = None,
) -> Table:
    """Return the point of each line.

    Args:
        engine: The engine that computes the points.
        recording: n lines; no lines give an empty table.
        config: Thresholds and geometry.
        progress: Called with the number of lines done so far.

    Raises:
        InputError: if the configuration does not fit in the registers, or ``contract.checked``
            refuses the lines: the same ones for every engine, with the same text.
    """
    registers = Registers.from_config(config)  # checks the configuration for every engine
    recording = checked(recording, config, pixels=False)  # each engine reads the pixels itself
    found = _points(engine, recording, config, registers, progress)
    # The engines need neither; they belong to the point all the same.
    time, y = np.asarray(recording.time_s), np.asarray(recording.y_mm)
    return replace(found, power=recording.power.astype(np.float64), time_s=time, y_mm=y)


def _points(
    engine: Engine,
    recording: Lines,
    config: Config,
    registers: Registers,
    progress: Callable[[int], None] | None,
) -> Table:
    """Return the point of each line of a checked recording."""
    lines, power, raised = recording.lines, recording.power, recording.mirror_flags
    lens = recording.lens
    if engine is Engine.IDEAL:
        own = lines, recording.angle_rad, power, config, progress
        return ideal.run(*own, mirror_flags=raised, lens=lens)
    given = lines, angle_turns(recording.angle_rad), power, registers, progress
    maps = map_table(config)
    # Imported here, because the RTL engine needs a compiler and the others do not.
    if engine is Engine.FIXED:
        from vrscan.fixed.vrscan_chain import run_fixed

        return table(run_fixed(*given, mirror_flags=raised, maps=maps, lens=lens))
    from vrscan.engines.chain_engine import run_rtl

    return table(run_rtl(*given, mirror_flags=raised, maps=maps, lens=lens))


def processes(engine: Engine, count: int, jobs: int) -> int:
    """Return the number of processes that work on lines.

    Args:
        engine: The engine that computes the points.
        count: Number of lines.
        jobs: Number that was asked for; 0 is one for each processor, or fewer for few lines.
    """
    most = min(processors(), count // _WORTH[engine]) if jobs == 0 else jobs
    return max(1, min(most, -(-count // BLOCK)))


def reach(config: Config) -> tuple[int, int]:
    """Return how many lines before and behind a line its point depends on.

    With a fit it has a neighbour on either side, and the speckle of each comes from those before.
    """
    return (peak_fit.REACH + 1, 1) if config.peak.fit else (0, 0)


def run_block(
    engine: Engine,
    recording: Lines,
    config: Config,
    first: int,
    before: Lines | None = None,
    behind: Lines | None = None,
) -> Table:
    """Return the points of lines that begin at number ``first`` of a recording.

    Args:
        engine: The engine that computes the points.
        recording: n lines.
        config: Thresholds and geometry.
        first: Number of the first line.
        before: The lines before them within ``reach``, or all that there are; with these and
            those behind the points are the same in blocks of any size.
        behind: The lines behind them within ``reach``, or all that there are.
    """
    skipped, count = 0 if before is None else len(before), len(recording)
    parts = [each for each in (before, recording, behind) if each is not None]
    if len(parts) > 1:
        recording = joined([replace(each, truth=None) for each in parts])
    found = run(engine, recording, config)
    if len(parts) > 1:
        number = np.arange(len(found)) - skipped
        found = found.of((number >= 0) & (number < count))
    return replace(found, line=found.line + (first - skipped))


@dataclass(frozen=True)
class _Work:
    """The work of a process that takes lines from anywhere in a recording."""

    engine: Engine
    config: Config

    def __call__(self, given: tuple[int, Lines, Lines | None, Lines | None]) -> Table:
        """Return the points of lines, given with the first one's number and the lines beside."""
        first, recording, before, behind = given
        return run_block(self.engine, recording, self.config, first, before, behind)


@contextlib.contextmanager
def streamed(
    engine: Engine, blocks: Iterable[Lines], config: Config, jobs: int = 1
) -> Iterator[Iterator[Table]]:
    """Run an engine on any number of lines, of which only some blocks are in memory.

    Args:
        engine: The engine that computes the points; ``prepare`` has been called.
        blocks: The lines, in their order; the size of a block does not change the points.
        config: Thresholds and geometry.
        jobs: Number of processes; see ``processes``.

    Yields:
        An iterator over the points in blocks of ``shadows.BLOCK`` lines, whose free intervals end
        where other lines' surfaces hide them.

    Raises:
        InputError: as ``run`` and ``parallel.workers``, and whatever ``blocks`` raises.
    """

    def numbered() -> Iterator[tuple[int, Lines, Lines | None, Lines | None]]:
        first, (depth, behind) = 0, reach(config)
        before: Lines | None = None
        whole = (block for block in blocks if len(block))
        for block, following in itertools.pairwise(itertools.chain(whole, [None])):
            assert block is not None
            most = None if following is None or not behind else part(following, slice(0, behind))
            yield first, block, before, most
            first += len(block)
            if depth:
                own = replace(part(block, slice(-depth, None)), truth=None)
                both = own if before is None else joined([before, own])
                before = part(both, slice(-depth, None))

    with workers(_Work(engine, config), jobs) as do:
        yield shaded(do(numbered()), config)


def prepare(engine: Engine, config: Config) -> None:
    """Build what an engine needs once, in this process, so that its messages come first.

    Raises:
        InputError: if it cannot be built, or the configuration does not fit in the registers.
    """
    nothing = np.zeros((0, config.sensor.line_length), np.uint16)
    run(engine, Lines(nothing, np.zeros(0), np.zeros(0, np.int64)), config)
