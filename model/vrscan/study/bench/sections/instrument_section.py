"""The whole instrument: the causes of its error, and the speed of each of its parts."""

import csv
import io
import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from matplotlib.colors import LogNorm

from vrscan.data.boards import SHIPPED
from vrscan.data.config import Clock
from vrscan.scene.description import shipped
from vrscan.scene.effects import EFFECTS
from vrscan.show.sheet import Column, Sheet, listed, number, words
from vrscan.show.style import INK, drawing
from vrscan.study.bench import instrument
from vrscan.study.bench.bench_page import (
    Attachment,
    Block,
    Heading,
    Picture,
    Table,
    Text,
    slug,
)
from vrscan.study.bench.cells import Cell, Figures
from vrscan.study.bench.sections.section import Found, Order, Section, png
from vrscan.study.plan import JUMP_PX, ZONES
from vrscan.study.report.reliability_report import expected
from vrscan.study.report.speed import PAPER_LINES

QUICK_SCENES = ("default", "sunlit")
FIDELITY_SCENES = ("default", "corner", "bust", "sunlit")
_LEAST_PX = 1e-4  # smaller is shown as nothing


def _scenes(order: Order) -> tuple[str, ...]:
    return QUICK_SCENES if order.quick else tuple(shipped())


def _budget(order: Order, scene: str) -> Cell:
    lines = order.size(3072, 1024)
    return order.cell(instrument.BUDGET, {"scene": scene, "lines": lines}, seed=0)


def _fidelity(order: Order, scene: str) -> Cell:
    given = {"scene": scene, "lines": 1024}
    return order.cell(instrument.FIDELITY, given, seed=0, timed=True)


def _lit(order: Order) -> tuple[str, ...]:
    return FIDELITY_SCENES[:1] if order.quick else FIDELITY_SCENES


def _speed(order: Order) -> Cell:
    sizes = {"lines": order.size(4096, 1024), "rtl": order.size(1024, 0)}
    return order.cell(instrument.SPEED, sizes, seed=0, timed=True)


def cells(order: Order) -> list[Cell]:
    """Return the budget cell of each scene, and the speeds of simulator and engines."""
    return [
        *(_budget(order, scene) for scene in _scenes(order)),
        *(_fidelity(order, scene) for scene in _lit(order)),
        _speed(order),
    ]


def blocks(order: Order, found: Found) -> Sequence[Block[Any]]:
    """Return the budgets and the speeds."""
    budgets = {scene: found(_budget(order, scene)) for scene in _scenes(order)}
    parts = {scene: _worst(figures) for scene, figures in budgets.items()}
    return [
        Heading("budget", "Error budget by cause"),
        Text(
            "What each cause contributes to a position: how far the point moves when this one "
            "thing is left out of the simulation and all random numbers stay the same, bias and "
            "rms together, in the worst of near, middle and far (vrscan budget). "
            "Arithmetic is the bit-accurate chain against the float equations on the "
            "same lines; the fit is how far points lie from those without it, of two passes."
        ),
        Picture(
            "budget-picture",
            _picture(parts),
            "Causes (rows) in the shipped scenes (columns), 1e-3 px. Empty: the scene has no such "
            "effect, or it moves nothing by as much as 0.1e-3 px.",
        ),
        _causes("budget", 0, "px", "1e-3 px.", parts),
        _causes("budget-z", 1, "mm", "The same in z, µm.", parts),
        _totals(budgets),
        _windows(order, budgets),
        *(
            Attachment(f"budget-{scene}.csv", figures["csv"].encode())
            for scene, figures in budgets.items()
        ),
        Heading("speed", "Speed of each part"),
        _speeds(order, found(_speed(order)), [found(_fidelity(order, s)) for s in _lit(order)]),
        _rates(order, found(_speed(order)), budgets["default"]),
        _simulator([found(_fidelity(order, s)) for s in _lit(order)]),
    ]


# By scene and cause, px and mm: the worst of near, middle and far, and of the arithmetic.
Worst = dict[str, dict[str, tuple[float, float]]]
_FIT, _ARITHMETIC = "the fit", "arithmetic"


