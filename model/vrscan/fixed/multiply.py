"""Signed multiplication, the twin of ``rtl/trig/multiply.sv`` and ``multiply_fast.sv``."""

import numpy as np

from vrscan.data.arrays import Ints

FAST_LATENCY = 4  # clocks from valid_i to valid_o of multiply_fast


def _limbs(width: int) -> int:
    """Return the number of limbs: 17 bits each, the top one signed with up to 18."""
    return 1 if width <= 18 else 1 + -(-(width - 18) // 17)


def latency(a_width: int, b_width: int) -> int:
    """Return the clocks from ``valid_i`` to ``valid_o``."""
    return _limbs(a_width) * _limbs(b_width) + 5


def multiply(a: Ints, b: Ints, *, a_width: int, b_width: int) -> Ints:
    """Return ``a * b``, which the hardware forms exactly.

    Args:
        a: Signed integers of ``a_width`` bits. Any shape.
        b: Signed integers of ``b_width`` bits, broadcast against ``a``.
        a_width: ``AWidth`` of the module.
        b_width: ``BWidth`` of the module.

    Returns:
        The products, int64.

    Raises:
        ValueError: if an operand does not fit in its width, or a product not in int64.
    """
    a, b = np.asarray(a, np.int64), np.asarray(b, np.int64)
    for name, operand, width in (("a", a, a_width), ("b", b, b_width)):
        # The bits from the sign upward are all equal in a number that fits.
        if operand.size and np.any((operand >> min(width - 1, 63)) != operand >> 63):
            raise ValueError(f"multiply: {name} does not fit in {width} bits")
    product: Ints = a * b
    # A wrapped product is off by 2**64 or more, the float's by 2**12 at most.
    if a_width + b_width > 64 and np.any(
        np.abs(a.astype(np.float64) * b.astype(np.float64) - product.astype(np.float64)) > 2.0**32
    ):
        raise ValueError("multiply: a product does not fit in 64 bits")
    return product
