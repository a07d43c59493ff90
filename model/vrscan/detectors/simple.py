"""Centroid, three points, and filters whose zero is the position.

All are surveyed by Fisher and Naidu, *A comparison of algorithms for subpixel peak detection*
(Image Technology, 1996): the centre of mass, the parabola, the Gaussian through three points and
the filter of Blais and Rioux. Offsets are px from the maximum.
"""

import numpy as np

from vrscan.data.arrays import Floats, Pixels
from vrscan.detectors.patch import REACH, Patch, columns, cut, place, run, shape

_LEAST_COUNT = 0.5  # pixels are raised to it before their logarithm is taken
_STEPS = 6  # Newton's steps; from the centroid of a noisy spot four are enough
_WITHIN = 0.75  # px between a pixel and its top; more than half, as noise moves what is between


def centroid(
    lines: Pixels, background: Floats, noise: Floats, *, k_noise: float, k_height: float
) -> Floats:
    """Return the centre of mass of the light above background in the run above a threshold [n], px.

    Args:
        lines: Counts [n, length].
        background: Mean of the background, counts [n].
        noise: Standard deviation of the background, counts [n].
        k_noise: Threshold above background over the noise.
        k_height: Threshold above background over the peak's height; the larger threshold is used.
    """
    patch = cut(lines, background, noise)
    mask = run(patch, np.maximum(k_noise * noise, k_height * patch.height))
    signal = np.where(mask, patch.signal, 0.0)
    area = signal.sum(axis=1)
    return place(patch, signal @ columns() / np.where(area > 0.0, area, np.nan))


def _smoothed(patch: Patch, width: int) -> Floats:
    """Return the mean of ``width`` (odd) pixels around each column; ends are 0."""
    if width == 1:
        return patch.signal
    half = width // 2
    total = np.cumsum(patch.signal, axis=1)
    total = np.concatenate([np.zeros((len(total), 1)), total], axis=1)
    mean = np.zeros_like(patch.signal)
    mean[:, half:-half] = (total[:, width:] - total[:, :-width]) / width
    return mean


def _three(patch: Patch, width: int) -> tuple[Floats, tuple[Floats, Floats, Floats]]:
    """Return the largest smoothed pixel's offset and the values left of it, there and right."""
    smooth = _smoothed(patch, width)
    near = max(width, 2)  # the largest mean lies within a filter of the largest pixel
    low, high = REACH - near, REACH + near + 1
    top = smooth[:, low:high].argmax(axis=1) + low
    rows = np.arange(len(smooth))
    values = smooth[rows, top - 1], smooth[rows, top], smooth[rows, top + 1]
    return (top - REACH).astype(np.float64), values


def _vertex(left: Floats, middle: Floats, right: Floats) -> Floats:
    """Return where the parabola through three values has its top; 0 where it has none."""
    bend = left - 2.0 * middle + right
    return np.where(bend < 0.0, 0.5 * (left - right) / np.where(bend < 0.0, bend, 1.0), 0.0)


def parabola(lines: Pixels, background: Floats, noise: Floats, *, width: int = 1) -> Floats:
    """Return the top of the parabola through the largest pixel and its neighbours [n], px.

    Fisher and Naidu 1996. A mean over ``width`` pixels goes before it.

    Args:
        lines: Counts [n, length].
        background: Mean of the background, counts [n].
        noise: Standard deviation of the background, counts [n].
        width: Width of the mean, px, odd; 1 means no mean.
    """
    patch = cut(lines, background, noise)
    top, (left, middle, right) = _three(patch, width)
    return place(patch, top + _vertex(left, middle, right))


def gaussian3(lines: Pixels, background: Floats, noise: Floats, *, width: int = 1) -> Floats:
    """Return the top of the Gaussian through the largest pixel and its neighbours [n], px.

    The parabola through the logarithms of what is above background, half a count at least (Fisher
    and Naidu 1996).

    Args:
        lines: Counts [n, length].
        background: Mean of the background, counts [n].
        noise: Standard deviation of the background, counts [n].
        width: Width of the mean before it, px, odd; 1 means no mean.
    """
    patch = cut(lines, background, noise)
    top, values = _three(patch, width)
    left, middle, right = (np.log(np.maximum(value, _LEAST_COUNT)) for value in values)
    return place(patch, top + _vertex(left, middle, right))


