"""Accuracy of S/N and sigma of whole lines against float64 from the same pixels.

The window is the fixed chain's; mean and noise of the background, the harmonic and the sum v_i
sin^2(theta_i - phi) are float64's own. Errors are in units of the allowed error, which is 0.5 % or
one step of the output, whichever is more: so the output's rounding alone gives 0.5.

A noise has 24 - PixelWidth fraction bits; from 128 such steps on (1/32 of a count at 12 bits) its
rounding keeps S/N within 0.5 %. Lines with less noise are measured separately, without a limit.

Windows of three pixels with T = 2 are left out of sigma: their samples lie at phases 0 and 1/2
only, so sin(theta_i - phi) is 0 throughout. Float64 gives a sigma of 0 for them, the fixed chain
one of a few steps.
"""

import math
from dataclasses import dataclass

import numpy as np

from vrscan.data import pkg
from vrscan.data.arrays import Floats, Ints, Pixels
from vrscan.data.config import Config
from vrscan.data.points import Points
from vrscan.fixed.cordic_vector import angle_bounds
from vrscan.fixed.line_statistics import ROOT_FRACTION
from vrscan.fixed.vrscan_chain import run_fixed
from vrscan.ideal.chain import run as run_ideal
from vrscan.ideal.position import first_harmonic, windows
from vrscan.registers.chain_registers import Registers
from vrscan.study.report.accuracy.position_accuracy import phase_bounds, sample_error
from vrscan.study.report.figure import SEED, Figure, largest

SHARE = 0.005  # allowed share of the value, or one step
GROUP = "S/N and sigma, whole lines"
LEAST_NOISE_STEPS = 128
WINDOW = {"window": "threshold"}  # the one window, whose S/N and sigma these are

_SNR_STEP, _SIGMA_STEP = 2.0**-pkg.SNR_FRACTION, 2.0**-pkg.SIGMA_FRACTION
_SNR_END = (2.0**pkg.SNR_WIDTH - 1.0) * _SNR_STEP
_SIGMA_END = (2.0**pkg.SIGMA_WIDTH - 1.0) * _SIGMA_STEP
_CHUNK = 512  # lines computed at a time: they fit in a core's cache


def spots(count: int, config: Config, draw: np.random.Generator) -> Pixels:
    """Return lines of one spot each, of any width, height, background and noise.

    Args:
        count: Number of lines.
        config: Sensor and conversion factor, which makes the shot noise.
        draw: Source of all random values.

    Returns:
        Counts [count, line_length]; about every 16th line is free of noise.
    """
    length, top = config.sensor.line_length, 2**config.sensor.pixel_width - 1
    place = np.arange(length)
    background = top * 0.9 * draw.random((count, 1)) ** 3
    height = top * 10.0 ** draw.uniform(-2.5, 0.3, (count, 1))
    sigma = 10.0 ** draw.uniform(-0.3, 1.8, (count, 1))
    centre = draw.uniform(0.0, length, (count, 1))
    noise = top * 10.0 ** draw.uniform(-5.0, -1.5, (count, 1))
    noise[draw.random(count) < 1 / 16] = 0.0
    skew = draw.uniform(0.5, 2.0, (count, 1))
    sigma = np.where(place > centre, sigma * skew, sigma)
    spot = height * np.exp(-0.5 * ((place - centre) / sigma) ** 2)
    shot = np.sqrt(config.peak.kappa * spot) * (noise > 0.0)
    lines = background + spot + np.hypot(noise, shot) * draw.standard_normal((count, length))
    return np.asarray(np.clip(np.rint(lines), 0, top), np.uint16)


def quiet(config: Config) -> Pixels:
    """Return lines of a low box on a flat background of which a few pixels are one count off.

    Args:
        config: The sensor.

    Returns:
        Counts [n, line_length], without shot noise.
    """
    length = config.sensor.line_length
    # In every one of the first nine blocks: that many blocks are left for the background.
    blocks = 20 + pkg.BLOCK_LENGTH * np.arange(9)
    grid = np.meshgrid((1, 2, 3, 4, 6), np.arange(1, 30), blocks)
    off, height, middle = (axis.ravel() for axis in grid)
    place = np.arange(length)
    away = (place - middle[:, None]) % length - length // 2
    lines = 100 + np.where(np.abs(place - middle[:, None]) <= 2, height[:, None], 0)
    return np.asarray(lines + ((away >= 0) & (away < off[:, None])), np.uint16)


