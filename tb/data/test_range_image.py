"""Sweeps and the image of distances: a wall's image is its distances, hole for hole."""

import io

import numpy as np
import pytest
from PIL import Image
from test_clouds import LINES, PERIOD, scan

from vrscan.data.errors import InputError
from vrscan.data.range_image import STEP_MM, grid, range_image, step_mm, sweeps, write_image


@pytest.mark.parametrize(
    ("angles", "want"),
    [
        ([], []),
        ([0.1], [0]),
        ([0.0, 0.0, 0.0], [0, 0, 0]),
        ([0.0, 0.1, 0.2], [0, 0, 0]),
        ([0.0, 0.0, 0.1, 0.1, 0.0, 0.0, 0.1], [0, 0, 0, 0, 1, 1, 2]),
        ([0.2, 0.1, 0.0, 0.1, 0.2, 0.1], [0, 0, 0, 1, 1, 2]),
        # A polygon's beam jumps back, and the line to which it jumps begins the next sweep.
        ([0.0, 0.1, 0.2, -0.2, -0.1, 0.0, 0.1, -0.3, -0.2], [0, 0, 0, 1, 1, 1, 1, 2, 2]),
        ([0.2, 0.1, 0.1, 0.6, 0.6, 0.5, 0.4], [0, 0, 0, 1, 1, 1, 1]),
        ([0.2, 0.1, 0.4, 0.3, 0.2], [0, 0, 1, 2, 2]),  # three steps are no jump
    ],
)
def test_a_sweep_ends_where_the_mirror_turns(angles: list[float], want: list[int]) -> None:
    assert sweeps(np.array(angles)).tolist() == want[: len(angles)]


def test_a_row_is_a_sweep_and_a_column_an_angle() -> None:
    points = scan()
    sweep, columns = sweeps(points.angle_rad), grid(points.angle_rad)
    image = range_image(points, sweep, columns)
    assert image.shape == (int(2 * LINES / PERIOD) + 1, columns.count)
    distance = np.hypot(points.x_mm, points.z_mm)
    seen = np.argwhere(np.isfinite(image))
    for row, column in seen:
        there = points.located & (sweep == row)
        at = np.abs(points.angle_rad - columns.middles()[column])
        nearest = np.flatnonzero(there)[np.argmin(at[there])]
        assert image[row, column] == np.float32(distance[nearest])
    # All lines have a place in it but those that share a column, near the turning points.
    used = np.unique(
        np.stack([sweep, columns.columns(points.angle_rad)])[:, points.located], axis=1
    )
    assert len(seen) == used.shape[1]
    full = range_image(scan_without_holes(), sweep, columns)
    assert np.isfinite(full[1:-1]).mean() > 0.95


def scan_without_holes():
    from dataclasses import replace

    return replace(scan(), located=np.ones(LINES, np.bool_))


@pytest.mark.parametrize("suffix", [".png", ".tif"])
@pytest.mark.parametrize("times", [1, 2, 8])
def test_a_file_has_the_distances(suffix: str, times: int) -> None:
    """A PNG in the least step that reaches the farthest point, which it says."""
    image = times * np.array([[400.01, np.nan, 0.001], [2047.0, 2047.96875, 31.25]], np.float32)
    file = io.BytesIO()
    write_image(image, suffix, file)
    read = Image.open(file)
    pixels = np.asarray(read)
    if suffix == ".tif":
        assert pixels.dtype == np.float32
        assert np.array_equal(pixels, image, equal_nan=True)
    else:
        step = float(read.text["step_mm"])
        assert step == step_mm(image) == times * STEP_MM
        assert pixels.tolist() == [[12800, 0, 1], [65504, 65535, 1000]]


def test_the_step_doubles_with_the_first_distance_that_does_not_fit() -> None:
    farthest = np.float32((2**16 - 1) * STEP_MM)
    for distance, want in ((farthest, 1), (np.nextafter(farthest, np.float32(np.inf)), 2)):
        assert step_mm(np.array([[distance]])) == want * STEP_MM
    assert step_mm(np.full((2, 2), np.nan, np.float32)) == STEP_MM


@pytest.mark.parametrize("count", [0, -3, 70_000])
def test_a_number_of_columns_out_of_range_is_refused(count: int) -> None:
    with pytest.raises(InputError, match=rf"--columns: .*\({count}\)"):
        grid(scan().angle_rad, count)


def test_lines_at_one_angle_are_one_column() -> None:
    columns = grid(np.zeros(5))
    assert columns.count == 1
    assert columns.columns(np.zeros(5)).tolist() == [0] * 5
