"""Stray light: the parts of receiver and scan head, and the shadows of dust and scratches.

Ghosts, which need the whole stack of surfaces, are in ``vrscan.scene.ghosts``; what polish, dust,
digs and scratches scatter is in ``vrscan.scene.scatter``. The sensor's axis u and all its tilts lie
in the plane of triangulation; "across" is at right angles to the row. Sources: "Straylight analyses
and mitigation strategies for the ELT METIS instrument" ("metis"), (6), 3 and 4.3; MIL-STD-1246C for
dust.
"""

import math
from dataclasses import dataclass
from typing import Annotated, Literal, get_args

import numpy as np
from pydantic import Field, model_validator
from scipy.special import erf

from vrscan.data.arrays import Bools, Floats
from vrscan.data.config import Positive, Section
from vrscan.scene.surface import WAVELENGTH_NM, Wavelength

Part = Literal[
    "window", "filter", "lens", "cover", "sensor", "mirror", "head_window", "halo", "dust"
]
Share = Annotated[float, Field(ge=0, lt=1)]
Tilt = Annotated[float, Field(ge=-30, le=30)]

BEYOND_PX = 20  # distance from a spot at which stray light is no longer part of it

_SQUARE_FOOT_M2 = 0.09290304
_CLEANLINESS_SLOPE = 0.926  # slope of log10 N over log10^2 x, MIL-STD-1246C
_LARGEST_UM = 1000.0  # a larger particle would be seen and wiped off


class Plate(Section):
    """A plane-parallel or wedged plate in front of the sensor."""

    thickness_mm: Positive = 2.0
    index: float = Field(default=1.5143, ge=1, le=4)  # N-BK7 at 658 nm
    gap_mm: float = Field(default=3.0, ge=0, le=500)  # air gap behind it, towards the sensor
    front_reflectance: Share = 0.005  # residual, of the face to the object
    back_reflectance: Share = 0.005
    tilt_deg: Tilt = 0.0  # positive: the side with larger u is nearer to the sensor
    across_deg: Tilt = 0.0
    wedge_deg: float = Field(default=0.0, ge=-5, le=5)  # added to the tilt of the back face


class Window(Plate):
    """The front window of the camera."""

    thickness_mm: Positive = 3.0
    gap_mm: float = Field(default=4.0, ge=0, le=500)


class Filter(Plate):
    """The interference filter, whose stack is on the front face."""

    thickness_mm: Positive = 2.0
    front_reflectance: Share = 0.05  # a pass band of 95 %


class Cover(Plate):
    """The glass over the sensor; the gap is to the chip."""

    thickness_mm: Positive = 0.7
    gap_mm: float = Field(default=1.0, ge=0, le=50)
    front_reflectance: Share = 0.01
    back_reflectance: Share = 0.01


class Lens(Section):
    """The lens: a triplet by default, scaled to the focal length of ``[geometry]``.

    The prescription was found for this project by least squares over real rays at f = 25 mm, f/3,
    658 nm: crowns of N-SK16, a flint of N-F2; its spots are 5, 7 and 11 um rms at 0, 8 and 15
    degrees. ``thin`` is an ideal lens without reflections.
    """

    kind: Literal["surfaces", "thin"] = "surfaces"
    radii_mm: list[float] = Field(default=[9.8, 310.0, -12.8, 8.66, 24.1, -10.9])  # 0 is flat
    spacing_mm: list[Positive] = Field(default=[1.75, 3.96, 0.65, 2.71, 1.6])  # between vertices
    index: list[Annotated[float, Field(ge=1, le=4)]] = Field(
        default=[1.6172, 1.0, 1.6150, 1.0, 1.6172]
    )
    stop: int = Field(default=3, ge=1)  # the stop lies at this surface; 1 is the first
    reflectance: Share = 0.005  # reflectance of each surface

    @model_validator(mode="after")
    def _complete(self) -> "Lens":
        count = len(self.radii_mm)
        if count < 2 or len(self.spacing_mm) != count - 1 or len(self.index) != count - 1:
            raise ValueError(
                f"{count} radii need as many spacings and indices less one, and not "
                f"{len(self.spacing_mm)} and {len(self.index)}"
            )
        if self.stop > count:
            raise ValueError(f"stop {self.stop} is behind the last of {count} surfaces")
        if any(abs(radius) < 1.0 for radius in self.radii_mm if radius):
            raise ValueError("a radius is 0 (flat) or at least 1 mm")
        return self