@dataclass(frozen=True)
class Quality:
    """Errors in units of the allowed error, for lines where both numbers are defined.

    Attributes:
        noise: Noise in steps of its format [n].
        snr: Error of S/N [n].
        snr_bound: Error of S/N that the widths allow [n].
        sigma: Error of sigma [m].
        sigma_bound: Error of sigma that the widths allow [m].
        windows: Share of the lines for which float64 cuts another window.
    """

    noise: Floats
    snr: Floats
    snr_bound: Floats
    sigma: Floats
    sigma_bound: Floats
    windows: float


def _allowed(value: Floats, step: float) -> Floats:
    return np.maximum(SHARE * value, step)


def _noise_error(length: int, pixel_width: int) -> float:
    """Return the largest error of a noise, counts: by its root, n times as large, and rounding."""
    # The background is no shorter than a quarter of the line, where there is one.
    root = 0.5 * 2.0**-ROOT_FRACTION / (length / 4.0)
    return root + 0.5 * 2.0 ** -(pkg.COUNT_WIDTH - pixel_width)


def _clipped(value: Floats, error: Floats, end: float) -> Floats:
    """Return the largest error of a value that saturates at ``end``."""
    above = np.minimum(value + error, end) - np.minimum(value, end)
    below = np.minimum(value, end) - np.minimum(np.maximum(value - error, 0.0), end)
    return np.asarray(np.maximum(above, below))


def _snr_error(snr: Floats, noise: Floats, config: Config) -> Floats:
    width = config.sensor.pixel_width
    error = _noise_error(config.sensor.line_length, width)
    mean = 0.5 * 2.0 ** -(pkg.COUNT_WIDTH - width)
    # Beyond half the noise the bound is of no use.
    least = np.maximum(noise - error, 0.5 * noise)
    return _clipped(snr, (snr * error + mean) / least + 0.5 * _SNR_STEP, _SNR_END)


def _sigma_error(
    pixels: Floats,
    points: Points,
    rows: Ints,
    background: Floats,
    noise: Floats,
    phase: Floats,
    magnitude: Floats,
    config: Config,
) -> Floats:
    """Return the largest error of sigma that the widths allow, px.

    The errors in the variance V = sum v_i (1 - cos(2 theta_i - 2 phi)) are: those of the rounded
    noise and background, of the cosines and the rounding of their sum, of the wave, and of kappa.
    Then come the rounding of the root and the error of the harmonic.
    """
    scale = 2.0 ** (pkg.ALIGNED_WIDTH - config.sensor.pixel_width)  # counts to aligned counts
    width = points.width[rows]
    period = width - (config.peak.period != "n")
    place = np.arange(pixels.shape[1])
    theta = 2.0 * np.pi * place / period[:, None]
    free = np.where(place < width[:, None], 2.0 * np.sin(theta - phase[:, None]) ** 2, 0.0)
    above = np.maximum(pixels - background[:, None], 0.0)
    shot = scale**2 * config.peak.kappa * (above * free).sum(axis=1)
    dark = (scale * noise) ** 2
    constant = free.sum(axis=1)
    variance = dark * constant + shot
    total = np.where(place < width[:, None], above, 0.0).sum(axis=1)

    pedestal = background * (config.peak.period != "n")
    cut = width.astype(np.float64) / scale  # the pedestal is cut to aligned counts
    turned, _ = phase_bounds(width, period, total, cut, magnitude, pedestal)
    turned = turned + 2.0 * np.pi * angle_bounds(pkg.ANGLE_WIDTH)[0] * 2.0**-pkg.ANGLE_WIDTH
    sample = sample_error(width, period)
    each = sample.table + sample.turn
    cosine = each + 2.0 * (turned + sample.turn)
    kappa = scale * config.peak.kappa
    step = scale * _noise_error(config.sensor.line_length, config.sensor.pixel_width)
    mean = scale * 0.5 * 2.0 ** -(pkg.COUNT_WIDTH - config.sensor.pixel_width)
    kappa_step = 0.5 * 2.0 ** -(28 - config.sensor.pixel_width)
    wrong = (
        (2.0 * scale * noise * step + step**2 + kappa * mean + 2.0**-17) * constant
        + dark * (2.0 ** -(pkg.WAVE_COUNT_FRACTION + 1) + width * cosine)
        + kappa * (2.0 ** -(pkg.WAVE_FRACTION + 1) + scale * total * cosine)
        + shot * (kappa_step / config.peak.kappa if config.peak.kappa else 0.0)
        + 2.0**-17
    )
    root = np.sqrt(variance)
    root_error = np.minimum(wrong / np.maximum(root, 1e-9), np.sqrt(wrong)) + 2.0**-9
    per_root = period / (2.0 * np.pi * math.sqrt(2.0)) / (scale * magnitude)
    harmonic = (each * total + pedestal * sample.turn) / magnitude + 1e-6  # and magnitude_bound
    value = per_root * root
    error = (per_root * root_error + value * harmonic) / np.maximum(1.0 - harmonic, 0.5)
    return _clipped(value, error + 0.5 * _SIGMA_STEP, _SIGMA_END)


