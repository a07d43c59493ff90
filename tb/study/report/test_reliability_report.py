"""Reliability: shares and ratios of errors of a known distribution, and of scanned scenes."""

import io
import math
import re
from dataclasses import fields, replace

import matplotlib.image
import numpy as np
import pytest
from harness import generator
from PIL import Image
from scipy.stats import norm

from vrscan.data.config import Config
from vrscan.data.lines import Lines, Truth
from vrscan.data.table import Table
from vrscan.engines.engine import Engine, run
from vrscan.engines.tools import repository_root
from vrscan.scene.description import load
from vrscan.scene.effects import present
from vrscan.scene.light import Light
from vrscan.scene.simulate import simulate
from vrscan.study.plan import FLAT_PX
from vrscan.study.report import reliability_report as report
from vrscan.study.report.reliability_report import ASTRAY_PX, Reliability

CONFIG = Config()
COUNT = 4000


def scanned(scene: str, count: int, seed: int) -> Lines:
    """Return a scene's lines with another seed, with every effect but one that no line tells."""
    described = load(scene).model_copy(update={"seed": seed})
    active = frozenset(present(described)) - {"grain"}
    return simulate(Light(described, CONFIG), count, active).lines


def points_of(lines: Lines, window: str) -> tuple[Table, Truth]:
    """Return the points of lines with a kind of window, and the truth."""
    assert lines.truth is not None
    peak = CONFIG.peak.model_copy(update={"window": window})
    return run(Engine.FIXED, lines, CONFIG.model_copy(update={"peak": peak})), lines.truth


@pytest.fixture(scope="module")
def form() -> tuple[Table, Truth]:
    """Return points whose columns can be replaced, one a line, on the beam's own spot."""
    lines = scanned("plane", 400, 1)
    points, truth = points_of(lines, "threshold")
    rows = np.resize(np.flatnonzero(points.located & np.isfinite(truth.position_px)), COUNT)
    many = Table.joined([points.of(np.arange(400) == row) for row in rows.tolist()])
    nothing = {name: np.zeros(COUNT, np.bool_) for name in many.flags}
    own = Truth(
        *(value[rows] for value in (truth.x_mm, truth.z_mm, truth.position_px, truth.surface)),
        truth.names,
    )
    return replace(many, flags=nothing, position_px=own.position_px.copy()), own


def made(form: tuple[Table, Truth], scale: float) -> tuple[Table, Truth]:
    """Return points with normal errors of ``scale`` times sigma, and sigma of 0.01 to 1 mm."""
    points, truth = form
    draw = generator(5)
    sigma = 10.0 ** draw.uniform(-2.0, 0.0, COUNT)
    z_mm = truth.z_mm + scale * sigma * draw.standard_normal(COUNT)
    return replace(points, sigma_z_mm=sigma, z_mm=z_mm), truth


@pytest.mark.parametrize("scale", [0.5, 1.0, 3.0])
def test_normal_errors_have_the_shares_of_the_normal_distribution(
    form: tuple[Table, Truth], scale: float
) -> None:
    found = Reliability.of(*made(form, scale))
    assert (found.points, found.astray, found.rated) == (COUNT, 0, COUNT)
    assert found.ratio == pytest.approx(scale, rel=4.0 / math.sqrt(2.0 * COUNT))
    for multiple in (0.5, 1.0, 2.0, 3.0, 4.0):
        share = 2.0 * norm.cdf(multiple / scale) - 1.0
        chance = 4.0 * math.sqrt(share * (1.0 - share) / COUNT) + 1.0 / COUNT
        assert found.share(multiple) == pytest.approx(share, abs=chance), multiple
        assert report.expected(multiple / scale) == pytest.approx(share)
    assert int(found.count.sum()) == int(found.within.sum()) == COUNT
    many = found.count >= 50
    assert many.sum() > 20
    ratio = np.sqrt(found.square_mm[many] / found.predicted_mm[many])
    assert np.abs(ratio / scale - 1.0).max() < 5.0 / math.sqrt(2.0 * 50)


