"""Stray light: the parts of receiver and scan head, scatter, dust and scratches.

Ghosts, which need the whole stack of surfaces, are in ``vrscan.scene.ghosts``. The sensor's axis u
and all its tilts lie in the plane of triangulation; "across" is at right angles to the row.
Sources: "Straylight analyses and mitigation strategies for the ELT METIS instrument" ("metis"), (1)
to (3), (6), 3 and 4.3; Dittman, Proc. SPIE 6291 (2006), for the scatter; MIL-STD-1246C for dust.
"""

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated, Literal, get_args

import numpy as np
from pydantic import Field, model_validator
from scipy.special import erf

from vrscan.data.arrays import Bools, Floats
from vrscan.data.config import Positive, Section
from vrscan.scene.surface import tis

Part = Literal["window", "filter", "lens", "cover", "sensor", "head_window", "halo", "dust"]
Share = Annotated[float, Field(ge=0, lt=1)]
Tilt = Annotated[float, Field(ge=-30, le=30)]

_SQUARE_FOOT_M2 = 0.09290304
_CLEANLINESS_SLOPE = 0.926  # slope of log10 N over log10^2 x, MIL-STD-1246C
_LARGEST_UM = 1000.0  # a larger particle would be seen and wiped off
_RINGS_PER_PX = 8  # rings of the halo; the row's share of a ring is exact to a ring's width
_RING_NODES = 48


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


