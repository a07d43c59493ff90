"""The picture to choose by: error on speckled scenes over line rate, on a board and on a PC."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from vrscan.data.arrays import Bools, Floats
from vrscan.data.boards import SHIPPED
from vrscan.data.config import Clock, Config
from vrscan.data.lines import Lines
from vrscan.data.residuals import rms
from vrscan.detectors.catalogue import Detector, detector
from vrscan.engines.engine import Engine, run
from vrscan.fixed import vrscan_chain as chain
from vrscan.ideal.geometry import triangle, undistorted
from vrscan.ideal.statistics import statistics
from vrscan.scene.simulate import take
from vrscan.show.sheet import Column, Sheet, number, rewrite, words
from vrscan.show.style import DECADES, drawing, plain_log
from vrscan.study.bench import cost, instrument
from vrscan.study.bench.bench_page import Block, Picture, Table, Text
from vrscan.study.bench.cells import Cell, Figures, configuration
from vrscan.study.bench.sections.section import KEYS, Found, Order, Section, is_own, look, png

WORK = "vrscan.study.bench.sections.choice_section:ways"
SCENES = ("default", "far", "corner")
LINES, QUICK_LINES = 3000, 300  # of each scene
PC = ("centroid-height", "gaussian-3", "blais-rioux-8", "matched", "likelihood")
MODULES: dict[str, tuple[str, ...]] = {
    "threshold": (
        *("line_statistics", "peak_isolate", "phase_correlate"),
        *("peak_position", "peak_confidence"),
    )
}
MODULES["two_pass"] = (*MODULES["threshold"], "peak_refine")
MODULES["fit"] = (*MODULES["two_pass"], "peak_fit", "peak_neighbours")
TITLES = {"threshold": "one window", "two_pass": "two passes", "fit": "fit and neighbours"}


def _pc(each: Detector, lines: Lines, config: Config) -> Floats:
    """Return z of each line in mm as a PC has it: background, position, triangle."""
    row = statistics(lines.lines, max_window=instrument.MAX_WINDOW)
    place = each.locate(lines.lines, row.background, row.noise, config)
    u, _ = undistorted(place, config.geometry)
    located = triangle(u, lines.angle_rad, config.geometry)
    return np.where(np.isfinite(place) & ~located.no_range, located.z, np.nan)


def _mean(values: Sequence[float]) -> float:
    """Return the geometric mean, in which a far scene counts as much as a near one."""
    return float(np.exp(np.mean(np.log(values))))


def ways(parameters: dict[str, Any], seed: int) -> Figures:
    """Return the error of every way to a point, and the lines/s of those of a PC, a timed work.

    Each way has the same lines: those of the scenes, rendered in full, of which the shipped mode
    says nothing against the point. A line on which another way finds nothing, or is more than a
    tenth of z off, is lost to it and not in its error.

    Args:
        parameters: ``config`` and ``lines`` of each scene.
        seed: Not used: the scenes have their own.

    Returns:
        ``errors``, by name of the window or the detector ``rms_mm`` and ``median_mm``, geometric
        means of the scenes, and ``lost``; ``rates`` of the detectors on one core; ``lines`` that
        were compared.
    """
    config, count = configuration(parameters), int(parameters["lines"])
    scanned = [take(name, count, config, "full").lines for name in SCENES]
    errors: dict[str, list[Floats]] = {}
    clear: list[Bools] = []
    for lines in scanned:
        truth = lines.truth
        assert truth is not None  # a simulation has a truth
        tables = {
            name: run(Engine.FIXED, lines, instrument.with_window(config, name)) for name in MODULES
        }
        fit = tables["fit"]
        kept = fit.clear & np.isfinite(truth.position_px)
        found = {name: np.where(each.located, each.z_mm, np.nan) for name, each in tables.items()}
        found |= {key: _pc(detector(key), lines, config) for key in PC}
        for name, z_mm in found.items():
            off = (z_mm - truth.z_mm)[kept]
            near = np.abs(off) < 0.1 * truth.z_mm[kept]  # false of what was not found
            errors.setdefault(name, []).append(np.where(near, off, np.nan))
        clear.append(kept)
    some = scanned[0]
    works: dict[str, Any] = {key: partial(_pc, detector(key), some, config) for key in PC}
    seconds = instrument.best(works)
    return {
        "lines": int(sum(kept.sum() for kept in clear)),
        "rates": {key: len(some) / seconds[key] for key in PC},
        "errors": {
            name: {
                "rms_mm": _mean([rms(off[np.isfinite(off)]) for off in scenes]),
                "median_mm": _mean([float(np.nanmedian(np.abs(off))) for off in scenes]),
                "lost": float(np.isnan(np.concatenate(scenes)).mean()),
            }
            for name, scenes in errors.items()
        },
    }


@dataclass(frozen=True)
class Way:
    """A way to a point: a mode of the instrument on a board, or a detector on a PC."""

    key: str  # of its detector
    title: str
    on_board: bool
    rms_mm: float
    median_mm: float
    lost: float
    lines_per_s: float
    latency_us: float | None = None
    lut: int | None = None


def _cell(order: Order) -> Cell:
    return order.cell(WORK, {"lines": order.size(LINES, QUICK_LINES)}, timed=True)


def latency_us(window: str, config: Config) -> float:
    """Return the time from a line's last pixel to its point on the board, at its own line rate."""
    clocks = chain.latency(
        chain.MAX_WINDOW,
        measured=True,
        line_length=config.sensor.line_length,
        pixel_width=config.sensor.pixel_width,
        first_width=None if window == "threshold" else chain.MAX_WINDOW,
        fit=window == "fit",
    )
    waits = 1.0 / config.most_lines_hz if window == "fit" else 0.0  # for the next line
    return 1e6 * (clocks / config.clock.frequency_hz + waits)


