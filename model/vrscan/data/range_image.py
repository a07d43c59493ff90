"""Sweeps of the mirror, and the image of the distances that they measured.

A sweep is what the mirror takes from one turning point to the next, or a facet of a polygon from
one jump back to the next. Its lines lie at angles that differ from sweep to sweep, so an image has
columns of its own, evenly spaced.
"""

import math
from dataclasses import dataclass
from typing import BinaryIO

import numpy as np
import numpy.typing as npt

from vrscan.data.arrays import Bools, Floats, Ints
from vrscan.data.errors import InputError
from vrscan.data.extras import named
from vrscan.data.residuals import NORMAL
from vrscan.data.table import Table

MOST_COLUMNS = 65_536
STEP_MM = 1.0 / 32.0  # of a pixel of 16 bits, in which 0 is no point; more for far points
SUFFIXES = (".png", ".tif", ".tiff")
_GAP = 0.95  # quantile of the steps between lines that a column is wide: hardly a hole
_JUMP = 4.0  # least ratio of a polygon's jump back to the steps beside it
_REVERSAL = 1.0 / 16.0  # largest share of the range that noise may go back by
_ROUNDING = 1e-9  # share of the range below which two angles differ by their last digits only

Image = npt.NDArray[np.float32]


@dataclass(frozen=True)
class Grid:
    """``count`` angles from ``first_rad`` on, ``step_rad`` apart: the middles of the columns."""

    first_rad: float
    step_rad: float
    count: int

    def columns(self, angle_rad: Floats) -> Ints:
        """Return the column of each angle, of its shape; the first or last one beyond the ends."""
        found = np.rint((angle_rad - self.first_rad) / self.step_rad).astype(np.int64)
        return np.clip(found, 0, self.count - 1)

    def inside(self, angle_rad: Floats) -> Bools:
        """Return which angles lie in a column and not beyond the ends, of their shape."""
        place = (angle_rad - self.first_rad) / self.step_rad
        return np.asarray((place > -0.5) & (place < self.count - 0.5))

    def middles(self) -> Floats:
        """Return the angle of each column, rad [count]."""
        return np.asarray(self.first_rad + self.step_rad * np.arange(self.count), np.float64)


def sweeps(angle_rad: Floats, *, exact: bool = False) -> Ints:
    """Return the number of the sweep of each line, from 0 [n].

    A sweep begins with the line after the turning point, or with the one to which a polygon's beam
    jumps back: a single step the other way, of ``_JUMP`` times its neighbours. Angles that were
    measured go to and fro by their noise and the step of their converter; where such reversals are
    between others, a mirror turns only where it goes back by more than ``_noise`` of all angles.

    Args:
        angle_rad: Scan angles of all lines, in the order in which they were taken [n].
        exact: Whether every reversal is a turning point. Then the last three steps that moved say
            whether a line begins a sweep, whatever the other lines are.

    Example:
        >>> import numpy as np
        >>> sweeps(np.array([0.0, 0.1, 0.2, 0.15, 0.05, 0.1])).tolist()
        [0, 0, 0, 1, 1, 2]
    """
    begins = np.zeros(len(angle_rad), np.int64)
    # A line at the angle of the one before it goes on as that one.
    rows = np.flatnonzero(np.concatenate([[True], np.diff(angle_rad) != 0.0])[: len(angle_rad)])
    angle = angle_rad[rows]
    step = np.diff(angle)
    turns = np.flatnonzero(np.diff(step > 0.0)) + 1
    least = 0.0
    if len(turns) > 1 and not exact:
        noise = _noise(angle_rad)
        if (np.abs(np.diff(angle[turns])) <= noise).any():
            turns, least = _turns(angle, turns, noise), noise
    kept = turns.copy()
    if len(turns) > 1:
        size = np.abs(step)
        largest = np.maximum.reduceat(size, turns)[:-1]
        back = np.abs(np.diff(angle[turns]))
        for run in np.flatnonzero(back - largest <= least).tolist():
            at = turns[run] + int(size[turns[run] : turns[run + 1]].argmax())
            single = least or turns[run + 1] == at + 1
            if single and size[at] >= _JUMP * max(size[at - 1], size[at + 1]):
                kept[run], kept[run + 1] = at, -1  # the beam goes on from where it jumped to
    begins[rows[kept[kept >= 0] + 1]] = 1
    return np.cumsum(begins)


