"""Measured lines of a printed staircase through the chain: valid share, heights by caliper.

The data are lines of a laser stripe in pairs: even index the empty bed, odd index the staircase, at
one camera row. With p the shift between the two in px, the height is h = D p / (e + p). D and e are
fitted to the medians of all levels, the bed's own 0 mm among them.

A line has a usable spot where its maximum is at least 5 % of full scale above the line's median:
the dimmest spot for which the shipped thresholds are stated. Darker lines are where the staircase
hides the stripe from the camera; what the chain says of them is counted and shown too.

A surface's stripe is smooth along a picture, so what positions have beside a parabola over its rows
is the detector's scatter.
"""

import argparse
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.progress import Progress
from scipy.optimize import least_squares

from vrscan.data import config as configuration
from vrscan.data import line_files
from vrscan.data.arrays import Bools, Floats, Ints, Pixels
from vrscan.data.errors import InputError
from vrscan.data.table import Table
from vrscan.engines import engine as engines
from vrscan.engines.engine import Engine
from vrscan.show.sheet import Column, Sheet
from vrscan.study.report.efficiency import with_window

USABLE_SHARE = 0.05  # of full scale, maximum above median
GOAL_VALID = 0.95
GOAL_MM = 0.3
WINDOWS = "fit", "two_pass", "threshold"
FEWEST_ROWS = 8  # of a surface in a picture


@dataclass(frozen=True)
class Level:
    """One height of the staircase."""

    height_mm: float  # the caliper's
    pairs: int  # of lines on it
    used: int  # of those, with two valid points
    shift_px: float  # their median
    spread_px: float  # half the distance of the 16th and 84th percentile
    fitted_mm: float

    @property
    def residual_mm(self) -> float:
        """Fitted minus caliper."""
        return self.fitted_mm - self.height_mm


@dataclass(frozen=True)
class Outcome:
    """What the experiment found."""

    usable: int
    usable_valid: int
    dark: int
    dark_valid: int
    levels: list[Level]
    scale_mm: float  # D
    distance_px: float  # e

    @property
    def lines(self) -> int:
        """All lines."""
        return self.usable + self.dark

    @property
    def good(self) -> bool:
        """Whether both figures are reached."""
        enough = self.usable_valid >= GOAL_VALID * self.usable
        return enough and all(abs(level.residual_mm) <= GOAL_MM for level in self.levels)


def usable_spots(pixels: Pixels, full_scale: int) -> Bools:
    """Return which lines have a spot [n]: maximum above median by ``USABLE_SHARE``."""
    rise = pixels.max(axis=1).astype(np.float64) - np.median(pixels, axis=1)
    return np.asarray(rise >= USABLE_SHARE * full_scale)


def evaluate(result: Table, usable: Bools, height_mm: Floats) -> Outcome:
    """Return share and heights.

    Args:
        result: Points of n lines; even rows the bed, odd rows the staircase.
        usable: Which lines have a usable spot [n].
        height_mm: Caliper height of each line's surface, NaN where unknown [n].
    """
    shift = result.position_px[0::2] - result.position_px[1::2]
    both = result.measured[0::2] & result.measured[1::2]
    height = np.round(height_mm[1::2].astype(np.float64), 3)
    known = np.unique(height[np.isfinite(height)])
    groups = [both & (height == value) for value in known]
    medians = np.array([np.median(shift[group]) for group in groups])

    def model(parameters: Floats) -> Floats:
        return np.asarray(parameters[0] * medians / (parameters[1] + medians))

    slope = known[-1] / medians[-1]  # start from h = slope p, which a far e tends to
    fit = least_squares(lambda v: model(v) - known, x0=(slope * 1000.0, 1000.0), x_scale="jac")
    fitted = model(fit.x)
    levels = [
        Level(
            height_mm=float(value),
            pairs=int((height == value).sum()),
            used=int(group.sum()),
            shift_px=float(median),
            spread_px=float(np.diff(np.percentile(shift[group], [16.0, 84.0]))[0]) / 2.0,
            fitted_mm=float(found),
        )
        for value, group, median, found in zip(known, groups, medians, fitted, strict=True)
    ]
    return Outcome(
        usable=int(usable.sum()),
        usable_valid=int((usable & result.measured).sum()),
        dark=int((~usable).sum()),
        dark_valid=int((~usable & result.measured).sum()),
        levels=levels,
        scale_mm=float(fit.x[0]),
        distance_px=float(fit.x[1]),
    )


