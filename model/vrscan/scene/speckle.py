"""Speckle of the imaged spot: each pixel's gain, and its effect on a position.

Light from a rough surface reaches a pixel as a sum of many random phasors. In a sharp image the
field is the beam's envelope times a circular Gaussian field whose cell is set by the cone of light
that meets at a pixel, lambda N wide, N = F (1 + m) with the magnification m of what is in focus
(Goodman, Speckle Phenomena in Optics, 2007, chapters 3 to 5). That cell is smaller than a pixel, so
a pixel sums some twelve of them and its gain has a contrast near 0.3.

Out of focus a pixel gets the light of each part of the pupil from another place, and where that is
beside the spot that part is dark. The cone that meets at a pixel is then narrower and the cells are
larger by as much, up to a contrast of 1: the sensor sees the pattern that the spot casts on the
pupil. During a pulse this pattern moves.

The pattern is tied to the surface. While neither surface nor camera moves, a pixel keeps its gain
as the beam's envelope passes over it, until the light's direction has turned so far that another
part of the scattered field falls into the pupil: by D / R, pupil over distance. So a gain is a
function only of the pixel and of the turn in units of D / R.
"""

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt
from scipy import fft
from scipy.special import erf

from vrscan.data.arrays import Floats, Ints
from vrscan.ideal.geometry import ThinLens
from vrscan.scene.legendre import legendre
from vrscan.scene.radiometry import mtf

Singles = npt.NDArray[np.float32]

KNOTS = 512  # knots of the turn; the pattern repeats after 32 times D / R, which a pixel never sees
KNOT_STEP = 0.0625  # D / R; the correlation from knot to knot is some 0.9
_SURFACE_STEP = 23.0  # D / R between surfaces: 32 of them are D / R or more apart
_HALF_ROW = 0.56  # pixel heights of motion that halve the correlation of a row's sum
_STREAM = 0x73706563  # separates these random numbers from others of the same seed
_LEVEL = 2.0**0.25  # ratio of the cells of one table of the pattern to those of the next
_LEVELS = 22  # tables: the last has cells of 45 times the first's
_SPOTS = np.geomspace(0.02, 20.0, 48)  # sigma of the spot over the disc's radius
_OFFSETS = 33  # offsets of a pixel from the spot's middle
_BLURS = 17  # nodes beside a spot's middle at which the speckle's size is worked out
_END = 4.0  # sigmas beyond the disc at which a spot's light ends
_MOST_CELLS = 15.0  # cells along a pixel up to which the quadrature holds
_BOX = 0.82  # (1/6) / 0.203: variance of a box's autocorrelation over that of a cell's, squares
_CELLS_APART = 6.0  # distance from which on cells are uncorrelated
_NEAREST_MM = 1.0  # nearer surfaces count as at this distance
_CHUNK = 1 << 14  # pixels computed at a time, so that the data stay in the cache
_PUPIL_GRID = 64  # grid points across the pupil; its soft edge keeps areas to 1e-3
_NODES = 160  # nodes of the quadrature; the integrand has less than 30 oscillations


@lru_cache(maxsize=1)
def _nodes() -> tuple[Floats, Floats, Floats]:
    """Return nodes and weights over 0 to 1, and the transfer function at each pair of nodes."""
    node, weight = legendre(_NODES)
    u = 0.5 * (node + 1.0)
    return u, 0.5 * weight, mtf(np.hypot(u[:, None], u))


@lru_cache(maxsize=256)
def _row_spectrum(pixel_cells: float) -> tuple[Floats, Floats]:
    """Return frequencies, in cut-offs, and the spectral weights of a row of pixels' energies."""
    if not pixel_cells > 0:
        raise ValueError(f"a pixel of {pixel_cells} cells")
    u, weight, pupil = _nodes()
    pixel = weight * np.sinc(pixel_cells * u) ** 2
    return u, (16.0 / math.pi) * pixel * (pupil @ pixel)


