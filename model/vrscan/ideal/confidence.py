"""Signal-to-noise ratio and the two confidences, (9) and (10)."""

import numpy as np

from vrscan.data.arrays import Bools, Floats, Ints


def signal_to_noise(maximum: Ints, background: Floats, noise: Floats) -> Floats:
    """Return (maximum - background) / noise [n], an amplitude ratio.

    It is 0 where the maximum is not above the background, and infinite where only the noise is 0.

    Args:
        maximum: Largest pixel, counts [n].
        background: Mean of the background, counts [n].
        noise: Its standard deviation, counts [n].
    """
    height = np.maximum(maximum - background, 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(height > 0.0, height / noise, 0.0)


def object_confidence(snr: Floats, valid: Bools, *, snr_max: float) -> Floats:
    """Return C_obj = snr / snr_max of VR-SCAN (9), at most 1, and 0 where snr < snr_min [n].

    Args:
        snr: Signal-to-noise ratio [n].
        valid: Where it reaches snr_min [n].
        snr_max: Ratio of confidence 1.
    """
    return np.where(valid, np.minimum(snr / snr_max, 1.0), 0.0)


def free_confidence(power: Ints, valid: Bools, *, power_max: int) -> Floats:
    """Return C_sfm = P_l / P_l,max of VR-SCAN (10) where snr < snr_min, 0 elsewhere [n].

    Args:
        power: Laser power of each line [n].
        valid: Where the signal-to-noise ratio reaches snr_min [n].
        power_max: Power of confidence 1.
    """
    return np.where(valid, 0.0, np.minimum(power / power_max, 1.0))
