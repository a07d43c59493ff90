"""Signal-to-noise ratio and the two confidences, (9) and (10)."""

from math import erf

import numpy as np

from vrscan.data.arrays import Bools, Floats, Ints

_erf = np.vectorize(erf, otypes=[np.float64])


def signal_to_noise(maximum: Ints, background: Floats, noise: Floats) -> Floats:
    """Return (maximum - background) / noise [n], an amplitude ratio.

    It is 0 where the maximum is not above the background, and infinite where only the noise is 0.

    Args:
        maximum: Largest pixel, counts [n].
        background: Mean of the background, counts [n].
        noise: Standard deviation of the background, counts [n].
    """
    height = np.maximum(maximum - background, 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(height > 0.0, height / noise, 0.0)


def object_confidence(z: Floats, sigma_z: Floats, valid: Bools, *, tolerance: float) -> Floats:
    """Return C_obj, the probability that z errs by less than a share of itself [n].

    C_obj of VR-SCAN (9) is the share of an S/N that somebody has to choose, ``printed_confidence``.
    This one is what the Gaussian of sigma_z has within ``tolerance * z``, and 0 where there is no
    point.

    Args:
        z: mm [n].
        sigma_z: Standard deviation of z, mm [n].
        valid: Whether there is a point [n].
        tolerance: Share of z.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        sigmas = tolerance * np.abs(z) / sigma_z
    return np.where(valid, _erf(np.nan_to_num(sigmas) / np.sqrt(2.0)), 0.0)


def printed_confidence(snr: Floats, valid: Bools, *, snr_max: float) -> Floats:
    """Return C_obj = snr / snr_max of VR-SCAN (9), at most 1, and 0 where there is no point [n].

    Args:
        snr: Signal-to-noise ratio [n].
        valid: Whether there is a point [n].
        snr_max: S/N at which the confidence is 1.
    """
    return np.where(valid, np.minimum(snr / snr_max, 1.0), 0.0)


def free_confidence(power: Ints, clear: Bools, *, power_max: int) -> Floats:
    """Return C_sfm = P_l / P_l,max of VR-SCAN (10) where snr < snr_min, 0 elsewhere [n].

    Args:
        power: Laser power of each line [n].
        clear: Whether snr < snr_min, and nothing else says that the line may not be trusted [n].
        power_max: Laser power at which the confidence is 1.
    """
    return np.where(clear, np.minimum(power / power_max, 1.0), 0.0)