def pixel_contrast2(pixel_cells: float) -> float:
    """Return the squared contrast of a square pixel: 1 over the number of cells that it sums.

    The spectrum of fully developed speckle is the pupil's transfer function times the area of a
    cell, (4 / pi) (lambda F)^2 (Goodman 2007, 4.4); a square pixel multiplies it by sinc^2 twice.
    One polarisation.

    Args:
        pixel_cells: Pixel pitch over lambda N, above 0; the quadrature is good to 1e-6 up
            to 15.

    Raises:
        ValueError: if ``pixel_cells`` is not positive.
    """
    return float(_row_spectrum(pixel_cells)[1].sum())


def pixel_correlation(pixel_cells: float, lag_px: Floats) -> Floats:
    """Return the correlation of two pixels of a row, or of two rows, ``lag_px`` apart [...].

    Args:
        pixel_cells: Pixel pitch in cells as in ``pixel_contrast2``.
        lag_px: Distance of the pixels, px; the quadrature is good to 1e-6 up to 60 /
            ``pixel_cells``.

    Raises:
        ValueError: if ``pixel_cells`` is not positive.
    """
    u, weight = _row_spectrum(pixel_cells)
    phase = 2.0 * math.pi * pixel_cells * np.asarray(lag_px)[..., None] * u
    return np.asarray((np.cos(phase) @ weight) / weight.sum())


def turn_correlation(pixel_cells: float, turn: Floats) -> Floats:
    """Return the correlation of a pixel's energy before and after the light has turned [n].

    Turned light shifts the scattered field across the pupil, and both exposures share the overlap
    of two discs. A point's energy correlates with the square of the overlap's area, the sum over
    many cells with the area itself (Parseval); a pixel lies between. It is computed as the
    overlap's own autocorrelation, weighted with the pixel's sinc^2 twice.

    Args:
        pixel_cells: Pixel pitch in cells as in ``pixel_contrast2``.
        turn: Change of the light's direction along the row, in pupil diameters over distance [n].

    Raises:
        ValueError: if ``pixel_cells`` is not positive.
    """
    if not pixel_cells > 0:
        raise ValueError(f"a pixel of {pixel_cells} cells")
    size = 2 * _PUPIL_GRID
    place = np.arange(size) - 0.5 * (size - 1)
    frequency = np.fft.fftfreq(size) * size / _PUPIL_GRID
    pixel = np.sinc(pixel_cells * frequency) ** 2
    covariance = []
    for part in np.concatenate([[0.0], np.abs(turn)]):
        shift = 0.5 * min(float(part), 1.0) * _PUPIL_GRID
        overlap = np.ones((size, size))
        for side in (-shift, shift):
            radius = np.hypot(place[:, None], place + side)
            overlap = np.minimum(overlap, np.clip(0.5 * _PUPIL_GRID - radius + 0.5, 0.0, 1.0))
        own = np.fft.irfft2(np.square(np.abs(np.fft.rfft2(overlap))), s=overlap.shape)
        covariance.append(pixel @ own @ pixel)
    return np.asarray(covariance[1:]) / covariance[0]


@lru_cache(maxsize=16)
def _error_factor(cut: float) -> float:
    half = math.sqrt(-2.0 * math.log(cut))
    x = np.linspace(-half, half, 4001)
    profile = np.exp(-0.5 * x * x)
    angle = math.pi * x / half
    shift = np.trapezoid(np.square(profile * np.sin(angle)), x)
    signal = np.trapezoid(profile * np.cos(angle), x)
    return float(half / math.pi * math.sqrt(shift) / signal)


def position_rms_px(
    sigma_px: Floats, contrast: Floats | float, correlation: float, cut: float = 0.05
) -> Floats:
    """Return the position error that speckle adds to a first-harmonic detector, px rms.

    First order in the contrast: gains g_i of variance C^2 move the phase of the window's first
    harmonic of a Gaussian spot by (T / 2 pi) sum f_i g_i sin / sum f_i cos. The window ends where
    the profile falls to ``cut`` of its peak. Neighbours with correlation rho add 1 + 2 rho to the
    variance.

    Leaves out that the gain moves the window's ends, which adds some 5 to 8 % at contrast 0.3, and
    that a spot below s = 2 px changes within a pixel.

    Args:
        sigma_px: Standard deviation of the spot [...].
        contrast: Contrast of a pixel, broadcast with ``sigma_px``.
        correlation: Correlation of neighbouring pixels.
        cut: Threshold over peak.
    """
    scale = _error_factor(cut) * math.sqrt(1.0 + 2.0 * correlation)
    return np.asarray(scale * np.asarray(contrast) * np.sqrt(sigma_px))


