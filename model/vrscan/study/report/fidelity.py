"""Speed and error of each fidelity, against ``full`` with the same random numbers.

The work is: ``count`` lines of a scene, rendered in one process; the points are those of the
chain's bit-accurate model. A speed is that of the rendering alone, on one core: lines over the
processor time of all threads, which other programs lengthen only through the caches and memory they
share. It is the best of several short runs that take turns with those of the other fidelities,
after a first run that fills the tables. On a machine with other work it is still a fifth to a half
too low.
"""

import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from rich.table import Table as RichTable

from vrscan.data.config import Config
from vrscan.data.lines import Truth
from vrscan.data.points import atomic_file
from vrscan.data.residuals import rms
from vrscan.data.table import Table
from vrscan.engines.engine import Engine
from vrscan.engines.engine import run as run_engine
from vrscan.scene.description import Description, load
from vrscan.scene.effects import EFFECTS, present
from vrscan.scene.light import Light
from vrscan.scene.simulate import Scanner, Simulation, simulate
from vrscan.show.sheet import Column, Sheet, listed, rewrite, short, words
from vrscan.show.style import COLOURS, DECADES, INK, QUIET, drawing, plain_log
from vrscan.study.plan import FLAT_PX, JUMP_PX, ZONES, alike, judged, moved, plan
from vrscan.study.progress import Progress
from vrscan.study.report.figure import largest, mean

TOLERANCES_PX = (0.1, 0.03, 0.01)
TIGHTEST = f"auto {TOLERANCES_PX[-1]:g}"
AIM_AUTO, AIM_FULL = 20_000.0, 2_000.0  # lines/s
BREAK_EVEN_LINES = 100_000  # lines on which a choice has to pay: a long scan's
ROUNDS = 3  # timed runs of each fidelity
NO_POINT = "no point"

_FLOOR_PX = 1e-4  # smaller errors are drawn here
_LEGEND = 0.2  # height of the legend's row over a panel's
_COLUMNS = 4  # columns of panels
_TOLERANCE: dict[str, Any] = {"color": QUIET, "linewidth": 0.8, "linestyle": (0, (1, 3))}
_AIM: dict[str, Any] = {"color": COLOURS[2], "linewidth": 0.8, "linestyle": (0, (5, 3))}
_OUT: dict[str, Any] = {"markerfacecolor": "white", "markeredgewidth": 1.2}


@dataclass(frozen=True)
class Row:
    """One fidelity of one scene; errors are positions less those of ``full``.

    Where a fidelity has coarse grains, both are compared without them, as ``auto`` chooses: with
    them a change of the light would be another draw of the same error (``vrscan.study.plan``).
    They are taken over lines whose spot the camera sees and that have a point in both, no farther
    apart than ``JUMP_PX``: points farther apart belong to different peaks. ``differ`` counts the
    others, over all lines. Without a point, errors are NaN: nothing was measured.
    """

    scene: str
    fidelity: str
    tolerance_px: float  # NaN without a tolerance
    effects: int  # number of effects that are on
    of: int  # number of effects that the scene has
    lines: int
    lines_per_s: float
    planning_s: float  # with filled tables; 0 where nothing is planned
    points: int  # number of points over which errors are taken
    bias_px: float
    rms_px: float  # rms error including the bias
    worst_px: float  # the same error in the worst third of the points by depth
    p99_px: float
    max_px: float
    bias_um: float  # mean error in z
    rms_um: float
    differ: float  # share of lines with a point in only one of the two, or two far apart
    truth_rms_px: float  # rms error against the truth
    truth_median_px: float  # median absolute error against the truth

    @property
    def within(self) -> bool | None:
        """Return whether the rms of every third is within the tolerance; None without them."""
        known = self.points and not np.isnan(self.tolerance_px)
        return self.worst_px <= self.tolerance_px if known else None


@dataclass
class _Run:
    """The work that is rendered again and again."""

    fidelity: str
    tolerance_px: float
    light: Light
    active: frozenset[str]
    plane_px: float | None = None  # ``Plan.plane_px``
    planning_s: float = 0.0
    best_s: float = np.inf  # best processor time

    def go(self, count: int) -> Simulation:
        """Render all lines."""
        return simulate(self.light, count, self.active, tolerance_px=self.plane_px)


