"""The search for the best value of each detector's one parameter, on separate training cells.

Each value of a grid is judged by the geometric mean, over the cells, of rms over bound; a lost line
counts as an error of ``LOST_PX``. The test cells have other random numbers, and also include other
spots.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from rich.table import Table as RichTable

from vrscan.data.config import Config
from vrscan.detectors.catalogue import Detector, detectors
from vrscan.detectors.patch import REACH
from vrscan.ideal.statistics import statistics
from vrscan.show.sheet import Column, Sheet, words
from vrscan.study.bench.cells import Cell, Figures, configuration, plain
from vrscan.study.bench.detect import source
from vrscan.study.report.efficiency import LOST_PX
from vrscan.study.report.spot_lines import Spot, mean_square, score, take

WORK = "vrscan.study.bench.tune:train"
SEED = 19860200  # no test uses it
SIGMAS_PX, PEAKS = (1.0, 1.7, 3.0, 5.0, 9.0), (0.05, 0.25, 0.7)
LINES = 2000


@dataclass(frozen=True)
class Trial:
    """One value of one detector's parameter."""

    detector: Detector
    value: float
    ratio: float  # geometric mean of rms over bound


def cells(config: Config, lines: int = LINES) -> list[Cell]:
    """Return the training cells."""
    common: dict[str, Any] = {"config": plain(config), "lines": lines}
    return [
        Cell(WORK, {**common, "sigma_px": sigma, "peak": peak}, SEED)
        for peak in PEAKS
        for sigma in SIGMAS_PX
    ]


def train(parameters: dict[str, Any], seed: int) -> Figures:
    """Return log(rms over bound) of every value of every detector on spots of one kind."""
    config, count = configuration(parameters), int(parameters["lines"])
    taken = take(Spot.of(parameters), count, config, source(parameters, seed))
    row = statistics(taken.lines, max_window=2 * REACH + 1)
    bound = float(np.sqrt(taken.bound.mean()))
    figures: Figures = {}
    for each in detectors():
        logs = []
        for value in each.grid:
            found = each.locate(taken.lines, row.background, row.noise, config, value)
            result = score(found, taken.true)
            square = mean_square(result.rms, result.lost)
            logs.append(0.5 * math.log(square) - math.log(bound))
        figures[each.key] = logs
    return figures


def trials(figures: Sequence[Figures]) -> list[Trial]:
    """Return the result of each value, in the order of catalogue and grid."""
    found = []
    for each in detectors():
        means = np.mean([cell[each.key] for cell in figures], axis=0) if each.grid else []
        found += [
            Trial(each, value, math.exp(mean)) for value, mean in zip(each.grid, means, strict=True)
        ]
    return found


def best(found: Sequence[Trial]) -> dict[str, Trial]:
    """Return the best value of each detector, by its short name."""
    chosen: dict[str, Trial] = {}
    for trial in found:
        held = chosen.get(trial.detector.key, trial)
        chosen[trial.detector.key] = min(held, trial, key=lambda t: t.ratio)
    return chosen


def table(found: Sequence[Trial]) -> RichTable:
    """Return the search for the terminal: the best of each grid, and what is built in."""
    chosen = best(found)

    def marks(trial: Trial) -> str:
        own = trial.detector
        named = ["best"] * (chosen[own.key] is trial) + ["built in"] * (trial.value == own.value)
        return ", ".join(named)

    columns: list[Column[Trial]] = [
        words("detector", lambda trial: trial.detector.title),
        words("parameter", lambda trial: trial.detector.parameter),
        Column("value", lambda trial: trial.value, "{:g}"),
        Column("rms / bound", lambda trial: trial.ratio, "{:.4f}"),
        Column("", marks),
    ]
    return Sheet(columns, found).terminal(
        "Geometric mean of rms over the Cramer-Rao bound",
        f"s = {', '.join(f'{s:g}' for s in SIGMAS_PX)} px, "
        f"{', '.join(f'{100 * p:g}' for p in PEAKS)} % of full scale; lost lines at {LOST_PX:g} px",
        apart=lambda trial: trial.detector.key,
    )
