"""The table of numbers that ``vrscan numbers`` prints: accuracy, efficiency, latency and speed."""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial, reduce
from operator import add
from pathlib import Path

import numpy as np
from rich.table import Table as RichTable

from vrscan.data.arrays import Floats
from vrscan.data.boards import SHIPPED
from vrscan.data.config import Clock, Config
from vrscan.data.errors import InputError
from vrscan.data.residuals import rms
from vrscan.data.table import Table
from vrscan.engines.engine import Engine, run
from vrscan.engines.shadows import shaded
from vrscan.fixed import vrscan_chain as chain
from vrscan.scene.description import load, shipped
from vrscan.scene.effects import present
from vrscan.scene.light import Light
from vrscan.scene.simulate import simulate
from vrscan.show.sheet import Column, Sheet, rewrite, words
from vrscan.study.progress import Progress
from vrscan.study.report import efficiency, formats, speed
from vrscan.study.report import speckle_report as speckle
from vrscan.study.report import two_pass_report as two_pass
from vrscan.study.report.accuracy import angle_accuracy as angle
from vrscan.study.report.accuracy import cordic_accuracy as cordic
from vrscan.study.report.accuracy import geometry_accuracy as geometry
from vrscan.study.report.accuracy import mirror_accuracy as mirror
from vrscan.study.report.accuracy import position_accuracy as position
from vrscan.study.report.accuracy import quality_accuracy as quality
from vrscan.study.report.accuracy import scatter_accuracy as scatter
from vrscan.study.report.figure import SEED, Figure
from vrscan.study.report.reliability_report import MULTIPLES, Reliability, expected
from vrscan.study.report.space_report import Space

LEAST_FIXED, LEAST_RTL = 10_000.0, 400.0  # lines/s
LATENCY_WIDTHS = (3, 16, 64, 255)
MOST_FALSE_PERCENT = 0.5  # of the lines with a free part


@dataclass(frozen=True)
class Size:
    """How much is measured; the defaults are all of it."""

    vectors: int = 100_000  # a decade of amplitudes, and phases a mirror
    windows: int = 12  # a width, shape and pedestal
    directions: int = 8  # phases a width, for the worst windows
    every: int = 1  # step of the width, px
    lines: int = 10_000  # of S/N and sigma, a configuration
    distances: int = 60  # a pixel
    noisy: int = 4_000  # lines a spot
    efficiency: int = 4_000  # lines a cell
    two_pass: int = 4_000  # the same, of the study that stands on few of them; 0 leaves it out
    speckled: int = 2_000  # the same, of speckled lines
    scanned: int = 6_000  # lines of each scene
    fixed: int = 10_000  # lines for the speed
    ideal: int = 10_000  # the same
    rtl: int = 2_000  # the same; 0 leaves the RTL out
    all_cores: bool = True  # whether the speed on all cores is measured, too
    mirror: float = 0.5  # seconds of RUN; 0 leaves the mirror's loop out


FULL = Size()
QUICK = Size(
    vectors=10_000, windows=1, directions=1, every=4, lines=1_000, distances=4, noisy=300,
    efficiency=300, two_pass=0, speckled=100, scanned=300, fixed=2_000, ideal=2_000,
    rtl=0, all_cores=False, mirror=0.0,
)  # fmt: skip


@dataclass(frozen=True)
class Stage:
    """A part of the table, and the number of its progress reports."""

    name: str
    steps: int
    run: Callable[[Progress], list[Figure]]


def _positions(size: Size, period_n: bool, progress: Progress) -> list[Figure]:
    result = position.sweep(
        size.windows, size.directions, period_n=period_n, every=size.every, progress=progress
    )
    return position.measure(result, period_n=period_n)


def efficiency_figures(cells: Sequence[efficiency.Cell]) -> list[Figure]:
    """Return what the study of ``efficiency`` came to, and what is asked of it."""
    figures = []
    for name, scores, judged in (
        ("shipped", [cell.shipped for cell in cells], True),
        ("(8) as printed", [cell.printed for cell in cells], False),
    ):
        least = efficiency.GOAL_EFFICIENCY if judged else math.nan
        most = 100.0 * efficiency.GOAL_LOST if judged else math.nan
        group = "efficiency, bound over measured variance"
        mean, worst = efficiency.geometric_mean(scores), min(s.efficiency for s in scores)
        figures += [
            Figure(
                group,
                f"{name}, geometric mean",
                "1",
                mean,
                limit=least,
                at_least=True,
                headline="efficiency against the Cramer-Rao bound" if judged else "",
            ),
            Figure(group, f"{name}, worst of {len(cells)} spots", "1", worst),
            Figure(
                group,
                f"{name}, lost, worst spot",
                "%",
                100.0 * efficiency.worst_lost(scores),
                limit=most,
                headline="lines lost, worst spot" if judged else "",
            ),
        ]
    return figures


