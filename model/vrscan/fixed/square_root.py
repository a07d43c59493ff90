"""Square root to the nearest integer, the twin of ``rtl/trig/square_root.sv``."""

import numpy as np

from vrscan.data.arrays import Ints


def latency(root_width: int) -> int:
    """Return the clocks from ``valid_i`` to ``valid_o``."""
    return root_width + 3


def square_root(radicand: Ints, *, root_width: int) -> Ints:
    """Return the square root to the nearest integer, exactly as the hardware does.

    A root of an integer never lies in the middle between two integers, so there is no tie.

    Args:
        radicand: Integers in [0, 2**(2 * root_width)), at most 2**62. Any shape.
        root_width: Bits of the root, ``RootWidth`` of the module.

    Returns:
        The roots, int64, all ones where the rounded root does not fit.

    Raises:
        ValueError: if a radicand is negative or too large.
    """
    radicand = np.asarray(radicand, np.int64)
    limit = min((1 << 2 * root_width) - 1, 1 << 62)
    if radicand.size and (radicand.min() < 0 or radicand.max() > limit):
        raise ValueError(f"square_root: radicands must be 0 to {limit}")
    # The floating-point root is off by one at most; integers correct it.
    root = np.sqrt(radicand.astype(np.float64)).astype(np.int64)
    root -= root * root > radicand
    root += (root + 1) * (root + 1) <= radicand
    root += radicand - root * root > root
    return np.minimum(root, (1 << root_width) - 1)
