"""Where rays meet the scene and what the camera gets of them, against geometry done by hand."""

import math
import warnings
from pathlib import Path

import numpy as np
import pytest
from scanners import EACH_SCANNER

from vrscan.data.arrays import Floats
from vrscan.data.config import Config
from vrscan.ideal.geometry import project
from vrscan.scene.description import Description, parse
from vrscan.scene.light import Light
from vrscan.scene.spots import STEEPEST_PX_PER_MM, Camera, Spots, meet

SEED = 20100301
CONFIG = Config()
PUPIL_MM2 = 0.25 * math.pi * (25.0 / 3.0) ** 2


def _scene(*targets: dict[str, object], **tables: object) -> Description:
    return parse({"target": list(targets), **tables}, "scene", Path())


def _meet(
    scene: Description,
    angle: Floats,
    *,
    offset: float = 0.0,
    y: float = 0.0,
    gloss: bool = False,
    falloff: bool = False,
    config: Config = CONFIG,
) -> Spots:
    light = Light(scene, config)
    direction = np.stack([np.sin(angle), np.zeros(len(angle)), np.cos(angle)], axis=1)
    across = np.stack([np.cos(angle), np.zeros(len(angle)), -np.sin(angle)], axis=1)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        return meet(
            light.world,
            light.materials,
            scene,
            config,
            offset * across,
            direction,
            np.full(len(angle), y),
            gloss=gloss,
            falloff=falloff,
        )


def _plane(z: float, turn: float = 0.0, tip: float = 0.0, **more: object) -> dict[str, object]:
    return {"kind": "plane", "position_mm": [0, 0, z], "rotation_deg": [tip, turn, 0], **more}


def with_geometry(config: Config, **changed: float) -> Config:
    geometry = config.geometry.model_copy(update=changed)
    return config.model_copy(update={"geometry": geometry})


@EACH_SCANNER
@pytest.mark.parametrize("offset", [0.0, 15.0])
def test_the_camera_sees_its_axis_in_the_middle_of_the_sensor(
    offset: float, config: Config
) -> None:
    config = with_geometry(config, offset_mm=offset)
    middle, geometry = config.sensor.line_length / 2 - 0.5, config.geometry
    camera = Camera.of(config, 3.0)
    for along in (100.0, 700.0):
        point = camera.place + along * camera.axis
        assert abs(project(point[:1], point[2:], geometry)[0] - middle) < 1e-9
        beside = point + 0.01 * along * camera.side
        want = middle + 0.01 * geometry.focal_mm / geometry.pitch_mm
        assert abs(project(beside[:1], beside[2:], geometry)[0] - want) < 1e-6
    assert abs(camera.axis @ camera.side) < 1e-15
    assert abs(camera.pupil_mm2 - 54.54) < 0.01


@EACH_SCANNER
@pytest.mark.parametrize("distortion", [0.0, 2e-4])
def test_the_image_moves_as_a_ray_beside_the_axis_shows(distortion: float, config: Config) -> None:
    config = with_geometry(config, k1=distortion)
    rng = np.random.default_rng(SEED)
    angle = np.radians(np.linspace(-9.0, 9.0, 7))
    for _ in range(25):
        z, turn, tip = rng.uniform(250, 900), rng.uniform(-60, 60), rng.uniform(-60, 60)
        scene = _scene(_plane(z, turn, tip))
        here = _meet(scene, angle, config=config)
        low, high = (_meet(scene, angle, offset=s, config=config) for s in (-1e-4, 1e-4))
        rows = here.seen & low.seen & high.seen
        moved = (high.position_px - low.position_px)[rows] / 2e-4
        assert np.allclose(here.px_per_mm[rows], moved, rtol=1e-5, atol=1e-3)


@EACH_SCANNER
def test_the_light_is_that_of_the_range_equation_on_a_turned_surface(config: Config) -> None:
    geometry, scale = config.geometry, config.geometry.base_mm / 60.0  # so large is the scanner
    rng = np.random.default_rng(SEED)
    count = 0
    for _ in range(40):
        z, turn, tip = scale * rng.uniform(200, 1200), rng.uniform(-80, 80), rng.uniform(-80, 80)
        angle = np.radians(rng.uniform(-10, 10, 1))
        scene = _scene(
            _plane(z, turn, tip, map={"kind": "stripes", "low": 0.4, "high": 0.4}),
            material={"default": {"reflectance": 0.6}},
        )
        plain, side = (_meet(scene, angle, falloff=on, config=config) for on in (False, True))
        if not plain.seen[0]:
            continue
        count += 1
        tip_r, turn_r = math.radians(tip), math.radians(turn)
        normal = np.array([0.0, math.sin(tip_r), -math.cos(tip_r)])
        normal = np.array(
            [
                normal[0] * math.cos(turn_r) + normal[2] * math.sin(turn_r),
                normal[1],
                -normal[0] * math.sin(turn_r) + normal[2] * math.cos(turn_r),
            ]
        )
        ray = np.array([math.sin(angle[0]), 0.0, math.cos(angle[0])])
        reach = z * normal[2] / (ray @ normal)
        point = reach * ray
        sight = np.array([geometry.base_mm, 0.0, 0.0]) - point
        far = float(np.linalg.norm(sight))
        if ray @ normal > 0:
            normal = -normal
        upright = max(float(sight @ normal) / far, 0.0)
        want = 0.6 * 0.4 / math.pi * upright * PUPIL_MM2 / far**2
        assert abs(plain.distance[0] - reach) < 1e-9
        assert abs(plain.collected[0] - want) <= 1e-12 * want
        phi = geometry.bias_rad
        axis = np.array([-math.cos(phi), 0.0, math.sin(phi)])
        assert abs(side.collected[0] - want * float(-sight @ axis) / far) <= 1e-12 * want
        assert abs(plain.depth[0] - float(-sight @ axis)) < 1e-9
    assert count > 20


