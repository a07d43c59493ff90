"""Records of points that no chain ever gave, with every bit in use."""

from collections.abc import Sequence

import numpy as np

from vrscan.data import pkg
from vrscan.data.records import FULL, Records

LENGTHS = ("x", "z")


def random_records(draw: np.random.Generator, lines: Sequence[int]) -> Records:
    """Return records of these lines, but for ``lost`` of any values, extreme ones among them."""
    records = np.frombuffer(draw.bytes(FULL.itemsize * len(lines)), FULL).copy()
    extremes = draw.random(len(lines)) < 0.2
    for name in FULL.names or ():
        info = np.iinfo(FULL[name])
        least, most = info.min, info.max
        if name in LENGTHS:
            most = (1 << (pkg.LENGTH_WIDTH - 1)) - 1
            least = -most - 1
        records[name] = np.where(
            extremes,
            draw.choice([least, most], len(lines)),
            draw.integers(least, most, len(lines), endpoint=True),
        )
    records["flags"] &= draw.integers(1 << 16, size=len(lines), dtype=np.uint16)
    records["bits"] &= 15
    records["line"] = [line % (1 << 32) for line in lines]
    records["lost"] = 0
    return records
