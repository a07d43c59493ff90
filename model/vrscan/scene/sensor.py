"""From a spot on the sensor to counts: pixel integration, shot noise, read noise, the converter."""

import math

import numpy as np
from scipy.special import erf

from vrscan.arrays import Floats, Pixels

REACH = 8.0  # spot sigmas, beyond which a Gaussian is below 1e-14 of its peak


def spot_electrons(
    position_px: Floats, sigma_px: Floats, peak_electrons: Floats, line_length: int
) -> Floats:
    """Return what Gaussian spots put into each pixel.

    Leaves out speckle, skew and motion during the pulse.

    Args:
        position_px: Centre of each spot [n]; pixel i is centred at i. NaN is no spot.
        sigma_px: Standard deviation [n].
        peak_electrons: Electrons that a pixel would hold at the spot's peak irradiance [n].
        line_length: Pixels of a line.

    Returns:
        Mean electrons [n, line_length].
    """
    electrons = np.zeros((len(position_px), line_length))
    rows = np.flatnonzero(np.isfinite(position_px))
    if len(rows) == 0:
        return electrons
    centre, sigma = position_px[rows], sigma_px[rows]
    reach = math.ceil(REACH * float(sigma.max()))
    first = np.round(centre).astype(np.int64) - reach
    edges = first[:, None] + np.arange(2 * reach + 2)
    scaled = (edges - 0.5 - centre[:, None]) / (math.sqrt(2.0) * sigma[:, None])
    area = 0.5 * np.diff(erf(scaled), axis=1)
    area *= (peak_electrons[rows] * sigma * math.sqrt(2.0 * math.pi))[:, None]
    pixel = edges[:, :-1]
    inside = (pixel >= 0) & (pixel < line_length)
    row = np.broadcast_to(rows[:, None], pixel.shape)
    electrons[row[inside], pixel[inside]] = area[inside]
    return electrons


def expose(
    electrons: Floats,
    rng: np.random.Generator,
    *,
    background_counts: float,
    read_noise_counts: float,
    kappa: float,
    pixel_width: int,
) -> Pixels:
    """Return the counts that a converter makes of the light.

    Leaves out fixed pattern, dark current and crosstalk.

    Args:
        electrons: Mean electrons of the spot [n, length].
        rng: Source of all noise.
        background_counts: Mean of even light, counts; it has shot noise too.
        read_noise_counts: Standard deviation, counts.
        kappa: Counts per electron.
        pixel_width: Bits; counts end at 0 and 2**pixel_width - 1.

    Returns:
        Counts, uint16 [n, length].
    """
    shot = rng.poisson(electrons + background_counts / kappa)
    read = read_noise_counts * rng.standard_normal(electrons.shape)
    counts = np.floor(shot * kappa + read + 0.5)
    return np.clip(counts, 0, 2**pixel_width - 1).astype(np.uint16)


def cramer_rao_variance(electrons: Floats, slope: Floats, dark_variance: float) -> Floats:
    """Return the least variance of a position estimate, px^2 [n].

    1 / sum_i (df_i / dmu)^2 / (b^2 + f_i), f_i in electrons, b^2 the variance of a pixel without
    the spot: read noise, background and converter step (Winick 1986).

    Args:
        electrons: Mean electrons f_i of the spot [n, length].
        slope: df_i / dmu, electrons per px [n, length].
        dark_variance: b^2, electrons squared.
    """
    return np.asarray(1.0 / (np.square(slope) / (dark_variance + electrons)).sum(axis=1))
