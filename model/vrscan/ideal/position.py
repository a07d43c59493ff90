"""Sub-pixel position from the phase of the first harmonic, (8), and its standard deviation."""

from dataclasses import dataclass

import numpy as np

from vrscan.data.arrays import Bools, Floats, Ints, Pixels

NO_PHASE_LIMIT = 1.16e-6  # share of the sum above background: a smaller harmonic is rounding
NO_PHASE_DUST = 1e-12  # share of the sum of raw pixels


@dataclass(frozen=True)
class Phase:
    """First harmonics of n windows; all arrays [n]."""

    delta: Floats  # position from the window's left edge, px
    phase: Floats  # rad, 0 to 2 pi
    magnitude: Floats  # |P1|, counts
    sigma: Floats  # standard deviation of delta, px
    light: Floats  # sum of the pixels above background, counts
    no_phase: Bools  # X = Y = 0: all other values are 0


def windows(lines: Pixels, left: Ints, width: Ints) -> Floats:
    """Return the pixels of each window, zeros behind its end.

    Args:
        lines: Counts [n, length].
        left: First pixel of each window [n].
        width: Pixels of each window [n].

    Returns:
        Counts [n, max(width)].
    """
    step = np.arange(int(width.max(initial=0)))
    column = np.minimum(left[:, None] + step, lines.shape[1] - 1)
    pixels = np.take_along_axis(lines, column, axis=1).astype(np.float64)
    return np.asarray(np.where(step < width[:, None], pixels, 0.0))


def first_harmonic(
    pixels: Floats,
    width: Ints,
    *,
    period_n: bool,
    background: Floats,
    noise: Floats,
    kappa: float,
    slope: Floats | None = None,
) -> Phase:
    """Return position and standard deviation from the phase of the first harmonic.

    VR-SCAN (8): X = sum p cos(2 pi t / T), Y = sum p sin(2 pi t / T), delta = T atan2(Y, X) / 2 pi
    and T more where that is negative. The paper's T = N - 1 puts first and last sample on one
    phase; with T = N a pedestal drops out.

    The standard deviation is that of the phase under independent pixel noise,
    sigma = T / 2 pi sqrt(sum v_i sin^2(theta_i - phi)) / |P1|, v_i = noise^2 + kappa p_i.

    Args:
        pixels: Counts [n, m], zeros behind each window's end.
        width: N of each window [n], 3 or more.
        period_n: Whether T = N; otherwise T = N - 1.
        background: Mean of the background, counts [n].
        noise: Standard deviation of the background, counts [n].
        kappa: Counts per electron.
        slope: Slope of a line through the window's middle that is subtracted before the
            correlation, counts per px [n]. The variance is that of the pixels as they are.

    Returns:
        The phases of n windows.
    """
    step = np.arange(pixels.shape[1])
    inside = step < width[:, None]
    period = (width if period_n else width - 1).astype(np.float64)
    theta = 2.0 * np.pi * step / period[:, None]
    flat = pixels
    if slope is not None:
        ramp = slope[:, None] * (step - (width[:, None] - 1) / 2.0)
        flat = np.where(inside, pixels - ramp, 0.0)
    x = (flat * np.cos(theta)).sum(axis=1)
    y = (flat * np.sin(theta)).sum(axis=1)
    magnitude = np.hypot(x, y)
    signal = np.where(inside, np.maximum(pixels - background[:, None], 0.0), 0.0)
    dust = NO_PHASE_DUST * pixels.sum(axis=1)  # what float64 leaves of a pedestal
    no_phase = magnitude <= NO_PHASE_LIMIT * signal.sum(axis=1) + dust
    # atan2 gives -pi to pi; the modulus is the second case of (8). A phase of -1e-17 would round
    # to 2 pi itself, one period on: it is 0.
    phase = np.where(no_phase, 0.0, np.arctan2(y, x) % (2.0 * np.pi))
    phase[phase >= 2.0 * np.pi] = 0.0
    variance = np.where(inside, np.square(noise)[:, None] + kappa * signal, 0.0)
    spread = np.sqrt((variance * np.square(np.sin(theta - phase[:, None]))).sum(axis=1))
    per_radian = period / (2.0 * np.pi)
    sigma = np.where(no_phase, 0.0, per_radian * spread / np.where(no_phase, 1.0, magnitude))
    return Phase(
        delta=phase * per_radian,
        phase=phase,
        magnitude=np.where(no_phase, 0.0, magnitude),
        sigma=sigma,
        light=signal.sum(axis=1),
        no_phase=no_phase,
    )