def run(
    scenes: Sequence[str],
    count: int,
    config: Config,
    progress: Progress | None = None,
    *,
    rounds: int = ROUNDS,
) -> list[Row]:
    """Return the rows of all scenes: minimal, auto from coarse to fine, full.

    Args:
        scenes: Names of shipped ones, or files.
        count: Number of lines of each scene.
        config: The instrument.
        progress: Called with the number of scenes done so far.
        rounds: Number of timed runs of each fidelity.

    Raises:
        InputError: if a scene does not load, or has no target where beam and camera meet.
    """
    loaded = [load(name) for name in scenes]  # all of them first, so that errors come at once
    rows: list[Row] = []
    for done, scene in enumerate(loaded, start=1):
        rows += _scene(scene, count, config, rounds)
        if progress is not None:
            progress(done)
    return rows


def _scene(scene: Description, count: int, config: Config, rounds: int) -> list[Row]:
    light = Light(scene, config)
    whole = frozenset(present(scene))
    full = _Run("full", np.nan, light, whole, FLAT_PX)
    reference = full.go(count)  # the first run fills the tables that all runs use
    truth = reference.lines.truth
    assert truth is not None  # a simulation has a truth, the same for all
    runs = [_Run("minimal", np.nan, light, frozenset())]
    for tolerance in TOLERANCES_PX:
        chosen = plan(
            light,
            count,
            fidelity="auto",
            tolerance_px=tolerance,
            each=False,
            break_even_lines=BREAK_EVEN_LINES,
        )
        given = (chosen.active, chosen.plane_px, chosen.seconds)
        runs.append(_Run(f"auto {tolerance:g}", tolerance, light, *given))
    one = judged(config)  # as auto chooses

    def points(each: _Run, active: frozenset[str]) -> Table:
        return run_engine(Engine.FIXED, replace(each, active=active).go(count).lines, one)

    references = {whole: run_engine(Engine.FIXED, reference.lines, one)}
    tables = []
    for each in runs:
        of, less = alike(whole, each.active)
        if of not in references:
            references[of] = points(full, of)
        own = points(each, each.active)
        tables.append((own, own if less == each.active else points(each, less), references[of]))
    tables.append((references[whole],) * 3)
    runs.append(full)
    for _ in range(rounds):
        for each in runs:
            begin = time.process_time()
            each.go(count)
            each.best_s = min(each.best_s, time.process_time() - begin)
    return [
        _row(scene.source, each, found, truth, len(whole), config)
        for each, found in zip(runs, tables, strict=True)
    ]


def costs(scenes: Sequence[str], count: int, config: Config) -> dict[str, list[float]]:
    """Return the time of each effect, microseconds per line, in all scenes that have it.

    Spots are followed ray by ray where they need it. A time is the best of several rounds.

    Args:
        scenes: Names of shipped ones, or files.
        count: Number of lines of each scene.
        config: The instrument.

    Raises:
        InputError: if a scene does not load.
    """
    found: dict[str, list[float]] = {name: [] for name in EFFECTS}
    for scene in [load(name) for name in scenes]:
        scanner = Scanner(Light(scene, config), count, frozenset(present(scene)))
        seconds = scanner.renderer.seconds
        groups = scanner.together(1)
        best = dict.fromkeys(present(scene), np.full(len(groups), np.inf))
        for _ in range(1 + ROUNDS):  # the first fills the tables
            taken = np.zeros((len(groups), len(best)))
            for k, blocks in enumerate(groups):
                seconds.clear()
                scanner.parts(blocks)
                taken[k] = [seconds.get(name, 0.0) for name in best]
            best = {
                name: np.minimum(known, own)
                for (name, known), own in zip(best.items(), taken.T, strict=True)
            }
        for name, known in best.items():
            found[name].append(1e6 * float(known.sum()) / count)
    return found


