"""The design space: error of the detector with other widths and windows, over their cost."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from vrscan.show.style import COLOURS, INK, LIGHT, QUIET, STYLE
from vrscan.study.bench import cost, design, design_cost
from vrscan.study.bench.bench_page import Block, Heading, Picture, Row, Table, Text, number
from vrscan.study.bench.cells import Cell, Figures, plain
from vrscan.study.bench.design import RANGES_MM
from vrscan.study.bench.sections.section import Found, Order, Section, png
from vrscan.study.bench.widths import Design
from vrscan.study.report.efficiency import LOST_PX, PEAKS, SIGMAS_PX

STEPS, QUICK_STEPS = 256, 32  # positions of a spot within a pixel
LINES, QUICK_LINES = 1000, 60  # lines with noise for each of the 20 spots
SKEW_LINES, QUICK_SKEW_LINES = 800, 100  # lines for each height of a skewed spot
WINDOW_PX = 32  # window for which clocks are stated
BOARD_HZ = 100e6  # clock of the ULX3S
NEAR = 1.05  # error over the shipped one's that is almost as good
UNSEEN = 1.001  # the same ratio in noise
DIGITS = 3  # digits to which errors are compared and shown
SHIPPED = Design()
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
QUICK_SERIES = ("pixel",)


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
    parameters: dict[str, Any] = {"config": plain(order.config), "designs": own}
    return Cell(design.EXACT, parameters | {"steps": QUICK_STEPS if order.quick else STEPS}, 0)


def _noisy(order: Order, sigma: float) -> Cell:
    parameters: dict[str, Any] = {"config": plain(order.config), "sigma_px": sigma}
    parameters |= {"lines": QUICK_LINES if order.quick else LINES, "rules": rules(order)}
    parameters["designs"] = [each.plain() for each in designs(order)]
    return Cell(design.NOISY, parameters, order.seed)


def _skewed(order: Order) -> Cell:
    parameters: dict[str, Any] = {"config": plain(order.config), "rules": rules(order)}
    parameters["lines"] = QUICK_SKEW_LINES if order.quick else SKEW_LINES
    return Cell(design.SKEWED, parameters, order.seed)


def _whole() -> Cell:
    return design_cost.cell(design_cost.WHOLE, SHIPPED)


def cells(order: Order) -> list[Cell]:
    """Return errors without and with noise, and the synthesis of each part of each design."""
    wanted = designs(order)
    found = [_noisy(order, sigma) for sigma in SIGMAS_PX]
    found += [_exact(order, bits) for bits in sorted({each.pixel_width for each in wanted})]
    found += [_skewed(order), _whole(), design_cost.cell(design_cost.SECOND_PASS, SHIPPED)]
    parts = [design_cost.cell(part, each) for each in wanted for part in design_cost.PARTS]
    return [*found, *{cell.key(): cell for cell in parts}.values()]


# ---- figures ----


@dataclass(frozen=True)
class Point:
    """A design with its figures.

    Attributes:
        design: Widths of the design.
        rms: Rms error of the arithmetic, px.
        largest: Largest error of the arithmetic on the spots, px.
        unrounded: Rms error before the output's rounding, px.
        bound: Largest error for any heights, px.
        noisy: Rms error in noise over the Cramer-Rao bound, geometric mean over the spots.
        spot: Rms error in noise of ``SPOT``, px.
        lut: Number of LUTs; the next fields are flip-flops, block RAMs and multipliers of all
            parts.
        clocks: Number of clocks for a window of ``WINDOW_PX``.
    """

    design: Design
    rms: float
    largest: float
    unrounded: float
    bound: float
    noisy: float
    spot: float
    lut: int
    ff: int
    ebr: int
    dsp: float
    clocks: int

    @property
    def rate(self) -> float:
        """Return the lines/s of the detector at the board's clock."""
        return BOARD_HZ / self.clocks


def excess(score: dict[str, float], bound: float) -> float:
    """Return the rms error over the bound, with an error of ``LOST_PX`` for lost lines."""
    kept = 0.0 if score["lost"] == 1.0 else (1.0 - score["lost"]) * score["rms"] ** 2
    return float((kept + score["lost"] * LOST_PX**2) ** 0.5 / bound)


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
    for bits in sorted({each.pixel_width for each in wanted}):
        own = [each for each in wanted if each.pixel_width == bits]
        exact |= dict(zip(own, found(_exact(order, bits))["errors"], strict=True))
    noisy = {sigma: found(_noisy(order, sigma)) for sigma in SIGMAS_PX}
    points = []
    for k, each in enumerate(wanted):
        over = [
            excess(noisy[sigma]["designs"][row][k], noisy[sigma]["bound_px"][row])
            for sigma in SIGMAS_PX
            for row in range(len(PEAKS))
        ]
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


