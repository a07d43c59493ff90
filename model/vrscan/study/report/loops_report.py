"""What the loops of laser and lens gain: the error on planes, with each of them and without."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import numpy as np
from rich.table import Table as RichTable

from vrscan.data.config import Config
from vrscan.data.lines import joined
from vrscan.data.points import atomic_file
from vrscan.engines.engine import BLOCK, Engine, run
from vrscan.engines.loops import LoopedScan
from vrscan.ideal.correction_map import with_moving_lens
from vrscan.scene.description import parse
from vrscan.scene.effects import present
from vrscan.scene.lens_motion import focus_of
from vrscan.scene.light import Light
from vrscan.scene.simulate import Scanner
from vrscan.show.sheet import Column, Sheet
from vrscan.show.style import COLOURS, drawing, plain_log
from vrscan.study.progress import Progress, for_each

PLANES_MM = (250.0, 300.0, 420.0, 600.0, 800.0, 1000.0)
BLOCKS = 6  # of a scan; the loops have settled in the last ones
MEASURED = 3  # blocks at the end that are measured
POWER_MW, FOCUS_MM = 7.0, 420.0  # without the loops: peaks of half of full scale at 400 mm
MISS = 1.02  # depth in focus at the start, over the plane's
REFLECTANCES = (0.8, 0.1)  # bright and dark
FOCUS = {"average_points": 256, "hold_points": 256}  # so that a short scan is enough
_WAYS = ((False, False), (True, False), (False, True), (True, True))  # power, focus
NAMES = ("constant, fixed", "adaptive, fixed", "constant, automatic", "adaptive, automatic")


@dataclass(frozen=True)
class Row:
    """The points of a plane with the loops or without."""

    reflectance: float
    z_mm: float
    way: int  # index into ``NAMES``: power, focus
    power_mw: float  # median power of the lines with a spot that the camera sees
    peak: float  # median height of their peaks over full scale
    focus_mm: float  # depth in focus at the end
    points: float  # share of the lines with a spot that the camera sees
    saturated: float  # share of the points
    rms_percent: float  # rms error in z over z, of points with a spot
    ratio: float  # rms of error over predicted sigma


@dataclass(frozen=True)
class _Work:
    """The work of a process: a plane, one way."""

    config: Config

    def __call__(self, given: tuple[float, float, int]) -> Row:
        reflectance, z_mm, way = given
        adaptive, automatic = _WAYS[way]
        values: dict[str, object] = {
            "target": [{"kind": "plane", "position_mm": [0.0, 0.0, z_mm]}],
            "material": {"default": {"reflectance": reflectance}},
            "lens": {"focus_mm": z_mm * MISS if automatic else FOCUS_MM},
            "laser": {"power_mw": POWER_MW},
            "seed": round(z_mm),
        }
        config = self.config
        if automatic:
            config = with_moving_lens(config)
            focus = config.focus.model_copy(update=FOCUS)
            config = config.model_copy(update={"focus": focus})
        scene = parse(values, f"plane at {z_mm:g} mm", Path())
        scanner = Scanner(Light(scene, config), BLOCKS * BLOCK, frozenset(present(scene)))
        scan = LoopedScan(scanner, adaptive=adaptive, automatic=automatic)
        blocks = list(scan.blocks())[-MEASURED - 1 :]
        lines = joined([each.simulation.lines for each in blocks])
        last = slice(len(blocks[0].simulation.lines), None)  # the first block is before the points
        points = run(Engine.FIXED, lines, config)
        truth = lines.truth
        assert truth is not None  # a simulation has a truth
        behind = np.arange(len(lines)) >= (last.start or 0)
        seen = behind & np.isfinite(truth.position_px)
        good = seen & points.located
        error = points.z_mm[good] - truth.z_mm[good]
        full = float(2**config.sensor.pixel_width - 1)
        height = (points.maximum[good] - points.background[good]) / full
        per_mw = config.laser.rated_mw / config.laser.power_max
        place = int(blocks[-1].controls.lens[-1])
        count = max(int(good.sum()), 1)
        nothing = math.nan if not good.any() else 0.0  # added to what has no value without points
        saturated = points.flags["SATURATED"][good].sum() / count
        return Row(
            reflectance=reflectance,
            z_mm=z_mm,
            way=way,
            power_mw=per_mw * float(np.median(lines.power[seen])),
            peak=float(np.median(height)) if len(height) else math.nan,
            focus_mm=focus_of(place, config),
            points=float(good.sum() / max(seen.sum(), 1)),
            saturated=nothing + float(saturated),
            rms_percent=nothing + 100.0 * math.sqrt(np.square(error / z_mm).sum() / count),
            ratio=nothing + math.sqrt(np.square(error / points.sigma_z_mm[good]).sum() / count),
        )


def measure(config: Config, jobs: int, progress: Progress | None = None) -> list[Row]:
    """Return the rows of all planes, by reflectance, distance and way.

    Args:
        config: The instrument.
        jobs: Number of processes.
        progress: Called with the number of rows done so far.
    """
    cells = [(r, z, way) for r in REFLECTANCES for z in PLANES_MM for way in range(len(NAMES))]
    return for_each(_Work(config), cells, progress, jobs)


COUNT = len(REFLECTANCES) * len(PLANES_MM) * len(NAMES)  # rows


def sheet(rows: list[Row]) -> Sheet[Row]:
    """Return the table of all rows."""
    columns: list[Column[Row]] = [
        Column("reflectance", lambda k: k.reflectance, "{:g}", name="reflectance"),
        Column("z, mm", lambda k: k.z_mm, "{:g}", name="z_mm"),
        Column("power, focus", lambda k: NAMES[k.way], "{}", name="way", align="left"),
        Column("power, mW", lambda k: k.power_mw, "{:.2f}", name="power_mw"),
        Column("peak / full scale", lambda k: k.peak, "{:.3f}", name="peak"),
        Column("in focus, mm", lambda k: k.focus_mm, "{:.0f}", name="focus_mm"),
        Column("with a point", lambda k: k.points, "{:.1%}", name="points"),
        Column("saturated", lambda k: k.saturated, "{:.1%}", name="saturated"),
        Column("rms, % of z", lambda k: k.rms_percent, "{:.4f}", name="rms_percent"),
        Column("error/sigma", lambda k: k.ratio, "{:.2f}", name="ratio"),
    ]
    return Sheet(columns, rows)


def table(rows: list[Row]) -> RichTable:
    """Return the table for the terminal."""
    return sheet(rows).terminal("planes, with the loops of laser and lens and without")


def picture(rows: list[Row], file: BinaryIO) -> None:
    """Draw the error over the distance, one panel for each reflectance, as PNG."""
    with drawing(8.0, 3.7) as figure:
        panels = figure.subplots(1, len(REFLECTANCES), sharey=True)
        for axes, reflectance in zip(panels, REFLECTANCES, strict=True):
            for way, name in enumerate(NAMES):
                own = [row for row in rows if row.way == way and row.reflectance == reflectance]
                z, error = [row.z_mm for row in own], [row.rms_percent for row in own]
                axes.plot(z, error, color=COLOURS[way], marker="o", markersize=3, label=name)
            axes.set(xlabel="z, mm", yscale="log", title=f"Reflectance {reflectance:g}")
        plain_log(panels[0], "y", (0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0))
        panels[0].set(ylabel="rms error of single points, % of z")
        named = panels[0].get_legend_handles_labels()
        figure.legend(*named, loc="outside lower center", ncols=4, title="power, focus")
        figure.savefig(file, format="png", dpi=150)


def pages(root: Path) -> tuple[Path, Path]:
    """Return the page and the picture that ``write`` writes."""
    return root / "docs" / "loops.md", root / "docs" / "loops.png"


def write(rows: list[Row], root: Path) -> tuple[Path, Path]:
    """Write the table of docs/loops.md, between its marks, and the picture; return their paths."""
    page, drawn = pages(root)
    before, rest = page.read_text().split(_BEGIN)
    _, behind = rest.split(_END)
    with atomic_file(drawn) as file:
        picture(rows, file)
    with atomic_file(page) as file:
        text = f"{before}{_BEGIN}\n\n{sheet(rows).markdown()}\n\n{_END}{behind}"
        file.write(text.encode())
    return page, drawn


_BEGIN, _END = "<!-- loops: begin -->", "<!-- loops: end -->"
