"""The size of residuals: their root mean square, and a sigma that outliers do not move."""

import math

import numpy as np

from vrscan.data.arrays import Floats

NORMAL = 1.4826  # standard deviation of a normal distribution over its median deviation


def rms(values: Floats, nothing: float = math.nan) -> float:
    """Return the root of the mean square, ``nothing`` of no value."""
    return float(np.sqrt(np.mean(np.square(values)))) if values.size else nothing


def robust_sigma(residuals: Floats) -> float:
    """Return the standard deviation of the normal distribution with the same median deviation."""
    return NORMAL * float(np.median(np.abs(residuals)))
