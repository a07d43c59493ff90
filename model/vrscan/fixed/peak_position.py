"""The peak's place from its phase, the twin of ``rtl/peak/peak_position.sv``."""

import numpy as np

from vrscan.data import pkg
from vrscan.data.arrays import Ints
from vrscan.fixed.multiply import latency as multiply_latency

LATENCY = multiply_latency(pkg.ANGLE_WIDTH + 1, pkg.WINDOW_WIDTH + 1) + 1


def peak_position(left: Ints, period: Ints, phase: Ints, *, line_length: int) -> Ints:
    """Return left + phase T of VR-SCAN (8), to nearest, half up.

    Args:
        left: First pixel of the window, [n].
        period: T, px, [n].
        phase: Phase of the first harmonic, fraction of a turn, 24 bits, [n].
        line_length: ``LineLength`` of the module; a position rounded up to the power of two at or
            above it is the largest one below.

    Returns:
        Positions in px with 12 fraction bits, int64 [n]. Pixel i is centred at i.
    """
    shift = pkg.ANGLE_WIDTH - pkg.POSITION_FRACTION
    delta = (phase * period + (1 << (shift - 1))) >> shift
    largest = (1 << ((line_length - 1).bit_length() + pkg.POSITION_FRACTION)) - 1
    position: Ints = np.minimum((left << pkg.POSITION_FRACTION) + delta, largest)
    return position
