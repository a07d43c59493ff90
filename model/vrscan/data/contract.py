"""Which lines the engines take, checked in one place.

``checked`` takes them in physical units, ``checked_words`` in the integers of the RTL. Every engine
refuses the same input with the same text, before any work is done.
"""

from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from vrscan.data import pkg
from vrscan.data.arrays import Bools, Floats, Ints, Pixels
from vrscan.data.config import Config
from vrscan.data.errors import LinesError
from vrscan.data.lines import Lines

POWER_LIMIT = 2**16 - 1  # largest value of the RTL's port
_FLAGS_LIMIT = 2**pkg.MIRROR_FLAG_WIDTH - 1
_LENS_LIMIT = 2**pkg.LENS_WIDTH - 1
_ANGLE_HALF = 2 ** (pkg.ANGLE_WIDTH - 1)  # half a turn


def checked(recording: Lines, config: Config, *, first: int = 0, pixels: bool = True) -> Lines:
    """Return lines in the form that every engine takes, or raise an error that says what is wrong.

    Args:
        recording: n lines, n may be 0. Pixels, powers from 0 to ``laser.power_max``, flags from 0
            to 7 and the lens's positions of 16 bits, if there are any, are whole numbers of any
            type; angles are of any floating-point type within +-pi rad. Times and positions of the
            scanner are numbers, of which a time may be NaN.
        config: The configuration, whose sensor gives the line's length and the bits of a pixel.
        first: Number of the first line, for error messages that name a line.
        pixels: Whether to read every pixel of lines that are uint16. The engines do, so
            ``engines.run`` need not.

    Returns:
        The same lines in the machine's own types, with flags, time and y for each line [n].

    Raises:
        LinesError: naming the array, what it must be, and a value that is not.
    """
    lines = _shaped(recording.lines, config.sensor.line_length)
    count = len(lines)
    angle = checked_angles(_column("angle_rad", recording.angle_rad, count), first)
    power = checked_power(recording.power, count, config.laser.power_max, first)
    raised = checked_flags(recording.mirror_flags, count, first)
    lens = recording.lens
    if lens is not None:
        lens = _whole("lens", lens, count, 0, _LENS_LIMIT, first)
    if pixels or lines.dtype != np.uint16:
        lines = _pixels(lines, config.sensor.pixel_width, first)
    time = _number("time_s", recording.time_s, count)
    y = _number("y_mm", recording.y_mm, count)
    _check_limits("time_s", time, ~np.isinf(time), "the finite numbers", first)
    _check_limits("y_mm", y, np.isfinite(y), "the finite numbers", first)
    return replace(
        recording,
        lines=lines,
        angle_rad=angle,
        power=power,
        mirror_flags=raised,
        lens=lens,
        time_s=time,
        y_mm=y,
    )


def checked_words(
    lines: Pixels,
    angle: Ints,
    power: Ints,
    mirror_flags: Ints | int,
    *,
    line_length: int,
    pixel_width: int,
) -> tuple[Pixels, Ints, Ints, Ints]:
    """Return lines, angles, powers and flags in the form that RTL and model take; see ``checked``.

    Args:
        lines: Pixels, whole numbers [n, line_length], below 2**pixel_width.
        angle: Scan angles, fractions of a turn as signed integers of 24 bits [n].
        power: Laser powers, integers of 16 bits [n].
        mirror_flags: Flags of the mirror, 0 to 7, [n] or one for all.
        line_length: ``LineLength`` of the elaboration.
        pixel_width: ``PixelWidth`` of the elaboration.

    Raises:
        LinesError: naming the array, what it must be, and a value that is not.
    """
    lines = _shaped(lines, line_length)
    count = len(lines)
    if np.asarray(angle).dtype.kind == "f":  # of another unit, though it may be whole
        raise LinesError(f"angle must be integers (is {np.asarray(angle).dtype})")
    angle = _whole("angle", angle, count, -_ANGLE_HALF, _ANGLE_HALF - 1)
    power = checked_power(power, count)
    raised = checked_flags(mirror_flags, count)
    lines = _pixels(lines, pixel_width)
    return lines, angle, power, raised


def checked_angles(angle_rad: npt.ArrayLike, first: int = 0) -> Floats:
    """Return angles as float64, any shape.

    Raises:
        LinesError: if they are not floating-point numbers within +-pi rad.
    """
    angle = np.asarray(angle_rad)
    if angle.dtype.kind != "f":
        raise LinesError(f"angle_rad must be floating point (is {angle.dtype})")
    angle = angle.astype(np.float64, copy=False)
    _check_limits(
        "angle_rad", angle, np.abs(angle) <= np.pi, "-pi to pi", first
    )  # NaN compares false
    return angle


