"""Lines of a rough surface in coherent light, by wave optics: the oracle of speckle.

The light goes from the surface to the pupil and from there to the sensor, each over its own
distance; the lens's phase is that of its focal length. No size of a cell, no scale and no blur is
assumed: they are what this comes to.
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy import fft

from vrscan.data.arrays import Floats

WAVELENGTH_MM = 658e-6
FOCAL_MM = 25.0
PUPIL_MM = FOCAL_MM / 3.0
PITCH_MM = 0.007
PER_PIXEL = 8  # grid points


@dataclass(frozen=True)
class Bench:
    """A surface and a lens that is focused at some distance."""

    range_mm: float = 400.0
    focus_mm: float = 400.0

    @property
    def image_mm(self) -> float:
        """Return the sensor's distance by the thin lens equation."""
        return 1.0 / (1.0 / FOCAL_MM - 1.0 / self.focus_mm)

    @property
    def scale(self) -> float:
        """Return a length in the image over that on the surface: by rays through the middle."""
        return self.image_mm / self.range_mm

    @property
    def radius_px(self) -> float:
        """Return the radius of the disc of rays from one point: by similar triangles."""
        sharp = 1.0 / (1.0 / FOCAL_MM - 1.0 / self.range_mm)
        return 0.5 * PUPIL_MM * abs(sharp - self.image_mm) / sharp / PITCH_MM


SHARP = Bench()


def coherent_rows(
    rng: np.random.Generator,
    sigma_px: float,
    half: int,
    trials: int,
    *,
    bench: Bench = SHARP,
    rows: int = 16,
    height_px: float | None = None,
    cycles: float = 0.0,
    shift_px: float = 0.0,
    centre_px: float = 0.0,
    pulse_px: float = 0.0,
    steps: int = 1,
) -> Floats:
    """Return the pixels' energies of sensor rows across a spot, [trials * kept rows, 2 half + 1].

    A surface of random scatterers, many to a resolved cell, is lit by a Gaussian beam.

    Args:
        rng: Source of all random numbers.
        sigma_px: Sigma of the spot in a sharp image along the row.
        half: Pixels on either side of the middle one.
        trials: Number of surfaces.
        bench: Distances of surface and focus.
        rows: Number of rows of the field, with ``height_px`` = None all of them kept: the spot is
            then even across the row, so every row is a trial.
        height_px: Sigma across the row, a few pixels; the three rows in the middle are kept.
        cycles: Tilt of the light, fringes across the field.
        shift_px: Motion of the surface across the row.
        centre_px: Place of the beam, from the middle pixel.
        pulse_px: Distance that the beam goes in the pulse; the light turns by that over the range.
        steps: Moments of the pulse.
    """
    step = PITCH_MM / bench.scale / PER_PIXEL  # on the surface
    columns, lines = (2 * half + 1) * PER_PIXEL, rows * PER_PIXEL
    x, y = (((np.arange(n) + 0.5) - n / 2) * step for n in (columns, lines))
    to_px = bench.scale / PITCH_MM
    wave = 2.0 * math.pi / WAVELENGTH_MM
    # Place on the pupil of each direction: it comes from the surface's distance.
    u = WAVELENGTH_MM * bench.range_mm * np.hypot(
        np.fft.fftfreq(columns, step), np.fft.fftfreq(lines, step)[:, None]
    )  # fmt: skip
    bend = 1.0 / bench.range_mm + 1.0 / bench.image_mm - 1.0 / FOCAL_MM
    lens = np.where(u <= 0.5 * PUPIL_MM, np.exp(0.5j * wave * bend * np.square(u)), 0.0)
    # each sample of the image's energy stands for its square, not for a point
    area = np.sinc(np.fft.rfftfreq(columns)) * np.sinc(np.fft.fftfreq(lines))[:, None]
    tall = np.ones(lines) if height_px is None else np.exp(-np.square(y * to_px / height_px) / 4)
    moments = ((np.arange(steps) + 0.5) / steps - 0.5) * pulse_px
    beams = []
    for moment in moments:
        beam = np.exp(-np.square((x * to_px - centre_px - moment) / sigma_px) / 4)
        turn = moment / to_px / bench.range_mm
        tilt = wave * turn * x + 2.0 * math.pi * cycles * np.arange(columns) / columns
        beams.append((beam * np.exp(1j * tilt)).astype(np.complex64))
    lens, area = lens.astype(np.complex64), area.astype(np.float32)
    found = []
    for _ in range(trials):
        real, imaginary = rng.standard_normal((2, lines, columns), np.float32)
        surface = np.roll(real + 1j * imaginary, round(shift_px * PER_PIXEL), axis=0)
        surface *= tall.astype(np.float32)[:, None]
        energy = np.zeros((lines, columns), np.float32)
        for beam in beams:
            energy += np.square(np.abs(fft.ifft2(fft.fft2(surface * beam) * lens)))
        energy = fft.irfft2(fft.rfft2(energy) * area, s=energy.shape)
        cut = energy.reshape(rows, PER_PIXEL, 2 * half + 1, PER_PIXEL).sum(axis=(1, 3))
        found.append(cut if height_px is None else cut[rows // 2 - 1 : rows // 2 + 2])
    return np.concatenate(found).astype(np.float64)