class HeadWindow(Section):
    """The window of the scan head, which the beam leaves through."""

    distance_mm: Positive = 15.0  # distance of its inner face from the pivot, along z
    thickness_mm: Positive = 2.0
    index: float = Field(default=1.5143, ge=1, le=4)
    inner_reflectance: Share = 0.005
    outer_reflectance: Share = 0.005
    tilt_deg: Tilt = 5.0  # positive: the side with larger x is farther away
    wedge_deg: float = Field(default=0.0, ge=-5, le=5)  # added to the tilt of the outer face


class Mirror(Section):
    """The mirror of the scan head.

    2.5 nm is what users report of gold on polysilicon, 2.3 to 2.6 nm rms; metis has 1 to 2 nm for
    its mirrors.
    """

    roughness_nm: float = Field(default=2.5, ge=0, le=50)  # rms; all else is that of [polish]


class Polish(Section):
    """The polish of the glass, K-correlation of metis (1).

    2 nm is what metis takes as its baseline for all but the best surfaces, 5 nm its worst case. B
    and s are those that Photon Engineering's FRED begins with (K-Correlation, after Dittman): the
    scatter bends at lambda / B, which is 3 mrad, of 0.1 to 10 mrad that its makers give for
    polished surfaces. Metis Table 1 has 27 mm and more, fitted to infrared materials.
    """

    roughness_nm: float = Field(default=2.0, ge=0, le=50)  # rms roughness
    roughness_at_nm: Wavelength = WAVELENGTH_NM  # light with which it was measured
    length_mm: float = Field(default=0.2, gt=0, le=1e5)  # B, 2 pi times the typical wavelength
    slope: float = Field(default=2.0, gt=0, le=10)  # s


class Dust(Section):
    """Dust, scratches and digs; levels of cleanliness of MIL-STD-1246C."""

    level: float = Field(default=300.0, ge=1, le=2000)  # level of every face but the cover's
    cover_level: float = Field(default=100.0, ge=1, le=2000)  # a cleaned face
    smallest_um: float = Field(default=1.0, ge=1, le=500)  # smaller particles are left out
    digs: int = Field(default=5, ge=0, le=10_000)  # digs per face, ISO 10110-7: 5/ digs x dig_mm
    dig_mm: float = Field(default=0.063, ge=0, le=5)  # root of the area of a dig
    scratches: int = Field(default=1, ge=0, le=1000)  # per face: L scratches x scratch_mm
    scratch_mm: float = Field(default=0.002, ge=0, le=1)  # width; as long as the face


class Stray(Section):
    """The table ``[stray]`` of a scene: the parts that may make stray light, and which exist.

    ``window``, ``filter`` and ``cover`` are plates in the light's way; ``lens`` and ``sensor`` are
    always there, and their names switch their reflections; ``mirror`` and ``head_window`` are the
    emitter's. ``halo`` is the scatter of polished glass, ``dust`` that of dust, digs and scratches.
    """

    enabled: list[Part] = Field(default=list(get_args(Part)))
    window: Window = Window()
    filter: Filter = Filter()
    lens: Lens = Lens()
    cover: Cover = Cover()
    sensor_reflectance: Share = 0.2  # specular reflectance of the chip
    mirror: Mirror = Mirror()
    head_window: HeadWindow = HeadWindow()
    # Irradiance in the filter's band at the lens, from outside the field, over that which it makes
    # on the sensor; 1e4 is what metis asks for (IMG-5).
    out_of_field: float = Field(default=1e4, ge=1)
    polish: Polish = Polish()
    dust: Dust = Dust()
    least_power: float = Field(default=1e-6, ge=0, lt=1)  # weaker ghosts are summed, not followed
    # Ghosts that bring less than this share of the light to any pixel are summed too. The peak of a
    # spot of 4 px has 1e-2; a discarded ghost is below 1e-7 of that.
    least_density: float = Field(default=1e-9, ge=0, lt=1)


