"""Speckle of the imaged spot: each pixel's gain, and its effect on a position.

Light from a rough surface reaches a pixel as a sum of many random phasors. In the image the field
is the beam's envelope times a circular Gaussian field whose cell is set by the lens alone, about
lambda F (1 + m) wide (Goodman, Speckle Phenomena in Optics, 2007, chapters 3 to 5). That cell is
smaller than a pixel, so a pixel sums some nine of them and its gain has a contrast near 0.3.

The pattern is tied to the surface. While neither surface nor camera moves, a pixel keeps its gain
as the beam's envelope passes over it, until the light's direction has turned so far that another
part of the scattered field falls into the pupil: by D / R, pupil over distance. So a gain is a
function only of the pixel and of the turn in units of D / R.
"""

import math
from functools import lru_cache

import numpy as np
import numpy.typing as npt
from numpy.lib.stride_tricks import sliding_window_view

from vrscan.data.arrays import Floats, Ints
from vrscan.scene.radiometry import mtf

Singles = npt.NDArray[np.float32]

KNOTS = 512  # knots of the turn; the pattern repeats after 32 times D / R, which a pixel never sees
KNOT_STEP = 0.0625  # D / R; the correlation from knot to knot is some 0.9
_SURFACE_STEP = 23.0  # D / R between surfaces: 32 of them are D / R or more apart
_HALF_ROW = 0.56  # pixel heights of motion that halve the correlation of a row's sum
_STREAM = 0x73706563  # separates these random numbers from others of the same seed
_LEAST_CLEARANCE = 1.05  # focal lengths; nearer objects have no image and count as at this distance
_TABLE_RANGE_MM = 400.0  # distance whose correlation of neighbours is used for all
_CELLS_APART = 6.0  # distance from which on cells are uncorrelated
_CHUNK = 1 << 14  # pixels computed at a time, so that the data stay in the cache
_PUPIL_GRID = 64  # grid points across the pupil; its soft edge keeps areas to 1e-3
_NODES = 160  # nodes of the quadrature; the integrand has less than 30 oscillations


@lru_cache(maxsize=1)
def _nodes() -> tuple[Floats, Floats, Floats]:
    """Return nodes and weights over 0 to 1, and the transfer function at each pair of nodes."""
    node, weight = np.polynomial.legendre.leggauss(_NODES)
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
        pixel_cells: Pixel pitch over lambda F (1 + m), above 0; the quadrature is good to 1e-6 up
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


def dorsch_px(
    contrast: float, wavelength_nm: float, f_number: float, magnification: float, pitch_mm: float
) -> float:
    """Return the position error of a resolved point, px: C lambda / (2 pi sin u').

    Dorsch, Haeusler, Herrmann, Laser triangulation: fundamental uncertainty in distance
    measurement, 1994. It is the least that a centroid over a whole, unresolved spot reaches; a spot
    of several pixels, cut out of one row, errs more, see ``position_rms_px``.
    """
    sine = 1.0 / (2.0 * f_number * (1.0 + magnification))
    return contrast * wavelength_nm * 1e-6 / (2.0 * math.pi * sine) / pitch_mm


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


