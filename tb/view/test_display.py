"""What is shown of points: the last ones, rows of whole periods, shares, and a range that rests."""

import time
from dataclasses import replace

import numpy as np
import pytest
from random_records import random_records

from vrscan.data import points, records
from vrscan.data.records import Form
from vrscan.data.table import Table
from vrscan.view import display as module
from vrscan.view.display import COLUMNS, KEPT, ROW_LINES, ROWS, Display
from vrscan.view.picture import followed, profile

SEED = 20261125
PER_PERIOD = 150.1


def scanned(count: int, distance_mm: float = 400.0) -> Table:
    """Return points on a circle around the mirror, as its sweeps find them."""
    angle = np.radians(20.5) * np.sin(2.0 * np.pi * np.arange(count) / PER_PERIOD)
    made = random_records(np.random.default_rng(SEED), range(count))
    made["flags"], made["bits"] = 0, records.MEASURED
    found = points.table(records.points(made))
    place = {"x_mm": distance_mm * np.sin(angle), "z_mm": distance_mm * np.cos(angle)}
    return replace(found, angle_rad=angle, **place)


@pytest.mark.parametrize("block", [7, 400, 5000])
def test_an_image_of_a_circle_has_one_distance(block: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "ROWS_A_S", np.inf)
    display, found = Display(), scanned(20_000)
    for start in range(0, len(found), block):
        display.take(found.of(slice(start, start + block)))
    image, reach = display.image()
    assert image.shape == (ROWS, COLUMNS)
    assert np.radians(20.5) <= reach < np.radians(21.5)
    rows = np.isfinite(image).any(axis=1)
    assert rows.sum() >= min(ROWS, 20_000 // block, 20_000 // (2 * ROW_LINES))
    assert np.isfinite(image[rows]).mean() > 0.8
    np.testing.assert_allclose(image[np.isfinite(image)], 400.0, rtol=1e-6)
    assert display.count == 20_000


def test_rows_are_no_faster_than_an_eye() -> None:
    display, begun = Display(), time.monotonic()
    found = scanned(40_000)
    for start in range(0, len(found), 400):
        display.take(found.of(slice(start, start + 400)))
    spent = time.monotonic() - begun
    rows = np.isfinite(display.image()[0]).any(axis=1).sum()
    assert 1 <= rows <= 1 + spent * module.ROWS_A_S


def test_the_last_points_are_kept_and_no_more() -> None:
    display, found = Display(), scanned(10 * KEPT)
    assert display.last() is None
    for start in range(0, len(found), 333):
        display.take(found.of(slice(start, start + 333)))
    last = display.last()
    assert last is not None
    np.testing.assert_array_equal(last.line, found.line[-KEPT:])
    assert sum(map(len, display._last)) < KEPT + 2 * 333
    assert sum(map(len, display._open)) < 16 * ROW_LINES


def test_a_sample_sums_up_what_came(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "SAMPLE_S", 0.0)
    display, found = Display(), scanned(1000)
    flags = {name: np.arange(1000) % 4 == 0 for name in found.flags}
    half = np.arange(1000) % 2 == 0
    display.mirror = 20.5, 0.001
    display.take(replace(found, flags=flags, measured=half, snr=np.where(half, 40.0, 1.0)))
    display.tick(17)
    display.tick(20)
    first, second = display.samples()
    assert (first.valid, first.snr, first.lost, first.amplitude_deg) == (0.5, 40.0, 17, 20.5)
    assert second.lost == 3 and second.rate == 0.0 and np.isnan(second.valid)
    assert set(display.flags.values()) == {0.25}


def test_a_profile_has_every_point_once_with_its_sigma_along_the_beam() -> None:
    found = points.table(records.points(random_records(np.random.default_rng(SEED), range(900))))
    drawn = profile(found)
    assert len(drawn.sound["x"]) + len(drawn.doubtful["x"]) == found.located.sum()
    reach = np.stack([drawn.sigma[name] for name in ("x0", "z0", "x1", "z1")])
    rows = found.located & (found.sigma_z_mm > 0.0)
    np.testing.assert_allclose(reach[3] - reach[1], 2.0 * found.sigma_z_mm[rows])
    slope = np.tan(found.angle_rad[rows])
    np.testing.assert_allclose(reach[0], slope * reach[1])
    np.testing.assert_allclose(reach[2], slope * reach[3])
    assert (drawn.free["z0"] < drawn.free["z1"]).all()


def test_a_range_follows_and_rests() -> None:
    draw = np.random.default_rng(SEED)
    first = followed((0.0, 1.0), draw.normal(500.0, 10.0, 1000))
    assert first[0] < 480.0 and 520.0 < first[1] < 560.0
    assert followed(first, draw.normal(500.0, 9.0, 1000)) == first
    assert followed(first, np.empty(0)) == first
    low, high = followed(first, draw.normal(500.0, 1.0, 1000))
    assert first[0] < low < high < first[1]


@pytest.mark.parametrize("form", [Form.COMPACT, Form.SPACE])
def test_short_records_have_the_places_of_full_ones(form: Form) -> None:
    full = random_records(np.random.default_rng(SEED), range(500))
    short = records.compact(full) if form is Form.COMPACT else records.space(full)
    brief = np.zeros(500, [("line", "<u4"), *short.dtype.descr])
    for name in short.dtype.names or ():
        brief[name] = short[name]
    brief["line"] = full["line"]
    want = points.table(records.points(full))
    found = points.table(records.form_points(brief, form))
    np.testing.assert_array_equal(found.located, want.located)
    rows = want.located
    np.testing.assert_array_equal(found.x_mm[rows], want.x_mm[rows])
    np.testing.assert_array_equal(found.z_mm[rows], want.z_mm[rows])
    toward = np.arctan2(want.x_mm[rows], want.z_mm[rows])
    np.testing.assert_allclose(found.angle_rad[rows], toward, atol=1e-6)
    if form is Form.SPACE:
        free = ~want.measured & (want.free_to_mm > 0.0)
        np.testing.assert_array_equal(found.free_to_mm[free], want.free_to_mm[free])
