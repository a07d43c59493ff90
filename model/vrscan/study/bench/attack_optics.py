"""The optics of ``vrscan bench attack``: coherent light on a line of pixels, apart from the scene.

The light of rough surfaces is a complex circular Gaussian field that a round aperture filters (J.
W. Goodman, *Speckle Phenomena in Optics*, 2007). Nothing here is the renderer's: what both leave
out alike is what physics leaves out.
"""

import math

import numpy as np
from scipy import fft

from vrscan.data.arrays import Floats, Pixels
from vrscan.data.config import Config

OVERSAMPLE = 8  # points a pixel, along the line and across it
PITCH_UM, WAVELENGTH_UM = 7.0, 0.658
OFFSET, READ_NOISE = 60.0, 3.0  # counts of 12 bits
_FREQUENCIES = 4  # at least, across the line on either side of 0
_CHUNK = 16  # lines computed at a time: they fit in a cache


def cutoff(f_number: float) -> float:
    """Return the largest spatial frequency of a field behind an aperture, cycles a pixel."""
    return PITCH_UM / (2.0 * WAVELENGTH_UM * f_number)


def pixels(samples: Floats) -> Floats:
    """Return the mean of the samples of each pixel [n, m] of [n, m * OVERSAMPLE]."""
    return np.asarray(samples.reshape(len(samples), -1, OVERSAMPLE).mean(axis=2))


def speckled(mean: Floats, f_number: float, looks: int, rng: np.random.Generator) -> Floats:
    """Return the light that falls on pixels of a square row, speckled [n, m].

    A field of random phases has the mean light's amplitude on the surface, and the aperture lets
    pass what is below its cutoff, which blurs the light by the aperture's diffraction. The field
    repeats beyond the ends of a line, and across the line, after several grains.

    Leaves out aberrations, the pixels' gaps and polarisation other than as looks.

    Args:
        mean: Mean light, any unit, even across the row [n, m * OVERSAMPLE].
        f_number: F number on the sensor's side; a grain is the wavelength times this long.
        looks: Number of independent patterns whose mean is taken.
        rng: Source of all random numbers.
    """
    count, length = mean.shape
    period = math.ceil(_FREQUENCIES / cutoff(f_number))  # across the line, px
    most = math.floor(cutoff(f_number) * period)
    across = np.arange(-most, most + 1) / period
    along = np.fft.fftfreq(length, 1.0 / OVERSAMPLE)
    aperture = np.hypot(along, across[:, None]) <= cutoff(f_number)
    # A unit field has a unit mean of light.
    passed = (aperture / math.sqrt(2.0 * looks * aperture.sum() / length)).astype(np.float32)
    turns = np.outer((np.arange(OVERSAMPLE) + 0.5) / OVERSAMPLE, across)
    phases = np.exp(2j * np.pi * turns).astype(np.complex64)
    amplitude = np.sqrt(mean).astype(np.float32)
    light = np.zeros((count, length // OVERSAMPLE))
    for start in range(0, count, _CHUNK):
        some = slice(start, start + _CHUNK)
        for _ in range(looks):
            own = amplitude[some, None]
            real, imaginary = rng.standard_normal((2, len(own), len(across), length), np.float32)
            field = fft.ifft(fft.fft((real + 1j * imaginary) * own) * passed)
            rows = np.einsum("yk,nkx->nyx", phases, field, optimize=True)
            light[some] += pixels(np.square(np.abs(rows)).mean(axis=1))
    return light


def exposed(
    light: Floats, first: Floats, peak: float, config: Config, rng: np.random.Generator
) -> Pixels:
    """Return the counts of whole lines [n, line length]: shot and read noise, offset, converter.

    Leaves out dark current, fixed pattern and stray light.

    Args:
        light: Light of the pixels, 1 is ``peak`` [n, m].
        first: Number of the first of them, all on the line [n].
        peak: Counts.
        config: Sensor and counts per electron.
        rng: Source of all random numbers.
    """
    kappa = config.peak.kappa
    counts = dark(len(light), OFFSET, config, rng)
    place = first.astype(np.int64)[:, None] + np.arange(light.shape[1])
    own = np.take_along_axis(counts, place, axis=1)
    np.put_along_axis(counts, place, own + kappa * rng.poisson(light * (peak / kappa)), axis=1)
    return converted(counts, config)


def unit(config: Config) -> float:
    """Return the counts of the sensor's converter that are one of 12 bits."""
    return 2.0 ** (config.sensor.pixel_width - 12)


def dark(count: int, offset: float, config: Config, rng: np.random.Generator) -> Floats:
    """Return offset, counts of 12 bits, and read noise of lines before the converter."""
    noise = rng.standard_normal((count, config.sensor.line_length))
    return np.asarray((offset + READ_NOISE * noise) * unit(config))


def converted(counts: Floats, config: Config) -> Pixels:
    """Return counts as the converter rounds and clips them."""
    full = 2**config.sensor.pixel_width - 1
    return np.clip(np.floor(counts + 0.5), 0, full).astype(np.uint16)
