"""A cut beam carried by 2-D FFT or by quadrature, and the row that its spot makes: its oracle."""

import math

import numpy as np
from scipy import fft
from scipy.special import j0, j1

from vrscan.data.arrays import Floats
from vrscan.data.config import Config
from vrscan.ideal.geometry import project
from vrscan.scene import beam
from vrscan.scene.beam import Laser

PER_PX = 8  # points of the camera's point spread in a pixel
_HALF_PX = 128  # its reach
# Part of the irradiance that is imaged, along and across: what is beyond 4 mm, on a plate that is
# ten times brighter, moves the row by 0.1 px at 1 m.
_COLUMNS_MM, _LINES_MM = 14.0, 8.5
_GRID_MM = 0.0166


def carried(laser: Laser, z: float, pixel: float, size: int) -> tuple[Floats, Floats]:
    """Carry the cut beam over z by its angular spectrum.

    Returns:
        The grid's axis in mm and the share of the power in each of its cells [size, size].
    """
    axis: Floats = (np.arange(size, dtype=np.float64) - size // 2) * pixel
    square = np.square(axis)[:, None] + np.square(axis)
    at_stop, bend, passed = _at_stop(laser)
    field = np.exp(-square / at_stop**2 - 1j * math.pi / laser.wavelength_mm * bend * square)
    # Cells on the stop's edge pass the part of the field that they are inside with.
    field *= np.clip((0.5 * laser.aperture_mm - np.sqrt(square)) / pixel + 0.5, 0.0, 1.0)
    f = np.fft.fftfreq(size, pixel)
    turn = -math.pi * laser.wavelength_mm * z * (np.square(f)[:, None] + np.square(f))
    out = np.square(np.abs(fft.ifft2(fft.fft2(field) * np.exp(1j * turn))))
    return axis, out * pixel**2 / (0.5 * math.pi * at_stop**2 * passed)


def _at_stop(laser: Laser) -> tuple[float, float, float]:
    """Return the beam's 1/e2 radius and curvature at the stop, and the share that passes it."""
    rayleigh = beam.rayleigh_mm(laser)
    radius = 0.5 * laser.beam_diameter_mm * math.hypot(1.0, laser.waist_mm / rayleigh)
    bend = laser.waist_mm / (laser.waist_mm**2 + rayleigh**2)
    return radius, bend, 1.0 - math.exp(-0.5 * (laser.aperture_mm / radius) ** 2)


def irradiance(laser: Laser, z: float, r: Floats) -> Floats:
    """Return the share of the power per mm2 at distances from the axis, by Fresnel's integral [n].

    Unlike a grid of the FFT, the quadrature has no end from which light comes back.
    """
    at_stop, bend, passed = _at_stop(laser)
    node, weight = np.polynomial.legendre.leggauss(600)
    rho = 0.25 * laser.aperture_mm * (node + 1.0)
    wave = math.pi / (laser.wavelength_nm * 1e-6)
    field = np.exp(-np.square(rho / at_stop) + 1j * wave * (1.0 / z - bend) * np.square(rho))
    ring = field * rho * weight * 0.25 * laser.aperture_mm
    found = 2.0 * wave / z * (j0(2.0 * wave / z * r[:, None] * rho) @ ring)
    return np.asarray(np.square(np.abs(found)) / (0.5 * math.pi * at_stop**2 * passed))


class CarriedSpot:
    """The spot of a cut beam on an upright plane, imaged on one row, by sums in two dimensions.

    Each point of the plane makes a disc out of focus, blurred by diffraction along the row and cut
    into pixels; the row is one of them high.
    """

    def __init__(self, laser: Laser, z: float, config: Config, disc_px: float, cutoff: float):
        """Carry the beam and image it.

        Args:
            laser: The laser.
            z: Distance of the plane, mm.
            config: The instrument.
            disc_px: Radius of the lens's disc.
            cutoff: Limit of the pupil's transfer, cycles per pixel.
        """
        self._z, self._geometry = z, config.geometry
        self.axis, across = (
            _GRID_MM * np.arange(-(end // _GRID_MM), end // _GRID_MM + 1.0)
            for end in (_COLUMNS_MM, _LINES_MM)
        )
        r = np.arange(0.0, math.hypot(_COLUMNS_MM, _LINES_MM) + 0.01, 0.002)
        light = np.interp(np.hypot(across[:, None], self.axis), r, irradiance(laser, z, r))
        f = np.fft.fftfreq(2 * _HALF_PX * PER_PX, 1.0 / PER_PX)
        turn = 2.0 * math.pi * disc_px * np.hypot(f[:, None], f)
        turn[0, 0] = 1e-9
        part = np.minimum(np.abs(f) / cutoff, 1.0)
        pupil = 2.0 / math.pi * (np.arccos(part) - part * np.sqrt(1.0 - part**2))
        spread = 2.0 * j1(np.maximum(turn, 1e-9)) / np.maximum(turn, 1e-9)
        spread = spread * np.sinc(f)[:, None] * np.sinc(f) * pupil
        spread = np.fft.fftshift(fft.ifft2(spread).real) * PER_PX**2
        self._place = np.arange(len(f)) / PER_PX - _HALF_PX
        height = across * self._px_per_mm()
        low = np.clip(((height + _HALF_PX) * PER_PX).astype(int), 0, len(f) - 2)
        share = ((height - self._place[low]) * PER_PX)[:, None]
        rows = spread[low] * (1.0 - share) + spread[low + 1] * share
        self._columns = light.T @ rows * _GRID_MM**2

    def _depth(self, x_mm: Floats) -> Floats:
        sine, cosine = math.sin(self._geometry.bias_rad), math.cos(self._geometry.bias_rad)
        return np.asarray((self._geometry.base_mm - x_mm) * cosine + self._z * sine)

    def _px_per_mm(self) -> float:
        geometry = self._geometry
        return geometry.focal_mm / geometry.pitch_mm / float(self._depth(np.zeros(1))[0])

    def row(self, x_mm: float, low: float, pixels: Floats) -> Floats:
        """Return the row's light at pixels, of 1 in all that the lens gets from a plane at x = 0.

        Args:
            x_mm: Place of the beam's axis.
            low: Reflectance of the plane at negative x, over that at positive x.
            pixels: Numbers of the pixels.
        """
        x = self.axis + x_mm
        cell = x[1] - x[0]
        bright = low + (1.0 - low) * np.clip(x / cell + 0.5, 0.0, 1.0)
        base = self._geometry.base_mm

        def collected(x: Floats) -> Floats:  # of a matt plane, by a pupil seen from the side
            return np.asarray(self._depth(x) / np.square(np.square(base - x) + self._z**2))

        bright = bright * collected(x) / collected(np.zeros(1))
        place = project(x, np.full(len(x), self._z), self._geometry)
        found = np.zeros(len(pixels))
        for weight, middle, column in zip(bright, place, self._columns, strict=True):
            found += weight * np.interp(pixels - middle, self._place, column, 0.0, 0.0)
        return found
