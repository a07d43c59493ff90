"""The record of a line's point in 64 bytes, the twin of ``rtl/points/point_record.sv``."""

import numpy as np

from vrscan.data.arrays import Bools, Ints
from vrscan.data.points import Points
from vrscan.data.records import (
    CONFIGURATION,
    FREE_ALIGN,
    FULL,
    INWARD,
    MEASURED,
    MORE_FLAGS,
    TEST,
    Records,
)

LATENCY = 3  # clocks from valid_i to the first byte

# The fields that have no meaning, and so are 0, where a point is not measured.
_OF_MEASURED = ("position", "sigma", "doubt", "sigma_z")


def point_record(
    points: Points,
    power: Ints,
    confidence: Ints,
    inward: Bools,
    test: Bools,
    time: Ints,
    configuration: Ints | int = 0,
) -> Records:
    """Return the records of points; ``vrscan.data.records.encode_full`` turns them into bytes.

    Args:
        points: n points as the chain gives them.
        power: Laser power in the line, u16 [n].
        confidence: Confidence in the scan angle, u8 [n].
        inward: Whether the mirror moves inward [n].
        test: Whether the line is one of the test pattern [n].
        time: Time of the centre of the pulse, clocks, u32 [n].
        configuration: The bit that changes with each commit, [n] or one for all.

    Returns:
        An array of ``vrscan.data.records.FULL`` [n].
    """
    records = np.zeros(len(points), FULL)
    for name in FULL.names or ():
        if hasattr(points, name):
            records[name] = getattr(points, name)
    records["power"] = power
    records["confidence"] = confidence
    records["time"] = time
    records["flags"] = points.flags & 0xFFFF
    records["bits"] = MEASURED * points.measured + INWARD * inward + TEST * test
    for bit, flag in MORE_FLAGS.items():
        records["bits"] |= (points.flags >> flag & 1).astype(np.uint8) << np.uint8(bit)
    records["bits"] |= np.uint8(CONFIGURATION) * np.asarray(configuration, np.uint8)
    for name in _OF_MEASURED:
        records[name][~points.measured] = 0
    for name, ends in (("x", points.free_from), ("z", points.free_to)):
        records[name][~points.measured] = ends[~points.measured] << FREE_ALIGN
    records["left"][points.width == 0], records["right"][points.width == 0] = 1, 0
    return records