def _amounts() -> tuple[Floats, Floats]:
    """Return h and the squared contrast of (1 - h + sqrt(h) z)^3 over its mean, z normal."""
    h = np.concatenate([[0.0], np.geomspace(1e-9, 0.13, 400)])
    variance = 9 * h * (1 - h) ** 4 + 36 * h**2 * (1 - h) ** 2 + 15 * h**3
    return h, variance / (1 - h**3) ** 2


_AMOUNT, _AMOUNT_CONTRAST2 = _amounts()


@lru_cache(maxsize=1)
def _contrasts() -> tuple[Floats, Floats]:
    """Return cells along a pixel and the contrast that averaging over one side of it leaves."""
    cells = np.geomspace(1e-3, _MOST_CELLS, 257)
    return cells, np.array([pixel_contrast2(float(c)) for c in cells]) ** 0.5


def _side_contrast(cells: Floats) -> Floats:
    """Return the factor of the squared contrast that one side of a pixel gives, by its cells [n].

    The squared contrast of a square pixel is taken for a product of two equal factors.
    """
    known, contrast = _contrasts()
    within = np.interp(np.log(np.minimum(cells, _MOST_CELLS)), np.log(known), contrast)
    return np.asarray(within * np.minimum(1.0, _MOST_CELLS / cells))


@lru_cache(maxsize=1)
def _cones() -> tuple[Floats, Floats]:
    """Return the parts of the cone along and across the row [spots, offsets].

    The spots are ``_SPOTS``; offsets go in equal steps from 0 to where a spot's light ends.
    """
    count = 800
    x = (np.arange(count) + 0.5) * 2.0 / count - 1.0
    spot = _SPOTS[:, None]
    chord = np.sqrt(1.0 - np.square(x))
    # Integrals over the chord of the Gaussian and of it times y squared.
    light = spot * math.sqrt(2.0 * math.pi) * erf(chord / (math.sqrt(2.0) * spot))
    second = spot**2 * (light - 2.0 * chord * np.exp(-0.5 * np.square(chord / spot)))
    offset = np.linspace(0.0, 1.0, _OFFSETS) * (1.0 + _END * spot)
    power = -0.5 * np.square((x - offset[:, :, None]) / spot[:, :, None])
    weight = np.exp(power - power.max(axis=2, keepdims=True))
    whole = np.einsum("sox,sx->so", weight, light)
    mean = np.einsum("sox,sx->so", weight, light * x) / whole
    square = np.einsum("sox,sx->so", weight, light * np.square(x)) / whole
    tall = np.einsum("sox,sx->so", weight, second) / whole
    # The rms of a disc is half its radius.
    return 2.0 * np.sqrt(square - np.square(mean)), 2.0 * np.sqrt(tall)


@dataclass(frozen=True)
class Blur:
    """Speckle out of focus, at k nodes beside a spot's middle or one for all; by default, none.

    Attributes:
        along: Width of that part of the cone of light that lights a node, over the whole cone's,
            along the row; the speckle's cells are larger by as much [n, k].
        across: The same across the row [n, k].
        drift_px: Motion of the pattern in the pulse [n, 1].
        node: Place of the pixels between the nodes, 0 to k - 1 [n, width]; None for one node.
    """

    along: Floats | float = 1.0
    across: Floats | float = 1.0
    drift_px: Floats | float = 0.0
    node: Singles | None = None


SHARP = Blur()


