"""How the beam passes over the scene, against the simulated motion and lines of sight."""

import math

import numpy as np
import pytest
from scanners import EACH_SCANNER

from vrscan.data.config import Config
from vrscan.ideal.geometry import undistorted
from vrscan.ideal.scanning import dwell_s, scan_efficiency, scan_rate, spacing_mm
from vrscan.scene.timeline import Scan, timeline


@EACH_SCANNER
def test_rate_and_spacing_are_those_of_simulated_lines(config: Config) -> None:
    count = 20_000
    lines = timeline(0, count, count, config, Scan(), 0)
    middle = np.abs(lines.angle_rad) < 0.02
    rate = scan_rate(config.mirror)
    print(f"\n{rate:.3f} rad/s, lines {np.abs(lines.rate_rad_per_s[middle]).mean():.3f}")
    assert np.abs(lines.rate_rad_per_s[middle]) == pytest.approx(rate, rel=2e-3)
    # Neighbours of a sweep that stand either side of the resting beam, at 500 mm.
    x = 500.0 * np.tan(lines.angle_rad)
    beside = (x[:-1] * x[1:] < 0.0) & (np.abs(x[1:] - x[:-1]) < 50.0)
    apart = np.abs(np.diff(x))[beside]
    spacing = float(spacing_mm(np.array(500.0), rate, config.line.rate_hz))
    print(f"spacing {spacing:.4f} mm, lines {apart.mean():.4f}")
    assert beside.sum() > 20
    assert apart == pytest.approx(spacing, rel=4e-3)


def test_figures_of_the_paper() -> None:
    """A line of 37.4 kHz while the beam turns at 562 rad/s, and its 1.7 mrad in 3.02 us."""
    rate = scan_rate(Config().mirror)
    assert rate == pytest.approx(2.0 * math.pi * 249.0 * math.radians(20.5), rel=0.01)
    assert 1e6 * float(dwell_s(np.array(1.7e-3), rate)) == pytest.approx(3.02, rel=0.01)
    assert float(spacing_mm(np.array(1000.0), rate, 37_400.0)) == pytest.approx(15.0, rel=0.01)


@EACH_SCANNER
def test_efficiency_is_the_share_of_time_between_the_sensors_ends(config: Config) -> None:
    """The ends' lines of sight meet the distance at two angles; (12) inverted says when."""
    z = np.geomspace(config.focus.near_mm, config.focus.far_mm, 5)
    geometry, mirror, margin = config.geometry, config.mirror, config.free.edge_px
    ends = np.array([margin, config.sensor.line_length - 1 - margin])
    u, _ = undistorted(ends, geometry)
    sight = geometry.bias_rad + np.arctan(u / geometry.focal_mm)
    x = geometry.base_mm - (z[:, None] - geometry.offset_mm) / np.tan(sight)
    angle = np.sort(np.arctan2(x, z[:, None]), axis=1)
    if mirror.polygon:
        half = math.radians(360.0 / mirror.facets)
        want = np.diff(np.clip(angle, -half, half), axis=1)[:, 0] / (2.0 * half)
    else:  # the first harmonic; the others are below 0.1 % of it
        share = np.clip(angle / math.radians(mirror.amplitude_deg), -1.0, 1.0)
        want = np.diff(np.arcsin(share), axis=1)[:, 0] / math.pi
    found = scan_efficiency(z, config)
    print(f"\nefficiency {np.round(found, 4)}, wanted {np.round(want, 4)}")
    assert found == pytest.approx(want, abs=2e-3)
    assert (found > 0.05).all() and (found < 1.0).any()
