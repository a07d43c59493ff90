"""The link budget against lines that are rendered: light, width, noise, scatter, limits."""

import csv
import io
import math
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rich.console import Console

from vrscan.data.arrays import Floats, Pixels
from vrscan.data.config import Config
from vrscan.data.lines import Lines
from vrscan.data.table import Table
from vrscan.engines.engine import Engine, run
from vrscan.ideal.geometry import project
from vrscan.scene.description import parse
from vrscan.scene.effects import present
from vrscan.scene.light import Light
from vrscan.scene.render import Renderer
from vrscan.scene.sensor import words
from vrscan.scene.simulate import Scanner, picked
from vrscan.study.report.link_budget import Link, link_budget, link_csv, link_table

CONFIG = Config()
COUNT = 600  # lines of a scan, and of the repetitions of one
BESIDE = {"ghosts", "skirt", "halo", "bounce", "prnu", "dsnu"}  # what the budget leaves out


@dataclass(frozen=True)
class Case:
    """A plate that faces the scanner, and the laser on it."""

    z_mm: float
    power_mw: float
    reflectance: float = 0.3
    aperture_mm: float = math.inf
    lux: float = 0.0
    sweep: str = "even"


CASES = {
    "near": Case(260.0, 8.0),
    "focus": Case(420.0, 8.0),
    "far": Case(900.0, 30.0),
    "stop": Case(600.0, 20.0, aperture_mm=1.0),
    "dim": Case(800.0, 16.0),
    "lamp": Case(500.0, 8.0, lux=150_000.0),
    "moving": Case(400.0, 8.0, sweep="mirror"),
}


def lit(case: Case, **changes: Any) -> Light:
    plate = {"kind": "plane", "name": "plate", "position_mm": [0, 0, case.z_mm], "material": "m"}
    laser = {"aperture_mm": case.aperture_mm, "power_mw": case.power_mw}
    values: dict[str, Any] = {
        "target": [plate],
        "scan": {"sweep": case.sweep, "half_angle_deg": 1.0},
        "laser": laser,
        "material": {"m": {"reflectance": case.reflectance}},
    }
    if case.lux:
        lamp = {"kind": "halogen", "illuminance_lux": case.lux, "flicker": 0.0}
        values["lamp"] = [lamp]
    return Light(parse(values | changes, "plate", Path()), CONFIG)


@cache
def judged(name: str) -> tuple[Light, Link]:
    light = lit(CASES[name])
    link = link_budget(light, COUNT)[1]
    assert link is not None
    return light, link


def repeated(light: Light, line: int, *, without: set[str]) -> Pixels:
    """Return one line of a scan again and again, each time with noise of its own."""
    active = frozenset(present(light.scene)) - without
    when = Scanner(light, COUNT, frozenset()).given(np.array([line]))[0]
    noise = words(7, 0, COUNT, CONFIG.sensor.line_length)
    renderer = Renderer(light, active)
    return renderer.render(picked(when, np.zeros(COUNT, np.int64)), noise).lines


def points(lines: Pixels, window: str) -> Table:
    peak = CONFIG.peak.model_copy(update={"window": window})
    power = np.full(len(lines), CONFIG.laser.power_max, np.int64)
    given = Lines(lines=lines, angle_rad=np.zeros(len(lines)), power=power)
    return run(Engine.FIXED, given, CONFIG.model_copy(update={"peak": peak}))


@cache
def still(name: str) -> Pixels:
    """Return the judged line of a case with noise and no speckle, many times."""
    light, link = judged(name)
    return repeated(light, link.line, without=BESIDE | {"speckle"})


def charge(light: Light, line: int) -> Floats:
    """Return the electrons of a line's laser without noise [length]."""
    active = frozenset(present(light.scene)) - BESIDE - {"speckle"}
    when = Scanner(light, COUNT, frozenset()).given(np.array([line]))[0]
    return np.asarray(Renderer(light, active).charge(when).laser_e[0], np.float64)


