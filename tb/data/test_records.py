"""Records of points: what is encoded is decoded, and compact ones say what the full ones do."""

import numpy as np
import pytest
from harness import generator
from random_records import random_records

from vrscan.data import link_pkg, pkg
from vrscan.data.points import table
from vrscan.data.records import (
    COMPACT,
    MEASURED,
    MORE_FLAGS,
    compact,
    decode_compact,
    decode_full,
    encode_compact,
    encode_full,
    points,
)

NAMES = {
    link_pkg.COMPACT_WEAK: ("LOW_SNR", "TOO_NARROW", "TOO_WIDE", "NO_PHASE"),
    link_pkg.COMPACT_AT_EDGE: ("AT_EDGE",),
    link_pkg.COMPACT_SATURATED: ("SATURATED",),
    link_pkg.COMPACT_RIVAL: ("RIVAL", "MIXED"),
    link_pkg.COMPACT_RANGE: ("NO_RANGE", "OUT_OF_RANGE"),
    link_pkg.COMPACT_MIRROR: ("NOT_RUNNING", "INDEX_FAULT", "UNSETTLED"),
    link_pkg.COMPACT_LOST: ("LINES_LOST", "POINTS_LOST"),
}


def test_records_are_decoded_as_they_were_encoded() -> None:
    records = random_records(generator(1), range(500))
    assert (decode_full(encode_full(records)) == records).all()
    small = compact(records)
    data = encode_compact(small)
    assert len(data) == 500 * link_pkg.COMPACT_BYTES
    assert (decode_compact(data) == small).all()
    for k in range(500):
        eight = data[8 * k : 8 * k + 8]
        assert int.from_bytes(eight[:3], "little", signed=True) == records["x"][k]
        assert int.from_bytes(eight[3:6], "little", signed=True) == records["z"][k]
        assert eight[6] == records["c_obj"][k]


def test_records_of_no_points_are_no_records() -> None:
    assert len(decode_full(b"")) == len(decode_compact(b"")) == 0
    assert encode_compact(np.zeros(0, COMPACT)) == b""


@pytest.mark.parametrize("name", pkg.FLAGS)
def test_compact_flag_gathers_its_flags(name: str) -> None:
    record = random_records(generator(2), [1])
    raised = 1 << pkg.FLAGS[name]
    record["flags"] = raised & 0xFFFF
    for measured in (False, True):
        more = sum(1 << bit for bit, flag in MORE_FLAGS.items() if raised >> flag & 1)
        record["bits"] = MEASURED * measured | more
        want = sum(1 << bit for bit, names in NAMES.items() if name in names)
        if measured and name not in ("NO_RANGE", "OUT_OF_RANGE"):
            want |= 1 << link_pkg.COMPACT_MEASURED
        assert compact(record)["flags"].tolist() == [want]


def test_lost_points_set_the_compact_flag() -> None:
    record = random_records(generator(3), [1])
    record["flags"], record["bits"], record["lost"] = 0, 0, 1
    assert compact(record)["flags"].tolist() == [1 << link_pkg.COMPACT_LOST]


def test_full_records_become_points() -> None:
    records = random_records(generator(4), range(50))
    got = points(records, 10, 4)
    assert len(got) == 50 and got.pixel_width == 10
    assert np.array_equal(table(got).z_mm, got.z * (4 / 4096))
    bits = records["bits"].astype(np.int64)
    assert (got.flags == records["flags"] + ((bits & 8) << 13) + ((bits & 32) << 12)).all()
    for name in ("line", "position", "row_variance", "c_sfm", "doubt"):
        assert (getattr(got, name) == records[name]).all() and getattr(got, name).dtype == np.int64
    assert (got.width == got.right - got.left + 1).all()
    point = records["bits"] & 1 == 1
    assert 0 < point.sum() < len(point)
    for name, end in (("x", "free_from"), ("z", "free_to")):
        assert (getattr(got, name) == np.where(point, records[name], 0)).all()
        assert (getattr(got, end) == np.where(point, 0, records[name] // 256)).all()
    assert (got.measured == (records["bits"] & 1 == 1)).all()


@pytest.mark.parametrize("decode", [decode_full, decode_compact])
def test_half_a_record_is_refused(decode) -> None:
    with pytest.raises(ValueError, match="buffer size"):
        decode(bytes(12))
