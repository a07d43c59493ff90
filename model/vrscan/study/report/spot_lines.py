"""Lines of single spots whose position is known, each with one difficulty, and their error bound.

The sensor is that of ``vrscan efficiency``: read noise 3 counts, 5 electrons per count at the
shipped conversion factor. The spot's own pixels and those beside it hold Poisson numbers; far from
the spot, where there is only even light, the Poisson number is drawn as a normal one.
"""

import math
from dataclasses import dataclass, fields
from typing import Any, Self

import numpy as np
from scipy.special import erf

from vrscan.data.arrays import Floats, Pixels
from vrscan.data.config import Config
from vrscan.data.residuals import rms
from vrscan.ideal.geometry import ThinLens
from vrscan.scene.description import Lens
from vrscan.scene.sensor import REACH, cramer_rao_variance
from vrscan.scene.speckle import Speckle
from vrscan.scene.surface import WAVELENGTH_NM
from vrscan.study.report.efficiency import BACKGROUND_COUNTS, LOST_PX, READ_NOISE_COUNTS

SLOPE_PX, RETURN_PX = 100, 250  # a slope is straight up to the first, 0 from the second on
_PATTERNS = 4  # speckle patterns in a cell
_ANGLE_RAD = 0.3  # either way: 28 pupil widths, over which a pattern changes that often


@dataclass(frozen=True)
class Spot:
    """The appearance of the lines of a cell.

    Attributes:
        sigma_px: Standard deviation of the spot.
        peak: Height of the spot, share of full scale; above 1 it is clipped.
        level: Even light below the spot, counts.
        slope: Slope of the background around the spot, counts/px.
        skew: The sides have (1 - skew) and (1 + skew) times ``sigma_px``; the position is the
            top's.
        contrast: Contrast of the speckle of a pixel; at most that of the lens.
        rival: Height of a second spot over that of the first.
        rival_px: Distance of the second spot to the right.
    """

    sigma_px: float
    peak: float
    level: float = BACKGROUND_COUNTS
    slope: float = 0.0
    skew: float = 0.0
    contrast: float = 0.0
    rival: float = 0.0
    rival_px: float = 0.0

    @classmethod
    def of(cls, parameters: dict[str, Any]) -> Self:
        """Return the spot that a cell's parameters describe; other keys are ignored."""
        return cls(**{f.name: parameters[f.name] for f in fields(cls) if f.name in parameters})


@dataclass(frozen=True)
class Taken:
    """n lines of a spot."""

    lines: Pixels  # counts [n, length]
    true: Floats  # true position, px [n]
    bound: Floats  # least variance of an estimate of it if there were no speckle, px^2 [n]
    speckled: Floats  # the same with the speckle [n]


@dataclass(frozen=True)
class Score:
    """Errors of a detector; lost lines count only in ``lost``."""

    rms: float  # rms error including the bias, px
    bias: float  # mean error, px
    spread: float  # rms error about the bias, px
    lost: float  # share of lines without a position or more than LOST_PX off


def profile(centre: Floats, left: float, right: float, edges: Floats) -> tuple[Floats, Floats]:
    """Return a spot of height 1 integrated over each pixel, and its derivative by the centre.

    Args:
        centre: Centres of the spots, px [n].
        left: Standard deviation of its left side, px.
        right: Standard deviation of the right side, px.
        edges: Edges of the pixels, px [n, m + 1].

    Returns:
        Two arrays [n, m].
    """
    away = edges - centre[:, None]
    sigma = np.where(away < 0.0, left, right)
    area = sigma * math.sqrt(0.5 * math.pi) * erf(away / (math.sqrt(2.0) * sigma))
    density = np.exp(-0.5 * np.square(away / sigma))
    return np.diff(area, axis=1), -np.diff(density, axis=1)


def _gains(
    first: Floats, width: int, spot: Spot, config: Config, rng: np.random.Generator
) -> Floats:
    """Return the gain of speckle for each pixel of each window [n, width]."""
    lens, count = Lens(), len(first)
    gains = np.empty((count, width))
    for part in np.array_split(np.arange(count), _PATTERNS):
        pattern = Speckle(
            int(rng.integers(1 << 31)),
            config.sensor.line_length,
            ThinLens.of(lens.f_number, lens.focus_mm, config.geometry),
            wavelength_nm=WAVELENGTH_NM,
            pitch_mm=config.geometry.pitch_mm,
        )
        distance = np.full(len(part), lens.focus_mm)
        most = float(pattern.contrast())
        looks = (most / min(spot.contrast, most)) ** 2
        angle = rng.uniform(-_ANGLE_RAD, _ANGLE_RAD, len(part))
        gains[part] = pattern.gain(first[part].astype(np.int64), width, angle, looks, distance)
    return gains


