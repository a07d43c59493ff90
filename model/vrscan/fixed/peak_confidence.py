"""S/N and uncertainty of a peak, the twin of ``rtl/peak/peak_confidence.sv``, and C_sfm."""

from dataclasses import dataclass

import numpy as np

from vrscan.data import pkg
from vrscan.data.arrays import Bools, Ints
from vrscan.fixed.divide import divide
from vrscan.fixed.divide import latency as divide_latency
from vrscan.fixed.multiply import latency as multiply_latency
from vrscan.fixed.square_root import latency as square_root_latency
from vrscan.fixed.square_root import square_root

ROOT_WIDTH = 28
KAPPA_FRACTION = 28 - pkg.ALIGNED_WIDTH
FRACTION_WIDTH = pkg.COUNT_WIDTH - pkg.ALIGNED_WIDTH
SQUARE_FRACTION = 2 * FRACTION_WIDTH


@dataclass(frozen=True)
class Confidence:
    """Quality of n peaks, int64 [n] each.

    Attributes:
        snr: (maximum - background) / noise, 8 fraction bits, saturating.
        no_noise: Whether the noise is zero, so that the S/N is its largest value, bool.
        sigma: Standard deviation of the position, px, 12 fraction bits, saturating.
        c_sfm: Confidence in free space (10); 255 is 1; 0 also where the noise is zero.
    """

    snr: Ints
    no_noise: Bools
    sigma: Ints
    c_sfm: Ints


def latency() -> int:
    """Return the clocks from ``valid_i`` to ``valid_o``."""
    product = multiply_latency(50, 32) + 2
    quotient = divide_latency(pkg.SIGMA_WIDTH) + 1
    root = square_root_latency(ROOT_WIDTH) + 1
    return 7 * product + 2 * quotient + root + 2


def _confidence(value: Ints, gain: int) -> Ints:
    scaled = (value * gain + (1 << (pkg.GAIN_FRACTION - 1))) >> pkg.GAIN_FRACTION
    limited: Ints = np.minimum(scaled, (1 << pkg.CONFIDENCE_WIDTH) - 1)
    return limited


def peak_confidence(
    *,
    measured: Bools,
    clear: Bools,
    maximum: Ints,
    background: Ints,
    noise: Ints,
    width: Ints,
    period: Ints,
    magnitude: Ints,
    sum: Ints,
    wave: Ints,
    count: Ints,
    power: Ints,
    pixel_width: int,
    kappa: int,
    c_sfm_gain: int,
) -> Confidence:
    """Return S/N, sigma and C_sfm of VR-SCAN (10).

    sigma = T / (2 pi) sqrt(sum v_i sin^2(theta_i - phi)) / |P1|, v_i = noise^2 + kappa p_i.

    Args:
        measured: Whether the peak has a phase, bool [n].
        clear: Whether nothing may be there: a low S/N, and no flag that says otherwise, bool [n].
        maximum: Largest pixel, counts, [n].
        background: Level of the background, counts, 24 - PixelWidth fraction bits, [n].
        noise: Noise of the background in the same format, at most half of full scale, [n].
        width: N modulo 256, [n].
        period: T modulo 256, [n].
        magnitude: Magnitude of the first harmonic from ``phase_correlate``, which also gives
            ``sum``, ``wave`` and ``count``, [n].
        sum: Sum of pixel - pedestal, aligned counts, [n].
        wave: Second harmonic of the window, [n].
        count: Second harmonic of ones, [n].
        power: Laser power, [n].
        pixel_width: ``PixelWidth`` of the module.
        kappa: Counts per electron, 28 - PixelWidth fraction bits.
        c_sfm_gain: 255 / power_max, 16 fraction bits.

    Returns:
        The quality of every peak.
    """
    height = (maximum << (pkg.COUNT_WIDTH - pixel_width)) - background
    snr, _ = divide(height << pkg.SNR_FRACTION, noise, quotient_width=pkg.SNR_WIDTH)
    snr = np.where(height == 0, 0, snr)

    fraction = background & ((1 << FRACTION_WIDTH) - 1)
    shift = KAPPA_FRACTION + FRACTION_WIDTH - SQUARE_FRACTION
    constant = noise * noise - ((kappa * fraction + (1 << (shift - 1))) >> shift)
    free = (width << pkg.WAVE_COUNT_FRACTION) - count
    # The product needs up to 63 bits; it is split so that its rounding stays exact.
    half = 1 << (pkg.WAVE_COUNT_FRACTION - 1)
    high, low = constant >> pkg.WAVE_COUNT_FRACTION, constant & (2 * half - 1)
    variance = high * free + ((low * free + half) >> pkg.WAVE_COUNT_FRACTION)
    variance = variance + kappa * ((sum << pkg.WAVE_FRACTION) - wave)
    root = square_root(np.maximum(variance, 0), root_width=ROOT_WIDTH)
    numerator = root * period * pkg.SIGMA_GAIN
    sigma, _ = divide(numerator, magnitude, quotient_width=pkg.SIGMA_WIDTH)
    return Confidence(
        snr=snr,
        no_noise=noise == 0,
        sigma=np.where(measured, sigma, 0),
        c_sfm=np.where(clear & (noise != 0), _confidence(power, c_sfm_gain), 0),
    )
