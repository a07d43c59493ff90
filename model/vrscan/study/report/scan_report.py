"""A simulated scan compared with its truth: the table of errors and the picture."""

from collections.abc import Callable
from typing import Any, BinaryIO

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from rich.table import Table as RichTable

from vrscan.data.arrays import Bools, Floats, Pixels
from vrscan.data.config import Config
from vrscan.data.lines import Lines, Truth
from vrscan.data.table import Table
from vrscan.ideal.chain import MAX_WINDOW
from vrscan.ideal.peak import cut
from vrscan.ideal.statistics import statistics
from vrscan.show.sheet import Column, Sheet, words
from vrscan.show.style import COLOURS, INK, LIGHT, QUIET, drawing
from vrscan.study.report.reliability_report import ASTRAY_PX
from vrscan.study.report.tally import Errors

_SHAPES = ((".", 2.0), ("x", 2.5), ("+", 3.0), ("^", 2.0))
_TRUTH: dict[str, Any] = {"color": LIGHT, "markersize": 5.0, "markeredgewidth": 0.0}
_WIDTH_POINTS = 650.0  # approximate width of a panel
_CONTEXT_PX = 100  # shown on either side of the brightest pixel where there is no window


def error_table(errors: list[Errors], title: str) -> RichTable:
    """Return the errors as a table for the terminal."""
    columns: list[Column[Errors]] = [
        words("surface", lambda e: e.name, wraps=True),
        Column("spots", lambda e: e.lines),
        Column("points", lambda e: e.points),
        Column("valid", lambda e: e.points / e.lines if e.lines else None, "{:.1f} %",
               scale=100, absent="-"),
        Column("astray", lambda e: e.astray),
        Column("mean", lambda e: e.mean_mm, "{:.4f}", unit="mm", absent="-"),
        Column("rms", lambda e: e.rms_mm, "{:.4f}", unit="mm", absent="-"),
        Column("max", lambda e: e.max_mm, "{:.4f}", unit="mm", absent="-"),
        Column("rms", lambda e: e.rms_percent, "{:.4f}", unit="%", absent="-"),
        Column("max", lambda e: e.max_percent, "{:.4f}", unit="%", absent="-"),
        Column("error/sigma", lambda e: e.ratio, "{:.3f}", absent="-"),
    ]  # fmt: skip
    return Sheet(columns, errors).terminal(
        title,
        "error in z, in mm and in % of range; error/sigma is the rms of error over predicted "
        "sigma, which knows of speckle only with a fit; a spot is a line whose spot the "
        f"camera sees; points astray are over {ASTRAY_PX:g} px off, on another spot, and in no "
        "error",
        apart=lambda row: row is errors[-1],
    )


def picture(
    recording: Lines,
    result: Table,
    config: Config,
    title: str,
    file: BinaryIO,
    *,
    y_mm: Floats | None = None,
    pixels: Callable[[int], Pixels] | None = None,
) -> None:
    """Draw profile with truth, error over the scan angle, and one raw line with its window.

    The lines may come in any order of angle, as from a mirror that swings to and fro, and any of
    them may be without spot or point. A scanner that moved gets a map of z over x and y instead of
    the profile.

    Args:
        recording: Lines with truth.
        result: Points of these lines.
        config: Configuration with which the points were computed.
        title: Title of the picture.
        file: A binary file, written as PNG.
        y_mm: Position of the scanner at each line [n]; None if it stood still.
        pixels: Function that returns the counts [length] of a line by its number, if the recording
            has no pixels.

    Raises:
        ValueError: if the lines have no truth.
    """
    truth = recording.truth
    if truth is None:
        raise ValueError("picture: lines without truth")
    panned = y_mm is not None and np.ptp(y_mm) > 0.0 if len(result) else False
    with drawing(10.0, 9.2, title) as figure:
        grid = figure.add_gridspec(3, 1, height_ratios=(1.5, 1.0, 1.0))
        if panned and y_mm is not None:
            _draw_map(figure.add_subplot(grid[0]), result, truth, y_mm)
        else:
            _draw_profile(figure.add_subplot(grid[0]), result, truth)
        _draw_error(figure.add_subplot(grid[1]), recording, result, truth)
        show = pixels or (lambda number: recording.lines[number])
        _draw_line(figure.add_subplot(grid[2]), show, result, config, truth)
        figure.savefig(file, format="png", dpi=130)


