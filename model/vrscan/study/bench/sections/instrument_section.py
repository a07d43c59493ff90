"""The whole instrument: the causes of its error, and the speed of each of its parts."""

import csv
import io
from collections.abc import Sequence
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure

from vrscan.scene.description import shipped
from vrscan.scene.effects import EFFECTS
from vrscan.show.style import INK, STYLE
from vrscan.study.bench import cost, instrument
from vrscan.study.bench.bench_page import (
    Attachment,
    Block,
    Heading,
    Picture,
    Row,
    Table,
    Text,
    number,
)
from vrscan.study.bench.cells import Cell, Figures, plain
from vrscan.study.bench.sections.section import Found, Order, Section, png
from vrscan.study.plan import JUMP_PX, ZONES

QUICK_SCENES = ("default", "sunlit")
FIDELITY_SCENES = ("default", "corner", "bust", "sunlit")
PAPER_LINES = 37_400.0  # lines/s of the paper's sensor
_LEAST_PX = 1e-4  # a smaller value is shown as nothing


def _scenes(order: Order) -> tuple[str, ...]:
    return QUICK_SCENES if order.quick else tuple(shipped())


def _budget(order: Order, scene: str) -> Cell:
    lines = 1024 if order.quick else 3072
    parameters = {"config": plain(order.config), "scene": scene, "lines": lines}
    return Cell(instrument.BUDGET, parameters, 0)


def _fidelity(order: Order, scene: str) -> Cell:
    parameters = {"config": plain(order.config), "scene": scene, "lines": 1024}
    return Cell(instrument.FIDELITY, parameters, 0, timed=True)


def _lit(order: Order) -> tuple[str, ...]:
    return FIDELITY_SCENES[:1] if order.quick else FIDELITY_SCENES


def _speed(order: Order) -> Cell:
    lines, rtl = (1024, 0) if order.quick else (4096, 1024)
    parameters = {"config": plain(order.config), "lines": lines, "rtl": rtl}
    return Cell(instrument.SPEED, parameters, 0, timed=True)


def cells(order: Order) -> list[Cell]:
    """Return the budget cell of each scene, and the speeds of simulator and engines."""
    return [
        *(_budget(order, scene) for scene in _scenes(order)),
        *(_fidelity(order, scene) for scene in _lit(order)),
        _speed(order),
    ]


def blocks(order: Order, found: Found) -> Sequence[Block]:
    """Return the budgets and the speeds."""
    budgets = {scene: found(_budget(order, scene)) for scene in _scenes(order)}
    parts = {scene: _worst(figures["csv"]) for scene, figures in budgets.items()}
    return [
        Heading("budget", "Error budget by cause"),
        Text(
            "What each cause contributes to a position: how far the point moves when this one "
            "thing is left out of the simulation and all random numbers stay the same, bias and "
            "rms together, in the worst of near, middle and far (<code>vrscan budget</code>). "
            "<em>arithmetic</em> is the bit-accurate chain against the float equations on the "
            "same lines."
        ),
        Picture(
            "budget-picture",
            _picture(parts, budgets),
            "Causes (rows) in the shipped scenes (columns), 1e-3 px. Empty: the scene has no such "
            "effect, or it moves nothing by as much as 0.1e-3 px. Speckle leads, with the optics "
            "(defocus, the cut beam, the footprint), which also change the spot's width and with "
            "it the grains that it covers; arithmetic is far below all light.",
        ),
        *_causes(parts, budgets),
        _totals(budgets),
        *(
            Attachment(f"budget-{scene}.csv", figures["csv"].encode())
            for scene, figures in budgets.items()
        ),
        Heading("speed", "Speed of each part"),
        _speeds(order, found(_speed(order)), [found(_fidelity(order, s)) for s in _lit(order)]),
        _simulator([found(_fidelity(order, s)) for s in _lit(order)]),
    ]


def _worst(text: str) -> dict[str, tuple[float, float, float]]:
    """Return px, mm and lost share of each effect in a budget's file, for its worst zone."""
    worst = {}
    for row in csv.DictReader(io.StringIO(text)):
        if row["effect"] not in EFFECTS or not row["near_rms_px"]:
            continue

        def most(unit: str, row: dict[str, str] = row) -> float:
            pairs = [(row[f"{z}_bias_{unit}"], row[f"{z}_rms_{unit}"]) for z in ZONES]
            return float(max(np.hypot(float(a or 0.0), float(b or 0.0)) for a, b in pairs))

        changed = max(float(row[f"{z}_changed"] or 0.0) for z in ZONES)
        worst[row["effect"]] = (most("px"), most("mm"), changed)
    return worst


