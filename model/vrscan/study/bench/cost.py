"""The cost of a detector: lines/s of its float form here, clocks and cells of its RTL."""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np

from vrscan.data.arrays import Pixels
from vrscan.data.config import Config
from vrscan.detectors.catalogue import Detector, detectors
from vrscan.engines.tools import repository_root
from vrscan.ideal.statistics import statistics
from vrscan.study.bench.cells import Figures, configuration
from vrscan.study.bench.detect import source
from vrscan.study.bench.instrument import CHUNK, MAX_WINDOW, best, reference
from vrscan.study.report.spot_lines import Spot, take

WORK = "vrscan.study.bench.cost:software"
TIMING = "docs/numbers.md"  # whose table scripts/timing.py --write makes


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
    """Return the rows of the page's table of modules, placed and routed alone, by module.

    Returns:
        None where the package is installed without its pages.
    """
    page = repository_root() / TIMING
    block = page.read_text().partition("<!-- timing: begin -->")[2] if page.exists() else ""
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in block.splitlines()]
    names = ("module", "fmax_mhz", "lut", "ff", "ebr", "dsp")
    return {row[0]: dict(zip(names, row, strict=True)) for row in rows if len(row) == len(names)}


def cells_of(modules: Sequence[str]) -> tuple[int, float] | None:
    """Return LUT and DSP of RTL modules, None where the page does not have all of them."""
    placed = timing()
    if not modules or any(name not in placed for name in modules):
        return None
    return (
        sum(int(placed[name]["lut"]) for name in modules),
        sum(float(placed[name]["dsp"]) for name in modules),
    )
