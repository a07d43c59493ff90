"""Sweeps over one difficulty of a line at a time: rms and bias of all detectors over it."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from vrscan.data.config import Config
from vrscan.detectors.catalogue import detectors
from vrscan.scene.speckle import position_rms_px
from vrscan.show.style import LIGHT, QUIET, STYLE
from vrscan.study.bench import detect
from vrscan.study.bench.bench_page import Block, Heading, Picture, Row, Table, Text, number, slug
from vrscan.study.bench.bench_spots import RETURN_PX, SLOPE_PX, most_contrast
from vrscan.study.bench.cells import Cell, Figures, plain
from vrscan.study.bench.sections.section import BOUND, Found, Order, Section, look, png
from vrscan.study.report.efficiency import LOST_PX

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
        "What looks at three pixels falls behind as the spot gets wide; the harmonic, the matched "
        "filter and the fits follow the bound. Below 1 px the pixel itself is as wide as the spot, "
        "and two passes lose it: fewer than three pixels are above a quarter of its height.",
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
        "Its shot noise raises the bound. With T = N - 1, (8) as printed, the pedestal itself "
        "leaks into the phase.",
        _named("level"),
    ),
    Sweep(
        "slope",
        "Sloping background",
        "slope, counts/px",
        (0.0, 0.1, 0.2, 0.5, 1.0, 2.0),
        _of_width(3.0, 8.0, peak=0.5, level=300.0),
        "A slope pulls every detector that takes the background for even. It is straight for "
        f"{SLOPE_PX} px on either side and gone at {RETURN_PX} px, so the background is measured "
        "where there is none; where it rises above the threshold beside the spot, the window runs "
        "on. Two passes take it off.",
        _named("slope"),
    ),
    Sweep(
        "saturation",
        "Saturated spots",
        "height over full scale",
        (0.5, 0.9, 1.2, 1.5, 2.0, 3.0, 5.0, 10.0, 20.0),
        _of_width(2.0, 6.0),
        "Full pixels say nothing of the place; the bound, which leaves them out, still falls a "
        "little with the brighter flanks. The first full pixel is no top, so what looks for one is "
        "off by half the plateau; a window from threshold to threshold keeps its middle.",
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
        "The position meant is that of the top. A constant offset can be calibrated; what changes "
        "between the two heights cannot: see the table of movement below.",
        _named("skew"),
    ),
    Sweep(
        "speckle",
        "Speckle",
        "contrast of a pixel",
        (0.0, 0.02, 0.05, 0.1, 0.15, 0.2, 0.25, 0.3),
        _of_width(2.0, 6.0, peak=0.5),
        "Light from a rough surface is grained, which no detector of a single line can know: all "
        "are far above the bound of photons alone (dashed). The dotted line is what first order "
        "in the contrast gives for the first harmonic. Centroids, which weigh the flanks as much "
        "as the top, do a little better than the rest.",
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
        "Where the light between the two stays above the threshold, one window holds both and the "
        "position is pulled to the rival or lost between them; where it falls below, the rival is "
        "no more than a flag. What looks at the top alone is disturbed least.",
        _away,
    ),
)


def _cell(order: Order, sweep: Sweep, panel: Panel, value: float) -> Cell:
    count = QUICK_LINES if order.quick else LINES
    parameters: dict[str, Any] = {"config": plain(order.config), "lines": count}
    return Cell(detect.WORK, parameters | sweep.spot(value, panel.fixed), order.seed)


def cells(order: Order) -> list[Cell]:
    """Return the cells of all sweeps."""
    return [_cell(order, s, p, v) for s in SWEEPS for p in s.panels for v in s.values]


def blocks(order: Order, found: Found) -> Sequence[Block]:
    """Return a picture and a table for each sweep."""
    count = QUICK_LINES if order.quick else LINES
    shown: list[Block] = [
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
            shown.append(_movement(sweep, got))
    return shown


def _table(sweep: Sweep, got: dict[tuple[str, float], Figures]) -> Table:
    rows, values = [], []
    listed = detectors()
    for panel in sweep.panels:
        for value in sweep.values:
            cell = got[panel.title, value]
            cells_ = [
                f"{value:g}",
                panel.title,
                number(1e3 * cell["bound_px"]),
                *(_rms(cell["errors"][each.key]) for each in listed),
            ]
            rows.append(Row(f"{sweep.key}-{slug(panel.title)}-{value:g}", cells_))
            for each in listed:
                error = cell["errors"][each.key]
                kept = [error[name] for name in ("rms", "bias", "spread", "lost")]
                values.append(
                    [panel.title, value, each.key, cell["lines"], cell["bound_px"], *kept]
                )
    return Table(
        f"sweep-{sweep.key}",
        [_broken(sweep.axis, 14), "spot", "bound", *(_broken(e.title, 9) for e in listed)],
        rows,
        "rms error, 1e-3 px; † more than 1 % of the lines are lost, - all of them. The file has "
        "bias, spread and lost lines, too.",
        ["panel", slug(sweep.axis), "detector", "lines", "bound_px", "rms_px", "bias_px",
         "spread_px", "lost"],
        values,
    )  # fmt: skip


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


def _movement(sweep: Sweep, got: dict[tuple[str, float], Figures]) -> Table:
    """Return the table of a skewed spot's movement with its height."""
    low, high = sweep.panels
    listed = detectors()
    rows, values = [], []
    for each in listed:
        moved = [
            got[high.title, v]["errors"][each.key]["bias"]
            - got[low.title, v]["errors"][each.key]["bias"]
            for v in sweep.values
        ]
        texts = [each.title, *(f"{1e3 * m:+.1f}" for m in moved)]
        rows.append(Row(f"skew-moves-{each.key}", texts, bold=each.key == "shipped"))
        values += [[each.key, v, m] for v, m in zip(sweep.values, moved, strict=True)]
    return Table(
        "skew-moves",
        ["detector", *(f"skew\n{100 * v:g} %" for v in sweep.values)],
        rows,
        "How far a skewed spot of s = 3 px moves between 10 and 90 % of full scale, 1e-3 px: the "
        "difference of the two biases.",
        ["detector", "skew", "moves_px"],
        values,
    )


def _picture(order: Order, sweep: Sweep, got: dict[tuple[str, float], Figures]) -> bytes:
    listed = detectors()
    lost = max(cell["errors"][e.key]["lost"] for cell in got.values() for e in listed)
    kinds = ["rms", "bias"] + ["lost"] * (lost > _LEAST_LOST)
    high = {"rms": 3.0, "bias": 2.3, "lost": 1.3}
    with mpl.rc_context(STYLE):
        size = (11.6, sum(high[kind] for kind in kinds) + 1.0)
        figure = Figure(figsize=size, layout="constrained")
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
    axes.grid(color=LIGHT, linewidth=0.5)
    axes.set_axisbelow(True)
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
        axes.plot(sweep.values, bound, label="Cramér-Rao bound", **BOUND)  # type: ignore[arg-type]
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
