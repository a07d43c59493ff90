"""A scan without a point: no error of 0 px is reported, but that nothing was measured, and why."""

import io
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from vrscan.data.config import Config
from vrscan.scene.description import parse
from vrscan.scene.effects import present
from vrscan.scene.light import Light
from vrscan.study.plan import FLAT_PX, LEAST_LINES, plan
from vrscan.study.report import budget, fidelity
from vrscan.study.report.unmeasured import unmeasured

PLANE = {"kind": "plane", "position_mm": [0, 0, 400]}
CLEAN = {"stray": {"enabled": []}}  # which is quick
FAINT = {"laser": {"power_mw": 1e-5}, **CLEAN}


def _light(config: Config | None = None, **tables: object) -> Light:
    return Light(parse({"target": [PLANE], **tables}, "my.toml", Path()), config or Config())


@pytest.mark.parametrize(
    ("tables", "wanted"),
    [
        (FAINT, "too dim: the best, at z = 400 mm"),
        ({"target": [{**PLANE, "position_mm": [0, 0, 1e7]}]}, "too dim: the best, at z = 1e+07 mm"),
        ({"laser": {"power_mw": 0}}, "no light of the laser comes back to the sensor"),
        ({"material": {"default": {"reflectance": 0}}}, "no light of the laser comes back"),
        ({"laser": {"beam_diameter_mm": 60, "aperture_mm": 60}}, "its sigma is 12"),
        ({**FAINT, "lamp": [{"kind": "halogen", "illuminance_lux": 5e4}]}, "sun and lamps put"),
        ({"sensor": {"dark_e_per_s": 1e12}}, "most lines are LOW_SNR"),
    ],
)
def test_the_cause_is_told(tables: dict[str, object], wanted: str) -> None:
    text = unmeasured(_light(**tables), 300)
    print(text)
    assert text.startswith("my.toml: nothing was measured: no line has a point, because ")
    assert wanted in text and "\n" not in text


def test_what_is_bright_and_too_far_is_told() -> None:
    far = {"laser": {"power_mw": 50}, "material": {"default": {"reflectance": 0.9}}}
    text = unmeasured(_light(target=[{**PLANE, "position_mm": [0, 0, 2300]}], **far), 300)
    print(text)
    assert "farther away than 2048 mm" in text or "z = 2300 mm" in text


def test_figures_of_a_dim_scene_are_those_of_its_lines() -> None:
    """What is said of the brightest spot is what makes a point appear when it is that much more."""
    text = unmeasured(_light(**FAINT), 300)
    found = re.search(r"pixel, (\S+) times the noise .* needs (\S+) times", text)
    assert found is not None
    short = float(found[2]) / float(found[1])
    for factor, any_point in ((0.4, False), (3.0, True)):
        brighter = _light(laser={"power_mw": 1e-5 * short * factor}, **CLEAN)
        chosen = plan(brighter, 300, fidelity="minimal", each=False)
        assert chosen.pointless != any_point, factor


def test_auto_leaves_nothing_out_where_nothing_is_measured() -> None:
    light = _light(**FAINT)
    found = plan(light, LEAST_LINES, fidelity="auto", each=False, break_even_lines=10**6)
    assert found.pointless and found.active == frozenset(present(light.scene))
    assert found.plane_px == FLAT_PX
    assert np.isnan(found.left_out.total_px).all()
    (line,) = budget.summary(plan(light, 300, fidelity="minimal", each=False))
    assert "px" not in line.partition("what is left out")[2] and "nothing that can be told" in line
    table = budget.budget_csv(plan(light, 300)).decode()
    rows = [row.split(",") for row in table.splitlines()]
    column = rows[0].index("near_rms_px")
    assert all(row[column] == "" for row in rows[1:])


def test_the_bench_reports_no_error_without_a_point(tmp_path: Path) -> None:
    path = tmp_path / "dim.toml"
    path.write_text(
        "[laser]\npower_mw = 1e-5\n[stray]\nenabled = []\n"
        '[[target]]\nkind = "plane"\nposition_mm = [0, 0, 400]\n'
    )
    dim = fidelity.run([str(path)], 100, Config(), rounds=1)
    for row in dim:
        assert row.points == 0 and row.within is None
        assert np.isnan([row.rms_px, row.worst_px, row.max_px, row.truth_rms_px]).all()
    figures = {"rms_px": 0.01, "worst_px": 0.02, "truth_rms_px": 0.3, "points": 90}
    good = [replace(row, scene="good", **figures) for row in dim]
    page = fidelity.markdown([*dim, *good]).splitlines()
    assert page[2].count(fidelity.NO_POINT) == 5 and fidelity.NO_POINT not in page[3]
    names, first = (row.split(",") for row in fidelity.csv_file(dim).decode().splitlines()[:2])
    assert first[names.index("worst_px")] == ""
    for some in (dim, [*dim, *good]):
        file = io.BytesIO()
        fidelity.picture(some, file)
        assert file.getvalue().startswith(b"\x89PNG")
        assert fidelity.table(some).row_count == len(some)
