"""Records of points as they lie in packets: 8 or 64 bytes each, little endian.

A record decodes to a structured array with one field for each number, in the raw formats of
``vrscan_pkg``. ``points`` turns full records into the ``Points`` of the rest of the package.
"""

from dataclasses import fields

import numpy as np
import numpy.typing as npt

from vrscan.data import link_pkg, pkg
from vrscan.data.arrays import Bools
from vrscan.data.points import Points

# The decoded records; numpy has no numbers of 24 bits.
COMPACT = np.dtype([("x", "<i4"), ("z", "<i4"), ("c_obj", "u1"), ("flags", "u1")])
FULL = np.dtype(
    [
        ("line", "<u4"),
        ("flags", "<u2"),
        ("left", "<u2"),
        ("right", "<u2"),
        ("maximum", "<u2"),
        ("row_mean", "<u4"),
        ("row_variance", "<u4"),
        ("background", "<u4"),
        ("noise", "<u4"),
        ("snr", "<u2"),
        ("sigma", "<u2"),
        ("position", "<i4"),
        ("angle", "<i4"),
        ("x", "<i4"),
        ("z", "<i4"),
        ("sigma_z", "<u2"),
        ("power", "<u2"),
        ("c_obj", "u1"),
        ("c_sfm", "u1"),
        ("width", "<u2"),
        ("confidence", "u1"),
        ("bits", "u1"),
        ("lost", "<u2"),
        ("time", "<u4"),
    ]
)
# Bits of the field ``bits`` of a full record.
MEASURED, INWARD, TEST = 1, 2, 4

# A compact record as it lies in a packet.
_PACKED = np.dtype([("x", "u1", 3), ("z", "u1", 3), ("c_obj", "u1"), ("flags", "u1")])

# The bits of a compact record's flags, and the flags of a point that set each.
_GATHERED = {
    link_pkg.COMPACT_WEAK: ("LOW_SNR", "TOO_NARROW", "TOO_WIDE", "NO_PHASE"),
    link_pkg.COMPACT_AT_EDGE: ("AT_EDGE",),
    link_pkg.COMPACT_SATURATED: ("SATURATED",),
    link_pkg.COMPACT_RIVAL: ("RIVAL",),
    link_pkg.COMPACT_RANGE: ("NO_RANGE", "OUT_OF_RANGE"),
    link_pkg.COMPACT_MIRROR: ("NOT_RUNNING", "INDEX_FAULT", "UNSETTLED"),
    link_pkg.COMPACT_LOST: ("LINES_LOST", "POINTS_LOST"),
}

Records = npt.NDArray[np.void]


def decode_compact(data: bytes) -> Records:
    """Return the compact records of a packet.

    Args:
        data: ``link_pkg.COMPACT_BYTES`` bytes a record.

    Returns:
        An array of ``COMPACT``.

    Raises:
        ValueError: if the last record is not whole.
    """
    packed = np.frombuffer(data, _PACKED)
    records = np.zeros(len(packed), COMPACT)
    for name in ("x", "z"):
        # The three bytes become the upper ones of four, and the shift extends the sign.
        wide = np.zeros((len(packed), 4), np.uint8)
        wide[:, 1:] = packed[name]
        records[name] = wide.view("<i4")[:, 0] >> 8
    for name in ("c_obj", "flags"):
        records[name] = packed[name]
    return records


def encode_compact(records: Records) -> bytes:
    """Return an array of ``COMPACT`` as it lies in a packet."""
    packed = np.zeros(len(records), _PACKED)
    for name in ("x", "z"):
        wide = np.ascontiguousarray(records[name], "<i4").view(np.uint8).reshape(-1, 4)
        packed[name] = wide[:, :3]
    for name in ("c_obj", "flags"):
        packed[name] = records[name]
    return packed.tobytes()


def decode_full(data: bytes) -> Records:
    """Return the full records of a packet.

    Args:
        data: ``link_pkg.FULL_BYTES`` bytes a record.

    Returns:
        An array of ``FULL``.

    Raises:
        ValueError: if the last record is not whole.
    """
    return np.frombuffer(data, FULL)


def encode_full(records: Records) -> bytes:
    """Return an array of ``FULL`` as it lies in a packet."""
    return np.ascontiguousarray(records, FULL).tobytes()


def measured(found: Records) -> Bools:
    """Return which points are measured [n]; for compact records, which also have a range."""
    if "bits" in (found.dtype.names or ()):
        return np.asarray(found["bits"] & MEASURED != 0)
    return np.asarray(found["flags"] >> link_pkg.COMPACT_MEASURED & 1 != 0)


def compact(records: Records) -> Records:
    """Return the compact records of full records, an array of ``COMPACT``.

    A point without a range has no x and z, so only its full record counts as measured.
    """
    flags = records["flags"].astype(np.int64)
    lost = (records["lost"] != 0).astype(np.int64) << pkg.FLAG_POINTS_LOST
    bits = (records["bits"] & MEASURED != 0) & (flags >> pkg.FLAG_NO_RANGE & 1 == 0)
    result = np.zeros(len(records), COMPACT)
    gathered = bits.astype(np.int64) << link_pkg.COMPACT_MEASURED
    for bit, names in _GATHERED.items():
        mask = sum(1 << pkg.FLAGS[name] for name in names)
        gathered |= ((flags | lost) & mask != 0).astype(np.int64) << bit
    for name in ("x", "z", "c_obj"):
        result[name] = records[name]
    result["flags"] = gathered
    return result


def points(records: Records, pixel_width: int = 12) -> Points:
    """Return full records as points, without the fields that only the link adds to them.

    Args:
        records: An array of ``FULL``.
        pixel_width: ``PixelWidth`` of the scanner.
    """
    names = [field.name for field in fields(Points) if field.name in (FULL.names or ())]
    return Points(
        **{name: records[name].astype(np.int64) for name in names},
        measured=records["bits"] & MEASURED != 0,
        pixel_width=pixel_width,
    )
