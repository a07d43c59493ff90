"""The shipped detector compared with the Cramer-Rao bound: the study behind the thresholds.

The lines have 12 bits, 5 electrons per count, read noise 3 counts, background 60 counts, and
Gaussian spots whose centres are anywhere between two pixels. (8) as printed (period N - 1,
threshold from the row's mean and deviation, the pedestal left in) is measured on the same lines as
the shipped detector, and so are one window and two; ``vrscan.study.report.two_pass_report`` has
more about these.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from itertools import product

import numpy as np
from rich.table import Table as RichTable

from vrscan.data.arrays import Floats
from vrscan.data.config import Config
from vrscan.data.lines import Lines
from vrscan.data.table import Table
from vrscan.detectors.plain import plain_lines
from vrscan.engines.engine import Engine, run
from vrscan.scene.sensor import cramer_rao_variance, expose, spot_electrons
from vrscan.show.sheet import Column, Sheet
from vrscan.study.progress import Progress, for_each
from vrscan.study.report.figure import SEED

SIGMAS_PX = (1.0, 2.0, 4.0, 8.0, 12.0)
PEAKS = (0.05, 0.20, 0.50, 0.90)  # heights, shares of full scale
READ_NOISE_COUNTS = 3.0
BACKGROUND_COUNTS = 60.0
LOST_PX = 5.0  # a position further off counts as lost
GOAL_EFFICIENCY, GOAL_LOST = 0.90, 0.002


@dataclass(frozen=True)
class Score:
    """The score of one detector in one cell."""

    efficiency: float  # bound variance over mean square error of the lines that are not lost
    rms_px: float
    lost: float  # share of lines without a position or more than LOST_PX off
    rival: float  # share of lines flagged RIVAL, though there is one spot only


@dataclass(frozen=True)
class Cell:
    """The scores for one width and height of the spot."""

    sigma_px: float
    peak: float
    bound_px: float
    shipped: Score
    one_pass: Score
    two_pass: Score
    printed: Score


def as_printed(config: Config) -> Config:
    """Return the configuration in which the detector is the paper's."""
    update = {"period": "n-1", "window": "threshold", "noise": "row", "k_height": 0.0}
    peak = config.peak.model_copy(update={**update, "k_noise": 1.0, "snr_min": 2.0})
    return config.model_copy(update={"peak": peak})


def with_window(config: Config, window: str) -> Config:
    """Return the configuration with this window, a value of ``peak.window``."""
    update = {"window": window} | ({} if window == "threshold" else {"period": "n"})
    return config.model_copy(update={"peak": config.peak.model_copy(update=update)})


def cell_lines(
    sigma_px: float, peak: float, count: int, config: Config
) -> tuple[Lines, Floats, Floats]:
    """Return noisy lines of one spot each.

    Args:
        sigma_px: Standard deviation of the spot.
        peak: Height of the spot, share of full scale.
        count: Number of lines.
        config: Sensor and conversion factor.

    Returns:
        The lines, the true positions in px [count] and the bound on their variance, px^2 [count].
    """
    rng = np.random.default_rng([SEED, round(100 * sigma_px), round(1000 * peak)])
    length, kappa = config.sensor.line_length, config.peak.kappa
    true = rng.uniform(0.25 * length, 0.75 * length, count)
    sigma = np.full(count, sigma_px)
    height = np.full(count, peak * 2**config.sensor.pixel_width / kappa)
    electrons = spot_electrons(true, sigma, height, length)
    step = 1e-3
    ahead = spot_electrons(true + step, sigma, height, length)
    behind = spot_electrons(true - step, sigma, height, length)
    dark = (READ_NOISE_COUNTS**2 + 1.0 / 12.0) / kappa**2 + BACKGROUND_COUNTS / kappa
    bound = cramer_rao_variance(electrons, (ahead - behind) / (2.0 * step), dark)
    lines = expose(
        electrons,
        rng,
        background_counts=BACKGROUND_COUNTS,
        read_noise_counts=READ_NOISE_COUNTS,
        kappa=kappa,
        pixel_width=config.sensor.pixel_width,
    )
    return plain_lines(lines, config), true, bound


