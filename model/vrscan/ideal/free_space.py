"""Where a beam without a peak is free: what the camera sees, and where a surface would be seen.

VR-SCAN (10) gives a confidence that a beam meets nothing, but not on which part of the beam: the
camera sees only a part, and a dark surface far away or out of focus gives no peak.
"""

import math
from functools import lru_cache

import numpy as np

from vrscan.data.arrays import Bools, Floats, Ints
from vrscan.data.config import Config
from vrscan.ideal.geometry import ThinLens, undistorted

_PHOTONS_PER_NJ = 3.3124e9  # at 658 nm
_LEAST_MM = 1.0  # z from which the response is defined
_MARGIN = 1.05  # of the mirror's amplitude: angles at which the darkest surface has to be seen
_ANGLES = 33
_RATIOS = np.geomspace(1e-2, 1e6, 1025)  # power / noise at which the reach is computed


def free_interval(
    angle_rad: Floats, power: Ints, noise: Floats, config: Config
) -> tuple[Floats, Floats]:
    """Return the interval of z in which a beam without a peak meets nothing; 0 and 0 for none.

    Args:
        angle_rad: Scan angles [n].
        power: Power of the laser [n].
        noise: Noise of the background, counts, above 0 where there is an interval [n].
        config: The configuration.
    """
    near, far = visible(angle_rad, config)
    with np.errstate(divide="ignore", invalid="ignore"):
        level = np.searchsorted(_RATIOS, np.nan_to_num(power / noise), "right") - 1
    bright_near, bright_far = _reaches(*config_sections(config))
    near = np.maximum(near, np.where(level >= 0, bright_near[level], np.inf))
    far = np.minimum(far, np.where(level >= 0, bright_far[level], 0.0))
    return np.where(near < far, near, 0.0), np.where(near < far, far, 0.0)


def config_sections(config: Config) -> tuple[object, ...]:
    """Return all of a configuration that free space depends on, to be kept by."""
    kept = config.geometry, config.free, config.peak, config.line, config.sensor, config.laser
    return (*kept, config.mirror.amplitude_deg)


def sectioned(sections: tuple[object, ...]) -> tuple[Config, Floats]:
    """Return a configuration of ``config_sections``, and the angles that the reach is for, rad."""
    names = "geometry", "free", "peak", "line", "sensor", "laser"
    *kept, amplitude_deg = sections
    assert isinstance(amplitude_deg, float)
    half = min(_MARGIN * math.radians(amplitude_deg), 0.499 * math.pi)
    config = Config().model_copy(update=dict(zip(names, kept, strict=True)))
    return config, np.linspace(-half, half, _ANGLES)


@lru_cache(maxsize=16)
def _reaches(*sections: object) -> tuple[Floats, Floats]:
    """Return ``reach`` at all ``_RATIOS``."""
    config, angles = sectioned(sections)
    return reach(_RATIOS, angles, config)


def visible(angle_rad: Floats, config: Config) -> tuple[Floats, Floats]:
    """Return the interval of z that the camera sees on the beam at each scan angle.

    With beta = Phi + atan(u / f) the line of sight of an end of the sensor, (3) is
    z = (B sin beta + CZ cos beta) cos a / cos(beta - a), which has no end beyond 90 degrees.

    Args:
        angle_rad: Scan angles, of any one shape, within +-90 degrees.
        config: Its geometry, sensor and ``free``.

    Returns:
        Least and largest z, mm, the largest at most ``free.far_mm``; where the camera sees nothing,
        and everywhere if the distortion maps two pixels to one place, infinite and 0.
    """
    geometry, last = config.geometry, config.sensor.line_length - 1
    angle = np.asarray(angle_rad, np.float64)
    ends = np.array([config.free.edge_px, last - config.free.edge_px])
    image, slope = undistorted(np.linspace(ends[0], ends[1], last + 1), geometry)
    if ends[0] >= ends[1] or np.any(np.diff(image) <= 0.0) or np.any(slope <= 0.0):
        return np.full(angle.shape, np.inf), np.zeros(angle.shape)
    beta = geometry.bias_rad + np.arctan(image[[0, -1]] / geometry.focal_mm)
    n = geometry.base_mm * np.sin(beta) + geometry.offset_mm * np.cos(beta)
    # The line of sight turns from the mirror, where it is at this angle, on with z.
    d = np.cos(beta[:, *(None,) * angle.ndim] - angle)
    meets = d > 0.0
    with np.errstate(over="ignore"):
        z = n[:, *(None,) * angle.ndim] * np.cos(angle) / np.where(meets, d, np.inf)
    near = np.where(meets[0], np.maximum(z[0], 0.0), np.inf)
    far = np.where(meets[1], np.minimum(z[1], config.free.far_mm), config.free.far_mm)
    none = near >= far
    return np.where(none, np.inf, near), np.where(none, 0.0, far)