def checked_power(
    power: npt.ArrayLike, count: int, limit: int = POWER_LIMIT, first: int = 0
) -> Ints:
    """Return the laser power of each line [count].

    Raises:
        LinesError: as ``checked``.
    """
    return _whole("power", power, count, 0, limit, first)


def checked_flags(mirror_flags: npt.ArrayLike, count: int, first: int = 0) -> Ints:
    """Return the mirror's flags of each line [count], from one for each line or one for all."""
    given = np.asarray(mirror_flags)
    if given.ndim == 0:
        given = np.broadcast_to(given, count)
    return _whole("mirror_flags", given, count, 0, _FLAGS_LIMIT, first)


def _shaped(lines: npt.ArrayLike, length: int) -> npt.NDArray[Any]:
    """Return lines in the machine's byte order; the values of the pixels are not checked."""
    given = np.asarray(lines)
    if given.dtype.kind not in "iuf":
        raise LinesError(f"lines must be whole numbers (are {given.dtype})")
    if given.ndim != 2 or given.shape[1] != length:
        raise LinesError(f"lines must have shape [n, {length}] (have {given.shape})")
    return given.astype(given.dtype.newbyteorder("="), copy=False)


def _pixels(lines: npt.NDArray[Any], pixel_width: int, first: int = 0) -> Pixels:
    """Return lines as uint16, or raise an error that names a pixel that does not fit."""
    if lines.dtype.kind == "u" and not int(np.bitwise_or.reduce(lines, axis=None)) >> pixel_width:
        return lines.astype(np.uint16, copy=False)  # faster than comparisons
    full = 2**pixel_width - 1
    wrong = ~((lines >= 0) & (lines <= full) & _are_whole(lines))
    if wrong.any():
        row, pixel = np.unravel_index(int(wrong.argmax()), lines.shape)
        value, where = lines[row, pixel], f"line {first + row}, pixel {pixel}"
        what = f"above {full}" if value > full else f"no whole number from 0 to {full}"
        raise LinesError(f"pixel {what} ({value} at {where})")
    return lines.astype(np.uint16)


def _are_whole(values: npt.NDArray[Any]) -> Bools:
    """Return which values are whole numbers, of their shape."""
    if values.dtype.kind != "f":
        return np.ones(values.shape, np.bool_)
    return np.asarray(np.isfinite(values) & (np.trunc(values) == values))


def _column(name: str, values: npt.ArrayLike, count: int) -> npt.NDArray[Any]:
    """Return values, one for each line."""
    column = np.asarray(values)
    if column.shape != (count,):
        raise LinesError(f"{name} must have shape ({count},) (has {column.shape})")
    return column


def _number(name: str, values: npt.ArrayLike, count: int) -> Floats:
    """Return float64 for each line, from one for each line or one for all."""
    given = np.asarray(values)
    if given.dtype.kind not in "fiu":
        raise LinesError(f"{name} must be numbers (is {given.dtype})")
    if given.ndim == 0:
        given = np.broadcast_to(given, count)
    return _column(name, given, count).astype(np.float64, copy=False)


def _whole(
    name: str, values: npt.ArrayLike, count: int, low: int, high: int, first: int = 0
) -> Ints:
    """Return whole numbers from low to high, one for each line."""
    column = _column(name, values, count)
    if column.dtype.kind not in "iuf":
        raise LinesError(f"{name} must be whole numbers (is {column.dtype})")
    _check_limits(name, column, _are_whole(column), "the whole numbers", first)
    # The values are compared in their own type, so the message can name even the largest integer.
    _check_limits(name, column, (column >= low) & (column <= high), f"{low} to {high}", first)
    return column.astype(np.int64, copy=False)


def _check_limits(
    name: str, values: npt.NDArray[Any], inside: Bools, limits: str, first: int
) -> None:
    """Raise an error unless all values are inside; it names the first one that is not."""
    outside = np.argwhere(~np.atleast_1d(inside))
    if len(outside):
        place = tuple(outside[0].tolist())
        value = np.atleast_1d(values)[place]
        line = ", ".join(map(str, (first + place[0], *place[1:])))
        raise LinesError(f"{name} outside {limits} ({value} at line {line})")
