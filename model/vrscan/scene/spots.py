"""Where rays of the beam meet the scene, where the camera sees that, and how much light it gets."""

from dataclasses import dataclass, fields
from functools import partial

import numpy as np

from vrscan.data.arrays import Bools, Floats, Ints
from vrscan.data.config import Config
from vrscan.ideal.geometry import project, undistorted
from vrscan.scene.description import Description
from vrscan.scene.shapes import dot
from vrscan.scene.surface import Material, beneath, brdf
from vrscan.scene.targets import World

STEEPEST_PX_PER_MM = 2000.0  # limit of the image's motion with a ray's offset
_RAYS = 1 << 13  # followed at a time: their data stay in the processor's cache
OFF_SENSOR_PX = 400.0  # farthest spot beside the sensor whose flank is still drawn
_NEAREST_MM = 1.0  # least distance in front of the lens


@dataclass(frozen=True)
class Camera:
    """The lens in the scanner's frame."""

    place: Floats  # centre of projection [3]
    axis: Floats  # unit vector towards the scene [3]
    side: Floats  # unit vector along which the image coordinate rises [3]
    pupil_mm2: float

    @classmethod
    def of(cls, config: Config, f_number: float) -> "Camera":
        """Return the camera of (2) and (4): at (B, 0, CZ), its axis at beta = Phi."""
        geometry = config.geometry
        sine, cosine = np.sin(geometry.bias_rad), np.cos(geometry.bias_rad)
        return cls(
            place=np.array([geometry.base_mm, 0.0, geometry.offset_mm]),
            axis=np.array([-cosine, 0.0, sine]),
            side=np.array([sine, 0.0, cosine]),
            pupil_mm2=0.25 * np.pi * (geometry.focal_mm / f_number) ** 2,
        )


@dataclass(frozen=True)
class Spots:
    """n rays of the beam with their spots; lengths are in the scanner's frame, mm."""

    lit: Bools  # the ray meets a target
    seen: Bools  # the lens sees that place, and its image is not far off the sensor
    point: Floats  # place of the hit [n, 3], the ray's start where not lit
    target: Ints  # index of the target, -1 where not lit
    distance: Floats  # distance from the ray's start [n], infinite where not lit
    depth: Floats  # distance from the lens along its axis [n]
    position_px: Floats  # position of the image [n], NaN where there cannot be one
    px_per_mm: Floats  # motion of the image per offset of the ray in the scan plane [n], or 0
    collected: Floats  # share of the ray's light that enters the pupil [n], 0 where not seen
    # Of light from beneath the surface: its share of ``collected``, the mean distance of its image
    # from the spot's, px, and the scales of its spread along and across the row, px [n, 4].
    beneath: Floats


