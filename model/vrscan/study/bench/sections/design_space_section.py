"""The design space: error of the detector with other widths and windows, over their cost."""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import partial
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes

from vrscan.data import boards
from vrscan.show.sheet import Column, Sheet, Value, listed, number, words
from vrscan.show.style import COLOURS, INK, QUIET, drawing, plain_log
from vrscan.study.bench import cost, design, design_cost
from vrscan.study.bench.bench_page import Block, Heading, Picture, Table, Text, slug
from vrscan.study.bench.cells import Cell, Figures
from vrscan.study.bench.design import RANGES_MM
from vrscan.study.bench.sections.section import Found, Order, Section, png
from vrscan.study.bench.widths import Design
from vrscan.study.report.efficiency import PEAKS, SIGMAS_PX
from vrscan.study.report.spot_lines import mean_square

STEPS, QUICK_STEPS = 256, 32  # positions of a spot within a pixel
LINES, QUICK_LINES = 1000, 60  # lines with noise for each of the 20 spots
SKEW_LINES, QUICK_SKEW_LINES = 800, 100  # lines for each height of a skewed spot
WINDOW_PX = 32  # window for which clocks are stated
DIGITS = 3  # to which errors are compared: what the tables show
SHIPPED = Design()
BOARD_HZ = boards.SHIPPED.clock_hz
AT_CLOCK = f"{1e-6 * BOARD_HZ:.1f} MHz"
SPOT = (2.0, 0.5)  # sigma in px and height of the spot whose error in noise is shown

# Table: log2 of its length, bits of an entry, bits of a sine, bits of the phase.
TABLES = (
    (10, 32, 24, 28),
    (9, 32, 24, 28),
    (8, 32, 24, 28),
    (7, 32, 24, 28),
    (6, 32, 24, 28),
    (5, 32, 24, 28),
    (10, 28, 24, 28),
    (10, 24, 24, 28),
    (10, 32, 24, 24),
    (8, 28, 24, 24),
    (8, 24, 24, 24),
    (7, 24, 24, 24),
    (10, 32, 18, 28),
    (8, 20, 18, 22),
    (6, 20, 18, 22),
    (6, 18, 18, 20),
)
# CORDIC: bits of its angle, number of rotations.
CORDICS = (
    (24, 26),
    (24, 22),
    (24, 20),
    (24, 18),
    (22, 22),
    (20, 22),
    (20, 18),
    (18, 18),
    (16, 16),
)
QUICK_TABLES = ((10, 32, 24, 28), (8, 20, 18, 22))
QUICK_CORDICS = ((24, 26), (20, 22))

K_NOISE, K_HEIGHT = (1.5, 2.0, 2.5, 3.0, 4.0), (0.0, 0.01, 0.02, 0.05, 0.1, 0.2)
QUICK_K_NOISE, QUICK_K_HEIGHT = (1.5, 2.5), (0.0, 0.02)
TWO_PASS = "two_pass"


@dataclass(frozen=True)
class Series:
    """One width that is changed, while the others stay as shipped.

    Attributes:
        key: Short name.
        title: Title of the series.
        unit: Unit of the values.
        values: Designs by their value, in order.
    """

    key: str
    title: str
    unit: str
    values: dict[int, Design]


def _series(key: str, title: str, unit: str, name: str, values: Sequence[int]) -> Series:
    return Series(key, title, unit, {v: replace(SHIPPED, **{name: v}) for v in values})


_ANGLES = {
    bits: replace(SHIPPED, angle_width=bits, rotations=bits + 2)
    for bits in (16, 18, 20, 22, 24, 26)
}
_DEPTHS = {1 << bits: replace(SHIPPED, table_bits=bits) for bits in (5, 6, 7, 8, 9, 10, 11)}
SERIES = (
    Series("depth", "Depth of the table", "entries", _DEPTHS),
    _series("entry", "Width of the table", "bits of an entry", "entry_width", (24, 28, 32)),
    _series("sine", "Sine behind it", "bits", "sine_width", (18, 20, 22, 24)),
    _series("phase", "Phase before it", "bits a turn", "phase_width", (16, 18, 20, 24, 28)),
    _series("rotations", "CORDIC iterations", "rotations", "rotations",
            (12, 14, 16, 18, 20, 22, 26)),
    Series("angle", "Angle, iterations as many", "bits a turn", _ANGLES),
    _series("pixel", "Pixel", "bits", "pixel_width", (8, 10, 12, 16)),
)  # fmt: skip


