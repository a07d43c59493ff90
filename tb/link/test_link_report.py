"""The files that a stream of points ends in."""

import csv
import io

import numpy as np
import pytest

from vrscan.data import records
from vrscan.data.records import FULL, Form
from vrscan.link.link_report import write_points
from vrscan.link.register_host import Build


def test_full_points_have_their_power_and_a_time_that_does_not_wrap() -> None:
    found = np.zeros(4, FULL)
    found["bits"], found["maximum"] = records.MEASURED, 100
    found["power"] = [65535, 13107, 0, 65535]
    found["time"] = [2**32 - 200, 2**32 - 100, 50, 150]  # clocks
    file = io.BytesIO()
    build = object.__new__(Build)
    object.__setattr__(build, "pixel_width", 12)
    object.__setattr__(build, "clock_hz", 100)
    write_points(".csv", file, found, Form.FULL, 1, build, None)
    rows = list(csv.DictReader(io.StringIO(file.getvalue().decode())))
    begin = (2**32 - 200) / 100
    time = [float(row["time_s"]) - begin for row in rows]
    assert time == pytest.approx([0.0, 1.0, 2.5, 3.5], abs=1e-6)
    assert [row["power"] for row in rows] == ["65535", "13107", "0", "65535"]
    assert [row["intensity"] for row in rows] == ["100.000", "500.000", "", "100.000"]
