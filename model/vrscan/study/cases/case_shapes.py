"""Lines of the catalogue from their parts: a background, spots, boxes.

A spot replaces the background where it is half a count or more, so the contents of the window are
exactly those that the entry states.
"""

import numpy as np

from vrscan.data.arrays import Floats, Pixels
from vrscan.data.config import Peak
from vrscan.study.cases.case_line import Line

LENGTH, FULL = 2048, 4095
LEVEL = 60  # counts: mean of the background, which goes up and down by one: its noise is 1
SEED = 20100301
ANY_WIDTH = Peak(max_core=255)  # of a window that stands for narrower ones


def background(length: int = LENGTH, level: int = LEVEL, ripple: int = 1) -> Floats:
    """Return a background [length] of mean ``level`` and deviation ``ripple``, counts."""
    return level + ripple * np.where(np.arange(length) % 2 == 0, 1.0, -1.0)


def gauss(length: int, centre: float, sigma: float, height: float) -> Floats:
    """Return a Gaussian spot [length], counts; symmetric about its centre to the last bit."""
    return np.asarray(height * np.exp(-((np.arange(length) - centre) ** 2) / (2.0 * sigma**2)))


def with_spots(
    base: Floats, *spots: tuple[float, float, float], level: float = LEVEL, full: int = FULL
) -> Pixels:
    """Return the counts [length] of spots on a background.

    Args:
        base: Background [length].
        spots: Centre in px, sigma in px and height in counts of each.
        level: Level on which the spots stand; the ripple of ``base`` ends where they begin.
        full: Largest pixel.
    """
    light = sum(gauss(len(base), *spot) for spot in spots)
    light = np.floor(np.asarray(light) + 0.5)
    return clipped(np.where(light > 0, level + light, base), full)


def clipped(values: Floats, full: int = FULL) -> Pixels:
    """Return values as pixels: rounded to nearest, and limited to 0 .. ``full``."""
    return np.clip(np.floor(values + 0.5), 0, full).astype(np.uint16)


def box(base: Floats, left: int, heights: Floats | list[int], full: int = FULL) -> Pixels:
    """Return a background whose pixels from ``left`` on are replaced, counts."""
    line = base.copy()
    line[left : left + len(heights)] = heights
    return clipped(line, full)


def reach(sigma: float, cut: float = 0.02) -> int:
    """Return the distance from its centre up to which a spot is above ``cut`` of its height, px."""
    return int(np.floor(sigma * np.sqrt(-2.0 * np.log(cut))))


def spot(
    centre: float,
    sigma: float = 3.0,
    height: float = 3000.0,
    *,
    flags: str = "",
    at_one: str | None = None,
    mixed: bool = False,
    true: float | None = None,
    window: tuple[int, int] | None = None,
    base: Floats | None = None,
    level: float = LEVEL,
    full: int = FULL,
) -> Line:
    """Return a line with one spot; ``flags`` and ``at_one`` are names separated by blanks."""
    ground = background() if base is None else base
    return Line(
        pixels=with_spots(ground, (centre, sigma, height), level=level, full=full),
        flags=frozenset(flags.split()),
        at_one=None if at_one is None else frozenset(at_one.split()),
        mixed=mixed,
        true=centre if true is None else true,
        window=window,
    )


def line(
    pixels: Pixels,
    flags: str | None = "",
    *,
    at_one: str | None = None,
    mixed: bool = False,
    true: float | None = None,
    window: tuple[int, int] | None = None,
    position: float | None = None,
) -> Line:
    """Return a line of given pixels; flags are names separated by blanks, None for any."""
    names, others = (None if some is None else frozenset(some.split()) for some in (flags, at_one))
    return Line(pixels, names, others, mixed, true=true, window=window, position=position)


def generator(salt: int) -> np.random.Generator:
    """Return a seeded generator."""
    return np.random.default_rng([SEED, salt])