def series(order: Order) -> Sequence[Series]:
    """Return the series: the widths that are changed one at a time."""
    if not order.quick:
        return SERIES
    few = {v: SERIES[-1].values[v] for v in (8, 12)}
    return [replace(SERIES[-1], values=few)]


def designs(order: Order) -> list[Design]:
    """Return all designs: the series, and every table with every CORDIC; the shipped one first."""
    tables, cordics = (QUICK_TABLES, QUICK_CORDICS) if order.quick else (TABLES, CORDICS)
    found = dict.fromkeys(
        Design(*table, angle_width=angle, rotations=rotations)
        for table in tables
        for angle, rotations in cordics
    )
    for each in series(order):
        found |= dict.fromkeys(each.values.values())
    return list(found)


def _pixel_widths(order: Order) -> list[int]:
    return sorted({each.pixel_width for each in designs(order)})


def rules(order: Order) -> list[dict[str, Any]]:
    """Return the rules of the window, as values of [peak]; the configuration's own first."""
    noises = QUICK_K_NOISE if order.quick else K_NOISE
    heights = QUICK_K_HEIGHT if order.quick else K_HEIGHT
    peak = order.config.peak
    own = {"k_noise": peak.k_noise, "k_height": peak.k_height}
    grid = [{"k_noise": noise, "k_height": height} for noise in noises for height in heights]
    two_pass = [{**own, "window": TWO_PASS}] if peak.period == "n" else []
    return [own, *(rule for rule in grid if rule != own), *two_pass]


def _exact(order: Order, pixel_width: int) -> Cell:
    own = [each.plain() for each in designs(order) if each.pixel_width == pixel_width]
    steps = order.size(STEPS, QUICK_STEPS)
    return order.cell(design.EXACT, {"designs": own, "steps": steps}, seed=0)


def _noisy(order: Order, sigma: float) -> Cell:
    own = [each.plain() for each in designs(order)]
    sizes = {"sigma_px": sigma, "lines": order.size(LINES, QUICK_LINES)}
    return order.cell(design.NOISY, {**sizes, "rules": rules(order), "designs": own})


def _skewed(order: Order) -> Cell:
    lines = order.size(SKEW_LINES, QUICK_SKEW_LINES)
    return order.cell(design.SKEWED, {"lines": lines, "rules": rules(order)})


def _whole() -> Cell:
    return design_cost.cell(design_cost.WHOLE, SHIPPED)


def cells(order: Order) -> list[Cell]:
    """Return errors without and with noise, and the synthesis of each part of each design."""
    wanted = designs(order)
    found = [_noisy(order, sigma) for sigma in SIGMAS_PX]
    found += [_exact(order, bits) for bits in _pixel_widths(order)]
    found += [_skewed(order), _whole(), design_cost.cell(design_cost.SECOND_PASS, SHIPPED)]
    parts = [design_cost.cell(part, each) for each in wanted for part in design_cost.PARTS]
    return [*found, *{cell.key(): cell for cell in parts}.values()]


# ---- figures ----


@dataclass(frozen=True)
class Point:
    """A design with what it comes to; errors in px."""

    design: Design
    rms: float  # of the arithmetic
    largest: float  # of the arithmetic, on the spots
    unrounded: float  # rms before the output's rounding
    bound: float  # for any heights
    noisy: float  # rms in noise over the Cramer-Rao bound, geometric mean over the spots
    spot: float  # rms in noise of ``SPOT``
    lut: int  # of all parts, as are the next
    ff: int
    ebr: int
    dsp: float
    clocks: int  # for a window of ``WINDOW_PX``

    @property
    def rate(self) -> float:
        """Return the lines/s of the detector at the board's clock."""
        return BOARD_HZ / self.clocks


def excess(score: dict[str, float], bound: float) -> float:
    """Return rms error over the bound, lost lines at ``LOST_PX``."""
    return float(mean_square(score["rms"], score["lost"]) ** 0.5 / bound)


