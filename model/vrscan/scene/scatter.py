"""Scatter of polished surfaces, and of dust, digs and scratches on them.

Roughness scatters by K-correlation, metis (1) to (5), after Dittman, Proc. SPIE 6291 (2006). What
lies on a surface and is large against the wavelength takes twice its area from a beam (Babinet; the
extinction paradox of Mie's theory): once as a shadow, ``stray.obscured_share``, and once by
diffraction into a lobe about the beam. The lobe of a disc is Airy's, that of a scratch the slit's;
Peterson, Proc. SPIE 8495 (2012), has both. Sizes of dust are those of MIL-STD-1246C, as in metis
4.3, which gives no lobes.

Leaves out what a particle refracts, reflects or lets through, which goes all over the half space
(2e-8 of it into a pixel), interference between particles, and any second scatter.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache, partial
from itertools import pairwise

import numpy as np
from scipy.sparse import csr_matrix
from scipy.special import erf, j0, j1, sici

from vrscan.data.arrays import Floats
from vrscan.scene.stray import Polish, Stray, covered_share, particles, pupil_faces, soiled
from vrscan.scene.surface import MIRROR_STEP, effective_roughness, tis

MOST_SCATTERED = 0.5  # share of the light above which single scatter describes no instrument
CAUSES = ("roughness", "dust", "digs", "scratches")

_RINGS_PER_PX = 8  # rings of the halo; the row's share of a ring is exact to a ring's width
_RING_NODES = 48
_SIZES = 96  # sizes that stand for those of dust
_LEAST_SINE = 1e-7
_SINES = 3000  # places of dust's lobe that are kept


@dataclass(frozen=True)
class Scatterer:
    """Faces at one distance that scatter for one cause."""

    cause: str  # one of ``CAUSES``
    depth: float  # optical depth: light that is left is exp(-depth)
    lever_mm: float  # distance over which an angle becomes a place on the sensor
    encircled: Callable[[Floats], Floats]  # share of the scattered light within a sine


@dataclass(frozen=True)
class Scatter:
    """All that scatters in a beam's way."""

    scatterers: tuple[Scatterer, ...]

    @property
    def total(self) -> float:
        """Return the share of the light that is scattered.

        TIS of (3) is that of single scatter and passes 1 for a rough surface; what is left of the
        beam is exp(-TIS) (Carniglia, Opt. Eng. 18 (1979)).
        """
        return -math.expm1(-sum(each.depth for each in self.scatterers))

    def shares(self) -> dict[str, float]:
        """Return the share of the light that each cause scatters; together they are the total."""
        return {
            cause: sum((self.share(each) for each in self.scatterers if each.cause == cause), 0.0)
            for cause in CAUSES
        }

    def share(self, scatterer: Scatterer) -> float:
        """Return the share of the light that goes to one of the scatterers."""
        whole = sum(each.depth for each in self.scatterers)
        return scatterer.depth / whole * self.total if whole > 0.0 else 0.0

    def within(self, place_mm: Floats) -> Floats:
        """Return the share of the light that is scattered to within a distance on the sensor."""
        found = np.zeros(np.shape(place_mm))
        for each in self.scatterers:
            found += self.share(each) * each.encircled(place_mm / np.hypot(place_mm, each.lever_mm))
        return found


@dataclass(frozen=True)
class Halo:
    """The light that scatter puts around a spot."""

    weights: Floats  # [n_px] share of the spot's light in the row's pixel at 0, 1, 2 .. px
    row: float  # share of the light that it puts on the row, both sides, out to n_px - 1
    total: float  # share of the light that is scattered, on the row or not


def receiver(
    stray: Stray,
    *,
    focal_mm: float = 25.0,
    f_number: float = 3.0,
    wavelength_nm: float = 658.0,
) -> Scatter:
    """Return what scatters between the object and the sensor.

    The lever is the focal length for window, filter and lens, and the optical distance to the chip
    for the cover's faces. Digs and scratches are on the former.
    """
    rough: list[tuple[float, float]] = []  # change of the index, lever
    for name, plate in (("window", stray.window), ("filter", stray.filter)):
        if name in stray.enabled:
            rough += [(plate.index - 1.0, focal_mm)] * 2
    if stray.lens.kind == "surfaces":
        media = [1.0, *stray.lens.index, 1.0]
        rough += [(abs(after - before), focal_mm) for before, after in pairwise(media)]
    levers = []
    if "cover" in stray.enabled:
        # A face that lies on the chip scatters into the pixel itself.
        near = max(stray.cover.gap_mm, 1e-6)
        levers = [near + stray.cover.thickness_mm / stray.cover.index, near]
        rough += [(stray.cover.index - 1.0, lever) for lever in levers]
    found = _polished(stray, stray.polish.roughness_nm, rough, wavelength_nm)
    found += _soil(stray, focal_mm / f_number, pupil_faces(stray), focal_mm, wavelength_nm)
    if "dust" in stray.enabled:
        level, least = stray.dust.cover_level, stray.dust.smallest_um
        depth = -math.log1p(-min(covered_share(level, least), 1.0 - 1e-12))
        lobe = partial(_dust_within, level, least, wavelength_nm)
        found += [Scatterer("dust", depth, lever, lobe) for lever in levers if depth > 0.0]
    return Scatter(tuple(found))


