"""Sweeps over one difficulty of a line at a time: rms and bias of all detectors over it."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from vrscan.data.config import Config
from vrscan.detectors.catalogue import Detector, detectors
from vrscan.scene.speckle import position_rms_px
from vrscan.show.sheet import Column, Sheet, listed, number, words
from vrscan.show.style import QUIET, drawing
from vrscan.study.bench import detect
from vrscan.study.bench.bench_page import Block, Heading, Picture, Table, Text, slug
from vrscan.study.bench.cells import Cell, Figures
from vrscan.study.bench.sections.section import (
    BOUND,
    Found,
    Order,
    Section,
    is_own,
    look,
    png,
)
from vrscan.study.report.efficiency import LOST_PX
from vrscan.study.report.spot_lines import RETURN_PX, SLOPE_PX, most_contrast

LINES, QUICK_LINES = 4000, 200  # lines per cell
_LEAST_LOST = 0.005  # a smaller share gets no panel of lost lines
Parameters = dict[str, float]


@dataclass(frozen=True)
class Panel:
    """One column of a sweep, with the parameters that stay the same."""

    title: str
    fixed: Parameters


@dataclass(frozen=True)
class Sweep:
    """One parameter that is changed.

    Attributes:
        key: Short name.
        title: Heading of the sweep.
        axis: Name of the parameter, with its unit.
        values: Values of the parameter.
        panels: Panels of the picture.
        caption: Text that describes the picture.
        spot: Function that returns the spot's parameters for a value and a panel.
        log: Whether the axis is logarithmic.
        also: A predicted rms that is shown with the bound, with its name.
    """

    key: str
    title: str
    axis: str
    values: Sequence[float]
    panels: Sequence[Panel]
    caption: str
    spot: Callable[[float, Parameters], Parameters]
    log: bool = False
    also: tuple[str, Callable[[float, Parameters, Config], float]] | None = None


def _named(name: str) -> Callable[[float, Parameters], Parameters]:
    return lambda value, fixed: {**fixed, name: value}


def _away(value: float, fixed: Parameters) -> Parameters:
    return {**fixed, "rival_px": value * fixed["sigma_px"]}


def _speckle_px(value: float, fixed: Parameters, config: Config) -> float:
    cut = config.peak.k_height
    correlation = most_contrast(config)[1]
    sigma = np.array(fixed["sigma_px"])
    return float(position_rms_px(sigma, value, correlation, cut))


def _of_width(*sigmas: float, **others: float) -> tuple[Panel, ...]:
    height = f", {100 * others['peak']:g} % of full scale" if "peak" in others else ""
    return tuple(Panel(f"s = {s:g} px{height}", {"sigma_px": s, **others}) for s in sigmas)


SWEEPS = (
    Sweep(
        "width",
        "Width of the spot",
        "standard deviation of the spot s, px",
        (0.6, 0.8, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0, 12.0),
        (
            Panel("50 % of full scale", {"peak": 0.5}),
            Panel("5 % of full scale", {"peak": 0.05}),
        ),
        "Below 1 px the pixel itself is as wide as the spot.",
        _named("sigma_px"),
        log=True,
    ),
    Sweep(
        "height",
        "Height of the spot",
        "height, share of full scale",
        (0.02, 0.05, 0.1, 0.2, 0.5, 0.9),
        _of_width(2.0, 8.0),
        "The bound falls with the light: read noise leads on the left, shot noise on the right.",
        _named("peak"),
        log=True,
    ),
    Sweep(
        "background",
        "Even light below the spot",
        "background, counts of 4095",
        (0.0, 30.0, 100.0, 300.0, 1000.0, 2000.0, 3000.0),
        _of_width(3.0, 8.0, peak=0.2),
        "Its shot noise raises the bound.",
        _named("level"),
    ),
    Sweep(
        "slope",
        "Sloping background",
        "slope, counts/px",
        (0.0, 0.1, 0.2, 0.5, 1.0, 2.0),
        _of_width(3.0, 8.0, peak=0.5, level=300.0),
        f"The slope is straight for {SLOPE_PX} px on either side of the spot and gone at "
        f"{RETURN_PX} px, so the background is measured where there is none.",
        _named("slope"),
    ),
    Sweep(
        "saturation",
        "Saturated spots",
        "height over full scale",
        (0.5, 0.9, 1.2, 1.5, 2.0, 3.0, 5.0, 10.0, 20.0),
        _of_width(2.0, 6.0),
        "The bound leaves full pixels out, which say nothing of the place.",
        _named("peak"),
        log=True,
    ),
    Sweep(
        "skew",
        "Skewed spots",
        "skew: how much of s the sides differ from it",
        (0.0, 0.05, 0.1, 0.15, 0.2, 0.25, 0.3),
        (
            Panel("s = 3 px, 10 % of full scale", {"sigma_px": 3.0, "peak": 0.1}),
            Panel("s = 3 px, 90 % of full scale", {"sigma_px": 3.0, "peak": 0.9}),
        ),
        "The position meant is that of the top. A constant offset can be calibrated, what changes "
        "between the two heights cannot: the second table has it.",
        _named("skew"),
    ),
    Sweep(
        "speckle",
        "Speckle",
        "contrast of a pixel",
        (0.0, 0.02, 0.05, 0.1, 0.15, 0.2, 0.25, 0.3),
        _of_width(2.0, 6.0, peak=0.5),
        "Light from a rough surface is grained. Two bounds are shown: that of photons alone, and "
        "that with the speckle, were neighbouring pixels independent. The dotted line is what "
        "first order in the contrast gives for the first harmonic.",
        _named("contrast"),
        also=("speckle, first order", _speckle_px),
    ),
    Sweep(
        "rival",
        "A second spot",
        "distance of the second spot, in s",
        (3.0, 4.0, 5.0, 6.0, 8.0, 12.0),
        tuple(
            Panel(f"s = 3 px, {ratio:g} as high", {"sigma_px": 3.0, "peak": 0.5, "rival": ratio})
            for ratio in (0.3, 0.6, 0.9)
        ),
        "Where the light between the two stays above the threshold, one window holds both.",
        _away,
    ),
)


def _cell(order: Order, sweep: Sweep, panel: Panel, value: float) -> Cell:
    spot = sweep.spot(value, panel.fixed)
    return order.cell(detect.WORK, {"lines": order.size(LINES, QUICK_LINES), **spot})


def cells(order: Order) -> list[Cell]:
    """Return the cells of all sweeps."""
    return [_cell(order, s, p, v) for s in SWEEPS for p in s.panels for v in s.values]


def blocks(order: Order, found: Found) -> Sequence[Block[Any]]:
    """Return a picture and a table for each sweep."""
    count = order.size(LINES, QUICK_LINES)
    shown: list[Block[Any]] = [
        Text(
            f"One thing is changed at a time, {count} lines a point, the same lines for all "
            "detectors. On top the rms error (bias included), below it the bias, both of the "
            f"lines that are not lost; lost are those without a position or more than {LOST_PX:g} "
            "px off, and where they are more than half a per cent a third row shows them. Dashed: "
            f"the Cramér-Rao bound. Dotted, below a bias: what chance makes of {count} lines at "
            "the bound."
        )
    ]
    for sweep in SWEEPS:
        got = {
            (p.title, v): found(_cell(order, sweep, p, v))
            for p in sweep.panels
            for v in sweep.values
        }
        shown.append(Heading(f"sweep-{sweep.key}", sweep.title))
        picture = _picture(order, sweep, got)
        shown.append(Picture(f"sweep-{sweep.key}-picture", picture, sweep.caption))
        shown.append(_table(sweep, got))
        if sweep.key == "skew":
            shown.append(_movement(order, sweep, got))
    return shown


def _speckled(got: dict[tuple[str, float], Figures]) -> bool:
    """Return whether speckle is in any of the lines."""
    return any(cell["speckled_px"] > cell["bound_px"] for cell in got.values())


def _table(sweep: Sweep, got: dict[tuple[str, float], Figures]) -> Table[tuple[str, float]]:
    def rms(each: Detector) -> Column[tuple[str, float]]:
        return Column(_broken(each.title, 9), lambda row: _rms(got[row]["errors"][each.key]))

    columns: list[Column[tuple[str, float]]] = [
        Column(_broken(sweep.axis, 14), lambda row: row[1], "{:g}"),
        words("spot", lambda row: row[0]),
        Column("bound", lambda row: got[row]["bound_px"], number, scale=1e3),
        *[Column("bound with\nspeckle", lambda row: got[row]["speckled_px"], number, scale=1e3)]
        * _speckled(got),
        *map(rms, detectors()),
    ]
    values = []
    for (panel, value), cell in got.items():
        for key, error in ((each.key, cell["errors"][each.key]) for each in detectors()):
            kept = [error[name] for name in ("rms", "bias", "spread", "lost")]
            bounds = cell["bound_px"], cell["speckled_px"]
            values.append([panel, value, key, cell["lines"], *bounds, *kept])
    names = ("panel", slug(sweep.axis), "detector", "lines", "bound_px", "speckled_px", "rms_px",
             "bias_px", "spread_px", "lost")  # fmt: skip
    return Table(
        f"sweep-{sweep.key}",
        Sheet(columns, list(got)),
        "rms error, 1e-3 px; † more than 1 % of the lines are lost, - all of them. The file has "
        "bias, spread and lost lines, too.",
        key=lambda row: f"{sweep.key}-{slug(row[0])}-{row[1]:g}",
        full=listed(names, values),
    )


def _rms(error: dict[str, float]) -> str:
    if error["lost"] == 1.0:
        return "-"
    return number(1e3 * error["rms"]) + ("†" if error["lost"] > 0.01 else "")


def _broken(text: str, room: int) -> str:
    """Return a heading in lines of about ``room`` characters."""
    lines = [""]
    for word in text.split():
        if len(lines[-1]) + len(word) + 1 > room and lines[-1]:
            lines.append("")
        lines[-1] = f"{lines[-1]} {word}".strip()
    return "\n".join(lines)


def _movement(order: Order, sweep: Sweep, got: dict[tuple[str, float], Figures]) -> Table[Detector]:
    """Return how far a skewed spot moves with its height."""
    low, high = sweep.panels

    def moved(each: Detector, skew: float) -> float:
        ends = (got[panel.title, skew]["errors"][each.key]["bias"] for panel in (high, low))
        return float(next(ends) - next(ends))

    def column(skew: float) -> Column[Detector]:
        return Column(
            f"skew\n{100 * skew:g} %", lambda e: moved(e, skew), "{:+.1f}", scale=1e3, absent="nan"
        )

    return Table(
        "skew-moves",
        Sheet([words("detector", lambda e: e.title), *map(column, sweep.values)], detectors()),
        "How far a skewed spot of s = 3 px moves between 10 and 90 % of full scale, 1e-3 px: the "
        "difference of the two biases.",
        key=lambda each: f"skew-moves-{each.key}",
        bold=lambda each: is_own(each.key, order.config),
        full=listed(
            ("detector", "skew", "moves_px"),
            [(each.key, v, moved(each, v)) for each in detectors() for v in sweep.values],
        ),
    )


def _picture(order: Order, sweep: Sweep, got: dict[tuple[str, float], Figures]) -> bytes:
    listed = detectors()
    lost = max(cell["errors"][e.key]["lost"] for cell in got.values() for e in listed)
    kinds = ["rms", "bias"] + ["lost"] * (lost > _LEAST_LOST)
    high = {"rms": 3.0, "bias": 2.3, "lost": 1.3}
    with drawing(11.6, sum(high[kind] for kind in kinds) + 1.0) as figure:
        grid = figure.subplots(
            len(kinds),
            len(sweep.panels),
            sharex=True,
            sharey="row",
            squeeze=False,
            height_ratios=[high[kind] for kind in kinds],
        )
        for column, panel in enumerate(sweep.panels):
            for row, kind in enumerate(kinds):
                _draw(grid[row, column], order, sweep, panel, got, kind)
            grid[0, column].set_title(panel.title)
        least = min(cell["bound_px"] / cell["lines"] ** 0.5 for cell in got.values())
        grid[1, 0].set_ylim(bottom=0.5 * least)
        for row, kind in enumerate(kinds):
            unit = {"rms": "rms error, px", "bias": "|bias|, px", "lost": "lost, %"}
            grid[row, 0].set_ylabel(unit[kind])
        figure.supxlabel(sweep.axis, fontsize=9)
        handles, labels = grid[0, 0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside right center", fontsize=8)
        return png(figure)


def _draw(
    axes: Axes,
    order: Order,
    sweep: Sweep,
    panel: Panel,
    got: dict[tuple[str, float], Figures],
    kind: str,
) -> None:
    given = [got[panel.title, value] for value in sweep.values]
    bound = [cell["bound_px"] for cell in given]
    for each in detectors():
        how = look(each.key)
        errors = [cell["errors"][each.key] for cell in given]
        known = [np.nan if e["lost"] == 1.0 else abs(e.get(kind, np.nan)) for e in errors]
        drawn = [100.0 * e["lost"] for e in errors] if kind == "lost" else known
        axes.plot(
            sweep.values,
            drawn,
            how.dashes,
            marker=how.marker,
            markersize=4,
            color=how.colour,
            linewidth=how.width,
            label=each.title,
        )
    if kind == "rms":
        axes.plot(sweep.values, bound, label="Cramér-Rao bound", **BOUND)
        if _speckled(got):
            grained = [cell["speckled_px"] for cell in given]
            axes.plot(
                sweep.values, grained, label="bound with speckle", **BOUND | {"linestyle": "-."}
            )
        if sweep.also is not None:
            name, rule = sweep.also
            more = [rule(value, panel.fixed, order.config) for value in sweep.values]
            shown = [m if m > 0.0 else np.nan for m in more]
            axes.plot(sweep.values, shown, ":", color=QUIET, linewidth=1.8, label=name)
    if kind != "lost":
        axes.set_yscale("log")
    if kind == "bias":
        chance = [value / given[0]["lines"] ** 0.5 for value in bound]
        axes.plot(sweep.values, chance, ":", color=QUIET, linewidth=1.2)
    if sweep.log:
        axes.set_xscale("log")
        axes.set_xticks(list(sweep.values), [f"{value:g}" for value in sweep.values])
        axes.minorticks_off()


SECTION = Section("sweeps", "What makes a line ugly", cells, blocks)
