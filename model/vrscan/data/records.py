"""Records of points as they lie in packets: 8, 9 or 64 bytes each, little endian.

A record decodes to a structured array with one field for each number, in the raw formats of
``vrscan_pkg``. ``points`` turns full records into the ``Points`` of the rest of the package.
"""

from dataclasses import fields
from enum import IntEnum
from typing import Any

import numpy as np
import numpy.typing as npt

from vrscan.data import link_pkg, pkg
from vrscan.data.arrays import Bools, Ints
from vrscan.data.points import NO_PLACE, Points


class Form(IntEnum):
    """The formats of records of points: the number of each in STREAM_START."""

    COMPACT = link_pkg.FORMAT_COMPACT
    FULL = link_pkg.FORMAT_FULL
    SPACE = link_pkg.FORMAT_SPACE  # points and free beams


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
        ("doubt", "<u2"),
        ("confidence", "u1"),
        ("bits", "u1"),
        ("lost", "<u2"),
        ("time", "<u4"),
    ]
)
# What is measured has x, z and c_obj, the other lines angle, free_from, free_to and c_sfm: the
# angle in turns with 24 fraction bits, of which the upper 16 are sent, and the interval as in
# ``Points``. Of the mirror's confidence the upper 7 bits are sent.
SPACE = np.dtype(
    [
        *COMPACT.descr,
        *(("angle", "<i4"), ("free_from", "<u2"), ("free_to", "<u2"), ("c_sfm", "u1")),
        *(("confidence", "u1"), ("inward", "u1")),
    ]
)
FREE_ALIGN = pkg.LENGTH_FRACTION - pkg.FREE_FRACTION  # of a free interval in x and z
# Bits of the field ``bits`` of a full record.
MEASURED, INWARD, TEST = 1, 2, 4
CONFIGURATION = 16  # changes with each commit
MORE_FLAGS = {3: pkg.FLAG_MIXED, 5: pkg.FLAG_MAP_FILLED}  # by its bit: those that ``flags`` lacks

# A compact record as it lies in a packet.
_PACKED = np.dtype([("x", "u1", 3), ("z", "u1", 3), ("c_obj", "u1"), ("flags", "u1")])
# The lines of a record of space that are not measured.
_FREE = np.dtype(
    [("angle", "<i2"), ("free_from", "<u2"), ("free_to", "<u2"), ("c_sfm", "u1"), ("flags", "u1")]
)
_ANGLE_DROP = pkg.ANGLE_WIDTH - 16  # bits of an angle that are not sent