def _efficiency(count: int, progress: Progress) -> list[Figure]:
    return efficiency_figures(efficiency.study(Engine.FIXED, Config(), count, progress))


def two_pass_figures(
    cells: Sequence[two_pass.Cell],
    places: tuple[Floats, Floats],
    slopes: Sequence[two_pass.Slope],
    between: Sequence[Figure] = (),
) -> list[Figure]:
    """Return what the study of ``two_pass_report`` came to, and what is asked of it.

    Args:
        cells: Efficiencies of ``study``.
        places: Places of ``skew_positions``, in one pass and in two.
        slopes: Biases of ``slope_study``.
        between: Figures that stand behind those of the efficiency.
    """
    group, figures = "two passes", []
    for name, goal, is_dim in (
        ("5 to 90 % of full scale", two_pass.GOAL, False),
        ("2 % of full scale", two_pass.GOAL_DIM, True),
    ):
        some = [cell for cell in cells if (cell.peak == two_pass.DIM_PEAK) == is_dim]
        figures += [
            Figure(group, f"efficiency, {name}, worst of {len(some)} spots", "1",
                   min(cell.two_pass for cell in some), limit=goal, at_least=True,
                   headline=f"two passes: efficiency, {name}, worst spot"),
            Figure(group, f"one pass, {name}, worst spot", "1",
                   min(cell.one_pass for cell in some)),
        ]  # fmt: skip
    before, after = (float(np.ptp(each)) for each in places)
    moves = "a skewed spot moves, 10 to 90 % of full scale"
    pulls = "a slope of 1 count/px pulls"
    return [
        *figures,
        *between,
        Figure(group, moves, "px", after, limit=two_pass.GOAL_SKEW_PX,
               headline=f"two passes: {moves}"),
        Figure(group, "one pass, a skewed spot moves", "px", before),
        Figure(group, pulls, "px", max(abs(result.bias) for result in slopes),
               limit=two_pass.GOAL_SLOPE_PX, headline=f"two passes: {pulls}"),
    ]  # fmt: skip