def part_of_cone(
    offset_px: Floats, sigma_px: Floats, height_px: Floats, radius_px: Floats
) -> tuple[Floats, Floats]:
    """Return the part of the cone that lights a pixel, along and across the row [n, width].

    A pixel sees the spot through each point of the pupil at another place: on the pupil lies a
    Gaussian of sigma s / a pupil radii, its middle x / a radii off, and the pupil cuts it. The part
    is the rms width of what is left over that of the pupil. A pixel's speckle is nearly that of a
    disc of the same rms: the spectrum of either begins with 1 / (4 pi rms^2).

    Args:
        offset_px: Distance x of the pixels from the spot's middle [n, width].
        sigma_px: Sigma s of the spot's sharp image along the row [n].
        height_px: The same across the row [n].
        radius_px: Radius a of the defocused disc [n].
    """
    tables = _cones()
    radius = np.maximum(radius_px, 1e-6)[:, None]
    found = []
    for table, sigma in zip(tables, (sigma_px, height_px), strict=True):
        spot = np.clip(sigma[:, None] / radius, _SPOTS[0], _SPOTS[-1])
        row = np.log(spot / _SPOTS[0]) / math.log(_SPOTS[1] / _SPOTS[0])
        far = np.minimum(np.abs(offset_px) / (radius + _END * spot * radius), 1.0)
        column = (_OFFSETS - 1) * far
        low = np.minimum(row.astype(np.int64), len(_SPOTS) - 2)
        left = np.minimum(column.astype(np.int64), _OFFSETS - 2)
        down, right = row - low, column - left
        first = table[low, left] + right * (table[low, left + 1] - table[low, left])
        last = table[low + 1, left] + right * (table[low + 1, left + 1] - table[low + 1, left])
        found.append(first + down * (last - first))
    return found[0], found[1]


