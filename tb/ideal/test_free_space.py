"""Free space: the visible interval against projection, the response against a direct integral."""

import math

import numpy as np
import pytest
from scanners import EACH_SCANNER, SCANNERS

from vrscan.data.config import Config, Free, Geometry, Sensor
from vrscan.ideal.free_space import reach, response, visible
from vrscan.ideal.geometry import project

DEGREE = np.pi / 180.0
GEOMETRIES = {
    **SCANNERS,
    "bare": Config(free=Free(edge_px=0.0, far_mm=2047.0)),
    "barrel": Config(geometry=Geometry(k1=2e-3, k2=-1e-5)),
    "cushion": Config(geometry=Geometry(k1=-1.5e-3, centre_px=900.0)),
    "printed": Config(geometry=Geometry(k1=1e-3, distortion="even")),
    "short": Config(sensor=Sensor(line_length=512), geometry=Geometry(centre_px=255.5)),
    "turned": Config(geometry=Geometry(bias_deg=60.0, offset_mm=-12.0, base_mm=90.0)),
    "far back": Config(geometry=Geometry(bias_deg=100.0, offset_mm=15.0)),
}


@pytest.mark.parametrize("config", GEOMETRIES.values(), ids=GEOMETRIES)
def test_the_visible_interval_is_where_projection_meets_the_sensor(config: Config) -> None:
    """Brute force: every z of a fine grid at many angles, on the sensor or not."""
    last, edge = config.sensor.line_length - 1, config.free.edge_px
    angle = np.linspace(-22.0, 22.0, 89) * DEGREE
    near, far = visible(angle, config)
    z = np.geomspace(20.0, config.free.far_mm, 4001)[None, :]
    place = project(z * np.tan(angle[:, None]), z, config.geometry)
    with np.errstate(invalid="ignore"):
        seen = (place >= edge) & (place <= last - edge)
    inside = (z >= near[:, None]) & (z <= far[:, None])
    # Only a z within rounding of an end may differ.
    close = np.isclose(z, near[:, None], rtol=1e-6) | np.isclose(z, far[:, None], rtol=1e-6)
    assert np.array_equal(seen | close, inside | close)
    assert seen.any() and not seen.all()


def test_the_shipped_view() -> None:
    """The figures of the design: from 741 mm at -20 degrees, up to 268 mm at +20."""
    near, far = visible(np.array([-20.0, -15.0, 15.0, 20.0]) * DEGREE, GEOMETRIES["bare"])
    assert np.allclose(near[:2], [740.05, 338.8], atol=0.05)
    assert np.allclose(far, [2047.0, 2047.0, 470.35, 268.35], atol=0.05)


def test_a_lens_that_folds_the_image_frees_nothing() -> None:
    config = Config(geometry=Geometry(k1=-0.0095))
    near, far = visible(np.zeros(3), config)
    assert np.all(near > far)


@EACH_SCANNER
def test_the_response_is_the_light_on_a_pixel(config: Config) -> None:
    """Against photons followed through the lens: rays from the surface to points of the pupil."""
    own = config.free.model_copy(update={"spot_mm": 0.01, "efficiency": 1.0})
    config = config.model_copy(update={"free": own})
    geometry, free = config.geometry, config.free
    rng = np.random.default_rng(4)
    for share, degrees in ((0.7, 0.0), (1.7, -10.0), (2.9, 5.0)):  # all of them out of focus
        z, angle = share * free.focus_mm, degrees * DEGREE
        axis = np.array([-math.cos(geometry.bias_rad), 0.0, math.sin(geometry.bias_rad)])
        side = np.array([math.sin(geometry.bias_rad), 0.0, math.cos(geometry.bias_rad)])
        up = np.array([0.0, 1.0, 0.0])
        lens = np.array([geometry.base_mm, 0.0, geometry.offset_mm])
        point = np.array([z * math.tan(angle), 0.0, z])
        count = 200_000
        radius = 0.5 * geometry.focal_mm / free.f_number * np.sqrt(rng.random(count))
        turn = rng.uniform(0.0, 2.0 * np.pi, count)
        offset = np.outer(radius * np.cos(turn), side) + np.outer(radius * np.sin(turn), up)
        ray = lens + offset - point
        square = np.einsum("ij,ij->i", ray, ray)
        # Lambert's law for a surface that faces the lens's middle, and the pupil's tilt.
        normal = (lens - point) / np.linalg.norm(lens - point)
        cosine = (ray @ normal) / np.sqrt(square)
        tilt = -(ray @ axis) / np.sqrt(square)
        area = np.pi * (0.5 * geometry.focal_mm / free.f_number) ** 2
        light = (cosine * tilt / square * area / np.pi).mean()
        # A thin lens sends a ray towards the point's image; the sensor stands where the focus is.
        deep = (point - lens) @ axis
        middle = (point - lens) @ side / deep
        scale = 1.0 - free.focus_mm / deep  # of the pupil, in the focal plane
        place = middle * free.focus_mm + offset @ side * scale
        height = offset @ up * scale
        sensor = 1.0 / (1.0 / geometry.focal_mm - 1.0 / free.focus_mm)
        per_px = free.focus_mm * geometry.pitch_mm / sensor
        half = 3.0  # px: the middle of the disc, to average
        inner = (np.abs(place - middle * free.focus_mm) < half * per_px) & (
            np.abs(height) < half * per_px
        )
        share = inner.mean() / (2.0 * half) ** 2
        photons = 50.0 * 1.0 * 1e-9 / (6.62607e-34 * 2.99792e8 / 658e-9)
        want = photons * light * share
        got = float(response(np.array([z]), np.array([angle]), config)[0])
        print(f"z {z}: {got:.0f} measured / {want:.0f} followed")
        assert got == pytest.approx(want, rel=0.04)


@EACH_SCANNER
def test_the_reach_is_where_the_darkest_surface_is_bright_enough(config: Config) -> None:
    angles = np.linspace(-0.3, 0.3, 7)
    ratio = np.array([100.0, 1e4, 1e5, 1e7])
    near, far = reach(ratio, angles, config)
    assert np.all(far[1:] >= far[:-1]) and np.all(near[1:] <= near[:-1])
    for k, each in enumerate(ratio):
        if near[k] >= far[k]:
            continue
        z = np.linspace(near[k], far[k], 300)[:, None]
        electrons = response(z, angles, config) * config.free.darkest / config.laser.power_max
        snr = electrons * config.peak.kappa * each
        assert snr.min() >= 0.999 * config.peak.snr_sure
        # A hundredth farther out, at some angle it is not.
        for beyond in (0.99 * near[k], 1.01 * far[k]):
            if beyond < config.free.far_mm:
                outside = response(np.array([beyond]), angles, config).min()
                scaled = outside * config.free.darkest * config.peak.kappa * each
                assert scaled / config.laser.power_max < config.peak.snr_sure
    assert np.isinf(near[0]) and far[0] == 0.0 and far[-1] == config.free.far_mm
