"""A cut beam's spots on edges of reflectance, against Fresnel's integral imaged by sums."""

import math
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from carried_beam import CarriedSpot

from vrscan.data.arrays import Floats
from vrscan.data.config import Config
from vrscan.ideal.geometry import ThinLens, project
from vrscan.ideal.scanning import scan_rate
from vrscan.scene import image
from vrscan.scene.beam import output_mw, radius_mm
from vrscan.scene.description import parse
from vrscan.scene.light import Light
from vrscan.scene.radiometry import photoelectrons
from vrscan.scene.render import Renderer
from vrscan.scene.timeline import Timeline
from vrscan.study.plan import FLAT_PX

CONFIG = Config()
ACTIVE = frozenset({"truncation", "footprint", "defocus", "diffraction", "falloff"})
PLACES_MM = np.linspace(-1.2, 1.2, 13)  # of the beam's axis
REACH_PX = 60  # of the sums, about the place of the axis


def plates(z: float, low: float, *, pattern: bool) -> Light:
    """Return a plane that is bright at positive x: two plates, or one with a pattern."""
    plane = {"kind": "plane", "position_mm": [0, 0, z], "material": "bright"}
    stripes = {"kind": "stripes", "period_mm": 600, "low": low}
    sides = [
        {"position_mm": [side * 100, 0, z], "size_mm": [200, 200], "material": name}
        for side, name in ((1, "bright"), (-1, "dim"))
    ]
    values: dict[str, object] = {
        "target": [{**plane, "map": stripes}] if pattern else [{**plane, **side} for side in sides],
        "material": {"bright": {"reflectance": 0.5}, "dim": {"reflectance": 0.5 * low}},
    }
    return Light(parse(values, "plates", Path()), CONFIG)


def at_places(z: float, place_mm: Floats) -> Timeline:
    count = len(place_mm)
    return Timeline(
        line=np.arange(count),
        time_s=np.zeros(count),
        angle_rad=np.arctan(place_mm / z),
        rate_rad_per_s=np.zeros(count),
        y_mm=np.zeros(count),
        reported_rad=np.zeros(count),
        index_s=np.zeros(0),
        index_outward=np.zeros(0, np.bool_),
    )


def lines(light: Light, z: float, tolerance_px: float) -> Floats:
    """Return the light of lines with the axis at ``PLACES_MM``, of 1 that the lens gets in all."""
    timeline = at_places(z, PLACES_MM)
    found = Renderer(light, ACTIVE, tolerance_px=tolerance_px).charge(timeline).laser_e
    geometry = CONFIG.geometry
    far, depth = math.hypot(geometry.base_mm, z), depth_mm(z)
    pupil = 0.25 * math.pi * (geometry.focal_mm / light.scene.lens.f_number) ** 2
    whole = 0.5 / math.pi * (z / far) * (depth / far) * pupil / far**2
    scene = light.scene
    efficiency = scene.sensor.quantum_efficiency * scene.lens.transmission
    efficiency *= scene.lens.filter_transmission
    efficiency *= (1.0 - light.scatter.total) * (1.0 - light.emitter.total)
    sent_w, pulse_s = 1e-3 * output_mw(scene.laser), 1e-6 * CONFIG.line.pulse_us
    sent = float(photoelectrons(sent_w, pulse_s, efficiency, scene.laser.wavelength_nm))
    return np.asarray(found, np.float64) / (sent * whole)


def depth_mm(z: float) -> float:
    geometry = CONFIG.geometry
    return geometry.base_mm * math.cos(geometry.bias_rad) + z * math.sin(geometry.bias_rad)


@cache
def carried(z: float, low: float) -> Floats:
    """Return what ``lines`` returns, by sums."""
    spot = carried_spot(z)
    found = np.zeros((len(PLACES_MM), CONFIG.sensor.line_length))
    for row, x, middle in zip(found, PLACES_MM, middles(z), strict=True):
        pixels = np.arange(middle - REACH_PX, middle + REACH_PX + 1)
        row[pixels] = spot.row(float(x), low, pixels.astype(np.float64))
    return found


