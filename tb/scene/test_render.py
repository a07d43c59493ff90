"""Rendered lines: each effect alone against its closed form, energy, and nothing that breaks."""

import math
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.constants import c, h
from scipy.special import erf

from vrscan.data.arrays import Floats
from vrscan.data.config import Config
from vrscan.ideal.geometry import project, triangle, undistorted
from vrscan.scene import render
from vrscan.scene.description import Description, parse
from vrscan.scene.effects import EFFECTS
from vrscan.scene.ghosts import Ghosts
from vrscan.scene.light import Light
from vrscan.scene.render import Frame, Renderer
from vrscan.scene.sensor import bloom
from vrscan.scene.timeline import Timeline

SEED = 20100301
PEAK_RATE = 562.0  # rad/s, of the mirror
NOISE_FREE = frozenset(EFFECTS) - {"shot", "read", "dark", "prnu", "dsnu", "index", "speckle"}
CONFIG = Config.model_validate({"sensor": {"pixel_width": 16}})

# Light that is counted: no stop, no losses, a converter that never ends.
CLEAN = {
    "stray": {"enabled": ["window", "filter", "lens", "cover", "sensor", "head_window"]},
    "laser": {"aperture_mm": math.inf, "rise_us": 0.05},
    "lens": {"transmission": 1, "filter_transmission": 1},
    "sensor": {"full_well_e": 1e12, "offset_counts": 0, "gain": 0.1},
    "material": {"default": {"reflectance": 0.3}},
}


def _scene(*targets: dict[str, object], **tables: dict[str, object]) -> Description:
    values: dict[str, object] = {key: dict(value) for key, value in CLEAN.items()}
    for key, table in tables.items():
        known = values.get(key, {})
        values[key] = {**known, **table} if isinstance(table, dict) else table
    values["target"] = list(targets)
    return parse(values, "scene", Path())


def _plane(z: float, turn: float = 0.0, **more: object) -> dict[str, object]:
    return {"kind": "plane", "position_mm": [0, 0, z], "rotation_deg": [0, turn, 0], **more}


def _times(angle: Floats, rate: float = 0.0, y: float = 0.0) -> Timeline:
    n = len(angle)
    return Timeline(
        line=np.arange(n),
        time_s=np.arange(n) / 37400.0,
        angle_rad=angle,
        rate_rad_per_s=np.full(n, rate),
        y_mm=np.full(n, y),
        reported_rad=angle + 1e-5,
        index_s=np.zeros(0),
        index_outward=np.zeros(0, np.bool_),
    )


def _frame(
    light: Light,
    active: frozenset[str] | set[str],
    angle: Floats,
    *,
    rate: float = 0.0,
    every_ray: bool = False,
) -> Frame:
    words = np.random.default_rng(SEED).integers(
        0, 65536, (len(angle), light.config.sensor.line_length), np.uint16
    )
    renderer = Renderer(light, frozenset(active), tolerance_px=0.0 if every_ray else None)
    return renderer.render(_times(angle, rate), words)


def _electrons(
    light: Light,
    active: frozenset[str] | set[str],
    angle: Floats,
    *,
    rate: float = 0.0,
    every_ray: bool = False,
) -> Floats:
    """Return electrons [n, length], of effects without noise, to half a count."""
    frame = _frame(light, active, angle, rate=rate, every_ray=every_ray)
    assert frame.lines.max() < 65535, "the converter ended"
    gain = light.scene.sensor.gain
    assert gain is not None
    return (frame.lines.astype(np.float64) - light.scene.sensor.offset_counts) / gain


def _fine(light: Light, angle: Floats) -> Light:
    """Return the same with a gain that puts the brightest pixel near the converter's end."""
    sensor = light.scene.sensor
    assert sensor.gain is not None
    coarse = light.scene.model_copy(
        update={"sensor": sensor.model_copy(update={"gain": 0.01 * sensor.gain})}
    )
    peak = _electrons(Light(coarse, light.config), frozenset(), angle).max()
    gain = 50_000.0 / float(peak)
    return Light(
        light.scene.model_copy(update={"sensor": sensor.model_copy(update={"gain": gain})}),
        light.config,
    )


def _moments(line: Floats, reach: int = 2048) -> tuple[float, float, float]:
    """Return sum, mean and variance about the peak, out to ``reach``."""
    peak = int(line.argmax())
    x = np.arange(max(peak - reach, 0), min(peak + reach + 1, len(line)))
    part = line[x]
    whole = float(part.sum())
    mean = float((part * x).sum() / whole)
    return whole, mean, float((part * np.square(x - mean)).sum() / whole)


def _depth(x: float, z: float) -> float:
    """Return the distance of a point from the lens along its axis."""
    phi = CONFIG.geometry.bias_rad
    return (60.0 - x) * math.cos(phi) + z * math.sin(phi)


def _angle_at(pixel: float, z: float) -> float:
    """Return the scan angle whose spot on a plane at z has its image at a pixel."""
    low, high = math.radians(-40.0), math.radians(40.0)
    for _ in range(60):
        middle = 0.5 * (low + high)
        got = project(np.array([z * math.tan(middle)]), np.array([z]), CONFIG.geometry)[0]
        low, high = (middle, high) if got < pixel else (low, middle)
    return 0.5 * (low + high)


# -- how much light there is --


@pytest.mark.parametrize(
    ("z", "rho", "photons"),
    [
        (250.0, 0.3, 3.489e8),
        (300.0, 0.3, 2.464e8),
        (600.0, 0.3, 6.343e7),
        (1000.0, 0.3, 2.298e7),
        (1000.0, 0.05, 3.830e6),
        (250.0, 0.9, 1.047e9),
    ],
)
def test_the_photons_are_those_of_the_range_equation(z: float, rho: float, photons: float) -> None:
    config = Config.model_validate({"sensor": {"pixel_width": 16}, "line": {"pulse_us": 26.7}})
    scene = _scene(
        _plane(z),
        material={"default": {"reflectance": rho}},
        sensor={"full_well_e": 1e12, "offset_counts": 0, "gain": 0.03},
    )
    light = _fine(Light(scene, config), np.zeros(1))
    got = _electrons(light, frozenset(), np.zeros(1))[0].sum()
    waist, wavelength = 0.5, 658e-6
    width = waist * math.hypot(1.0, z * wavelength / (math.pi * waist**2))
    sigma = 0.5 * width * 25.0 / 0.007 / _depth(0.0, z)
    row = float(erf(0.5 / (math.sqrt(2.0) * sigma)))
    upright = z / math.hypot(z, 60.0)  # which (2-31) leaves out
    want = photons * 26.7 / 26.74 * 0.5 * upright * row
    print(f"z {z:g} rho {rho}: {got:.4g} / {want:.4g} electrons, eta_B {row:.3f}")
    assert abs(got / want - 1.0) < 0.003
    assert 0.10 < row < 0.335


def test_the_pupil_from_the_side_is_foreshortened() -> None:
    light = Light(_scene(_plane(400.0)), CONFIG)
    angle = np.array([_angle_at(p, 400.0) for p in (100.0, 1023.5, 1950.0)])
    plain = _electrons(light, set(), angle).sum(axis=1)
    got = _electrons(light, {"falloff"}, angle).sum(axis=1)
    u = (np.array([100.0, 1023.5, 1950.0]) - 1023.5) * 0.007
    assert np.allclose(got / plain, np.cos(np.arctan(u / 25.0)), rtol=2e-4)


