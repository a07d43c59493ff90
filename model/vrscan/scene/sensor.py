"""From a spot on the sensor to counts: pixel integration, noise, fixed pattern, the converter.

``spot_electrons`` and ``expose`` are a sensor with independent noise in each call. The others, from
``SensorModel`` on, belong to the light simulator: their random numbers are one 16-bit word for each
pixel and line, the same whatever else is modelled, so that two runs of a scene differ only by the
effects that one of them leaves out.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated

import numpy as np
import numpy.typing as npt
from pydantic import Field
from scipy.special import erf, ndtri

from vrscan.data.arrays import Floats, Pixels
from vrscan.data.config import Positive, Section

REACH = 8.0  # spot sigmas beyond which a Gaussian is below 1e-14 of its peak

WORDS = 1 << 16  # number of values of a random word

# One number each keeps the random numbers of different uses apart. None is small: SeedSequence
# takes (seed, use) and (seed, use, 0) for the same.
_NOISE_STREAM = 0x6E6F6973
_PATTERN_STREAM = 0x70617474

LEAST_VARIANCE = 1e-12  # e^2; keeps 0 / 0 from a sensor without light and read noise

SPILL_REACH = 16.0  # 1/e lengths of the spill; 1e-7 is left there

_CHUNK = 1 << 15  # pixels computed at a time, so that the data stay in the cache

Singles = npt.NDArray[np.float32]
Share = Annotated[float, Field(ge=0, le=1)]
NotNegative = Annotated[float, Field(ge=0)]


def spot_electrons(
    position_px: Floats, sigma_px: Floats, peak_electrons: Floats, line_length: int
) -> Floats:
    """Return the mean electrons that Gaussian spots put into each pixel.

    Leaves out speckle, skew and motion during the pulse.

    Args:
        position_px: Centre of each spot [n]; pixel i is centred at i. NaN means no spot.
        sigma_px: Standard deviation of each spot [n].
        peak_electrons: Electrons that a pixel would hold at the spot's peak irradiance [n].
        line_length: Number of pixels of a line.

    Returns:
        Mean electrons [n, line_length].
    """
    electrons = np.zeros((len(position_px), line_length))
    rows = np.flatnonzero(np.isfinite(position_px))
    if len(rows) == 0:
        return electrons
    centre, sigma = position_px[rows], sigma_px[rows]
    reach = math.ceil(REACH * float(sigma.max()))
    first = np.round(centre).astype(np.int64) - reach
    edges = first[:, None] + np.arange(2 * reach + 2)
    scaled = (edges - 0.5 - centre[:, None]) / (math.sqrt(2.0) * sigma[:, None])
    area = 0.5 * np.diff(erf(scaled), axis=1)
    area *= (peak_electrons[rows] * sigma * math.sqrt(2.0 * math.pi))[:, None]
    pixel = edges[:, :-1]
    inside = (pixel >= 0) & (pixel < line_length)
    row = np.broadcast_to(rows[:, None], pixel.shape)
    electrons[row[inside], pixel[inside]] = area[inside]
    return electrons


def expose(
    electrons: Floats,
    rng: np.random.Generator,
    *,
    background_counts: float,
    read_noise_counts: float,
    kappa: float,
    pixel_width: int,
) -> Pixels:
    """Return the counts that a converter makes of the light.

    Leaves out fixed pattern, dark current and crosstalk.

    Args:
        electrons: Mean electrons of the spot [n, length].
        rng: Source of all noise.
        background_counts: Mean of even light, counts; it also has shot noise.
        read_noise_counts: Standard deviation of the read noise, counts.
        kappa: Counts per electron.
        pixel_width: Bits of a pixel; counts end at 0 and 2**pixel_width - 1.

    Returns:
        Counts, uint16 [n, length].
    """
    shot = rng.poisson(electrons + background_counts / kappa)
    read = read_noise_counts * rng.standard_normal(electrons.shape)
    counts = np.floor(shot * kappa + read + 0.5)
    return np.clip(counts, 0, 2**pixel_width - 1).astype(np.uint16)


def cramer_rao_variance(
    electrons: Floats, slope: Floats, dark_variance: Floats | float, contrast: Floats | float = 0.0
) -> Floats:
    """Return the least variance of a position estimate, px^2 [n].

    1 / sum_i (df_i / dmu)^2 / (b^2 + f_i + C^2 f_i^2), f_i in electrons, b^2 the variance of a
    pixel without the spot: read noise, background and converter step (Winick 1986). Speckle of
    contrast C multiplies the light of each pixel by a gain of variance C^2. With gamma distributed
    gains the counts of shot noise are negative binomial, whose information about their mean is the
    inverse variance; with read noise too, the counts tell a little more than that.

    Leaves out that neighbours share a part of their speckle.

    Args:
        electrons: Mean electrons f_i of the spot [n, length].
        slope: df_i / dmu, electrons per px [n, length].
        dark_variance: b^2, electrons squared, of each pixel or one for all.
        contrast: C of a pixel's speckle, [n] or one for all.
    """
    gains = np.square(np.expand_dims(contrast, -1) * electrons)
    return np.asarray(1.0 / (np.square(slope) / (dark_variance + electrons + gains)).sum(axis=1))


class SensorModel(Section):
    """The sensor's physical part, ``[sensor]`` of a scene.

    It leaves out lag, crosstalk of optical and electrical origin, nonlinearity below full well,
    column noise of the converter, and temperature. With anti-blooming and a settled converter these
    are below 1 % of the signal of a neighbouring pixel or line; crosstalk of 1 % widens a spot of s
    = 2 px by 0.25 % and does not move it.
    """

    quantum_efficiency: Share = 0.5  # electrons per photon, fill factor included
    read_noise_e: NotNegative = 15.0  # rms read noise
    dark_e_per_s: NotNegative = 5000.0
    full_well_e: Positive = 25_000.0  # 12 bits end at 20,475; see Description.of
    prnu: float = Field(default=0.005, ge=0, lt=0.2)  # rms of the pixels' sensitivity
    dsnu_e: NotNegative = 5.0  # rms of the pixels' offset
    blooming: Share = 0.02  # share of the charge above full well that spills; the rest is drained
    spill_px: Positive = 2.0  # 1/e length of the spilt charge
    offset_counts: NotNegative = 60.0
    gain: Positive | None = None  # counts per electron; the instrument's kappa if None

    def dark_electrons(self, exposure_s: float) -> float:
        """Return the mean electrons of the dark current in ``exposure_s`` seconds."""
        return self.dark_e_per_s * exposure_s


@dataclass(frozen=True)
class Readout:
    """The conversion from electrons to counts, with all defaults filled in.

    Attributes:
        gain: Counts per electron.
        offset_counts: Count of a pixel without electrons.
        read_noise_e: Standard deviation of the read noise, electrons.
        top_count: Largest count: the converter's last code, or full well if that is lower.
    """

    gain: float
    offset_counts: float
    read_noise_e: float
    top_count: int


def readout(model: SensorModel, kappa: float, pixel_width: int) -> Readout:
    """Return the readout of ``model``.

    Args:
        model: The scene's sensor.
        kappa: Counts per electron where the scene states no gain.
        pixel_width: Bits of the converter.

    Raises:
        ValueError: if there is no gain.
    """
    gain = model.gain if model.gain is not None else kappa
    if not gain > 0:
        raise ValueError(f"a gain of {gain} counts per electron converts nothing")
    full = math.floor(model.offset_counts + gain * model.full_well_e + 0.5)
    return Readout(gain, model.offset_counts, model.read_noise_e, min(2**pixel_width - 1, full))


def _normal() -> Singles:
    """Return the quantiles of the normal distribution at the middles of ``WORDS`` equal steps."""
    z = ndtri((np.arange(WORDS) + 0.5) / WORDS)
    return np.asarray(z / np.sqrt(np.mean(np.square(z))), np.float32)


NORMAL = _normal()  # indexed by word: mean 0, variance 1, ends at -4.32 and 4.32


def words(seed: int, block: int, rows: int, length: int) -> Pixels:
    """Return the random words of a block of lines, one for each pixel and line.

    They depend only on the arguments: the block has the same noise in whatever order and with
    whatever effects it is rendered. ``block`` stands for a fixed range of lines; blocks of another
    size have other words.

    Args:
        seed: The scene's seed, at least 0.
        block: Number of the block, at least 0.
        rows: Number of lines of the block.
        length: Number of pixels of a line.

    Returns:
        uint16 [rows, length], even over 0..65535.
    """
    source = np.random.SFC64(np.random.SeedSequence((seed, _NOISE_STREAM, block)))
    count = rows * length
    raw = np.asarray(source.random_raw((count + 3) // 4), "<u8")
    return np.asarray(raw.view("<u2")[:count].reshape(rows, length), np.uint16)


def _levels(z: Singles, mean_e: Singles, readout: Readout) -> Singles:
    """Return counts before the converter's rounding, half a count too high, float32 like ``z``.

    All operations are in float32 and one at a time, so that a table and a single pixel agree to the
    last bit.
    """
    noisy = readout.read_noise_e**2 > 2.0 / 6.0**2  # then neither limit below does anything
    variance = mean_e + np.float32(readout.read_noise_e**2)
    bend = variance if noisy else np.maximum(variance, np.float32(LEAST_VARIANCE))
    bend = mean_e / bend
    bend *= np.float32(1.0 / 6.0)
    # b^2 + 2 c^2 is the variance of b z + c (z^2 - 1)
    level: Singles = np.square(bend)
    level *= np.float32(2.0)
    np.subtract(variance, level, out=level)
    if not noisy:
        np.maximum(level, np.float32(0.0), out=level)
    np.sqrt(level, out=level)
    level *= z
    curved = np.square(z, out=variance)
    curved -= np.float32(1.0)
    curved *= bend
    level += curved
    level += mean_e
    level *= np.float32(readout.gain)
    level += np.float32(readout.offset_counts + 0.5)
    return level


def _convert(level: Singles, top_count: int) -> Pixels:
    """Return the converter's codes; ``level`` is overwritten. Truncation of a positive is floor."""
    np.clip(level, np.float32(0.0), np.float32(top_count), out=level)
    return level.astype(np.uint16)