def most_contrast(config: Config) -> tuple[float, float]:
    """Return the contrast of a pixel without averaging, and the correlation of neighbours."""
    lens = Lens()
    pattern = Speckle(
        0,
        64,
        ThinLens.of(lens.f_number, lens.focus_mm, config.geometry),
        wavelength_nm=WAVELENGTH_NM,
        pitch_mm=config.geometry.pitch_mm,
    )
    return float(pattern.contrast()), pattern.correlation


def take(spot: Spot, count: int, config: Config, rng: np.random.Generator) -> Taken:
    """Return lines of a spot that is anywhere between two pixels, in the middle half of the line.

    The bounds assume that the background, the second spot and the speckle's mean are known, and
    that a pixel at full scale carries no information. That neighbours share a part of their
    speckle is in the lines and not in the bound.

    Args:
        spot: Appearance of the spot.
        count: Number of lines.
        config: Sensor and conversion factor.
        rng: Source of all random numbers.
    """
    length, kappa = config.sensor.line_length, config.peak.kappa
    full = 2**config.sensor.pixel_width - 1
    true = rng.uniform(0.25 * length, 0.75 * length, count)
    left, right = (1.0 - spot.skew) * spot.sigma_px, (1.0 + spot.skew) * spot.sigma_px
    reach = math.ceil(REACH * max(left, right))
    if spot.slope:
        reach = max(reach, RETURN_PX)
    width = 2 * reach + 1 + math.ceil(spot.rival_px)
    first = np.round(true) - reach
    pixel = first[:, None] + np.arange(width)
    edges = first[:, None] + np.arange(width + 1) - 0.5
    peak = spot.peak * (full + 1) / kappa
    shape, slope = profile(true, left, right, edges)
    light = peak * shape
    if spot.rival:
        light += peak * spot.rival * profile(true + spot.rival_px, left, right, edges)[0]
    if spot.contrast:
        light = light * _gains(first, width, spot, config, rng)
    away = pixel - true[:, None]
    fade = np.clip((RETURN_PX - np.abs(away)) / (RETURN_PX - SLOPE_PX), 0.0, 1.0)
    ramp = spot.slope * np.clip(away, -SLOPE_PX, SLOPE_PX) * fade
    below = np.maximum(spot.level + ramp, 0.0) / kappa

    dark = (READ_NOISE_COUNTS**2 + 1.0 / 12.0) / kappa**2 + below
    tells = kappa * (light + below) < full
    told = np.where(tells, peak * slope, 0.0)
    bound, speckled = (
        cramer_rao_variance(peak * shape, told, dark, contrast) for contrast in (0.0, spot.contrast)
    )

    even = math.hypot(READ_NOISE_COUNTS, math.sqrt(kappa * spot.level))
    counts = rng.standard_normal((count, length), np.float32)
    counts *= np.float32(even)
    counts += np.float32(spot.level)
    shot = kappa * rng.poisson(light + below)
    own = shot + READ_NOISE_COUNTS * rng.standard_normal(shot.shape)
    inside = (pixel >= 0) & (pixel < length)
    row = np.broadcast_to(np.arange(count)[:, None], pixel.shape)
    counts[row[inside], pixel[inside].astype(np.int64)] = own[inside]
    lines = np.clip(np.floor(counts + np.float32(0.5)), 0, full).astype(np.uint16)
    return Taken(lines=lines, true=true, bound=bound, speckled=speckled)


def score(position: Floats, true: Floats) -> Score:
    """Return the errors of positions.

    Args:
        position: Positions found, px, NaN where none was found [n].
        true: True positions, px [n].
    """
    error = position - true
    with np.errstate(invalid="ignore"):
        good = np.abs(error) <= LOST_PX
    kept = error[good]
    if not kept.size:
        return Score(math.inf, math.nan, math.nan, 1.0)
    return Score(
        rms=rms(kept),
        bias=float(kept.mean()),
        spread=float(kept.std()),
        lost=1.0 - float(good.mean()),
    )


def mean_square(rms: float, lost: float) -> float:
    """Return the mean square error of all lines, px^2; a lost line counts as ``LOST_PX``.

    Args:
        rms: Error of the lines that are not lost, px.
        lost: Share of lost lines.
    """
    kept = 0.0 if lost == 1.0 else (1.0 - lost) * rms**2
    return kept + lost * LOST_PX**2