def close(what: str, predicted: float, measured: float, rel: float) -> None:
    print(f"{what}: predicted {predicted:.5g}, measured {measured:.5g}, {predicted / measured:.4f}")
    assert predicted == pytest.approx(measured, rel=rel)


@pytest.mark.parametrize("name", CASES)
def test_received_power_is_the_range_equation(name: str) -> None:
    """By hand: (2-30) from a matt plate to a round pupil beside the beam."""
    case, (_, link) = CASES[name], judged(name)
    geometry = CONFIG.geometry
    sent = case.power_mw * (1.0 if math.isinf(case.aperture_mm) else 1.0 - math.exp(-2.0))
    dx, dz = geometry.base_mm - link.x_mm, link.z_mm - geometry.offset_mm
    far = math.hypot(dx, dz)
    sine, cosine = math.sin(geometry.bias_rad), math.cos(geometry.bias_rad)
    depth = dx * cosine + dz * sine
    pupil = 0.25 * math.pi * (geometry.focal_mm / 3.0) ** 2
    want = 1e3 * sent * case.reflectance / math.pi * (dz / far) * (depth / far) * pupil / far**2
    close("power into the lens, uW", link.received_uw, want, 0.02)
    assert link.sent_mw == pytest.approx(sent, rel=1e-9)
    assert link.reflectance == pytest.approx(case.reflectance, rel=1e-6)
    assert link.range_mm == pytest.approx(far, rel=1e-6)


@pytest.mark.parametrize("name", CASES)
def test_light_and_width_are_those_of_the_line(name: str) -> None:
    light, link = judged(name)
    row = charge(light, link.line)
    pixel = np.arange(len(row))
    total = float(row.sum())
    mean = float((row * pixel).sum()) / total
    width = math.sqrt(float((row * np.square(pixel - mean)).sum()) / total)
    close("electrons on the row", link.signal_e, total, 2e-4)
    # Diffraction's tails and a stop's rings have no second moment: a window ends them.
    tails = link.widths_px["defocus"] < 5.0 or not math.isinf(CASES[name].aperture_mm)
    close("width, px", link.sigma_px, width, 0.15 if tails else 0.025)
    close("brightest pixel, electrons", link.peak_e, float(row.max()), 0.03)
    assert math.hypot(*link.widths_px.values()) == pytest.approx(link.sigma_px)


@pytest.mark.parametrize("name", CASES)
def test_signal_to_noise_is_that_of_the_brightest_pixel(name: str) -> None:
    _, link = judged(name)
    lines = still(name).astype(np.float64)
    pixel = int(lines.mean(axis=0).argmax())
    beside = np.median(lines, axis=1).mean()
    measured = (lines[:, pixel].mean() - beside) / lines[:, pixel].std()
    close("S/N of the brightest pixel", link.snr, float(measured), 0.08)
    dark = float(lines[:, pixel + 80 : pixel + 280].std(axis=0).mean()) / CONFIG.peak.kappa
    close("noise beside the spot, e", math.hypot(link.dark_rms_e, math.sqrt(link.background_e)),
          dark, 0.03)  # fmt: skip
    height = float(lines[:, pixel].mean()) / 4095.0
    close("height over full scale", link.full_scale, height, 0.03)


@pytest.mark.parametrize("name", CASES)
def test_scatter_is_as_predicted_without_speckle(name: str) -> None:
    """(2-80) for one window; a fit is near the bound of light where the spot is a Gaussian."""
    _, link = judged(name)
    found = points(still(name), "threshold")
    assert found.measured.all()
    close("sigma, one window, px", link.phase_px, float(found.position_px.std()), 0.13)
    fitted = float(points(still(name), "fit").position_px.std())
    ratio = fitted / link.bound_px
    print(f"fit {fitted:.4f} px is {ratio:.3f} of the bound of light")
    flat = link.widths_px["defocus"] > 2.0 * link.widths_px["beam"]
    assert 0.92 < ratio < (2.6 if flat else 1.2)