@lru_cache(maxsize=8)
def _level_table(mean_e: float, readout: Readout) -> Singles:
    return _levels(NORMAL, np.full(WORDS, mean_e, np.float32), readout)


@lru_cache(maxsize=8)
def _count_table(mean_e: float, readout: Readout) -> Pixels:
    return _convert(_level_table(mean_e, readout).copy(), readout.top_count)


def chunks(rows: int, length: int) -> Iterator[slice]:
    """Yield some lines after others, so many that they stay in the processor's cache."""
    step = max(1, _CHUNK // max(1, length))
    for first in range(0, rows, step):
        yield slice(first, first + step)


def expose_even(
    words: Pixels, mean_e: float, readout: Readout, offset_e: Singles | None = None
) -> Pixels:
    """Return the counts of pixels that all hold the same mean charge, by a table of all words.

    Gives the same counts as ``expose_pixels`` with that mean everywhere, to the last bit, at a
    fraction of its time. A new ``mean_e`` costs a new table, 0.5 ms.

    Args:
        words: Random words [n, length].
        mean_e: Mean electrons, light and dark current, at least 0.
        readout: Readout of the sensor.
        offset_e: Offset of each pixel, electrons without noise [length]; see
            ``FixedPattern.offset``.

    Returns:
        Counts, uint16 [n, length].

    Raises:
        ValueError: if the mean is negative or not finite.
    """
    if not 0 <= mean_e < math.inf:
        raise ValueError(f"a mean of {mean_e} electrons")
    rows, length = words.shape
    counts = np.empty((rows, length), np.uint16)
    if offset_e is None:
        codes = _count_table(mean_e, readout)
        for some in chunks(rows, length):
            codes.take(words[some], mode="wrap", out=counts[some])
        return counts
    table, shift = _level_table(mean_e, readout), offset_e * np.float32(readout.gain)
    for some in chunks(rows, length):
        level = table.take(words[some], mode="wrap")
        level += shift
        counts[some] = _convert(level, readout.top_count)
    return counts


def expose_pixels(
    words: Pixels, mean_e: Singles, readout: Readout, offset_e: Singles | None = None
) -> Pixels:
    """Return the counts of pixels, each with its own mean charge m.

    With the word's normal deviate z, read variance r^2, v = m + r^2 and c = m / (6 v) the charge is

        m + sqrt(v - 2 c^2) z + c (z^2 - 1),

    the first terms of Cornish and Fisher's expansion (Cornish, Fisher 1938) of a Poisson number
    plus Gaussian read noise: mean m and variance v exactly, third moment m - 4 c^3, where Poisson's
    is m (c is at most 1/6).

    Leaves out: tails beyond 4.3 standard deviations (1.6e-5 of all pixels); that charge comes in
    whole electrons, which read noise above 1 e hides; read noise at full well.

    Args:
        words: Random words [n, w].
        mean_e: Mean electrons, light and dark current, at least 0 [n, w].
        readout: Readout of the sensor.
        offset_e: Offset of each pixel as in ``expose_even``, [w] or [n, w].

    Returns:
        Counts, uint16 [n, w].
    """
    rows, length = words.shape
    counts = np.empty((rows, length), np.uint16)
    shift = None if offset_e is None else offset_e * np.float32(readout.gain)
    for some in chunks(rows, length):
        z = NORMAL.take(words[some], mode="wrap")
        level = _levels(z, np.asarray(mean_e[some], np.float32), readout)
        if shift is not None:
            level += shift if shift.ndim == 1 else shift[some]
        counts[some] = _convert(level, readout.top_count)
    return counts


@dataclass(frozen=True)
class FixedPattern:
    """Differences from pixel to pixel that are the same in every line.

    Attributes:
        sensitivity: A pixel's response to light over the mean of all, float32 [length].
        dark_e: A pixel's offset, electrons without noise, float32 [length].
    """

    sensitivity: Singles
    dark_e: Singles

    def offset(self, even_e: float) -> Singles:
        """Return each pixel's offset under even light of ``even_e`` electrons, [length].

        Even light's own pattern also counts as an offset: the pixel's mean is right, and its noise
        is that of the mean pixel, 0.25 % off for a pattern of 0.5 %. So a spot times
        ``sensitivity`` on top of ``even_e`` and this offset gives exactly the counts of
        ``expose_even`` where the spot ends.
        """
        return self.dark_e + np.float32(even_e) * (self.sensitivity - np.float32(1.0))


def fixed_pattern(model: SensorModel, seed: int, length: int) -> FixedPattern:
    """Return the fixed pattern of a sensor: Gaussian, white, of the sizes in ``model``.

    Args:
        model: The scene's sensor.
        seed: The sensor's own seed, at least 0.
        length: Number of pixels of a line.
    """
    rng = np.random.Generator(
        np.random.SFC64(np.random.SeedSequence((seed, _PATTERN_STREAM, length)))
    )
    normal = rng.standard_normal((2, length))
    sensitivity = np.maximum(1.0 + model.prnu * normal[0], 0.0)
    return FixedPattern(
        np.asarray(sensitivity, np.float32), np.asarray(model.dsnu_e * normal[1], np.float32)
    )


def bloom(mean_e: Singles, model: SensorModel, out: Singles | None = None) -> Singles:
    """Return the charge after full pixels have spilt into their neighbours.

    Of a pixel's charge above full well the share ``blooming`` spills, half to either side, and the
    drain takes the rest. On its way, spilt charge passes full pixels and leaves the share 1 -
    exp(-1 / spill_px) in each other pixel, as far as that is not full. So no pixel ends above full
    well, and all charge is kept but what is drained or leaves the end of the row.

    It leaves out noise of the spill, blooming of the whole chip, and that a drain's share falls as
    it fills.

    Args:
        mean_e: Mean electrons [n, w].
        model: The scene's sensor.
        out: Where the result goes: ``mean_e``, which is then overwritten, or a copy of it if None.

    Returns:
        Mean electrons [n, w]; ``mean_e`` itself where nothing is above full well.
    """
    full = np.float32(model.full_well_e)
    rows = np.flatnonzero(mean_e.max(axis=1) > full)
    if len(rows) == 0:
        return mean_e
    over = mean_e[rows] > full
    # Only where charge can reach: the full pixels and some pixels on either side.
    width = mean_e.shape[1]
    excess = np.where(over, mean_e[rows] - full, np.float32(0.0)).sum(axis=1)
    filled = model.blooming * excess / full  # pixels, half of them on either side
    reach = np.minimum(np.ceil(SPILL_REACH * model.spill_px + filled), width).astype(np.int64)
    first = np.maximum(over.argmax(axis=1) - reach, 0)
    last = np.minimum(width - 1 - over[:, ::-1].argmax(axis=1) + reach, width - 1)
    column = first[:, None] + np.arange(int((last - first).max()) + 1)
    inside = (column <= last[:, None]).T  # a line's own reach, whatever its neighbours need
    at = (rows[:, None], np.clip(column, 0, width - 1))
    held = np.where(inside, mean_e[at].T, np.float32(0.0))
    spilt = np.maximum(held - full, np.float32(0.0)) * np.float32(0.5 * model.blooming)
    np.minimum(held, full, out=held)
    share = np.float32(-math.expm1(-1.0 / model.spill_px))
    for order in (range(len(held)), range(len(held) - 1, -1, -1)):
        walking = np.zeros(held.shape[1], np.float32)
        for pixel in order:
            left = np.minimum(walking * share, full - held[pixel])
            held[pixel] += left
            walking -= left
            walking += spilt[pixel]
    result = mean_e.copy() if out is None else out
    kept = inside.T
    row = np.broadcast_to(rows[:, None], column.shape)[kept]
    result[row, column[kept]] = held.T[kept]
    return result