def ranked(config: Config, found: Figures) -> list[Way]:
    """Return the modes of the instrument, then the detectors of a PC."""
    board = config.model_copy(update={"clock": Clock(frequency_hz=SHIPPED.clock_hz)})
    made = []
    for window, modules in MODULES.items():
        own, sizes = instrument.with_window(board, window), cost.cells_of(modules)
        made.append(
            Way(KEYS[window], f"{TITLES[window]}, {SHIPPED.title}", True, **found["errors"][window],
                lines_per_s=math.floor(own.most_lines_hz), latency_us=latency_us(window, own),
                lut=sizes and sizes[0])
        )  # fmt: skip
    return made + [
        Way(key, f"{detector(key).title}, PC", False, **found["errors"][key],
            lines_per_s=found["rates"][key])
        for key in PC
    ]  # fmt: skip


def sheet(made: Sequence[Way]) -> Sheet[Way]:
    """Return the table behind the picture."""
    return Sheet([
        words("way to a point", lambda way: way.title, name="way"),
        Column("rms, mm", lambda way: way.rms_mm, "{:.3f}", name="rms_mm"),
        Column("median, mm", lambda way: way.median_mm, "{:.3f}", name="median_mm"),
        Column("lost", lambda way: way.lost, "{:.2f} %", scale=100.0, name="lost"),
        Column("lines/s", lambda way: way.lines_per_s, number, name="lines_per_s"),
        Column("latency, us", lambda way: way.latency_us, "{:.0f}", name="latency_us", absent="-"),
        Column("LUT", lambda way: way.lut, "{:,}", name="lut", absent="-"),
    ], made)  # fmt: skip


def picture(made: Sequence[Way]) -> bytes:
    """Return error over line rate: filled on the board, hollow on one core of a PC."""
    with drawing(10.4, 4.4) as figure:
        axes = figure.subplots()
        for way in made:
            how = look(way.key)
            label = f"{way.title}: {way.rms_mm:.2f} mm"
            if way.on_board:
                label += f", {way.latency_us:.0f} µs" + (f", {way.lut:,} LUT" if way.lut else "")
            fill = how.colour if way.on_board else "none"
            axes.plot(way.lines_per_s, way.rms_mm, how.marker, color=how.colour, label=label,
                      markersize=13 if way.on_board else 9, markerfacecolor=fill)  # fmt: skip
        axes.set(xscale="log", yscale="log", xlabel="lines/s", ylabel="rms error of z, mm")
        axes.margins(x=0.15, y=0.15)
        plain_log(axes, "x", DECADES, "{:,.0f}")
        plain_log(axes, "y", (0.1, *(0.05 * k for k in range(3, 20)), 1.0, 1.5, 2.0, 3.0, 5.0))
        axes.set_title("Filled: on the board. Hollow: in Python on one core")
        figure.legend(loc="outside right center", fontsize=8)
        return png(figure)


def blocks(order: Order, found: Found) -> Sequence[Block[Any]]:
    """Return the picture and its table."""
    figures = found(_cell(order))
    made = ranked(order.config, figures)
    return [
        Text(
            f"Every way has the same {figures['lines']:,} lines of the scenes {', '.join(SCENES)}, "
            "rendered in full, with speckle, and with no flag of the shipped mode. A mode of the "
            f"board has the line rate that its clock, {1e-6 * SHIPPED.clock_hz:.2f} MHz, allows "
            "for the sensor's pixels, the latency from a line's last pixel to its point, and the "
            f"LUT of its detector from {cost.TIMING}. A PC's detector is numpy on one core, from "
            "pixels to z, without the camera's transfer; compiled code is faster, not better."
        ),
        Picture("choice-picture", picture(made), "Down and right is better."),
        Table("choice", sheet(made),
              "Geometric means of the scenes. Lost: no point, or a tenth of z off.",
              key=lambda way: f"choice-{way.title.replace(' ', '-')}",
              bold=lambda way: is_own(way.key, order.config)),
    ]  # fmt: skip


def pages(root: Path) -> tuple[Path, Path]:
    """Return the files that ``write`` makes: the picture of the README, and docs/numbers.md."""
    return root / "docs" / "choice.png", root / "docs" / "numbers.md"


def write(config: Config, figures: Figures, root: Path) -> list[Path]:
    """Write the picture, and its table into docs/numbers.md; return the files."""
    made = ranked(config, figures)
    drawn, page = pages(root)
    drawn.write_bytes(picture(made))
    return [drawn, *([page] if rewrite(page, {"choice": sheet(made).markdown()}) else [])]


SECTION = Section("choice", "Which way to a point", lambda order: [_cell(order)], blocks)
