"""The budget's tables against the plan, the class of a laser and B against closed forms."""

import csv
import io
import math
import re
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rich.console import Console, RenderableType

from vrscan.data.config import Config
from vrscan.scene.beam import radius_mm
from vrscan.scene.description import Description, parse
from vrscan.scene.effects import EFFECTS, present
from vrscan.scene.light import Light
from vrscan.scene.simulate import simulate
from vrscan.scene.sun import watts_per_lumen
from vrscan.scene.surface import brdf
from vrscan.show.sheet import short
from vrscan.study.plan import ZONES, Difference, Plan, Prediction, plan
from vrscan.study.report import budget

CONFIG = Config()
WIDTH = 120
PLATE_Z = 400.0


def scene(**tables: Any) -> Description:
    """A small plate that faces the scanner at 400 mm, and what else is asked for."""
    plate = {"kind": "plane", "name": "plate", "position_mm": [0, 0, PLATE_Z], "size_mm": [12, 12]}
    values = {
        "target": [plate],
        "scan": {"sweep": "even", "half_angle_deg": 0.5},
        "laser": {"aperture_mm": float("inf"), "power_mw": 5.0},
    }
    return parse(values | tables, "plate", Path())


@cache
def planned() -> tuple[Light, Plan]:
    light = Light(scene(), CONFIG)
    return light, plan(light, 60, fidelity="auto")


def made_up() -> Plan:
    """A plan with a figure of its own in every place."""
    rng = np.random.default_rng(5)

    def change(size: float) -> Difference:
        signed, plain = rng.normal(0.0, size, (2, 4)), rng.uniform(0.0, size, (2, 4))
        return Difference(signed[0], plain[0], signed[1], plain[1], rng.uniform(0.0, 1.0, 4))

    names = present(scene())
    return Plan(
        fidelity="auto",
        tolerance_px=0.01,
        active=frozenset(names[::2]),
        plane_px=0.01,
        present=names,
        predictions=tuple(
            Prediction(name, change(10.0 ** (k % 6 - 3)), 0.5 * k, name in names[::2])
            for k, name in enumerate(names)
        ),
        absent=tuple(name for name in EFFECTS if name not in names),
        left_out=change(0.003),
        distance_mm=np.array([250.25, 400.0, 1234.5]),
        microseconds=(40.0, 300.0),
        count=100_000,
        lines=640,
        seconds=2.5,
    )


def shown(grid: RenderableType) -> list[str]:
    console = Console(width=WIDTH, file=io.StringIO())
    console.print(grid)
    assert isinstance(console.file, io.StringIO)
    return console.file.getvalue().splitlines()


@pytest.mark.parametrize("what", ["measured", "made_up"])
def test_every_figure_of_the_plan_is_in_the_table(what: str) -> None:
    found = planned()[1] if what == "measured" else made_up()
    lines = shown(budget.figures_table(found, scene()))
    assert not any("…" in line for line in lines)
    text = "\n".join(lines)
    for zone, z_mm in zip(ZONES, found.distance_mm, strict=True):
        assert f"{zone}, z {z_mm:.0f} mm" in text
    for row in found.predictions:
        (line,) = (line for line in lines if line.startswith(f"{row.name} "))
        numbers = [float(word) for word in re.findall(r"-?\d+(?:\.\d+)?", line)]
        change = row.difference
        for index in range(len(ZONES)):
            want = (
                change.bias_px[index],
                change.rms_px[index],
                change.bias_mm[index],
                change.rms_mm[index],
            )
            np.testing.assert_allclose(numbers[4 * index : 4 * index + 4], want, 1e-3, atol=6e-4)
        assert numbers[-1] == pytest.approx(row.microseconds, abs=0.051)
        assert (" on " in line) == row.on
        assert (" off " in line) == (not row.on)
        worst = 100.0 * row.difference.changed.max()
        assert (f"{worst:.1f} %" in line) == (worst > 0.0)