def emitter(stray: Stray, *, face_mm: float = 25.0 / 3.0, wavelength_nm: float = 658.0) -> Scatter:
    """Return what scatters in the scan head: its mirror, and both faces of its window.

    Levers are 1 mm, so that places are tangents. Of dust, digs and scratches there is as much on an
    area as on the receiver's faces, of diameter ``face_mm``; the thin beam meets its mean.
    """
    found: list[Scatterer] = []
    faces = 0
    if "mirror" in stray.enabled:
        found += _polished(stray, stray.mirror.roughness_nm, [(MIRROR_STEP, 1.0)], wavelength_nm)
        faces += 1
    if "head_window" in stray.enabled:
        step = stray.head_window.index - 1.0
        found += _polished(stray, stray.polish.roughness_nm, [(step, 1.0)] * 2, wavelength_nm)
        faces += 2
    found += _soil(stray, face_mm, faces, 1.0, wavelength_nm)
    return Scatter(tuple(found))


def halo_weights(
    n_px: int,
    scatter: Scatter,
    *,
    sigma_px: float = 0.0,
    pitch_mm: float = 0.007,
) -> Halo:
    """Return the line-spread of the scatter on a sensor of a single row.

    In two dimensions the energy is the scattered share exactly, because rings take what lies
    between two radii in closed form; only the row's share of a ring is summed.

    Leaves out the surfaces' places inside the lens, that the row sees them at an angle, and that a
    scratch makes a streak at right angles to itself: it is spread evenly over all directions.

    Args:
        n_px: Number of pixels on one side of the spot.
        scatter: What scatters in front of the sensor.
        sigma_px: Sigma of the Gaussian spot across the row; 0 is a point on the row's middle. Along
            the row the weights are those of a point, to be convolved with the spot.
        pitch_mm: Pitch of the square pixels.

    Raises:
        ValueError: if ``n_px`` is below 1 or ``sigma_px`` negative.
    """
    if n_px < 1 or sigma_px < 0.0:
        raise ValueError(f"halo of {n_px} px, sigma {sigma_px} px")
    if scatter.total == 0.0:
        return Halo(np.zeros(n_px), 0.0, 0.0)
    edge, row = _rings(n_px, sigma_px)
    sums = np.asarray(row @ np.diff(scatter.within(edge * pitch_mm)), np.float64)
    weights = sums * np.where(np.arange(n_px) == 0, 1.0, 0.5)  # two sides share all but pixel 0
    return Halo(weights=weights, row=float(sums.sum()), total=scatter.total)


@lru_cache(maxsize=4)
def _rings(n_px: int, sigma_px: float) -> tuple[Floats, csr_matrix]:
    """Return the edges of rings in px, and the share of each ring in each pixel [n_px, rings]."""
    # Rings from far inside the core outwards, linear where they are pixels apart.
    inner = np.geomspace(1e-6, 0.25, 200)
    reach = math.hypot(n_px, 0.5 + 6.0 * sigma_px)
    core = np.arange(0.25, 8.0, 0.125 / _RINGS_PER_PX)[1:]
    outer = np.arange(8.0, reach + 1.0, 1.0 / _RINGS_PER_PX)
    edge = np.concatenate([[0.0], inner, core, outer])
    radius = 0.5 * (edge[1:] + edge[:-1])
    high = 0.5 + 6.0 * sigma_px
    widest = np.arcsin(np.minimum(1.0, high / radius))
    turn = widest[:, None] * (np.arange(_RING_NODES) + 0.5) / _RING_NODES
    on_row = _on_row(radius[:, None] * np.sin(turn), sigma_px)
    share = on_row * (widest[:, None] / _RING_NODES) * (2.0 / math.pi)
    place = np.floor(radius[:, None] * np.cos(turn) + 0.5).astype(np.int64)
    seen = place < n_px
    ring = np.broadcast_to(np.arange(len(radius))[:, None], place.shape)
    at = (place[seen], ring[seen])
    return edge, csr_matrix((share[seen], at), shape=(n_px, len(radius)))  # sums equal places


def intensity(scatter: Scatter, angle_rad: Floats) -> Floats:
    """Return the light that is scattered into directions, as a share of the beam per solid angle.

    Args:
        scatter: What scatters, over levers of 1 mm.
        angle_rad: Rising angles from the beam, at least two [n], below a right angle.

    Returns:
        sr^-1 [n]: means over the rings that reach half of the way to the neighbours. That of the
        first angle is over its whole disc, that of the last to itself.
    """
    middle = np.sqrt(angle_rad[1:] * angle_rad[:-1])
    edge = np.concatenate([[0.0], middle, angle_rad[-1:]])
    light = np.diff(scatter.within(np.tan(edge)))
    return np.asarray(light / (2.0 * math.pi * np.diff(-np.cos(edge))))


