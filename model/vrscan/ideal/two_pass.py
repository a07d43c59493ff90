"""The second window of the accurate mode: its width suits the noise, and its baseline is level."""

from dataclasses import dataclass

import numpy as np

from vrscan.data.arrays import Floats, Ints, Pixels

# The window's width in spot sigmas depends on rho = dark variance / (kappa peak): where shot noise
# dominates, the flanks carry information; where dark noise dominates, they are noise. The steps are
# those of the best efficiency against the Cramer-Rao bound (``vrscan efficiency``), with one
# exception: from 10 % of full scale up the width hardly changes, because a skewed spot would move
# with its power.
RHO = (5 / 64, 5 / 16, 1.0)
WIDTHS = (6.75, 6.5, 5.5, 5.0)
LEAST_SHARE, LARGEST_SHARE = 0.1, 0.5  # sigma of the spot over the first window
GAP_SHIFT = 3  # an eighth of the window lies between it and the blocks
LARGEST_BLOCK = 16  # px
PAIRS = 4
BRIGHTER = 32.0  # standard deviations of a pixel: 4 of the difference of two blocks of 16
FEWEST = 3  # least number of pixels of a window


@dataclass(frozen=True)
class Windows:
    """Second windows of n lines; all arrays [n]."""

    left: Ints  # first pixel
    width: Ints  # px
    slope: Floats  # slope of the background, counts per px
    sigma: Floats  # sigma of the spot, px, from the first window


def harmonic_share(cut: Floats) -> Floats:
    """Return |P1| / sum for a Gaussian that a window of T = N cuts at +-``cut`` sigmas, [n]."""
    place = (np.arange(2000) + 0.5) / 1000.0 - 1.0
    profile = np.exp(-0.5 * np.square(cut[:, None] * place))
    return np.asarray((profile * np.cos(np.pi * place)).sum(axis=1) / profile.sum(axis=1))


_CUT = np.linspace(0.05, 8.0, 800)
_SHARE = harmonic_share(_CUT)
_BOX = float(np.interp(0.5 / LARGEST_SHARE, _CUT, _SHARE))  # a smaller share is a plateau's


def sigma_share(share: Floats) -> Floats:
    """Return sigma / N of the Gaussian whose window of N pixels has |P1| / sum = ``share``, [n].

    The share grows with the width of the cut, from 0 for a box to 1 for a single pixel's spike. The
    result is limited to LEAST_SHARE and LARGEST_SHARE.
    """
    cut = np.interp(share, _SHARE, _CUT)
    return np.clip(0.5 / cut, LEAST_SHARE, LARGEST_SHARE)


def relative_width(rho: Floats) -> Floats:
    """Return the window's width in spot sigmas [n] for dark variance over shot noise ``rho``."""
    return np.asarray(np.array(WIDTHS)[np.searchsorted(np.array(RHO), rho, side="left")])


def block(width: Ints) -> Ints:
    """Return the pixels of a block beside a window: the power of two below or at it, up to 16."""
    power = np.floor(np.log2(width)).astype(np.int64)
    return np.asarray(np.minimum(1 << power, LARGEST_BLOCK))


def baseline(lines: Pixels, left: Ints, width: Ints, noise: Floats) -> Floats:
    """Return the slope of the background beside each window, counts per px [n].

    It is taken from PAIRS blocks on either side, the first an eighth of the window away from it.
    Light is never negative, so of the pairs of blocks at equal distances the one with the least sum
    has no rival in it. Pairs that are brighter than it by more than the noise are left out, and so
    are those that the sensor's end cuts. The slope is the sum of the differences of the other pairs
    over the sum of their distances.

    Args:
        lines: Counts [n, length].
        left: First pixel of each window [n].
        width: Number of pixels of each window [n].
        noise: Standard deviation of the background, counts [n].

    Returns:
        The slopes; 0 where no pair is whole.
    """
    count, length = lines.shape
    row = np.arange(count)
    total = np.concatenate([np.zeros((count, 1)), np.cumsum(lines, axis=1)], axis=1)
    size, gap = block(width), width >> GAP_SHIFT
    sums, rises, distances = (np.zeros((count, PAIRS)) for _ in range(3))
    for k in range(PAIRS):
        near = gap + k * size
        first, last = left - near - size, left + width + near + size
        whole = (first >= 0) & (last <= length)
        first, last = np.where(whole, first, 0), np.where(whole, last, size)
        below = total[row, first + size] - total[row, first]
        above = total[row, last] - total[row, last - size]
        sums[:, k] = np.where(whole, above + below, np.inf)
        rises[:, k] = above - below
        distances[:, k] = width + 2 * near + size
    least = sums.min(axis=1)
    kept = np.isfinite(sums) & (sums - np.where(np.isfinite(least), least, 0.0)[:, None]
                                <= BRIGHTER * noise[:, None])  # fmt: skip
    span = (distances * kept).sum(axis=1)
    return np.where(span > 0, (rises * kept).sum(axis=1) / (size * np.maximum(span, 1)), 0.0)


def second_windows(
    lines: Pixels,
    *,
    left: Ints,
    width: Ints,
    position: Floats,
    share: Floats,
    rho: Floats,
    noise: Floats,
    max_window: int,
) -> Windows:
    """Return the second window of each line and the slope of the background beside it.

    The width is ``relative_width`` times sigma. The middle of the window is the first position, or
    the middle of the first window where that holds a plateau, whose phase is of no use. The line's
    end cuts the window.

    Args:
        lines: Counts [n, length].
        left: First pixel of the first window [n].
        width: Number of pixels of the first window [n].
        position: Position from the first window's first harmonic, px [n].
        share: |P1| over the sum of the first window's pixels above background [n].
        rho: Dark variance over kappa times the peak's height [n].
        noise: Standard deviation of the background, counts [n].
        max_window: Largest window, px.

    Returns:
        The windows. Where fewer than FEWEST pixels are left, the first window is returned.
    """
    sigma = width * sigma_share(share)
    box = share < _BOX
    position = np.where(box, left + (width - 1) / 2.0, position)
    wanted = np.floor(relative_width(rho) * sigma + 0.5).astype(np.int64)
    wanted = np.clip(wanted, FEWEST, max_window)
    begin = np.floor(position - (wanted - 1) / 2.0 + 0.5).astype(np.int64)
    end = np.minimum(begin + wanted - 1, lines.shape[1] - 1)
    begin = np.maximum(begin, 0)
    kept = end - begin + 1 >= FEWEST
    begin = np.where(kept, begin, left)
    count = np.where(kept, end - begin + 1, width)
    slope = baseline(lines, begin, count, noise)
    return Windows(left=begin, width=count, slope=slope, sigma=sigma)
