"""Sweeps and the image of distances: a wall's image is its distances, hole for hole."""

import io
import math
from collections.abc import Callable

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
    for exact in (False, True):
        assert sweeps(np.array(angles), exact=exact).tolist() == want[: len(angles)]


# Where a wave of a period turns or jumps back, periods, and its angle over the phase.
WAVES: dict[str, tuple[list[float], Callable[[np.ndarray], np.ndarray]]] = {
    "resonant": ([0.25, 0.75], lambda phase: np.sin(2.0 * np.pi * phase)),
    "triangle": ([0.25, 0.75], lambda phase: 1.0 - 4.0 * np.abs((phase + 0.25) % 1.0 - 0.5)),
    "polygon": ([0.5], lambda phase: 2.0 * ((phase + 0.5) % 1.0) - 1.0),
}


@pytest.mark.parametrize("wave", WAVES)
@pytest.mark.parametrize("period", [75.3, 200.7, 2000.9])
@pytest.mark.parametrize("noise", ["none", "a step", "seldom a step", "normal", "three steps"])
def test_noise_and_steps_of_a_converter_are_no_turns(wave: str, period: float, noise: str) -> None:
    """21 sweeps of a galvanometer, whose angles have 12 bits: of the lines around each turn."""
    turns, angle = WAVES[wave]
    periods = 20.6 / len(turns)
    phase = np.arange(int(periods * period)) / period
    draw = np.random.default_rng(12)
    added = {
        "none": 0.0 * phase,
        "a step": draw.integers(-1, 2, len(phase)),
        "seldom a step": np.where(draw.random(len(phase)) < 0.03, 1, 0),
        "normal": draw.normal(0.0, 1.0, len(phase)),
        "three steps": draw.normal(0.0, 3.0, len(phase)),
    }[noise]
    read = np.rint(2047.0 * angle(phase) + added) * (0.35 / 2047.0)
    at = np.flatnonzero(np.diff(sweeps(read))) + 1
    want = [n + turn for n in range(math.ceil(periods)) for turn in turns if n + turn < periods]
    assert len(at) == len(want) in (20, 21)
    away = 0.0 if wave == "polygon" else 0.02  # periods in which a sine moves by 16 of 4096 steps
    assert np.abs(at / period - want).max() <= away + 1.0 / period
    if noise == "none" and wave == "polygon":
        assert np.array_equal(sweeps(read), sweeps(read, exact=True))


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