def _two_passes(count: int, progress: Progress) -> list[Figure]:
    config, group = Config(), "two passes"
    cells = two_pass.study(Engine.FIXED, config, count, progress)
    places = two_pass.skew_positions(Engine.FIXED, config, count // 2)
    slopes = two_pass.slope_study(Engine.FIXED, config, count // 4)
    error, bound, same = two_pass.arithmetic(config, count // 4)
    nearest = int(np.argmax(error / bound))
    arithmetic = [
        Figure(group, "against float64 in the same window, nearest to its bound", "1e-3 px",
               1e3 * float(error[nearest]), 1e3 * float(bound[nearest])),
        Figure(group, "against float64 in the same window, rms", "1e-3 px", 1e3 * rms(error)),
        Figure(group, "lines where float64 has the same window", "%", 100.0 * same),
    ]  # fmt: skip
    return two_pass_figures(cells, places, slopes, arithmetic)


def speckle_figures(cells: Sequence[speckle.Cell]) -> list[Figure]:
    """Return what the study of ``speckle_report`` came to."""
    group, count = "speckled lines, bound with speckle over measured variance", len(cells)
    figures = []
    for window, name in (("fit", "fit"), ("two_pass", "two passes"), ("threshold", "one pass")):
        worst = min(cell.efficiency(window) for cell in cells)
        shown = "fit: efficiency on speckled lines, bound with speckle" if window == "fit" else ""
        mean = speckle.mean_efficiency(cells, window)
        figures += [
            Figure(group, f"{name}, geometric mean", "1", mean, headline=shown),
            Figure(group, f"{name}, worst of {count} spots", "1", worst),
        ]
    alone = [cell.bound_px / cell.scores["fit"].rms_px for cell in cells]
    scores = [cell.scores["fit"] for cell in cells]
    return [
        *figures,
        Figure(group, "fit, over the bound of light alone, geometric mean", "1",
               float(np.exp(2.0 * np.mean(np.log(alone))))),
        Figure(group, "fit, error over sigma, least", "1", min(each.ratio for each in scores)),
        Figure(group, "fit, error over sigma, largest", "1", max(each.ratio for each in scores)),
        Figure(group, "fit, lost, worst spot", "%", 100.0 * max(each.lost for each in scores)),
    ]  # fmt: skip


def _speckled(count: int, progress: Progress) -> list[Figure]:
    return speckle_figures(speckle.study(Engine.FIXED, Config(), count, progress))


@dataclass(frozen=True)
class Rounding:
    """By how much the shipped chain differs from the same equations in float64, rms."""

    px: float
    um: float

    @classmethod
    def of(cls, fixed: Table, ideal: Table) -> "Rounding":
        """Return that of the points without a flag that have the same window in both."""
        same = fixed.clear & ideal.clear
        same &= (fixed.left == ideal.left) & (fixed.width == ideal.width)
        return cls(
            rms((fixed.position_px - ideal.position_px)[same]),
            1e3 * rms((fixed.z_mm - ideal.z_mm)[same]),
        )


HEADLINE_SCENE = "default"  # of those with a fit, the one whose rounding the README shows


def scene_figures(found: Mapping[str, tuple[Reliability, Space, Rounding]]) -> list[Figure]:
    """Return how reliable the points of scenes are, and what is said of space without one."""
    group = "scenes with a fit, points without a flag"
    normal = 100.0 * float(expected(2))
    figures = []
    for name, (each, _, rounding) in found.items():
        shown = f"fit against float64 on {name}: " if name == HEADLINE_SCENE else ""
        figures += [
            Figure(group, f"{name}, against float64 in the same window, position, rms", "1e-3 px",
                   1e3 * rounding.px, headline=shown and f"{shown}position, rms"),
            Figure(group, f"{name}, against float64 in the same window, z, rms", "um",
                   rounding.um, headline=shown and f"{shown}z, rms"),
            Figure(group, f"{name}, error over sigma", "1", each.ratio),
            Figure(group, f"{name}, within 2 sigma, of normal errors {normal:.1f}", "%",
                   100.0 * each.share(2)),
        ]  # fmt: skip
    points = reduce(add, (each for each, *_ in found.values()))
    space = reduce(add, (each for _, each, _ in found.values()))
    free = max(space.free, 1)
    ratios = [each.ratio for each, *_ in found.values() if each.rated]
    return [
        *figures,
        Figure(group, "error over sigma, median of the scenes", "1",
               float(np.median(ratios)) if ratios else math.nan,
               headline="fit: error over predicted sigma, median of the scenes"),
        *(
            Figure(group, f"all scenes, within {k} sigma", "%", 100.0 * points.share(k),
                   headline="fit: points within 2 sigma, all scenes" if k == 2 else "")
            for k in MULTIPLES
        ),
        Figure(group, "all scenes, astray", "%", 100.0 * points.astray / max(points.points, 1)),
        Figure(group, f"falsely free, of {space.free} lines with a free part", "%",
               100.0 * space.false / free, limit=MOST_FALSE_PERCENT,
               headline="beams falsely free, all scenes"),
        Figure(group, "free, with a surface that another one hides", "%",
               100.0 * space.hidden / free),
    ]  # fmt: skip


def _scene(name: str, count: int) -> tuple[Reliability, Space, Rounding]:
    """Return the errors of a scene's points with every effect, a fit, and random numbers anew."""
    scene = load(name).model_copy(update={"seed": SEED})
    config = Config()
    lens = {"focus_mm": scene.lens.focus_mm, "f_number": scene.lens.f_number}
    changed = {
        "peak": config.peak.model_copy(update={"window": "fit"}),
        "free": config.free.model_copy(update=lens),
    }
    config = config.model_copy(update=changed)
    lines = simulate(Light(scene, config), count, frozenset(present(scene))).lines
    assert lines.truth is not None  # a simulation has a truth
    points = Table.joined(list(shaded([run(Engine.FIXED, lines, config)], config)))
    rounding = Rounding.of(points, run(Engine.IDEAL, lines, config))
    return Reliability.of(points, lines.truth), Space.of(points, lines.truth), rounding


def _scenes(count: int, progress: Progress) -> list[Figure]:
    found = {}
    for name in shipped():
        found[name] = _scene(name, count)
        progress(len(found))
    return scene_figures(found)


def latency(config: Config) -> list[Figure]:
    """Return the clocks from a line's last pixel to its point, lines without a gap."""
    group = f"latency, last pixel to point, at the clock of a {SHIPPED.title}"
    length, width = config.sensor.line_length, config.sensor.pixel_width
    on_board = config.model_copy(update={"clock": Clock(frequency_hz=SHIPPED.clock_hz)})
    figures = []
    shown = "latency, last pixel to point, at most"
    Kind = tuple[str, int | None, bool, bool, str]
    kinds: list[Kind] = [("not measured", None, False, False, "")]
    for twice in (False, True):
        more, mode = (", and again", "two passes") if twice else ("", "one window")
        kinds += [(f"N = {w}{more}", w, twice, False, f"{mode}: {shown}") for w in LATENCY_WIDTHS]
    at_board = f"latency with the fit on a {SHIPPED.title}, last pixel to point"
    kinds += [("with a fit", 255, True, True, at_board)]
    for name, window, twice, fit, headline in kinds:
        clocks = chain.latency(
            window or 0,
            measured=window is not None,
            line_length=length,
            pixel_width=width,
            first_width=window if twice else None,
            fit=fit,
        )
        clocks += length if fit else 0  # the point waits for the next line
        figures.append(Figure(group, name, "clocks", clocks))
        figures.append(
            Figure(group, name, "us", 1e6 * clocks / SHIPPED.clock_hz, headline=headline)
        )
    return [
        *figures,
        Figure(
            group,
            f"lines of {length} px at {1e-6 * SHIPPED.clock_hz:.2f} MHz",
            "lines/s",
            math.floor(on_board.most_lines_hz),
            headline=f"lines of {length} px on a {SHIPPED.title}",
        ),
    ]


def _speed(
    engine: Engine, count: int, least: float, all_cores: bool, config: Config
) -> list[Figure]:
    try:
        rate = speed.measure(engine, config, count, None if all_cores else 1)
    except InputError:  # there is no compiler
        return []
    group, scene = "speed on this machine", "of the default scene"
    one, every = f"engine {engine} on one core", f"engine {engine} on all cores"
    name = f"{one}, {count} lines {scene}"
    figures = [Figure(group, name, "lines/s", rate.one, limit=least, at_least=True, headline=one)]
    if all_cores:
        name = f"{every}, {rate.cores} of them, lines {scene}"
        figures.append(Figure(group, name, "lines/s", rate.every, headline=every))
    return figures


def stages(size: Size) -> list[Stage]:
    """Return the parts of the table, in their order."""
    config = Config()

    def at_once(name: str, measure: Callable[[], list[Figure]]) -> Stage:
        return Stage(name, 1, lambda _: measure())

    parts = [
        at_once("cordic_vector", partial(cordic.measure, size.vectors)),
        *(
            Stage(
                f"position, T = {'N' if period_n else 'N - 1'}",
                position.batches(size.every),
                partial(_positions, size, period_n),
            )
            for period_n in (True, False)
        ),
        at_once("S/N and sigma", partial(quality.measure, size.lines)),
        Stage("x and z", geometry.INSTRUMENTS, partial(geometry.measure, size.distances)),
        at_once("scan angle", partial(angle.measure, size.vectors)),
        at_once("scatter", partial(scatter.measure, size.noisy)),
        Stage(
            "efficiency",
            len(efficiency.PEAKS) * len(efficiency.SIGMAS_PX),
            partial(_efficiency, size.efficiency),
        ),
        Stage("speckled lines", speckle.SPOTS, partial(_speckled, size.speckled)),
        Stage("scenes", len(shipped()), partial(_scenes, size.scanned)),
        at_once("latency", partial(latency, config)),
    ]
    if size.two_pass:
        cells = len(two_pass.PEAKS) * len(two_pass.SIGMAS_PX)
        parts.append(Stage("two passes", cells, partial(_two_passes, size.two_pass)))
    for engine, count, least in (
        (Engine.FIXED, size.fixed, LEAST_FIXED),
        (Engine.IDEAL, size.ideal, math.nan),
        (Engine.RTL, size.rtl, LEAST_RTL),
    ):
        if count:
            given = engine, count, least, size.all_cores, config
            parts.append(at_once(f"speed, {engine}", partial(_speed, *given)))
    if size.mirror:
        parts += [
            at_once("mirror, steady", partial(mirror.steady, config, size.mirror)),
            at_once("mirror, faults", partial(mirror.faults, config, size.mirror)),
            *(
                at_once(f"mirror, {hertz:+g} Hz", partial(mirror.drift, config, hertz, seconds))
                for hertz, seconds in mirror.DRIFTS
            ),
        ]
    return parts


def _text(value: float) -> str:
    if math.isnan(value):
        return "-"
    if value == 0.0 or 1e-3 <= abs(value) < 1e6:
        return f"{value:.4g}" if abs(value) < 1e4 else f"{value:.0f}"
    return f"{value:.3g}"


def _limit(figure: Figure) -> str:
    text = _text(figure.limit)
    return f">= {text}" if figure.at_least and text != "-" else text


def _verdict(figure: Figure) -> str:
    if not figure.judged:
        return ""
    return "ok" if figure.passes else "FAIL"


README = (  # the headlines that it shows
    f"fit against float64 on {HEADLINE_SCENE}: position, rms",
    f"fit against float64 on {HEADLINE_SCENE}: z, rms",
    "fit: efficiency on speckled lines, bound with speckle",
    "fit: error over predicted sigma, median of the scenes",
    "fit: points within 2 sigma, all scenes",
    "beams falsely free, all scenes",
    f"latency with the fit on a {SHIPPED.title}, last pixel to point",
    f"lines of 2048 px on a {SHIPPED.title}",
    "angle against the mirror's truth in RUN, rms",
    "engine fixed on one core",
    "engine rtl on one core",
)
_SUMMARY = "docs/numbers.md#headline-figures"


_COLUMNS: list[Column[Figure]] = [
    Column(None, lambda f: f.group, name="group"),
    words("figure", lambda f: f.name, name="name", wraps=True),
    words("unit", lambda f: f.unit, name="unit"),
    Column("measured", lambda f: f.measured, _text, name="measured", kept="{}", absent="-"),
    Column("predicted", lambda f: f.predicted, _text, name="predicted", kept="{}", absent="-"),
    Column("floor", lambda f: f.floor, _text, name="floor", kept="{}", absent="-"),
    Column("limit", _limit),
    Column(None, lambda f: f.limit, name="limit", kept="{}"),
    Column(None, lambda f: "least" if f.at_least else "most", name="limit_is"),
    Column(None, lambda f: int(f.passes) if f.judged else None, name="passes"),
]


def sheet(figures: Sequence[Figure]) -> Sheet[Figure]:
    """Return all figures as a table, a heading a group."""
    return Sheet([*_COLUMNS, words("", _verdict)], figures, group=lambda figure: figure.group)


def table(figures: Sequence[Figure]) -> RichTable:
    """Return the table for the terminal."""
    return sheet(figures).terminal(
        f"Measured, predicted from the widths, and what is asked; seed {SEED}",
        "floor: what the output's own rounding leaves; 0.5 % or step: error in units of what is "
        "allowed, 0.5 % of the value or one step; ratio: first harmonic of (8) over the sum above "
        "background",
    )


def headlines(figures: Iterable[Figure]) -> dict[str, Figure]:
    """Return a figure for each headline: of those that share it, the one nearest to its limit."""
    worst: dict[str, Figure] = {}
    for figure in figures:
        held = worst.get(figure.headline, figure)
        worst[figure.headline] = max(held, figure, key=lambda f: f.nearness)
    worst.pop("", None)
    return worst


def summary(figures: Iterable[Figure]) -> str:
    """Return the table of headlines for docs/numbers.md."""
    found = headlines(figures)
    return Sheet(_COLUMNS, [replace(f, name=name) for name, f in found.items()]).markdown()


def excerpt(figures: Iterable[Figure]) -> str:
    """Return the table of the README, whose names link to docs/numbers.md."""
    found = headlines(figures)
    columns: list[Column[Figure]] = [
        words("figure", lambda f: f"[{f.headline}]({_SUMMARY})"),
        Column("reached", lambda f: f"{_text(f.measured)} {f.unit}".removesuffix(" 1")),
        Column("asked", lambda f: f"{'<= ' * _limit(f)[0].isdigit()}{_limit(f)}"),
    ]
    return Sheet(columns, [found[name] for name in README if name in found]).markdown()


def pages(root: Path) -> tuple[Path, Path]:
    """Return the pages that ``write_pages`` rewrites, those with the number table."""
    return root / "README.md", root / "docs" / "numbers.md"


def write_pages(figures: Sequence[Figure], root: Path) -> list[Path]:
    """Rewrite the generated blocks of README.md and docs/numbers.md.

    Args:
        figures: Figures of the full size.
        root: Folder of the README.

    Returns:
        The files that have their markers; the others stay as they are.
    """
    new = (
        {"numbers": excerpt(figures)},
        {"numbers": sheet(figures).markdown(), "summary": summary(figures), **formats.blocks()},
    )
    return [page for page, blocks in zip(pages(root), new, strict=True) if rewrite(page, blocks)]
