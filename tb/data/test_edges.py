"""Recorded edges: what is read, what a board would sample of them, how bad files are refused."""

from pathlib import Path

import numpy as np
import pytest

from vrscan.data.edges import pairs, read, sample
from vrscan.data.errors import InputError

CLOCK_HZ = 125e6


def write(folder: Path, text: str) -> Path:
    path = folder / "edges.csv"
    path.write_text(text)
    return path


def test_levels_hold_from_their_row_on(tmp_path: Path) -> None:
    path = write(tmp_path, "time_s,comparator,gate\n0,0,1\n1e-6,1,1\n2e-6,1,0\n")
    time, comparator, gate = read(path)
    assert time.tolist() == [0.0, 1e-6, 2e-6]
    assert comparator.tolist() == [0, 1, 1]
    assert gate.tolist() == [1, 1, 0]


@pytest.mark.parametrize("oversample", [1, 2, 4, 8])
def test_samples_are_the_levels_at_their_times(oversample: int) -> None:
    """Every sample of every clock, rebuilt from the changes, against the levels at its time."""
    random = np.random.default_rng(7)
    count, clocks = 300, 2000
    grid = np.sort(random.choice(clocks * oversample - 1, count, replace=False)) + 1
    time = grid / (CLOCK_HZ * oversample)  # on samples, where rounding could go either way
    comparator, gate = random.integers(0, 2, (2, count))
    rows = sample(time, comparator, gate, clock_hz=CLOCK_HZ, oversample=oversample)
    assert (np.diff(rows["clock"]) > 0).all()
    row = np.searchsorted(rows["clock"], np.arange(clocks + 2), side="right") - 1
    for name, level in (("comparator", comparator), ("gate", gate)):
        words = np.where(row >= 0, rows[name][row], 0)
        bits = (words[:, None] >> np.arange(oversample) & 1).ravel()
        index = np.searchsorted(grid, np.arange(len(bits)), side="right") - 1
        assert np.array_equal(bits, np.where(index >= 0, level[index], 0)), name


def test_an_edge_between_two_samples_is_seen_by_the_later_one() -> None:
    rows = sample(np.array([9.1e-9]), np.array([1]), np.array([1]), clock_hz=125e6, oversample=4)
    assert rows.tolist() == [(1, 0b1110, 0b1110), (2, 0b1111, 0b1111)]


def test_pairs_are_crossings_in_the_light() -> None:
    time = np.arange(8.0)
    comparator = np.array([1, 0, 0, 1, 0, 0, 0, 1])
    gate = np.array([0, 1, 1, 1, 1, 0, 1, 1])
    outward, inward = pairs(time, comparator, gate)
    assert (outward.tolist(), inward.tolist()) == ([3.0], [4.0])


BAD = {
    "no_header": ("0,0,0\n", "no column time_s (has none)"),
    "other_columns": ("time,comparator,gate\n0,0,0\n", "no column time_s (has time, comparator"),
    "empty": ("", "no column time_s (has none)"),
    "no_row": ("time_s,comparator,gate\n", "no edges"),
    "short_row": ("time_s,comparator,gate\n0,1\n", "line 2: 2 fields"),
    "level_of_two": ("time_s,comparator,gate\n0,2,0\n", "line 2: comparator '2' is not 0 or 1"),
    "text": ("time_s,comparator,gate\nnow,1,0\n", "line 2: time_s 'now'"),
    "nan": ("time_s,comparator,gate\nnan,1,0\n", "line 2: time_s 'nan'"),
    "open_quote": ('time_s,comparator,gate\n0,0,0\n"1,1,0\n' + "2,1,0\n" * 999, "line 3: not"),
    "twice": ("time_s,comparator,gate,Gate\n0,0,0,0\n", "2 columns gate"),
    "long_level": ("time_s,comparator,gate\n0,0," + 5000 * "9" + "\n", "line 2: gate '999"),
    "backwards": (
        "time_s,comparator,gate\n2,1,0\n1,0,0\n",
        "line 3: time_s 1 is before the row above",
    ),
}


@pytest.mark.parametrize("name", BAD)
def test_a_bad_file_is_one_line_that_names_file_and_place(tmp_path: Path, name: str) -> None:
    text, part = BAD[name]
    path = write(tmp_path, text)
    with pytest.raises(InputError) as caught:
        read(path)
    assert str(path) in str(caught.value)
    assert part in str(caught.value)
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < len(str(path)) + 300


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"none\.csv"):
        read(tmp_path / "none.csv")
