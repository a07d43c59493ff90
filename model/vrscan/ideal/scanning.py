"""How the beam passes over the scene: its rate, dwell, spacing of points and scan efficiency.

Equations are those of iria, "Optical-Mechanical, Active/Passive Imaging Systems" (1982). A sweep
is one way of a resonant mirror, or a facet of a polygon.
"""

import math

import numpy as np

from vrscan.data.arrays import Floats
from vrscan.data.config import Config, Mirror
from vrscan.ideal.geometry import project
from vrscan.ideal.motion import motion

_PHASES = 4096  # of a period, at which the scan efficiency is summed


def scan_angles(mirror: Mirror, phase: Floats) -> Floats:
    """Return the scan angle at phases of a period, rad: (12), or a polygon's straight line.

    Args:
        mirror: The mirror.
        phase: Phases from 0 to 1, turns; a polygon's period is a facet.
    """
    if mirror.polygon:
        return np.asarray((0.5 - phase) * (4.0 * math.pi / mirror.facets))
    return motion(phase, math.radians(mirror.amplitude_deg), mirror.harmonics)


def scan_rate(mirror: Mirror) -> float:
    """Return the rate at which the beam passes its resting direction, rad/s.

    It is the largest rate of a resonant mirror, and the only one of a polygon.
    """
    apart = 2e-4  # turns, about a quarter of one: the resting direction, or any of a polygon's
    step = np.diff(scan_angles(mirror, 0.25 + np.array([-0.5, 0.5]) * apart))
    return float(abs(step[0])) / apart * mirror.frequency_hz


def dwell_s(angle_rad: Floats, rate_rad_per_s: float) -> Floats:
    """Return the time in which the beam turns by an angle, (1-40): that in which it passes a pixel.

    Args:
        angle_rad: Angle that a pixel covers, seen from the mirror.
        rate_rad_per_s: Rate of the scan.
    """
    return np.asarray(angle_rad / rate_rad_per_s)


def spacing_mm(z_mm: Floats, rate_rad_per_s: float, lines_hz: float) -> Floats:
    """Return the distance of neighbouring points of a sweep on an upright surface.

    Args:
        z_mm: Distance of the surface.
        rate_rad_per_s: Rate of the scan.
        lines_hz: Lines in a second, of one point each.
    """
    return np.asarray(z_mm * math.tan(rate_rad_per_s / lines_hz))


def scan_efficiency(z_mm: Floats, config: Config) -> Floats:
    """Return eta_s of (1-39): the share of time in which the camera sees the beam at a distance.

    Args:
        z_mm: Distances of upright surfaces [n].
        config: Mirror, geometry, sensor and ``free.edge_px``.
    """
    angles = scan_angles(config.mirror, (np.arange(_PHASES) + 0.5) / _PHASES)
    z = z_mm[:, None]
    place = project(np.tan(angles) * z, np.broadcast_to(z, (len(z), _PHASES)), config.geometry)
    edge = config.free.edge_px
    with np.errstate(invalid="ignore"):
        seen = (place >= edge) & (place <= config.sensor.line_length - 1 - edge)
    return np.asarray(seen.mean(axis=1))