def blais_rioux(lines: Pixels, background: Floats, noise: Floats, *, order: int) -> Floats:
    """Return the zero of a derivative filter next to the largest pixel, by linear interpolation.

    g(i) = sum of the order / 2 pixels after i less that of as many before it (Blais and Rioux,
    *Real-time numerical peak detector*, Signal Processing 11, 1986). g falls through zero at the
    peak; of several such places the one nearest to the maximum counts.

    Args:
        lines: Counts [n, length].
        background: Mean of the background, counts [n].
        noise: Standard deviation of the background, counts [n].
        order: Number of pixels of the filter: 4 or 8 in the paper.
    """
    patch = cut(lines, background, noise)
    half = order // 2
    total = np.concatenate([np.zeros((len(lines), 1)), np.cumsum(patch.signal, axis=1)], axis=1)
    # Column c of g is pixel c + half of the patch.
    after = total[:, 2 * half + 1 :] - total[:, half + 1 : -half]
    before = total[:, half : -half - 1] - total[:, : -2 * half - 1]
    slope = after - before
    falls = (slope[:, :-1] > 0.0) & (slope[:, 1:] <= 0.0)
    middle = np.arange(falls.shape[1]) + half - REACH
    # Halfway between its two pixels, plus a hair, so that two equally near ones have an order.
    distance = np.where(falls, np.abs(middle + 0.5 + 1e-6), np.inf)
    chosen = distance.argmin(axis=1)
    rows = np.arange(len(lines))
    high, low = slope[rows, chosen], slope[rows, chosen + 1]
    there = np.isfinite(distance[rows, chosen])
    part = high / np.where(there, high - low, 1.0)
    return place(patch, np.where(there, middle[chosen] + part, np.nan))


def steger(lines: Pixels, background: Floats, noise: Floats, *, ratio: float) -> Floats:
    """Return the top of the smoothed light where it is bent most [n], px.

    The light is smoothed by a Gaussian and has the derivatives p' and p'' at each pixel, and so a
    top -p' / p'' from it. Of the pixels that have one near, that with the least p'' gives the
    position (C. Steger, *An unbiased detector of curvilinear structures*, IEEE PAMI 20, 1998). His
    least width of the Gaussian is half the line's width over sqrt(3).

    Args:
        lines: Counts [n, length].
        background: Mean of the background, counts [n].
        noise: Standard deviation of the background, counts [n].
        ratio: Width of the Gaussian over that of the peak, which is measured on each line.
    """
    patch = cut(lines, background, noise)
    width = ratio * shape(patch, noise).sigma[:, None]
    count = patch.signal.shape[1]
    turn = 2.0 * np.pi * np.fft.rfftfreq(2 * count)  # zeros behind the patch: its ends do not meet
    smooth = np.fft.rfft(patch.signal, 2 * count) * np.exp(-0.5 * np.square(turn * width))
    first, second = (
        np.fft.irfft(smooth * (1j * turn) ** order, 2 * count)[:, :count] for order in (1, 2)
    )
    falls = second < 0.0
    top = np.where(falls, -first / np.where(falls, second, 1.0), np.inf)
    bend = np.where(np.abs(top) <= _WITHIN, second, np.inf)
    chosen = bend.argmin(axis=1)
    rows = np.arange(len(lines))
    there = np.isfinite(bend[rows, chosen])
    return place(patch, np.where(there, columns()[chosen] + top[rows, chosen], np.nan))


def matched(
    lines: Pixels,
    background: Floats,
    noise: Floats,
    *,
    ratio: float = 1.0,
    sigma_px: float | None = None,
) -> Floats:
    """Return where the correlation with a Gaussian is largest [n], px.

    The matched filter of white noise (Turin, *An introduction to matched filters*, IRE Transactions
    on Information Theory 6, 1960) at any place, not only at whole pixels: the zero of
    sum p_i (i - x) exp(-(i - x)^2 / 2 w^2), by Newton's steps from the centroid.

    Args:
        lines: Counts [n, length].
        background: Mean of the background, counts [n].
        noise: Standard deviation of the background, counts [n].
        ratio: Width w of the template over that of the peak, which is measured on each line.
        sigma_px: Width of the peak if it is known.
    """
    patch = cut(lines, background, noise)
    seen = shape(patch, noise)
    sigma = seen.sigma if sigma_px is None else np.full(len(lines), sigma_px)
    width = (ratio * sigma)[:, None]
    at = seen.centre[:, None]
    step = columns()
    for _ in range(_STEPS):
        scaled = np.square((step - at) / width)
        weight = patch.signal * np.exp(-0.5 * scaled)
        score = (weight * (step - at)).sum(axis=1, keepdims=True)
        bend = (weight * (scaled - 1.0)).sum(axis=1, keepdims=True)
        move = np.where(bend < 0.0, score / np.where(bend < 0.0, -bend, 1.0), 0.0)
        at = at + np.clip(move, -width, width)
    return place(patch, at[:, 0])
