"""Speckled lines: the error of each way to a position, over the hardware that it takes."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from vrscan.data import pkg
from vrscan.detectors.catalogue import Detector, detector, rivals
from vrscan.fixed.square_root import latency as root_latency
from vrscan.fixed.vrscan_chain import MAX_WINDOW
from vrscan.show.sheet import Column, Sheet, listed, words
from vrscan.show.style import INK, QUIET, drawing, plain_log
from vrscan.study.bench import design_cost, detect
from vrscan.study.bench.bench_page import Block, Picture, Table, Text
from vrscan.study.bench.cells import Cell, Figures
from vrscan.study.bench.sections.design_space_section import SHIPPED, front
from vrscan.study.bench.sections.section import Found, Order, Section, is_own, look, png
from vrscan.study.report.spot_lines import most_contrast

LINES, QUICK_LINES = 2000, 100  # lines per cell
SIGMAS_PX, COUNTS, CONTRASTS = (1.5, 3.0, 5.0, 9.0), (400, 1000, 3000), (0.0, 0.21, 0.29)
SHOWN = ("one-pass", "two-pass", "fit", "likelihood", "centroid-height")  # and the rivals
ROOT_BITS = 12

_TWO_PASSES = dict.fromkeys(("peak_isolate", "phase_correlate", "peak_position", "peak_refine"), 1)
_PARTS = {part.module: part for part in (*design_cost.PARTS, design_cost.SECOND_PASS)}
_PARTS["phase_correlate"] = design_cost.WHOLE
_ROOTS = math.ceil(MAX_WINDOW * root_latency(ROOT_BITS) / pkg.FIT_PERIOD)


@dataclass(frozen=True)
class Hardware:
    """The modules that a detector takes, with their numbers, and why if it is an estimate."""

    modules: dict[str, int]
    estimate: str = ""


_SHARED = "passes share one data path: that of the fit"
_ESTIMATES = {
    "centroid-height": Hardware(
        {"peak_isolate": 1, "multiply": 2, "divide": 1}, "two sums and their quotient"
    ),
    "root": Hardware(
        {**_TWO_PASSES, "square_root": _ROOTS}, f"{_ROOTS} roots in turns for {MAX_WINDOW} px"
    ),
    "third-root": Hardware({**_TWO_PASSES, "quarter_wave": 2}, "tables of log2 and of its inverse"),
    "logarithm": Hardware({**_TWO_PASSES, "quarter_wave": 1}, "a table of log2"),
    "flanks": Hardware(
        {**_TWO_PASSES, "quarter_wave": 1, "multiply": 2, "divide": 1},
        "a table of powers, two sums and their quotient",
    ),
    "one-step": Hardware({**_TWO_PASSES, "peak_fit": 1}, _SHARED),
    "likelihood": Hardware({**_TWO_PASSES, "peak_fit": 1}, _SHARED),
}


def hardware(each: Detector) -> Hardware:
    """Return the modules of a detector: its own, or those that it would be made of."""
    if each.modules:
        return Hardware(dict.fromkeys(each.modules, 1))
    return _ESTIMATES[each.key]


@cache
def shown() -> tuple[Detector, ...]:
    """Return the detectors that are compared."""
    return (*map(detector, SHOWN), *rivals())


def _spot(order: Order, sigma: float, counts: int, contrast: float) -> Cell:
    full = 2**order.config.sensor.pixel_width
    spot = {"sigma_px": sigma, "peak": counts / full, "contrast": contrast}
    lines = order.size(LINES, QUICK_LINES)
    return order.cell(
        detect.WORK, {"lines": lines, **spot, "detectors": [each.key for each in shown()]}
    )


def _synthesis(module: str) -> Cell:
    return design_cost.cell(_PARTS.get(module, design_cost.Part(module, ())), SHIPPED)


def _spots() -> list[tuple[float, int, float]]:
    return [(s, h, c) for c in CONTRASTS for h in COUNTS for s in SIGMAS_PX]


def cells(order: Order) -> list[Cell]:
    """Return the spots, with speckle and without, and the synthesis of every module."""
    modules = dict.fromkeys(m for each in shown() for m in hardware(each).modules)
    return [*(_spot(order, *spot) for spot in _spots()), *map(_synthesis, modules)]


@dataclass(frozen=True)
class Row:
    """A detector: rms errors over a bound, geometric means over the spots, and its hardware."""

    detector: Detector
    by_contrast: tuple[float, ...]  # over the bound that knows of speckle, by ``CONTRASTS``
    worst: float  # of all speckled spots
    over_light: float  # over the bound of light alone, speckled spots
    lost: float  # largest share of lost lines
    lut: int
    dsp: float
    estimate: str

    @property
    def speckled(self) -> float:
        """Error over the bound of all speckled spots."""
        return float(np.exp(np.mean(np.log(self.by_contrast[1:]))))


def rows(order: Order, found: Found) -> list[Row]:
    """Return what each detector comes to."""
    grid = {spot: found(_spot(order, *spot)) for spot in _spots()}

    def mean(values: Sequence[float]) -> float:
        return float(np.exp(np.mean(np.log(values))))

    def over(key: str, bound: str, contrast: float) -> list[float]:
        return [
            cell["errors"][key]["rms"] / cell[bound]
            for (_, _, own), cell in grid.items()
            if own == contrast
        ]

    made = []
    for each in shown():
        own = hardware(each)
        parts = [(found(_synthesis(m)), n) for m, n in own.modules.items()]
        errors = {c: over(each.key, "speckled_px", c) for c in CONTRASTS}
        light = [r for c in CONTRASTS[1:] for r in over(each.key, "bound_px", c)]
        made.append(
            Row(
                detector=each,
                by_contrast=tuple(mean(errors[c]) for c in CONTRASTS),
                worst=max(max(errors[c]) for c in CONTRASTS[1:]),
                over_light=mean(light),
                lost=max(cell["errors"][each.key]["lost"] for cell in grid.values()),
                lut=round(sum(n * part["lut"] for part, n in parts)),
                dsp=sum(n * part["dsp"] for part, n in parts),
                estimate=own.estimate,
            )
        )
    return made


def blocks(order: Order, found: Found) -> Sequence[Block[Any]]:
    """Return the table and the picture of error over hardware."""
    made = rows(order, found)
    grid = {spot: found(_spot(order, *spot)) for spot in _spots()}
    correlation = most_contrast(order.config)[1]
    return [
        Text(
            "A rough surface in coherent light gives each pixel a gain of its own, so a flank "
            "tells as much of the position as the top. Errors are rms over the Cramér-Rao bound "
            "with speckle, shot noise and read noise; without speckle that is the bound of light "
            "alone. The bound takes the pixels' gains as independent, although neighbours have a "
            f"correlation of {correlation:.2f}: no detector reaches 1 where speckle leads."
        ),
        Picture(
            "speckle-pareto",
            _picture(made),
            "Error over hardware, geometric means over the spots. Filled: modules of this "
            "repository; hollow: an estimate from such modules. The step line joins what no other "
            "detector beats in both. The dashed line is the bound.",
        ),
        _table(order, made, grid),
    ]


def _table(
    order: Order, made: list[Row], grid: dict[tuple[float, int, float], Figures]
) -> Table[Row]:
    def column(k: int) -> Column[Row]:
        head = f"C = {CONTRASTS[k]:g}" if CONTRASTS[k] else "no speckle"
        return Column(f"over bound,\n{head}", lambda row: row.by_contrast[k], "{:.2f}")

    columns: list[Column[Row]] = [
        words("detector", lambda row: row.detector.title),
        *(column(k) for k in (1, 2)),
        Column("\nworst", lambda row: row.worst, "{:.2f}"),
        column(0),
        Column("speckled, over\nlight's bound", lambda row: row.over_light, "{:.2f}"),
        Column("lost,\nworst", lambda row: row.lost, "{:.2f} %", scale=100.0),
        Column("\nLUT", lambda row: row.lut, "{:,}"),
        Column("\nDSP", lambda row: row.dsp, "{:g}"),
        words("estimated from", lambda row: row.estimate, wraps=True),
    ]
    values = [
        [key, s, h, c, cell["lines"], cell["bound_px"], cell["speckled_px"], error["rms"],
         error["bias"], error["lost"]]
        for (s, h, c), cell in grid.items() for key, error in cell["errors"].items()
    ]  # fmt: skip
    names = ("detector", "sigma_px", "counts", "contrast", "lines", "bound_px", "speckled_px",
             "rms_px", "bias_px", "lost")  # fmt: skip
    return Table(
        "speckle",
        Sheet(columns, made),
        f"s = {', '.join(f'{s:g}' for s in SIGMAS_PX)} px, {', '.join(map(str, COUNTS))} counts "
        f"high, {order.size(LINES, QUICK_LINES)} lines each, whose speckle differs from line to "
        "line; geometric means. The rms is of the lines that are not lost. LUT and DSP: "
        "synth_ecp5 of each module alone, not placed; an estimate adds up modules of the same "
        "kind of work.",
        key=lambda row: f"speckle-{row.detector.key}",
        bold=lambda row: is_own(row.detector.key, order.config),
        full=listed(names, values),
    )


def _panel(axes: Axes, made: list[Row], errors: list[float], title: str) -> None:
    for row, error in zip(made, errors, strict=True):
        how = look(row.detector.key)
        fill = "none" if row.estimate else how.colour
        style: dict[str, Any] = {"markerfacecolor": fill, "markeredgecolor": how.colour}
        name = row.detector.title + (" (estimate)" if row.estimate else "")
        axes.plot(row.lut, error, how.marker, markersize=9, label=name, **style)
    best = front([(row.lut, error) for row, error in zip(made, errors, strict=True)])
    place = [(made[k].lut, errors[k]) for k in best]
    axes.step(*zip(*place, strict=True), where="post", color=QUIET, linewidth=1.0, zorder=0)
    axes.axhline(1.0, color=INK, linewidth=1.1, linestyle=(0, (4, 2)))
    axes.set(xlabel="LUT", title=title, yscale="log")
    axes.set_xlim(0.0, 1.1 * max(row.lut for row in made))
    low, high = axes.get_ylim()
    axes.set_ylim(min(low, 0.95), max(high, 1.1))
    plain_log(axes, "y", (1.0, 1.2, 1.5, 2.0, 3.0, 5.0, 10.0))


def _picture(made: list[Row]) -> bytes:
    with drawing(10.6, 4.2) as figure:
        speckled, plain = figure.subplots(1, 2)
        both = " and ".join(f"{c:g}" for c in CONTRASTS[1:])
        _panel(speckled, made, [row.speckled for row in made], f"Speckle, contrast {both}")
        _panel(plain, made, [row.by_contrast[0] for row in made], "No speckle")
        speckled.set_ylabel("rms error over the bound")
        figure.legend(*speckled.get_legend_handles_labels(), loc="outside right center", fontsize=8)
        return png(figure)


SECTION = Section("speckle", "Speckle: error over hardware", cells, blocks)