@dataclass(frozen=True)
class WindowGhost:
    """The beam that the scan head's window reflects twice, relative to the direct beam.

    A beam is the line through ``shift * (cos b, -sin b)`` in (x, z) in the direction
    ``(sin b, cos b)``, where b is the scan angle plus its turn; so all shifts are at the mirror's
    pivot.
    """

    shift_mm: Floats  # [n] shift of the ghost, less that of the direct beam
    turn_rad: Floats  # [n] turn of the ghost, less that of the direct beam
    power: Floats  # [n] power of the ghost over that of the direct beam


def window_ghost(window: HeadWindow, angle_rad: Floats) -> WindowGhost:
    """Return the beam reflected at the window's outer and then at its inner face, with exact rays.

    Snell's law and the law of reflection in the scan plane, no small angles. For faces that are
    parallel the ghost is parallel to the beam and stands off by 2 t tan(i') cos(i).

    Leaves out polarisation and the rise of the residual reflectance with the angle, further
    reflections (lower by R^2 again), and the rim of the window.

    Args:
        window: The plate.
        angle_rad: Scan angle [n]; beams that cannot leave the window have no power.

    Returns:
        Shifts, turns and power [n], finite throughout.
    """
    angle = np.asarray(angle_rad, dtype=np.float64)
    inner = math.radians(window.tilt_deg)
    outer = inner + math.radians(window.wedge_deg)
    point = np.zeros((*angle.shape, 2))
    first = np.array([0.0, window.distance_mm])
    second = np.array([0.0, window.distance_mm + window.thickness_mm])
    heading = np.stack([np.sin(angle), np.cos(angle)], axis=-1)
    start, inside, passes = _face(point, heading, first, inner, 1.0 / window.index)
    far, leaving, leaves = _face(start, inside, second, outer, window.index)
    back, again, meets = _face(far, _mirrored(inside, outer), first, inner, 1.0)
    last, ghost, escapes = _face(back, _mirrored(again, inner), second, outer, window.index)
    good = passes & leaves & meets & escapes
    direct_shift, direct_turn = _line(far, leaving, angle, good)
    shift, turn = _line(last, ghost, angle, good)
    power = window.inner_reflectance * window.outer_reflectance
    return WindowGhost(
        shift_mm=shift - direct_shift,
        turn_rad=turn - direct_turn,
        power=np.where(good, power, 0.0),
    )


def attenuation(wide: Floats, wide_pitch: float, image: Floats, image_pitch: float) -> float:
    """Return A of metis (6): the most stray light on one pixel over all light of the image.

    Args:
        wide: Irradiance of the stray light alone on the wide detector, E_2.
        wide_pitch: Its pixel size p_2.
        image: Irradiance of the image on the small detector, E_1.
        image_pitch: Its pixel size p_1, in the same unit.

    Raises:
        ValueError: if the image holds no light, which leaves A undefined.
    """
    light = float(np.sum(image)) * image_pitch**2
    if not light > 0.0:
        raise ValueError("attenuation: the image holds no light")
    return float(np.max(wide)) * wide_pitch**2 / light


def particles(level: float, size_um: Floats | float) -> Floats:
    """Return the number of particles of at least ``size_um`` on a square foot, MIL-STD-1246C.

    log10 N = 0.926 (log10^2 level - log10^2 size): the level is the size of which there is one.
    Of metis Table 3, per 0.1 m^2, only the row of the vortex mask agrees with this (a square foot
    is 0.093 m^2). The detector's states 2.4 times fewer particles than its level has, the other six
    9.6 to 10.1 times fewer, as if they were counted on a tenth of that area.

    Args:
        level: Level of cleanliness, um.
        size_um: Size of the particles, at least 1 um.
    """
    logs = math.log10(level) ** 2 - np.square(np.log10(size_um))
    return np.asarray(np.power(10.0, _CLEANLINESS_SLOPE * logs), dtype=np.float64)


