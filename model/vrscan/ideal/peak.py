"""Threshold and window: where the peak is, and whether it is a peak."""

from dataclasses import dataclass

import numpy as np

from vrscan.data.arrays import Bools, Floats, Ints, Pixels


@dataclass(frozen=True)
class Windows:
    """The runs above the threshold in n lines; all arrays [n]."""

    left: Ints  # first pixel
    right: Ints  # last pixel; left - 1 without a run
    width: Ints  # px
    rival: Bools  # another run, at least min_width wide


def threshold(
    background: Floats, noise: Floats, maximum: Ints, *, k_noise: float, k_height: float
) -> Floats:
    """Return the level above which a pixel belongs to a peak, in counts [n].

    VR-SCAN cuts at the noise alone (section IV-G 1, ``k_height`` = 0). The relative term keeps the
    cut at one place of a skewed spot while laser power and reflectance change.

    Args:
        background: Mean of the background, counts [n].
        noise: Standard deviation of the background, counts [n].
        maximum: Largest pixel, counts [n].
        k_noise: Threshold above background in standard deviations.
        k_height: Threshold above background in heights of the peak.
    """
    height = np.maximum(maximum - background, 0.0)
    return background + np.maximum(k_noise * noise, k_height * height)


def isolate(lines: Pixels, first_maximum: Ints, level: Floats, *, min_width: int) -> Windows:
    """Return the run of pixels strictly above ``level`` that holds the maximum.

    Args:
        lines: Counts [n, length].
        first_maximum: Index of the first maximum, px [n].
        level: Threshold, counts [n].
        min_width: Shortest other run that counts as a rival, px.

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
    run = np.zeros((len(lines), length + 1), np.int32)
    np.cumsum(others, axis=1, out=run[:, 1:])
    rival = (run[:, min_width:] - run[:, :-min_width] == min_width).any(axis=1)
    return Windows(left=left, right=right, width=width, rival=rival)
