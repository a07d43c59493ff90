"""Integers kept within the words of the hardware."""

import numpy as np

from vrscan.data.arrays import Ints


def saturated(values: Ints, width: int) -> Ints:
    """Return values limited to signed words of so many bits."""
    limit = 1 << (width - 1)
    return np.clip(values, -limit, limit - 1)