def _scores(noisy: dict[float, Figures], kind: str, k: int) -> list[tuple[Figures, float]]:
    """Return score and bound of a design or a rule on each of the spots."""
    return [
        (scores[k], bound)
        for figures in noisy.values()
        for scores, bound in zip(figures[kind], figures["bound_px"], strict=True)
    ]


def front(costs: Sequence[tuple[float, float]]) -> list[int]:
    """Return the points that no other one dominates by being as good in both and better in one.

    Args:
        costs: Two figures of each point; less is better.

    Returns:
        Their indices in ``costs``, by rising first figure; of equal points all.
    """
    kept: list[int] = []
    least = float("inf")
    place = sorted(range(len(costs)), key=lambda k: costs[k])
    for k in place:
        if costs[k][1] < least or (kept and costs[k] == costs[kept[-1]]):
            kept.append(k)
            least = costs[k][1]
    return kept


def _points(order: Order, found: Found) -> list[Point]:
    wanted = designs(order)
    exact: dict[Design, dict[str, float]] = {}
    for bits in _pixel_widths(order):
        own = [each for each in wanted if each.pixel_width == bits]
        exact |= dict(zip(own, found(_exact(order, bits))["errors"], strict=True))
    noisy = {sigma: found(_noisy(order, sigma)) for sigma in SIGMAS_PX}
    points = []
    for k, each in enumerate(wanted):
        over = [excess(*pair) for pair in _scores(noisy, "designs", k)]
        parts = [found(design_cost.cell(part, each)) for part in design_cost.PARTS]
        total = {name: sum(part[name] for part in parts) for name in design_cost.RESOURCES}
        points.append(
            Point(
                design=each,
                rms=exact[each]["rms"],
                largest=exact[each]["max"],
                unrounded=exact[each]["unrounded"],
                bound=design.bound(each),
                noisy=float(np.exp(np.log(over).mean())),
                spot=noisy[SPOT[0]]["designs"][PEAKS.index(SPOT[1])][k]["rms"],
                lut=int(total["lut"]),
                ff=int(total["ff"]),
                ebr=int(total["ebr"]),
                dsp=float(total["dsp"]),
                clocks=design.clocks(each, WINDOW_PX),
            )
        )
    return points


# What designs are chosen by: a price and an error, the less the better, with their headings.
FRONTS = {
    "L": ("lut", "rms", "Error over LUT"),
    "B": ("lut", "bound", "Bound over LUT"),
    "R": ("rate", "rms", "Error over rate"),
}


def _costs(point: Point, mark: str) -> tuple[float, float]:
    """Return price and error of a front; errors to ``DIGITS`` digits."""
    price, error, _ = FRONTS[mark]
    cost = -point.rate if price == "rate" else point.lut
    return cost, float(f"{getattr(point, error):.{DIGITS}g}")


def _front(points: Sequence[Point], mark: str) -> list[Point]:
    """Return the front; of points that are the same on it the shipped one, or that of least LUT."""
    costs = [_costs(point, mark) for point in points]
    kept: dict[tuple[float, float], Point] = {}
    for k in sorted(front(costs), key=lambda k: (points[k].design != SHIPPED, points[k].lut)):
        kept.setdefault(costs[k], points[k])
    return [kept[cost] for cost in sorted(kept)]


def named(each: Design) -> str:
    """Return a design in short, as the tables name it."""
    return (
        f"{1 << each.table_bits} x {each.entry_width}, phase {each.phase_width}, "
        f"sine {each.sine_width}, angle {each.angle_width}, {each.rotations} rotations"
    )


# ---- blocks ----


