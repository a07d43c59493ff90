"""Filters: what each takes away and keeps, and what it costs in lateral resolution."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import fftconvolve
from test_clouds import scan

from vrscan.data import filters
from vrscan.data.errors import InputError
from vrscan.data.table import Table

SEED = 4
LINES = 4000
PERIOD = 170.4  # lines; not whole, so that sweeps interlace
SIGMA_MM = 0.1
STEP_MM = 10.0
PX_PER_RAD = 3570.0
WIDTH_PX = 16


def surface(z: np.ndarray, angle: np.ndarray, *, flagged: bool = False) -> Table:
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
    columns |= {"position_px": 2000.0 + PX_PER_RAD * angle, "width": np.full(count, WIDTH_PX)}
    columns |= {"sigma_px": np.full(count, 0.1)}
    flags = {name: flagged & (np.arange(count) % (3 + k) == 0) for k, name in enumerate(base.flags)}
    return Table(flags=flags, pixel_width=12, **columns)


def angles(period: float = PERIOD, count: int = LINES) -> np.ndarray:
    """Return angles that a triangular motion has, whose lines are evenly far apart."""
    phase = np.arange(count) / period % 1.0
    return 0.35 * (4.0 * np.abs(phase - 0.5) - 1.0)


def noisy(points: Table, seed: int = SEED) -> Table:
    """Return points with errors of ``SIGMA_MM``, of which 0.9 is that of a spot on pixels.

    Each pixel has a gain of its own, as under speckle, so the middle of a Gaussian spot errs by
    the sum of gain times offset times light: the same whenever the spot is at the same place.
    """
    rng = np.random.default_rng(seed)
    fine, spot = 20, 0.25 * WIDTH_PX  # places a pixel at which the error is computed
    gain = np.zeros(4000 * fine)
    gain[::fine] = rng.normal(size=4000)
    away = np.arange(-100 * fine // 4, 100 * fine // 4 + 1) / fine
    light = away * np.exp(-0.5 * (away / spot) ** 2)
    error = fftconvolve(gain, light, mode="same") / np.sqrt(np.square(light[::fine]).sum())
    speckle = np.interp(points.position_px, np.arange(len(gain)) / fine, error)
    noise = rng.normal(size=len(points))
    z = points.z_mm + SIGMA_MM * (np.sqrt(0.9) * speckle + np.sqrt(0.1) * noise)
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
MOVING = [name for name in FILTERS if name[:3] in ("med", "ave")]
GAINS = {  # noise before over noise after on a flat surface, as docs/formats.md has it
    "median 3": 1.35,
    "median 5": 1.6,
    "median 9": 1.8,
    "average 2": 1.27,
    "average 4": 1.63,
    "average 8": 1.93,
}


@pytest.mark.parametrize("name", MOVING)
def test_noise_falls_on_a_flat_surface_and_sigma_says_by_how_much(name: str) -> None:
    errors, ratios = [], []
    for seed in range(3):
        found = FILTERS[name](noisy(FLAT, seed))
        errors.append(found.z_mm - 400.0)
        ratios.append(errors[-1] / found.sigma_z_mm)
    gain = SIGMA_MM / float(np.std(errors))
    ratio = float(np.sqrt(np.mean(np.square(ratios))))
    print(f"{name}: gain {gain:.2f}, error/sigma {ratio:.2f}")
    assert gain == pytest.approx(GAINS[name], rel=0.06)
    assert 0.77 < ratio < 1.2


@pytest.mark.parametrize("name", MOVING)
def test_nothing_moves_across_an_edge(name: str) -> None:
    before = noisy(EDGE)
    after = FILTERS[name](before)
    assert np.abs(after.z_mm - EDGE.z_mm).max() < 5.0 * SIGMA_MM
    far = np.abs(EDGE.angle_rad - 0.05) > 0.1
    assert np.std((after.z_mm - EDGE.z_mm)[far]) < 0.9 * np.std((before.z_mm - EDGE.z_mm)[far])


@pytest.mark.parametrize("name", MOVING)
def test_a_plane_stays_where_it_is_up_to_the_ends_of_its_sweeps(name: str) -> None:
    """Angles of a resonant mirror, whose lines crowd at the turning points."""
    angle = 0.35 * np.cos(np.arange(3000) / 75.07 * np.pi)
    for slope in (0.5, -1.0):
        wall = 400.0 / (1.0 - slope * np.tan(angle))
        after = FILTERS[name](surface(wall, angle))
        assert np.abs(after.z_mm - wall).max() < 1e-9
        assert np.mean(after.sigma_z_mm < 0.95 * SIGMA_MM) > 0.5
    assert np.array_equal(FILTERS[name](surface(wall, angle)).located, np.ones(3000, np.bool_))


CURVED = {
    "ball": lambda angle: 400.0 - np.sqrt(np.maximum(60.0**2 - (400.0 * angle) ** 2, 0.0)),
    "waves": lambda angle: 400.0 + 3.0 * np.sin(angle / 0.02),
    "ramps": lambda angle: 400.0 + 100.0 * np.abs(angle / 0.1 % 1.0 - 0.5),
    # A thread whose pitch is the distance of a sweep's lines: a sweep alone takes it for a plane.
    "thread": lambda angle: 400.0 + 2.0 * np.sin(2.0 * np.pi * angle / (1.4 / PERIOD)),
    "bars": lambda angle: 400.0 - 8.0 * (angle / 0.07 % 1.0 < 0.1),
}


@pytest.mark.parametrize("shape", CURVED)
@pytest.mark.parametrize("name", MOVING)
def test_no_shape_is_worse_than_before(name: str, shape: str) -> None:
    true = CURVED[shape](angles())
    before = noisy(surface(true, angles()))
    after = FILTERS[name](before)
    old, new = before.z_mm - true, after.z_mm - true
    ratio = float(np.sqrt(np.mean(np.square(new / after.sigma_z_mm))))
    print(f"{shape}, {name}: rms {np.std(old):.4f} to {np.std(new):.4f}, error/sigma {ratio:.2f}")
    assert np.sqrt(np.mean(new**2)) <= 1.01 * np.sqrt(np.mean(old**2))
    assert 0.8 < ratio < 1.25


@pytest.mark.parametrize("name", MOVING)
def test_points_with_a_doubt_or_two_spots_stay_and_move_no_others(name: str) -> None:
    before = noisy(FLAT)
    odd = np.arange(LINES) % 50 == 7
    high = replace(before, z_mm=before.z_mm + np.where(odd, 0.25, 0.0))
    plain = FILTERS[name](replace(before, located=~odd))
    for other in (
        replace(high, doubt_px=np.where(odd, 0.05, 0.0)),
        replace(high, flags=dict(high.flags, MIXED=odd)),
        replace(high, flags=dict(high.flags, RIVAL=odd)),
    ):
        after = FILTERS[name](other)
        assert np.array_equal(after.z_mm[odd], high.z_mm[odd])
        assert np.array_equal(after.sigma_z_mm[odd], high.sigma_z_mm[odd])
        assert np.allclose(after.z_mm[~odd], plain.z_mm[~odd])


def test_a_median_stays_in_its_run_of_lines() -> None:
    """Beside lines without a point, and with the numbers of lines that a slow link lets through."""
    before = noisy(FLAT)
    gap = np.arange(LINES) % 3 == 0  # leaves pairs, and no line between two others
    after = filters.median(replace(before, located=~gap), 3)
    assert np.array_equal(after.z_mm, before.z_mm)
    after = filters.median(before.of(~gap), 3)  # the same, with their rows left out
    assert np.mean(after.z_mm == before.z_mm[~gap]) == 1.0
    after = filters.median(replace(before, line=13 * before.line), 3)
    assert np.array_equal(after.z_mm, filters.median(before, 3).z_mm)


@pytest.mark.parametrize("name", FILTERS)
def test_rows_and_flags_stay_and_a_moved_point_stays_on_its_beam(name: str) -> None:
    flagged = surface(EDGE.z_mm, angles(), flagged=True)
    before = replace(noisy(flagged), located=np.arange(LINES) % 7 != 0)
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


@pytest.mark.parametrize("name", FILTERS)
@pytest.mark.parametrize("count", [0, 1, 2, 7])
def test_few_points_or_none_are_no_error(name: str, count: int) -> None:
    few = FLAT.of(slice(0, count))
    for points in (few, replace(few, located=np.zeros(count, np.bool_))):
        assert len(FILTERS[name](points)) == count


def some(z: list[float], located: list[int] | None = None) -> Table:
    points = surface(np.array(z, np.float64), 0.01 * np.arange(len(z)))
    return points if located is None else replace(points, located=np.array(located, np.bool_))


def test_a_spike_goes_and_edge_slope_and_what_is_two_lines_wide_stay() -> None:
    z = [400, 400, 430, 400, 400, 450, 450, 400, 400, 500, 500, 510, 520, 500, 500]
    assert np.flatnonzero(~filters.spike(some(z), 20.0).located).tolist() == [2]
    assert np.flatnonzero(~filters.spike(some(z), 31.0).located).tolist() == []
    across = some([400, 400, 0, 430, 0, 400, 400], [1, 1, 0, 1, 0, 1, 1])  # holes on either side
    assert filters.spike(across, 20.0).located.tolist() == [1, 1, 0, 0, 0, 1, 1]


@pytest.mark.parametrize("name", ["spike", "outlier"])
def test_what_other_sweeps_see_as_well_is_no_spike(name: str) -> None:
    """A bar of one line's width, seen once or in each sweep, and a surface that ends in a slope."""
    bar = np.abs(angles() - 0.05) < 0.5 * 1.4 / PERIOD
    once = bar & (np.arange(LINES) // PERIOD == 10)
    for which, left in ((bar, bar), (once, np.zeros(LINES, np.bool_))):
        before = surface(400.0 - 8.0 * which, angles())
        assert np.array_equal(FILTERS[name](before).located, left | ~which)
    steep = surface(400.0 / (1.0 - 3.0 * np.abs(np.tan(angles()))).clip(0.1), angles())
    assert FILTERS[name](steep).located[np.abs(steep.angle_rad) > 0.3].all()


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