def test_points_with_a_flag_do_not_count_and_those_astray_are_beyond(
    form: tuple[Table, Truth],
) -> None:
    points, truth = made(form, 1.0)
    rows = np.arange(COUNT)
    flags = {**points.flags, "RIVAL": rows < 100, "SATURATED": rows < 150}
    position = np.where((rows >= 200) & (rows < 220), truth.position_px + ASTRAY_PX + 1.0,
                        points.position_px)  # fmt: skip
    spot = np.where((rows >= 300) & (rows < 305), np.nan, truth.position_px)
    sigma = np.where((rows >= 400) & (rows < 407), 0.0, points.sigma_z_mm)
    odd = replace(points, flags=flags, position_px=position, sigma_z_mm=sigma,
                  located=rows != 500)  # fmt: skip
    found = Reliability.of(odd, replace(truth, position_px=spot))
    assert found.points == COUNT - 151
    assert found.astray == 25 and found.rated == found.points - 25 - 7
    assert found.within[-1] >= 32 and found.share(report.MOST) < 1.0
    assert found.ratio == pytest.approx(1.0, rel=0.05)
    near = np.arange(COUNT) >= 150
    near[[*range(200, 220), *range(300, 305), *range(400, 407), 500]] = False
    rms_mm = np.sqrt(np.mean(np.square(odd.z_mm - truth.z_mm)[near]))
    assert found.rms_mm == pytest.approx(rms_mm)
    assert f"{found.points} points without a flag, 25 astray, the others {rms_mm:.2f}" in str(found)
    assert f"2 sigma holds {100.0 * found.share(2):.1f} %" in str(found)


def test_parts_add_up(form: tuple[Table, Truth]) -> None:
    points, truth = made(form, 1.3)
    odd = np.arange(COUNT) % 3 == 0
    whole, parts = Reliability.of(points, truth), []
    for rows in (odd, ~odd):
        columns = {name: getattr(truth, name)[rows] for name in ("x_mm", "z_mm", "position_px")}
        some = Truth(**columns, surface=truth.surface[rows], names=truth.names)
        parts.append(Reliability.of(points.of(rows), some))
    both = parts[0] + parts[1]
    for field in fields(Reliability):
        assert np.allclose(getattr(both, field.name), getattr(whole, field.name)), field.name
    assert str(both) == str(whole)


def test_the_picture_of_any_points(form: tuple[Table, Truth]) -> None:
    points, truth = made(form, 1.0)
    flagged = replace(points, flags={**points.flags, "RIVAL": np.ones(COUNT, np.bool_)})
    for table in (points, flagged):
        found = Reliability.of(table, truth)
        file = io.BytesIO()
        report.picture(found, "A scan", file)
        image = matplotlib.image.imread(io.BytesIO(file.getvalue()))
        assert image.shape[1] > 1000 and float(image.std()) > 0.02
    assert str(found) == "no point without a flag" and math.isnan(found.share(2))


def test_the_readmes_picture_has_the_figures_of_todays_scan() -> None:
    """They are written into the file; a last digit may differ on another machine."""
    with Image.open(repository_root() / "docs" / "reliability.png") as image:
        drawn = str(image.info["Description"])
    scene = load("default")
    lines = simulate(
        Light(scene, CONFIG), 3000, frozenset(present(scene)), tolerance_px=FLAT_PX
    ).lines
    today = str(Reliability.of(*points_of(lines, "fit")))
    had, has = (np.array(re.findall(r"\d+\.?\d*", text), np.float64) for text in (drawn, today))
    assert had == pytest.approx(has, rel=0.002, abs=0.011), (
        "docs/reliability.png is stale: vrscan scan --engine fixed --out build/scan draws it anew"
        f"\n  drawn: {drawn}\n  today: {today}"
    )


@pytest.mark.parametrize("scene", ["default", "corner", "sunlit"])
def test_a_fit_knows_how_far_its_points_are_off(scene: str) -> None:
    """On rough surfaces, from lines with every effect; the window alone knows of no speckle."""
    lines = scanned(scene, 3000, 41)
    fit, window = (Reliability.of(*points_of(lines, name)) for name in ("fit", "threshold"))
    print(f"\n{scene}: {fit}\n  threshold: {window}")
    assert 0.9 < fit.share(2) < 0.995 and fit.astray < 0.02 * fit.points
    assert 0.6 < fit.ratio < 1.6
    assert window.share(2) < 0.5 and window.ratio > 3.0