def test_the_glint_is_where_the_bisector_is_the_normal() -> None:
    scene = _scene(
        {"kind": "cylinder", "position_mm": [0, 0, 430], "radius_mm": 30},
        material={"default": {"reflectance": 0.0, "gloss": 0.6, "lobe_deg": 2.0}},
    )
    angle = np.linspace(-0.06, 0.06, 2401)
    spots = _meet(scene, angle, gloss=True)
    best = int(spots.collected.argmax())
    point = spots.point[best]
    normal = (point - np.array([0.0, 0.0, 430.0])) / 30.0
    back = -point / np.linalg.norm(point)
    sight = np.array([60.0, 0.0, 0.0]) - point
    half = back + sight / np.linalg.norm(sight)
    half /= np.linalg.norm(half)
    assert math.degrees(math.acos(min(1.0, float(half @ normal)))) < 0.15
    assert spots.collected[best] < 0.6
    assert _meet(scene, angle).collected.max() == 0.0  # Lambert alone: there is none


def test_what_stands_between_spot_and_lens_hides_it() -> None:
    # A thin post on the line from the spot at angle 0 to the lens.
    post = {"kind": "cylinder", "position_mm": [30, 0, 200], "radius_mm": 3}
    angle = np.array([0.0, 0.05])
    free, hidden = _meet(_scene(_plane(400.0)), angle), _meet(_scene(_plane(400.0), post), angle)
    assert free.seen.all()
    assert list(hidden.seen) == [False, True]
    assert list(hidden.lit) == [True, True]
    assert hidden.collected[0] == 0.0 < hidden.collected[1] == free.collected[1]


def test_the_far_side_of_a_surface_sends_nothing() -> None:
    # Lit from the left of a plane that leans past the camera.
    spots = _meet(_scene(_plane(400.0, -85.0)), np.radians([-3.0, 0.0, 3.0]))
    normal = np.array([-math.sin(math.radians(85.0)), 0.0, math.cos(math.radians(85.0))])
    side = [float((np.array([60.0, 0, 0]) - p) @ normal) * float(p @ normal) for p in spots.point]
    for k in range(3):
        if spots.lit[k]:
            assert (spots.collected[k] > 0.0) == (side[k] < 0.0 and bool(spots.seen[k]))


@pytest.mark.parametrize("z", [-500.0, -1.0, 0.0, 5.0])
def test_targets_behind_or_beside_the_lens_have_no_image_or_a_finite_one(z: float) -> None:
    spots = _meet(_scene(_plane(z)), np.radians(np.linspace(-80.0, 80.0, 33)))
    assert np.isfinite(spots.collected).all()
    assert np.isfinite(spots.px_per_mm).all()
    assert np.isfinite(spots.position_px[spots.seen]).all()
    assert (spots.collected[~spots.seen] == 0.0).all()
    if z < 0.0:
        assert not spots.seen.any()
        assert not spots.lit.any()
        assert np.isinf(spots.distance).all()


def test_a_beam_along_a_surface_spreads_no_farther_than_stated() -> None:
    for turn in (89.9, 89.9999, 90.0, 90.0001):
        spots = _meet(_scene(_plane(400.0, turn)), np.radians(np.linspace(-1.0, 1.0, 41)))
        assert np.abs(spots.px_per_mm).max() <= STEEPEST_PX_PER_MM
        assert np.isfinite(spots.collected).all()
        assert (spots.collected <= 1.0).all()


def test_a_scanner_that_moves_sees_another_part_in_its_own_frame() -> None:
    ball = {"kind": "sphere", "position_mm": [0, 20, 400], "radius_mm": 30}
    scene = _scene(ball)
    angle = np.zeros(1)
    for y in (-15.0, 0.0, 20.0, 35.0, 60.0):
        spots = _meet(scene, angle, y=y)
        square = 30.0**2 - (y - 20.0) ** 2
        assert spots.lit[0] == (square > 0.0)
        if square > 0.0:
            assert np.allclose(spots.point[0], [0.0, 0.0, 400.0 - math.sqrt(square)], atol=1e-9)


@EACH_SCANNER
def test_a_spot_far_beside_the_sensor_is_not_followed_and_one_near_it_is(config: Config) -> None:
    angle = np.radians(np.linspace(-60.0, 60.0, 401))
    spots = _meet(_scene(_plane(500.0)), angle, config=config)
    half = config.sensor.line_length / 2
    near = np.abs(spots.position_px - half) < half + 400.0
    assert near.any() and not near.all()
    assert np.array_equal(spots.seen, near)
    assert (spots.collected[~near] == 0.0).all()
