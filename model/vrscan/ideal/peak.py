"""Threshold and window: where the peak is, and whether it is a peak."""

from dataclasses import dataclass

import numpy as np

from vrscan.data.arrays import Bools, Floats, Ints, Pixels
from vrscan.ideal.statistics import Statistics

MOST_LIFT = 0.5  # share of the height to which the row's deviation lifts the threshold
LEAST_NOISE, DARK_NOISE = 5 / 16, 1.0  # counts, that of the converter's steps; without any light
FAINTEST = 2.0**-12  # counts, least background that is told from none
MOST_RAISED = 15  # powers of two by which clipping may hide the noise
CORE_HEIGHT = 0.25  # share of the height above which other runs are rivals
MOST_RIVALS = 2  # narrow rivals of a clear spot
EVEN = 17 / 16  # spread over noise up to which a row is even
MOST_GAP = 4  # px between the parts of a spot that speckle breaks up; a fit joins them


@dataclass(frozen=True)
class Windows:
    """The runs above the threshold in n lines; all arrays [n]."""

    left: Ints  # first pixel
    right: Ints  # last pixel; left - 1 without a run
    width: Ints  # px
    pixels: Ints  # number of those above the threshold, all of the width but gaps
    pair: Bools  # whether two of them are side by side
    rivals: Ints  # number of other runs, with a part of at least min_width px
    narrow_rivals: Ints  # of these, those of at most max_width pixels above the threshold


def threshold(
    background: Floats, noise: Floats, maximum: Ints, *, k_noise: float, k_height: float
) -> Floats:
    """Return the level above which a pixel belongs to a peak, in counts [n].

    VR-SCAN cuts at the noise alone (section IV-G 1, ``k_height`` = 0). The relative term keeps the
    cut at one place of a skewed spot while laser power and reflectance change.

    Args:
        background: Mean of the background, counts [n].
        noise: What the background's deviation is taken to be, counts [n].
        maximum: Largest pixel, counts [n].
        k_noise: Threshold above background in standard deviations.
        k_height: Threshold above background in heights of the peak.
    """
    height = np.maximum(maximum - background, 0.0)
    return background + np.maximum(k_noise * noise, k_height * height)


def unclipped(noise: Floats, background: Floats) -> Floats:
    """Return the noise of a sensor whose black is clipped, counts [n].

    Only the tail of the noise is above black then, and of a Gaussian's tail sigma is about 1.4
    times the variance over the mean. Where the noise is larger than the background, in half powers
    of two, it is multiplied by their ratio and 1.4 (3/2 stands for an odd half). It is 5/16 of a
    count at least, a little above the steps' sqrt(1/12), and a count where all of the background is
    0 and tells nothing.

    Args:
        noise: Standard deviation of the background, counts [n].
        background: Mean of the background, counts [n].
    """
    parts = [np.frexp(np.maximum(each, FAINTEST)) for each in (noise, background)]
    halves = [2 * bits + (mantissa >= 0.75) for mantissa, bits in parts]
    raise_by = halves[0] - halves[1]
    raise_by = np.where(raise_by > 0, np.minimum(raise_by + 1, 2 * MOST_RAISED + 1), 0)
    raised = np.ldexp(np.where(raise_by & 1, 1.5, 1.0) * noise, raise_by >> 1)
    least = np.where(background == 0.0, DARK_NOISE, LEAST_NOISE)
    told: Floats = np.maximum(raised, least)
    return told


def cut(row: Statistics, *, k_noise: float, k_height: float, limited: bool) -> Floats:
    """Return the level above which the window of each line is, in counts [n].

    It has to lie above what the row's background reaches, so it takes the spread.

    Args:
        row: The lines' statistics.
        k_noise: Threshold above background in spreads.
        k_height: Threshold above background in heights of the peak.
        limited: Whether the spread lifts the threshold by ``MOST_LIFT`` of the height at most.
    """
    rise = k_noise * row.spread
    if limited:
        rise = np.minimum(rise, MOST_LIFT * (row.maximum - row.background))
    return threshold(row.background, rise, row.maximum, k_noise=1.0, k_height=k_height)


def isolate(
    lines: Pixels,
    first_maximum: Ints,
    level: Floats,
    *,
    min_width: int,
    max_width: int = 255,
    gap: int = 0,
) -> Windows:
    """Return the run of pixels strictly above ``level`` that holds the maximum.

    Out of focus, coarse speckle breaks a spot up. A closing joins its parts (Serra, Image Analysis
    and Mathematical Morphology, 1982).

    Args:
        lines: Counts [n, length].
        first_maximum: Index of the first maximum, px [n].
        level: Threshold, counts [n].
        min_width: Shortest part of another run that counts, px.
        max_width: Most pixels of one that counts as narrow.
        gap: Most pixels that are not above the level between two parts of a run.

    Returns:
        The windows; width 0 where not even the maximum is above the threshold.
    """
    length = lines.shape[1]
    above = joined = lines > level[:, None]
    if gap:
        wide = np.pad(above, ((0, 0), (gap, gap)))  # beyond the line there is nothing to join
        dilated = np.logical_or.reduce([wide[:, k : k + length + gap] for k in range(gap + 1)])
        joined = np.logical_and.reduce([dilated[:, k : k + length] for k in range(gap + 1)])
    index = np.arange(length, dtype=np.int32)
    centre = first_maximum[:, None]
    left = np.where(~joined & (index <= centre), index, -1).max(axis=1).astype(np.int64) + 1
    right = np.where(~joined & (index >= centre), index, length).min(axis=1).astype(np.int64) - 1
    inside = above[np.arange(len(lines)), first_maximum]
    width = np.where(inside, right - left + 1, 0)
    left = np.where(inside, left, first_maximum)
    right = left + width - 1

    others = joined & ((index < left[:, None]) | (index > right[:, None]))
    beside = np.pad(others, ((0, 0), (1, 1)))
    begins = np.flatnonzero(others & ~beside[:, :-2])
    ends = np.flatnonzero(others & ~beside[:, 2:])
    before = np.zeros((len(lines), length + 1), np.int32)
    np.cumsum(above, axis=1, out=before[:, 1:])
    whole = np.zeros_like(others)  # where a part of at least min_width ends
    whole[:, min_width - 1 :] = before[:, min_width:] - before[:, :-min_width] == min_width
    rival = np.zeros(len(begins), np.bool_)
    rival[np.searchsorted(begins, np.flatnonzero(whole & others), side="right") - 1] = True
    rows, first = np.divmod(begins, length)
    narrow = rival & (before[rows, ends % length + 1] - before[rows, first] <= max_width)
    rivals, narrow_rivals = (
        np.bincount(rows[each], minlength=len(lines)) for each in (rival, narrow)
    )
    own = above & ~others
    return Windows(
        left=left,
        right=right,
        width=width,
        pixels=own.sum(axis=1),
        pair=np.asarray((own[:, 1:] & own[:, :-1]).any(axis=1)),
        rivals=rivals,
        narrow_rivals=narrow_rivals,
    )


def clear(core: Windows, *, max_core: int) -> Bools:
    """Return which lines have a spot that its surroundings cannot be taken for.

    At most ``max_core`` of its pixels are above ``CORE_HEIGHT``, and at most ``MOST_RIVALS`` others
    like it are on the line. Textures, edges and lamps are wider or many.

    Args:
        core: The runs above ``CORE_HEIGHT`` of the height.
        max_core: Most pixels of a spot there; of a narrow run in ``core``, too.
    """
    return np.asarray((core.pixels <= max_core) & (core.narrow_rivals <= MOST_RIVALS))