@cache
def carried_spot(z: float) -> CarriedSpot:
    scene = plates(z, 1.0, pattern=True).scene
    lens, geometry = scene.lens, CONFIG.geometry
    depth = np.array([depth_mm(z)])
    disc = float(image.defocus_radius_px(depth, lens.focus_mm, lens.f_number, CONFIG)[0])
    working = ThinLens.of(lens.f_number, lens.focus_mm, geometry).working
    cutoff = geometry.pitch_mm / (1e-6 * scene.laser.wavelength_nm * working)
    return CarriedSpot(scene.laser, z, CONFIG, disc, cutoff)


def middles(z: float) -> np.ndarray:
    place = project(PLACES_MM, np.full(len(PLACES_MM), z), CONFIG.geometry)
    return np.rint(place).astype(int)


def position(row: Floats) -> float:
    """Return the centroid of what is above a tenth of the peak, less that."""
    above = np.maximum(row - 0.1 * row.max(), 0.0)
    peak = int(row.argmax())
    dark = np.flatnonzero(above == 0.0)
    first, last = dark[dark < peak][-1], dark[dark > peak][0]
    x = np.arange(first, last)
    return float((above[x] * x).sum() / above[x].sum())


@pytest.mark.parametrize("tolerance_px", [0.0, FLAT_PX, 0.01])
@pytest.mark.parametrize(
    ("z", "low", "pattern", "most_px"),
    [
        (250.0, 0.1, False, 0.03),
        (400.0, 0.1, False, 0.01),
        (400.0, 0.1, True, 0.01),
        (400.0, 0.01, False, 0.02),
        (400.0, 1.0, True, 0.002),
        (600.0, 0.1, False, 0.03),
        (800.0, 0.1, False, 0.015),
        (1000.0, 0.1, False, 0.03),
    ],
)
def test_a_cut_beam_at_an_edge_of_reflectance_is_where_the_wave_is(
    z: float, low: float, pattern: bool, most_px: float, tolerance_px: float
) -> None:
    want = carried(z, low)
    got = lines(plates(z, low, pattern=pattern), z, tolerance_px)
    error = np.array([position(a) - position(b) for a, b in zip(got, want, strict=True)])
    rms = float(np.sqrt(np.square(error).mean()))
    print(f"z {z:g}, 1:{1 / low:g}: {np.abs(error).max():.4f} px at most, {rms:.4f} px rms")
    assert np.abs(error).max() < most_px
    near = [slice(m - REACH_PX, m + REACH_PX + 1) for m in middles(z)]
    light = np.array([a[s].sum() / b[s].sum() for a, b, s in zip(got, want, near, strict=True)])
    print(f"light {light.min():.4f} to {light.max():.4f}, at x = 0 {light[6]:.4f}")
    # The sums have the image's scale of x = 0, which changes by 0.3 % over these places.
    assert np.abs(light - 1.0).max() < 2e-2
    if low == 1.0:
        assert abs(light[6] - 1.0) < 1e-3
    peaks = got.max(axis=1) / want.max(axis=1)
    print(f"peaks {peaks.min():.4f} to {peaks.max():.4f}")
    assert np.abs(peaks - 1.0).max() < 0.015


@pytest.mark.parametrize("tolerance_px", [0.0, 0.01])
@pytest.mark.parametrize(("z", "pulse_us"), [(400.0, 1.0), (1000.0, 1.0), (400.0, 4.0)])
def test_a_beam_that_moves_over_an_edge_moves_and_the_edge_does_not(
    z: float, pulse_us: float, tolerance_px: float
) -> None:
    """Against the wave's rows at moments of the pulse, in which the beam turns by 0.56 mrad/us."""
    line = CONFIG.line.model_copy(update={"pulse_us": pulse_us})
    config = CONFIG.model_copy(update={"line": line})
    light = Light(plates(z, 0.1, pattern=False).scene, config)
    place_mm, turned = np.linspace(-1.2, 1.2, 13), scan_rate(config.mirror) * 1e-6 * pulse_us
    timeline = at_places(z, place_mm)
    timeline = replace(timeline, rate_rad_per_s=np.full(len(timeline), 1e6 * turned / pulse_us))
    renderer = Renderer(light, ACTIVE | {"smear"}, tolerance_px=tolerance_px)
    got = renderer.charge(timeline).laser_e.astype(np.float64)
    node, weight = np.polynomial.legendre.leggauss(9 if pulse_us == 1.0 else 25)
    moments = z * np.tan(timeline.angle_rad[:, None] + 0.5 * turned * node)
    spot = carried_spot(z)
    error = []
    for row, middle, moment in zip(got, middles(z), moments, strict=True):
        pixels = np.arange(middle - REACH_PX, middle + REACH_PX + 1).astype(np.float64)
        parts = [w * spot.row(float(x), 0.1, pixels) for w, x in zip(weight, moment, strict=True)]
        want = np.zeros(len(row))
        want[middle - REACH_PX : middle + REACH_PX + 1] = sum(parts)
        error.append(position(row) - position(want))
    print(
        f"z {z:g}, {pulse_us:g} us: {np.abs(error).max():.4f} px at most, {np.std(error):.4f} rms"
    )
    assert np.abs(error).max() < 0.03


