"""Free interval of a beam without a peak, the twin of ``rtl/geometry/free_interval.sv``."""

import numpy as np

from vrscan.data.arrays import Ints
from vrscan.fixed.divide import divide
from vrscan.registers.free_table import FRACTION_WIDTH, HALF, MANTISSA_WIDTH, QUOTIENT_FRACTION

LATENCY = 26  # clocks from valid_i to valid_o
QUOTIENT_WIDTH = 16


def free_interval(
    angle: Ints,
    power: Ints,
    noise: Ints,
    *,
    begin: int,
    shift: int,
    table_from: Ints | tuple[int, ...],
    table_to: Ints | tuple[int, ...],
) -> tuple[Ints, Ints]:
    """Return the ends of the interval of z in which a beam without a peak meets nothing.

    Args:
        angle: Scan angle, fraction of a turn, s24, [n].
        power: Power of the laser, u16, [n].
        noise: Noise of the background, u24, [n].
        begin: Angle of entry 0, s24.
        shift: The entries are 2**(shift + FRACTION_WIDTH) steps of an angle apart; u4.
        table_from: Least z, mm, 4 fraction bits, u16; 128 entries over the angle, what the camera
            sees, and 128 over power / noise, where the darkest surface gives a peak.
        table_to: Largest z in the same format; where it is not above the least, the entry is empty.

    Returns:
        Least and largest z, int64 [n]; both 0 where nothing is free.
    """
    table_from, table_to = np.asarray(table_from, np.int64), np.asarray(table_to, np.int64)
    filled = table_from < table_to
    offset = np.asarray(angle, np.int64) - begin
    steps = np.maximum(offset, 0) >> shift
    outside = (offset < 0) | (steps >> FRACTION_WIDTH >= HALF - 1)
    index = np.where(outside, 0, steps >> FRACTION_WIDTH)
    share = steps & (1 << FRACTION_WIDTH) - 1
    empty = outside | ~filled[index] | ~filled[index + 1]
    # A product is rounded so that the interval shrinks: up for the least z, down for the largest.
    rise = (table_from[index + 1] - table_from[index]) * share
    least = table_from[index] - (-rise >> FRACTION_WIDTH)
    largest = table_to[index] + ((table_to[index + 1] - table_to[index]) * share >> FRACTION_WIDTH)

    quotient, _ = divide(
        np.asarray(power, np.int64) << QUOTIENT_FRACTION, noise, quotient_width=QUOTIENT_WIDTH
    )
    exponent = np.frexp(np.maximum(quotient, 1).astype(np.float64))[1].astype(np.int64) - 1
    mantissa = (quotient << MANTISSA_WIDTH >> exponent) & (1 << MANTISSA_WIDTH) - 1
    entry = HALF + (exponent << MANTISSA_WIDTH) + mantissa
    least = np.maximum(least, table_from[entry])
    largest = np.minimum(largest, table_to[entry])
    free = ~empty & (quotient > 0) & (least < largest)
    return np.where(free, least, 0), np.where(free, largest, 0)