def _worst(figures: Figures) -> dict[str, tuple[float, float]]:
    worst = {_ARITHMETIC: (figures["arithmetic_px"], figures["arithmetic_mm"])}
    if figures["fit_px"]:
        worst[_FIT] = figures["fit_px"], figures["fit_mm"]
    for row in csv.DictReader(io.StringIO(figures["csv"])):
        if row["effect"] not in EFFECTS or not row["near_rms_px"]:
            continue

        def most(unit: str, row: dict[str, str] = row) -> float:
            pairs = [(row[f"{z}_bias_{unit}"], row[f"{z}_rms_{unit}"]) for z in ZONES]
            return float(max(np.hypot(float(a or 0.0), float(b or 0.0)) for a, b in pairs))

        worst[row["effect"]] = (most("px"), most("mm"))
    return worst


def _names(parts: Worst) -> list[str]:
    """Return the causes that any scene has, the largest first, then fit and arithmetic."""
    size = {
        name: max((own[name][0] for own in parts.values() if name in own), default=-1.0)
        for name in EFFECTS
    }
    found = sorted((name for name in size if size[name] >= 0.0), key=lambda name: -size[name])
    return [*found, *[_FIT] * any(_FIT in own for own in parts.values()), _ARITHMETIC]


def _causes(key: str, index: int, unit: str, caption: str, parts: Worst) -> Table[str]:
    def column(scene: str) -> Column[str]:
        own = parts[scene]
        digits = partial(number, digits=2)
        return Column(scene, lambda n: own[n][index] if n in own else None, digits, scale=1e3)

    names = _names(parts)
    values = [(n, s, parts[s][n][index]) for n in names for s in parts if n in parts[s]]
    return Table(
        key,
        Sheet([words("cause", lambda name: name), *map(column, parts)], names),
        f"{caption} Bias and rms together, worst of near, middle and far. Each scene's whole "
        "table, with the share of points that come and go, is a file of its own below.",
        key=lambda name: f"{key}-{slug(name)}",
        bold=lambda name: name == _ARITHMETIC,
        full=listed(("cause", "scene", f"worst_{unit}"), values),
    )


def _totals(budgets: dict[str, Figures]) -> Table[str]:
    def column(heading: str, name: str, form: Any = number, scale: float = 1.0) -> Column[str]:
        return Column(heading, lambda scene: budgets[scene][name], form, name=name, scale=scale)

    columns: list[Column[str]] = [
        words("scene", lambda scene: scene, name="scene"),
        column("points", "points", "{}"),
        column(f"farther off\nthan {JUMP_PX:g} px", "jumped", "{:.2f} %", 100.0),
        column("error,\nrms px", "error_px"),
        column("median\npx", "median_px"),
        column("error in z,\nrms mm", "error_mm"),
        column("median\nmm", "median_mm"),
        column("arithmetic,\n1e-3 px", "arithmetic_px", scale=1e3),
        column("arithmetic,\nµm", "arithmetic_mm", scale=1e3),
        column("another\nwindow", "other_window", "{:.2f} %", 100.0),
        column("one fit\nonly", "one_fit", "{:.2f} %", 100.0),
    ]
    return Table(
        "total",
        Sheet(columns, list(budgets)),
        "All causes together: points of the bit-accurate chain against the scene's truth. Points "
        f"more than {JUMP_PX:g} px off are those of second reflections and of edges; they count in "
        "the median, not in the rms. Another window: where a rounded threshold takes a pixel more "
        "or less than the float equations'. One fit only: where chi squared lies near its limit, "
        "and the fit gives the point in one of both. Arithmetic is of the lines with the same "
        "window and the fit in both or in none.",
        key=lambda scene: f"total-{scene}",
    )


