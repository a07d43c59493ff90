"""Unsigned division to the nearest integer, the twin of ``rtl/trig/divide.sv``."""

import numpy as np

from vrscan.data.arrays import Bools, Ints


def latency(quotient_width: int) -> int:
    """Return the clocks from ``valid_i`` to ``valid_o``."""
    return quotient_width + 3


def divide(
    dividend: Ints | np.int64, divisor: Ints | np.int64, *, quotient_width: int
) -> tuple[Ints, Bools]:
    """Return ``dividend / divisor`` to nearest, half up, exactly as the hardware does.

    Args:
        dividend: Integers of at least 0; with half the divisor added they must fit in int64.
        divisor: Integers of at least 0, broadcast against ``dividend``.
        quotient_width: Bits of the quotient, ``QuotientWidth`` of the module.

    Returns:
        The quotient, int64, all ones where it does not fit or the divisor is 0; and a bool array
        that is true there.

    Raises:
        ValueError: if an operand is negative.
    """
    dividend, divisor = np.broadcast_arrays(
        np.asarray(dividend, np.int64), np.asarray(divisor, np.int64)
    )
    if dividend.size and (dividend.min() < 0 or divisor.min() < 0):
        raise ValueError("divide: operands must not be negative")
    largest = (1 << quotient_width) - 1
    quotient = (dividend + (divisor >> 1)) // np.maximum(divisor, 1)
    overflow = (divisor == 0) | (quotient > largest)
    return np.where(overflow, largest, quotient), overflow
