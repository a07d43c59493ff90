"""A simulated scan against its truth: the table of errors and the picture."""

from dataclasses import dataclass
from typing import BinaryIO

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from rich.table import Table as RichTable

from vrscan.arrays import Bools, Floats
from vrscan.config import Config
from vrscan.ideal.peak import threshold
from vrscan.lines import Lines, Truth
from vrscan.report.style import COLOURS, INK, LIGHT, QUIET, STYLE
from vrscan.table import Table


@dataclass(frozen=True)
class Errors:
    """How far the points of one surface are from the truth, in z."""

    name: str
    lines: int  # with a spot that the camera sees
    points: int
    rms_mm: float
    max_mm: float
    rms_percent: float  # of the range
    max_percent: float
    ratio: float  # rms of error over predicted sigma: 1 where the prediction is right


def compare(result: Table, truth: Truth) -> list[Errors]:
    """Return the errors of each surface, and of all of them last."""
    seen = np.isfinite(truth.position_px)
    rows = [(name, truth.surface == index) for index, name in enumerate(truth.names)]
    rows.append(("all", np.ones(len(result), np.bool_)))
    return [_errors(name, where & seen, result, truth) for name, where in rows]


def stray(result: Table, truth: Truth) -> int:
    """Return how many points there are where the camera sees no spot."""
    return int((result.located & np.isnan(truth.position_px)).sum())


def _errors(name: str, where: Bools, result: Table, truth: Truth) -> Errors:
    good = where & result.located
    if not good.any():
        nothing = float("nan")
        return Errors(name, int(where.sum()), 0, *[nothing] * 5)
    error = np.abs(result.z_mm[good] - truth.z_mm[good])
    share = 100.0 * error / truth.z_mm[good]  # spot and point are on one ray: z as good as range
    ratio = error / result.sigma_z_mm[good]

    def rms(values: Floats) -> float:
        return float(np.sqrt(np.mean(np.square(values))))

    return Errors(
        name=name,
        lines=int(where.sum()),
        points=int(good.sum()),
        rms_mm=rms(error),
        max_mm=float(error.max()),
        rms_percent=rms(share),
        max_percent=float(share.max()),
        ratio=rms(ratio),
    )


def error_table(errors: list[Errors], title: str) -> RichTable:
    """Return the errors as a table for the terminal."""
    grid = RichTable(
        title=title,
        caption="error in z, in mm and in % of range; error/sigma is the rms of error over "
        "predicted sigma; a spot is a line whose spot the camera sees",
        title_justify="left",
        caption_justify="left",
    )
    grid.add_column("surface")
    headings = (
        "spots",
        "points",
        "valid",
        "rms mm",
        "max mm",
        "rms %",
        "max %",
        "error/sigma",
    )
    for heading in headings:
        grid.add_column(heading, justify="right")
    for index, row in enumerate(errors):
        grid.add_row(
            row.name,
            f"{row.lines}",
            f"{row.points}",
            f"{100.0 * row.points / row.lines:.1f} %" if row.lines else "-",
            f"{row.rms_mm:.4f}",
            f"{row.max_mm:.4f}",
            f"{row.rms_percent:.4f}",
            f"{row.max_percent:.4f}",
            f"{row.ratio:.3f}",
            end_section=index == len(errors) - 2,
        )
    return grid


def picture(recording: Lines, result: Table, config: Config, title: str, file: BinaryIO) -> None:
    """Draw profile with truth, error along the scan, and one raw line with its window.

    Args:
        recording: Lines with truth.
        result: Their points.
        config: What they were found with.
        title: One line on top.
        file: A binary file, written as PNG.
    """
    truth = recording.truth
    if truth is None:
        raise ValueError("picture: lines without truth")
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(10.0, 9.2), layout="constrained")  # no window system involved
        figure.suptitle(title, x=0.012, ha="left", fontsize=12, fontweight="bold", color=INK)
        grid = figure.add_gridspec(3, 1, height_ratios=(1.5, 1.0, 1.0))
        _draw_profile(figure.add_subplot(grid[0]), result, truth)
        _draw_error(figure.add_subplot(grid[1]), recording, result, truth)
        _draw_line(figure.add_subplot(grid[2]), recording, result, config, truth)
        for axes in figure.axes:
            axes.grid(color=LIGHT, linewidth=0.5)
            axes.set_axisbelow(True)
        figure.savefig(file, format="png", dpi=130)


