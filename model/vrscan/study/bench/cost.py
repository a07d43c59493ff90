"""The cost of a detector: lines/s of its float form here, clocks and cells of its RTL."""

import csv
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from vrscan.data.arrays import Pixels
from vrscan.data.config import Config
from vrscan.detectors.catalogue import Detector, detectors
from vrscan.engines.tools import build_folder
from vrscan.ideal.statistics import statistics
from vrscan.study.bench.cells import Figures, configuration
from vrscan.study.bench.detect import source
from vrscan.study.bench.instrument import CHUNK, MAX_WINDOW, best, reference
from vrscan.study.report.spot_lines import Spot, take

WORK = "vrscan.study.bench.cost:software"
TIMING = "make timing"  # writes the results of the place and route tools


def software(parameters: dict[str, Any], seed: int) -> Figures:
    """Return the lines/s of each detector on one core, a timed work.

    Each run starts from whole lines and ends at positions: background and noise of the line
    are taken first, which the chain does for itself; it also goes on to (x, z).

    Args:
        parameters: ``config``, ``lines`` and the fields of ``Spot`` that differ from the defaults.
        seed: Seed of the lines.

    Returns:
        ``rates`` by short name, and under ``reference`` the rate of the statistics alone.
    """
    config, count = configuration(parameters), int(parameters["lines"])
    lines = take(Spot.of(parameters), count, config, source(parameters, seed)).lines
    works: dict[str, Callable[[], object]] = {
        "reference": lambda: reference(lines),
        **{each.key: partial(_whole, each, lines, config) for each in detectors()},
    }
    seconds = best(works)
    return {"rates": {name: count / seconds[name] for name in works}, "lines": count}


def _whole(each: Detector, lines: Pixels, config: Config) -> None:
    """Find the positions of whole lines."""
    if each.engine:
        nothing = np.zeros(len(lines))
        each.locate(lines, nothing, nothing, config)
        return
    for start in range(0, len(lines), CHUNK):
        some = lines[start : start + CHUNK]
        row = statistics(some, max_window=MAX_WINDOW)
        each.locate(some, row.background, row.noise, config)


def timing() -> dict[str, dict[str, str]]:
    """Return the rows of ``make timing`` by module; none where it has not been run."""
    try:
        with (build_folder() / "timing" / "timing.csv").open(newline="") as file:
            return {row["module"]: row for row in csv.DictReader(file)}
    except (OSError, KeyError, csv.Error):
        return {}