@dataclass(frozen=True)
class Axis:
    """A figure by which a design is chosen."""

    key: str
    words: str
    unit: str
    scale: float = 1.0

    def of(self, point: Point) -> float:
        """Return the figure, of which less is better; errors to ``DIGITS`` digits."""
        if self.key == "rate":
            return -point.rate
        return float(f"{getattr(point, self.key):.{DIGITS}g}") if self.scale != 1.0 else point.lut


RMS = Axis("rms", "rms error", "1e-3 px", 1e3)
BOUND = Axis("bound", "error bound for any heights", "1e-3 px", 1e3)
LUT = Axis("lut", "LUT", "LUT")
RATE = Axis("rate", "lines/s", "lines/s")
FRONTS = ((LUT, RMS), (LUT, BOUND), (RATE, RMS))


def _front(points: Sequence[Point], axes: tuple[Axis, Axis]) -> list[Point]:
    """Return the front; of points that are equal on it the shipped one, or that of least LUT."""
    costs = [(axes[0].of(p), axes[1].of(p)) for p in points]
    kept: dict[tuple[float, float], Point] = {}
    for k in sorted(front(costs), key=lambda k: (points[k].design != SHIPPED, points[k].lut)):
        kept.setdefault(costs[k], points[k])
    return [kept[cost] for cost in sorted(kept)]


def dominator(points: Sequence[Point], axes: tuple[Axis, Axis], own: Point) -> Point | None:
    """Return the cheapest of the points that dominate ``own``, None without any."""
    first, second = axes
    better = [
        p
        for p in points
        if first.of(p) <= first.of(own)
        and second.of(p) <= second.of(own)
        and (first.of(p), second.of(p)) != (first.of(own), second.of(own))
    ]
    return min(better, key=lambda p: (first.of(p), second.of(p)), default=None)


def words(each: Design) -> str:
    """Return a design as the short text of the tables."""
    return (
        f"{1 << each.table_bits} x {each.entry_width}, phase {each.phase_width}, "
        f"sine {each.sine_width}, angle {each.angle_width}, {each.rotations} rotations"
    )


def beaten(points: Sequence[Point], own: Point) -> Point | None:
    """Return the point with fewest LUT that is worse than ``own`` in one figure at most.

    Figures are rms, largest error and bound, all resources and the clocks; None without such a
    point.
    """

    def figures(point: Point) -> list[float]:
        errors = [float(f"{e:.{DIGITS}g}") for e in (point.rms, point.largest, point.bound)]
        return [*errors, point.lut, point.ff, point.ebr, point.dsp, point.clocks]

    wanted = figures(own)
    better = [
        p
        for p in points
        if figures(p) != wanted and all(a <= b for a, b in zip(figures(p), wanted, strict=True))
    ]
    return min(better, key=lambda p: p.lut, default=None)