def test_sunlight_of_the_digest_makes_542_electrons() -> None:
    # 0.15 W cm^-2 um^-1 through 20 nm, a whole line of 26.74 us; 658 nm is the digest's photon.
    lamp = {"kind": "led", "illuminance_lux": 500, "flicker": 0.0}
    lens = {"filter_nm": [648, 668], "transmission": 1, "filter_transmission": 1}
    scene = _scene(_plane(400.0), lamp=[lamp], lens=lens)
    up = np.array([[0.0, 0.0, -1.0]])
    known = scene.lamp[0].in_band_irradiance(up, band_nm=scene.lens.filter_nm)[0]
    bright = {**lamp, "illuminance_lux": 500.0 * 30.0 / float(known)}
    light = Light(_scene(_plane(400.0), lamp=[bright], lens=lens), CONFIG)
    got = light.ambient("lamps", 0.0)
    fall = np.cos(np.arctan((np.arange(2048) - 1023.5) * 0.007 / 25.0)) ** 4
    print(f"ambient {got[1023]:.2f} / 542.5 electrons")
    assert abs(got[1023] / 542.5 - 1.0) < 2e-3
    assert np.allclose(got / got[1023], fall, rtol=1e-4)
    # And they are on every line, with their shot noise.
    lines = _frame(light, {"lamps", "shot"}, np.array([0.9, 0.9])).lines / 0.1
    assert abs(lines[:, 900:1100].mean() / 542.5 - 1.0) < 0.01
    assert abs(lines[:, 1000:1048].std() / math.sqrt(542.5 + 100 / 12) - 1.0) < 0.25


def test_no_light_comes_from_where_nothing_is() -> None:
    scene = _scene({"kind": "plane", "position_mm": [0, 0, 400], "size_mm": [40, 40]}, lamp=[{}])
    got = Light(scene, CONFIG).ambient("lamps", 0.0)
    edge = project(np.array([-20.0, 20.0]), np.array([400.0, 400.0]), CONFIG.geometry)
    assert got[: int(edge[0]) - 9].max() == 0.0
    assert got[int(edge[1]) + 10 :].max() == 0.0
    assert got[int(edge[0]) + 10 : int(edge[1]) - 9].min() > 0.0


def _ambient(
    scene: Description, name: str, time_s: Floats | float = 0.0, y_mm: Floats | float = 0.0
) -> Floats:
    """Return the electrons of lines with nothing but sun or lamps [n, length], to 1/40."""
    fine = scene.sensor.model_copy(update={"gain": 20.0})
    scene = scene.model_copy(update={"sensor": fine})
    time, y = np.broadcast_arrays(np.asarray(time_s, np.float64), np.asarray(y_mm, np.float64))
    when = replace(_times(np.full(len(time), 0.9)), time_s=time, y_mm=y)
    words = np.zeros((len(time), 2048), np.uint16)
    lines = Renderer(Light(scene, CONFIG), frozenset({name})).render(when, words).lines
    assert lines.max() < 65535
    return lines.astype(np.float64) / 20.0


def test_lamps_flicker_from_line_to_line() -> None:
    quarter = 0.25 / 120.0  # of the flicker, at 60 Hz: crest, mean, trough, mean, crest
    time = 7.0 / 120.0 + quarter * np.arange(5)
    lamp = {"illuminance_lux": 100_000.0, "mains_hz": 60.0}
    deep, weak = {**lamp, "flicker": 0.4}, {**lamp, "flicker": 0.1, "phase_rad": math.pi}
    steady = _ambient(_scene(_plane(400.0), lamp=[{**lamp, "flicker": 0.0}]), "lamps", time)
    assert steady[:, 1000].min() > 300.0
    assert np.ptp(steady, axis=0).max() == 0.0
    for lamps, level in (
        ([deep], [1.4, 1.0, 0.6, 1.0, 1.4]),
        ([deep, weak], [2.3, 2.0, 1.7, 2.0, 2.3]),  # the weak one is dark when the deep is bright
    ):
        got = _ambient(_scene(_plane(400.0), lamp=lamps), "lamps", time)
        print(f"levels {(got / steady).mean(axis=1).round(4)} / {level}")
        assert np.abs(got - np.array(level)[:, None] * steady).max() < 0.026 * (1.0 + max(level))


@pytest.mark.parametrize("name", ["sun", "lamps"])
def test_a_panning_scanner_sees_the_light_of_what_is_before_it(name: str) -> None:
    def plane(y: float, material: str) -> dict[str, object]:
        where = {"position_mm": [0, y, 400], "size_mm": [2000, 100]}
        return {"kind": "plane", "material": material, **where}

    tables: dict[str, object] = {
        "material": {"grey": {"reflectance": 0.2}, "white": {"reflectance": 0.6}},
        "sun": {"heading_deg": 180.0},
        "lamp": [{"illuminance_lux": 20_000.0, "flicker": 0.0}],
    }
    two = plane(-50.0, "grey"), plane(50.0, "white")
    y = np.array([-150.0, -60.0, -5.0, 5.0, 60.0, 150.0])
    got = _ambient(_scene(*two, scan={"pan_mm_per_s": 300.0}, **tables), name, y_mm=y)
    print(f"{name}: {got[:, 1000]} electrons")
    assert got[[0, 5]].max() == 0.0
    assert got[1, 1000] > 10.0
    assert np.array_equal(got[1], got[2])
    assert np.array_equal(got[3], got[4])
    assert np.abs(got[4] - 3.0 * got[1]).max() <= 0.026 * 4.0
    # A line does not depend on the lines beside it.
    alone = _ambient(_scene(*two, scan={"pan_mm_per_s": 300.0}, **tables), name, y_mm=y[3:4])
    assert np.array_equal(alone[0], got[3])


def test_a_panning_scanner_leaves_the_shadow_of_a_roof() -> None:
    # The sun stands high in the north, where the wall faces: below the roof it gets the sky alone.
    sun = {"heading_deg": 180.0, "sky": "given", "dni_w_m2": 800.0, "dhi_w_m2": 60.0}
    roof = {"kind": "box", "position_mm": [0, 60, 370], "size_mm": [2000, 4, 60]}
    scene = _scene(_plane(400.0), roof, sun=sun, scan={"pan_mm_per_s": 300.0})
    assert scene.sun is not None
    band = scene.lens.filter_nm
    facing = np.array([[0.0, 0.0, -1.0], [0.0, 0.0, -1.0]])
    shade, light = scene.sun.in_band_irradiance(
        facing, shaded=np.array([True, False]), band_nm=band
    )
    got = _ambient(scene, "sun", y_mm=np.array([0.0, 40.0, 100.0]))[:, 900:1100].mean(axis=1)
    print(f"in the light over in the shade {got[2] / got[0]:.3f} / {light / shade:.3f}")
    assert light / shade > 2.0
    assert abs(got[1] / got[0] - 1.0) < 0.01
    assert abs(got[2] / got[0] / (light / shade) - 1.0) < 0.02


# -- where it is and how wide --


