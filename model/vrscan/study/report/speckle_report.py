"""The kinds of window on speckled spots, against both Cramer-Rao bounds, and what sigma says there.

Sensor and noise are those of ``study.report.efficiency``; every line has speckle of its own, as
``study.report.spot_lines`` makes it. One bound is that of light alone, which no detector comes near
where speckle leads; the other knows of speckle, too, with pixels whose gains are independent.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import product

import numpy as np
from rich.table import Table as RichTable

from vrscan.data.arrays import Floats
from vrscan.data.config import Config
from vrscan.data.residuals import rms
from vrscan.detectors.plain import plain_lines
from vrscan.engines.engine import Engine, run
from vrscan.show.sheet import Column, Sheet
from vrscan.study.progress import Progress, for_each
from vrscan.study.report.efficiency import LOST_PX
from vrscan.study.report.spot_lines import Spot, take

CONTRASTS, PEAKS, SIGMAS_PX = (0.21, 0.29), (0.1, 0.25, 0.7), (1.5, 3.0, 6.0, 9.0)
SPOTS = len(CONTRASTS) * len(PEAKS) * len(SIGMAS_PX)
WINDOWS = ("threshold", "two_pass", "fit")
_SEED = 20100303


@dataclass(frozen=True)
class Score:
    """The score of one kind of window; lost lines count only in ``lost``."""

    rms_px: float
    lost: float  # share of lines without a position or more than LOST_PX off
    ratio: float  # rms of error over sigma
    within: float  # share of lines within 2 sigma


@dataclass(frozen=True)
class Cell:
    """The scores for one contrast, height and width."""

    contrast: float
    peak: float
    sigma_px: float
    bound_px: float  # of light alone
    speckled_px: float  # with speckle
    scores: dict[str, Score]  # by window

    def efficiency(self, window: str) -> float:
        """Return the variance of the bound with speckle over the mean square error."""
        return (self.speckled_px / self.scores[window].rms_px) ** 2


def study(
    engine: Engine,
    config: Config,
    count: int,
    progress: Progress | None = None,
    *,
    jobs: int = 1,
) -> list[Cell]:
    """Return the scores of every contrast, height and width.

    Args:
        engine: The engine that detects.
        config: Thresholds and sensor; every kind of window is taken in turn.
        count: Number of lines per cell.
        progress: Called with the number of cells done so far.
        jobs: Number of processes, which share the cells.
    """
    spots = product(CONTRASTS, PEAKS, SIGMAS_PX)
    return for_each(partial(_cell, engine, config, count), spots, progress, jobs)


def _cell(engine: Engine, config: Config, count: int, spot: tuple[float, float, float]) -> Cell:
    contrast, peak, sigma = spot
    rng = np.random.default_rng([_SEED, *(round(1000 * each) for each in spot)])
    taken = take(Spot(sigma, peak, contrast=contrast), count, config, rng)
    lines = plain_lines(taken.lines, config)
    scores = {}
    for window in WINDOWS:
        changed = config.peak.model_copy(update={"window": window, "period": "n"})
        result = run(engine, lines, config.model_copy(update={"peak": changed}))
        error = np.abs(result.position_px - taken.true)
        good = result.measured & (error <= LOST_PX)
        ratio = error[good] / result.sigma_px[good]
        lost = 1.0 - float(good.mean())
        scores[window] = Score(rms(error[good]), lost, rms(ratio), float((ratio <= 2.0).mean()))
    bound, speckled = (float(np.sqrt(each.mean())) for each in (taken.bound, taken.speckled))
    return Cell(contrast, peak, sigma, bound, speckled, scores)


def mean_efficiency(cells: Sequence[Cell], window: str) -> float:
    """Return the geometric mean of the efficiency."""
    logs: Floats = np.log([cell.efficiency(window) for cell in cells])
    return float(np.exp(logs.mean()))


def _columns(window: str, name: str) -> Iterator[Column[Cell]]:
    yield Column(name, lambda c: c.scores[window].rms_px, "{:.1f}", scale=1e3)
    yield Column("eff.", lambda c: c.efficiency(window), "{:.3f}")


def speckle_table(cells: Sequence[Cell], engine: Engine, count: int) -> RichTable:
    """Return the study as a table for the terminal: both bounds, and each kind of window."""
    columns: list[Column[Cell]] = [
        Column("C", lambda c: c.contrast, "{:g}"),
        Column("peak", lambda c: c.peak, "{:.0f} %", scale=100),
        Column("s,", lambda c: c.sigma_px, "{:g}", unit="px"),
        Column("bound", lambda c: c.bound_px, "{:.1f}", scale=1e3),
        Column("speckled", lambda c: c.speckled_px, "{:.1f}", scale=1e3),
        *_columns("threshold", "one pass"),
        *_columns("two_pass", "two"),
        *_columns("fit", "fit"),
        Column("lost", lambda c: c.scores["fit"].lost, "{:.2f}", unit="%", scale=100),
        Column("error/sigma", lambda c: c.scores["fit"].ratio, "{:.2f}"),
        Column("2 sigma", lambda c: c.scores["fit"].within, "{:.1f} %", scale=100),
    ]
    return Sheet(columns, cells).terminal(
        f"Speckled lines with each kind of window, engine {engine}, {count} lines a cell",
        "rms errors in 1e-3 px: the bound of light alone, that with speckle, and with one pass, "
        "two and a fit; eff. = variance of the bound with speckle / mean square error; the last "
        "three of the fit",
        apart=lambda c: (c.contrast, c.peak),
    )