class Speckle:
    """The gain of every pixel, for any angle of the beam.

    A pixel's sum over M cells is close to gamma distributed with shape M, the inverse squared
    contrast (Goodman 2007, 4.7). A gamma variate is close to the cube of a normal one (Wilson,
    Hilferty 1931), down to M = 1; the constants here are set so that mean and contrast are exact
    for every M, whole or not. The normal variates are a table over pixel and turn with the
    correlation of either; between knots of the turn they are mixed, and the mix is scaled back to
    variance 1, so that contrast and mean are the same everywhere. Coarser patterns have tables of
    their own, made of the same random numbers when they are first needed.

    Leaves out: that from line to line speckle out of focus moves, and changes sooner than sharp
    speckle does; how the distance bends the
    path of the turn (the correlation angle is right to some 30 % on a steep surface); correlations
    between pixels and angles beyond second order, and the third moment (of twelve cells the
    skewness is 0.66, the gamma distribution's 0.58); spots so small, below 2 px, that envelope and
    cells do not part.
    """

    def __init__(
        self,
        seed: int,
        line_length: int,
        lens: ThinLens,
        *,
        wavelength_nm: float,
        pitch_mm: float,
    ) -> None:
        """Make the table, some 30 ms for 2048 pixels.

        Args:
            seed: Seed of the pattern, at least 0; the same seed gives the same pattern.
            line_length: Number of pixels of the sensor.
            lens: Pupil, distance of the sensor and focus.
            wavelength_nm: Wavelength of the laser.
            pitch_mm: Width and height of a pixel.

        Raises:
            ValueError: if a length is not positive.
        """
        if min(line_length, wavelength_nm, pitch_mm, *vars(lens).values()) <= 0:
            raise ValueError("line length, wavelength, pitch and the lens's lengths: above 0")
        self.seed = seed
        self.line_length = line_length
        self.lens = lens
        self.pitch_mm = pitch_mm
        self.cells = pitch_mm / (wavelength_nm * 1e-6 * lens.working)
        knot = np.arange(KNOTS)
        turn = np.arange(0.0, 1.0 + KNOT_STEP, KNOT_STEP)
        fall = turn_correlation(self.cells, turn)
        self._along = np.interp(np.minimum(knot, KNOTS - knot) * KNOT_STEP, turn, fall)
        self._next_knot = float(self._along[1])
        self._half_turn = float(np.interp(-0.5, -fall, turn))
        rng = np.random.Generator(np.random.SFC64(np.random.SeedSequence((seed, _STREAM))))
        self._white = fft.rfft2(rng.standard_normal((KNOTS, line_length), np.float32))
        # Memory is taken as tables are made.
        self._tables = np.empty((_LEVELS, (KNOTS + 4) * line_length), np.float32)
        self._made = np.zeros(_LEVELS, np.bool_)

    def _make(self, level: int) -> None:
        """Make a table of normal variates, its cells ``_LEVEL`` ** ``level`` of the sharp ones.

        A window over the end of a row reads the next row: those pixels are off the sensor.
        """
        length, cells = self.line_length, self.cells / _LEVEL**level
        pixel = np.arange(length)
        lag = np.minimum(pixel, length - pixel)
        near = lag < _CELLS_APART / cells + 2
        across = np.zeros(length)
        across[near] = pixel_correlation(cells, lag[near].astype(float))
        # periodic in turn and pixel: the row and column where it wraps are like any other
        power = np.maximum(np.fft.fft(self._along).real, 0.0)[:, None] * np.maximum(
            np.fft.rfft(across).real, 0.0
        )
        spectrum = np.asarray(np.sqrt(power), np.float32)
        table = fft.irfft2(self._white * spectrum, s=(KNOTS, length))
        self._tables[level] = np.concatenate([table[-1:], table, table[:3]]).ravel()
        self._made[level] = True

    def _start(self, level: Ints) -> Ints:
        """Return where tables begin in the flat array of all, which are made if they are not."""
        there = np.bincount(level.ravel(), minlength=_LEVELS) > 0
        for each in np.flatnonzero(there & ~self._made).tolist():
            self._make(each)
        return level * self._tables.shape[1]

    def blur(
        self,
        offset_px: Floats,
        sigma_px: Floats,
        height_px: Floats,
        radius_px: Floats,
        speed_px: Floats,
        range_mm: Floats,
    ) -> Blur:
        """Return what defocus does to the speckle of n spots.

        As the light turns, a part of the surface lights another part of the pupil, which out of
        focus is another place: the pattern moves by 1 - range / focus of the spot's own motion.

        Args:
            offset_px: Distance of the pixels from the spot's middle [n, width].
            sigma_px: Sigma of the sharp image along the row [n].
            height_px: The same across the row [n].
            radius_px: Radius of the defocused disc [n].
            speed_px: Distance that the spot moves in the pulse [n].
            range_mm: Depth of the surface [n].
        """
        reach = radius_px + _END * np.maximum(sigma_px, height_px) + 1e-6
        nodes = reach[:, None] * np.linspace(0.0, 1.0, _BLURS)
        along, across = part_of_cone(nodes, sigma_px, height_px, radius_px)
        drift = np.abs((1.0 - range_mm / self.lens.focus_mm) * speed_px)
        place = np.abs(offset_px) * ((_BLURS - 1) / reach)[:, None]
        return Blur(along, across, drift[:, None], np.minimum(place, _BLURS - 1).astype(np.float32))

    def contrast(self, looks: Floats | float = 1.0, blur: Blur = SHARP) -> Floats:
        """Return the contrast of a pixel, rms over mean, of the shape of what is given.

        Args:
            looks: Number of independent patterns that are averaged, at least 1; broadcast with
                ``blur``.
            blur: What defocus does; by default the image is sharp. The contrast is that at its
                nodes.
        """
        along = _side_contrast(self.cells * blur.along * np.hypot(1.0, blur.drift_px))
        across = _side_contrast(self.cells * np.asarray(blur.across))
        return np.sqrt(along * across / np.maximum(looks, 1.0))

    @property
    def correlation(self) -> float:
        """Return the correlation of neighbouring pixels of a sharp image."""
        return float(pixel_correlation(self.cells, np.array(1.0)))

    def _level(self, blur: Blur) -> Floats:
        """Return which tables, whole or between two, are as coarse as the light of blur's nodes."""
        finer = np.square(1.0 / np.asarray(blur.along)) + _BOX * np.square(
            self.cells * np.asarray(blur.drift_px)
        )
        return np.clip(0.5 / math.log(_LEVEL) * np.log(finer), 0.0, _LEVELS - 1.0)

    def gain(
        self,
        first_px: Ints,
        width: int,
        angle_rad: Floats,
        looks: Floats | float,
        range_mm: Floats,
        *,
        blur: Blur = SHARP,
        travel_mm: Floats | float = 0.0,
        surface: Ints | int = 0,
    ) -> Singles:
        """Return the gain of each pixel: mean 1, contrast ``contrast``.

        Args:
            first_px: First pixel of each line's window [n]; a window may reach over the sensor's
                ends, the gains there have the right size and no meaning.
            width: Number of pixels of a window.
            angle_rad: Direction of the beam [n].
            looks: Number of independent patterns that surface or light average, [n] or one for all.
            range_mm: Distance from the lens to the surface [n]. Where nothing is hit it may be
                infinite or NaN.
            blur: What defocus does; by default the image is sharp.
            travel_mm: Distance that the scanner has moved along the row's normal [n]; the image
                moves by that times its scale. After 0.56 pixel heights the correlation is 1/2, as
                it should be; after a whole one it is still 0.18, where it should be 0.07.
            surface: Number of the surface hit [n]; each has its own pattern.

        Returns:
            float32 [n, width], at least 0.

        Raises:
            ValueError: if a window is wider than the sensor is long.
        """
        length = self.line_length
        if width > length:
            raise ValueError(f"a window of {width} pixels on a sensor of {length}")
        lines = len(first_px)
        seen = np.isfinite(range_mm) & np.isfinite(angle_rad)
        near = np.where(seen, np.maximum(range_mm, _NEAREST_MM), self.lens.focus_mm)
        turn = np.where(seen, angle_rad, 0.0) * near / self.lens.pupil_mm
        shift_px = travel_mm * self.lens.image_mm / near / self.pitch_mm
        turn = turn + (self._half_turn / _HALF_ROW) * shift_px + _SURFACE_STEP * np.asarray(surface)
        place = np.mod(turn / KNOT_STEP, KNOTS)
        knot = np.floor(place).astype(np.int64)
        part = place - knot
        # rows of the flat table: the knot before, then knots 0 .. KNOTS + 2
        start = (knot % KNOTS + 1) * length + np.clip(first_px, -length, length)

        count = np.broadcast_to(looks, (lines,))[:, None]
        wanted = np.square(self.contrast(count, blur))
        amount = np.interp(wanted, _AMOUNT_CONTRAST2, _AMOUNT)
        # (1 - h + sqrt(h) z)^3 / (1 - h^3), the root of the divisor taken into the brackets
        size = np.cbrt(1.0 - amount**3)
        # between knots, both are mixed and the mix is scaled back to variance 1
        mixed = np.sqrt((1 - part) ** 2 + part**2 + 2 * part * (1 - part) * self._next_knot)
        nodes = [
            np.asarray(np.broadcast_to(each, amount.shape), np.float32)
            for each in (np.sqrt(amount) / size, (1.0 - amount) / size, self._level(blur))
        ]
        low, high = (np.asarray(share / mixed, np.float32)[:, None] for share in (1.0 - part, part))

        result = np.empty((lines, width), np.float32)
        pixel = np.arange(width)
        step = max(1, _CHUNK // max(1, width))
        for line in range(0, lines, step):
            some = slice(line, line + step)
            spread, middle, level = (
                each[some] if blur.node is None else _between(each[some], blur.node[some])
                for each in nodes
            )
            which = np.rint(level).astype(np.int64)
            at = self._start(which) + start[some, None] + pixel
            flat = self._tables.ravel()
            root = flat.take(at)
            root *= low[some]
            at += length
            after = flat.take(at)
            after *= high[some]
            root += after
            root *= spread
            root += middle
            np.maximum(root, np.float32(0.0), out=root)
            np.multiply(root, root, out=after)
            np.multiply(after, root, out=result[some])
        return result


def _between(nodes: Singles, place: Singles) -> Singles:
    """Return the values at places between nodes [n, width] of values at these [n, k]."""
    count = nodes.shape[1]
    left = np.minimum(place.astype(np.int32), count - 2)
    part = place - left
    at = left + (count * np.arange(len(nodes), dtype=np.int32))[:, None]
    flat = nodes.ravel()
    found: Singles = flat.take(at)
    part *= flat.take(at + 1) - found
    found += part
    return found
