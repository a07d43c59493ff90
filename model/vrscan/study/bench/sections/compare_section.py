"""Comparison of the detectors: the error of each over all spots, and its cost."""

import itertools
from collections.abc import Sequence
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from vrscan.detectors.catalogue import Detector, detectors
from vrscan.fixed import peak_position, peak_refine, phase_correlate
from vrscan.show.style import INK, LIGHT, STYLE
from vrscan.study.bench import cost, detect
from vrscan.study.bench.bench_page import Block, Heading, Picture, Row, Table, Text, number
from vrscan.study.bench.cells import Cell, plain
from vrscan.study.bench.sections.section import Found, Order, Section, look, png
from vrscan.study.report.efficiency import LOST_PX, PEAKS, SIGMAS_PX

LINES, QUICK_LINES = 5000, 300  # lines per cell
SHOWN_PEAK = 0.5  # height whose rms the table shows
SPEED_SIGMA_PX = 4.0
WINDOW_PX = 32  # window for which clocks are stated
FIRST_PX = 16  # first of two windows for which clocks are stated
SHIPPED = "shipped"
FAINT = 0.02  # share of full scale: fainter than the spots of the mean
MAPPED = ("printed", "shipped", "two-pass", "likelihood")  # shown by spot


def _spot(order: Order, sigma: float, peak: float) -> Cell:
    count = QUICK_LINES if order.quick else LINES
    parameters = {"config": plain(order.config), "lines": count}
    return Cell(detect.WORK, {**parameters, "sigma_px": sigma, "peak": peak}, order.seed)


def _speed(order: Order) -> Cell:
    parameters: dict[str, Any] = {"config": plain(order.config), "peak": SHOWN_PEAK}
    parameters |= {"lines": 512 if order.quick else 2048, "sigma_px": SPEED_SIGMA_PX}
    return Cell(cost.WORK, parameters, order.seed, timed=True)


def cells(order: Order) -> list[Cell]:
    """Return the spots of ``vrscan efficiency``, fainter ones, and the speed."""
    grid = [_spot(order, sigma, peak) for peak in (FAINT, *PEAKS) for sigma in SIGMAS_PX]
    return [*grid, _speed(order)]


def _efficiency(bound: float, error: dict[str, float]) -> float:
    """Return the bound over the mean square error, with an error of ``LOST_PX`` for lost lines."""
    kept = 0.0 if error["lost"] == 1.0 else (1.0 - error["lost"]) * error["rms"] ** 2
    return bound**2 / (kept + error["lost"] * LOST_PX**2)


def _tuned(each: Detector) -> str:
    return f"{each.parameter}: {each.value:g}" if each.grid else each.parameter


def blocks(order: Order, found: Found) -> Sequence[Block]:
    """Return the table of errors, the table of costs and the picture of one over the other."""
    grid = {(s, p): found(_spot(order, s, p)) for p in PEAKS for s in SIGMAS_PX}
    listed = detectors()
    every = {
        each.key: np.array(
            [_efficiency(cell["bound_px"], cell["errors"][each.key]) for cell in grid.values()]
        )
        for each in listed
    }
    mean = {key: float(np.exp(np.log(values).mean())) for key, values in every.items()}
    speed = found(_speed(order))
    count = next(iter(grid.values()))["lines"]
    return [
        Text(
            "Every detector gets the same lines: one Gaussian spot anywhere between two pixels, 12 "
            "bits, 5 electrons a count, shot noise, read noise of 3 counts, 60 counts of "
            "background. Each was given its best parameter by a search on other spots and other "
            "random numbers (<code>vrscan bench tune</code>). The efficiency is the Cramér-Rao "
            "bound's variance over the mean square error, so 1 is all that light and noise allow."
        ),
        Heading("error", "Error against the bound"),
        _errors(listed, grid, every, mean, count),
        _map(listed, order, found),
        Heading("cost", "What each costs"),
        _costs(listed, speed, mean),
        Picture(
            "speed-error",
            _picture(listed, speed["rates"], mean),
            "Speed over error: lines a second of the software on one core, over rms error in units "
            "of the bound, geometric mean over the 20 spots. Left is better, higher is faster. The "
            "dashed line is the bound; the RTL of (8) takes a line every 2048 clocks whatever its "
            "window.",
        ),
    ]