class Polish(Section):
    """The polish of the receiver's surfaces, K-correlation of metis (1).

    2 nm is what metis takes as its baseline for all but the best surfaces, 5 nm its worst case.
    """

    roughness_nm: float = Field(default=2.0, ge=0, le=50)  # rms roughness
    length_mm: float = Field(default=1.0, gt=0, le=1e5)  # B, 2 pi times the typical wavelength
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
    always there, and their names switch their reflections; ``head_window`` is the emitter's.
    """

    enabled: list[Part] = Field(default=list(get_args(Part)))
    window: Window = Window()
    filter: Filter = Filter()
    lens: Lens = Lens()
    cover: Cover = Cover()
    sensor_reflectance: Share = 0.2  # specular reflectance of the chip
    head_window: HeadWindow = HeadWindow()
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
    direct_shift_mm: Floats  # [n] shift of the direct beam by the window
    direct_turn_rad: Floats  # [n] turn of the direct beam by the window


@dataclass(frozen=True)
class Halo:
    """The light that the scatter of polished surfaces puts around a spot."""

    weights: Floats  # [n_px] share of the spot's light in the row's pixel at 0, 1, 2 .. px
    row: float  # share of the light that it puts on the row, both sides, out to n_px - 1
    total: float  # share of the light that is scattered, on the row or not


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
        direct_shift_mm=direct_shift,
        direct_turn_rad=direct_turn,
    )


def halo_weights(
    n_px: int,
    stray: Stray,
    *,
    sigma_px: float = 0.0,
    focal_mm: float = 25.0,
    pitch_mm: float = 0.007,
    wavelength_nm: float = 658.0,
) -> Halo:
    """Return the line-spread of the scatter on a sensor of a single row.

    Each surface scatters the share tis of metis (3), spread over direction cosines as the
    K-correlation of (1) has it, and reaches the sensor over its lever: the focal length for window,
    filter and lens, the optical distance to the chip for the cover's faces. In two dimensions the
    energy is the sum of the surfaces' TIS exactly, because rings take what lies between two radii
    in closed form; only the row's share of a ring is summed.

    Leaves out the surfaces' places inside the lens, and that the row sees them at an angle.

    Args:
        n_px: Number of pixels on one side of the spot.
        stray: Surfaces that are there, and their polish.
        sigma_px: Sigma of the Gaussian spot across the row; 0 is a point on the row's middle. Along
            the row the weights are those of a point, to be convolved with the spot.
        focal_mm: Focal length of the lens.
        pitch_mm: Pitch of the square pixels.
        wavelength_nm: Wavelength of the light.

    Raises:
        ValueError: if ``n_px`` is below 1 or ``sigma_px`` negative.
    """
    if n_px < 1 or sigma_px < 0.0:
        raise ValueError(f"halo of {n_px} px, sigma {sigma_px} px")
    if "halo" not in stray.enabled or stray.polish.roughness_nm == 0.0:
        return Halo(np.zeros(n_px), 0.0, 0.0)
    faces = _scatterers(stray, focal_mm)
    # Rings from far inside the core outwards, linear where they are pixels apart.
    inner = np.geomspace(1e-6, 0.25, 200)
    reach = math.hypot(n_px, 0.5 + 6.0 * sigma_px)
    core = np.arange(0.25, 8.0, 0.125 / _RINGS_PER_PX)[1:]
    outer = np.arange(8.0, reach + 1.0, 1.0 / _RINGS_PER_PX)
    edge = np.concatenate([[0.0], inner, core, outer])
    within = np.zeros_like(edge)
    total = 0.0
    for index_step, lever in faces:
        scattered = float(tis(stray.polish.roughness_nm, wavelength_nm, index_step))
        total += scattered
        sine = edge * pitch_mm / np.hypot(edge * pitch_mm, lever)
        within += scattered * _encircled(sine, stray.polish, wavelength_nm)
    ring = np.diff(within)
    radius = 0.5 * (edge[1:] + edge[:-1])
    high = 0.5 + 6.0 * sigma_px
    widest = np.arcsin(np.minimum(1.0, high / radius))
    turn = widest[:, None] * (np.arange(_RING_NODES) + 0.5) / _RING_NODES
    on_row = _on_row(radius[:, None] * np.sin(turn), sigma_px)
    share = ring[:, None] * on_row * (widest[:, None] / _RING_NODES) * (2.0 / math.pi)
    place = np.floor(radius[:, None] * np.cos(turn) + 0.5).astype(np.int64)
    seen = place < n_px
    sums = np.bincount(place[seen], share[seen], n_px).astype(np.float64)
    weights = sums * np.where(np.arange(n_px) == 0, 1.0, 0.5)  # two sides share all but pixel 0
    return Halo(weights=weights, row=float(sums.sum()), total=total)


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
    Of metis Table 3 only the row of the vortex mask agrees with this; the others state 9.3 times
    fewer particles than their level has on 0.1 m^2, as if counted on a tenth of that.

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


def obscured_share(stray: Stray, *, focal_mm: float = 25.0, f_number: float = 3.0) -> float:
    """Return the share of the light that dust, digs and scratches in the pupil obscure.

    Metis 4.3: on faces near the pupil (window, filter, lens) every particle shadows all pixels
    alike, and light is lost as its area over the beam's. A particle on the cover's faces, near the
    focus, shadows single pixels instead: ``dust_shadow``.

    The model leaves out that the obscured light is in part diffracted near the image and not lost,
    and that a dig or a scratch may lie where the beam is not.

    Args:
        stray: Faces that are there, and their cleanliness.
        focal_mm: Focal length, which over the f-number is the beam's width on the faces.
        f_number: f-number of the lens.
    """
    if "dust" not in stray.enabled:
        return 0.0
    dust = stray.dust
    faces = 2 * (("window" in stray.enabled) + ("filter" in stray.enabled))
    faces += len(stray.lens.radii_mm) if stray.lens.kind == "surfaces" else 2
    diameter = focal_mm / f_number
    beam = 0.25 * math.pi * diameter**2
    defects = dust.digs * dust.dig_mm**2 + dust.scratches * dust.scratch_mm * diameter
    one = min(1.0, covered_share(dust.level, dust.smallest_um) + defects / beam)
    return 1.0 - (1.0 - one) ** faces


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
    small = np.minimum(first, second)
    large = np.maximum(first, second)
    apart = distance >= small + large
    inside = distance <= large - small
    crossing = ~(apart | inside)
    d = np.where(crossing, distance, 1.0)
    a = np.where(crossing, small, 0.8)
    b = np.where(crossing, large, 0.8)
    square = np.square(d)
    near = np.clip((square + a**2 - b**2) / (2.0 * d * a), -1.0, 1.0)
    far = np.clip((square + b**2 - a**2) / (2.0 * d * b), -1.0, 1.0)
    kite = (-d + a + b) * (d + a - b) * (d - a + b) * (d + a + b)
    common = a**2 * np.arccos(near) + b**2 * np.arccos(far) - 0.5 * np.sqrt(np.maximum(kite, 0.0))
    whole = np.where(inside, math.pi * np.square(small), 0.0)
    return np.asarray(np.where(crossing, common, whole))


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


def _scatterers(stray: Stray, focal_mm: float) -> list[tuple[float, float]]:
    """Return the change of index and the lever in mm of each polished surface."""
    faces = []
    for name, plate in (("window", stray.window), ("filter", stray.filter)):
        if name in stray.enabled:
            faces += [(plate.index - 1.0, focal_mm)] * 2
    if stray.lens.kind == "surfaces":
        media = [1.0, *stray.lens.index, 1.0]
        faces += [(abs(after - before), focal_mm) for before, after in pairwise(media)]
    if "cover" in stray.enabled:
        cover = stray.cover
        # A face that lies on the chip scatters into the pixel itself.
        near = max(cover.gap_mm, 1e-6)
        faces += [(cover.index - 1.0, near + cover.thickness_mm / cover.index)]
        faces += [(cover.index - 1.0, near)]
    return faces


def _encircled(sine: Floats, polish: Polish, wavelength_nm: float) -> Floats:
    """Return the share of the scattered light within a sine of the scatter angle: (1) integrated.

    2 pi integral of (1 + B^2 b^2 / lambda^2)^(-s/2) b db, over its value at b = 1.
    """
    waves = 1e6 * polish.length_mm / wavelength_nm
    bend = 1.0 - 0.5 * polish.slope

    def band(logs: Floats) -> Floats:
        return np.asarray(logs if abs(bend) < 1e-9 else np.expm1(bend * logs) / bend)

    return band(np.log1p(np.square(waves * sine))) / band(np.log1p(np.square([waves])))


def _on_row(y: Floats, sigma_px: float) -> Floats:
    """Return the share of the spot within half a pixel of this distance across the row."""
    if sigma_px == 0.0:
        return np.where(np.abs(y) < 0.5, 1.0, 0.0)
    scale = 1.0 / (math.sqrt(2.0) * sigma_px)
    return np.asarray(0.5 * (erf((y + 0.5) * scale) - erf((y - 0.5) * scale)))