Worst = dict[str, dict[str, tuple[float, float, float]]]


def _names(parts: Worst) -> list[str]:
    """Return the effects of all scenes, the largest first."""
    size = {
        name: max((p[name][0] for p in parts.values() if name in p), default=-1.0)
        for name in EFFECTS
    }
    return sorted((name for name in size if size[name] >= 0.0), key=lambda name: -size[name])


def _causes(parts: Worst, budgets: dict[str, Figures]) -> list[Table]:
    """Return the tables in px and in mm of z."""
    files = ", ".join(f'<a href="budget-{s}.csv">{s}</a>' for s in parts)
    words = (
        "Bias and rms together, worst of near, middle and far. Each scene's whole table, with the "
        f"share of points that come and go: {files}."
    )
    return [
        _cause_table("budget", 0, 1e3, "px", f"1e-3 px. {words}", parts, budgets),
        _cause_table("budget-z", 1, 1e3, "mm", f"The same in z, µm. {words}", parts, budgets),
    ]


def _cause_table(
    key: str,
    index: int,
    scale: float,
    unit: str,
    caption: str,
    parts: Worst,
    budgets: dict[str, Figures],
) -> Table:
    scenes = list(parts)
    rows: list[Row] = []
    values: list[list[Any]] = []
    for name in [*_names(parts), "arithmetic"]:
        own = {s: parts[s][name][index] for s in scenes if name in parts[s]}
        if name == "arithmetic":
            own = {s: budgets[s][f"arithmetic_{unit}"] for s in scenes}
        texts = [number(scale * own[s], 2) if s in own else "" for s in scenes]
        rows.append(Row(f"{key}-{name}", [name, *texts], bold=name == "arithmetic"))
        values += [[name, s, value] for s, value in own.items()]
    return Table(
        key, ["cause", *scenes], rows, caption, ["cause", "scene", f"worst_{unit}"], values
    )


def _totals(budgets: dict[str, Figures]) -> Table:
    rows: list[Row] = []
    values: list[list[Any]] = []
    names = ("points", "jumped", "error_px", "median_px", "error_mm", "median_mm",
             "arithmetic_px", "arithmetic_mm", "other_window")  # fmt: skip
    for scene, figures in budgets.items():
        shown = [
            f"{figures['points']}",
            f"{100.0 * figures['jumped']:.2f} %",
            number(figures["error_px"]),
            number(figures["median_px"]),
            number(figures["error_mm"]),
            number(figures["median_mm"]),
            number(1e3 * figures["arithmetic_px"]),
            number(1e3 * figures["arithmetic_mm"]),
            f"{100.0 * figures['other_window']:.2f} %",
        ]
        rows.append(Row(f"total-{scene}", [scene, *shown]))
        values.append([scene, *(figures[name] for name in names)])
    return Table(
        "total",
        [
            "scene",
            "points",
            f"farther off\nthan {JUMP_PX:g} px",
            "error,\nrms px",
            "median\npx",
            "error in z,\nrms mm",
            "median\nmm",
            "arithmetic,\n1e-3 px",
            "arithmetic,\nµm",
            "another\nwindow",
        ],
        rows,
        "All causes together: points of the bit-accurate chain against the scene's truth. Points "
        f"more than {JUMP_PX:g} px off are those of second reflections and of edges; they count in "
        "the median, not in the rms. Another window: where a rounded threshold takes a pixel more "
        "or less than the float equations'; arithmetic is of the other lines.",
        ["scene", *names],
        values,
    )


def _picture(parts: Worst, budgets: dict[str, Figures]) -> bytes:
    names, scenes = [*_names(parts), "arithmetic"], list(parts)
    values = np.full((len(names), len(scenes)), np.nan)
    for column, scene in enumerate(scenes):
        for row, name in enumerate(names[:-1]):
            if name in parts[scene]:
                values[row, column] = parts[scene][name][0]
        values[-1, column] = budgets[scene]["arithmetic_px"]
    values[values < _LEAST_PX] = np.nan
    if budgets:
        values[-1] = [max(b["arithmetic_px"], 1e-9) for b in budgets.values()]
    with mpl.rc_context(STYLE):
        figure = Figure(
            figsize=(2.2 + 0.66 * max(len(scenes), 6), 0.9 + 0.27 * len(names)),
            layout="constrained",
        )
        axes = figure.subplots()
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