def _errors(
    listed: Sequence[Detector],
    grid: dict[tuple[float, float], dict[str, Any]],
    every: dict[str, Any],
    mean: dict[str, float],
    count: int,
) -> Table:
    bounds = [1e3 * grid[s, SHOWN_PEAK]["bound_px"] for s in SIGMAS_PX]
    rows = [Row("detector-bound", ["Cramér-Rao bound", "", "1", "1", "", *map(number, bounds)])]
    values: list[list[Any]] = []
    for each in listed:
        errors = {at: cell["errors"][each.key] for at, cell in grid.items()}
        shown = [1e3 * errors[s, SHOWN_PEAK]["rms"] for s in SIGMAS_PX]
        lost = max(error["lost"] for error in errors.values())
        rows.append(
            Row(
                f"detector-{each.key}",
                [
                    each.title,
                    _tuned(each),
                    f"{mean[each.key]:.3f}",
                    f"{every[each.key].min():.3f}",
                    f"{100.0 * lost:.2f} %" if lost else "0",
                    *map(number, shown),
                ],
                bold=each.key == SHIPPED,
            )
        )
        for (sigma, peak), error in errors.items():
            bound = grid[sigma, peak]["bound_px"]
            kept = [error[name] for name in ("rms", "bias", "spread", "lost")]
            score = _efficiency(bound, error)
            values.append([each.key, each.value, sigma, peak, count, bound, *kept, score])
    return Table(
        "detectors",
        [
            "detector",
            "tuned",
            "efficiency,\ngeometric mean",
            "\nworst",
            "lost,\nworst",
            *(f"rms, 1e-3 px\ns = {s:g} px" for s in SIGMAS_PX),
        ],
        rows,
        f"Efficiency over 20 spots: s = {', '.join(f'{s:g}' for s in SIGMAS_PX)} px, "
        f"{', '.join(f'{100 * p:.0f}' for p in PEAKS)} % of full scale; {count} lines each, so an "
        f"rms is known to {100.0 / (2.0 * count) ** 0.5:.1f} %. Lost: no position, or more than "
        f"{LOST_PX:g} px off. The rms columns are at {100 * SHOWN_PEAK:.0f} % of full scale.",
        ["detector", "parameter", "sigma_px", "peak", "lines", "bound_px", "rms_px", "bias_px",
         "spread_px", "lost", "efficiency"],
        values,
    )  # fmt: skip


def _map(listed: Sequence[Detector], order: Order, found: Found) -> Table:
    """Return the efficiency of the instrument's detectors by width and height of the spot."""
    rows: list[Row] = []
    values: list[list[Any]] = []
    for each in listed:
        if each.key not in MAPPED:
            continue
        for peak in (FAINT, *PEAKS):
            scores = []
            for sigma in SIGMAS_PX:
                cell = found(_spot(order, sigma, peak))
                error = cell["errors"][each.key]
                scores.append(_efficiency(cell["bound_px"], error))
                values.append([each.key, peak, sigma, scores[-1], error["lost"]])
            percent = f"{100.0 * peak:g}"
            texts = [f"{each.title}, {percent} %", *(f"{score:.3f}" for score in scores)]
            rows.append(Row(f"map-{each.key}-{percent}", texts, bold=each.key == SHIPPED))
    return Table(
        "efficiency",
        ["efficiency: detector, height", *(f"s = {s:g} px" for s in SIGMAS_PX)],
        rows,
        "Bound's variance over mean square error by width and height of the spot, in per cent of "
        f"full scale. The means above are without the {100.0 * FAINT:g} %.",
        ["detector", "peak", "sigma_px", "efficiency", "lost"],
        values,
    )


def _cells_of(modules: Sequence[str]) -> tuple[int, float] | None:
    """Return LUT and DSP of RTL modules, None where the tools have not been run on all of them."""
    placed = cost.timing()
    if not modules or any(name not in placed for name in modules):
        return None
    return (
        sum(int(placed[name]["lut"]) for name in modules),
        sum(float(placed[name]["dsp"]) for name in modules),
    )


def _clocks(each: Detector) -> int | None:
    """Return the clocks from a window's last pixel to the position, None without RTL."""
    if not each.modules:
        return None
    clocks = phase_correlate.latency(WINDOW_PX) + peak_position.LATENCY
    if "peak_refine" in each.modules:
        clocks += phase_correlate.first_latency(FIRST_PX) + peak_refine.latency()
    return clocks