class Speckle:
    """The gain of every pixel, for any angle of the beam.

    A pixel's sum over M cells is close to gamma distributed with shape M, the inverse squared
    contrast (Goodman 2007, 4.7). A gamma variate is close to the cube of a normal one (Wilson,
    Hilferty 1931), down to M = 1; the constants here are set so that mean and contrast are exact
    for every M, whole or not. The normal variates are a table over pixel and turn with the
    correlation of either; between knots of the turn they are mixed, and the mix is scaled back to
    variance 1, so that contrast and mean are the same everywhere.

    Leaves out: that speckle of a defocused image moves as the light's direction turns; how the
    distance bends the path of the turn (the correlation angle is right to some 30 % on a steep
    surface); correlations between pixels and angles beyond second order, and the third moment (of
    twelve cells the skewness is 0.66, the gamma distribution's 0.58); spots so small, below 2 px,
    that envelope and cells do not part; the polarisation, which ``looks`` = 2 states.
    """

    def __init__(
        self,
        seed: int,
        line_length: int,
        *,
        wavelength_nm: float,
        focal_mm: float,
        f_number: float,
        pitch_mm: float,
    ) -> None:
        """Make the table, some 30 ms for 2048 pixels.

        Args:
            seed: Seed of the pattern, at least 0; the same seed gives the same pattern.
            line_length: Number of pixels of the sensor.
            wavelength_nm: Wavelength of the laser.
            focal_mm: Focal length of the lens.
            f_number: f-number of the lens for an object far away.
            pitch_mm: Width and height of a pixel.

        Raises:
            ValueError: if a length is not positive.
        """
        if min(line_length, wavelength_nm, focal_mm, f_number, pitch_mm) <= 0:
            raise ValueError("line length, wavelength, focal length, f-number, pitch: above 0")
        self.line_length = line_length
        self.focal_mm = focal_mm
        self.pitch_mm = pitch_mm
        self.pupil_mm = focal_mm / f_number
        self._far_cells = pitch_mm / (wavelength_nm * 1e-6 * f_number)
        # contrast against clearance = 1 - f / R, to which the cells of a pixel are proportional
        self._clearance = np.linspace(1.0 - 1.0 / _LEAST_CLEARANCE, 1.0, 65)
        self._contrast2 = np.array(
            [pixel_contrast2(self._far_cells * float(c)) for c in self._clearance]
        )
        knot = np.arange(KNOTS)
        cells = self._far_cells * (1.0 - focal_mm / _TABLE_RANGE_MM)
        turn = np.arange(0.0, 1.0 + KNOT_STEP, KNOT_STEP)
        fall = turn_correlation(cells, turn)
        along = np.interp(np.minimum(knot, KNOTS - knot) * KNOT_STEP, turn, fall)
        self._next_knot = float(along[1])
        self._half_turn = float(np.interp(-0.5, -fall, turn))
        pixel = np.arange(line_length)
        lag = np.minimum(pixel, line_length - pixel)
        near = lag < _CELLS_APART / cells + 2
        across = np.zeros(line_length)
        across[near] = pixel_correlation(cells, lag[near].astype(float))
        # periodic in turn and pixel, so that the row and column where it wraps are like any other
        power = np.maximum(np.fft.fft(along).real, 0.0)[:, None] * np.maximum(
            np.fft.rfft(across).real, 0.0
        )
        spectrum = np.asarray(np.sqrt(power), np.float32)
        rng = np.random.Generator(np.random.SFC64(np.random.SeedSequence((seed, _STREAM))))
        white = rng.standard_normal((KNOTS, line_length), np.float32)
        mixed = np.fft.rfft2(white) * spectrum
        table = np.asarray(np.fft.irfft2(mixed, s=white.shape), np.float32)
        # a window over the end of a row reads the next row: those pixels are off the sensor
        self._flat = np.concatenate([table[-1], table.ravel(), table[0], table[1], table[2]])

    def contrast(self, range_mm: Floats, looks: Floats | float = 1.0) -> Floats:
        """Return the contrast of a pixel, rms over mean [n].

        Args:
            range_mm: Distance from the lens to the surface [n]; nearer than the focal length
                counts as 1.05 focal lengths.
            looks: Number of independent patterns that are averaged, at least 1.
        """
        cells = np.interp(self._part(range_mm), self._clearance, self._contrast2)
        return np.asarray(np.sqrt(cells / np.maximum(looks, 1.0)))

    def correlation(self, range_mm: float) -> float:
        """Return the correlation of neighbouring pixels.

        The table has that of 400 mm at every distance; at 150 mm it is some 6 % larger, at 1 m 4 %
        smaller.
        """
        part = float(self._part(np.array([range_mm]))[0])
        return float(pixel_correlation(self._far_cells * part, np.array(1.0)))

    def gain(
        self,
        first_px: Ints,
        width: int,
        angle_rad: Floats,
        looks: Floats | float,
        range_mm: Floats,
        *,
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
            travel_mm: Distance that the scanner has moved along the row's normal [n]; the image
                moves by that times f / (R - f). After 0.56 pixel heights the correlation is 1/2, as
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
        distance = np.maximum(
            np.where(np.isfinite(range_mm), range_mm, np.inf), _LEAST_CLEARANCE * self.focal_mm
        )
        seen = np.isfinite(distance) & np.isfinite(angle_rad)
        near = np.where(seen, distance, 2.0 * self.focal_mm)
        turn = np.where(seen, angle_rad, 0.0) * near / self.pupil_mm
        shift_px = travel_mm * self.focal_mm / (near - self.focal_mm) / self.pitch_mm
        turn = turn + (self._half_turn / _HALF_ROW) * shift_px + _SURFACE_STEP * np.asarray(surface)
        place = np.mod(turn / KNOT_STEP, KNOTS)
        knot = np.floor(place).astype(np.int64)
        part = place - knot
        # rows of the flat table: the knot before, then knots 0 .. KNOTS + 2
        start = (knot % KNOTS + 1) * length + np.clip(first_px, -length, length)

        wanted = np.square(self.contrast(distance, looks))
        amount = np.interp(wanted, _AMOUNT_CONTRAST2, _AMOUNT)
        # (1 - h + sqrt(h) z)^3 / (1 - h^3), the root of the divisor taken into the brackets
        size = np.cbrt(1.0 - amount**3)
        spread = np.sqrt(amount) / size
        spread /= np.sqrt((1 - part) ** 2 + part**2 + 2 * part * (1 - part) * self._next_knot)
        middle = np.asarray((1.0 - amount) / size, np.float32)
        low = np.asarray(spread * (1.0 - part), np.float32)
        high = np.asarray(spread * part, np.float32)

        windows = sliding_window_view(self._flat, width)
        result = np.empty((lines, width), np.float32)
        step = max(1, _CHUNK // max(1, width))
        for line in range(0, lines, step):
            some = slice(line, line + step)
            root = windows[start[some]]
            root *= low[some, None]
            after = windows[start[some] + length]
            after *= high[some, None]
            root += after
            root += middle[some, None]
            np.maximum(root, np.float32(0.0), out=root)
            np.multiply(root, root, out=after)
            np.multiply(after, root, out=result[some])
        return result

    def _part(self, range_mm: Floats) -> Floats:
        """Return 1 - f / R, to which the cells of a pixel are proportional."""
        distance = np.fmax(range_mm, _LEAST_CLEARANCE * self.focal_mm)
        return np.asarray(1.0 - self.focal_mm / distance)