def _hardware(order: Order) -> tuple[str, float | None]:
    """Return a word and the lines/s of the chain from its place and route."""
    placed, length = cost.timing(), order.config.sensor.line_length
    if "vrscan_chain" not in placed:
        return f"run {cost.TIMING}", None
    fmax = float(placed["vrscan_chain"]["fmax_mhz"])
    return f"{fmax:g} MHz, {length} clocks a line", 1e6 * fmax / length


def _speeds(order: Order, speed: Figures, lit: Sequence[Figures]) -> Table:
    rates, reference = speed["rates"], speed["rates"]["reference"]
    lines = speed["lines"]
    rows: list[Row] = []
    values: list[list[Any]] = []

    def add(key: str, title: str, work: str, rate: float | None, comparable: bool = True) -> None:
        ratio = rate / reference if rate is not None and comparable else None
        rows.append(
            Row(
                f"speed-{key}",
                [
                    title,
                    number(rate) if rate is not None else "",
                    f"{ratio:.3g}" if ratio is not None else "",
                    f"{rate / PAPER_LINES:.3g}" if rate is not None else "",
                    work,
                ],
            )
        )
        values.append([key, rate, ratio, work])

    add("reference", "reference", instrument.REFERENCE, rates["reference"])
    for figures in lit[:1]:
        for row in figures["rows"]:
            name = row["fidelity"]
            if name in ("minimal", "auto 0.01", "full"):
                work = f"default scene, {row['effects']} of {row['of']} effects"
                add(f"simulator-{name.replace(' ', '-')}", f"simulator, {name}", work,
                    row["lines_per_s"])  # fmt: skip
    add("fixed", "bit-accurate model", f"{lines['fixed']} lines to points", rates["fixed"])
    add("ideal", "float64 equations", f"{lines['ideal']} lines to points", rates["ideal"])
    simulated = f"{lines['rtl']} lines to points, Verilator"
    add("rtl", "RTL, simulated", speed["missing"] or simulated, rates.get("rtl"))
    word, hardware = _hardware(order)
    add("hardware", "hardware", word, hardware)
    return Table(
        "speed",
        ["part", "lines/s", "over\nreference", "over the paper's\n37,400 lines/s", "work"],
        rows,
        "One core of this machine, lines of 2048 px of the default scene, processor time, best of "
        "three rounds in turns; all but the hardware. The ratio to the reference, measured in the "
        "same run, is what to compare between machines. Hardware: the fastest clock that place and "
        "route reach for the whole chain, and one clock a pixel.",
        ["part", "lines_per_s", "over_reference", "work"],
        values,
    )


def _simulator(lit: Sequence[Figures]) -> Table:
    rows: list[Row] = []
    values: list[list[Any]] = []
    for figures in lit:
        full = figures["rows"][-1]["lines_per_s"]
        for row in figures["rows"]:
            name = f"{row['scene']}, {row['fidelity']}"
            rows.append(
                Row(
                    f"light-{row['scene']}-{row['fidelity'].replace(' ', '-')}",
                    [
                        name,
                        f"{row['effects']} / {row['of']}",
                        number(row["lines_per_s"]),
                        f"{row['lines_per_s'] / full:.1f}",
                        number(row["worst_px"]) if row["fidelity"] != "full" else "0",
                        number(row["truth_rms_px"]),
                    ],
                )
            )
            values.append(
                [row["scene"], row["fidelity"], row["effects"], row["of"], row["lines_per_s"],
                 row["worst_px"], row["rms_um"], row["truth_rms_px"]]
            )  # fmt: skip
    return Table(
        "light",
        [
            "simulator: scene, fidelity",
            "effects",
            "lines/s",
            "over full",
            "off from full,\nrms px",
            "chain against\ntruth, rms px",
        ],
        rows,
        "Speed of the light simulator against the error of what each fidelity leaves out, worst "
        "third of the points by depth; <code>vrscan bench light</code> has all scenes.",
        ["scene", "fidelity", "effects", "of", "lines_per_s", "off_px", "off_um", "truth_px"],
        values,
    )


SECTION = Section("instrument", "The whole instrument", cells, blocks)