def test_base_and_sums_add_up() -> None:
    found = made_up()
    lines = {line.split("  ")[0]: line for line in shown(budget.figures_table(found, scene()))}
    effects = sum(row.microseconds for row in found.predictions)
    last = {name: float(line.split()[-1]) for name, line in lines.items() if name in SUMS}
    assert last["base"] + effects == pytest.approx(found.microseconds[1], abs=0.1)
    assert last["all on"] == found.microseconds[1]
    assert last["planned"] == found.microseconds[0]
    assert last["all on"] + last["left out"] == pytest.approx(last["planned"])
    figures = [float(word) for word in re.findall(r"-?\d+\.\d+", lines["left out"])]
    assert figures[0] == pytest.approx(found.left_out.bias_px[0], abs=6e-5)


SUMS = ("base", "left out", "planned", "all on")


def test_budget_is_both_tables() -> None:
    found = made_up()
    lines = shown(budget.budget_table(found, scene()))
    both = shown(budget.figures_table(found, scene())), shown(budget.effects_table(found))
    assert [line.rstrip() for line in lines] == [line.rstrip() for line in (*both[0], "", *both[1])]


def test_effects_say_what_stands_in_their_place() -> None:
    found = made_up()
    lines = shown(budget.effects_table(found))
    for name, effect in EFFECTS.items():
        (line,) = (line for line in lines if line.startswith(f"{name} "))
        assert effect.what in line
        off = name not in found.active and name not in found.absent
        assert line.rstrip().endswith(effect.without) == off
        assert ("not in this scene" in line) == (name in found.absent)


@given(
    value=st.floats(-9.9e5, 9.9e5, allow_nan=False),
    decimals=st.integers(3, 4),
)
def test_numbers_keep_their_room(value: float, decimals: int) -> None:
    text = short(value, decimals + 2)
    assert len(text) <= decimals + 3 + (abs(value) >= 10.0 ** (decimals + 1))
    step = 10.0 ** -max(decimals + 1 - len(str(int(abs(value)))), 0)
    assert abs(float(text) - value) <= 0.51 * step
    assert not text.startswith("-0.0") or float(text) != 0.0


def test_summary_says_what_a_scan_has_had() -> None:
    found = made_up()
    (line,) = budget.summary(found)
    assert f"{len(found.active)} of {len(found.present)} on" in line
    assert "40 us a line instead of 300" in line
    assert f"{found.left_out.total_px.max():.4f} px" in line
    (line,) = budget.summary(replace(found, active=frozenset(found.present), fidelity="full"))
    assert line == f"effects: all {len(found.present)} (fidelity full)"


def test_csv_holds_the_plan() -> None:
    found = made_up()
    text = budget.budget_csv(found).decode()
    rows = {row["effect"]: row for row in csv.DictReader(io.StringIO(text))}
    assert list(rows) == [*EFFECTS, "left_out", "planned", "full"]
    for prediction in found.predictions:
        row = rows[prediction.name]
        assert row["state"] == ("on" if prediction.on else "off")
        assert float(row["us_per_line"]) == prediction.microseconds
        for index, zone in enumerate(ZONES):
            assert float(row[f"{zone}_z_mm"]) == found.distance_mm[index]
            for name in ("bias_px", "rms_px", "bias_mm", "rms_mm", "changed"):
                want = getattr(prediction.difference, name)[index]
                assert float(row[f"{zone}_{name}"]) == pytest.approx(want, rel=1e-5)
    for name in found.absent:
        assert rows[name]["state"] == "absent"
        assert rows[name]["near_rms_px"] == ""
    assert float(rows["left_out"]["far_rms_mm"]) == pytest.approx(
        found.left_out.rms_mm[2], rel=1e-5
    )
    assert float(rows["left_out"]["us_per_line"]) == -260.0
    without = csv.reader(io.StringIO(budget.budget_csv(found, times=False).decode()))
    want = [row[:2] + row[3:] for row in csv.reader(io.StringIO(text))]
    assert list(without) == want