def _costs(listed: Sequence[Detector], speed: dict[str, Any], mean: dict[str, float]) -> Table:
    rates = speed["rates"]
    reference = rates["reference"]
    rows = [Row("cost-reference", ["statistics alone", number(reference), "1"] + [""] * 3)]
    values: list[list[Any]] = [["reference", reference, 1.0, None, None, None, None]]
    for each in listed:
        rate, cells_of = rates[each.key], _cells_of(each.modules)
        if cells_of:
            lut, dsp = f"{cells_of[0]:,}", f"{cells_of[1]:g}"
        else:
            lut = dsp = f"run {cost.TIMING}" if each.modules else "no RTL"
        clocks = _clocks(each)
        took = "no RTL" if clocks is None else f"{clocks}"
        rows.append(
            Row(
                f"cost-{each.key}",
                [each.title, number(rate), f"{rate / reference:.2f}", took, lut, dsp],
                bold=each.key == SHIPPED,
            )
        )
        values.append(
            [
                each.key,
                rate,
                rate / reference,
                clocks,
                *(cells_of or (None, None)),
                mean[each.key],
            ]
        )
    return Table(
        "cost",
        [
            "detector",
            "software,\nlines/s",
            "over\nreference",
            f"clocks,\nwindow of {WINDOW_PX} px",
            "\nLUT",
            "\nDSP",
        ],
        rows,
        f"Software: {speed['lines']} lines of 2048 px, s = {SPEED_SIGMA_PX:g} px at "
        f"{100 * SHOWN_PEAK:.0f} % of full scale, from pixels to positions on one core, best of "
        "three rounds in turns; processor time. The reference is the named work that all need: "
        "maximum, mean and variance of every line in numpy, measured in the same run; compare "
        "machines by the ratio. (8) and T = N run the whole chain, to (x, z) and its deviation. "
        "Clocks: from the window's last pixel to the position, with two passes from the first "
        f"window's, {FIRST_PX} px; a line takes as many clocks as it has pixels, whatever the "
        "window. LUT and DSP: window, correlator and position, and what makes the second window, "
        f"each module placed alone, from <code>{cost.TIMING}</code>; the correlator does both "
        "periods and one pass or two.",
        ["detector", "lines_per_s", "over_reference", "clocks", "lut", "dsp", "efficiency"],
        values,
    )


def _picture(listed: Sequence[Detector], rates: dict[str, float], mean: dict[str, float]) -> bytes:
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(9.4, 4.6), layout="constrained")
        axes = figure.subplots()
        axes.grid(color=LIGHT, linewidth=0.5)
        axes.set_axisbelow(True)
        for each in listed:
            how, off = look(each.key), mean[each.key] ** -0.5
            axes.plot(off, rates[each.key], how.marker, color=how.colour, markersize=8)
        axes.axvline(1.0, color=INK, linewidth=1.1, linestyle=(0, (4, 2)))
        axes.set_xscale("log")
        axes.set_yscale("log")
        low, high = axes.get_xlim()
        axes.set_xlim(min(low, 0.95), 1.5 * high)
        ticks = [t for t in (1.0, 1.1, 1.2, 1.5, 2.0, 3.0, 5.0, 10.0, 20.0) if t < 1.5 * high]
        axes.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
        bottom, top = axes.get_ylim()
        levels = [k * 10.0**e for e in range(3, 7) for k in (1, 2, 5)]
        shown = [level for level in levels if bottom <= level <= top]
        axes.set_yticks(shown, [f"{level:,.0f}" for level in shown])
        axes.minorticks_off()
        _label(axes, {each: (mean[each.key] ** -0.5, rates[each.key]) for each in listed})
        axes.set_xlabel("rms error over the Cramér-Rao bound, geometric mean of 20 spots")
        axes.set_ylabel("lines/s, one core")
        axes.set_title("Speed against error")
        return png(figure)


def _label(axes: Axes, places: dict[Detector, tuple[float, float]]) -> None:
    """Write the names beside their points, lower or higher where one would cover another."""
    taken: list[tuple[float, float, float]] = []  # left, right and height of the names, points
    scale = 72.0 / axes.figure.dpi
    at = {each: axes.transData.transform(place) * scale for each, place in places.items()}
    for each, (x, y) in sorted(at.items(), key=lambda item: -item[1][1]):
        left, right, line = x + 7.0, x + 12.0 + 4.6 * len(each.title), y
        marks = [(px - 5.0, px + 5.0, py) for px, py in at.values() if (px, py) != (x, y)]
        shifts = itertools.chain([0.0], *([-step, step] for step in np.arange(1.0, 200.0)))
        while any(a < right and left < b and abs(line - h) < 9.0 for a, b, h in taken + marks):
            line = y + float(next(shifts))
        taken.append((left, right, line))
        axes.annotate(
            each.title,
            places[each],
            textcoords="offset points",
            xytext=(7.0, line - y - 3.0),
            fontsize=8,
            fontweight="bold" if each.key == SHIPPED else "normal",
            color=INK,
        )


SECTION = Section("detectors", "Detectors side by side", cells, blocks)
