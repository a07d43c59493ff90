"""The budget of stray light against fits, rendered lines and the scatter itself."""

import csv
import io

import numpy as np
import pytest
from PIL import Image
from rich.console import Console
from scipy.interpolate import CubicSpline
from scipy.optimize import curve_fit

from vrscan.data.arrays import Floats
from vrscan.data.config import Config
from vrscan.scene.description import Description
from vrscan.scene.light import Light
from vrscan.study.report import stray_report as report

COUNT = 600


def _light(**stray: object) -> Light:
    plane = {"kind": "plane", "position_mm": [0, 0, 420], "rotation_deg": [0, 25, 0]}
    tables = {"target": [plane], "stray": stray, "laser": {"power_mw": 50}}
    return Light(Description.model_validate(tables), Config())


@pytest.fixture(scope="module")
def found() -> report.StrayBudget:
    return report.stray_budget(_light(), COUNT, 1e-4)


def _named(found: report.StrayBudget, name: str) -> report.Cause:
    return next(cause for cause in found.causes if cause.name == name)


def test_tables_fit_and_name_every_cause(found: report.StrayBudget) -> None:
    console = Console(width=120, file=io.StringIO())
    console.print(report.report(found))
    assert isinstance(console.file, io.StringIO)
    text = console.file.getvalue()
    assert "…" not in text
    for cause in ("roughness", "dust", "digs", "scratches"):
        assert f"camera: {cause}" in text and f"scan head: {cause}" in text
    assert "5/5x0.063, dig 7" in text and "filter 1 + sensor x2" in text
    rows = list(csv.DictReader(io.StringIO(report.budget_csv(found).decode())))
    assert [row["cause"] for row in rows] == [cause.name for cause in found.causes]
    assert float(rows[0]["target_a"]) == pytest.approx(found.target, rel=1e-5)
    ghosts = list(csv.DictReader(io.StringIO(report.ghost_csv(found).decode())))
    assert len(ghosts) == len(found.ghosts) > 15


def test_picture_has_both_axes(found: report.StrayBudget) -> None:
    file = io.BytesIO()
    report.picture(found, file)
    with Image.open(file) as picture:
        assert picture.size == (1300, 572)


def test_a_of_a_halo_is_its_own_weight(found: report.StrayBudget) -> None:
    bare = [name for name in found.light.scene.stray.enabled if name != "dust"]
    halo = found.light.with_stray(found.light.scene.stray.model_copy(update={"enabled": bare})).halo
    want = float(halo.weights[20])
    level = _named(found, "camera: roughness").level
    print("A", level, "weight", want)
    assert level == pytest.approx(np.full(3, want), rel=0.06)
    together = found.causes[-1].level
    for cause in found.causes[:-1]:
        assert (cause.level <= 1.02 * together).all(), cause.name


def test_shift_is_that_of_a_fit() -> None:
    """A fit of the spot's own shape by scipy, with ghosts strong enough to see."""
    plates = {"front_reflectance": 0.1, "back_reflectance": 0.1, "tilt_deg": 0.02}
    light = _light(window=plates, filter=plates)
    lines = report._Lines(light, COUNT)
    added = lines.added(light, {"ghosts"})
    first = lines.shifts(added)
    pixel = np.arange(added.shape[1], dtype=np.float64)
    fitted = []
    rows = range(0, len(added), max(len(added) // 8, 1))
    for k in rows:
        some, _ = lines.solve[k]
        shape = CubicSpline(pixel, lines.base_e[k])

        def moved(x: Floats, shift: float, height: float, level: float, s=shape) -> Floats:
            return height * s(x - shift) + level

        got = (lines.base_e[k] + added[k])[some]
        fitted.append(curve_fit(moved, pixel[some], got, p0=(0.0, 1.0, 0.0))[0][0])
    want, shown = np.array(fitted), first[list(rows)]
    print("shift", shown.round(4), "fit", want.round(4))
    assert np.abs(want).max() > 0.02
    assert shown == pytest.approx(want, rel=0.06)  # first order: the ghosts are 3e-2 of the light


def test_an_edge_of_light_of_the_target_shifts_by_the_tolerance(found: report.StrayBudget) -> None:
    lines = report._Lines(found.light, COUNT)
    pixel = np.arange(lines.base_e.shape[1], dtype=np.float64)
    edges = lines.whole_e[:, None] * (pixel > lines.place[:, None])
    each = found.tolerance_px / np.abs(lines.shifts(edges))
    k = int(np.argmin(np.abs(each - found.target)))  # it is the median of the worst third
    some, _ = lines.solve[k]
    edge = found.target * edges[k]
    shape = CubicSpline(pixel, lines.base_e[k])

    def moved(x: Floats, shift: float, height: float, level: float) -> Floats:
        return height * shape(x - shift) + level

    got = curve_fit(moved, pixel[some], (lines.base_e[k] + edge)[some], p0=(0.0, 1.0, 0.0))[0][0]
    print(f"shift {got:.5f} px of {found.tolerance_px}")
    assert abs(got) == pytest.approx(found.tolerance_px, rel=0.1)
    assert np.median(each) >= found.target


def test_largest_values_reach_their_targets(found: report.StrayBudget) -> None:
    lines = report._Lines(found.light, COUNT)
    stray = found.light.scene.stray
    change = {
        "camera: roughness": ("halo", "roughness", "polish", "roughness_nm"),
        "mirror: roughness": ("skirt", "roughness", "mirror", "roughness_nm"),
        "camera: cleanliness level": ("halo", "dust", "dust", "level"),
    }
    tried = 0
    for limit in found.limits:
        if limit.name not in change or not np.isfinite(limit.by_level):
            continue
        effect, cause, section, name = change[limit.name]
        part = getattr(stray, section).model_copy(update={name: limit.by_level})
        table = report._alone(stray.model_copy(update={section: part}), cause)
        level, _ = lines.figures(found.light.with_stray(table), [effect])
        print(f"{limit.name} {limit.by_level:.3g}: A {level.max():.3g} of {found.target:.3g}")
        assert level.max() == pytest.approx(found.target, rel=0.08)
        tried += 1
    assert tried >= 1