def blocks(order: Order, found: Found) -> Sequence[Block[Any]]:
    """Return the series, the fronts and the rules of the window, each with a picture."""
    points = _points(order, found)
    by_design = {p.design: p for p in points}
    own = by_design[SHIPPED]
    ours = [p for p in points if p.design.pixel_width == SHIPPED.pixel_width]
    return [
        Text(
            "What the widths of the detector buy. The error of the arithmetic is that of the "
            "bit-accurate model against (8) in float64 on the same pixels, of spots without noise; "
            "0.0705e-3 px rms and 0.122e-3 px at most of it are the output's own rounding. The "
            "bound holds for any heights whose first harmonic is a tenth of their sum or more. "
            f"With noise is against the truth, {order.size(LINES, QUICK_LINES)} lines of "
            "each of the 20 spots of vrscan efficiency, the same photons for all designs."
        ),
        Text(
            "LUT and the like are of five parts, window, correlator, table, CORDIC and position, "
            "each synthesised alone with each width (synth_ecp5, LFE5U). Clocks are those from a "
            f"line's last pixel to its position for a window of {WINDOW_PX} px, lines/s the "
            f"board's clock, {AT_CLOCK}, over them: no variant was placed."
        ),
        _facts(order, found, own),
        Heading("design-series", "One width at a time"),
        Picture(
            "design-series-picture",
            _series_picture(series(order), by_design),
            "Error over each width, the others as shipped (bold tick); below each width the "
            "detector's LUT. Grey: rms in noise of the spot of "
            f"s = {SPOT[0]:g} px at {100 * SPOT[1]:g} %. Level: a bit more buys nothing; far below "
            "the grey: no single line shows it.",
        ),
        _series_table(order, by_design),
        Heading("design-front", "Pareto front"),
        Picture(
            "design-front-picture",
            _front_picture(ours, own),
            f"{len(ours)} designs of {SHIPPED.pixel_width}-bit pixels: every table with every "
            "CORDIC, and the series. Left: rms of the arithmetic. Middle: the bound for any "
            "heights. Right: rms over the rate. Down is better, left (right in the last) is "
            "cheaper; the line is the front, the star the shipped widths.",
        ),
        _front_table(order, points, ours, own),
        Heading("design-window", "Rule of the window"),
        *_rules(order, found, own),
    ]


def _facts(order: Order, found: Found, own: Point) -> Table[Sequence[Value]]:
    """Return what the section's other figures stand on."""
    exact = {bits: found(_exact(order, bits)) for bits in _pixel_widths(order)}
    placed, length = cost.timing(), order.config.sensor.line_length
    names = ("peak_isolate", "phase_correlate", "peak_position")
    known = all(name in placed for name in names)
    fmax = min(float(placed[name]["fmax_mhz"]) for name in names) if known else None
    parts = [part for part in design_cost.PARTS if part.module in _CORRELATOR]
    rows: list[tuple[Value, ...]] = [
        ("windows without noise", exact[SHIPPED.pixel_width]["windows"]),
        ("LUT of correlator, table and CORDIC, each alone",
         sum(found(design_cost.cell(part, SHIPPED))["lut"] for part in parts)),
        ("LUT of the correlator as a whole", found(_whole())["lut"]),
        (f"lines/s that {length} px allow at {AT_CLOCK}", BOARD_HZ / length),
        (f"MHz of the slowest shipped module, from {cost.TIMING}", fmax),
        ("lines/s of the shipped detector at that clock", fmax and 1e6 * fmax / own.clocks),
        *((f"1e-3 px rms that a converter of {bits} bits moves (8) by, without noise",
           1e3 * figures["converter"]) for bits, figures in exact.items()),
    ]  # fmt: skip
    sheet = listed(("figure", "value"), rows, left=1)
    shown = [sheet.columns[0], replace(sheet.columns[1], form=number, absent="-")]
    return Table(
        "design-facts",
        replace(sheet, columns=shown),
        "The parts of the correlator against the whole show what is lost between them.",
        key=lambda row: f"design-{slug(str(row[0]))}",
    )


_CORRELATOR = ("phase_correlate", "quarter_wave", "cordic_vector")