@pytest.mark.parametrize("turn", [-40.0, 0.0, 30.0])
def test_the_spot_is_where_the_triangle_says_and_as_wide_as_the_beam(turn: float) -> None:
    light = Light(_scene(_plane(450.0, turn)), CONFIG)
    angle = np.radians([-8.0, 0.0, 6.0])
    frame = _frame(light, set(), angle)
    truth = frame.truth
    u, _ = undistorted(truth.position_px, CONFIG.geometry)
    found = triangle(u, angle, CONFIG.geometry)
    assert np.allclose(found.x, truth.x_mm, atol=1e-9)
    assert np.allclose(found.z, truth.z_mm, atol=1e-9)
    assert np.allclose(truth.x_mm, truth.z_mm * np.tan(angle))
    lines = _electrons(light, set(), angle)
    for k in range(3):
        whole, mean, variance = _moments(lines[k], 120)
        x, z = truth.x_mm[k], truth.z_mm[k]
        width = 0.5 * math.hypot(1.0, math.hypot(x, z) * 658e-6 / (math.pi * 0.25))
        # The same surface hit by a parallel ray beside the axis.
        way, slope = 1e-3, math.tan(math.radians(turn))  # z = 450 - slope x
        beside = np.array([math.cos(angle[k]), -math.sin(angle[k])]) * way
        run = (450.0 - slope * beside[0] - beside[1]) / (
            math.cos(angle[k]) + slope * math.sin(angle[k])
        )
        hit = beside + run * np.array([math.sin(angle[k]), math.cos(angle[k])])
        moved = project(hit[:1], hit[1:], CONFIG.geometry)[0] - truth.position_px[k]
        sigma = 0.5 * width * abs(moved) / way
        assert whole > 0.0
        assert abs(mean - truth.position_px[k]) < 2e-3
        assert abs(variance / (sigma**2 + 1.0 / 12.0) - 1.0) < 2e-3


@pytest.mark.parametrize(
    ("z", "pulse_us", "length_px"),
    [(250.0, 26.7, 51.0), (1000.0, 26.7, 54.0), (250.0, 1.0, 1.9), (1000.0, 1.0, 2.0)],
)
def test_motion_smears_the_spot_as_far_as_it_goes(
    z: float, pulse_us: float, length_px: float
) -> None:
    config = Config.model_validate({"sensor": {"pixel_width": 16}, "line": {"pulse_us": pulse_us}})
    gain = 0.02 if z < 500 else 0.2
    scene = _scene(
        _plane(z),
        laser={"aperture_mm": math.inf, "rise_us": 0.0, "power_mw": 50 / pulse_us},
        sensor={"full_well_e": 1e12, "offset_counts": 0, "gain": gain},
    )
    light = Light(scene, config)
    sides = 1e-6 * np.array([-1.0, 1.0])
    place = project(z * np.tan(sides), np.full(2, z), config.geometry)
    want = float(np.diff(place)[0]) / 2e-6 * PEAK_RATE * 1e-6 * pulse_us
    still, moved = (
        _moments(_electrons(light, {"smear"}, np.zeros(1), rate=rate)[0], 90)
        for rate in (0.0, PEAK_RATE)
    )
    got = math.sqrt(12.0 * (moved[2] - still[2]))
    print(f"z {z:g}, {pulse_us} us: smear {got:.3f} / {want:.3f} px")
    assert abs(got / want - 1.0) < 0.01
    assert abs(got / length_px - 1.0) < 0.04
    assert abs(moved[0] / still[0] - 1.0) < 1e-3
    assert abs(moved[1] - still[1]) < 0.01


def test_each_blur_keeps_the_light_and_defocus_what_the_row_still_sees() -> None:
    light = Light(_scene(_plane(330.0, 10.0)), CONFIG)
    angle = np.radians(np.linspace(-5.0, 9.0, 6))
    plain = _electrons(light, set(), angle, rate=PEAK_RATE).sum(axis=1)
    for name in ("smear", "diffraction", "coma", "footprint"):
        got = _electrons(light, {name}, angle, rate=PEAK_RATE, every_ray=True).sum(axis=1)
        print(name, got / plain)
        assert np.allclose(got, plain, rtol=2e-3), name
    sharp = _electrons(light, {"defocus"}, angle)
    share = sharp.sum(axis=1) / plain
    # Far more blurred than high, the row holds 4 / (3 pi) .. of what a Gaussian twice as wide has:
    # the numbers are image.row_share's, which is tested against a sum in two dimensions.
    assert (share > 0.2).all() and (share < 0.95).all()
    both = _electrons(light, {"defocus", "smear", "coma", "diffraction"}, angle, rate=PEAK_RATE)
    assert np.allclose(both.sum(axis=1), sharp.sum(axis=1), rtol=2e-3)


def test_coma_points_away_from_the_axis_on_both_sides() -> None:
    scene = _scene(_plane(400.0), lens={"coma_px": 3.0, **CLEAN["lens"]})
    light = Light(scene, CONFIG)
    angle = np.array([_angle_at(p, 400.0) for p in (150.0, 1023.5, 1900.0)])
    third = []
    for line in _electrons(light, {"coma"}, angle):
        whole, mean, _ = _moments(line, 80)
        x = np.arange(2048) - mean
        third.append(float((line * x**3)[np.abs(x) < 80].sum() / whole))
    want = [2.0 * (3.0 * (p - 1023.5) / 1024.0) ** 3 for p in (150.0, 1023.5, 1900.0)]
    print("third moment", third, "/", want)
    assert third[0] < 0.0 < third[2]
    assert np.allclose(third, want, atol=0.03 * want[2])


def test_rays_over_a_plane_are_its_tangent_plane() -> None:
    light = Light(_scene(_plane(500.0, 25.0)), CONFIG)
    angle = np.radians(np.linspace(-9.0, 9.0, 7))
    flat = _electrons(light, set(), angle)
    rays = _electrons(light, {"footprint"}, angle, every_ray=True)
    slope = math.tan(math.radians(25.0))
    for a, one, other in zip(angle, flat, rays, strict=True):
        first, second = _moments(one, 60), _moments(other, 60)
        # Only perspective bends the image of parallel rays: half its second derivative.
        side = np.array([-1.0, 0.0, 1.0])
        run = (500.0 - slope * side * np.cos(a) + side * np.sin(a)) / (
            np.cos(a) + slope * np.sin(a)
        )
        x, z = side * np.cos(a) + run * np.sin(a), -side * np.sin(a) + run * np.cos(a)
        place = project(x, z, CONFIG.geometry)
        width = 0.25 * math.hypot(1.0, run[1] * 658e-6 / (math.pi * 0.25))
        # And more light comes from the side where the camera is nearer and sees it less aslant.
        sight = np.stack([60.0 - x, -z], axis=1)
        far = np.linalg.norm(sight, axis=1)
        collected = -(sight @ np.array([slope, 1.0])) / far**3
        want = 0.5 * (place[0] - 2.0 * place[1] + place[2]) * width**2
        want += (place[2] - place[0]) * (collected[2] - collected[0]) / collected[1] / 4 * width**2
        moved = second[1] - first[1]
        print(f"rays against plane: {moved:+.5f} / {want:+.5f} px, width {second[2] / first[2]}")
        assert abs(second[0] / first[0] - 1.0) < 2e-3
        assert abs(moved - want) < 1e-3
        assert abs(second[2] / first[2] - 1.0) < 5e-3


