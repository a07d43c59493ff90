"""The benefit of the second window: its efficiency, and its errors by skew and slope.

Sensor and spots are those of ``study.report.efficiency``. There efficiency is the bound over the
measured mean square error, which chance alone moves by 2 % with 4,000 lines; here it is the mean
square error of the efficient score over the detector's, on the same lines. The score is the
estimate that reaches the bound, for which it needs the truth; both errors come from the same noise,
so most of the chance drops out.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import product
from typing import Any

import numpy as np
from rich.table import Table as RichTable

from vrscan.data import pkg
from vrscan.data.arrays import Floats, Ints, Pixels
from vrscan.data.config import Config
from vrscan.detectors.plain import plain_lines
from vrscan.engines.engine import Engine, run
from vrscan.scene.sensor import spot_electrons
from vrscan.show.sheet import Column, Sheet, listed
from vrscan.study.progress import Progress, for_each
from vrscan.study.report.accuracy import position_accuracy as position
from vrscan.study.report.efficiency import (
    BACKGROUND_COUNTS,
    LOST_PX,
    READ_NOISE_COUNTS,
    cell_lines,
    with_window,
)

WINDOWS = ("threshold", "two_pass")  # one pass and two
SIGMAS_PX = (1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0, 12.0)
DIM_PEAK = 0.02  # share of full scale
PEAKS = (DIM_PEAK, 0.05, 0.10, 0.20, 0.50, 0.90)
GOAL, GOAL_DIM = 0.95, 0.90  # least efficiency in every cell, and for peaks below 5 %

SKEW = 0.25  # sides of 0.75 s and 1.25 s
SKEW_SIGMA_PX = 3.0
SKEW_PEAKS = (0.10, 0.15, 0.20, 0.30, 0.50, 0.70, 0.90)
GOAL_SKEW_PX = 0.02

SLOPE_SIGMAS_PX = (1.0, 3.0, 8.0, 12.0)
SLOPE_PEAKS = (0.05, 0.20, 0.90)
SLOPE = 1.0  # counts per px
SLOPE_REACH_PX, SLOPE_END_PX = 120, 250  # end of the straight part; back at the background's level
SLOPE_BACKGROUND_COUNTS = 200.0
GOAL_SLOPE_PX = 0.005
_SUBPIXELS = 8
_SEED = 20100302


@dataclass(frozen=True)
class Cell:
    """Efficiency and share of lost lines for one width and height of spot, in both modes."""

    sigma_px: float
    peak: float
    one_pass: float
    two_pass: float
    lost: float  # share with two passes: no position, or more than LOST_PX off


@dataclass(frozen=True)
class Slope:
    """The effect of a slope on a spot with two passes, px."""

    sigma_px: float
    peak: float
    bias: float  # mean change of a position
    rms: float  # rms error of positions on the slope
    level_rms: float  # rms error of positions without a slope


def efficient_score(
    lines: Pixels, true: Floats, sigma_px: float, peak: float, config: Config
) -> Floats:
    """Return the error of the estimate that reaches the bound, px [n].

    The Fisher information's inverse times sum_i (df_i / dmu) (p_i - f_i) / (b^2 + f_i), at the
    truth (Winick 1986).

    Args:
        lines: Counts [n, length].
        true: Centres, px [n].
        sigma_px: Standard deviation of the spots.
        peak: Height of the spots, share of full scale.
        config: Sensor and conversion factor.
    """
    kappa, length = config.peak.kappa, lines.shape[1]
    sigma = np.full(len(true), sigma_px)
    height = np.full(len(true), peak * 2**config.sensor.pixel_width / kappa)
    step = 1e-3
    mean = spot_electrons(true, sigma, height, length)
    slope = spot_electrons(true + step, sigma, height, length)
    slope -= spot_electrons(true - step, sigma, height, length)
    slope /= 2.0 * step
    dark = (READ_NOISE_COUNTS**2 + 1.0 / 12.0) / kappa**2 + BACKGROUND_COUNTS / kappa
    weight = slope / (dark + mean)
    residual = lines / kappa - mean - BACKGROUND_COUNTS / kappa
    return np.asarray((weight * residual).sum(axis=1) / (weight * slope).sum(axis=1))


def study(
    engine: Engine,
    config: Config,
    count: int,
    progress: Progress | None = None,
    *,
    peaks: Sequence[float] = PEAKS,
    sigmas_px: Sequence[float] = SIGMAS_PX,
    jobs: int = 1,
) -> list[Cell]:
    """Return the efficiency of both modes for every height and width of spot.

    Args:
        engine: The engine that detects.
        config: Thresholds and sensor.
        count: Number of lines per cell.
        progress: Called with the number of cells done so far.
        peaks: Heights of the spots, shares of full scale.
        sigmas_px: Widths of the spots.
        jobs: Number of processes, which share the cells.
    """
    return for_each(
        partial(_cell, engine, config, count), product(peaks, sigmas_px), progress, jobs
    )


def _cell(engine: Engine, config: Config, count: int, spot: tuple[float, float]) -> Cell:
    peak, sigma = spot
    lines, true, _ = cell_lines(sigma, peak, count, config)
    least = np.square(efficient_score(lines.lines, true, sigma, peak, config))
    found, lost = [], 0.0
    for window in WINDOWS:
        result = run(engine, lines, with_window(config, window))
        error = result.position_px - true
        good = result.measured & (np.abs(error) <= LOST_PX)
        found.append(float(least[good].mean() / np.square(error[good]).mean()))
        lost = 1.0 - float(good.mean())
    return Cell(sigma, peak, found[0], found[1], lost)


def rounding_bound(width: Ints, height: Floats) -> Floats:
    """Return the largest error of the model's second window against float64 in the same one, px.

    It is that of one window plus the baseline's rounding. A slope is exact to half of a step per
    px, which moves the position by at most N**3 / (4 pi**2 |P1|) times that. What is subtracted
    from a pixel is a whole number of aligned counts, and the remainder is carried to the next
    pixel: the sum of the remainders' differences times a sine is at most 2, which moves the
    position by at most 2 N / (2 pi |P1|).

    Args:
        width: Widths of the windows, px [n].
        height: Heights of the spots, aligned counts [n]; |P1| is more than a tenth of it times the
            width.
    """
    n = np.asarray(width, np.float64)
    light = n * height / 10.0
    bound = n**3 / (4.0 * np.pi**2 * light) * 2.0 ** -(pkg.RAMP_FRACTION + 1) + n / (np.pi * light)
    return np.asarray(position.guarantee(period_n=True) + bound)


def arithmetic(config: Config, count: int) -> tuple[Floats, Floats, float]:
    """Return errors of the model against the float64 chain where both have the same window, px.

    Args:
        config: Thresholds and sensor.
        count: Number of lines of each width and height.

    Returns:
        Errors [n], the bound of each [n], and the share of lines with the same window.
    """
    settings = with_window(config, "two_pass")
    errors, bounds, lines_with_both = [], [], 0
    aligned = 2.0 ** (pkg.ALIGNED_WIDTH - config.sensor.pixel_width)
    for peak in PEAKS:
        for sigma in SIGMAS_PX:
            lines, _, _ = cell_lines(sigma, peak, count, config)
            got, want = (run(each, lines, settings) for each in (Engine.FIXED, Engine.IDEAL))
            both = got.measured & want.measured
            same = both & (got.left == want.left) & (got.width == want.width)
            height = aligned * (got.maximum - got.background)[same]
            errors.append(np.abs(got.position_px - want.position_px)[same])
            bounds.append(rounding_bound(got.width[same], height))
            lines_with_both += int(both.sum())
    error = np.concatenate(errors)
    return error, np.concatenate(bounds), len(error) / max(lines_with_both, 1)


def _profile(centre: Floats, sides: tuple[float, float], height: float, length: int) -> Floats:
    """Return spots whose sides have two widths, integrated over each pixel, [n, length]."""
    spots = np.zeros((len(centre), length))
    for part in (np.arange(_SUBPIXELS) + 0.5) / _SUBPIXELS - 0.5:
        place = np.arange(length) + part - centre[:, None]
        width = np.where(place < 0.0, sides[0], sides[1])
        spots += np.exp(-0.5 * np.square(place / width))
    return np.asarray(height / _SUBPIXELS * spots)


def _counts(mean: Floats, draws: Floats, config: Config) -> Pixels:
    """Return counts with the noise of the study, Gaussian, from standard normal ``draws``."""
    spread = np.sqrt(READ_NOISE_COUNTS**2 + config.peak.kappa * mean)
    top = 2**config.sensor.pixel_width - 1
    return np.clip(np.floor(mean + spread * draws + 0.5), 0, top).astype(np.uint16)


def _positions(engine: Engine, pixels: Pixels, config: Config, window: str) -> Floats:
    result = run(engine, plain_lines(pixels, config), with_window(config, window))
    return np.asarray(np.where(result.measured, result.position_px, np.nan))


def _draws(count: int, salt: int, config: Config) -> tuple[Floats, Floats]:
    """Return centres in the middle half of the line and standard normal noise."""
    rng = np.random.default_rng([_SEED, salt])
    length = config.sensor.line_length
    centre = rng.uniform(0.25 * length, 0.75 * length, count)
    return centre, rng.standard_normal((count, length))


def skew_positions(engine: Engine, config: Config, count: int) -> tuple[Floats, Floats]:
    """Return the positions of a skewed spot, px from its highest place, in one pass and in two.

    Its sides have (1 - SKEW) and (1 + SKEW) times SKEW_SIGMA_PX. The spots and the draws of noise
    are the same at each height. The positions are means over ``count`` lines, one for each of
    SKEW_PEAKS.
    """
    centre, draws = _draws(count, 1, config)
    sides = (1.0 - SKEW) * SKEW_SIGMA_PX, (1.0 + SKEW) * SKEW_SIGMA_PX
    shape = _profile(centre, sides, 1.0, draws.shape[1])
    full = float(2**config.sensor.pixel_width)
    found = np.zeros((2, len(SKEW_PEAKS)))
    for k, peak in enumerate(SKEW_PEAKS):
        pixels = _counts(BACKGROUND_COUNTS + peak * full * shape, draws, config)
        for row, window in zip(found, WINDOWS, strict=True):
            row[k] = np.nanmean(_positions(engine, pixels, config, window) - centre)
    return found[0], found[1]


def sloping(place: Floats) -> Floats:
    """Return a background that slopes by SLOPE at a spot, counts over its level, any shape.

    It is straight for SLOPE_REACH_PX on either side, which covers the widest window and its blocks,
    and back at its level at SLOPE_END_PX. So the line's statistics, which leave out the
    surroundings of the spot, do not change; a different level elsewhere would be a matter of the
    threshold.

    Args:
        place: Distance from the spot, px.
    """
    far = np.abs(place)
    back = SLOPE_REACH_PX * (SLOPE_END_PX - far) / (SLOPE_END_PX - SLOPE_REACH_PX)
    return np.asarray(
        SLOPE * np.sign(place) * np.where(far < SLOPE_REACH_PX, far, np.maximum(back, 0.0))
    )


def slope_study(
    engine: Engine,
    config: Config,
    count: int,
    *,
    peaks: Sequence[float] = SLOPE_PEAKS,
    sigmas_px: Sequence[float] = SLOPE_SIGMAS_PX,
) -> list[Slope]:
    """Return the effect of ``sloping`` on spots of every height and width, with two passes.

    Spots and draws of noise are the same with and without it, so that the difference is its effect.
    """
    results = []
    full = float(2**config.sensor.pixel_width)
    for peak in peaks:
        for sigma in sigmas_px:
            centre, draws = _draws(count, 2, config)
            spot = _profile(centre, (sigma, sigma), peak * full, draws.shape[1])
            level = SLOPE_BACKGROUND_COUNTS + spot
            rise = sloping(np.arange(draws.shape[1]) - centre[:, None])
            flat, tilted = (
                _positions(engine, _counts(mean, draws, config), config, WINDOWS[1]) - centre
                for mean in (level, level + rise)
            )
            results.append(
                Slope(
                    sigma_px=sigma,
                    peak=peak,
                    bias=float(np.nanmean(tilted - flat)),
                    rms=float(np.nanstd(tilted)),
                    level_rms=float(np.nanstd(flat)),
                )
            )
    return results


def _grid(
    results: Sequence[Any], text: Callable[[Any], str]
) -> Sheet[tuple[float, dict[float, Any]]]:
    """Return results as a table with a row a height and a column a width."""
    rows: dict[float, dict[float, Any]] = {}
    for result in results:
        rows.setdefault(result.peak, {})[result.sigma_px] = result

    def column(sigma: float) -> Column[tuple[float, dict[float, Any]]]:
        return Column(f"{sigma:g}", lambda row: text(row[1][sigma]), unit="px")

    sigmas = sorted({result.sigma_px for result in results})
    peak: Column[tuple[float, Any]] = Column("peak", lambda row: row[0], "{:g} %", scale=100)
    return Sheet([peak, *map(column, sigmas)], list(rows.items()))


def efficiency_grid(cells: list[Cell], engine: Engine, count: int) -> RichTable:
    """Return the efficiencies as a table, a row a height: one pass, then two."""
    return _grid(cells, lambda cell: f"{cell.one_pass:.3f}/{cell.two_pass:.3f}").terminal(
        f"Efficiency with one pass / two passes, engine {engine}, {count} lines a cell",
        "mean square error of the efficient score over the detector's, on the same lines",
    )


def skew_grid(one: Floats, two: Floats, peaks: Sequence[float] = SKEW_PEAKS) -> RichTable:
    """Return the places of a skewed spot as a table, and how far it moves."""
    rows = [
        [name, *(f"{place:.3f}" for place in places), f"{np.ptp(places):.4f}"]
        for name, places in (("one pass", one), ("two passes", two))
    ]
    names = ["peak", *(f"{100 * peak:.0f} %" for peak in peaks), "moves by"]
    return listed(names, rows, left=1).terminal(
        f"A spot with sides of {1 - SKEW:g} s and {1 + SKEW:g} s, s = {SKEW_SIGMA_PX:g} px: px "
        "from its highest place"
    )


def slope_grid(results: list[Slope]) -> RichTable:
    """Return what a slope does as a table, a row a height."""

    def text(each: Slope) -> str:
        return f"{1e3 * each.bias:+.2f}; {1e3 * each.level_rms:.1f}, {1e3 * each.rms:.1f}"

    return _grid(results, text).terminal(
        f"A background that slopes by {SLOPE:g} count/px, two passes: bias, and rms without and "
        "with it, 1e-3 px"
    )