def _noise(angle_rad: Floats) -> float:
    """Return by how much measured angles may go back without a turn of the mirror, rad.

    That is ten standard deviations of their noise, which is taken from fourth differences, as the
    motion is smooth, and no less than three of their smallest steps; but little of their range.
    """
    step = np.abs(np.diff(angle_rad))
    span = float(np.ptp(angle_rad))
    rough = np.abs(np.diff(angle_rad, 4))
    noise = NORMAL * float(np.median(rough)) / math.sqrt(70.0) if len(rough) else 0.0
    smallest = float(step[step > _ROUNDING * span].min(initial=span))
    return min(max(10.0 * noise, 3.5 * smallest), _REVERSAL * span)


def _turns(angle: Floats, reversals: Ints, least: float) -> Ints:
    """Return those of the reversals between which the angle goes by more than ``least``."""
    kept: list[int] = []
    low = high = extreme = 0
    rising = None  # not known before the angle has gone so far
    for place in [*reversals.tolist(), len(angle) - 1]:
        if rising is None:
            low = place if angle[place] < angle[low] else low
            high = place if angle[place] > angle[high] else high
            if angle[high] - angle[low] > least:
                rising, extreme = high > low, max(low, high)
            continue
        on = angle[place] - angle[extreme] if rising else angle[extreme] - angle[place]
        if on > 0.0:
            extreme = place
        elif on < -least:
            kept.append(extreme)
            rising, extreme = not rising, place
    return np.array(kept, np.int64)


def grid(angle_rad: Floats, count: int | None = None) -> Grid:
    """Return columns over all angles.

    Args:
        angle_rad: Scan angles of all lines, in their order [n], n at least 1.
        count: Number of columns; None takes as many as leave hardly a hole in a sweep, whose lines
            are farthest apart in the middle.

    Raises:
        InputError: if ``count`` is not 1 to ``MOST_COLUMNS``.
    """
    low, high = float(angle_rad.min()), float(angle_rad.max())
    if count is None:
        step = np.abs(np.diff(angle_rad))
        step = step[step > 0.0]
        widest = float(np.quantile(step, _GAP)) if len(step) else 1.0
        count = min(1 + int((high - low) / widest), MOST_COLUMNS)
    if not 1 <= count <= MOST_COLUMNS:
        raise InputError(f"--columns: must be 1 to {MOST_COLUMNS} ({count})")
    return Grid(low, (high - low) / max(count - 1, 1) or 1.0, count)


def range_image(points: Table, sweep: Ints, columns: Grid) -> Image:
    """Return the distance of each column's point from the mirror, mm, NaN where there is none.

    Args:
        points: n points; those without a place do not count.
        sweep: Number of the sweep of each [n], as ``sweeps`` gives it; it is the row.
        columns: The columns. Of several points of a sweep in one the nearest to its middle counts.

    Returns:
        float32 [sweeps, columns.count].
    """
    found = np.full((int(sweep.max(initial=-1)) + 1, columns.count), np.nan, np.float32)
    rows = np.flatnonzero(points.located)
    column = columns.columns(points.angle_rad[rows])
    away = np.abs(points.angle_rad[rows] - columns.middles()[column])
    order = np.argsort(-away, kind="stable")  # of several values in a place the last one stays
    rows, column = rows[order], column[order]
    found[sweep[rows], column] = np.hypot(points.x_mm[rows], points.z_mm[rows])
    return found


def step_mm(image: Image) -> float:
    """Return the step in which 16 bits hold all distances, mm: ``STEP_MM``, doubled as often."""
    farthest = float(np.nanmax(image, initial=0.0))
    return STEP_MM * 2.0 ** max(0, math.ceil(math.log2(max(farthest / STEP_MM, 1.0) / (2**16 - 1))))


def write_image(image: Image, suffix: str, file: BinaryIO) -> None:
    """Write an image of distances.

    Args:
        image: Distances, mm, NaN where there is none [rows, columns].
        suffix: One of ``SUFFIXES``: ``.png`` has 16 bits in steps of ``step_mm``, which its text
            of that name says, and 0 where there is no point; a TIFF has the distances as float32.
        file: A binary file.

    Raises:
        MissingError: if Pillow is not installed.
    """
    with named():
        from PIL import Image as Pictures
        from PIL.PngImagePlugin import PngInfo

    if suffix == ".png":
        step, text = step_mm(image), PngInfo()
        text.add_text("step_mm", str(step))
        steps = np.where(np.isnan(image), 0, np.clip(np.rint(image / step), 1, 2**16 - 1))
        Pictures.fromarray(steps.astype(np.uint16)).save(file, "PNG", pnginfo=text)
    else:
        Pictures.fromarray(image).save(file, "TIFF")
