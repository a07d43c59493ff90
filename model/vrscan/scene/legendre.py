"""Nodes and weights of Gauss and Legendre's quadrature, which take long to find."""

from functools import cache

import numpy as np

from vrscan.data.arrays import Floats


@cache
def legendre(count: int) -> tuple[Floats, Floats]:
    """Return nodes from -1 to 1 and weights, not to be written to [count]."""
    found = np.polynomial.legendre.leggauss(count)
    for each in found:
        each.flags.writeable = False
    return found
