"""Signal-to-noise ratio and the two confidences, (9) and (10)."""

import numpy as np

from vrscan.data.arrays import Bools, Floats, Ints


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


def object_confidence(snr: Floats, valid: Bools, *, snr_max: float) -> Floats:
    """Return C_obj = snr / snr_max of VR-SCAN (9), at most 1, and 0 where snr < snr_min [n].

    Args:
        snr: Signal-to-noise ratio [n].
        valid: Whether the ratio reaches snr_min [n].
        snr_max: Signal-to-noise ratio at which the confidence is 1.
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