def _columns(order: Order) -> list[Column[Point]]:
    """Return the columns of a design."""
    per_px = dict(zip(RANGES_MM, design.micrometres(order.config), strict=True))

    def width(name: str) -> Column[Point]:
        return Column(None, lambda point: getattr(point.design, name), name=name)

    def um(z_mm: float) -> Column[Point]:
        heading = "µm rms at\n250 mm" if z_mm == RANGES_MM[0] else f"\n{z_mm:g}"
        name = f"rms_um_{z_mm:.0f}mm"
        return Column(heading, lambda point: point.rms * per_px[z_mm], number, name=name)

    def most_um(z_mm: float) -> Column[Point]:
        return Column(None, lambda point: point.largest * per_px[z_mm], name=f"max_um_{z_mm:.0f}mm")

    milli: dict[str, Any] = {"form": number, "scale": 1e3}
    return [
        *map(width, ("table_bits", "entry_width", "sine_width", "phase_width", "angle_width",
                     "rotations", "pixel_width")),
        Column("arithmetic,\n1e-3 px rms", lambda point: point.rms, name="rms_px", **milli),
        Column("\nlargest", lambda point: point.largest, name="max_px", **milli),
        Column(None, lambda point: point.unrounded, name="unrounded_rms_px"),
        Column("bound,\n1e-3 px", lambda point: point.bound, name="bound_px", **milli),
        *map(um, RANGES_MM),
        *map(most_um, RANGES_MM),
        Column("with noise,\nover CRB", lambda point: point.noisy, "{:.4f}",
               name="noise_over_bound"),
        Column(f"s = {SPOT[0]:g} px,\n1e-3 px", lambda point: point.spot,
               partial(number, digits=4), scale=1e3, name="noise_rms_px"),
        Column("\nLUT", lambda point: point.lut, "{:,}", name="lut"),
        Column("\nFF", lambda point: point.ff, "{:,}", name="ff"),
        Column("\nEBR", lambda point: point.ebr, name="ebr"),
        Column("\nDSP", lambda point: point.dsp, "{:g}", name="dsp"),
        Column("\nclocks", lambda point: point.clocks, name="clocks"),
        Column("\nlines/s", lambda point: point.rate, "{:,.0f}", name="lines_per_s"),
    ]  # fmt: skip


_InSeries = tuple[Series, int, Point]


def _of_point(column: Column[Point]) -> Column[_InSeries]:
    """Return the column of a design for a design in its series."""
    own = {each.name: getattr(column, each.name) for each in fields(column)}
    return Column(**own | {"value": lambda row: column.value(row[2])})


def _series_table(order: Order, points: dict[Design, Point]) -> Table[_InSeries]:
    columns: list[Column[_InSeries]] = [
        words("changed", lambda row: f"{row[0].title}, {row[1]} {row[0].unit}"),
        Column(None, lambda row: row[0].key, name="changed"),
        Column(None, lambda row: row[1], name="value"),
        *map(_of_point, _columns(order)),
    ]
    rows = [(s, value, points[which]) for s in series(order) for value, which in s.values.items()]
    return Table(
        "design-series",
        Sheet(columns, rows),
        "The others are as shipped. Micrometres: the rms of the arithmetic through dz/dx_s of "
        "straight ahead. CRB: the Cramér-Rao bound, rms over it, geometric mean of 20 spots. The "
        "arithmetic is judged on the pixels it gets; light and noise are the same at all pixel "
        "widths.",
        key=lambda row: f"design-{row[0].key}-{row[1]}",
        bold=lambda row: row[2].design == SHIPPED,
    )


def _front_table(
    order: Order, points: Sequence[Point], ours: Sequence[Point], own: Point
) -> Table[Point]:
    fronts = {mark: {p.design for p in _front(ours, mark)} for mark in FRONTS}

    def on(mark: str) -> Column[Point]:
        names = {"L": "front_lut_rms", "B": "front_lut_bound", "R": "front_rate_rms"}
        return Column(None, lambda point: int(point.design in fronts[mark]), name=names[mark])

    columns: list[Column[Point]] = [
        words("table, sine, CORDIC", lambda point: named(point.design)),
        words(
            "front", lambda p: "".join(m for m, members in fronts.items() if p.design in members)
        ),
        *_columns(order),
        *map(on, FRONTS),
        Column(None, lambda point: int(point is own), name="shipped"),
    ]
    rows = sorted(points, key=lambda p: (p.lut, p.rms))
    shown = [p for p in rows if p is own or any(p.design in members for members in fronts.values())]
    return Table(
        "design-front",
        Sheet(columns, shown),
        f"What is on a front, by LUT, errors compared to {DIGITS} digits; the shipped widths in "
        "bold. L: rms against LUT, B: bound against LUT, R: rms against lines/s. All designs are "
        "in the file.",
        key=lambda point: f"design-{point.design.key}",
        bold=lambda point: point is own,
        full=Sheet(columns, rows),
    )