@pytest.mark.parametrize(
    "target",
    [
        _plane(500.0, 25.0),
        _plane(350.0, 45.0),
        {"kind": "cylinder", "position_mm": [0, 0, 700], "radius_mm": 120},
    ],
    ids=("plane", "steep", "cylinder"),
)
def test_a_spot_on_its_plane_is_where_its_rays_are(target: dict[str, object]) -> None:
    """Curvature and uneven light move it by up to the tolerance; its speckle is the same."""
    light, angle = Light(_scene(target), CONFIG), np.radians(np.linspace(-4.0, 4.0, 9))

    def charge(active: set[str], every_ray: bool) -> Floats:
        made = Renderer(light, frozenset(active), tolerance_px=0.0 if every_ray else 0.01)
        return made.charge(_times(angle, PEAK_RATE)).laser_e.astype(np.float64)

    axis, spot, rays = (
        charge(*way) for way in ((set(), False), ({"footprint"}, False), ({"footprint"}, True))
    )
    place = [
        (lines @ np.arange(lines.shape[1])) / lines.sum(axis=1) for lines in (axis, spot, rays)
    ]
    print("without the shift", np.round(place[0] - place[2], 4), "with it", place[1] - place[2])
    assert np.abs(place[0] - place[2]).max() > 0.002
    assert np.abs(place[1] - place[2]).max() < 3e-4
    coarse = {"footprint", "speckle", "grain", "defocus", "smear"}
    spot, rays = charge(coarse, False), charge(coarse, True)
    assert np.abs(spot - rays).max() < 5e-3 * rays.max()


@pytest.mark.parametrize("offset", [-1.0, -0.3, 0.0, 0.5, 1.2])
def test_a_spot_on_two_surfaces_splits_its_light_as_its_area(offset: float) -> None:
    # A sheet in front of a wall hides the beam's part at negative x; the camera sees both.
    front, back = 400.0, 440.0
    scene = _scene(
        {"kind": "plane", "position_mm": [-50, 0, front], "size_mm": [100, 80]}, _plane(back)
    )
    light = Light(scene, CONFIG)
    width = 0.5 * math.hypot(1.0, front * 658e-6 / (math.pi * 0.25))
    angle = np.array([math.atan(0.5 * width * offset / front)])
    line = _electrons(light, {"footprint"}, angle)[0]
    near, far = (project(np.zeros(1), np.array([z]), CONFIG.geometry)[0] for z in (front, back))
    cut = round(0.5 * (near + far))
    got = float(line[:cut].sum() if near < far else line[cut:].sum()) / float(line.sum())
    back_share = 0.5 * (1.0 + float(erf(offset / math.sqrt(2.0))))
    # What one surface sends against the other: each as a plane of its own.
    alone = [
        _electrons(Light(_scene(_plane(z)), CONFIG), set(), np.zeros(1)).sum()
        for z in (front, back)
    ]
    want = (1 - back_share) * alone[0] / ((1 - back_share) * alone[0] + back_share * alone[1])
    print(f"offset {offset} sigma: front {got:.4f} / {want:.4f}")
    assert abs(got - want) < 0.012


# -- noise --


@pytest.mark.parametrize(("noise", "slope"), [("shot", 0.5), ("read", 1.0)])
def test_signal_over_noise_rises_as_its_root_or_as_itself(noise: str, slope: float) -> None:
    power = np.array([0.3, 3.0, 30.0])
    ratio = []
    for mw in power:
        scene = _scene(
            _plane(700.0),
            laser={"aperture_mm": math.inf, "power_mw": float(mw)},
            sensor={"full_well_e": 1e9, "offset_counts": 1000, "gain": 1.0, "read_noise_e": 40},
        )
        light = Light(scene, CONFIG)
        counts = _frame(light, {noise}, np.full(600, 0.01)).lines.astype(np.float64)
        middle = int(_electrons(light, set(), np.array([0.01]))[0].argmax())
        sums = counts[:, middle - 15 : middle + 16].sum(axis=1) - 1000.0 * 31
        ratio.append(sums.mean() / sums.std())
    got = np.diff(np.log(ratio)) / np.diff(np.log(power))
    print(f"{noise}: S/N {np.round(ratio, 1)}, slopes {np.round(got, 3)} / {slope}")
    assert np.allclose(got, slope, atol=0.04)


@pytest.mark.parametrize("looks", [1.0, 4.0])
def test_speckle_of_lines_has_its_contrast(looks: float) -> None:
    scene = _scene(_plane(500.0), material={"default": {"reflectance": 0.3, "looks": looks}})
    light = Light(scene, CONFIG)
    angle = np.radians(np.linspace(-11.0, 11.0, 900))
    plain, got = _electrons(light, set(), angle), _electrons(light, {"speckle"}, angle)
    bright = plain > 0.2 * plain.max(axis=1, keepdims=True)
    gain = got[bright] / plain[bright]
    # Cells of (4 / pi) (lambda F (1 + m))^2 against a pixel's 49 um^2, when there are many.
    focus = scene.lens.focus_mm
    lens = 0.658 * 3.0 * focus / (focus - 25.0)
    many = math.sqrt(4.0 / math.pi * lens**2 / 49.0 / looks)
    exact = float(light.speckle.contrast(looks))
    print(f"looks {looks}: contrast {gain.std():.4f} / {exact:.4f}, many cells {many:.4f}")
    assert abs(gain.mean() - 1.0) < 0.01
    assert abs(gain.std() / exact - 1.0) < 0.05
    assert abs(exact / many - 1.0) < 0.2


@pytest.mark.parametrize(("waist_mm", "z"), [(1.0, 450.0), (2.0, 450.0), (2.0, 300.0)])
def test_speckle_moves_the_centroid_as_far_as_it_must(waist_mm: float, z: float) -> None:
    scene = _scene(_plane(z), laser={"beam_diameter_mm": waist_mm, "aperture_mm": math.inf})
    light = Light(scene, CONFIG)
    ends = _angle_at(150.0, z), _angle_at(1900.0, z)
    angle = np.linspace(*ends, 1500)
    place = _frame(light, set(), angle).truth.position_px
    got = []
    for line, middle in zip(_electrons(light, {"speckle"}, angle), place, strict=True):
        x = np.arange(2048) - middle
        near = np.abs(x) < 40
        got.append(float((line * x)[near].sum() / line[near].sum()))
    waist = 0.5 * waist_mm
    width = waist * math.hypot(1.0, z * 658e-6 / (math.pi * waist**2))
    sigma = 0.5 * width * 25.0 / 0.007 / _depth(0.0, z)
    # Gains of contrast C and neighbours' correlation rho: C^2 (1 + 2 rho) sum f^2 x^2 / (sum f)^2.
    contrast = float(light.speckle.contrast(light.looks[0]))
    rho = light.speckle.correlation
    want = contrast * math.sqrt((1 + 2 * rho) * sigma / (4.0 * math.sqrt(math.pi)))
    print(f"s {sigma:.2f}: centroid {np.std(got):.4f} / {want:.4f} px")
    assert abs(np.std(got) / want - 1.0) < 0.12
    assert abs(np.mean(got)) < 4.0 * want / math.sqrt(150)
    assert 0.09 < np.std(got) < 0.21


