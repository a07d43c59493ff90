"""The peak's place from its phase, the twin of ``rtl/peak/peak_position.sv``."""

from vrscan.arrays import Ints
from vrscan.fixed import pkg
from vrscan.fixed.multiply import latency as multiply_latency

LATENCY = multiply_latency(pkg.ANGLE_WIDTH + 1, pkg.WINDOW_WIDTH + 1) + 1


def peak_position(left: Ints, period: Ints, phase: Ints) -> Ints:
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