def costs_markdown(found: Mapping[str, Sequence[float]]) -> str:
    """Return the times of effects as a Markdown table, the most expensive first.

    Effects that no scene has, or that take no time of their own, are left out.
    """
    median = {name: float(np.median(own)) for name, own in found.items() if max(own, default=0.0)}
    lines = [
        [name, f"{own:.1f}", f"{max(found[name]):.1f}", f"{EFFECTS[name].typical_us:g}"]
        for name, own in sorted(median.items(), key=lambda item: -item[1])
    ]
    heads = ["effect", "median of the scenes", "largest", "as auto counts it"]
    return listed(heads, lines, left=1).markdown()


def _row(
    scene: str, made: _Run, tables: tuple[Table, ...], truth: Truth, of: int, config: Config
) -> Row:
    """Return a row from its points, and from those that are compared: the fidelity's and full's."""
    own, found, full = tables
    apart = moved(found, full, config)
    jumped = np.abs(apart) > JUMP_PX
    seen = np.isfinite(truth.position_px)
    used = found.located & full.located & seen & ~jumped
    px, um = apart[used], 1e3 * (found.z_mm - full.z_mm)[used]
    parts = np.array_split(np.argsort(truth.z_mm[used], kind="stable"), len(ZONES))
    known = own.located & seen
    error = (own.position_px - truth.position_px)[known]
    return Row(
        scene=scene,
        fidelity=made.fidelity,
        tolerance_px=made.tolerance_px,
        effects=len(made.active),
        of=of,
        lines=len(found),
        lines_per_s=len(found) / max(made.best_s, 1e-9),
        planning_s=made.planning_s,
        points=int(used.sum()),
        bias_px=mean(px) if px.size else math.nan,
        rms_px=rms(px),
        worst_px=max(rms(px[part], 0.0) for part in parts) if px.size else math.nan,
        p99_px=float(np.percentile(np.abs(px), 99.0)) if px.size else math.nan,
        max_px=largest(px),
        bias_um=mean(um) if um.size else math.nan,
        rms_um=rms(um),
        differ=float(((found.located != full.located) | jumped).mean()),
        truth_rms_px=rms(error),
        truth_median_px=float(np.median(np.abs(error))) if error.size else math.nan,
    )


def faster(rows: Sequence[Row], scene: str) -> float:
    """Return the speed of the tightest auto over that of full on a scene."""
    speed = {row.fidelity: row.lines_per_s for row in rows if row.scene == scene}
    return speed[TIGHTEST] / speed["full"]


def _scenes(rows: Sequence[Row]) -> list[str]:
    return list(dict.fromkeys(row.scene for row in rows))


def _title(scene: str) -> str:
    """Return a scene's name without folder and suffix."""
    return Path(scene).stem


def _from_full(heading: str, name: str, room: int) -> Column[Row]:
    """Return the column of an error against full, which full itself leaves empty."""

    def value(row: Row) -> float | None:
        return None if row.fidelity == "full" else float(getattr(row, name))

    return Column(heading, value, lambda error: short(error, room))


def table(rows: Sequence[Row]) -> RichTable:
    """Return the bench as a table for the terminal, 120 columns wide."""
    lines = max((row.lines for row in rows), default=0)
    columns: list[Column[Row]] = [
        words("\nscene", lambda row: _title(row.scene)),
        words("\nfidelity", lambda row: row.fidelity),
        Column("\non", lambda row: f"{row.effects}/{row.of}"),
        Column("\nlines/s", lambda row: row.lines_per_s, _speed),
        _from_full("bias\npx", "bias_px", 6),
        _from_full("rms\npx", "rms_px", 6),
        _from_full("worst\npx", "worst_px", 6),
        _from_full("99 %\npx", "p99_px", 6),
        _from_full("max\npx", "max_px", 5),
        words("\nok", lambda row: {True: "yes", False: "NO", None: ""}[row.within]),
        _from_full("rms z\nµm", "rms_um", 5),
        Column("\ndiffer", lambda row: row.differ or None, "{:.2f}%", scale=100),
        Column("truth\nrms", lambda row: row.truth_rms_px, lambda error: short(error, 5)),
        Column("truth\nmed.", lambda row: row.truth_median_px, lambda error: short(error, 5)),
        Column("plan\ns", lambda row: row.planning_s or None, "{:.1f}"),
    ]
    return Sheet(columns, rows).terminal(
        f"Fidelity against full with the same random numbers: {lines} lines of each scene, "
        "chain fixed",
        "lines/s: rendering alone, by one core's processor time; on: effects. Position less that "
        "of full, both without grain if it is on: bias, rms (bias included), rms of the worst "
        "third by depth, 99 % and largest; ok: the worst third is within auto's tolerance; differ: "
        f"lines with a point in only one of the two, or two more than {JUMP_PX:g} px apart, which "
        "count nowhere else. Truth: rms and median of the position's own error. Plan: s that "
        "planning takes.",
        apart=lambda row: row.scene,
    )


