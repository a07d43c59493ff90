"""Patches: the surroundings of each line's maximum, on which most detectors work."""

from dataclasses import dataclass

import numpy as np

from vrscan.data.arrays import Bools, Floats, Ints, Pixels

REACH = 127  # px on either side of the maximum: together the instrument's longest window, 255
LEAST_SNR = 8.0  # a lower peak does not count as one, like the shipped snr_min
K_NOISE = 2.5  # shipped threshold of the run above background / noise
K_HEIGHT = 0.02  # shipped threshold of the run above background / peak's height


@dataclass(frozen=True)
class Patch:
    """The pixels around the maxima of n lines; columns are pixels, ``REACH`` is the maximum's."""

    peak: Ints  # first maximum, px [n]
    signal: Floats  # counts above background, 0 off the sensor [n, 2 REACH + 1]
    raw: Floats  # counts, the background's off the sensor [n, 2 REACH + 1]
    inside: Bools  # whether a column is on the sensor [n, 2 REACH + 1]
    height: Floats  # height of the maximum above background, counts [n]
    found: Bools  # whether the height is LEAST_SNR times the noise or more [n]


@dataclass(frozen=True)
class Shape:
    """Shapes of peaks, from the run above the threshold; all arrays [n]."""

    centre: Floats  # centroid of the run, px from the maximum
    sigma: Floats  # area / height / sqrt(2 pi), at least 0.3 px


def columns() -> Floats:
    """Return the positions of a patch's columns, px from the maximum."""
    return np.arange(-REACH, REACH + 1, dtype=np.float64)


def cut(lines: Pixels, background: Floats, noise: Floats) -> Patch:
    """Return the patches of n lines.

    Args:
        lines: Counts [n, length].
        background: Mean of each line's background, counts [n].
        noise: Standard deviation of each line's background, counts [n].
    """
    peak = lines.argmax(axis=1).astype(np.int64)
    index = peak[:, None] + np.arange(-REACH, REACH + 1)
    inside = (index >= 0) & (index < lines.shape[1])
    pixels = np.take_along_axis(lines, np.clip(index, 0, lines.shape[1] - 1), axis=1)
    raw = np.where(inside, pixels, background[:, None])
    signal = raw - background[:, None]
    height = signal[:, REACH].copy()
    return Patch(
        peak=peak,
        signal=signal,
        raw=raw,
        inside=inside,
        height=height,
        found=(height > 0.0) & (height >= LEAST_SNR * noise),
    )


def run(patch: Patch, level: Floats) -> Bools:
    """Return the run of pixels above ``level`` that holds the maximum [n, 2 REACH + 1].

    Args:
        patch: Patches of n lines.
        level: Threshold above background, counts [n].
    """
    below = ~(patch.signal > level[:, None]) | ~patch.inside
    # On either side of the maximum, a run ends at the first pixel that is not above the level.
    right = ~np.logical_or.accumulate(below[:, REACH:], axis=1)
    left = ~np.logical_or.accumulate(below[:, REACH::-1], axis=1)
    return np.concatenate([left[:, :0:-1], right], axis=1)


def shape(patch: Patch, noise: Floats) -> Shape:
    """Return centre and width of each peak, from the run that the shipped threshold cuts out.

    Args:
        patch: Patches of n lines.
        noise: Standard deviation of the background, counts [n].
    """
    mask = run(patch, np.maximum(K_NOISE * noise, K_HEIGHT * patch.height))
    inside = np.where(mask, patch.signal, 0.0)
    area = np.where(patch.found, inside.sum(axis=1), 1.0)
    centre = inside @ columns() / np.where(area > 0.0, area, 1.0)
    height = np.where(patch.found, patch.height, 1.0)
    sigma = np.maximum(area / height / np.sqrt(2.0 * np.pi), 0.3)
    return Shape(centre=centre, sigma=sigma)


def place(patch: Patch, offset: Floats) -> Floats:
    """Return positions, px, NaN where there is no peak or the offset is outside the patch.

    Args:
        patch: Patches of n lines.
        offset: Offset of the position from the maximum, px [n].
    """
    with np.errstate(invalid="ignore"):
        good = patch.found & (np.abs(offset) <= REACH)
    return np.where(good, patch.peak + offset, np.nan)