def _windows(order: Order, budgets: dict[str, Figures]) -> Table[tuple[str, str]]:
    """Return each scene with each kind of window: error, reliability and free space."""

    def column(heading: str, name: str, form: Any = number) -> Column[tuple[str, str]]:
        scale = 100.0 if "%" in str(form) else 1.0

        def value(row: tuple[str, str]) -> Any:
            return budgets[row[0]]["windows"][row[1]][name]

        return Column(heading, value, form, name=name, scale=scale)

    columns: list[Column[tuple[str, str]]] = [
        words("scene", lambda row: row[0], name="scene"),
        words("window", lambda row: row[1], name="window"),
        column("error,\nrms px", "error_px"),
        column("error in z,\nrms mm", "error_mm"),
        column("error /\nsigma", "ratio", "{:.2f}"),
        column("2 sigma\nholds", "within", "{:.1f} %"),
        column("\nastray", "astray", "{:.2f} %"),
        column("lines with\na free part", "free", "{:.1f} %"),
        column("falsely\nfree", "false", "{:.2f} %"),
        column("hidden\nsurface", "hidden", "{:.2f} %"),
    ]
    normal = 100.0 * float(expected(2))
    return Table(
        "windows",
        Sheet(columns, [(scene, name) for scene in budgets for name in instrument.WINDOWS]),
        f"The same lines with each kind of window. Errors are of points within {JUMP_PX:g} px; the "
        f"next three columns of all points without a flag, of which 2 sigma would hold {normal:.1f}"
        " % were their errors normal; astray are points on another spot than the beam's own. Of "
        "all lines: those of whose beam a part is called free, those with a surface in that part, "
        "and those where it is hidden from the camera by another surface.",
        key=lambda row: f"windows-{row[0]}-{row[1]}",
        bold=lambda row: row[1] == order.config.peak.window,
    )


def _rates(order: Order, speed: Figures, default: Figures) -> Table[str]:
    """Return speed against error of each kind of window."""
    rates = speed["rates"]
    own = {name: instrument.with_window(order.config, name) for name in instrument.WINDOWS}

    def hardware(window: str) -> int:
        return _hardware(Order(own[window], order.seed, order.quick))[1]

    def rate(engine: str) -> Column[str]:
        titles = {
            "fixed": "bit-accurate\nmodel",
            "ideal": "float64\nequations",
            "rtl": "RTL,\nsim.",
        }
        return Column(
            titles[engine], lambda window: rates.get(f"{engine} {window}"), number,
            name=f"{engine}_per_s", absent="-",
        )  # fmt: skip

    columns: list[Column[str]] = [
        words("window", lambda window: window, name="window"),
        Column("error,\nrms px", lambda w: default["windows"][w]["error_px"], number,
               name="error_px"),
        Column("clocks\na line", lambda window: own[window].line_clks, name="clocks"),
        Column(f"\n{SHIPPED.title}", hardware, number, name="hardware_per_s"),
        *map(rate, ("fixed", "ideal", "rtl")),
    ]  # fmt: skip
    return Table(
        "rates",
        Sheet(columns, list(instrument.WINDOWS)),
        "Speed against error: lines/s with each kind of window, as above, and the error in the "
        "default scene. The hardware takes as long for any of them: a clock a pixel.",
        key=lambda window: f"rates-{window}",
        bold=lambda window: window == order.config.peak.window,
    )


def _picture(parts: Worst) -> bytes:
    names, scenes = _names(parts), list(parts)
    nothing = (np.nan, np.nan)
    values = np.array([[parts[s].get(name, nothing)[0] for s in scenes] for name in names])
    values[:-1][values[:-1] < _LEAST_PX] = np.nan
    values[-1] = np.maximum(values[-1], 1e-9)
    with drawing(2.2 + 0.66 * max(len(scenes), 6), 0.9 + 0.27 * len(names)) as figure:
        axes = figure.subplots()
        axes.grid(visible=False)
        top = max(float(np.nanmax(values)), 1e-3)
        axes.imshow(values, cmap="YlOrBr", norm=LogNorm(5e-5, 3.0 * top), aspect="auto")
        for row in range(len(names)):
            for column in range(len(scenes)):
                value = values[row, column]
                if np.isfinite(value):
                    text = number(1e3 * value, 2)
                    shade = "white" if value > 0.15 * top else INK
                    axes.text(
                        column, row, text, ha="center", va="center", fontsize=7.5, color=shade
                    )
        axes.set_xticks(range(len(scenes)), scenes, rotation=30, ha="right")
        axes.set_yticks(range(len(names)), names)
        axes.tick_params(length=0, colors=INK)
        for spine in axes.spines.values():
            spine.set_visible(False)
        axes.set_title("What each cause moves a position by, 1e-3 px")
        return png(figure)


