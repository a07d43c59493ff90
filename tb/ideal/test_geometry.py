"""The float triangle: printed against stable form, slopes against differences, and back again."""

import numpy as np
import pytest
from scanners import SCANNERS

from vrscan.data.config import Geometry
from vrscan.ideal import geometry as g

ODD = Geometry(k1=2e-4, k2=-1e-6, offset_mm=2.0)
EVEN = Geometry(k1=2e-4, k2=-1e-6, offset_mm=2.0, distortion="even")
GEOMETRIES = {name: config.geometry for name, config in SCANNERS.items()}
GEOMETRIES |= {"odd": ODD, "even": EVEN}
EACH_GEOMETRY = pytest.mark.parametrize("geometry", GEOMETRIES.values(), ids=GEOMETRIES)


def grid(geometry: Geometry) -> tuple[np.ndarray, np.ndarray]:
    """Return positions over the sensor, whose middle is the axis, and angles."""
    place = np.linspace(0, 2 * geometry.centre_px, 301)
    position, angle = np.meshgrid(place, np.radians(np.linspace(-20, 20, 81)))
    return position, angle


@EACH_GEOMETRY
def test_the_stable_form_is_the_printed_one(geometry: Geometry) -> None:
    position, angle = grid(geometry)
    u, _ = g.undistorted(position, geometry)
    beta = geometry.bias_rad + np.arctan(u / geometry.focal_mm)
    tame = (np.abs(beta - np.pi / 2) > 0.01) & (beta - angle < np.pi - 0.1)
    found = g.triangle(u, angle, geometry)
    tame &= ~found.no_range & (found.z < 2000.0)
    x, z = g.triangle_printed(u[tame], angle[tame], geometry)
    assert tame.sum() > 5000
    assert np.abs(found.z[tame] - z).max() < 1e-8
    assert np.abs(found.x[tame] - x).max() < 1e-8


def test_nothing_happens_at_90_degrees() -> None:
    geometry = Geometry()
    position, angle = grid(geometry)
    u = np.full_like(position, geometry.focal_mm * np.tan(np.pi / 2 - geometry.bias_rad))
    found = g.triangle(u, np.full_like(angle, 0.1), geometry)
    assert np.allclose(found.x, geometry.base_mm)  # beta = 90 degrees looks along x = B


def test_parallel_and_parting_rays_have_no_range() -> None:
    geometry = Geometry()
    found = g.triangle(np.array([7.0, 7.0]), np.array([0.3, -0.3]), geometry)
    assert found.no_range.tolist() == [False, True]
    assert (found.x[1], found.z[1], found.slope[1]) == (0.0, 0.0, 0.0)


@EACH_GEOMETRY
def test_slopes_are_derivatives(geometry: Geometry) -> None:
    position, angle = grid(geometry)
    step = 1e-4
    u, du = g.undistorted(position, geometry)
    ahead, behind = (g.undistorted(position + s, geometry)[0] for s in (step, -step))
    assert np.allclose((ahead - behind) / (2 * step), du, rtol=1e-6)
    found = g.triangle(u, angle, geometry)
    sides = [g.triangle(v, angle, geometry) for v in (ahead, behind)]
    near = ~found.no_range & (found.z < 1000.0)
    numeric = (sides[0].z - sides[1].z)[near] / (2 * step)
    assert np.allclose(numeric, (found.slope * du)[near], rtol=1e-5)


def test_radial_and_lateral_error_are_those_of_6() -> None:
    """Only for alpha = CZ = 0 and beta = 90 degrees, where the paper's approximation is exact."""
    geometry = Geometry(bias_deg=89.0)
    distance, precision = np.array([500.0]), 0.0015
    u = g.project(np.zeros(1), distance, geometry)
    corrected, _ = g.undistorted(u, geometry)
    slope = g.triangle(corrected, np.zeros(1), geometry).slope[0]
    radial = g.radial_error(distance, precision, geometry)[0]
    assert radial == pytest.approx(abs(slope) * precision, rel=0.03)
    lateral = g.lateral_error(distance, precision, geometry)[0]
    assert lateral == pytest.approx(radial * geometry.base_mm / 500.0)
    assert g.angle_precision(distance, precision, geometry)[0] == pytest.approx(0.06e-3, rel=0.01)


@EACH_GEOMETRY
def test_projecting_a_point_finds_its_pixel(geometry: Geometry) -> None:
    position, angle = grid(geometry)
    u, _ = g.undistorted(position, geometry)
    found = g.triangle(u, angle, geometry)
    near = ~found.no_range & (found.z < 3000.0)
    back = g.project(found.x[near], found.z[near], geometry)
    assert np.abs(back - position[near]).max() < 1e-7


def test_behind_the_camera_is_nowhere() -> None:
    assert np.isnan(g.project(np.array([0.0]), np.array([-500.0]), Geometry()))[0]


def test_the_printed_distortion_is_even_and_a_radial_one_is_odd() -> None:
    offset = np.array([500.0])
    for geometry, sign in ((ODD, -1.0), (EVEN, 1.0)):
        moved = []
        for side in (-offset, offset):
            u, _ = g.undistorted(geometry.centre_px + side, geometry)
            moved.append((u - side * geometry.pitch_mm)[0])
        assert moved[0] == pytest.approx(sign * moved[1])