def covered_share(level: float, smallest_um: float = 1.0) -> float:
    """Return the share of a surface that dust covers, as discs of the particles' size.

    The integral of pi/4 x^2 over the distribution of ``particles`` from ``smallest_um`` up to the
    level, in closed form. Leaves out that long particles (fibres) cover more than their disc.
    """
    top, bottom = math.log(level), math.log(smallest_um)
    if top <= bottom:
        return 0.0
    slope = _CLEANLINESS_SLOPE / math.log(10.0)
    ends = math.exp(2.0 * bottom + slope * (top**2 - bottom**2)) - math.exp(2.0 * top)
    root = math.sqrt(slope)
    bell = erf(root * (top - 1.0 / slope)) - erf(root * (bottom - 1.0 / slope))
    inner = math.exp(slope * top**2 + 1.0 / slope) * math.sqrt(math.pi / slope) * float(bell)
    return 0.25 * math.pi * (ends + inner) * 1e-12 / _SQUARE_FOOT_M2


def soiled(stray: Stray, diameter_mm: float) -> dict[str, float]:
    """Return the shares of a beam on a face that dust, digs and scratches cover, by cause.

    Leaves out that a dig or a scratch may lie where the beam is not.

    Args:
        stray: The cleanliness of the faces.
        diameter_mm: Diameter of the beam on the face, which is as wide as the face.
    """
    if "dust" not in stray.enabled:
        return {}
    dust = stray.dust
    beam = 0.25 * math.pi * diameter_mm**2
    return {
        "dust": covered_share(dust.level, dust.smallest_um),
        "digs": dust.digs * dust.dig_mm**2 / beam,
        "scratches": dust.scratches * dust.scratch_mm * diameter_mm / beam,
    }


def pupil_faces(stray: Stray) -> int:
    """Return the number of faces near the pupil: of window, filter and lens."""
    faces = 2 * (("window" in stray.enabled) + ("filter" in stray.enabled))
    return faces + (len(stray.lens.radii_mm) if stray.lens.kind == "surfaces" else 2)


def obscured_share(stray: Stray, *, focal_mm: float = 25.0, f_number: float = 3.0) -> float:
    """Return the share of the light that dust, digs and scratches in the pupil take away.

    Metis 4.3: on faces near the pupil (window, filter, lens) every particle shadows all pixels
    alike, and light is lost as its area over the beam's. As much again is diffracted, which is in
    ``vrscan.scene.scatter``. A particle on the cover's faces, near the focus, shadows single pixels
    instead: ``dust_shadow``.

    Args:
        stray: Faces that are there, and their cleanliness.
        focal_mm: Focal length, which over the f-number is the beam's width on the faces.
        f_number: f-number of the lens.
    """
    one = min(1.0, sum(soiled(stray, focal_mm / f_number).values()))
    return 1.0 - (1.0 - one) ** pupil_faces(stray)


def dust_shadow(
    stray: Stray,
    length_px: int,
    seed: int,
    *,
    pitch_mm: float = 0.007,
    f_number: float = 3.0,
) -> Floats:
    """Return the transmission of the sensor's cover for each pixel, with dust on both faces.

    Metis 4.3, obscuration near the focus: a pixel sees a disc of the face, as wide as the
    distance over the f-number, and a particle takes the share of that disc that it covers. The
    directions in which the pixels look never change, so neither does the pattern.

    Leaves out diffraction, and the overlap of particles.

    Args:
        stray: The cover and its cleanliness.
        length_px: Number of pixels of the row.
        seed: Seed of the places and sizes; the same seed gives the same dust.
        pitch_mm: Pitch of the pixels.
        f_number: f-number of the lens.

    Returns:
        Shares from 0 to 1 [length_px].
    """
    gone = np.zeros(length_px)
    if "dust" not in stray.enabled or "cover" not in stray.enabled:
        return 1.0 - gone
    random = np.random.Generator(np.random.SFC64(np.random.SeedSequence((seed, 0xD057))))
    dust, cover = stray.dust, stray.cover
    heights = (cover.gap_mm, cover.gap_mm + cover.thickness_mm / cover.index)
    for height in heights:
        radius = max(0.5 * height / f_number, 0.5 * pitch_mm)
        margin = radius + 0.5e-3 * _LARGEST_UM
        area_m2 = 1e-6 * (length_px * pitch_mm + 2.0 * margin) * 2.0 * margin
        expected = float(particles(dust.cover_level, dust.smallest_um)) * area_m2 / _SQUARE_FOOT_M2
        count = int(random.poisson(expected))
        x = random.uniform(-margin, length_px * pitch_mm + margin, count)
        y = random.uniform(-margin, margin, count)
        logs = np.log10(dust.smallest_um) ** 2 - np.log10(1.0 - random.random(count)) / (
            _CLEANLINESS_SLOPE
        )
        size = np.minimum(np.power(10.0, np.sqrt(logs)), _LARGEST_UM)
        near = np.abs(y) < radius + 0.5e-3 * size
        x, y, size = x[near], y[near], size[near]
        reach = np.ceil((radius + 0.5e-3 * size) / pitch_mm).astype(np.int64)
        centre = np.floor(x / pitch_mm).astype(np.int64)
        count_px = 2 * reach + 1
        owner = np.repeat(np.arange(len(x)), count_px)
        first = np.cumsum(count_px) - count_px
        pixel = np.arange(count_px.sum()) - first[owner] - reach[owner] + centre[owner]
        inside = (pixel >= 0) & (pixel < length_px)
        owner, pixel = owner[inside], pixel[inside]
        distance = np.hypot((pixel + 0.5) * pitch_mm - x[owner], y[owner])
        covered = disc_overlap(0.5e-3 * size[owner], radius, distance) / (math.pi * radius**2)
        gone += np.bincount(pixel, weights=covered, minlength=length_px)
    return 1.0 - np.minimum(gone, 1.0)