def response(z_mm: Floats, angle_rad: Floats, config: Config) -> Floats:
    """Return the peak of a white upright surface at full power, electrons in a pixel.

    The light of a pulse is scattered by Lambert's law; the pupil collects it, and the pixel at the
    middle takes its share of a disc: the spot's image and the blur out of focus, by their areas.

    Args:
        z_mm: Distance of the surface on the beam, positive.
        angle_rad: Scan angle, broadcast against ``z_mm``.
        config: Its geometry, laser, line and ``free``.
    """
    geometry, free = config.geometry, config.free
    x, z = z_mm * np.tan(angle_rad) - geometry.base_mm, z_mm - geometry.offset_mm
    depth = z * np.sin(geometry.bias_rad) - x * np.cos(geometry.bias_rad)
    square = np.square(x) + np.square(z)
    front = np.maximum(depth, _LEAST_MM)
    lens = ThinLens.of(free.f_number, free.focus_mm, geometry)
    pupil_mm2 = 0.25 * np.pi * lens.pupil_mm**2
    area_px2 = np.pi * np.square(spot_px(front, config))
    sent = config.laser.rated_mw * config.line.pulse_us * _PHOTONS_PER_NJ * free.efficiency
    collected = pupil_mm2 / np.pi * front / square**1.5
    return np.asarray(np.where(depth > 0.0, sent * collected / area_px2, 0.0))


def spot_px(depth_mm: Floats, config: Config) -> Floats:
    """Return the radius of a spot's image at a depth along the lens's axis, with its blur, px."""
    geometry, free = config.geometry, config.free
    lens = ThinLens.of(free.f_number, free.focus_mm, geometry)
    per_mm = geometry.focal_mm / geometry.pitch_mm  # px per unit of tangent
    spot = per_mm * free.spot_mm / depth_mm
    blurred = 0.5 * lens.pupil_mm * lens.image_mm / geometry.pitch_mm
    blur = blurred * np.abs(1.0 / free.focus_mm - 1.0 / depth_mm)
    return np.asarray(np.sqrt(np.square(spot) + np.square(blur)))


def reach(ratio: Floats, angle_rad: Floats, config: Config) -> tuple[Floats, Floats]:
    """Return the interval of z in which the darkest surface gives a peak at any of these angles.

    Args:
        ratio: Power of the laser over noise in counts [n].
        angle_rad: Scan angles [m].
        config: The configuration.

    Returns:
        Least and largest z [n], mm; infinite and 0 where there is no such z. The ends are taken
        from steps of 0.2 %, inwards.
    """
    z = np.geomspace(_LEAST_MM, config.free.far_mm, 3801)
    peak = response(z, np.asarray(angle_rad)[:, None], config)
    counts = peak * config.free.darkest * config.peak.kappa / config.laser.power_max
    with np.errstate(divide="ignore"):
        wanted = config.peak.snr_sure / np.asarray(ratio, np.float64)
    near, far = np.full(len(wanted), np.inf), np.zeros(len(wanted))
    for k, least in enumerate(wanted.tolist()):
        seen = counts >= least
        if not seen.any(axis=1).all():
            continue
        near[k], far[k] = z[_begin(counts, seen)].max(), z[_end(counts, seen)].min()
    none = near >= far
    return np.where(none, np.inf, near), np.where(none, 0.0, far)


def _begin(counts: Floats, seen: Bools) -> Ints:
    """Return the first index of the run of ``seen`` that holds the largest count [m]."""
    top = counts.argmax(axis=1)
    dark = ~seen & (np.arange(counts.shape[1]) < top[:, None])
    behind = counts.shape[1] - dark[:, ::-1].argmax(axis=1)
    return np.asarray(np.where(dark.any(axis=1), behind, 0))


def _end(counts: Floats, seen: Bools) -> Ints:
    """Return the last index of that run [m]."""
    top = counts.argmax(axis=1)
    dark = ~seen & (np.arange(counts.shape[1]) > top[:, None])
    last = counts.shape[1] - 1
    return np.asarray(np.where(dark.any(axis=1), dark.argmax(axis=1) - 1, last))