_ANGLE_COLOURS = {16: COLOURS[1], 18: "#b8860b", 20: COLOURS[2], 22: COLOURS[3], 24: COLOURS[0],
                  26: QUIET}  # fmt: skip


def _star(axes: Axes, x: float, y: float) -> None:
    axes.plot(x, y, "*", color=INK, markersize=14, markeredgecolor="white", zorder=7)


_LEVELS = [k * 10.0**e for e in range(-3, 4) for k in (1, 2, 5)]


def _front_picture(points: Sequence[Point], own: Point) -> bytes:
    with drawing(11.6, 4.4) as figure:
        panels = figure.subplots(1, 3)
        for axes, mark in zip(panels, FRONTS, strict=True):

            def place(point: Point, mark: str = mark) -> tuple[float, float]:
                price, error = _costs(point, mark)
                return abs(price), 1e3 * error

            for point in points:
                colour = _ANGLE_COLOURS.get(point.design.angle_width, QUIET)
                look: dict[str, Any] = {"color": colour, "markersize": 4, "alpha": 0.75}
                if point.design.sine_width < SHIPPED.sine_width:
                    look |= {"markerfacecolor": "none", "marker": "s"}
                axes.plot(*place(point), **{"marker": "o"} | look)
            best = [place(point) for point in _front(points, mark)]
            axes.plot(*zip(*best, strict=True), "-", color=INK, linewidth=1.2, zorder=6)
            _star(axes, *place(own))
            axes.set(yscale="log", xlabel="LUT of the detector", title=FRONTS[mark][2])
            axes.locator_params("x", nbins=5)
            axes.set_ylabel(f"{FRONTS[mark][1]} error, 1e-3 px".replace("bound", "largest"))
            plain_log(axes, "y", _LEVELS)
        axes.set_xlabel(f"lines/s at {AT_CLOCK}, window of {WINDOW_PX} px")
        for bits, colour in _ANGLE_COLOURS.items():
            axes.plot([], [], "o", color=colour, markersize=4, label=f"angle {bits} bits")
        axes.plot(
            [], [], "s", color=QUIET, markerfacecolor="none", markersize=4, label="sine < 24 bits"
        )
        axes.plot([], [], "*", color=INK, markersize=11, label="shipped")
        axes.plot([], [], "-", color=INK, linewidth=1.2, label="front")
        figure.legend(*axes.get_legend_handles_labels(), loc="outside lower center", ncols=9)
        return png(figure)


