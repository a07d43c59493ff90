"""The second bounce against the integral over the beam, and against itself for every pixel."""

import math
from pathlib import Path

import numpy as np
import pytest

from vrscan.data.config import Config
from vrscan.scene import bounce
from vrscan.scene.beam import radius_mm
from vrscan.scene.description import Description, load, parse
from vrscan.scene.light import PAN_STEP_MM, Light
from vrscan.scene.simulate import Scanner

CONFIG = Config()


def _scene(target: dict[str, object], **tables: object) -> Description:
    values: dict[str, object] = {
        "stray": {"enabled": ["window", "filter", "lens", "cover", "sensor", "head_window"]},
        "laser": {"aperture_mm": math.inf},
        "material": {"default": {"reflectance": 0.8}},
        "target": [target],
    }
    return parse(values | tables, "scene", Path())


@pytest.mark.parametrize(("aside", "bound"), [(20.0, 0.02), (5.0, 0.07), (2.0, 0.07), (1.3, 0.16)])
def test_the_second_bounce_close_to_the_crease_is_the_integral_over_the_spot(
    aside: float, bound: float
) -> None:
    edge = 400.0
    plates = {"kind": "corner", "position_mm": [0, 0, edge], "size_mm": [100, 100]}
    scene = _scene(plates)
    light = Light(scene, CONFIG)
    angle = math.atan(-aside / (edge - aside))
    got = bounce.bounced(light, np.array([angle]), np.zeros(1))[0]
    # Every part of the beam on the left plate, z = edge + x, lights the right one, z = edge - x.
    radius = float(radius_mm(np.array([math.hypot(aside, edge - aside)]), scene.laser)[0])
    steps = np.linspace(-2.2, 2.2, 61) * radius
    across, height = (each.ravel() for each in np.meshgrid(steps, steps))
    weight = np.exp(-2.0 * (np.square(across) + np.square(height)) / radius**2)
    # An offset across the beam turns the ray to another place on the plate.
    turn = math.tan(angle) + across / (edge - aside) / math.cos(angle)
    deep = edge / (1.0 - turn)
    spot = np.stack([turn * deep, height, deep], axis=1)
    weight = np.where(spot[:, 0] < 0.0, weight, 0.0) / weight.sum()
    pixels = np.arange(4, 2044)
    beta = CONFIG.geometry.bias_rad + np.arctan((pixels - 1023.5) * 0.007 / 25.0)
    ray = np.stack([-np.cos(beta), np.zeros(len(beta)), np.sin(beta)], axis=1)
    far = (edge - 60.0) / (ray[:, 2] + ray[:, 0])
    point = np.array([60.0, 0.0, 0.0]) + far[:, None] * ray
    seen = (point[:, 0] > 0.05) & (point[:, 0] < 69.0)
    want = np.zeros(len(pixels))
    for k in np.flatnonzero(seen):
        way = point[k] - spot
        gap = np.linalg.norm(way, axis=1)
        cosines = (way[:, 0] - way[:, 2]) * (way[:, 0] + way[:, 2]) / 2.0 / np.square(gap)
        want[k] = 0.8 / math.pi * (weight * cosines / np.square(gap)).sum()
    off_axis = np.cos(beta - CONFIG.geometry.bias_rad) ** 4
    want *= 0.8 / math.pi * 0.007**2 * math.pi / 36.0 * off_axis
    worst = np.abs(got[pixels] - want)[seen].max() / want.max()
    print(f"{aside} mm from a crease: worst error of the bounce {worst:.4f} of its largest")
    assert worst < bound


def test_an_even_sweep_beyond_the_mirrors_bounces_too() -> None:
    plates = {"kind": "corner", "position_mm": [230, 0, 480], "size_mm": [200, 200]}
    scene = _scene(plates, scan={"sweep": "even", "half_angle_deg": 35.0})
    light = Light(scene, CONFIG)
    near, wide = (bounce.bounced(light, np.radians([a]), np.zeros(1)) for a in (21.0, 27.0))
    assert not np.array_equal(near, wide)


@pytest.mark.parametrize("name", ["corner", "bust"])
def test_near_its_spot_it_is_that_of_the_lines_own_spot_at_every_pixel(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    light = Light(load(name), CONFIG)
    scanner = Scanner(light, 100_000, frozenset())
    angle, y = [], []
    for block in (8, 13, 25, 34, 47, 60, 77, 88):
        when = scanner.timeline(block)
        seen = np.flatnonzero(np.isfinite(scanner.renderer.look(when).position_px))
        some = seen[:: max(1, len(seen) // 40)]
        angle.append(when.angle_rad[some])
        y.append(when.y_mm[some])
    places = np.concatenate(angle), np.round(np.concatenate(y) / PAN_STEP_MM) * PAN_STEP_MM
    got = bounce.bounced(light, *places)
    monkeypatch.setattr(bounce, "BESIDE_PX", 2048)
    want = bounce.bounced(light, *places)
    apart = np.abs(got - want).max() / want.max()
    print(f"{name}: {len(got)} lines, within {apart:.4f} of the largest bounce")
    assert len(got) > 20
    assert apart < 0.02
