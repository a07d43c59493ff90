"""The table of points: its examples, its intensity, and rows that are taken out and joined."""

import doctest
from dataclasses import replace

import numpy as np
import pytest
from test_clouds import scan

from vrscan.data import range_image, table
from vrscan.data.extras import MissingError
from vrscan.data.table import Table


@pytest.mark.parametrize("module", [table, range_image])
def test_the_examples_run(module) -> None:
    found = doctest.testmod(module)
    assert found.attempted > 0
    assert found.failed == 0


def test_intensity_is_the_height_at_full_power() -> None:
    power = np.array([65535.0, 32767.5, 0.0, np.nan, 65535.0, 65535.0])
    points = replace(
        scan().of(np.arange(1000) < 6),
        maximum=np.array([160, 160, 160, 160, 160, 10]),
        background=np.full(6, 60.0),
        power=power,
        measured=np.array([True] * 4 + [False, True]),
    )
    want = [100.0, 200.0, np.nan, np.nan, np.nan, 0.0]
    assert np.array_equal(points.intensity, want, equal_nan=True)


def test_rows_that_are_joined_again_are_the_same() -> None:
    points = scan()
    first = np.arange(len(points)) < 300
    again = Table.joined([points.of(first), points.of(~first)])
    assert points.to_frame().equals(again.to_frame())


def test_without_pandas_a_frame_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    import sys

    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(MissingError, match=r"pandas is missing: .*\[scene\]"):
        scan().to_frame()