def _series_picture(shown: Sequence[Series], points: dict[Design, Point]) -> bytes:
    columns = min(4, len(shown) + 1)
    rows = -(-(len(shown) + 1) // columns)
    with drawing(2.95 * columns, 2.75 * rows) as figure:
        flat = figure.subplots(rows, columns, sharey=True, squeeze=False).ravel()
        for axes, each in zip(flat, shown, strict=False):
            at = np.arange(len(each.values))
            own = [points[which] for which in each.values.values()]
            for name, form, width, colour, label in (
                ("spot", "-", 3.0, QUIET, f"with noise, s = {SPOT[0]:g} px"),
                ("bound", "^:", 1.5, COLOURS[3], "bound, any heights"),
                ("largest", "s--", 1.5, COLOURS[1], "arithmetic, largest"),
                ("rms", "o-", 1.5, COLOURS[0], "arithmetic, rms"),
            ):
                errors = [1e3 * getattr(point, name) for point in own]
                axes.plot(at, errors, form, color=colour, lw=width, markersize=4, label=label)
            axes.set_yscale("log")
            names = [f"{value}\n{p.lut}" for value, p in zip(each.values, own, strict=True)]
            axes.set_xticks(at, names, fontsize=7.5)
            for label, which in zip(axes.get_xticklabels(), each.values.values(), strict=True):
                label.set_fontweight("bold" if which == SHIPPED else "normal")
            axes.margins(x=0.1)
            axes.set(title=each.title, xlabel=f"{each.unit}; LUT below")
            axes.minorticks_off()
        plain_log(flat[0], "y", _LEVELS)
        for axes in flat[::columns]:
            axes.set_ylabel("error, 1e-3 px")
        handles, labels = flat[0].get_legend_handles_labels()
        for axes in flat[len(shown) :]:
            axes.set_axis_off()
        flat[len(shown)].legend(handles[::-1], labels[::-1], loc="center", fontsize=9)
        return png(figure)


# ---- the window ----


@dataclass(frozen=True)
class Rule:
    """A rule of the window with its figures over the 20 spots."""

    values: dict[str, Any]
    noisy: float  # rms error over the bound, geometric mean
    worst: float
    lost: float
    width: float  # mean width of the window, px
    first: float  # mean width of the first window, px
    rival: float  # largest share of lines with RIVAL but without a rival
    moved: float  # movement of a skewed spot with its height, px
    clocks: int
    lut: int

    @property
    def two_pass(self) -> bool:
        """Return whether there are two windows."""
        return bool(self.values.get("window") == TWO_PASS)

    @property
    def title(self) -> str:
        """Return the name of the rule."""
        if self.two_pass:
            return "two passes"
        return f"k_noise {self.values['k_noise']:g}, k_height {self.values['k_height']:g}"

    @property
    def key(self) -> str:
        """The end of its row's id."""
        if self.two_pass:
            return "two-pass"
        return f"{self.values['k_noise']:g}-{self.values['k_height']:g}"


def _rule_list(order: Order, found: Found, own: Point) -> list[Rule]:
    noisy: dict[float, Figures] = {sigma: found(_noisy(order, sigma)) for sigma in SIGMAS_PX}
    second = found(design_cost.cell(design_cost.SECOND_PASS, SHIPPED))
    moved = found(_skewed(order))["moved"]
    listed = []
    for k, values in enumerate(rules(order)):
        scores = _scores(noisy, "rules", k)
        over = [excess(*pair) for pair in scores]
        width = float(np.mean([score["width"] for score, _ in scores]))
        first = float(np.mean([score["first"] for score, _ in scores]))
        twice = values.get("window") == TWO_PASS
        listed.append(
            Rule(
                values=values,
                noisy=float(np.exp(np.log(over).mean())),
                worst=max(over),
                lost=max(score["lost"] for score, _ in scores),
                width=width,
                first=first,
                rival=max(score["rival"] for score, _ in scores),
                moved=moved[k],
                clocks=design.clocks(SHIPPED, round(width), round(first) if twice else None),
                lut=own.lut + (int(second["lut"]) if twice else 0),
            )
        )
    return listed


def _rules(order: Order, found: Found, own: Point) -> list[Block[Any]]:
    ruled = _rule_list(order, found, own)
    best = [ruled[k] for k in front([(rule.clocks, rule.noisy) for rule in ruled])]
    columns: list[Column[Rule]] = [
        words("rule", lambda rule: rule.title),
        Column(None, lambda rule: TWO_PASS if rule.two_pass else "threshold", name="window"),
        Column(None, lambda rule: rule.values["k_noise"], name="k_noise"),
        Column(None, lambda rule: rule.values["k_height"], name="k_height"),
        Column("with noise,\nover CRB", lambda rule: rule.noisy, "{:.4f}",
               name="noise_over_bound"),
        Column("\nworst spot", lambda rule: rule.worst, "{:.3f}", name="worst_over_bound"),
        Column("lost,\nworst", lambda rule: rule.lost, "{:.2g} %", scale=100, name="lost"),
        Column("false rivals,\nworst", lambda rule: rule.rival, "{:.2g} %", scale=100,
               name="false_rivals"),
        Column("skewed spot\nmoves, 1e-3 px", lambda rule: rule.moved, number, scale=1e3,
               name="skew_moved_px"),
        Column("window,\npx", lambda rule: rule.width, "{:.1f}", name="width_px"),
        Column(None, lambda rule: rule.first, name="first_width_px"),
        Column("\nclocks", lambda rule: rule.clocks, name="clocks"),
        Column("\nlines/s", lambda rule: BOARD_HZ / rule.clocks, "{:,.0f}", name="lines_per_s"),
        Column("\nLUT", lambda rule: rule.lut, "{:,}", name="lut"),
        Column("\nfront", lambda rule: "yes" if rule in best else ""),
        Column(None, lambda rule: int(rule in best), name="front"),
    ]  # fmt: skip
    return [
        Picture(
            "design-window-picture",
            _rule_picture(ruled),
            "Error in noise above the bound: over the threshold's share of the height, for each "
            "factor of the noise (left); over clocks, windows as wide as the rule makes them "
            "(middle); over how far a skewed spot moves with its height (right). Lines in the last "
            "two are the fronts, the star is the configuration's rule, the diamond two passes.",
        ),
        Table(
            "design-window",
            Sheet(columns, ruled),
            "Threshold = background + max(k_noise noise, k_height height). Registers hold the two "
            "factors, so they cost no cells; a wider window costs clocks. Means over the 20 spots "
            f"of the study, which are symmetric. Skewed: a spot of {design.SKEW_PX:g} px and skew "
            f"{design.SKEW:g} as its height goes from {100 * design.SKEW_HEIGHTS[0]:g} to "
            f"{100 * design.SKEW_HEIGHTS[-1]:g} % of full scale. False rivals: noise that a low "
            "k_noise takes for a second spot. Front: error against clocks.",
            key=lambda rule: f"design-window-{rule.key}",
            bold=lambda rule: rule is ruled[0],
        ),
    ]


def _over(rule: Rule) -> float:
    """Return by how much the error exceeds the bound, %, at least the least value of a picture."""
    return max(100.0 * (rule.noisy - 1.0), 0.1)


def _rule_picture(listed: Sequence[Rule]) -> bytes:
    with drawing(11.6, 4.0) as figure:
        left, *others = figure.subplots(1, 3, sharey=True)
        single = [rule for rule in listed if not rule.two_pass]
        heights = sorted({rule.values["k_height"] for rule in single})
        noises = sorted({rule.values["k_noise"] for rule in single})
        shades = mpl.colormaps["viridis"](np.linspace(0.05, 0.85, len(noises)))
        for noise, colour in zip(noises, shades, strict=True):
            own = sorted(
                (rule for rule in single if rule.values["k_noise"] == noise),
                key=lambda rule: float(rule.values["k_height"]),
            )
            errors = [_over(rule) for rule in own]
            at = [heights.index(rule.values["k_height"]) for rule in own]
            left.plot(at, errors, "o-", color=colour, markersize=4, label=f"k_noise {noise:g}")
            for axes, places in zip(others, _places(own), strict=True):
                axes.plot(places, errors, "o", color=colour, markersize=4.5)
        left.set_xticks(range(len(heights)), [f"{height:g}" for height in heights])
        for rule in listed:
            if rule.two_pass:
                left.axhline(_over(rule), color=COLOURS[1], linestyle="--", label="two passes")
                for axes, (place,) in zip(others, _places([rule]), strict=True):
                    axes.plot(place, _over(rule), "D", color=COLOURS[1], markersize=7)
        for axes, places in zip(others, _places(listed), strict=True):
            pairs = [(place, _over(rule)) for place, rule in zip(places, listed, strict=True)]
            best = [pairs[k] for k in front(pairs)]
            axes.plot(*zip(*best, strict=True), "-", color=INK, linewidth=1.1, zorder=1)
            axes.set_xscale("log")
            _star(axes, *pairs[0])
        _star(left, heights.index(listed[0].values["k_height"]), _over(listed[0]))
        plain_log(others[0], "x", (200, 300, 400, 500, 600, 700))
        plain_log(others[1], "x", _LEVELS)
        left.set(
            yscale="log",
            title="Rule of the window",
            xlabel="k_height, share of the peak's height",
            ylabel="rms in noise above the Cramér-Rao bound, %",
        )
        others[0].set(title="Error over clocks", xlabel="clocks to the position")
        others[1].set(title="Error over movement", xlabel="movement of a skewed spot, 1e-3 px")
        plain_log(left, "y", _LEVELS)
        left.legend()
        return png(figure)


def _places(ruled: Sequence[Rule]) -> tuple[list[float], list[float]]:
    """Return clocks and movement in 1e-3 px of each rule."""
    return [float(rule.clocks) for rule in ruled], [1e3 * rule.moved for rule in ruled]


SECTION = Section("design", "The design space", cells, blocks)
