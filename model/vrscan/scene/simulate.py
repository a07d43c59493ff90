"""A scene's lines: with the effects that it needs, in blocks, on any number of processes."""

import itertools
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from vrscan.data.arrays import Ints, Pixels
from vrscan.data.config import Config
from vrscan.data.lines import Lines, bare, joined, part
from vrscan.data.parallel import processors, workers
from vrscan.scene.description import Description, load
from vrscan.scene.effects import chosen, present
from vrscan.scene.light import Light
from vrscan.scene.render import Frame, Renderer
from vrscan.scene.sensor import words
from vrscan.scene.timeline import Timeline, timeline

BLOCK = 1024  # lines of a block, which share its random numbers
TOGETHER = 4  # blocks that are made together: much of the time of a single one does not grow


@dataclass(frozen=True)
class Simulation:
    """A scan: its lines with truth, and the time and the angle of each."""

    lines: Lines
    timeline: Timeline


@dataclass(frozen=True)
class Around:
    """The lines of a block, with some of those before and behind it, None where there are none."""

    number: int
    simulation: Simulation
    before: Lines | None
    behind: Lines | None


class Scanner:
    """Source of the lines of a scan over a scene, in any order.

    A line is the same whichever of its neighbours are made with it: random numbers belong to a
    block of ``BLOCK`` lines, and blocks are always made whole.
    """

    def __init__(
        self,
        light: Light,
        count: int,
        active: frozenset[str],
        *,
        tolerance_px: float | None = None,
    ) -> None:
        """Prepare a scan.

        Args:
            light: The scene and the instrument.
            count: Number of lines of the scan.
            active: The effects that are on.
            tolerance_px: Largest error of a tangent plane, above which a spot is followed ray by
                ray; the scene's tolerance if None.
        """
        self.light, self.count = light, count
        self.renderer = Renderer(light, active, tolerance_px=tolerance_px)
        self._given = (light.scene, light.belief, count, active, tolerance_px)

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle the scanner as its arguments: rays cannot be pickled, and tables are long."""
        return _scanner, self._given

    @property
    def blocks(self) -> int:
        """Return the number of blocks of the scan."""
        return -(-self.count // BLOCK)

    def timeline(self, block: int) -> Timeline:
        """Return the timeline of a block, which is whole even if the scan ends in the block."""
        scene, config = self.light.scene, self.light.belief
        first = block * BLOCK
        # The angles of an even sweep depend on the number of lines: it ends with the scan.
        last = first + BLOCK if scene.scan.sweep == "mirror" else min(first + BLOCK, self.count)
        total = max(self.count, last)
        return timeline(
            first, last - first, total, config, scene.scan, scene.seed, scene.instrument
        )

    def block(self, number: int) -> Frame:
        """Return a block of lines."""
        when = self.timeline(number)
        return self.renderer.render(when, self.words(number)[: len(when)])

    def part(self, number: int) -> Simulation:
        """Return the lines of a block that belong to the scan."""
        return self.parts(range(number, number + 1))[0]

    def parts(self, blocks: range) -> list[Simulation]:
        """Return the lines of some blocks that belong to the scan, made together."""
        whens = [self.timeline(number) for number in blocks]
        noise = [self.words(k)[: len(when)] for k, when in zip(blocks, whens, strict=True)]
        frame = self.renderer.render(Timeline.joined(whens), np.concatenate(noise))
        lines, first, made = self.recorded(frame), 0, []
        for number, when in zip(blocks, whens, strict=True):
            count = min(len(when), self.count - number * BLOCK)
            own = part(lines, slice(first, first + count))
            made.append(Simulation(own, picked(when, slice(0, count))))
            first += len(when)
        return made

    def together(self, jobs: int, first: int = 0) -> list[range]:
        """Return the blocks from ``first`` on in groups that keep ``jobs`` processes busy."""
        left = self.blocks - first
        size = TOGETHER if jobs <= 1 else max(1, min(TOGETHER, left // (4 * jobs)))
        starts = range(first, self.blocks, size)
        return [range(k, min(k + size, self.blocks)) for k in starts]

    def around(self, blocks: range, before: int, behind: int) -> Iterator[Around]:
        """Yield what ``parts`` gives, with so many lines before and behind, at most ``BLOCK``."""
        made = self.parts(blocks)
        first, last = blocks.start * BLOCK, min(blocks.stop * BLOCK, self.count)
        numbers = (
            np.arange(max(first - before, 0), first),
            np.arange(last, min(last + behind, self.count)),
        )
        ends: list[Lines | None] = [None, None]
        if len(numbers[0]) or len(numbers[1]):
            lines, split = self.recorded(self.some(np.concatenate(numbers))), len(numbers[0])
            sides = part(lines, slice(0, split)), part(lines, slice(split, None))
            ends = [side if len(side) else None for side in sides]
        left = [part(each.lines, slice(-before, None)) if before else None for each in made]
        right = [part(each.lines, slice(0, behind)) if behind else None for each in made]
        yield from map(Around, blocks, made, [ends[0], *left[:-1]], [*right[1:], ends[1]])

    def recorded(self, frame: Frame) -> Lines:
        """Return the lines of a frame as a recording has them."""
        laser = self.light.config.laser
        level = self.light.scene.laser.power_mw / laser.rated_mw
        power = np.full(len(frame.lines), round(level * laser.power_max), np.int64)
        when = frame.timeline
        return Lines(frame.lines, frame.reported_rad, power, frame.truth, 0, when.time_s, when.y_mm)

    def given(self, numbers: Ints) -> tuple[Timeline, Pixels]:
        """Return the input of rendering for any lines, whatever the effects: timeline and words."""
        parts, noise = [], []
        order = np.argsort(numbers, kind="stable")
        rising = numbers[order]
        for block in np.unique(rising // BLOCK).tolist():
            rows = rising[rising // BLOCK == block] - block * BLOCK
            parts.append(picked(self.timeline(block), rows))
            noise.append(self.words(block, int(rows[-1]) + 1)[rows])
        place = np.argsort(order, kind="stable")
        return picked(Timeline.joined(parts), place), np.concatenate(noise)[place]

    def some(self, numbers: Ints) -> Frame:
        """Return any lines, equal to those in their blocks."""
        return self.renderer.render(*self.given(numbers))

    def line(self, number: int) -> Pixels:
        """Return the counts of one line [length]."""
        line: Pixels = self.some(np.array([number])).lines[0]
        return line

    @property
    def end_s(self) -> float:
        """Return the time at which the last line is taken, s."""
        return float(self.timeline(self.blocks - 1).time_s[(self.count - 1) % BLOCK])

    def words(self, block: int, lines: int = BLOCK) -> Pixels:
        """Return the random words of the first lines of a block."""
        return words(self.light.scene.seed, block, lines, self.light.config.sensor.line_length)


def picked(whole: Timeline, rows: Ints | slice) -> Timeline:
    """Return some lines of a timeline, with all its crossings."""
    return replace(
        whole,
        line=whole.line[rows],
        time_s=whole.time_s[rows],
        angle_rad=whole.angle_rad[rows],
        rate_rad_per_s=whole.rate_rad_per_s[rows],
        y_mm=whole.y_mm[rows],
        reported_rad=whole.reported_rad[rows],
    )


def simulate(
    light: Light,
    count: int,
    active: frozenset[str],
    *,
    tolerance_px: float | None = None,
    jobs: int = 1,
    progress: Callable[[int], None] | None = None,
) -> Simulation:
    """Return the lines of a scan.

    Args:
        light: The scene and the instrument.
        count: Number of lines, at least 1.
        active: The effects that are on.
        tolerance_px: Largest error of a tangent plane, above which a spot is followed ray by ray;
            the scene's tolerance if None.
        jobs: Number of processes; 0 is one for each processor. The lines do not depend on it.
        progress: Called with the number of lines done so far.
    """
    if count < 1:
        raise ValueError(f"simulate: count {count} is below 1")
    scanner = Scanner(light, count, active, tolerance_px=tolerance_px)
    counts = np.empty((count, light.config.sensor.line_length), np.uint16)  # may be gigabytes
    parts: list[Simulation] = []
    jobs = min(jobs or processors(), scanner.blocks)
    with workers(scanner.parts, jobs) as do:
        for made in itertools.chain.from_iterable(do(scanner.together(jobs))):
            first = len(parts) * BLOCK
            done = first + len(made.lines)
            counts[first:done] = made.lines.lines
            parts.append(replace(made, lines=bare(made.lines)))
            if progress is not None:
                progress(done)
    when = Timeline.joined([made.timeline for made in parts])
    # The last block was whole: crossings after the scan's end do not belong to the scan.
    inside = when.index_s <= when.time_s[-1] + 1.0 / light.config.line.rate_hz
    return Simulation(
        replace(joined([made.lines for made in parts]), lines=counts),
        replace(when, index_s=when.index_s[inside], index_outward=when.index_outward[inside]),
    )


def take(name: str, count: int, config: Config, effects: str | list[str] = "full") -> Simulation:
    """Return a scan of a scene by its name, with the given effects.

    Args:
        name: A shipped scene or a file.
        count: Number of lines.
        config: The instrument.
        effects: ``full``, ``minimal``, or names of effects.

    Raises:
        InputError: as ``description.load`` and ``Light``, or if an effect is unknown.
    """
    scene = load(name)
    if effects == "full":
        active = frozenset(present(scene))
    else:
        active = chosen([] if effects == "minimal" else list(effects), scene.source)
    return simulate(Light(scene, config), count, active)


def _scanner(
    scene: Description,
    config: Config,
    count: int,
    active: frozenset[str],
    tolerance_px: float | None,
) -> Scanner:
    light = Light(scene, config)
    return Scanner(light, count, active, tolerance_px=tolerance_px)