def disc_overlap(first: Floats | float, second: Floats | float, distance: Floats) -> Floats:
    """Return the common area of two discs of these radii, elementwise, all in one unit."""
    small, large, distance = np.broadcast_arrays(
        np.minimum(first, second), np.maximum(first, second), distance
    )
    inside = distance <= large - small
    common = np.where(inside, math.pi * np.square(small), 0.0)
    crossing = ~inside & (distance < small + large)
    a, b, d = (each[crossing] for each in (small, large, distance))
    square = np.square(d)
    near = np.clip((square + a**2 - b**2) / (2.0 * d * a), -1.0, 1.0)
    far = np.clip((square + b**2 - a**2) / (2.0 * d * b), -1.0, 1.0)
    kite = (-d + a + b) * (d + a - b) * (d - a + b) * (d + a + b)
    lens = a**2 * np.arccos(near) + b**2 * np.arccos(far)
    common[crossing] = lens - 0.5 * np.sqrt(np.maximum(kite, 0.0))
    return np.asarray(common)


def _face(
    point: Floats, heading: Floats, vertex: Floats, tilt: float, ratio: float
) -> tuple[Floats, Floats, Bools]:
    """Return where rays (x, z) meet a tilted face, how they go on behind it, and whether they do.

    ``ratio`` is the index before the face over the one behind it; 1 leaves the heading unchanged.
    """
    normal = np.array([-math.sin(tilt), math.cos(tilt)])
    cosine = heading @ normal
    flat = np.abs(cosine) < 1e-9
    cosine = np.where(flat, 1.0, cosine)
    path = ((vertex - point) @ normal) / cosine
    square = 1.0 - ratio**2 * (1.0 - np.square(cosine))
    through = np.sqrt(np.maximum(square, 0.0)) * np.sign(cosine)
    onward = ratio * heading + (through - ratio * cosine)[..., None] * normal
    good = ~flat & (square > 0.0) & (path > 0.0)
    return point + np.where(good, path, 0.0)[..., None] * heading, onward, good


def _mirrored(heading: Floats, tilt: float) -> Floats:
    normal = np.array([-math.sin(tilt), math.cos(tilt)])
    return np.asarray(heading - 2.0 * (heading @ normal)[..., None] * normal)


def _line(
    point: Floats,
    heading: Floats,
    angle: Floats,
    good: Bools,
) -> tuple[Floats, Floats]:
    """Return a line's shift at the origin and its turn against the scan angle, 0 where not good."""
    turn = np.arctan2(heading[..., 0], heading[..., 1]) - angle
    shift = point[..., 0] * np.cos(angle + turn) - point[..., 1] * np.sin(angle + turn)
    return np.where(good, shift, 0.0), np.where(good, turn, 0.0)