def compare(lines: Pixels, config: Config) -> Quality:
    """Return the errors of S/N and sigma of lines.

    Args:
        lines: Counts [n, line_length].
        config: Thresholds, period and conversion factor.
    """
    parts = [_compare(lines[k : k + _CHUNK], config) for k in range(0, len(lines), _CHUNK)]
    columns = {
        name: np.concatenate([getattr(part, name) for part in parts])
        for name in ("noise", "snr", "snr_bound", "sigma", "sigma_bound")
    }
    return Quality(**columns, windows=float(np.mean([part.windows for part in parts])))


def _compare(lines: Pixels, config: Config) -> Quality:
    nothing = np.zeros(len(lines), np.int64)
    points = run_fixed(lines, nothing, nothing, Registers.from_config(config))
    ideal = run_ideal(lines, nothing.astype(np.float64), nothing, config)
    background, noise = ideal.background, ideal.noise

    noisy = np.flatnonzero(noise > 0.0)
    snr = (ideal.maximum - background)[noisy] / noise[noisy]
    snr_got = points.snr[noisy] * _SNR_STEP
    snr_error = np.abs(snr_got - np.minimum(snr, _SNR_END))
    snr_allowed = _allowed(np.minimum(snr, _SNR_END), _SNR_STEP)
    snr_bound = _snr_error(snr, noise[noisy], config)

    least = pkg.MIN_WINDOW + (config.peak.period != "n")
    rows = np.flatnonzero(points.measured & (points.width >= least))
    pixels = windows(lines[rows], points.left[rows], points.width[rows])
    exact = first_harmonic(
        pixels,
        points.width[rows],
        period_n=config.peak.period == "n",
        background=background[rows],
        noise=noise[rows],
        kappa=config.peak.kappa,
    )
    kept = ~exact.no_phase
    rows, pixels = rows[kept], pixels[kept]
    sigma = exact.sigma[kept]
    sigma_bound = _sigma_error(
        pixels,
        points,
        rows,
        background[rows],
        noise[rows],
        exact.phase[kept],
        exact.magnitude[kept],
        config,
    )
    sigma_error = np.abs(points.sigma[rows] * _SIGMA_STEP - np.minimum(sigma, _SIGMA_END))
    sigma_allowed = _allowed(np.minimum(sigma, _SIGMA_END), _SIGMA_STEP)

    present = (points.width > 0) | (ideal.width > 0)
    moved = (points.left != ideal.left) | (points.width != ideal.width)
    return Quality(
        noise=noise[noisy] * 2.0 ** (pkg.COUNT_WIDTH - config.sensor.pixel_width),
        snr=snr_error / snr_allowed,
        snr_bound=snr_bound / snr_allowed,
        sigma=sigma_error / sigma_allowed,
        sigma_bound=sigma_bound / sigma_allowed,
        windows=float((moved & present).mean()),
    )


def measure(count: int) -> list[Figure]:
    """Return the figures of S/N and sigma, for both periods and both kinds of noise.

    Args:
        count: Number of lines of each kind.
    """
    draw = np.random.default_rng([SEED, 3])
    figures = []

    def figure(
        name: str, error: Floats, bound: Floats, limit: float = math.nan, headline: str = ""
    ) -> None:
        figures.append(
            Figure(
                GROUP,
                f"{name}, {len(error)} lines",
                "0.5 % or step",
                largest(error),
                largest(bound),
                0.5,
                limit,
                headline=headline,
            )
        )

    for period, noise in (("n", "background"), ("n-1", "background"), ("n", "row")):
        config = Config.model_validate({"peak": {**WINDOW, "period": period, "noise": noise}})
        found = compare(spots(count, config, draw), config)
        title = f"T = {period.upper().replace('-', ' - ')}, noise of the {noise}"
        loud = found.noise >= LEAST_NOISE_STEPS
        figure(f"S/N, {title}", found.snr[loud], found.snr_bound[loud], 1.0, "S/N, whole lines")
        figure(f"sigma, {title}", found.sigma, found.sigma_bound, 1.0, "sigma, whole lines")
        name = f"windows that float cuts elsewhere, {title}"
        figures.append(Figure(GROUP, name, "%", 100.0 * found.windows))
    config = Config.model_validate({"peak": WINDOW})
    found = compare(quiet(config), config)
    low = found.noise < LEAST_NOISE_STEPS
    name = f"S/N, noise below 2^-{pkg.COUNT_WIDTH - config.sensor.pixel_width - 7} count"
    figure(name, found.snr[low], found.snr_bound[low])
    return figures