# Safety


def test_class_of_a_stalled_beam_is_that_of_its_mean() -> None:
    """Long exposures of a beam at rest: 0.39 mW is class 1, 1 mW class 2, 5 mW 3R, 500 mW 3B."""
    beam = budget.emission(scene(), CONFIG)
    assert beam.duty == pytest.approx(1e-6 * CONFIG.line.rate_hz)
    for limit_mw, below, above in ((0.39, "1", "2"), (1, "2", "3R"), (5, "3R", "3B")):
        edge_w = 1e-3 * limit_mw / beam.duty
        assert budget.laser_class(0.999 * edge_w, beam, stalled=True) == below
        assert budget.laser_class(1.001 * edge_w, beam, stalled=True) == above
    assert budget.laser_class(0.499 / beam.duty, beam, stalled=True) == "3B"
    assert budget.laser_class(0.501 / beam.duty, beam, stalled=True) == "4"


def test_infrared_has_no_class_2() -> None:
    lines = budget.safety_lines(scene(laser={"wavelength_nm": 850}), CONFIG)
    assert not any("class 2" in line for line in lines)
    beam = budget.emission(scene(laser={"wavelength_nm": 850}), CONFIG)
    c4 = 10.0 ** (0.002 * 150.0)
    edge_w = 0.39e-3 * c4 / beam.duty
    assert budget.laser_class(0.999 * edge_w, beam, stalled=True) == "1"
    assert budget.laser_class(1.001 * edge_w, beam, stalled=True) == "3R"


@pytest.mark.parametrize(
    ("power_mw", "moving", "stalled"), [(9, "1", "1"), (20, "1", "2"), (50, "2", "3R")]
)
def test_safety_lines_state_both_classes(power_mw: float, moving: str, stalled: str) -> None:
    lines = budget.safety_lines(
        scene(laser={"power_mw": power_mw, "aperture_mm": float("inf")}), CONFIG
    )
    assert f"class {moving} while the mirror moves, class {stalled} if it stalls" in lines[-1]
    assert f"{power_mw:g} mW in a pulse" in lines[0]
    rest = [float(text) for text in re.findall(r"([\d.]+) stalled", lines[1])]
    duty = CONFIG.line.rate_hz * 1e-6 * CONFIG.line.pulse_us
    assert rest == pytest.approx([0.39 / duty, 1.0 / duty, 5.0 / duty], rel=0.01)


def test_no_power_has_no_class() -> None:
    lines = budget.safety_lines(scene(laser={"power_mw": 0}), CONFIG)
    assert "no laser light" in lines[-1]


# Other light


LAMP = {"kind": "led", "illuminance_lux": 2000.0, "flicker": 0.0}


def brightness(light: Light, found: Plan) -> tuple[float, float, float]:
    """B, least power in mW and required B, of the middle zone."""
    (line,) = (line for line in budget.light_lines(light, found) if "middle, z" in line)
    words = re.search(r"B ([\d.e+]+), least power ([\d.e+-]+) mW \(B ([\d.e+]+)\)", line)
    assert words is not None, line
    return float(words[1]), float(words[2]), float(words[3])


def test_a_scene_in_the_dark_has_no_light_lines() -> None:
    assert budget.light_lines(*planned()) == []


def test_brightness_ratio_of_a_lamp() -> None:
    """B - 1 is the laser's mean irradiance over its disc, over lux times W/lm in the band."""
    light = Light(scene(lamp=[LAMP]), CONFIG)
    found = planned()[1]
    ratio, least, required = brightness(light, found)
    radius = float(radius_mm(np.array(PLATE_Z), light.scene.laser))
    duty = 1e-6 * CONFIG.line.pulse_us * CONFIG.line.rate_hz
    laser = 5e-3 * duty / (math.pi * (1e-3 * radius) ** 2)
    lamp = 2000.0 * watts_per_lumen("led", *light.scene.lens.filter_nm)
    print(f"B measured {ratio}, predicted {1 + laser / lamp:.4g}")
    assert ratio == pytest.approx(1.0 + laser / lamp, rel=0.006)
    power = {"power_mw": least, "aperture_mm": float("inf")}
    at_least = brightness(Light(scene(lamp=[LAMP], laser=power), CONFIG), found)[0]
    assert at_least == pytest.approx(required, rel=0.02)  # least power has two digits


