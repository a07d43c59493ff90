"""The simple light: one Gaussian spot a line, its width from defocus, its height from Lambert.

It leaves out speckle, motion during the pulse, the spot's extent on the object, stray and sun
light, and the mirror: the angle of each line is given. A fuller simulator replaces ``simulate``
and ends in the same ``Lines``.
"""

from dataclasses import dataclass

import numpy as np

from vrscan.config import Config
from vrscan.errors import InputError
from vrscan.ideal.geometry import project
from vrscan.lines import Lines, Truth
from vrscan.scene.sensor import expose, spot_electrons
from vrscan.scene.surfaces import Cylinder, Segment, Surface, first_hit

READ_NOISE_COUNTS = 3.0
BACKGROUND_COUNTS = 60.0
BEST_SIGMA_PX = 2.0
DEFOCUS_PX_MM = 1.2e4  # spot sigma per difference of inverse distances
_SEED = 20100301


@dataclass(frozen=True)
class Scene:
    """Surfaces and how they are looked at."""

    surfaces: tuple[Surface, ...]
    half_angle_deg: float  # the scan goes from minus to plus this
    focus_mm: float  # distance of the sharpest spot
    height_counts: float  # peak of a white surface, square to the beam, in focus


_PLANE = Segment("plane", 0.3, (-400.0, 500.0), (400.0, 620.0))
_STEP = (
    Segment("step", 0.5, (-80.0, 500.0), (-20.0, 500.0)),
    Segment("step", 0.5, (-20.0, 500.0), (-20.0, 557.0)),
    Segment("step", 0.5, (-80.0, 500.0), (-80.0, 548.0)),
)
_CYLINDER = Cylinder("cylinder", 0.7, (62.0, 500.0), 38.0)


def _scene(*surfaces: Surface) -> Scene:
    return Scene(surfaces, half_angle_deg=12.5, focus_mm=560.0, height_counts=8000.0)


SCENES = {
    "default": _scene(_PLANE, *_STEP, _CYLINDER),
    "plane": _scene(_PLANE),
    "step": _scene(_PLANE, *_STEP),
    "cylinder": _scene(_PLANE, _CYLINDER),
}


def named(name: str) -> Scene:
    """Return a scene by its name.

    Raises:
        InputError: if there is none of that name.
    """
    if name not in SCENES:
        raise InputError(f"{name}: no such scene (there are {', '.join(SCENES)})")
    return SCENES[name]


def simulate(scene: Scene, count: int, config: Config, *, seed: int = _SEED) -> Lines:
    """Return the lines of one sweep over a scene, at known angles, with truth.

    Args:
        scene: What is looked at.
        count: Lines, evenly spaced in angle.
        config: Geometry, sensor and conversion factor.
        seed: Of all noise.

    Returns:
        ``count`` lines. A spot that the camera cannot see, because something is in its way or it
        falls beside the sensor, leaves its line dark.
    """
    rng = np.random.default_rng(seed)
    geometry, length = config.geometry, config.sensor.line_length
    half = np.radians(scene.half_angle_deg)
    angle = np.linspace(-half, half, count)
    beam = np.stack([np.sin(angle), np.cos(angle)], axis=1)
    distance, cosine, surface = first_hit(scene.surfaces, np.zeros((count, 2)), beam)
    lit = surface >= 0
    point = np.where(lit, distance, 0.0)[:, None] * beam

    # The camera sees the spot if nothing is nearer on the ray from the spot to the lens.
    camera = np.array([geometry.base_mm, geometry.offset_mm])
    view = camera - point
    away = np.hypot(view[:, 0], view[:, 1])
    obstacle, _, _ = first_hit(scene.surfaces, point, view / away[:, None])
    position = project(point[:, 0], point[:, 1], geometry)
    with np.errstate(invalid="ignore"):
        on_sensor = (position > -0.5) & (position < length - 0.5)
    seen = lit & (obstacle > away) & on_sensor
    position = np.where(seen, position, np.nan)

    safe = np.where(lit, distance, scene.focus_mm)
    defocus = DEFOCUS_PX_MM * (1.0 / safe - 1.0 / scene.focus_mm)
    sigma = np.hypot(BEST_SIGMA_PX, defocus)
    reflectance = np.array([s.reflectance for s in scene.surfaces])[surface]
    height = scene.height_counts * reflectance * cosine * np.square(scene.focus_mm / safe)
    height *= BEST_SIGMA_PX / sigma
    electrons = spot_electrons(position, sigma, height / config.peak.kappa, length)
    lines = expose(
        electrons,
        rng,
        background_counts=BACKGROUND_COUNTS,
        read_noise_counts=READ_NOISE_COUNTS,
        kappa=config.peak.kappa,
        pixel_width=config.sensor.pixel_width,
    )
    names = tuple(dict.fromkeys(s.name for s in scene.surfaces))
    group = np.array([names.index(s.name) for s in scene.surfaces])
    truth = Truth(
        x_mm=np.where(lit, point[:, 0], np.nan),
        z_mm=np.where(lit, point[:, 1], np.nan),
        position_px=position,
        surface=np.where(lit, group[surface], -1),
        names=names,
    )
    power = np.full(count, config.laser.power_max, np.int64)
    return Lines(lines=lines, angle_rad=angle, power=power, truth=truth)
