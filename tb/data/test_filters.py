"""Filters: what each takes away and keeps, and what it costs in lateral resolution."""

from dataclasses import replace

import numpy as np
import pytest
from test_clouds import scan

from vrscan.data import filters
from vrscan.data.errors import InputError
from vrscan.data.range_image import sweeps
from vrscan.data.table import Table

SEED = 4
LINES = 8000
PERIOD = 170.4  # lines; not whole, so that sweeps interlace
SIGMA_MM = 0.1
STEP_MM = 10.0


def surface(z: np.ndarray, angle: np.ndarray) -> Table:
    """Return points of a scan that meets a surface on every line, without noise."""
    count = len(z)
    base = scan().of(np.zeros(1000, np.bool_))
    columns = {
        name: np.zeros(count, getattr(base, name).dtype)
        for name in base.__dataclass_fields__
        if name not in ("flags", "pixel_width")
    }
    columns |= {"line": np.arange(count), "angle_rad": angle, "z_mm": z, "x_mm": z * np.tan(angle)}
    columns |= {"located": np.ones(count, np.bool_), "measured": np.ones(count, np.bool_)}
    columns |= {"sigma_z_mm": np.full(count, SIGMA_MM), "c_obj": np.linspace(0.0, 1.0, count)}
    flags = {name: np.arange(count) % (3 + k) == 0 for k, name in enumerate(base.flags)}
    return Table(flags=flags, pixel_width=12, **columns)


def angles(period: float = PERIOD, count: int = LINES) -> np.ndarray:
    """Return angles that a triangular motion has, whose lines are evenly far apart."""
    phase = np.arange(count) / period % 1.0
    return 0.35 * (4.0 * np.abs(phase - 0.5) - 1.0)


def noisy(points: Table) -> Table:
    rng = np.random.default_rng(SEED)
    z = points.z_mm + rng.normal(0.0, SIGMA_MM, len(points))
    return replace(points, z_mm=z, x_mm=z * np.tan(points.angle_rad))


FLAT = surface(np.full(LINES, 400.0), angles())
EDGE = surface(400.0 + STEP_MM * (angles() > 0.05), angles())
FILTERS = {
    "median 3": lambda points: filters.median(points, 3),
    "median 5": lambda points: filters.median(points, 5),
    "median 9": lambda points: filters.median(points, 9),
    "spike": lambda points: filters.spike(points, 5.0),
    "outlier": lambda points: filters.outlier(points, 5.0),
    "average 2": lambda points: filters.average(points, 2),
    "average 4": lambda points: filters.average(points, 4),
    "average 8": lambda points: filters.average(points, 8),
}


def edge_lines(points: Table) -> float:
    """Return the 10 to 90 % width of the edge, in distances of a sweep's lines.

    The points of all sweeps are laid over each other by angle, as an image of all of them has them.
    """
    rows = points.located
    away = points.angle_rad[rows] - 0.05
    level = (points.z_mm[rows] - 400.0) / STEP_MM
    between = (level > 0.1) & (level < 0.9)
    spacing = 1.4 / PERIOD
    return float(np.ptp(away[between]) / spacing) if between.any() else 0.0


def kept(name: str, width: int) -> float:
    """Return the share of a bar's height that is left of a bar of so many lines in each sweep."""
    place = angles()
    spacing = 1.4 / PERIOD
    bar = np.abs(place - 0.05) < 0.5 * width * spacing
    found = FILTERS[name](surface(400.0 - STEP_MM * bar, place))
    middle = found.located & (np.abs(place - 0.05) < 0.5 * spacing)
    there = np.abs(place - 0.05) < 0.5 * spacing
    height = np.where(middle, (400.0 - found.z_mm) / STEP_MM, 0.0)
    return float(height[there].mean())


def narrowest(name: str) -> int:
    """Return the least width of a bar, in lines, of which half of the height is left."""
    return next(width for width in range(1, 12) if kept(name, width) >= 0.5)


# Gain: noise before over noise after, flat surface. Edge: 10 to 90 %, lines of a sweep. Bar: the
# narrowest that is left, lines of a sweep. docs/formats.md has the same figures.
COSTS = {
    "median 3": (1.5, 0.0, 2),
    "median 5": (1.88, 0.0, 3),
    "median 9": (2.51, 0.0, 5),
    "spike": (1.0, 0.0, 2),
    "outlier": (1.0, 0.0, 4),
    "average 2": (1.63, 1.4, 1),
    "average 4": (2.14, 1.2, 1),
    "average 8": (2.92, 1.0, 1),
}


@pytest.mark.parametrize("name", FILTERS)
def test_the_cost_in_lateral_resolution(name: str) -> None:
    flat = FILTERS[name](noisy(FLAT))
    gain = SIGMA_MM / float(np.std(flat.z_mm[flat.located]))
    edge = edge_lines(FILTERS[name](EDGE))
    told = float(np.median(flat.sigma_z_mm))
    print(f"{name}: gain {gain:.2f}, told {SIGMA_MM / told:.2f}, edge {edge:.2f} lines, "
          f"bar {narrowest(name)} lines")  # fmt: skip
    want_gain, want_edge, want_bar = COSTS[name]
    assert gain == pytest.approx(want_gain, rel=0.04)
    assert SIGMA_MM / told == pytest.approx(gain, rel=0.05)
    assert edge == pytest.approx(want_edge, abs=0.15)
    assert narrowest(name) == want_bar