# The bits of a compact record's flags, and the flags of a point that set each.
_GATHERED = {
    link_pkg.COMPACT_WEAK: ("LOW_SNR", "TOO_NARROW", "TOO_WIDE", "NO_PHASE"),
    link_pkg.COMPACT_AT_EDGE: ("AT_EDGE",),
    link_pkg.COMPACT_SATURATED: ("SATURATED",),
    link_pkg.COMPACT_RIVAL: ("RIVAL", "MIXED"),
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


def decode_space(data: bytes) -> Records:
    """Return the records of a packet of points and free beams, an array of ``SPACE``.

    Args:
        data: ``link_pkg.SPACE_BYTES`` bytes a record.

    Raises:
        ValueError: if the last record is not whole.
    """
    rows = np.frombuffer(data, np.uint8).reshape(-1, link_pkg.SPACE_BYTES)
    as_point = decode_compact(rows[:, : link_pkg.COMPACT_BYTES].tobytes())
    as_free = np.frombuffer(rows[:, : link_pkg.COMPACT_BYTES].tobytes(), _FREE)
    records = np.zeros(len(rows), SPACE)
    records["flags"] = as_point["flags"]
    point = measured(as_point)
    for name in ("x", "z", "c_obj"):
        records[name][point] = as_point[name][point]
    for name in ("free_from", "free_to", "c_sfm"):
        records[name][~point] = as_free[name][~point]
    half = 1 << _ANGLE_DROP - 1  # the middle of what the sent bits leave open
    records["angle"][~point] = (as_free["angle"][~point].astype(np.int64) << _ANGLE_DROP) + half
    records["confidence"] = rows[:, 8] << 1
    records["inward"] = rows[:, 8] >> 7
    return records


def encode_space(records: Records) -> bytes:
    """Return an array of ``SPACE`` as it lies in a packet."""
    rows = np.zeros((len(records), link_pkg.SPACE_BYTES), np.uint8)
    point = measured(records)
    packed = np.frombuffer(encode_compact(records), np.uint8).reshape(-1, link_pkg.COMPACT_BYTES)
    free = np.zeros(len(records), _FREE)
    free["angle"] = (records["angle"] >> _ANGLE_DROP).astype(np.int16)
    for name in ("free_from", "free_to", "c_sfm", "flags"):
        free[name] = records[name]
    bare = free.view(np.uint8).reshape(-1, link_pkg.COMPACT_BYTES)
    rows[:, :8] = np.where(point[:, None], packed, bare)
    rows[:, 8] = records["confidence"] >> 1 | records["inward"] << 7
    return rows.tobytes()


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


def flags_of(records: Records) -> Ints:
    """Return the flags of full records, by the bits of ``pkg.FLAGS`` [n]."""
    flags, bits = (records[name].astype(np.int64) for name in ("flags", "bits"))
    for bit, flag in MORE_FLAGS.items():
        flags = flags | (bits >> bit & 1) << flag
    return flags


def located(records: Records) -> Bools:
    """Return which full records are measured and have a place [n]."""
    return np.asarray(measured(records) & (flags_of(records) & NO_PLACE == 0))


def compact(records: Records) -> Records:
    """Return the compact records of full records, an array of ``COMPACT``.

    A point with NO_RANGE or OUT_OF_RANGE has no x and z, so only its full record counts as
    measured. What is not measured has the ends of its free interval there.
    """
    flags = flags_of(records)
    lost = (records["lost"] != 0).astype(np.int64) << pkg.FLAG_POINTS_LOST
    bits = located(records)
    result = np.zeros(len(records), COMPACT)
    gathered = bits.astype(np.int64) << link_pkg.COMPACT_MEASURED
    for bit, names in _GATHERED.items():
        mask = sum(1 << pkg.FLAGS[name] for name in names)
        gathered |= ((flags | lost) & mask != 0).astype(np.int64) << bit
    for name in ("x", "z", "c_obj"):
        result[name] = records[name]
    result["flags"] = gathered
    return result


def space(records: Records) -> Records:
    """Return the records of points and free beams of full records, an array of ``SPACE``."""
    small = compact(records)
    point = measured(small)
    result = np.zeros(len(records), SPACE)
    result["flags"] = small["flags"]
    for name in ("x", "z", "c_obj"):
        result[name][point] = small[name][point]
    half = 1 << _ANGLE_DROP - 1
    sent = (records["angle"] >> _ANGLE_DROP).astype(np.int16)
    result["angle"][~point] = (sent[~point].astype(np.int64) << _ANGLE_DROP) + half
    result["c_sfm"][~point] = records["c_sfm"][~point]
    for name, source in (("free_from", "x"), ("free_to", "z")):
        ends = records[source].astype(np.int64) >> FREE_ALIGN & (1 << pkg.FREE_WIDTH) - 1
        result[name][~point] = ends[~point]
    result["confidence"] = records["confidence"] & 0xFE
    result["inward"] = (records["bits"] & INWARD) != 0
    return result


def points(records: Records, pixel_width: int = 12, unit_mm: int = 1) -> Points:
    """Return full records as points, without the fields that only the link adds to them.

    Args:
        records: An array of ``FULL``.
        pixel_width: ``PixelWidth`` of the scanner.
        unit_mm: Its unit of length, mm.
    """
    names = [field.name for field in fields(Points) if field.name in (FULL.names or ())]
    found = {name: records[name].astype(np.int64) for name in names}
    found["flags"] = flags_of(records)
    found["width"] = found["right"] - found["left"] + 1
    point = records["bits"] & MEASURED != 0
    for name, source in (("free_from", "x"), ("free_to", "z")):
        found[name] = np.where(point, 0, found[source] >> FREE_ALIGN)
        found[source] = np.where(point, found[source], 0)
    return Points(
        **found,
        measured=point,
        pixel_width=pixel_width,
        unit_mm=unit_mm,
    )


def short_points(found: Records, pixel_width: int, unit_mm: int) -> Points:
    """Return compact records, or those of points and free beams, as points.

    What they lack is 0. Of the flags that share a bit the first stands for all, and what is
    measured has the angle of its place.

    Args:
        found: n records with the number of their line as the field ``line``.
        pixel_width: ``PixelWidth`` of the scanner.
        unit_mm: Its unit of length, mm.
    """
    point, names = measured(found), found.dtype.names or ()
    wide = {name: found[name].astype(np.int64) for name in names}
    none = np.zeros(len(found), np.int64)
    turns = np.arctan2(wide["x"], wide["z"]) / (2.0 * np.pi)
    angle = np.rint(turns * 2.0**pkg.ANGLE_WIDTH).astype(np.int64)
    flags = none
    for bit, (first, *_) in _GATHERED.items():
        flags = flags | (wide["flags"] >> bit & 1) << pkg.FLAGS[first]
    wide |= {"flags": flags, "angle": np.where(point, angle, wide.get("angle", none))}
    columns: dict[str, Any] = {field.name: wide.get(field.name, none) for field in fields(Points)}
    formats = {"pixel_width": pixel_width, "unit_mm": unit_mm}
    return Points(**columns | {"measured": point} | formats)


def form_points(found: Records, form: Form, pixel_width: int = 12, unit_mm: int = 1) -> Points:
    """Return records of any form, with the numbers of their lines, as points."""
    make = points if form is Form.FULL else short_points
    return make(found, pixel_width, unit_mm)