def test_pixels_differ_as_much_as_stated() -> None:
    scene = _scene(
        _plane(900.0),
        sensor={"full_well_e": 1e9, "offset_counts": 200, "gain": 1.0, "prnu": 0.02, "dsnu_e": 7},
    )
    light = Light(scene, CONFIG)
    dark = _frame(light, {"dsnu"}, np.full(1, 0.9)).lines[0].astype(float) - 200.0
    assert abs(dark.std() / math.hypot(7.0, math.sqrt(1 / 12)) - 1.0) < 0.06
    angle = np.radians(np.linspace(-12, 12, 400))
    plain, got = _electrons(light, set(), angle), _electrons(light, {"prnu"}, angle)
    bright = plain > 1000.0
    assert abs((got[bright] / plain[bright]).std() / 0.02 - 1.0) < 0.1


# -- stray light --


def test_the_windows_ghost_is_where_two_reflections_put_it() -> None:
    window = {"tilt_deg": 8.0, "inner_reflectance": 0.3, "outer_reflectance": 0.3}
    scene = _scene(_plane(300.0), stray={"head_window": {**window, "thickness_mm": 30.0}})
    light = Light(scene, CONFIG)
    angle = np.radians([-3.0, 0.0, 5.0])
    plain, got = _electrons(light, set(), angle), _electrons(light, {"window"}, angle)
    for k in range(3):
        slant = angle[k] - math.radians(-8.0)  # positive tilt: larger x is farther away
        inside = math.asin(math.sin(slant) / 1.5143)
        shift = 2.0 * 30.0 * math.tan(inside) * math.cos(slant)
        way = np.array([math.sin(angle[k]), math.cos(angle[k])])
        options = []
        for sign in (-1.0, 1.0):
            start = sign * shift * np.array([way[1], -way[0]])
            hit = start + (300.0 - start[1]) / way[1] * way
            options.append(project(hit[:1], hit[1:], CONFIG.geometry)[0])
        ghost = _moments(got[k] - plain[k], 40)
        main = _moments(plain[k], 40)
        off = [abs(ghost[1] - option) for option in options]
        print(f"ghost at {ghost[1]:.2f} / {options[int(np.argmin(off))]:.2f} px")
        # The place follows the surface's tangent: exact on a plane, but for the perspective.
        assert min(off) < 0.02 * abs(ghost[1] - main[1])
        assert abs(ghost[0] / main[0] / 0.09 - 1.0) < 0.01


def _bare_stack(**more: object) -> dict[str, object]:
    return {
        "enabled": ["cover", "sensor"],
        "lens": {"kind": "thin"},
        "cover": {
            "gap_mm": 1.0,
            "front_reflectance": 0.0,
            "back_reflectance": 0.5,
            "thickness_mm": 0.7,
        },
        "sensor_reflectance": 0.5,
        "least_power": 0.0,
        "least_density": 0.0,
        **more,
    }


def test_the_chips_ghost_off_its_cover_is_a_disc_where_geometry_puts_it() -> None:
    z = 420.0
    depth = _depth(0.0, z)
    scene = _scene(
        _plane(z),
        stray=_bare_stack(),
        lens={"focus_mm": depth, "transmission": 1, "filter_transmission": 1},
        sensor={"full_well_e": 1e12, "offset_counts": 0, "gain": 1.0},
        laser={"aperture_mm": math.inf, "power_mw": 0.6},
    )
    angle = np.array([_angle_at(p, z) for p in (700.0, 1023.5, 1500.0)])
    light = _fine(Light(scene, CONFIG), angle)
    plain, got = _electrons(light, set(), angle), _electrons(light, {"ghosts"}, angle)
    for k, place in enumerate((700.0, 1023.5, 1500.0)):
        extra = got[k] - plain[k]
        whole, mean, variance = _moments(np.maximum(extra, 0.0))
        # Two gaps more to go: a disc of 2 g / 2 F, moved by 2 g tan(chief) along the row; of a lens
        # that is focused by 25 mm / (1 - 25 / depth).
        behind = 25.0 / (1.0 - 25.0 / depth)
        radius = 1.0 / 3.0 / 0.007 * 25.0 / behind
        offset = 2.0 * 1.0 * (place - 1023.5) / behind
        width = 0.5 * math.hypot(
            1.0, math.hypot(z * math.tan(angle[k]), z) * 658e-6 / math.pi / 0.25
        )
        high = 0.5 * width * 25.0 / 0.007 / _depth(z * math.tan(angle[k]), z)
        light_whole = plain[k].sum() / float(erf(0.5 / (math.sqrt(2.0) * high)))
        want = light_whole * 0.25 * 2.0 / (math.pi * radius)
        print(
            f"ghost at {mean - place:+.2f} / {offset:+.2f} px, {whole:.0f} / {want:.0f} e, "
            f"rms {math.sqrt(variance):.1f} / {radius / math.sqrt(3):.1f}"
        )
        assert abs(mean - place - offset) < 0.6
        assert abs(whole / want - 1.0) < 0.06
        assert abs(math.sqrt(variance) / (radius / math.sqrt(3.0)) - 1.0) < 0.1


