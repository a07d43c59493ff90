"""Growth of each part's time with its work: length of a line, and number of lines."""

from collections.abc import Sequence
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from vrscan.data.config import Config
from vrscan.show.style import COLOURS, INK, LIGHT, STYLE
from vrscan.study.bench import instrument
from vrscan.study.bench.bench_page import Block, Picture, Row, Table, Text, number
from vrscan.study.bench.cells import Cell, Figures, plain
from vrscan.study.bench.sections.section import Found, Order, Section, png

COUNTS, QUICK_COUNTS = (64, 256, 1024, 4096, 16384), (64, 256, 1024)
LENGTHS, QUICK_LENGTHS = (512, 1024, 2048, 4096), (1024, 2048, 4096)
RTL_COUNTS = (64, 256, 1024)
RTL_LENGTHS = (1024, 4096)  # besides the configuration's own; each has to be built once
LINES = 1024  # number of lines where the length changes
_RTL_LINES = 256

NAMES = {
    "reference": "statistics in numpy",
    "simulator": "simulator, full",
    "fixed": "bit-accurate model",
    "ideal": "float64 equations",
    "rtl": "RTL, simulated",
}
_COLOURS = dict(zip(NAMES, (INK, *COLOURS), strict=False))
_MARKS = dict(zip(NAMES, "osD^v", strict=True))


def _cell(order: Order, sizes: Sequence[tuple[int, int]], rtl: Sequence[tuple[int, int]]) -> Cell:
    parameters: dict[str, Any] = {"config": plain(order.config)}
    parameters |= {"sizes": [list(size) for size in sizes], "rtl": [list(size) for size in rtl]}
    return Cell(instrument.GROWTH, parameters, 0, timed=True)


def _by_count(order: Order) -> Cell:
    length = order.config.sensor.line_length
    counts, rtl = (QUICK_COUNTS, ()) if order.quick else (COUNTS, RTL_COUNTS)
    return _cell(order, [(length, count) for count in counts], [(length, c) for c in rtl])


def _by_length(order: Order) -> Cell:
    own = order.config.sensor.line_length
    lengths = QUICK_LENGTHS if order.quick else LENGTHS
    rtl = () if order.quick else sorted({*RTL_LENGTHS, own})
    return _cell(order, [(n, LINES) for n in lengths], [(n, _RTL_LINES) for n in rtl])


def cells(order: Order) -> list[Cell]:
    """Return the two series."""
    return [_by_count(order), _by_length(order)]


def exponent(sizes: Sequence[float], seconds: Sequence[float]) -> float:
    """Return p of the power law seconds = c size^p that fits best in logarithms."""
    if len(sizes) < 2:
        return float("nan")
    return float(np.polyfit(np.log(sizes), np.log(seconds), 1)[0])


def _series(figures: Figures, column: int) -> dict[str, list[tuple[int, int, float]]]:
    """Return rows of size, lines and s for each part, by rising size."""
    found: dict[str, list[tuple[int, int, float]]] = {}
    for row in figures["seconds"]:
        found.setdefault(row[0], []).append((row[column], row[2], row[3]))
    return {name: sorted(found[name]) for name in NAMES if name in found}


def blocks(order: Order, found: Found) -> Sequence[Block]:
    """Return the picture and the table of exponents."""
    counts = _series(found(_by_count(order)), 2)
    lengths = _series(found(_by_length(order)), 1)
    rows: list[Row] = []
    values: list[list[Any]] = []
    for what, series in (("lines", counts), ("length", lengths)):
        unit = "number of lines" if what == "lines" else "length of a line"
        for name, points in series.items():
            sizes, seconds = [p[0] for p in points], [p[2] for p in points]
            per = [1e6 * s / lines for _, lines, s in points]
            power = exponent(sizes, seconds)
            rows.append(
                Row(
                    f"growth-{name}-{what}",
                    [
                        f"{NAMES[name]}, {unit}",
                        f"{sizes[0]} .. {sizes[-1]}",
                        f"{power:.2f}",
                        number(per[0]),
                        number(per[-1]),
                        number(1e6 / per[0]),
                        number(1e6 / per[-1]),
                    ],
                )
            )
            values += [[name, what, *point] for point in points]
    clocks = _clocks(order.config)
    return [
        Text(
            "Time = c · size<sup>p</sup>, p fitted over the sizes measured. With the number of "
            "lines p is 1 where each line costs the same and below where starting costs more; "
            "with their length p is 1 where every pixel costs the same, and below where the work "
            "is at the peak. The simulator makes blocks of 1024 lines as a whole, whose random "
            f"numbers belong together: fewer lines cost as much. The hardware takes {clocks}."
        ),
        Picture(
            "growth-picture",
            _picture(counts, lengths, order.config),
            "Time of a line over how many there are (left) and over their length (right), one "
            "core. Level on the left: twice the lines take twice the time. Rising with slope 1 on "
            "the right (dashed): twice the pixels take twice the time.",
        ),
        Table(
            "growth",
            [
                "part, size",
                "sizes",
                "exponent\np",
                "µs a line,\nsmallest",
                "\nlargest",
                "lines/s,\nsmallest",
                "\nlargest",
            ],
            rows,
            f"Lines of the default scene; {order.config.sensor.line_length} px where their number "
            f"changes, {LINES} of them ({_RTL_LINES} in the RTL) where their length does. "
            "Processor time, best of two rounds.",
            ["part", "changes", "size", "lines", "seconds"],
            values,
        ),
    ]


def _clocks(config: Config) -> str:
    length = config.sensor.line_length
    return f"one clock a pixel, {length} for a line of {length}: p is 1 in both, by construction"


def _picture(
    counts: dict[str, list[tuple[int, int, float]]],
    lengths: dict[str, list[tuple[int, int, float]]],
    config: Config,
) -> bytes:
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(11.0, 3.9), layout="constrained")
        left, right = figure.subplots(1, 2, sharey=True)
        for axes, series, words in (
            (left, counts, f"number of lines of {config.sensor.line_length} px"),
            (right, lengths, "length of a line, px"),
        ):
            axes.grid(color=LIGHT, linewidth=0.5)
            axes.set_axisbelow(True)
            sizes: set[int] = set()
            for name, points in series.items():
                size = [p[0] for p in points]
                sizes |= set(size)
                per = [1e6 * s / lines for _, lines, s in points]
                label = NAMES[name]
                axes.plot(size, per, _MARKS[name] + "-", color=_COLOURS[name], label=label)
            axes.set_xscale("log", base=2)
            axes.set_yscale("log")
            axes.set_xticks(sorted(sizes), [str(size) for size in sorted(sizes)])
            axes.minorticks_off()
            axes.set_xlabel(words)
        if "fixed" in lengths:
            ends = np.array([p[0] for p in lengths["fixed"]], float)
            middle = lengths["fixed"][len(ends) // 2]
            line = 1e6 * middle[2] / middle[1] * ends / middle[0]
            right.plot(ends, line, "--", color=INK, linewidth=0.9, label="as the pixels")
        left.set_ylabel("µs a line")
        handles, labels = right.get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside right center", fontsize=8)
        return png(figure)


SECTION = Section("growth", "How each grows with its work", cells, blocks)
