"""A simulated scan, block by block: light, points, files and errors, in constant memory.

A process simulates a block of lines and runs the engine on it, so pixels stay where they are made.
It returns the points, the bytes of the cloud and the sums of the errors, and the lines themselves
only where they are to be kept. What a block's points hide of the beams beside it is taken off here.
Where laser or lens follow the scene, one process makes the light, block after block, and the others
the points.
"""

import itertools
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from vrscan.data.arrays import Bools, Floats, Pixels
from vrscan.data.config import Config
from vrscan.data.lines import Lines, bare, joined, part
from vrscan.data.parallel import workers
from vrscan.data.points import ply_vertices
from vrscan.data.table import Table
from vrscan.engines import shadows
from vrscan.engines.engine import Engine, processes, reach, run_block
from vrscan.engines.loops import Controls, Looped, LoopedScan, Progress
from vrscan.scene.simulate import BLOCK, Around, Scanner
from vrscan.study.report.space_report import Space
from vrscan.study.report.tally import Tally
from vrscan.study.scan_store import PIECE, Piece, Store

assert BLOCK == shadows.BLOCK  # the blocks of the points are those of the lines

MOST_DRAWN = 30_000  # largest number of lines of a picture
LOOPS_HEADER = b"line,power,light_mw,lens_mm,lens_read_mm\n"
_JOINED = 64  # number of samples that are joined at a time
_STREAM = 0xD2A3  # stream of the random numbers that pick the samples