def _speed(lines_per_s: float) -> str:
    """Return a speed to three digits, because no more are repeatable."""
    digits = len(str(int(lines_per_s)))
    return f"{round(lines_per_s, 3 - digits):,.0f}"


def csv_file(rows: Sequence[Row]) -> bytes:
    """Return all figures as a file; a tolerance that there is not stays empty."""
    names = [field.name for field in fields(Row)]
    values = [[*(getattr(row, name) for name in names), _whether(row.within)] for row in rows]
    return listed([*names, "within"], values).csv()


def _whether(value: bool | None) -> int | None:
    return None if value is None else int(value)


def markdown(rows: Sequence[Row]) -> str:
    """Return the bench as a Markdown table, a line for each scene.

    In each fidelity's column lines/s and the error against full, rms of the worst third; bold is
    beyond its tolerance.
    """
    names = list(dict.fromkeys(row.fidelity for row in rows))
    lines = []
    for scene in _scenes(rows):
        here = {row.fidelity: row for row in rows if row.scene == scene}
        cells = [_markdown_cell(here[name]) for name in names]
        own = here["full"].truth_rms_px
        truth = NO_POINT if math.isnan(own) else f"{own:.2g} px"
        lines.append([_title(scene), *cells, f"{faster(rows, scene):.1f} x", truth])
    heads = ["scene", *names, f"{TIGHTEST} over full", "full against truth"]
    return listed(heads, lines, left=1).markdown()


def _markdown_cell(row: Row) -> str:
    speed = _speed(row.lines_per_s)
    if row.fidelity == "full":
        return speed
    error = f"{row.worst_px:.2g} px" if row.points else NO_POINT
    return f"{speed}, **{error}**" if row.within is False else f"{speed}, {error}"


def pages(root: Path) -> tuple[Path, Path]:
    """Return the page and the picture that ``write_pages`` rewrites."""
    return root / "docs" / "light.md", root / "docs" / "fidelity.png"


def write_pages(
    rows: Sequence[Row], times: Mapping[str, Sequence[float]], root: Path
) -> list[Path]:
    """Rewrite the generated tables of docs/light.md, and the picture next to it.

    Args:
        rows: Rows of all shipped scenes.
        times: Times of the effects, from ``costs``.
        root: Folder of the README.

    Returns:
        The files, or none if the page or its markers are missing.
    """
    page, plot = pages(root)
    if not rewrite(page, {"fidelity": markdown(rows), "costs": costs_markdown(times)}):
        return []
    with atomic_file(plot) as drawn:
        picture(rows, drawn)
    return [page, plot]


# The picture


def _marks() -> dict[str, dict[str, Any]]:
    """Return the style of each fidelity."""
    marks: dict[str, dict[str, Any]] = {"minimal": {"marker": "s", "color": COLOURS[1]}}
    for shape, tolerance in zip("v^o", TOLERANCES_PX, strict=True):
        marks[f"auto {tolerance:g}"] = {"marker": shape, "color": COLOURS[0]}
    # An auto that equals full lies on it, and both must be visible.
    marks["full"] = {"marker": "D", "color": INK, "markersize": 6.5, "zorder": 3}
    return {name: {"markersize": 5.5, "zorder": 4} | mark for name, mark in marks.items()}