def meet(
    world: World,
    materials: tuple[Material, ...],
    scene: Description,
    config: Config,
    origin: Floats,
    direction: Floats,
    y_mm: Floats,
    *,
    gloss: bool,
    falloff: bool,
    subsurface: bool = False,
) -> Spots:
    """Follow rays to the scene and on to the camera.

    The light that the pupil collects is the range equation, iria (2-31): f_r cos(theta_v) A / R^2,
    with the pupil foreshortened where ``falloff`` is on. A ray along a surface spreads without
    limit over it: its image moves by ``STEEPEST_PX_PER_MM`` at most.

    Args:
        world: The targets.
        materials: Material of each target.
        scene: The scene, whose lens and laser are used.
        config: The configuration, whose geometry is used.
        origin: Start of each ray in the scanner's frame, y = 0 [n, 3].
        direction: Unit vectors, y = 0 [n, 3].
        y_mm: Position of the scanner along y [n].
        gloss: Whether lobes are included.
        falloff: Whether the pupil is foreshortened.
        subsurface: Whether light from beneath surfaces is followed.
    """
    if len(origin) > _RAYS:
        rays = [slice(first, first + _RAYS) for first in range(0, len(origin), _RAYS)]
        on = partial(meet, gloss=gloss, falloff=falloff, subsurface=subsurface)
        given = world, materials, scene, config
        parts = [on(*given, origin[k], direction[k], y_mm[k]) for k in rays]
        names = [field.name for field in fields(Spots)]
        return Spots(*(np.concatenate([getattr(part, name) for part in parts]) for name in names))
    camera = Camera.of(config, scene.lens.f_number)
    start = origin.copy()
    start[:, 1] += y_mm
    hits = world.cast(start, direction)
    lit = hits.target >= 0
    distance = np.where(lit, hits.distance_mm, 0.0)
    point = origin + distance[:, None] * direction
    depth = (point - camera.place) @ camera.axis
    front = lit & (depth > _NEAREST_MM)
    position = np.full(len(lit), np.nan)
    position[front] = project(point[front, 0], point[front, 2], config.geometry)
    middle = 0.5 * config.sensor.line_length
    with np.errstate(invalid="ignore"):
        rows = np.flatnonzero(np.abs(position - middle) < middle + OFF_SENSOR_PX)
    found = Spots(
        lit=lit,
        seen=np.zeros(len(lit), np.bool_),
        point=point,
        target=hits.target,
        distance=np.where(lit, hits.distance_mm, np.inf),
        depth=np.where(front, depth, 1.0),
        position_px=position,
        px_per_mm=np.zeros(len(lit)),
        collected=np.zeros(len(lit)),
        beneath=np.zeros((len(lit), 4)),
    )
    if len(rows) == 0:
        return found

    here, ray, normal = point[rows], direction[rows], hits.normal[rows]
    lift = np.zeros_like(here)
    lift[:, 1] = y_mm[rows]
    clear = ~world.blocked(here + lift, camera.place + lift)
    found.seen[rows] = clear
    sight = camera.place - here
    square = dot(sight, sight)
    far = np.sqrt(square)
    view = sight / far[:, None]
    deep, lateral = depth[rows], -(sight @ camera.side)
    # An offset s in the scan plane moves the point by s (e - d (e.n)/(d.n)), e across the ray d.
    slant = dot(ray, normal)
    slant = np.where(np.abs(slant) < 1e-9, -1e-9, slant)
    along = (ray[:, 2] * normal[:, 0] - ray[:, 0] * normal[:, 2]) / slant
    step_x, step_z = ray[:, 2] - along * ray[:, 0], -ray[:, 0] - along * ray[:, 2]
    tangent = lateral / deep
    _, slope = undistorted(position[rows], config.geometry)
    scale = config.geometry.focal_mm / deep / slope
    # The image's motion with x and z of a point.
    by_x, by_z = (scale * (camera.side[k] - tangent * camera.axis[k]) for k in (0, 2))
    lean = step_x * by_x + step_z * by_z
    found.px_per_mm[rows] = np.clip(lean, -STEEPEST_PX_PER_MM, STEEPEST_PX_PER_MM)

    upright = np.maximum(dot(view, normal), 0.0)
    scattered = np.zeros(len(rows))
    target = hits.target[rows]
    for material in dict.fromkeys(materials):
        kinds = np.array([own == material for own in materials])
        own = np.flatnonzero(clear & kinds[target])
        if len(own) == 0:
            continue
        matt = material.reflectance / np.pi * hits.albedo[rows[own]]
        if material.gloss == 0.0 or not gloss:
            # Only Lambert's reflection, which saves the computation of a lobe.
            scattered[own] = matt * (slant[own] < 0.0)
        else:
            scattered[own] = brdf(
                material,
                ray[own],
                normal[own],
                view[own],
                hits.albedo[rows[own]],
                wavelength_nm=scene.laser.wavelength_nm,
                acceptance_rad=np.sqrt(camera.pupil_mm2 / np.pi) / far[own],
            )
        kind = material.subsurface
        lit_there = scattered[own] > 0.0
        own, matt = own[lit_there], matt[lit_there]
        if kind is None or not subsurface or len(own) == 0:
            continue
        away = beneath(ray[own], normal[own], view[own])
        along_px = np.abs(lean[own]) / np.hypot(1.0, along[own])  # px per mm of the surface
        across_px = config.geometry.focal_mm / config.geometry.pitch_mm / deep[own]
        found.beneath[rows[own]] = np.stack(
            [
                kind.share * matt / scattered[own],
                kind.length_mm * (away[:, 0] * by_x[own] + away[:, 2] * by_z[own]),
                kind.lateral_mm * along_px,
                kind.lateral_mm * across_px,
            ],
            axis=1,
        )
    solid = camera.pupil_mm2 / square
    if falloff:
        solid = solid * deep / far
    found.collected[rows] = np.minimum(scattered * upright * solid, 1.0)
    return found