def verdict(points: Sequence[Point], own: Point) -> list[str]:
    """Return sentences on the place of the shipped configuration."""
    said = []
    best = beaten(points, own)
    if best is None:
        said.append("No design is as good as the shipped one in every figure and better in one.")
    else:
        saved = {
            f"LUT ({100 * (own.lut - best.lut) / own.lut:.1f} %)": own.lut - best.lut,
            "FF": own.ff - best.ff,
            "EBR": own.ebr - best.ebr,
            "DSP": own.dsp - best.dsp,
            "clocks": own.clocks - best.clocks,
        }
        fewer = ", ".join(f"{count:g} {name}" for name, count in saved.items() if count)
        said.append(
            "The shipped widths are <b>dominated in every figure at once</b>: "
            f"{words(best.design)} has the same errors and bound, to {DIGITS} digits, or less, "
            f"the same resources, or fewer: {fewer or 'none'}."
        )
    unseen = [p for p in points if p.noisy <= UNSEEN * own.noisy]
    least = min(unseen, key=lambda p: (p.lut, p.rms))
    said.append(
        f"In noise the widths stop to matter early: {words(least.design)} errs "
        f"{least.noisy:.4f} times the Cramér-Rao bound, the shipped widths {own.noisy:.4f}, and "
        f"takes {own.lut - least.lut} LUT ({100 * (own.lut - least.lut) / own.lut:.0f} %), "
        f"{own.dsp - least.dsp:g} DSP and {own.clocks - least.clocks} clocks less. What more bits "
        f"buy is the bound for any heights, {1e3 * least.bound:.2g}e-3 px there and "
        f"{1e3 * own.bound:.2g}e-3 px as shipped, and averages over many lines."
    )
    for axes in FRONTS:
        price, error = axes
        where = f"{error.words} against {price.words}"
        best = dominator(points, axes, own)
        if best is None:
            text = f"{where}: the shipped widths are on the front."
        else:
            if price.of(best) == price.of(own):
                gain = f"as many {price.words}"
            elif price is LUT:
                gain = f"{own.lut - best.lut} LUT fewer"
            else:
                gain = f"{best.rate - own.rate:,.0f} lines/s more"
            a, b = error.of(own), error.of(best)
            less = "the same error" if a == b else f"{error.words} {100 * (1 - b / a):.2g} % lower"
            text = (
                f"{where}: the shipped widths are <b>not</b> on the front. "
                f"{words(best.design)} dominates them with {gain} and {less}."
            )
        near = [p for p in points if error.of(p) <= NEAR * error.of(own)]
        cheap = min(near, key=lambda p: (price.of(p), error.of(p)))
        if cheap is not own and cheap is not best:
            saves = (
                f"{own.lut - cheap.lut} LUT ({100 * (own.lut - cheap.lut) / own.lut:.0f} %)"
                if price is LUT
                else f"{100 * (cheap.rate / own.rate - 1):.0f} % of the rate"
            )
            text += (
                f" Within {100 * (NEAR - 1):.0f} % of their error the cheapest is "
                f"{words(cheap.design)}: it gains {saves}."
            )
        said.append(text[0].upper() + text[1:])
    return said


# ---- blocks ----


