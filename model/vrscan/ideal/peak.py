"""Threshold and window: where the peak is, and whether it is a peak."""

from dataclasses import dataclass

import numpy as np

from vrscan.data.arrays import Bools, Floats, Ints, Pixels
from vrscan.ideal.statistics import Statistics

MOST_LIFT = 0.5  # share of the height to which the row's deviation lifts the threshold
CORE_HEIGHT = 0.25  # share of the height above which other runs are rivals
MOST_RIVALS = 2  # narrow rivals of a clear spot


@dataclass(frozen=True)
class Windows:
    """The runs above the threshold in n lines; all arrays [n]."""

    left: Ints  # first pixel
    right: Ints  # last pixel; left - 1 without a run
    width: Ints  # px
    rivals: Ints  # number of other runs, at least min_width wide
    narrow_rivals: Ints  # of these, those of at most max_width


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
    lines: Pixels, first_maximum: Ints, level: Floats, *, min_width: int, max_width: int = 255
) -> Windows:
    """Return the run of pixels strictly above ``level`` that holds the maximum.

    Args:
        lines: Counts [n, length].
        first_maximum: Index of the first maximum, px [n].
        level: Threshold, counts [n].
        min_width: Shortest other run that counts, px.
        max_width: Longest other run that counts as narrow, px.

    Returns:
        The windows; width 0 where not even the maximum is above the threshold.
    """
    length = lines.shape[1]
    above = lines > level[:, None]
    index = np.arange(length, dtype=np.int32)
    centre = first_maximum[:, None]
    left = np.where(~above & (index <= centre), index, -1).max(axis=1).astype(np.int64) + 1
    right = np.where(~above & (index >= centre), index, length).min(axis=1).astype(np.int64) - 1
    inside = above[np.arange(len(lines)), first_maximum]
    width = np.where(inside, right - left + 1, 0)
    left = np.where(inside, left, first_maximum)
    right = left + width - 1

    others = above & ((index < left[:, None]) | (index > right[:, None]))
    before = np.zeros((len(lines), length + 1), np.int32)
    np.cumsum(others, axis=1, out=before[:, 1:])
    begins = others.copy()
    begins[:, 1:] &= ~others[:, :-1]

    def as_wide_as(least: int) -> Ints:
        whole = before[:, least:] - before[:, :-least] == least
        return np.asarray((whole & begins[:, : whole.shape[1]]).sum(axis=1))

    rivals = as_wide_as(min_width)
    narrow = np.maximum(rivals - as_wide_as(max_width + 1), 0)
    return Windows(left=left, right=right, width=width, rivals=rivals, narrow_rivals=narrow)


def clear(core: Windows, *, max_core: int) -> Bools:
    """Return which lines have a spot that its surroundings cannot be taken for.

    It is at most ``max_core`` wide at ``CORE_HEIGHT``, and at most ``MOST_RIVALS`` others like it
    are on the line. Textures, edges and lamps are wider or many.

    Args:
        core: The runs above ``CORE_HEIGHT`` of the height.
        max_core: Largest width of a spot there, px; that of a narrow run in ``core``, too.
    """
    return np.asarray((core.width <= max_core) & (core.narrow_rivals <= MOST_RIVALS))