def _dots(index: int) -> dict[str, Any]:
    """Return the style of a surface's points: four colours, then the same in other shapes."""
    shape, size = _SHAPES[index // len(COLOURS) % len(_SHAPES)]
    return {
        "linestyle": "",
        "marker": shape,
        "markersize": size,
        "markeredgewidth": 0.7 if shape in "x+" else 0.0,
        "color": COLOURS[index % len(COLOURS)],
    }


def _near(values: Floats, true: Floats) -> Bools:
    """Return which values are near enough to be shown without shrinking the scene."""
    real = true[np.isfinite(true)]
    if not real.size:
        return np.ones(len(values), np.bool_)
    margin = max(0.3 * float(np.ptp(real)), 10.0)
    return np.asarray((values > real.min() - margin) & (values < real.max() + margin))


def _draw_profile(axes: Axes, result: Table, truth: Truth) -> None:
    """Draw points over the true profile; all of it in dots, as the lines come in any order."""
    seen = np.isfinite(truth.position_px)
    near = _near(result.x_mm, truth.x_mm) & _near(result.z_mm, truth.z_mm)
    axes.plot(truth.x_mm, truth.z_mm, "o", **_TRUTH, label="truth", zorder=1)
    for index, name in enumerate(truth.names):
        surface = truth.surface == index
        rows = result.located & surface & seen
        if surface.any():
            label = f"{name}, {_counted(rows, 'point')}"
            rows = rows & near
            axes.plot(result.x_mm[rows], result.z_mm[rows], **_dots(index), label=label)
    hidden = np.isfinite(truth.z_mm) & ~seen
    _draw_hidden(axes, truth.x_mm, truth.z_mm, hidden)
    _draw_stray(axes, result.x_mm, result.z_mm, result.located & ~seen, near)
    axes.set_aspect("equal", adjustable="datalim")
    axes.set(title="Profile", xlabel="x in mm", ylabel="z in mm")
    _legend(axes, columns=3, markerscale=3.0)


def _draw_map(axes: Axes, result: Table, truth: Truth, y_mm: Floats) -> None:
    """Draw the points of a scanner that moved: z as colour over x and y."""
    seen = np.isfinite(truth.position_px)
    near = _near(result.x_mm, truth.x_mm)
    rows = result.located & seen
    _draw_hidden(axes, truth.x_mm, y_mm, np.isfinite(truth.z_mm) & ~seen)
    if (rows & near).any():
        label = _counted(rows, "point")
        rows = rows & near
        low, high = np.percentile(result.z_mm[rows], (1.0, 99.0))
        dots = axes.scatter(
            result.x_mm[rows],
            y_mm[rows],
            c=result.z_mm[rows],
            s=2.0,
            linewidths=0,
            cmap="viridis_r",  # near is bright
            vmin=low,
            vmax=max(high, low + 1e-3),
            label=label,
        )
        assert axes.figure is not None
        axes.figure.colorbar(dots, ax=axes, label="z in mm", pad=0.01)
    _draw_stray(axes, result.x_mm, y_mm, result.located & ~seen, near)
    axes.set_aspect("equal", adjustable="datalim")
    axes.set(title="Points", xlabel="x in mm", ylabel="y in mm")
    _legend(axes, markerscale=3.0)


def _draw_hidden(axes: Axes, across: Floats, up: Floats, rows: Bools) -> None:
    if rows.any():
        label = f"hidden from the camera, {_counted(rows, 'line')}"
        style: dict[str, Any] = {"color": QUIET, "markersize": 3.0, "markeredgewidth": 0.7}
        axes.plot(across[rows], up[rows], "x", **style, label=label)


def _draw_stray(axes: Axes, across: Floats, up: Floats, rows: Bools, near: Bools) -> None:
    if rows.any():
        label = f"without a spot, {_counted(rows, 'point')}"
        rows = rows & near
        axes.plot(across[rows], up[rows], "d", color=INK, markersize=2.5, label=label)


def _counted(rows: Bools, what: str) -> str:
    count = int(rows.sum())
    return f"{count} {what}" + ("" if count == 1 else "s")


def _legend(axes: Axes, columns: int = 1, **options: Any) -> None:
    """Add a legend above the axes, where it covers nothing, if there is anything to name."""
    handles, labels = axes.get_legend_handles_labels()
    if handles:
        place: dict[str, Any] = {"loc": "lower right", "bbox_to_anchor": (1.0, 0.98)}
        legend = axes.legend(handles, labels, ncols=columns, **place, **options)
        for mark in legend.legend_handles:  # enlarges small dots only
            if isinstance(mark, Line2D):
                mark.set_markersize(min(mark.get_markersize(), 6.0))


def _draw_error(axes: Axes, recording: Lines, result: Table, truth: Truth) -> None:
    """Draw the error in z over the scan angle, each point in front of twice its predicted sigma."""
    good = result.located & np.isfinite(truth.position_px)
    angle = np.degrees(recording.angle_rad)
    error = np.where(good, 1e3 * (result.z_mm - truth.z_mm), np.nan)
    limit = 1.3 * float(np.percentile(np.abs(error[good]), 99.0)) if good.any() else 1.0
    limit = max(limit, 1e-3)
    if good.any():
        sigma = np.minimum(2e3 * result.sigma_z_mm[good], 10.0 * limit)
        axes.vlines(
            angle[good],
            -sigma,
            sigma,
            color=LIGHT,
            linewidth=np.clip(_WIDTH_POINTS / np.unique(angle[good].round(2)).size, 1.0, 3.0),
            label="twice the predicted sigma",
            zorder=1,
        )
    for index in range(len(truth.names)):
        rows = good & (truth.surface == index)
        axes.plot(angle[rows], error[rows], **_dots(index))
    beyond = good & (np.abs(np.nan_to_num(error)) > limit)
    if beyond.any():
        axes.plot(
            angle[beyond],
            np.sign(error[beyond]) * limit * 0.97,
            "d",
            color=INK,
            markersize=2.5,
            label=f"beyond the axis, {_counted(beyond, 'point')}",
        )
    axes.set_ylim(-limit, limit)
    if len(angle) and np.ptp(angle) > 0.0:
        margin = 0.05 * np.ptp(angle)
        axes.set_xlim(angle.min() - margin, angle.max() + margin)
    axes.set(
        title="Error in z over the scan angle" if good.any() else "No point on a spot",
        xlabel="scan angle in degrees",
        ylabel="measured - true in µm",
    )
    _legend(axes)


def _draw_line(
    axes: Axes, pixels: Callable[[int], Pixels], result: Table, config: Config, truth: Truth
) -> None:
    """One raw line around its window: the widest spot's, where the window shows best."""
    axes.set(xlabel="pixel", ylabel="counts")
    rows = np.flatnonzero(result.located & np.isfinite(truth.position_px))
    if len(rows) == 0:
        _draw_brightest(axes, pixels, result)
        return
    by_width = rows[np.argsort(result.width[rows], kind="stable")]
    row = int(by_width[round(0.95 * (len(by_width) - 1))])
    number = int(result.line[row])
    line = pixels(number)
    left, right = int(result.left[row]), int(result.right[row])
    reach = 2 * (right - left + 1)
    first = max(0, left - reach)
    last = min(len(line), right + reach + 1)
    pixel = np.arange(first, last)
    noise_row = config.peak.noise == "row"
    level = cut(
        statistics(line[None], max_window=MAX_WINDOW, noise_row=noise_row),
        k_noise=config.peak.k_noise,
        k_height=config.peak.cut_height,
        limited=not noise_row,
    )[0]
    axes.axvspan(
        left - 0.5,
        right + 0.5,
        color="#fbe9d7",
        linewidth=0,
        label=f"window, {right - left + 1} px",
    )
    axes.step(pixel, line[first:last], where="mid", color=COLOURS[0], linewidth=1)
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
    axes.set_title(f"Line {number} with its window")
    axes.legend(loc="upper left" if last == len(line) else "upper right")  # the spot is that far


def _draw_brightest(axes: Axes, pixels: Callable[[int], Pixels], result: Table) -> None:
    """Draw the line with the brightest pixel, for a scan without a point."""
    axes.set_title("No line with a point")
    if len(result) == 0:
        return
    number = int(result.line[np.argmax(result.maximum)])
    line = pixels(number)
    peak = int(np.argmax(line))
    first, last = max(0, peak - _CONTEXT_PX), min(len(line), peak + _CONTEXT_PX + 1)
    axes.step(np.arange(first, last), line[first:last], where="mid", color=COLOURS[0], linewidth=1)
    axes.set_xlim(first, last - 1)
    axes.set_title(f"No line with a point; the brightest, line {number}")
