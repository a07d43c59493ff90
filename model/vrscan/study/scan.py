"""A simulated scan, block by block: light, points, files and errors, in constant memory.

A process simulates a block of lines and runs the engine on it, so pixels stay where they are made.
It returns the points, the bytes of the cloud and the sums of the errors, and the lines themselves
only where they are to be kept. What a block's points hide of the beams beside it is taken off here.
"""

from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from vrscan.data.arrays import Bools, Floats
from vrscan.data.lines import Lines, bare, joined, part
from vrscan.data.parallel import workers
from vrscan.data.points import ply_vertices
from vrscan.data.table import Table
from vrscan.engines import shadows
from vrscan.engines.engine import Engine, processes, reach, run_block
from vrscan.scene.simulate import BLOCK, Scanner
from vrscan.study.report.space_report import Space
from vrscan.study.report.tally import Tally

assert BLOCK == shadows.BLOCK  # the blocks of the points are those of the lines

MOST_DRAWN = 30_000  # largest number of lines of a picture
_JOINED = 64  # number of samples that are joined at a time
_STREAM = 0xD2A3  # stream of the random numbers that pick the samples


@dataclass(frozen=True)
class Sample:
    """Lines that represent a whole scan in its picture: all of them if they are few."""

    lines: Lines  # n lines without pixels
    points: Table
    y_mm: Floats  # position of the scanner [n]

    @classmethod
    def joined(cls, parts: list["Sample"]) -> "Sample":
        """Return one sample of all lines of ``parts``, at least one."""
        return cls(
            lines=joined([each.lines for each in parts]),
            points=Table.joined([each.points for each in parts]),
            y_mm=np.concatenate([each.y_mm for each in parts]),
        )


@dataclass(frozen=True)
class Part:
    """The results of one block of a scan."""

    points: Table
    ply: bytes  # result of ``ply_vertices``
    tally: Tally
    bare: Lines  # lines without pixels
    y_mm: Floats  # position of the scanner at each line
    drawn: Bools  # lines that are in the picture
    lines: Lines | None  # lines with their truth, if they are kept


@dataclass(frozen=True)
class _Work:
    """The work of a process."""

    scanner: Scanner
    engine: Engine
    keep: bool

    def __call__(self, number: int) -> Part:
        taken = self.scanner.part(number)
        lines, y_mm = taken.lines, taken.timeline.y_mm
        truth = lines.truth
        assert truth is not None  # a simulation has a truth
        config = self.scanner.light.config
        beside = self.scanner.beside(number, *reach(config))
        points = run_block(self.engine, lines, config, number * BLOCK, *beside)
        rng = np.random.default_rng((self.scanner.light.scene.seed, _STREAM, number))
        drawn = rng.random(len(lines)) < MOST_DRAWN / self.scanner.count
        return Part(
            points=points,
            ply=ply_vertices(points, y_mm),
            tally=Tally.of(points, truth),
            bare=bare(lines),
            y_mm=y_mm,
            drawn=drawn,
            lines=lines if self.keep else None,
        )


def scan(
    scanner: Scanner,
    engine: Engine,
    take: Callable[[Part], None],
    *,
    keep: bool = False,
    jobs: int = 1,
    progress: Callable[[int], None] | None = None,
) -> tuple[Tally, Sample, Space]:
    """Scan a scene.

    Args:
        scanner: The scene, its effects, and the number of lines.
        engine: The engine that turns lines into points; ``engines.prepare`` has been called.
        take: Called with each block, in the order of its lines.
        keep: Whether blocks come with their lines.
        jobs: Number of processes, as for ``engines.processes``. The blocks do not depend on it.
        progress: Called with the number of lines done so far.

    Raises:
        InputError: as ``engines.run`` and ``parallel.workers``.
    """
    jobs = processes(engine, scanner.count, jobs)
    tally: Tally | None = None
    space: Space | None = None
    samples: list[Sample] = []
    waiting: deque[Part] = deque()

    def found(parts: Iterator[Part]) -> Iterator[Table]:
        for each in parts:
            waiting.append(each)
            yield each.points

    with workers(_Work(scanner, engine, keep), jobs) as do:
        # A block waits for the next one, whose surfaces may hide parts of its beams.
        for points in shadows.shaded(found(do(range(scanner.blocks))), scanner.light.config):
            each = replace(waiting.popleft(), points=points)
            take(each)
            tally = each.tally if tally is None else tally + each.tally
            truth = each.bare.truth
            assert truth is not None
            seen = Space.of(points, truth)
            space = seen if space is None else space + seen
            drawn = each.drawn
            samples.append(Sample(part(each.bare, drawn), points.of(drawn), each.y_mm[drawn]))
            if len(samples) == _JOINED:  # even a sample without lines takes memory
                samples = [Sample.joined(samples)]
            if progress is not None:
                progress(tally.lines)
    assert tally is not None and space is not None  # there is at least one line
    return tally, Sample.joined(samples), space