def picture(rows: Sequence[Row], file: BinaryIO) -> None:
    """Draw speed over error, a panel for each scene.

    Args:
        rows: Rows of one scene or more.
        file: A binary file, written as PNG.
    """
    scenes = _scenes(rows)
    columns = min(_COLUMNS, max(len(scenes), 3))  # at least three, for title and legend
    high = -(-len(scenes) // columns)
    lines = max((row.lines for row in rows), default=0)
    title = f"Speed over error against full: {lines} lines of each scene, one core"
    with drawing(2.75 * columns, 2.1 * (high + _LEGEND) + 0.9, title) as figure:
        rows_high = {"height_ratios": [1.0] * high + [_LEGEND]}
        grid = figure.subplots(
            high + 1, columns, sharex=True, sharey=True, squeeze=False, gridspec_kw=rows_high
        )
        panels = list(grid.ravel())
        _limits(panels[0], rows)
        for index, (axes, scene) in enumerate(zip(panels, scenes, strict=False)):
            _draw_panel(axes, rows, scene)
            if index + columns >= len(scenes):  # no panel below
                axes.tick_params(labelbottom=True)
        for axes in panels[len(scenes) :]:
            axes.axis("off")
        legend = grid[-1, 0].legend(handles=_handles(), loc="upper left", ncols=4)
        legend.set_in_layout(False)  # it is as wide as the row
        figure.supxlabel(
            "rms difference of the position from full, worst third by depth, in px "
            "(none: at the left end, marked 0)",
            fontsize=9,
            color=INK,
        )
        figure.supylabel("lines/s", fontsize=9, color=INK)
        figure.savefig(file, format="png", dpi=130)


def _place(row: Row) -> float:
    """Return where a row is drawn; NaN, which is nowhere, without a point."""
    return math.nan if math.isnan(row.worst_px) else max(row.worst_px, _FLOOR_PX)


def _limits(axes: Axes, rows: Sequence[Row]) -> None:
    """Set the axes of all panels, which share them."""
    axes.set(xscale="log", yscale="log")
    farthest = max([1.0, *[row.worst_px for row in rows if row.points]])
    speeds = [row.lines_per_s for row in rows]
    low, high = min([AIM_FULL, *speeds]), max([AIM_AUTO, *speeds])
    axes.set_xlim(_FLOOR_PX / 1.8, 2.0 * farthest)
    axes.set_ylim(0.75 * low, 1.6 * high)
    powers = range(1 + round(np.log10(_FLOOR_PX)), int(np.log10(2.0 * farthest)) + 1)
    ticks = [10.0**power for power in powers]
    axes.set_xticks([_FLOOR_PX, *ticks], ["0", *[f"{tick:g}" for tick in ticks]])
    plain_log(axes, "y", DECADES, "{:,.0f}")


def _draw_panel(axes: Axes, rows: Sequence[Row], scene: str) -> None:
    axes.grid(visible=False, axis="x")
    for tolerance in TOLERANCES_PX:
        axes.axvline(tolerance, **_TOLERANCE)
    for aim in (AIM_AUTO, AIM_FULL):
        axes.axhline(aim, **_AIM)
    own = [row for row in rows if row.scene == scene]
    speeds = [row.lines_per_s for row in own]
    axes.plot([_place(row) for row in own], speeds, color=QUIET, linewidth=1.0, zorder=2)
    marks = _marks()
    for row in own:
        mark = marks[row.fidelity] | (_OUT if row.within is False else {})
        axes.plot(_place(row), row.lines_per_s, linestyle="", clip_on=False, **mark)
    if not any(row.points for row in own):
        axes.text(0.5, 0.5, NO_POINT, transform=axes.transAxes, ha="center", color=QUIET)
    axes.set_title(_title(scene))
    axes.set_title(
        f"{TIGHTEST}: {faster(rows, scene):.1f} x full",
        loc="right",
        fontsize=8,
        fontweight="normal",
        color=QUIET,
    )
    axes.tick_params(labelsize=7.5)


def _handles() -> list[Line2D]:
    marks = _marks()
    out = marks[TIGHTEST] | _OUT
    aims = f"aims: {AIM_AUTO:,.0f} auto, {AIM_FULL:,.0f} full"
    return [
        *(Line2D([], [], linestyle="", label=name, **mark) for name, mark in marks.items()),
        Line2D([], [], linestyle="", label="auto, beyond its tolerance", **out),
        Line2D([], [], label="the tolerances", **_TOLERANCE),
        Line2D([], [], label=aims, **_AIM),
    ]
