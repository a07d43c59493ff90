"""Growth of each part's time with its work: length of a line, and number of lines."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from vrscan.data.config import Config
from vrscan.show.sheet import Column, Sheet, listed, number, words
from vrscan.show.style import COLOURS, DECADES, INK, drawing, plain_log
from vrscan.study.bench import instrument
from vrscan.study.bench.bench_page import Block, Picture, Table, Text
from vrscan.study.bench.cells import Cell, Figures
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
    given = {"sizes": [list(size) for size in sizes], "rtl": [list(size) for size in rtl]}
    return order.cell(instrument.GROWTH, given, seed=0, timed=True)


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


@dataclass(frozen=True)
class _Series:
    """How the time of one part grows: rows of size, lines and seconds, by rising size."""

    part: str
    what: str
    points: list[tuple[int, int, float]]

    @property
    def power(self) -> float:
        """The exponent."""
        return exponent([p[0] for p in self.points], [p[2] for p in self.points])

    def second(self, index: int) -> float:
        """Return the time of a line, s."""
        return self.points[index][2] / self.points[index][1]


def blocks(order: Order, found: Found) -> Sequence[Block[Any]]:
    """Return the picture and the table of exponents."""
    counts = _series(found(_by_count(order)), 2)
    lengths = _series(found(_by_length(order)), 1)
    units = {"lines": "number of lines", "length": "length of a line"}
    rows = [
        _Series(name, what, points)
        for what, series in (("lines", counts), ("length", lengths))
        for name, points in series.items()
    ]
    columns: list[Column[_Series]] = [
        words("part, size", lambda s: f"{NAMES[s.part]}, {units[s.what]}"),
        Column("sizes", lambda s: f"{s.points[0][0]} .. {s.points[-1][0]}"),
        Column("exponent\np", lambda s: s.power, "{:.2f}", absent="nan"),
        Column("µs a line,\nsmallest", lambda s: s.second(0), number, scale=1e6),
        Column("\nlargest", lambda s: s.second(-1), number, scale=1e6),
        Column("lines/s,\nsmallest", lambda s: 1.0 / s.second(0), number),
        Column("\nlargest", lambda s: 1.0 / s.second(-1), number),
    ]
    length = order.config.sensor.line_length
    return [
        Text(
            "Time = c · size^p, p fitted over the sizes measured: 1 where each line, or each "
            "pixel, costs the same, less where starting costs more or the work is at the peak. The "
            "simulator makes whole blocks of 1024 lines. The hardware takes one clock a pixel, "
            f"{length} for a line of {length}: p is 1 in both, by construction."
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
            Sheet(columns, rows),
            f"Lines of the default scene; {length} px where their number changes, {LINES} of them "
            f"({_RTL_LINES} in the RTL) where their length does. Processor time, best of two "
            "rounds.",
            key=lambda s: f"growth-{s.part}-{s.what}",
            full=listed(
                ("part", "changes", "size", "lines", "seconds"),
                [(s.part, s.what, *point) for s in rows for point in s.points],
            ),
        ),
    ]


def _picture(
    counts: dict[str, list[tuple[int, int, float]]],
    lengths: dict[str, list[tuple[int, int, float]]],
    config: Config,
) -> bytes:
    with drawing(11.0, 3.9) as figure:
        left, right = figure.subplots(1, 2, sharey=True)
        for axes, series, words in (
            (left, counts, f"number of lines of {config.sensor.line_length} px"),
            (right, lengths, "length of a line, px"),
        ):
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
        plain_log(left, "y", DECADES)
        left.set_ylabel("µs a line")
        handles, labels = right.get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside right center", fontsize=8)
        return png(figure)


SECTION = Section("growth", "How each grows with its work", cells, blocks)