@pytest.mark.parametrize(
    ("across", "blur"),
    [(0.0, 0.0), (2.0, 1.0), (0.0, 5.9), (0.0, 12.0), (0.0, 30.0), (10.0, 30.0), (-20.0, 30.0)],
)
def test_a_ghost_on_the_row_is_a_disc_blurred_by_the_spot(
    across: float, blur: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    place, away = 800.0, 300.3

    def one(self: Light, depth_mm: Floats, field_mm: Floats) -> Ghosts:
        assert depth_mm.shape == field_mm.shape == (1,)
        values = (np.full((1, 1), value) for value in (away, across, blur, 1.0))
        return Ghosts(("one",), *values, np.zeros(1))

    monkeypatch.setattr(Light, "ghosts", one)
    angle = np.array([_angle_at(place, 420.0)])
    light = _fine(Light(_scene(_plane(420.0)), CONFIG), angle)
    x = 420.0 * math.tan(angle[0])
    width = 0.5 * math.hypot(1.0, math.hypot(x, 420.0) * 658e-6 / math.pi / 0.25)
    sigma = 0.5 * width * 25.0 / 0.007 / _depth(x, 420.0)
    plain, lit = (_electrons(light, more, angle)[0] for more in (set(), {"ghosts"}))
    whole = plain.sum() / float(erf(0.5 / (math.sqrt(2.0) * sigma)))
    got = (lit - plain) / whole

    # The disc as thin strips along the row, each a box blurred along it and weighted across it.
    strip = np.linspace(-1.0, 1.0, 4001)[1:-1]
    radius = max(blur, 1e-3)
    chord = radius * np.sqrt(1.0 - np.square(strip))
    offset = (np.arange(2048) - place - away)[:, None]
    scale = 1.0 / (math.sqrt(2.0) * math.hypot(sigma, math.sqrt(1.0 / 12.0)))  # with a pixel's
    along = 0.5 * (erf((offset + chord) * scale) - erf((offset - chord) * scale))
    gap, scale = across + radius * strip, 1.0 / (math.sqrt(2.0) * sigma)
    onto = 0.5 * (erf((gap + 0.5) * scale) - erf((gap - 0.5) * scale))
    want = along @ onto * (strip[1] - strip[0]) / (math.pi * radius)
    error = np.abs(got - want) / want.max()
    if blur > 8.0 * sigma:  # its ends count as hard
        end = math.sqrt(blur**2 - across**2)
        error = error[np.abs(np.abs(offset[:, 0]) - end) > 4.0 * sigma]
    off = float(offset[:, 0] @ got) / got.sum()
    print(
        f"light {got.sum():.5f} / {want.sum():.5f}, middle {off:+.3f} px off, "
        f"worst pixel {100.0 * error.max():.2f} %"
    )
    assert abs(got.sum() / want.sum() - 1.0) < 0.02
    assert abs(off) < 0.05
    assert error.max() < 0.02


def test_a_small_ghost_has_its_disc_with_and_without_defocus() -> None:
    stray = _bare_stack()
    stray["cover"] = {**stray["cover"], "gap_mm": 0.3}  # a disc of 14 px
    scene = _scene(_plane(420.0), stray=stray, lens={"focus_mm": _depth(0.0, 420.0)})
    light = Light(scene, CONFIG)
    spread = []
    for names in (set(), {"defocus"}):
        plain, got = (
            _electrons(light, names | more, np.zeros(1))[0] for more in (set(), {"ghosts"})
        )
        spread.append(_moments(np.maximum(got - plain, 0.0), 60)[2])
    assert abs(spread[0] / spread[1] - 1.0) < 0.02


def test_a_row_beside_the_spot_sees_the_same_halo_and_ghosts() -> None:
    rough = {"enabled": ["window", "filter", "halo"], "polish": {"roughness_nm": 20}}

    def extra(offset: float, name: str) -> float:
        scene = _scene(
            _plane(420.0),
            stray=_bare_stack() if name == "ghosts" else rough,
            lens={"focus_mm": 420.0, "row_offset_px": offset},
            sensor={"full_well_e": 1e12, "offset_counts": 0, "gain": 2.0},
            laser={"aperture_mm": math.inf, "power_mw": 50},
        )
        angle = np.array([_angle_at(1023.0, 420.0)])
        light = _fine(Light(scene, CONFIG), angle)
        plain, got = (_electrons(light, more, angle)[0] for more in (set(), {name}))
        off = np.abs(np.arange(2048) - 1023 - 25) < 10
        return float((got - plain)[off].sum())

    for name in ("ghosts", "halo"):
        assert abs(extra(6.0, name) / extra(0.0, name) - 1.0) < 0.02, name


def test_the_halo_takes_from_the_spot_what_it_scatters() -> None:
    angle = np.array([_angle_at(1023.0, 420.0)])
    stray = {"enabled": ["window", "filter", "cover", "halo"], "polish": {"roughness_nm": 15.0}}
    scene = _scene(_plane(420.0), stray=stray)
    light = _fine(Light(scene, CONFIG), angle)
    plain, got = (_electrons(light, more, angle)[0] for more in (set(), {"halo", "wings"}))
    clean = _fine(Light(_scene(_plane(420.0), stray={"enabled": []}), CONFIG), angle)
    whole = _electrons(clean, set(), angle)[0].max()
    left = 1.0 - light.halo.total
    print(f"peak {got.max() / whole:.4f} / {left:.4f} and some halo")
    assert light.halo.total > 0.02
    assert plain.max() / whole == pytest.approx(left, rel=1e-4)
    assert left < got.max() / whole < left + 0.2 * light.halo.total
    # Where it is brightest it follows the spot, without a needle in a single pixel.
    near = (got - plain)[1023 - 40 : 1023 + 41]
    assert abs(int(near.argmax()) - 40) <= 2
    assert near.max() < 1.15 * np.sort(near)[-3]
    # And far away, with so much gain that the spot ends the converter, it is that of the surfaces.
    gain = 1e3 * float(light.scene.sensor.gain or 0.0)
    sensor = light.scene.sensor.model_copy(update={"gain": gain})
    bright = Light(light.scene.model_copy(update={"sensor": sensor}), CONFIG)
    line = _frame(bright, {"halo", "wings"}, angle).lines[0] / gain
    width = 0.5 * math.hypot(1.0, 420.0 * 658e-6 / math.pi / 0.25)
    high = 0.5 * width * 25.0 / 0.007 / _depth(0.0, 420.0)
    whole = plain.sum() / float(erf(0.5 / (math.sqrt(2.0) * high)))
    for first, last in ((60, 120), (120, 400), (400, 1000)):
        want = whole / left * light.halo.weights[first:last].sum()
        sides = [line[1023 + first : 1023 + last].sum(), line[1024 - last : 1024 - first].sum()]
        print(f"halo from {first} to {last} px: {sides[0]:.3f}, {sides[1]:.3f} / {want:.3f} e")
        assert np.allclose(sides, want, rtol=0.02)


def test_dust_on_the_pupil_takes_its_share() -> None:
    scene = _scene(
        _plane(420.0),
        stray={
            "enabled": ["window", "filter", "dust"],
            "dust": {"level": 500.0, "cover_level": 1.0},
        },
    )
    light = Light(scene, CONFIG)
    plain, got = (_electrons(light, more, np.zeros(1))[0] for more in (set(), {"dust"}))
    assert 0.01 < light.obscured < 0.9
    assert abs(got.sum() / plain.sum() / (1.0 - light.obscured) - 1.0) < 2e-3


# -- the second bounce --


def test_the_second_bounce_is_the_integral_over_what_the_camera_sees() -> None:
    edge = 400.0
    plates = {"kind": "corner", "position_mm": [0, 0, edge], "size_mm": [100, 100]}
    scene = _scene(
        plates,
        material={"default": {"reflectance": 0.8}},
        sensor={"full_well_e": 1e12, "offset_counts": 0, "gain": 200.0},  # the spot saturates
    )
    light = Light(scene, CONFIG)
    # The plates are z = edge - |x|; the spot on the left one.
    angle = math.atan(-20.0 / (edge - 20.0))
    plain, got = (
        _frame(light, more, np.array([angle])).lines[0] / 200.0
        for more in (set(), {"bounce", "wings"})
    )
    extra = got - plain
    spot = np.array([-20.0, 0.0, edge - 20.0])
    left, right = (
        np.array([1.0, 0.0, -1.0]) / math.sqrt(2),
        np.array([-1.0, 0.0, -1.0]) / math.sqrt(2),
    )
    beam_e = 1e-6 * 50e-3 / (h * c / 658e-9) * 0.5  # of the whole pulse
    pixels = np.arange(40, 2000, 60)
    want = np.zeros(len(pixels))
    phi = CONFIG.geometry.bias_rad
    for k, pixel in enumerate(pixels):
        beta = phi + math.atan((pixel - 1023.5) * 0.007 / 25.0)
        ray = np.array([-math.cos(beta), 0.0, math.sin(beta)])
        far = (edge - 60.0) / (ray[2] + ray[0])  # on z = edge - x
        point = np.array([60.0, 0.0, 0.0]) + far * ray
        if not 0.5 < point[0] < 69.0:
            continue
        way = point - spot
        gap = float(np.linalg.norm(way))
        lit = 0.8 / math.pi * (way @ left) / gap * -(way @ right) / gap / gap**2  # 1/mm^2
        radiance = lit * 0.8 / math.pi
        want[k] = beam_e * radiance * 0.007**2 * math.pi / 36.0 * math.cos(beta - phi) ** 4
    known = want > 0.0
    far_off = np.abs(pixels - plain.argmax()) > 60
    both = known & far_off
    assert both.sum() > 5
    print("bounce", np.round(extra[pixels[both]], 2)[:8], "/", np.round(want[both], 2)[:8])
    assert np.allclose(extra[pixels[both]], want[both], rtol=0.02, atol=0.01)


# -- the two ways to expose a line --


FULL_WELLS = [25_000.0, 400.0]


@pytest.mark.parametrize("full_well", FULL_WELLS)
@pytest.mark.parametrize(
    "active",
    [
        {"shot", "read"},
        {"shot", "read", "dark", "prnu", "dsnu", "lamps"},
        {"prnu", "lamps"},
        {"shot", "prnu", "dust", "speckle", "defocus", "smear", "coma", "dark", "read"},
        {"dsnu"},
    ],
)
def test_windows_and_whole_lines_have_the_same_counts(active: set[str], full_well: float) -> None:
    lamp = {"kind": "halogen", "illuminance_lux": 2000.0, "flicker": 0.0}  # else all are whole
    # No effect of "ghosts" but that whole lines are worked out: there is nothing that reflects.
    scene = _scene(
        _plane(350.0, 8.0),
        stray={"enabled": ["dust"]},
        lamp=[lamp],
        sensor={"full_well_e": full_well, "offset_counts": 60, "gain": 0.2, "prnu": 0.02},
    )
    light = Light(scene, Config())
    angle = np.radians(np.linspace(-11.0, 12.0, 150))
    window = _frame(light, active, angle, rate=300.0).lines
    whole = _frame(light, active | {"ghosts"}, angle, rate=300.0).lines
    assert np.array_equal(window, whole)
    assert (window > 100).any()


def test_several_spots_in_a_line_have_one_window(monkeypatch: pytest.MonkeyPatch) -> None:
    # The second beam's spot is a few pixels beside the first one; at the step's edge are two more.
    step = {"kind": "step", "position_mm": [0, 0, 350], "rotation_deg": [0, 180, 0]}
    light = Light(_scene(step, sensor={"offset_counts": 60, "gain": 0.2}), CONFIG)
    angle = np.radians(np.linspace(-4.0, 4.0, 300))
    active = {"shot", "read", "prnu", "dust", "speckle", "footprint", "window", "blooming"}
    window = _frame(light, active, angle, rate=300.0).lines
    monkeypatch.setattr(render, "whole_lines", lambda _: True)
    whole = _frame(light, active, angle, rate=300.0).lines
    assert np.array_equal(window, whole)
    assert (window > 100).any()


def test_without_wings_the_light_beside_spots_ends_with_their_window() -> None:
    corner = {"kind": "corner", "position_mm": [0, 0, 420], "size_mm": [100, 100]}
    light = Light(
        _scene(
            corner,
            material={"default": {"reflectance": 0.9}},
            stray={"enabled": ["halo", "head_window", "cover", "mirror"]},
            sensor={"full_well_e": 1e9, "offset_counts": 60, "gain": 20.0},
        ),
        CONFIG,
    )
    angle = np.radians(np.linspace(-8.0, 8.0, 200))
    active, beside = {"prnu", "dark", "window", "footprint"}, {"halo", "skirt", "bounce"}
    frames = [
        _frame(light, active | more, angle, rate=300.0)
        for more in (set[str](), beside, beside | {"wings"})
    ]
    without, ends, whole = (frame.lines for frame in frames)
    column = np.arange(whole.shape[1])
    reach = np.abs(column - frames[0].truth.position_px[:, None])
    assert np.array_equal(ends[reach <= 12], whole[reach <= 12])
    assert np.array_equal(ends[reach > 200], without[reach > 200])
    assert ((ends == whole) | (ends == without)).all()
    for some in (reach <= 12, reach > 200):
        assert (whole[some] > without[some]).mean() > 0.3  # the middle of a spot ends the converter


@pytest.mark.parametrize("full_well", [25_000.0, 2000.0, 50.0])
def test_charge_that_spills_is_the_same_in_windows_and_whole_lines(full_well: float) -> None:
    scene = _scene(
        _plane(300.0),
        stray={"enabled": []},
        sensor={
            "full_well_e": full_well,
            "offset_counts": 60,
            "gain": 1.0,
            "blooming": 0.3,
            "spill_px": 6.0,
        },
    )
    light = Light(scene, CONFIG)
    angle = np.radians(np.linspace(-9.0, 9.0, 60))
    active = {"shot", "read", "blooming"}
    window = _frame(light, active, angle).lines.astype(int)
    whole = _frame(light, active | {"ghosts"}, angle).lines.astype(int)
    assert np.abs(window - whole).max() <= 1
    assert (window != whole).mean() < 1e-3


def test_what_spills_in_a_line_does_not_depend_on_its_neighbours() -> None:
    sensor = parse({"target": [_plane(300.0)], "sensor": {"full_well_e": 100}}, "s", Path()).sensor
    light = np.zeros((2, 2048), np.float32)
    light[0, 1000:1004] = 150.0
    light[1, 500:540] = 1e9
    both = bloom(light, sensor)
    for k in range(2):
        assert np.array_equal(bloom(light[k : k + 1], sensor)[0], both[k])
    assert both.max() <= 100.0
    assert both[1, 600] > 99.0  # 8e6 pixels full of charge: it reaches the ends


# -- nothing breaks --


TORTURES: dict[str, tuple[list[dict[str, object]], dict[str, dict[str, object]]]] = {
    "grazing": ([_plane(400.0, 89.9)], {}),
    "along the beam": (
        [{"kind": "plane", "position_mm": [0, 0, 300], "rotation_deg": [0, 90, 0]}],
        {},
    ),
    "behind the camera": ([_plane(-200.0)], {}),
    "behind and before": ([_plane(-200.0), _plane(300.0)], {}),
    "not hit": ([{"kind": "sphere", "position_mm": [0, 300, 400], "radius_mm": 20}], {}),
    "touching the lens": ([{"kind": "sphere", "position_mm": [60, 0, 20], "radius_mm": 20}], {}),
    "around the lens": ([{"kind": "sphere", "position_mm": [0, 0, 0], "radius_mm": 300}], {}),
    "a few mm away": ([_plane(4.0)], {}),
    "no power": ([_plane(400.0)], {"laser": {"power_mw": 0}}),
    "black": ([_plane(400.0)], {"material": {"default": {"reflectance": 0, "gloss": 0}}}),
    "black map": (
        [_plane(400.0, map={"kind": "checker", "square_mm": 2, "low": 0})],
        {},
    ),
    "saturated": (
        [_plane(150.0)],
        {"sensor": {"full_well_e": 0.5, "offset_counts": 4000, "gain": 3.9}},
    ),
    "mirror": (
        [_plane(300.0, -5.0)],
        {"material": {"default": {"reflectance": 0, "gloss": 1, "lobe_deg": 0.001}}},
    ),
    "polished": (
        [{"kind": "cylinder", "position_mm": [0, 0, 350], "radius_mm": 30}],
        {"material": {"default": {"reflectance": 0.1, "gloss": 0.8, "roughness_nm": 30}}},
    ),
    "corner": ([{"kind": "corner", "position_mm": [0, 0, 400]}], {}),
    "blind": ([_plane(400.0)], {"lens": {"transmission": 0}, "sensor": {"quantum_efficiency": 0}}),
    "out of focus": ([_plane(700.0)], {"lens": {"focus_mm": 26, "f_number": 0.5, "coma_px": 20}}),
    "beside the row": ([_plane(400.0)], {"lens": {"row_offset_px": 1e4}}),
    "wide beam": ([_plane(400.0, 60.0)], {"laser": {"beam_diameter_mm": 60, "aperture_mm": 60}}),
    "deaf": ([_plane(400.0)], {"sensor": {"dark_e_per_s": 1e12, "read_noise_e": 0, "dsnu_e": 0}}),
}


def _tortured(name: str) -> Description:
    targets, tables = TORTURES[name]
    values: dict[str, object] = {"target": targets, "lamp": [{"illuminance_lux": 1e4}], **tables}
    values["sun"] = {"sky": "given", "ghi_w_m2": 900, "dhi_w_m2": 100}
    return parse(values, name, Path())


@pytest.mark.parametrize("name", TORTURES)
def test_no_scene_breaks_it(name: str) -> None:
    light = Light(_tortured(name), Config())
    angle = np.concatenate([np.radians(np.linspace(-20.5, 20.5, 13)), [1e-9]])
    everything = frozenset(EFFECTS)
    with warnings.catch_warnings(), np.errstate(all="raise", under="ignore"):
        warnings.simplefilter("error")
        for active in (frozenset[str](), everything, everything - {"footprint", "ghosts", "halo"}):
            frame = _frame(light, active, angle, rate=560.0, every_ray="footprint" in active)
            assert frame.lines.max() <= 4095
            assert len(frame.lines) == len(angle)
            seen = np.isfinite(frame.truth.position_px)
            assert (frame.truth.surface[seen] >= 0).all()
    if name in ("no power", "black", "blind", "behind the camera", "not hit"):
        dark = _frame(
            light, everything - {"sun", "lamps", "veil", "dark", "shot", "read", "dsnu"}, angle
        )
        assert dark.lines.max() == dark.lines.min() == 60


@pytest.mark.parametrize("name", EFFECTS)
def test_each_effect_alone_works(name: str) -> None:
    scene = parse(
        {
            "target": [
                {"kind": "corner", "position_mm": [0, 0, 480], "size_mm": [120, 100]},
                {"kind": "sphere", "position_mm": [50, 0, 350], "radius_mm": 20, "material": "m"},
            ],
            "material": {
                "m": {
                    "reflectance": 0.2,
                    "gloss": 0.5,
                    "subsurface": {"share": 0.5, "length_mm": 0.3},
                },
                "default": {"reflectance": 0.9},
            },
            "lamp": [{}],
            "sun": {"sky": "given", "ghi_w_m2": 900, "dhi_w_m2": 100},
        },
        "scene",
        Path(),
    )
    light = Light(scene, Config())
    angle = np.radians(np.linspace(-14, 14, 40))
    with warnings.catch_warnings(), np.errstate(all="raise", under="ignore"):
        warnings.simplefilter("error")
        rest = {"grain": {"speckle"}, "detail": {"footprint"}, "wings": {"halo"}}.get(name, set())
        plain = _frame(light, rest, angle, rate=500.0, every_ray=True)
        got = _frame(light, rest | {name}, angle, rate=500.0, every_ray=True)
    if name == "index":
        assert np.array_equal(got.lines, plain.lines)
        assert np.allclose(got.reported_rad - plain.reported_rad, 1e-5)
    elif name == "dark":
        assert np.abs(got.lines.astype(int) - plain.lines).max() <= 1  # 0.13 electrons
    else:
        assert not np.array_equal(got.lines, plain.lines)


@pytest.mark.parametrize("end", [0.0, 2047.0])
@pytest.mark.parametrize("every_ray", [False, True])
def test_a_spot_half_off_the_sensor_leaves_half_of_its_light(end: float, every_ray: bool) -> None:
    light = Light(_scene(_plane(500.0)), CONFIG)
    out = -1.0 if end == 0.0 else 1.0
    pixel = [end + 0.5 * out, end + 900.0 * out, end - 60.0 * out, end + 20.0 * out]
    angle = np.array([_angle_at(p, 500.0) for p in pixel])
    active = {"footprint"} if every_ray else set()
    lines = _electrons(light, active, angle, every_ray=every_ray)
    whole = lines[2].sum()
    assert abs(lines[0].sum() / whole - 0.5) < 0.01
    assert lines[1].sum() == 0.0
    assert 0.0 <= lines[3].sum() < 0.01 * whole
    truth = _frame(light, active, angle).truth.position_px
    assert np.isnan(truth[[1, 3]]).all()
    assert abs(truth[2] - pixel[2]) < 1e-6


@pytest.mark.parametrize("length", [64, 500, 1024, 4096])
def test_any_length_of_sensor_works(length: int) -> None:
    config = Config.model_validate(
        {"sensor": {"line_length": length}, "geometry": {"centre_px": length / 2 - 0.5}}
    )
    scene = parse({"target": [_plane(450.0, 30.0)], "lens": {"focus_mm": 100}}, "scene", Path())
    light = Light(scene, config)
    angle = np.radians(np.linspace(-20, 20, 60))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        frame = _frame(light, frozenset(EFFECTS), angle, every_ray=True)
    assert frame.lines.shape == (60, length)
    assert frame.lines.std(axis=1).min() > 0.5  # a blur, and its noise
    # The truth is where the ray meets the leaning plane, on any sensor that is long enough.
    way = 450.0 / (np.cos(angle) + np.tan(np.radians(30.0)) * np.sin(angle))
    pixel = project(way * np.sin(angle), way * np.cos(angle), config.geometry)
    seen = np.abs(pixel - config.geometry.centre_px) <= length / 2
    assert seen.any()
    assert np.array_equal(np.isfinite(frame.truth.position_px), seen)
    assert np.abs(frame.truth.position_px - pixel)[seen].max() < 1e-6


@settings(deadline=None, max_examples=12, derandomize=True)
@given(
    z=st.floats(-100.0, 3000.0),
    turn=st.floats(-90.0, 90.0),
    tip=st.floats(-80.0, 80.0),
    power=st.floats(0.0, 50.0),
    waist=st.floats(-2000.0, 2000.0),
    focus=st.floats(30.0, 5000.0),
    every_ray=st.booleans(),
)
def test_any_plane_in_any_light_gives_lines(
    z: float, turn: float, tip: float, power: float, waist: float, focus: float, every_ray: bool
) -> None:
    scene = parse(
        {
            "target": [{"kind": "plane", "position_mm": [0, 0, z], "rotation_deg": [tip, turn, 0]}],
            "laser": {"power_mw": power, "waist_mm": waist},
            "lens": {"focus_mm": focus},
        },
        "scene",
        Path(),
    )
    light = Light(scene, Config())
    angle = np.radians([-20.0, -3.0, 0.0, 11.0])
    with warnings.catch_warnings(), np.errstate(all="raise", under="ignore"):
        warnings.simplefilter("error")
        frame = _frame(light, NOISE_FREE, angle, rate=400.0, every_ray=every_ray)
    assert frame.lines.min() >= 60
    lit = np.isfinite(frame.truth.z_mm)
    assert np.isfinite(frame.truth.x_mm[lit]).all()
