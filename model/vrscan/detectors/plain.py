"""Lines that are nothing but their pixels, where only the detector is measured."""

import numpy as np

from vrscan.data.arrays import Pixels
from vrscan.data.config import Config
from vrscan.data.lines import Lines


def plain_lines(pixels: Pixels, config: Config) -> Lines:
    """Return lines of these pixels at angle 0, with the laser at its full power."""
    count = len(pixels)
    power = np.full(count, config.laser.power_max, np.int64)
    return Lines(lines=pixels, angle_rad=np.zeros(count), power=power)