def blocks(order: Order, found: Found) -> Sequence[Block]:
    """Return the series, the fronts and the rules of the window, each with a picture."""
    points = _points(order, found)
    by_design = {p.design: p for p in points}
    own = by_design[SHIPPED]
    ours = [p for p in points if p.design.pixel_width == SHIPPED.pixel_width]
    whole = found(_whole())
    alone = [
        found(design_cost.cell(part, SHIPPED))["lut"]
        for part in design_cost.PARTS
        if part.module in ("phase_correlate", "quarter_wave", "cordic_vector")
    ]
    shown = order.config.sensor.line_length
    windows = found(_exact(order, SHIPPED.pixel_width))["windows"]
    return [
        Text(
            "What the widths of the detector buy. Its RTL is synthesised with each width "
            "(<code>synth_ecp5</code>, LFE5U), and its bit-accurate model runs with the same: "
            "every LUT and every error is measured. The error of the <b>arithmetic</b> is that "
            f"against (8) in float64 on the same pixels, over {windows:,} windows of spots without "
            f"noise (s = {', '.join(f'{s:g}' for s in design.SPOTS_PX)} px, "
            f"{' and '.join(f'{100 * h:g}' for h in design.HEIGHTS)} % of full scale, "
            f"{QUICK_STEPS if order.quick else STEPS} places in a pixel). The position leaves "
            "with 12 fraction bits: 0.0705e-3 px rms and 0.122e-3 px at most are its own rounding, "
            "which no width here removes. The <b>bound</b> holds for any heights of a window of up "
            "to 255 px whose first harmonic is a tenth of their sum or more: what the widths were "
            "chosen by. <b>With noise</b> is against the truth, the light of "
            f"<code>vrscan efficiency</code>, {QUICK_LINES if order.quick else LINES} lines of "
            "each of 20 spots: all designs get the same photons, so differences are no chance."
        ),
        Text(
            "A detector is peak_isolate, phase_correlate and peak_position; its cells are those of "
            "five parts, window, correlator, table, CORDIC and position, each synthesised alone. "
            f"Of the correlator as a whole the parts make {sum(alone):,} LUT of {whole['lut']:,}. "
            f"Clocks are those from the line's last pixel to its position for a window of "
            f"{WINDOW_PX} px, and lines/s are the board's clock, {BOARD_HZ / 1e6:.0f} MHz, over "
            "them: no variant was placed. A line also takes a clock for each of its pixels: "
            f"{shown} px at {BOARD_HZ / 1e6:.0f} MHz are {BOARD_HZ / shown:,.0f} lines/s with "
            f"each of these designs. {_placed(own)}"
        ),
        Heading("design-series", "One width at a time"),
        Picture(
            "design-series-picture",
            _series_picture(series(order), by_design),
            "Error over each width, the others as shipped (bold tick); below each width the "
            "detector's LUT. Grey: rms in noise of the spot of "
            f"s = {SPOT[0]:g} px at {100 * SPOT[1]:g} %. Where all are level, a bit more buys "
            "nothing; what is far below the grey, no single line shows.",
        ),
        _series_table(order, by_design, found),
        Heading("design-front", "Pareto front"),
        *(Text(sentence) for sentence in verdict(ours, own)),
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


def _placed(own: Point) -> str:
    placed = cost.timing()
    names = ("peak_isolate", "phase_correlate", "peak_position")
    if any(name not in placed for name in names):
        return f"Fmax of the shipped modules: run <code>{cost.TIMING}</code>."
    slowest = min(float(placed[name]["fmax_mhz"]) for name in names)
    return (
        f"The shipped modules, placed, reach {slowest:.1f} MHz: "
        f"{1e6 * slowest / own.clocks:,.0f} lines/s."
    )


_HEADINGS = (
    "arithmetic,\n1e-3 px rms",
    "\nlargest",
    "µm rms at\n250 mm",
    "\n500",
    "\n1000",
    "bound,\n1e-3 px",
    "with noise,\nover CRB",
    f"s = {SPOT[0]:g} px,\n1e-3 px",
    "\nLUT",
    "\nFF",
    "\nEBR",
    "\nDSP",
    "\nclocks",
    "\nlines/s",
)
_COLUMNS = (
    "table_bits", "entry_width", "sine_width", "phase_width", "angle_width", "rotations",
    "pixel_width", "rms_px", "max_px", "unrounded_rms_px", "bound_px",
    *(f"{what}_um_{z:.0f}mm" for what in ("rms", "max") for z in RANGES_MM),
    "noise_over_bound", "noise_rms_px", "lut", "ff", "ebr", "dsp", "clocks", "lines_per_s",
)  # fmt: skip


def _texts(point: Point, per_px: Sequence[float]) -> list[str]:
    return [
        number(1e3 * point.rms),
        number(1e3 * point.largest),
        *(number(point.rms * um) for um in per_px),
        number(1e3 * point.bound),
        f"{point.noisy:.4f}",
        number(1e3 * point.spot, 4),
        f"{point.lut:,}",
        f"{point.ff:,}",
        f"{point.ebr}",
        f"{point.dsp:g}",
        f"{point.clocks}",
        f"{point.rate:,.0f}",
    ]


def _values(point: Point, per_px: Sequence[float]) -> list[Any]:
    return [
        *vars(point.design).values(),
        point.rms,
        point.largest,
        point.unrounded,
        point.bound,
        *(size * um for size in (point.rms, point.largest) for um in per_px),
        point.noisy,
        point.spot,
        point.lut,
        point.ff,
        point.ebr,
        point.dsp,
        point.clocks,
        point.rate,
    ]


def _series_table(order: Order, points: dict[Design, Point], found: Found) -> Table:
    per_px = design.micrometres(order.config)
    rows, values = [], []
    for each in series(order):
        for value, which in each.values.items():
            point = points[which]
            title = f"{each.title}, {value} {each.unit}"
            row = f"design-{each.key}-{value}"
            rows.append(Row(row, [title, *_texts(point, per_px)], bold=which == SHIPPED))
            values.append([each.key, value, *_values(point, per_px)])
    pixels = [
        f"{1e3 * found(_exact(order, bits))['converter']:.2g} at {bits} bits"
        for each in series(order)
        if each.key == "pixel"
        for bits in each.values
    ]
    return Table(
        "design-series",
        ["changed", *_HEADINGS],
        rows,
        "The others are as shipped. Micrometres: the rms of the arithmetic through dz/dx_s of "
        "straight ahead. CRB: the Cramér-Rao bound, rms over it, geometric mean of 20 spots. The "
        "arithmetic is judged on the pixels it gets; what the converter itself rounds away moves "
        f"(8) by {', '.join(pixels)} (1e-3 px rms, without noise). Light and noise are the same "
        "at all pixel widths.",
        ["changed", "value", *_COLUMNS],
        values,
    )


def _front_table(order: Order, points: Sequence[Point], ours: Sequence[Point], own: Point) -> Table:
    per_px = design.micrometres(order.config)
    fronts = [set(map(id, _front(ours, axes))) for axes in FRONTS]
    rows, values = [], []
    for point in sorted(points, key=lambda p: (p.lut, p.rms)):
        on = [id(point) in members for members in fronts]
        values.append([*_values(point, per_px), *map(int, on), int(point is own)])
        if any(on) or point is own:
            marks = "".join(mark if is_on else "" for mark, is_on in zip("LBR", on, strict=True))
            cells = [words(point.design), marks, *_texts(point, per_px)]
            rows.append(Row(f"design-{point.design.key}", cells, bold=point is own))
    return Table(
        "design-front",
        ["table, sine, CORDIC", "front", *_HEADINGS],
        rows,
        f"What is on a front, by LUT, errors compared to {DIGITS} digits; the shipped widths in "
        "bold. L: rms against LUT, B: bound against LUT, R: rms against lines/s. All designs are "
        "in the file.",
        [*_COLUMNS, "front_lut_rms", "front_lut_bound", "front_rate_rms", "shipped"],
        values,
    )


_ANGLE_COLOURS = {16: COLOURS[1], 18: "#b8860b", 20: COLOURS[2], 22: COLOURS[3], 24: COLOURS[0],
                  26: QUIET}  # fmt: skip


def _star(axes: Axes, x: float, y: float) -> None:
    axes.plot(x, y, "*", color=INK, markersize=14, markeredgecolor="white", zorder=7)


def _plain_log(axes: Axes, which: str, levels: Sequence[float]) -> None:
    """Write the ticks of a logarithmic axis as plain numbers."""
    low, high = axes.get_xlim() if which == "x" else axes.get_ylim()
    ticks = [level for level in levels if low <= level <= high]
    names = [f"{tick:g}" for tick in ticks]
    (axes.set_xticks if which == "x" else axes.set_yticks)(ticks, names)
    axes.tick_params(which="minor", length=0)
    axes.minorticks_off()


_LEVELS = [k * 10.0**e for e in range(-3, 4) for k in (1, 2, 5)]


def _front_picture(points: Sequence[Point], own: Point) -> bytes:
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(11.6, 4.4), layout="constrained")
        all_axes = figure.subplots(1, 3)
        for axes, pair, title in zip(
            all_axes, FRONTS, ("Error over LUT", "Bound over LUT", "Error over rate"), strict=True
        ):
            price, error = pair

            def place(point: Point, pair: tuple[Axis, Axis] = pair) -> tuple[float, float]:
                return abs(pair[0].of(point)), pair[1].scale * pair[1].of(point)

            axes.grid(color=LIGHT, linewidth=0.5)
            axes.set_axisbelow(True)
            for point in points:
                colour = _ANGLE_COLOURS.get(point.design.angle_width, QUIET)
                narrow = point.design.sine_width < SHIPPED.sine_width
                axes.plot(
                    *place(point),
                    "s" if narrow else "o",
                    color=colour,
                    markersize=4,
                    alpha=0.75,
                    markerfacecolor="none" if narrow else colour,
                )
            best = [place(point) for point in _front(points, pair)]
            axes.plot(*zip(*best, strict=True), "-", color=INK, linewidth=1.2, zorder=6)
            _star(axes, *place(own))
            axes.set_yscale("log")
            _plain_log(axes, "y", _LEVELS)
            axes.set_xlabel(f"{price.words}{' of the detector' if price is LUT else ''}")
            axes.set_ylabel(f"{error.words}, {error.unit}")
            axes.set_title(title)
        all_axes[2].set_xlabel(f"lines/s at {BOARD_HZ / 1e6:.0f} MHz, window of {WINDOW_PX} px")
        marks = [
            all_axes[0].plot([], [], "o", color=colour, markersize=4, label=f"angle {bits} bits")[0]
            for bits, colour in _ANGLE_COLOURS.items()
        ]
        marks += all_axes[0].plot(
            [], [], "s", color=QUIET, markerfacecolor="none", markersize=4, label="sine < 24 bits"
        )
        marks += all_axes[0].plot([], [], "*", color=INK, markersize=11, label="shipped")
        marks += all_axes[0].plot([], [], "-", color=INK, linewidth=1.2, label="front")
        figure.legend(handles=marks, loc="outside lower center", ncols=9)
        return png(figure)