def _draw_profile(axes: Axes, result: Table, truth: Truth) -> None:
    """Points over the true profile, which is broken where the surface jumps."""
    jump = np.flatnonzero(np.abs(np.diff(truth.z_mm)) > 5.0) + 1
    x, z = np.insert(truth.x_mm, jump, np.nan), np.insert(truth.z_mm, jump, np.nan)
    axes.plot(x, z, color=LIGHT, linewidth=5.0, solid_capstyle="round", label="truth", zorder=1)
    for index, name in enumerate(truth.names):
        rows = result.located & (truth.surface == index)
        axes.plot(
            result.x_mm[rows],
            result.z_mm[rows],
            ".",
            color=COLOURS[index % len(COLOURS)],
            markersize=2.0,
            label=f"{name}, {rows.sum()} points",
        )
    hidden = np.isnan(truth.position_px) & np.isfinite(truth.z_mm)
    if hidden.any():
        axes.plot(
            truth.x_mm[hidden],
            truth.z_mm[hidden],
            "x",
            color=QUIET,
            markersize=3.0,
            label=f"hidden from the camera, {hidden.sum()} lines",
        )
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_title("Profile")
    axes.set_xlabel("x in mm")
    axes.set_ylabel("z in mm")
    axes.legend(loc="lower left", markerscale=3.0)


def _draw_error(axes: Axes, recording: Lines, result: Table, truth: Truth) -> None:
    """Error in z along the scan within twice the predicted sigma."""
    good = result.located & np.isfinite(truth.position_px)
    angle = np.degrees(recording.angle_rad)
    error = np.where(good, 1e3 * (result.z_mm - truth.z_mm), np.nan)
    sigma = np.where(good, 1e3 * result.sigma_z_mm, np.nan)
    limit = 1.3 * float(np.nanpercentile(np.abs(error), 99.0)) if good.any() else 1.0
    axes.fill_between(
        angle,
        -2.0 * sigma,
        2.0 * sigma,
        color=LIGHT,
        linewidth=0,
        label="twice the predicted sigma",
    )
    for index in range(len(truth.names)):
        rows = truth.surface == index
        colour = COLOURS[index % len(COLOURS)]
        axes.plot(angle[rows], error[rows], ".", color=colour, markersize=2.0)
    beyond = np.abs(np.nan_to_num(error)) > limit
    if beyond.any():
        axes.plot(
            angle[beyond],
            np.sign(error[beyond]) * limit * 0.97,
            "d",
            color=INK,
            markersize=2.5,
            label=f"beyond the axis, {beyond.sum()} points",
        )
    axes.set_ylim(-limit, limit)
    axes.set_title("Error in z along the scan")
    axes.set_xlabel("scan angle in degrees")
    axes.set_ylabel("measured - true in µm")
    axes.legend(loc="lower right", bbox_to_anchor=(1.0, 0.98), ncols=2)


def _draw_line(axes: Axes, recording: Lines, result: Table, config: Config, truth: Truth) -> None:
    """One raw line around its window: the widest spot's, where the window shows best."""
    rows = np.flatnonzero(result.located & np.isfinite(truth.position_px))
    if len(rows) == 0:
        axes.set_title("No line with a point")
        return
    by_width = rows[np.argsort(result.width[rows], kind="stable")]
    row = int(by_width[round(0.95 * (len(by_width) - 1))])
    left, right = int(result.left[row]), int(result.right[row])
    reach = 2 * (right - left + 1)
    first = max(0, left - reach)
    last = min(recording.lines.shape[1], right + reach + 1)
    pixel = np.arange(first, last)
    level = threshold(
        result.background[row : row + 1],
        result.noise[row : row + 1],
        result.maximum[row : row + 1],
        k_noise=config.peak.k_noise,
        k_height=config.peak.k_height,
    )[0]
    axes.axvspan(
        left - 0.5,
        right + 0.5,
        color="#fbe9d7",
        linewidth=0,
        label=f"window, {right - left + 1} px",
    )
    axes.step(pixel, recording.lines[row, first:last], where="mid", color=COLOURS[0], linewidth=1)
    axes.axhline(level, color=COLOURS[1], linewidth=1, label=f"threshold, {level:.0f} counts")
    axes.axvline(
        result.position_px[row],
        color=INK,
        linewidth=1,
        linestyle="--",
        label=f"position, {result.position_px[row]:.3f} ± {result.sigma_px[row]:.3f} px"
        f" (true {truth.position_px[row]:.3f})",
    )
    axes.set_xlim(first, last - 1)
    axes.set_title(f"Line {row} with its window")
    axes.set_xlabel("pixel")
    axes.set_ylabel("counts")
    axes.legend(loc="upper right")