def _hardware(order: Order) -> tuple[str, int]:
    """Return a word and the lines/s of the board, whose routed design meets its clock."""
    clock = Clock(frequency_hz=SHIPPED.clock_hz)
    board = order.config.model_copy(update={"clock": clock})
    clocks = f"{1e-6 * SHIPPED.clock_hz:.2f} MHz, {board.line_clks} clocks a line"
    return f"{SHIPPED.title}, {clocks}", math.floor(board.most_lines_hz)


@dataclass(frozen=True)
class _Part:
    """A part of the instrument and how fast it is; None where that is not known."""

    key: str
    title: str
    work: str
    rate: float | None
    ratio: float | None = None


def _speeds(order: Order, speed: Figures, lit: Sequence[Figures]) -> Table[_Part]:
    rates, lines = speed["rates"], speed["lines"]
    rows: list[_Part] = []

    def add(key: str, title: str, work: str, rate: float | None) -> None:
        rows.append(_Part(key, title, work, rate, rate and rate / rates["reference"]))

    add("reference", "reference", instrument.REFERENCE, rates["reference"])
    for row in (row for figures in lit[:1] for row in figures["rows"]):
        name = row["fidelity"]
        if name in ("minimal", "auto 0.01", "full"):
            work = f"default scene, {row['effects']} of {row['of']} effects"
            add(f"simulator-{slug(name)}", f"simulator, {name}", work, row["lines_per_s"])
    window, given = order.config.peak.window, f"{lines['model']} lines to points"
    add("fixed", "bit-accurate model", given, rates[f"fixed {window}"])
    add("ideal", "float64 equations", given, rates[f"ideal {window}"])
    simulated = f"{lines['rtl']} lines to points, Verilator"
    add("rtl", "RTL, simulated", speed["missing"] or simulated, rates.get(f"rtl {window}"))
    word, hardware = _hardware(order)
    add("hardware", "hardware", word, hardware)
    columns: list[Column[_Part]] = [
        Column(None, lambda part: part.key, name="part"),
        words("part", lambda part: part.title),
        Column("lines/s", lambda part: part.rate, number, name="lines_per_s"),
        Column("over\nreference", lambda part: part.ratio, "{:.3g}", name="over_reference"),
        Column("over the paper's\n37,400 lines/s", lambda part: part.rate, "{:.3g}",
               scale=1.0 / PAPER_LINES),
        words("work", lambda part: part.work, name="work", wraps=True),
    ]  # fmt: skip
    return Table(
        "speed",
        Sheet(columns, rows),
        "One core of this machine, lines of 2048 px of the default scene, processor time, best of "
        "three rounds in turns; all but the hardware. The ratio to the reference, measured in the "
        "same run, is what to compare between machines. Hardware: the fastest clock that place and "
        "route reach for the whole chain, and one clock a pixel.",
        key=lambda part: f"speed-{part.key}",
    )


def _simulator(lit: Sequence[Figures]) -> Table[dict[str, Any]]:
    full = {row["scene"]: row["lines_per_s"] for figures in lit for row in figures["rows"]}
    columns: list[Column[dict[str, Any]]] = [
        words("simulator: scene, fidelity", lambda row: f"{row['scene']}, {row['fidelity']}"),
        Column(None, lambda row: row["scene"], name="scene"),
        Column(None, lambda row: row["fidelity"], name="fidelity"),
        Column("effects", lambda row: f"{row['effects']} / {row['of']}"),
        Column(None, lambda row: row["effects"], name="effects"),
        Column(None, lambda row: row["of"], name="of"),
        Column("lines/s", lambda row: row["lines_per_s"], number, name="lines_per_s"),
        Column("over full", lambda row: row["lines_per_s"] / full[row["scene"]], "{:.1f}"),
        Column("off from full,\nrms px", lambda row: row["worst_px"], number, name="off_px"),
        Column(None, lambda row: row["rms_um"], name="off_um"),
        Column("chain against\ntruth, rms px", lambda row: row["truth_rms_px"], number,
               name="truth_px"),
    ]  # fmt: skip
    return Table(
        "light",
        Sheet(columns, [row for figures in lit for row in figures["rows"]]),
        "Speed of the light simulator against the error of what each fidelity leaves out, worst "
        "third of the points by depth; vrscan bench light has all scenes.",
        key=lambda row: f"light-{row['scene']}-{row['fidelity'].replace(' ', '-')}",
    )


SECTION = Section("instrument", "The whole instrument", cells, blocks)