@dataclass(frozen=True)
class Sample:
    """Lines that represent a whole scan in its picture: all of them if they are few."""

    lines: Lines  # n lines without pixels
    points: Table
    y_mm: Floats  # position of the scanner [n]
    controls: Controls | None  # what laser and lens did, if they followed the scene

    @classmethod
    def joined(cls, parts: list["Sample"]) -> "Sample":
        """Return one sample of all lines of ``parts``, at least one."""
        return cls(
            lines=joined([each.lines for each in parts]),
            points=Table.joined([each.points for each in parts]),
            y_mm=np.concatenate([each.y_mm for each in parts]),
            controls=Controls.joined([each.controls for each in parts if each.controls]),
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
    controls: Controls | None  # what laser and lens did, if they followed the scene


def loops_rows(part: Part, config: Config) -> bytes:
    """Return what laser and lens did in a block's lines, as rows of loops.csv.

    Args:
        part: A part with controls.
        config: The laser's rating and the motor's steps.
    """
    done = part.controls
    assert done is not None
    per_mw = config.laser.rated_mw / config.laser.power_max
    step_mm = 1e-3 * config.focus.resolution_um
    columns = part.points.line, done.power, per_mw * done.light
    places = step_mm * done.lens, step_mm * done.known
    rows = zip(*(each.tolist() for each in (*columns, *places)), strict=True)
    return "".join(
        f"{line},{power},{light:.4f},{lens:.4f},{read:.4f}\n"
        for line, power, light, lens, read in rows
    ).encode()


def pixels_of(looped: LoopedScan, sample: Sample) -> Callable[[int], Pixels]:
    """Return the function that gives the counts of a sample's line by its number."""
    controls = sample.controls
    assert controls is not None

    def pixels(number: int) -> Pixels:
        row = int(np.searchsorted(sample.points.line, number))
        return looped.line(number, float(controls.light[row]), int(controls.lens[row]))

    return pixels


@dataclass(frozen=True)
class _Made:
    """A block whose light is made already."""

    around: Around
    controls: Controls


@dataclass(frozen=True)
class _Work:
    """The work of a process."""

    scanner: Scanner
    engine: Engine
    keep: bool

    def __call__(self, given: range | _Made) -> list[Part]:
        """Return the parts of some blocks, or of one whose light is made already."""
        if isinstance(given, _Made):
            return [self._part(given.around, given.controls)]
        around = self.scanner.around(given, *reach(self.scanner.light.belief))
        return [self._part(each, None) for each in around]

    def _part(self, given: Around, controls: Controls | None) -> Part:
        config, number = self.scanner.light.belief, given.number
        lines, y_mm = given.simulation.lines, given.simulation.timeline.y_mm
        truth = lines.truth
        assert truth is not None  # a simulation has a truth
        beside = given.before, given.behind
        points = run_block(self.engine, lines, config, number * BLOCK, *beside)
        rng = np.random.default_rng((self.scanner.light.scene.seed, _STREAM, number))
        drawn = rng.random(len(lines)) < MOST_DRAWN / self.scanner.count
        return Part(
            points=points,
            ply=ply_vertices(points),
            tally=Tally.of(points, truth),
            bare=bare(lines),
            y_mm=y_mm,
            drawn=drawn,
            lines=lines if self.keep else None,
            controls=controls,
        )


def scan(
    scanner: Scanner,
    engine: Engine,
    take: Callable[[Part], None],
    *,
    keep: bool = False,
    jobs: int = 1,
    progress: Callable[[int], None] | None = None,
    looped: LoopedScan | None = None,
    store: Store | None = None,
) -> tuple[Tally, Sample, Space]:
    """Scan a scene.

    Args:
        scanner: The scene, its effects, and the number of lines.
        engine: The engine that turns lines into points; ``engines.prepare`` has been called.
        take: Called with each block, in the order of its lines.
        keep: Whether blocks come with their lines.
        jobs: Number of processes, as for ``engines.processes``. The blocks do not depend on it.
        progress: Called with the number of lines done so far.
        looped: The same scan where laser or lens follow the scene.
        store: Where finished blocks are kept, and from where an interrupted scan goes on.

    Raises:
        InputError: as ``engines.run``, ``parallel.workers`` and ``Store``.
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
        parts = _parts(scanner, looped, store, do, jobs)
        # A block waits for the next one, whose surfaces may hide parts of its beams.
        for points in shadows.shaded(found(parts), scanner.light.belief):
            each = replace(waiting.popleft(), points=points)
            take(each)
            tally = each.tally if tally is None else tally + each.tally
            truth = each.bare.truth
            assert truth is not None
            seen = Space.of(points, truth)
            space = seen if space is None else space + seen
            drawn = each.drawn
            controls = None if each.controls is None else each.controls.of(drawn)
            sample = part(each.bare, drawn), points.of(drawn), each.y_mm[drawn], controls
            samples.append(Sample(*sample))
            if len(samples) == _JOINED:  # even a sample without lines takes memory
                samples = [Sample.joined(samples)]
            if progress is not None:
                progress(tally.lines)
    assert tally is not None and space is not None  # there is at least one line
    return tally, Sample.joined(samples), space


def _parts(
    scanner: Scanner,
    looped: LoopedScan | None,
    store: Store | None,
    do: Callable[[Iterator[range | _Made]], Iterator[list[Part]]],
    jobs: int,
) -> Iterator[Part]:
    """Yield the parts of a scan: those that the store has, and then new ones, which it gets."""
    first, states = 0, dict[int, Progress]()
    for piece in store.pieces() if store is not None else ():
        first += len(piece.parts)
        if looped is not None:
            looped.progress = piece.state
        yield from piece.parts
    items: Iterator[range | _Made] = iter(scanner.together(jobs, first))
    if looped is not None:
        items = _made(looped, states)
    fresh: list[Part] = []
    for number, each in enumerate(itertools.chain.from_iterable(do(items)), first):
        yield each
        if store is not None:
            fresh.append(each)
            if (number + 1) % PIECE == 0:
                store.add(number // PIECE, Piece(fresh, states.pop(number + 1, None)))
                fresh = []


def _made(looped: LoopedScan, states: dict[int, Progress]) -> Iterator[_Made]:
    """Yield blocks with the lines beside them, and note how the scan stood before each piece."""
    depth, behind = reach(looped.scanner.light.belief)
    before = looped.progress.before
    number = looped.progress.number
    blocks = itertools.chain(_noted(looped, states), [None])
    for block, following in itertools.pairwise(blocks):
        assert block is not None
        lines = block.simulation.lines
        least = part(following.simulation.lines, slice(0, behind)) if following else None
        around = Around(number, block.simulation, before, least if behind else None)
        yield _Made(around, block.controls)
        number += 1
        if depth:
            own = replace(part(lines, slice(-depth, None)), truth=None)
            both = own if before is None else joined([before, own])
            before = part(both, slice(-depth, None))


def _noted(looped: LoopedScan, states: dict[int, Progress]) -> Iterator[Looped]:
    """Yield the blocks of a scan; ``states`` gets where it stands between two pieces."""
    for block in looped.blocks():
        if looped.progress.number % PIECE == 0:
            states[looped.progress.number] = looped.progress
        yield block