@pytest.mark.parametrize(("name", "most"), [("near", 1.2), ("focus", 1.2), ("far", 3.5)])
def test_speckled_lines_scatter_no_less_than_the_bound(name: str, most: float) -> None:
    light, link = judged(name)
    active = frozenset(present(light.scene)) - BESIDE
    frame = Scanner(light, 4 * COUNT, active).some(np.arange(0, 4 * COUNT, 4))
    found = points(frame.lines, "fit")
    error = (found.position_px - frame.truth.position_px)[found.measured]
    measured = float(error.std())
    print(f"{name}: bound with speckle {link.speckled_px:.4f}, measured {measured:.4f} px")
    assert 0.92 * link.speckled_px < measured < most * link.speckled_px
    assert measured > 1.5 * link.bound_px


@pytest.mark.parametrize("name", ["near", "focus", "far", "lamp"])
def test_least_reflectance_is_where_points_begin(name: str) -> None:
    _, link = judged(name)
    shares = []
    for factor in (0.6, 1.0, 1.5):
        dark = {"m": {"reflectance": factor * link.least_reflectance}}
        lines = repeated(lit(CASES[name], material=dark), link.line, without=BESIDE | {"speckle"})
        shares.append(float(points(lines, "threshold").measured.mean()))
    print(f"{name}: least {link.least_reflectance:.4g}: {shares} of lines at 0.6, 1 and 1.5 of it")
    assert shares[0] < 0.2
    assert shares[2] > 0.9


def test_saturated_spot_is_marked_and_no_light_has_no_sigma() -> None:
    bright = lit(Case(420.0, 50.0, reflectance=0.95))
    links = link_budget(bright, COUNT)
    dim = link_budget(lit(Case(420.0, 15.0)), COUNT)
    for link, whole in zip(links, dim, strict=True):
        assert link is not None and whole is not None
        assert link.full_scale > 1.0 > whole.full_scale
        # Ten times the light, but the pixels of the spot's middle tell nothing.
        assert link.bound_px > 1.5 * whole.bound_px * math.sqrt(whole.signal_e / link.signal_e)
        assert math.isnan(link.phase_px)
    assert shown(links, bright).count("saturated") >= 3
    dark = link_budget(lit(Case(420.0, 0.0)), COUNT)[0]
    assert dark is not None
    assert dark.snr == 0.0
    assert math.isinf(dark.speckled_px) and math.isinf(dark.least_reflectance)


def shown(links: list[Link | None], light: Light) -> str:
    console = Console(width=120, file=io.StringIO())
    console.print(link_table(links, light))
    assert isinstance(console.file, io.StringIO)
    return console.file.getvalue()


def test_table_and_file_hold_every_zone() -> None:
    light, link = judged("focus")
    links: list[Link | None] = [link, None, link]
    text = shown(links, light)
    assert "…" not in text
    (line,) = (line for line in text.splitlines() if line.startswith("width s of the spot"))
    assert line.split()[-4:] == [f"{link.sigma_px:.3g}", "no", "line", f"{link.sigma_px:.3g}"]
    rows = list(csv.DictReader(io.StringIO(link_csv(links).decode())))
    assert [row["zone"] for row in rows] == ["near", "far"]
    for row in rows:
        for name in ("received_uw", "signal_e", "snr", "phase_px", "speckled_px", "sigma_px"):
            assert float(row[name]) == pytest.approx(getattr(link, name), rel=1e-5)
        assert float(row["speckled_mm"]) == pytest.approx(link.speckled_px * link.mm_per_px, 1e-5)


def test_millimetres_are_those_of_the_geometry() -> None:
    """By the projection of two places on the beam; z^2 pitch / (f B) is right to some percent."""
    geometry = CONFIG.geometry
    for name in ("near", "far"):
        link = judged(name)[1]
        z = link.z_mm + np.array([-0.5, 0.5])
        low, high = project(link.x_mm / link.z_mm * z, z, geometry)
        close("mm of z per px", link.mm_per_px, 1.0 / abs(high - low), 1e-3)
        plain = link.z_mm**2 * geometry.pitch_mm / (geometry.focal_mm * geometry.base_mm)
        close("z^2 pitch / (f B)", link.mm_per_px, plain, 0.08)
