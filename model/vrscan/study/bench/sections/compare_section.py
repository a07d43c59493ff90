"""Comparison of the detectors: the error of each over all spots, and its cost."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from vrscan.data import pkg
from vrscan.data.arrays import Floats
from vrscan.detectors.catalogue import Detector, detectors
from vrscan.fixed import peak_fit, peak_position, peak_refine, phase_correlate
from vrscan.show.sheet import Column, Sheet, listed, number, words
from vrscan.study.bench import cost, detect
from vrscan.study.bench.bench_page import Block, Heading, Table, Text
from vrscan.study.bench.cells import Cell, Figures
from vrscan.study.bench.sections.section import Found, Order, Section, is_own
from vrscan.study.report.efficiency import LOST_PX, PEAKS, SIGMAS_PX
from vrscan.study.report.spot_lines import mean_square

LINES, QUICK_LINES = 5000, 300  # lines per cell
SHOWN_PEAK = 0.5  # height whose rms the table shows
SPEED_SIGMA_PX = 4.0
WINDOW_PX = 32  # window for which clocks are stated
FIRST_PX = 16  # first of two windows for which clocks are stated
FAINT = 0.02  # share of full scale: fainter than the spots of the mean
MAPPED = ("printed", "one-pass", "two-pass", "fit", "likelihood")  # shown by spot


def _spot(order: Order, sigma: float, peak: float) -> Cell:
    count = order.size(LINES, QUICK_LINES)
    return order.cell(detect.WORK, {"lines": count, "sigma_px": sigma, "peak": peak})


def _speed(order: Order) -> Cell:
    spot = {"sigma_px": SPEED_SIGMA_PX, "peak": SHOWN_PEAK}
    return order.cell(cost.WORK, {"lines": order.size(2048, 512), **spot}, timed=True)


def cells(order: Order) -> list[Cell]:
    """Return the spots of ``vrscan efficiency``, fainter ones, and the speed."""
    grid = [_spot(order, sigma, peak) for peak in (FAINT, *PEAKS) for sigma in SIGMAS_PX]
    return [*grid, _speed(order)]


def _efficiency(bound: float, error: dict[str, float]) -> float:
    """Return bound over mean square, lost lines at ``LOST_PX``."""
    return bound**2 / mean_square(error["rms"], error["lost"])


def _tuned(each: Detector) -> str:
    return f"{each.parameter}: {each.value:g}" if each.grid else each.parameter


def blocks(order: Order, found: Found) -> Sequence[Block[Any]]:
    """Return the table of errors, the table of prices and the picture of one over the other."""
    grid = {(s, p): found(_spot(order, s, p)) for p in PEAKS for s in SIGMAS_PX}
    shown = detectors()
    every = {
        each.key: np.array(
            [_efficiency(cell["bound_px"], cell["errors"][each.key]) for cell in grid.values()]
        )
        for each in shown
    }
    mean = {key: float(np.exp(np.log(values).mean())) for key, values in every.items()}
    speed = found(_speed(order))
    return [
        Text(
            "Every detector gets the same lines: one Gaussian spot anywhere between two pixels, 12 "
            "bits, 5 electrons a count, shot noise, read noise of 3 counts, 60 counts of "
            "background. Each has the parameter that vrscan bench tune found for it on other "
            "spots. The efficiency is the Cramér-Rao bound's variance over the mean square error: "
            "1 is all that light and noise allow."
        ),
        Heading("error", "Error against the bound"),
        _errors(order, grid, every, mean),
        _map(shown, order, found),
        Heading("cost", "What each costs"),
        _costs(order, shown, speed, mean),
    ]


def _errors(
    order: Order,
    grid: dict[tuple[float, float], Figures],
    every: dict[str, Floats],
    mean: dict[str, float],
) -> Table[Detector | None]:
    """Return the table of all detectors, below the bound, which is None."""
    count = next(iter(grid.values()))["lines"]

    def lost(each: Detector) -> str:
        most = max(float(cell["errors"][each.key]["lost"]) for cell in grid.values())
        return f"{100.0 * most:.2f} %" if most else "0"

    def rms(sigma: float) -> Column[Detector | None]:
        cell = grid[sigma, SHOWN_PEAK]

        def value(each: Detector | None) -> float:
            return float(cell["errors"][each.key]["rms"] if each else cell["bound_px"])

        return Column(f"rms, 1e-3 px\ns = {sigma:g} px", value, number, scale=1e3)

    columns: list[Column[Detector | None]] = [
        words("detector", lambda each: each.title if each else "Cramér-Rao bound"),
        words("tuned", lambda each: _tuned(each) if each else ""),
        Column("efficiency,\ngeometric mean", lambda e: mean[e.key] if e else "1", "{:.3f}"),
        Column("\nworst", lambda e: float(every[e.key].min()) if e else "1", "{:.3f}"),
        Column("lost,\nworst", lambda each: lost(each) if each else ""),
        *map(rms, SIGMAS_PX),
    ]
    values = []
    for each in detectors():
        for (sigma, peak), cell in grid.items():
            error, bound = cell["errors"][each.key], cell["bound_px"]
            kept = [error[name] for name in ("rms", "bias", "spread", "lost")]
            score = _efficiency(bound, error)
            values.append([each.key, each.value, sigma, peak, count, bound, *kept, score])
    names = ("detector", "parameter", "sigma_px", "peak", "lines", "bound_px", "rms_px", "bias_px",
             "spread_px", "lost", "efficiency")  # fmt: skip
    return Table(
        "detectors",
        Sheet(columns, [None, *detectors()]),
        f"Efficiency over 20 spots: s = {', '.join(f'{s:g}' for s in SIGMAS_PX)} px, "
        f"{', '.join(f'{100 * p:.0f}' for p in PEAKS)} % of full scale; {count} lines each, so an "
        f"rms is known to {100.0 / (2.0 * count) ** 0.5:.1f} %. Lost: no position, or more than "
        f"{LOST_PX:g} px off. The rms columns are at {100 * SHOWN_PEAK:.0f} % of full scale.",
        key=lambda each: f"detector-{each.key if each else 'bound'}",
        bold=lambda each: each is not None and is_own(each.key, order.config),
        full=listed(names, values),
    )


def _map(shown: Sequence[Detector], order: Order, found: Found) -> Table[tuple[Detector, float]]:
    """Return the efficiency of the instrument's detectors by width and height of the spot."""

    def score(each: Detector, peak: float, sigma: float) -> tuple[float, float]:
        cell = found(_spot(order, sigma, peak))
        error = cell["errors"][each.key]
        return _efficiency(cell["bound_px"], error), error["lost"]

    def column(sigma: float) -> Column[tuple[Detector, float]]:
        return Column(f"s = {sigma:g} px", lambda row: score(*row, sigma)[0], "{:.3f}")

    title: Column[tuple[Detector, float]] = words(
        "efficiency: detector, height", lambda row: f"{row[0].title}, {100.0 * row[1]:g} %"
    )
    rows = [(e, peak) for e in shown if e.key in MAPPED for peak in (FAINT, *PEAKS)]
    return Table(
        "efficiency",
        Sheet([title, *map(column, SIGMAS_PX)], rows),
        "Bound's variance over mean square error by width and height of the spot, in per cent of "
        f"full scale. The means above are without the {100.0 * FAINT:g} %.",
        key=lambda row: f"map-{row[0].key}-{100.0 * row[1]:g}",
        bold=lambda row: is_own(row[0].key, order.config),
        full=listed(
            ("detector", "peak", "sigma_px", "efficiency", "lost"),
            [(e.key, peak, s, *score(e, peak, s)) for e, peak in rows for s in SIGMAS_PX],
        ),
    )


