"""Lines of a rough surface in coherent light, by wave optics: the oracle of speckle."""

import math

import numpy as np

from vrscan.data.arrays import Floats

RANGE_MM = 400.0
CELL_UM = 0.658 * 3.0 / (1.0 - 25.0 / RANGE_MM)  # lambda F (1 + m)
PITCH_UM = 7.0
PER_PIXEL = 8  # grid points


def coherent_rows(
    rng: np.random.Generator,
    sigma_px: float,
    half: int,
    trials: int,
    *,
    rows: int = 16,
    cycles: int = 0,
    shift_px: float = 0.0,
    centre_px: float = 0.0,
) -> Floats:
    """Return the pixels' energies of many sensor rows across a spot, [trials * rows, 2 half + 1].

    A surface of random scatterers, many to a resolved cell, lit by a Gaussian beam and imaged by a
    circular pupil, coherently. The spot is tall (sigma is 14 um and more, a row 7 um), so along
    the rows' normal it is even and every row of the image is a trial. ``cycles`` tilts the
    light by so many fringes across the field, ``shift_px`` moves the surface along the normal, and
    ``centre_px`` the beam away from the middle pixel.
    """
    step = PITCH_UM / PER_PIXEL
    columns = (2 * half + 1) * PER_PIXEL
    x = (np.arange(columns) + 0.5 - columns / 2) * step
    beam = np.exp(-np.square((x / PITCH_UM - centre_px) / sigma_px) / 4)
    fx = np.fft.fftfreq(columns, step)
    fy = np.fft.fftfreq(rows * PER_PIXEL, step)
    pupil = np.hypot(fx, fy[:, None]) <= 0.5 / CELL_UM
    tilt = np.exp(2j * math.pi * cycles * np.arange(columns) / columns)
    lit = beam * tilt
    # each sample stands for its square, not for a point
    area = np.sinc(fx * step) * np.sinc(fy * step)[:, None]
    found = []
    for _ in range(trials):
        real, imaginary = rng.standard_normal((2, rows * PER_PIXEL, columns))
        surface = np.roll(real + 1j * imaginary, round(shift_px * PER_PIXEL), axis=0)
        image = np.fft.ifft2(np.fft.fft2(surface * lit) * pupil)
        energy = np.fft.ifft2(np.fft.fft2(np.square(np.abs(image))) * area).real
        cut = energy.reshape(rows, PER_PIXEL, 2 * half + 1, PER_PIXEL)
        found.append(cut.sum(axis=(1, 3)))
    return np.concatenate(found)
