"""The three engines behind one call: the RTL, its bit-accurate model and the float equations."""

import contextlib
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Generic, TypeVar

import numpy as np

from vrscan.data.config import Config
from vrscan.data.contract import checked
from vrscan.data.lines import Lines
from vrscan.data.parallel import processors, workers
from vrscan.data.points import table
from vrscan.data.table import Table
from vrscan.ideal import chain as ideal
from vrscan.registers.chain_registers import Registers, angle_turns

BLOCK = 1024  # lines that go to a process together: 4 MB, and a second of the RTL

T = TypeVar("T")


class Engine(StrEnum):
    """Who turns lines into points."""

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
        engine: Who computes it.
        recording: n lines; none give an empty table.
        config: Thresholds and geometry.
        progress: Called with the number of lines done so far.

    Raises:
        InputError: if the configuration does not fit in the registers, or ``contract.checked``
            refuses the lines: the same ones for every engine, with the same text.
    """
    registers = Registers.from_config(config)  # checks the configuration for every engine alike
    recording = checked(recording, config, pixels=False)  # each engine reads the pixels itself
    lines, power, raised = recording.lines, recording.power, recording.mirror_flags
    if engine is Engine.IDEAL:
        return ideal.run(lines, recording.angle_rad, power, config, progress, mirror_flags=raised)
    angle = angle_turns(recording.angle_rad)
    # Imported here, because the RTL engine needs a compiler and the others do not.
    if engine is Engine.FIXED:
        from vrscan.fixed.vrscan_chain import run_fixed

        return table(run_fixed(lines, angle, power, registers, progress, mirror_flags=raised))
    from vrscan.engines.chain_engine import run_rtl

    return table(run_rtl(lines, angle, power, registers, progress, mirror_flags=raised))


def processes(engine: Engine, count: int, jobs: int) -> int:
    """Return how many processes work on lines.

    Args:
        engine: Who computes their points.
        count: Lines.
        jobs: As asked for; 0 is one for each processor, or fewer for few lines.
    """
    most = min(processors(), count // _WORTH[engine]) if jobs == 0 else jobs
    return max(1, min(most, -(-count // BLOCK)))


def run_block(engine: Engine, recording: Lines, config: Config, first: int) -> Table:
    """Return the points of lines that begin at number ``first`` of a recording.

    The chain keeps nothing of a line but how many there were, so the points are the same in blocks
    of any size.
    """
    found = run(engine, recording, config)
    return replace(found, line=found.line + first)


@dataclass(frozen=True)
class _Work(Generic[T]):
    """The work of a process that takes lines from anywhere in a recording."""

    engine: Engine
    config: Config
    then: Callable[[Table], T]  # done to the points

    def __call__(self, given: tuple[int, Lines]) -> tuple[int, T]:
        """Return the number behind the last line, and what comes of the points.

        Args:
            given: The number of the first line, and the lines.
        """
        first, recording = given
        points = run_block(self.engine, recording, self.config, first)
        return first + len(recording), self.then(points)


@contextlib.contextmanager
def streamed(
    engine: Engine,
    blocks: Iterable[Lines],
    config: Config,
    then: Callable[[Table], T],
    jobs: int = 1,
) -> Iterator[Iterator[tuple[int, T]]]:
    """Run an engine on any number of lines, of which only some blocks are in memory.

    Args:
        engine: Who computes the points; ``prepare`` has been called.
        blocks: The lines, in their order; how many are in one does not matter to the points.
        config: Thresholds and geometry.
        then: Done to each block's points, by the process that computed them.
        jobs: Processes; see ``processes``.

    Yields:
        An iterator over the blocks: lines done so far, and what ``then`` returned.

    Raises:
        InputError: as ``run`` and ``parallel.workers``, and whatever ``blocks`` raises.
    """

    def numbered() -> Iterator[tuple[int, Lines]]:
        first = 0
        for block in blocks:
            yield first, block
            first += len(block)

    with workers(_Work(engine, config, then), jobs) as do:
        yield do(numbered())


def prepare(engine: Engine, config: Config) -> None:
    """Build what an engine needs, here and once, so that its messages come before any other.

    Raises:
        InputError: if it cannot be built, or the configuration does not fit in the registers.
    """
    nothing = np.zeros((0, config.sensor.line_length), np.uint16)
    run(engine, Lines(nothing, np.zeros(0), np.zeros(0, np.int64)), config)