def _series_picture(shown: Sequence[Series], points: dict[Design, Point]) -> bytes:
    with mpl.rc_context(STYLE):
        columns = min(4, len(shown) + 1)
        rows = -(-(len(shown) + 1) // columns)
        figure = Figure(figsize=(2.95 * columns, 2.75 * rows), layout="constrained")
        flat = figure.subplots(rows, columns, sharey=True, squeeze=False).ravel()
        for axes, each in zip(flat, shown, strict=False):
            axes.grid(color=LIGHT, linewidth=0.5)
            axes.set_axisbelow(True)
            at = np.arange(len(each.values))
            own = [points[which] for which in each.values.values()]
            axes.plot(at, [1e3 * p.spot for p in own], "-", color=QUIET, linewidth=3, alpha=0.5,
                      label=f"with noise, s = {SPOT[0]:g} px")  # fmt: skip
            axes.plot(at, [1e3 * p.bound for p in own], "^:", color=COLOURS[3], markersize=4,
                      label="bound, any heights")  # fmt: skip
            axes.plot(at, [1e3 * p.largest for p in own], "s--", color=COLOURS[1], markersize=4,
                      label="arithmetic, largest")  # fmt: skip
            axes.plot(at, [1e3 * p.rms for p in own], "o-", color=COLOURS[0], markersize=4,
                      label="arithmetic, rms")  # fmt: skip
            axes.set_yscale("log")
            names = [f"{value}\n{p.lut}" for value, p in zip(each.values, own, strict=True)]
            axes.set_xticks(at, names, fontsize=7.5)
            for label, which in zip(axes.get_xticklabels(), each.values.values(), strict=True):
                label.set_fontweight("bold" if which == SHIPPED else "normal")
            axes.margins(x=0.1)
            axes.set_title(each.title)
            axes.set_xlabel(f"{each.unit}; LUT below")
            axes.minorticks_off()
        _plain_log(flat[0], "y", _LEVELS)
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


def _rule_list(order: Order, found: Found, own: Point) -> list[Rule]:
    noisy: dict[float, Figures] = {sigma: found(_noisy(order, sigma)) for sigma in SIGMAS_PX}
    second = found(design_cost.cell(design_cost.SECOND_PASS, SHIPPED))
    moved = found(_skewed(order))["moved"]
    listed = []
    for k, values in enumerate(rules(order)):
        scores = [
            (noisy[sigma]["rules"][row][k], noisy[sigma]["bound_px"][row])
            for sigma in SIGMAS_PX
            for row in range(len(PEAKS))
        ]
        over = [excess(score, least) for score, least in scores]
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


def _rules(order: Order, found: Found, own: Point) -> list[Block]:
    listed = _rule_list(order, found, own)
    shipped = listed[0]
    best = front([(rule.clocks, rule.noisy) for rule in listed])
    rows, values = [], []
    for k, rule in enumerate(listed):
        mark = "yes" if k in best else ""
        rate = BOARD_HZ / rule.clocks
        name = "two-pass" if rule.two_pass else (
            f"{rule.values['k_noise']:g}-{rule.values['k_height']:g}"
        )  # fmt: skip
        texts = [f"{rule.noisy:.4f}", f"{rule.worst:.3f}", f"{100 * rule.lost:.2g} %"]
        texts.append(f"{100 * rule.rival:.2g} %")
        texts += [
            number(1e3 * rule.moved),
            f"{rule.width:.1f}",
            f"{rule.clocks}",
            f"{rate:,.0f}",
            f"{rule.lut:,}",
            mark,
        ]
        rows.append(Row(f"design-window-{name}", [rule.title, *texts], bold=rule is shipped))
        values.append(
            ["two_pass" if rule.two_pass else "threshold", rule.values["k_noise"],
             rule.values["k_height"], rule.noisy, rule.worst, rule.lost, rule.rival, rule.moved,
             rule.width, rule.first, rule.clocks, rate, rule.lut, int(k in best)]
        )  # fmt: skip
    return [
        Text(_rule_verdict(listed)),
        Picture(
            "design-window-picture",
            _rule_picture(listed),
            "Error in noise above the bound: over the threshold's share of the height, for each "
            "factor of the noise (left); over clocks, windows as wide as the rule makes them "
            "(middle); over how far a skewed spot moves with its height (right). Lines in the last "
            "two are the fronts, the star is the configuration's rule, the diamond two passes.",
        ),
        Table(
            "design-window",
            ["rule", "with noise,\nover CRB", "\nworst spot", "lost,\nworst",
             "false rivals,\nworst", "skewed spot\nmoves, 1e-3 px", "window,\npx",
             "\nclocks", "\nlines/s", "\nLUT", "\nfront"],
            rows,
            "Threshold = background + max(k_noise noise, k_height height). Registers hold the two "
            "factors, so they cost no cells; a wider window costs clocks. Means over the 20 spots "
            f"of the study, which are symmetric. What k_height is there for: a spot of "
            f"{design.SKEW_PX:g} px and skew {design.SKEW:g} moves by so much as its height goes "
            f"from {100 * design.SKEW_HEIGHTS[0]:g} to {100 * design.SKEW_HEIGHTS[-1]:g} % of full "
            "scale. What k_noise is there for: below, noise is taken for rivals.",
            ["window", "k_noise", "k_height", "noise_over_bound", "worst_over_bound", "lost",
             "false_rivals", "skew_moved_px", "width_px", "first_width_px", "clocks", "lines_per_s",
             "lut", "front"],
            values,
        ),
    ]  # fmt: skip


def _rule_verdict(listed: Sequence[Rule]) -> str:
    shipped = listed[0]
    single = [rule for rule in listed if not rule.two_pass]

    def told(rule: Rule) -> str:
        return (
            f"errs {rule.noisy:.3f} times the bound in {rule.clocks} clocks, moves a skewed spot "
            f"by {number(1e3 * rule.moved, 2)}e-3 px and flags rivals that are not there on up to "
            f"{100 * rule.rival:.2g} % of the lines"
        )

    text = f"The configuration's rule, {shipped.title}, {told(shipped)}. "
    for price, name in ((_clocks, "clocks"), (_movement, "movement")):
        better = [
            r
            for r in single
            if price(r) <= price(shipped)
            and r.noisy <= shipped.noisy
            and (price(r), r.noisy) != (price(shipped), shipped.noisy)
        ]
        least = min(better, key=lambda rule: rule.noisy, default=None)
        if least is None:
            text += f"Of one pass it is on the front of error against {name}. "
        else:
            text += f"Of one pass it is <b>not</b> on the front of error against {name}: "
            text += f"{least.title} {told(least)}. "
    best = min(single, key=lambda rule: rule.noisy)
    if best is not shipped:
        text += f"Least error of one pass: {best.title} {told(best)}. "
    for rule in listed:
        if rule.two_pass:
            text += f"With two passes the detector {told(rule)}, and has "
            text += f"{rule.lut - shipped.lut:,} LUT more."
    return text


def _clocks(rule: Rule) -> float:
    return float(rule.clocks)


def _movement(rule: Rule) -> float:
    return 1e3 * rule.moved


def _over(rule: Rule) -> float:
    """Return by how much the error exceeds the bound, %, at least the least value of a picture."""
    return max(100.0 * (rule.noisy - 1.0), 0.1)


def _rule_picture(listed: Sequence[Rule]) -> bytes:
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(11.6, 4.0), layout="constrained")
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
        _plain_log(others[0], "x", (200, 300, 400, 500, 600, 700))
        _plain_log(others[1], "x", _LEVELS)
        left.set_xlabel("k_height, share of the peak's height")
        others[0].set_xlabel("clocks from the last pixel to the position")
        others[1].set_xlabel("movement of a skewed spot, 1e-3 px")
        left.set_yscale("log")
        _plain_log(left, "y", _LEVELS)
        left.set_ylabel("rms in noise above the Cramér-Rao bound, %")
        for axes, title in zip(
            (left, *others),
            ("Rule of the window", "Error over clocks", "Error over movement"),
            strict=True,
        ):
            axes.grid(color=LIGHT, linewidth=0.5)
            axes.set_axisbelow(True)
            axes.set_title(title)
        left.legend()
        return png(figure)


def _places(listed: Sequence[Rule]) -> tuple[list[float], list[float]]:
    """Return clocks and movement in 1e-3 px for each rule."""
    return [_clocks(r) for r in listed], [_movement(r) for r in listed]


SECTION = Section("design", "The design space", cells, blocks)
