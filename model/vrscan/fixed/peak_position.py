"""The peak's place from its phase, the twin of ``rtl/peak/peak_position.sv``."""

import numpy as np
import numpy.typing as npt

from vrscan.fixed import pkg
from vrscan.fixed.multiply import latency as multiply_latency

LATENCY = multiply_latency(pkg.ANGLE_WIDTH + 1, pkg.WINDOW_WIDTH + 1) + 1

Integers = npt.NDArray[np.int64]


def peak_position(left: Integers, period: Integers, phase: Integers) -> Integers:
    """Return left + phase T of VR-SCAN (8), to nearest, half up.

    Args:
        left: First pixel of the window, [n].
        period: T, px, [n].
        phase: Fraction of a turn, 24 bits, [n].

    Returns:
        Positions in px with 12 fraction bits, int64 [n]. Pixel i is centred at i.
    """
    shift = pkg.ANGLE_WIDTH - pkg.POSITION_FRACTION
    delta = (phase * period + (1 << (shift - 1))) >> shift
    return (left << pkg.POSITION_FRACTION) + delta