def _clocks(each: Detector) -> int | None:
    """Return the clocks from a window's last pixel to the position, None without RTL."""
    if not each.modules:
        return None
    if "peak_fit" in each.modules:
        return pkg.FIT_START + 1 + peak_fit.LATENCY
    clocks = phase_correlate.latency(WINDOW_PX) + peak_position.LATENCY
    if "peak_refine" in each.modules:
        clocks += phase_correlate.first_latency(FIRST_PX) + peak_refine.latency()
    return clocks


def _costs(
    order: Order, shown: Sequence[Detector], speed: Figures, mean: dict[str, float]
) -> Table[Detector | None]:
    """Return the table of prices; None is the reference."""
    rates = speed["rates"]

    def rate(each: Detector | None) -> float:
        return float(rates[each.key if each else "reference"])

    def cells_of(k: int) -> Callable[[Detector | None], int | float | None]:
        return lambda each: (cost.cells_of(each.modules) or (None, None))[k] if each else None

    def unknown(each: Detector | None) -> str:
        return "" if each is None else f"not in {cost.TIMING}" if each.modules else "no RTL"

    columns: list[Column[Detector | None]] = [
        words("detector", lambda each: each.title if each else "statistics alone"),
        Column(None, lambda each: each.key if each else "reference", name="detector"),
        Column("software,\nlines/s", rate, number, name="lines_per_s"),
        Column("over\nreference", lambda each: rate(each) / rates["reference"], "{:.2f}",
               name="over_reference"),
        Column(f"clocks,\nwindow of {WINDOW_PX} px", lambda each: _clocks(each) if each else "",
               name="clocks", absent="no RTL"),
        Column("\nLUT", cells_of(0), "{:,}", name="lut", absent=unknown),
        Column("\nDSP", cells_of(1), "{:g}", name="dsp", absent=unknown),
        Column(None, lambda each: mean[each.key] if each else None, name="efficiency"),
    ]  # fmt: skip
    return Table(
        "cost",
        Sheet(columns, [None, *shown]),
        f"Software: {speed['lines']} lines of 2048 px, s = {SPEED_SIGMA_PX:g} px at "
        f"{100 * SHOWN_PEAK:.0f} % of full scale, from pixels to positions on one core, best of "
        "three rounds in turns; processor time. The reference is maximum, mean and variance of "
        "every line in numpy, measured in the same run; compare machines by the ratio. (8) and T = "
        "N run the whole chain, to (x, z) and its deviation. Clocks: from the window's last pixel "
        f"to the position, with two passes and the fit from the first window's, {FIRST_PX} px. All "
        f"of them take a line every {order.config.sensor.line_length} clocks. LUT and DSP: "
        "window, correlator and position, what makes the second window, and the fit, each placed "
        f"alone, from {cost.TIMING}.",
        key=lambda each: f"cost-{each.key if each else 'reference'}",
        bold=lambda each: each is not None and is_own(each.key, order.config),
    )


SECTION = Section("detectors", "Detectors side by side", cells, blocks)