def scatter(result: Table, rows: Floats, surface: Ints, some: Bools) -> float:
    """Return half the distance of the 16th and 84th percentile of positions beside parabolas, px.

    Args:
        result: Points of n lines.
        rows: Row of the picture of each line, and its offset on the line, px [2, n].
        surface: Number of the surface of a picture that each line hits [n].
        some: Lines that count [n].
    """
    row, offset = rows
    beside = []
    for number in range(surface.max() + 1):
        lines = np.flatnonzero(some & (surface == number))
        if len(lines) < FEWEST_ROWS:
            continue
        place, across = result.position_px[lines] - offset[lines], row[lines]
        kept = np.full(len(lines), True)
        for _ in range(3):
            parabola = np.polynomial.Polynomial.fit(across[kept], place[kept], 2)
            rest = place - parabola(across)
            kept = np.abs(rest) <= 4.5 * np.median(np.abs(rest[kept])) + 1e-9
        beside.append(rest)
    return float(np.diff(np.percentile(np.concatenate(beside), [16.0, 84.0]))[0]) / 2.0


def scatters(path: Path, engine: Engine) -> dict[str, tuple[float, float]]:
    """Return the scatter of each window's positions, of clear and of saturated lines, px."""
    config = configuration.load(None)
    recording = line_files.read(path, config)
    with np.load(path) as arrays:
        rows = np.stack([arrays["row"], arrays["offset"]]).astype(np.float64)
        height, frame, scan = (arrays[name] for name in ("height_mm", "frame", "scan"))
    known = np.isfinite(height)
    keys = np.stack([scan == "bed", frame, np.round(100 * np.where(known, height, 0))], axis=1)
    surface = np.unique(keys, axis=0, return_inverse=True)[1].reshape(-1)
    found = {
        window: engines.run(engine, recording, with_window(config, window)) for window in WINDOWS
    }
    good = np.all([each.measured for each in found.values()], axis=0) & known
    full = found[WINDOWS[0]].flags["SATURATED"]
    return {
        window: (
            scatter(each, rows, surface, good & ~full),
            scatter(each, rows, surface, good & full),
        )
        for window, each in found.items()
    }


def experiment(path: Path, engine: Engine, config_path: Path | None = None) -> Outcome:
    """Run the lines of ``path`` through an engine and evaluate them.

    Raises:
        InputError: if the file is not the staircase's.
    """
    config = configuration.load(config_path)
    recording = line_files.read(path, config)
    with np.load(path) as arrays:
        if "height_mm" not in arrays.files:
            raise InputError(f"{path}: no array named height_mm")
        height = arrays["height_mm"]
    if height.shape != (len(recording),) or len(recording) % 2:
        raise InputError(f"{path}: height_mm must be one for each of pairs of lines {height.shape}")
    with Progress(console=Console(stderr=True)) as progress:
        task = progress.add_task(f"engine {engine}", total=len(recording))
        result = engines.run(
            engine, recording, config, lambda done: progress.update(task, completed=done)
        )
    full_scale = 2**config.sensor.pixel_width - 1
    return evaluate(result, usable_spots(recording.lines, full_scale), height)


def show(outcome: Outcome, engine: Engine, console: Console) -> None:
    """Print the outcome."""
    share = 100.0 * outcome.usable_valid / outcome.usable
    console.print(
        f"engine {engine}: {outcome.usable_valid} of {outcome.usable} lines with a usable spot are "
        f"valid, {share:.1f} % (at least {100 * GOAL_VALID:.0f} %)"
    )
    console.print(
        f"{outcome.dark_valid} of {outcome.dark} lines without one have a point as well: "
        f"{100.0 * (outcome.usable_valid + outcome.dark_valid) / outcome.lines:.1f} % of all"
    )
    columns: list[Column[Level]] = [
        Column("caliper", lambda level: level.height_mm, "{:.2f}", unit="mm"),
        Column("pairs", lambda level: level.pairs),
        Column("used", lambda level: level.used),
        Column("median p", lambda level: level.shift_px, "{:.3f}", unit="px"),
        Column("spread", lambda level: level.spread_px, "{:.3f}", unit="px"),
        Column("h", lambda level: level.fitted_mm, "{:.3f}", unit="mm"),
        Column("residual", lambda level: level.residual_mm, "{:+.3f}", unit="mm"),
    ]
    caption = (
        f"h = D p / (e + p), D = {outcome.scale_mm:.2f} mm, e = {outcome.distance_px:.1f} px; "
        f"residuals at most {GOAL_MM} mm"
    )
    console.print(Sheet(columns, outcome.levels).terminal(caption=caption))


def main() -> int:
    """Run the experiment; exit status 1 if a figure is not reached, 2 for bad input."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("data", type=Path, help="stairs.npz")
    parser.add_argument("--engine", type=Engine, choices=list(Engine), default=Engine.RTL)
    parser.add_argument("--config", type=Path)
    arguments = parser.parse_args()
    try:
        outcome = experiment(arguments.data, arguments.engine, arguments.config)
    except InputError as error:
        print(f"stairs: {error}", file=sys.stderr)
        return 2
    console = Console(width=None if sys.stdout.isatty() else 120)
    show(outcome, arguments.engine, console)
    for window, (clear, full) in scatters(arguments.data, arguments.engine).items():
        console.print(f"{window}: scatter {clear:.3f} px, of saturated lines {full:.3f} px")
    return 0 if outcome.good else 1


if __name__ == "__main__":
    sys.exit(main())