@pytest.mark.parametrize(
    "target",
    [
        {"kind": "cylinder", "position_mm": [0, 0, 395], "radius_mm": 0.05},
        {"kind": "plane", "position_mm": [0, 0, 399], "size_mm": [0.1, 20]},
        {"kind": "plane", "position_mm": [-50, 0, 399.5], "size_mm": [100, 80]},
        {"kind": "corner", "position_mm": [0, 0, 400], "size_mm": [100, 100]},
        {
            "kind": "plane",
            "position_mm": [0, 0, 400],
            "map": {"kind": "stripes", "period_mm": 600, "low": 0.1},
        },
    ],
    ids=("wire", "slip", "ledge", "corner", "stripe"),
)
def test_in_full_every_spot_that_a_ray_finds_elsewhere_is_followed(target: dict[str, Any]) -> None:
    """Thinner than the rays that tell with a wide tolerance are apart; a fold under the rings."""
    alone = target["kind"] == "corner" or "map" in target
    wall = [] if alone else [{"kind": "plane", "position_mm": [0, 0, 400]}]
    light = Light(parse({"target": [target, *wall]}, "thin", Path()), CONFIG)
    place_mm = np.linspace(-3.0, 3.0, 241)
    made = {
        tolerance_px: Renderer(light, ACTIVE, tolerance_px=tolerance_px)
        .charge(at_places(400.0, place_mm))
        .laser_e.astype(np.float64)
        for tolerance_px in (0.0, FLAT_PX, 0.01)
    }
    # What is followed ray by ray is the same to the last bit.
    full, auto = (
        np.abs(made[k] - made[0.0]).max(axis=1) / made[0.0].max() for k in (FLAT_PX, 0.01)
    )
    near = np.abs(place_mm) < 4.3 * float(radius_mm(np.array([400.0]), light.scene.laser)[0])
    print(f"worst pixel {full.max():.4f} of the peak in full, {auto.max():.4f} with 0.01 px")
    print(f"of {near.sum()} lines {np.sum(full[near] == 0.0)} and {np.sum(auto[near] == 0.0)}")
    assert (full[near] == 0.0).all() and full.max() < 2e-3
    assert np.mean(full[~near] > 0.0) > 0.5
    thin = target.get("radius_mm", target.get("size_mm", [9.0])[0]) < 1.0
    assert auto.max() > 0.05 if thin else auto.max() < 3e-3


@pytest.mark.parametrize("z", [400.0, 430.0, 460.0])
def test_in_full_the_rings_beside_a_spot_are_the_waves(z: float) -> None:
    got, want = lines(plates(z, 1.0, pattern=True), z, FLAT_PX), carried(z, 1.0)
    worst = []
    for ours, true, middle in zip(got, want, middles(z), strict=True):
        beside = np.abs(np.arange(len(ours)) - middle)
        beside = (beside > 12) & (beside < 30)
        worst.append(np.abs(ours - true)[beside].max() / true.max())
    print(f"worst pixel {1e4 * max(worst):.2f}e-4 of the peak")
    assert max(worst) < 4e-4  # windows as narrow as of a Gaussian beam fold twice as much back