def test_brightness_ratio_is_what_the_rows_show() -> None:
    """A Gaussian spot is twice as bright in its middle as the disc of (4) and sums up to that."""
    light = Light(scene(lamp=[LAMP], material={"default": {"reflectance": 0.05}}), CONFIG)
    ratio = brightness(light, planned()[1])[0]
    lines = simulate(light, 60, frozenset({"lamps"})).lines
    counts = lines.lines.astype(np.float64)
    assert counts.max() < 4095
    offset = light.scene.sensor.offset_counts
    # A pixel of the lamp's light has too few counts to be read off its rounded row.
    lamp_e = float(light.ambient("lamps", 0.0)[1023])
    rows = np.where(counts > np.median(counts), counts - offset, 0.0)
    window = (rows > 0.0).sum(axis=1)
    kappa = CONFIG.peak.kappa
    spot_e = float(np.mean(rows.sum(axis=1) / kappa - window * lamp_e))
    geometry = CONFIG.geometry
    radius = float(radius_mm(np.array(PLATE_Z), light.scene.laser))
    depth = (0.0 - geometry.base_mm) * -math.cos(geometry.bias_rad) + PLATE_Z * math.sin(
        geometry.bias_rad
    )
    across = 0.5 * radius * geometry.focal_mm / geometry.pitch_mm / depth  # sigma, px
    in_row = math.erf(0.5 / (math.sqrt(2.0) * across))
    # Peak times 2 pi sigma sigma' is all of the spot; the row takes a share of it.
    expected = 2.0 * (ratio - 1.0) * lamp_e * 2.0 * math.pi * across**2 * in_row
    print(f"electrons of the spot on the row: measured {spot_e:.0f}, from B {expected:.0f}")
    assert spot_e == pytest.approx(expected, rel=0.05)


def test_glint_is_the_lobe_at_the_bisector() -> None:
    """A plate whose normal halves the way to the lens shows the lobe's peak at x = 0."""
    half = 0.5 * math.degrees(math.atan2(60.0, PLATE_Z))
    plate = {
        "kind": "plane",
        "name": "mirror",
        "position_mm": [0, 0, PLATE_Z],
        "rotation_deg": [0, -half, 0],
        "material": "steel",
    }
    steel = {"reflectance": 0.2, "gloss": 0.3, "lobe_deg": 5}
    light = Light(scene(target=[plate], material={"steel": steel}), CONFIG)
    found = planned()[1]
    (line,) = budget.light_lines(light, found)
    words = re.search(r"up to ([\d.]+) times .* x (-?\d+), z (\d+) mm", line)
    assert words is not None, line
    normal = np.array([[math.sin(math.radians(half)), 0.0, -math.cos(math.radians(half))]])
    ray = np.array([[0.0, 0.0, 1.0]])
    view = ray - 2.0 * (ray @ normal.T) * normal  # the mirrored ray
    np.testing.assert_allclose(view[0], np.array([60, 0, -PLATE_Z]) / math.hypot(60, PLATE_Z))
    pupil = 0.5 * CONFIG.geometry.focal_mm / 3.0 / math.hypot(60.0, PLATE_Z)
    peak = brdf(light.materials[0], ray, normal, view, acceptance_rad=pupil)[0]
    want = float(peak) / (0.2 / math.pi)
    print(f"glint measured {words[1]}, lobe's peak {want:.4g}")
    assert float(words[1]) == pytest.approx(want, rel=0.05)
    assert abs(float(words[2])) <= 5.0