@pytest.mark.parametrize("name", FILTERS)
def test_rows_and_flags_stay_and_a_moved_point_stays_on_its_beam(name: str) -> None:
    before = replace(noisy(EDGE), located=np.arange(LINES) % 7 != 0)
    after = FILTERS[name](before)
    assert len(after) == len(before)
    for flag, raised in before.flags.items():
        assert np.array_equal(after.flags[flag], raised)
    assert not (after.located & ~before.located).any()
    for column in ("line", "angle_rad", "c_obj", "measured", "position_px", "time_s"):
        assert np.array_equal(getattr(after, column), getattr(before, column))
    rows = after.located
    assert np.allclose(after.x_mm[rows], (after.z_mm * np.tan(after.angle_rad))[rows])
    assert np.isfinite(after.z_mm[rows]).all() and np.isfinite(after.sigma_z_mm[rows]).all()


def some(z: list[float], located: list[int] | None = None) -> Table:
    points = surface(np.array(z, np.float64), 0.01 * np.arange(len(z)))
    return points if located is None else replace(points, located=np.array(located, np.bool_))


def test_a_spike_goes_and_edge_slope_and_what_is_two_lines_wide_stay() -> None:
    z = [400, 400, 430, 400, 400, 450, 450, 400, 400, 500, 500, 510, 520, 500, 500]
    assert np.flatnonzero(~filters.spike(some(z), 20.0).located).tolist() == [2]
    assert np.flatnonzero(~filters.spike(some(z), 31.0).located).tolist() == []
    across = some([400, 400, 0, 430, 0, 400, 400], [1, 1, 0, 1, 0, 1, 1])  # holes on either side
    assert filters.spike(across, 20.0).located.tolist() == [1, 1, 0, 0, 0, 1, 1]


def test_a_median_needs_half_of_its_window() -> None:
    z = [400, 401, 450, 403, 404, 405, 406]
    found = filters.median(some(z), 3).z_mm
    assert found.tolist() == [400.5, 401, 403, 404, 404, 405, 405.5]
    found = filters.median(some(z, [1, 0, 1, 0, 1, 1, 1]), 3)
    assert found.z_mm[[0, 2]].tolist() == [400, 450]
    assert found.located.tolist() == [True, False, True, False, True, True, True]


def test_an_outlier_is_far_from_the_lines_around_by_their_spread_and_its_own_sigma() -> None:
    z = [400.0, 400.1, 399.9, 401.5, 400.0, 400.1, 399.9, 400.0, 400.1, 400.0]
    assert np.flatnonzero(~filters.outlier(some(z), 5.0).located).tolist() == [3]
    doubtful = replace(some(z), sigma_z_mm=np.full(len(z), 1.0))
    assert filters.outlier(doubtful, 5.0).located.all()


def test_confidence_and_flags_choose_points_exactly() -> None:
    found = filters.min_confidence(FLAT, 0.25)
    assert np.array_equal(found.located, FLAT.c_obj >= 0.25)
    found = filters.without_flags(FLAT, "MIXED,RIVAL")
    assert np.array_equal(found.located, ~(FLAT.flags["MIXED"] | FLAT.flags["RIVAL"]))


def test_an_average_of_sweeps_that_do_not_interlace_is_that_of_each_angle() -> None:
    still = surface(np.full(1600, 400.0), angles(160.0, 1600))
    found = filters.average(noisy(still), 4)
    inner = np.abs(still.angle_rad) < 0.3
    assert np.std(found.z_mm[inner]) == pytest.approx(SIGMA_MM / 2.0, rel=0.15)


@pytest.mark.parametrize("scans", [2, 3, 8])
def test_an_average_leaves_a_tilted_wall_where_it_is(scans: int) -> None:
    """The error is the wall's slope times a part of the distance of interlaced lines."""
    place = angles()
    wall = 400.0 / (1.0 - 0.5 * np.tan(place))  # 27 degrees
    error = filters.average(surface(wall, place), scans).z_mm - wall
    group = sweeps(place) // scans
    inner = (np.abs(place) < 0.3) & (group < group.max())
    assert np.abs(np.mean(error[inner])) < 0.01
    assert np.abs(error[inner]).max() < 1.5  # a sweep's lines are 2 mm of depth apart there


def test_filters_work_in_the_order_in_which_they_are_given() -> None:
    z = [400.0, 400.0, 460.0, 400.0, 400.0, 400.0]
    first = filters.median(filters.spike(some(z), 20.0), 3)
    other = filters.spike(filters.median(some(z), 3), 20.0)
    assert first.located.tolist() == [True, True, False, True, True, True]
    assert other.located.all()


WRONG = {
    "an even window": (lambda: filters.median(FLAT, 4), "--median: must be odd"),
    "no window": (lambda: filters.median(FLAT, 1), "--median"),
    "no height": (lambda: filters.spike(FLAT, 0.0), "--spike: must be above 0"),
    "no number": (lambda: filters.outlier(FLAT, float("nan")), "--outlier"),
    "a percentage": (
        lambda: filters.min_confidence(FLAT, 90.0),
        "--min-confidence: must be 0 to 1",
    ),
    "no flag": (lambda: filters.without_flags(FLAT, "MIXT"), "did you mean 'MIXED'"),
    "one sweep": (lambda: filters.average(FLAT, 1), "--average: must be 2"),
}


@pytest.mark.parametrize("case", WRONG)
def test_what_a_filter_does_not_take_is_told(case: str) -> None:
    call, text = WRONG[case]
    with pytest.raises(InputError, match=text):
        call()