def disc_within(sine: Floats, diameter_um: float, wavelength_nm: float) -> Floats:
    """Return the share of a disc's diffracted light within a sine: Rayleigh's 1 - J0^2 - J1^2.

    Over its value at a sine of 1, beyond which nothing propagates.
    """

    def within(x: Floats) -> Floats:
        return np.asarray(1.0 - np.square(j0(x)) - np.square(j1(x)))

    edge = 1e3 * math.pi * diameter_um / wavelength_nm
    return np.asarray(within(edge * sine) / within(np.array(edge)))


def slit_within(sine: Floats, width_um: float, wavelength_nm: float) -> Floats:
    """Return the share of a scratch's diffracted light within a sine, on both sides.

    (2 / pi) (Si(2 x) - sin^2 x / x), x = pi width sine / wavelength, over its value at 1.
    """

    def within(x: Floats) -> Floats:
        return np.asarray(sici(2.0 * x)[0] - np.sin(x) * np.sinc(x / math.pi))

    edge = 1e3 * math.pi * width_um / wavelength_nm
    return np.asarray(within(edge * sine) / within(np.array(edge)))


def rough_within(sine: Floats, polish: Polish, wavelength_nm: float) -> Floats:
    """Return the share of the roughness's light within a sine of the scatter angle: (1) integrated.

    2 pi integral of (1 + B^2 b^2 / lambda^2)^(-s/2) b db, over its value at b = 1.
    """
    waves = 1e6 * polish.length_mm / wavelength_nm
    bend = 1.0 - 0.5 * polish.slope

    def band(logs: Floats) -> Floats:
        return np.asarray(logs if abs(bend) < 1e-9 else np.expm1(bend * logs) / bend)

    return band(np.log1p(np.square(waves * sine))) / band(np.log1p(np.square(waves)))


@lru_cache(maxsize=64)
def _dust_lobe(level: float, smallest_um: float, wavelength_nm: float) -> tuple[Floats, Floats]:
    """Return logarithms of sines, and the share of dust's diffracted light within each.

    The lobes of discs of ``_SIZES`` sizes, each with the area that particles near that size cover.
    """
    size = np.geomspace(smallest_um, level, _SIZES + 1)
    count = -np.diff(particles(level, size))
    middle = np.sqrt(size[1:] * size[:-1])
    area = count * np.square(middle)
    sine = np.geomspace(_LEAST_SINE, 1.0, _SINES)
    parts = np.stack([disc_within(sine, each, wavelength_nm) for each in middle])
    return np.log(sine), np.asarray(area @ parts / area.sum())


def _dust_within(level: float, smallest_um: float, wavelength_nm: float, sine: Floats) -> Floats:
    logs, within = _dust_lobe(level, smallest_um, wavelength_nm)
    with np.errstate(divide="ignore"):
        return np.asarray(np.interp(np.log(sine), logs, within, left=0.0))


def _polished(
    stray: Stray, roughness_nm: float, faces: Sequence[tuple[float, float]], wavelength_nm: float
) -> list[Scatterer]:
    """Return the scatter by roughness of faces, given as changes of the index and levers."""
    if "halo" not in stray.enabled or roughness_nm == 0.0:
        return []
    polish = stray.polish
    sigma_nm = effective_roughness(
        roughness_nm,
        wavelength_nm,
        polish.roughness_at_nm,
        length_um=1e3 * polish.length_mm,
        slope=polish.slope,
    )
    depth: dict[float, float] = {}
    for step, lever in faces:
        depth[lever] = depth.get(lever, 0.0) + float(tis(sigma_nm, wavelength_nm, step))
    lobe = partial(rough_within, polish=stray.polish, wavelength_nm=wavelength_nm)
    return [Scatterer("roughness", each, lever, lobe) for lever, each in depth.items()]


def _soil(
    stray: Stray, face_mm: float, faces: int, lever_mm: float, wavelength_nm: float
) -> list[Scatterer]:
    """Return the diffraction by dust, digs and scratches on some faces."""
    covered = soiled(stray, face_mm)
    whole = sum(covered.values())
    if whole == 0.0 or faces == 0:
        return []
    depth = -faces * math.log1p(-min(whole, 1.0 - 1e-12))
    dust = stray.dust
    disc_um = 2e3 * dust.dig_mm / math.sqrt(math.pi)
    lobes: dict[str, Callable[[Floats], Floats]] = {
        "dust": partial(_dust_within, dust.level, dust.smallest_um, wavelength_nm),
        "digs": partial(disc_within, diameter_um=disc_um, wavelength_nm=wavelength_nm),
        "scratches": partial(
            slit_within, width_um=1e3 * dust.scratch_mm, wavelength_nm=wavelength_nm
        ),
    }
    return [
        Scatterer(cause, depth * share / whole, lever_mm, lobes[cause])
        for cause, share in covered.items()
        if share > 0.0
    ]


def _on_row(y: Floats, sigma_px: float) -> Floats:
    """Return the share of the spot within half a pixel of this distance across the row."""
    if sigma_px == 0.0:
        return np.where(np.abs(y) < 0.5, 1.0, 0.0)
    scale = 1.0 / (math.sqrt(2.0) * sigma_px)
    return np.asarray(0.5 * (erf((y + 0.5) * scale) - erf((y - 0.5) * scale)))