def _score(result: Table, true: Floats, bound: Floats) -> Score:
    error = result.position_px - true
    good = result.measured & (np.abs(error) <= LOST_PX)
    square = float(np.square(error[good]).mean()) if good.any() else float("inf")
    return Score(
        efficiency=float(bound.mean()) / square,
        rms_px=square**0.5,
        lost=1.0 - float(good.mean()),
        rival=float(result.flags["RIVAL"].mean()),
    )


def study(
    engine: Engine,
    config: Config,
    count: int,
    progress: Progress | None = None,
    *,
    jobs: int = 1,
) -> list[Cell]:
    """Return the score of every width and height.

    Args:
        engine: The engine that detects.
        config: The configuration, whose thresholds are under test.
        count: Number of lines per cell.
        progress: Called with the number of cells done so far.
        jobs: Number of processes, which share the cells.
    """
    return for_each(
        partial(_cell, engine, config, count), product(PEAKS, SIGMAS_PX), progress, jobs
    )


def _cell(engine: Engine, config: Config, count: int, spot: tuple[float, float]) -> Cell:
    peak, sigma = spot
    lines, true, bound = cell_lines(sigma, peak, count, config)
    return Cell(
        sigma_px=sigma,
        peak=peak,
        bound_px=float(bound.mean()) ** 0.5,
        shipped=_score(run(engine, lines, config), true, bound),
        one_pass=_score(run(engine, lines, with_window(config, "threshold")), true, bound),
        two_pass=_score(run(engine, lines, with_window(config, "two_pass")), true, bound),
        printed=_score(run(engine, lines, as_printed(config)), true, bound),
    )


def geometric_mean(scores: list[Score]) -> float:
    """Return the geometric mean of the efficiency."""
    return float(np.exp(np.mean([np.log(score.efficiency) for score in scores])))


def worst_lost(scores: list[Score]) -> float:
    """Return the largest share of lost lines in any cell."""
    return max(score.lost for score in scores)


def _scores(
    name: str, of: Callable[[Cell], Score], *, lost: bool = True, rival: bool = False
) -> Iterator[Column[Cell]]:
    """Return the columns of a detector's scores."""
    yield Column(name, lambda c: of(c).rms_px, "{:.2f}", scale=1e3)
    yield Column("eff.", lambda c: of(c).efficiency, "{:.3f}")
    if lost:
        yield Column("lost", lambda c: of(c).lost, "{:.2f}", unit="%", scale=100)
    if rival:
        yield Column("RIVAL", lambda c: of(c).rival, "{:.2f}", unit="%", scale=100)


def efficiency_table(cells: list[Cell], engine: Engine, count: int) -> RichTable:
    """Return the study as a table for the terminal: bound, shipped detector, its windows, (8)."""
    columns: list[Column[Cell]] = [
        Column("peak", lambda c: c.peak, "{:.0f} %", scale=100),
        Column("s,", lambda c: c.sigma_px, "{:g}", unit="px"),
        Column("bound", lambda c: c.bound_px, "{:.2f}", scale=1e3),
        *_scores("set", lambda c: c.shipped, rival=True),
        *_scores("one pass", lambda c: c.one_pass, lost=False),
        *_scores("two", lambda c: c.two_pass, lost=False),
        *_scores("(8)", lambda c: c.printed),
    ]
    return Sheet(columns, cells).terminal(
        f"Efficiency as configured, with one pass and with two, engine {engine}, {count} lines a "
        "cell",
        "rms errors in 1e-3 px: the bound's, as configured, with one pass, with two, and of (8) as "
        "printed; eff. = bound variance / mean square error; lost = no position or more than "
        f"{LOST_PX:g} px off",
        apart=lambda c: c.peak,
    )
