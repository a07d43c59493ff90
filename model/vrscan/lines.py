"""Sensor lines: the type that every engine reads, what all engines refuse, and recorded lines.

``checked`` is the contract in physical units, ``checked_words`` the same in the integers of the
RTL. What either refuses is refused by every engine with the same text, before any work is done.
"""

import difflib
import warnings
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import numpy.typing as npt

from vrscan.arrays import Bools, Floats, Ints, Pixels
from vrscan.config import Config
from vrscan.errors import InputError, InputWarning, LinesError
from vrscan.fixed import pkg

_POWER_LIMIT = 2**16 - 1  # of the RTL's port
_FLAGS_LIMIT = 2**pkg.MIRROR_FLAG_WIDTH - 1
_ANGLE_HALF = 2 ** (pkg.ANGLE_WIDTH - 1)  # half a turn
_ARRAYS = ("lines", "angle_rad", "power", "mirror_flags")  # of an .npz
_WORDS = {"angle_rad": "angle", "power": "power", "mirror_flags": "flag"}  # that give one away
_MISSPELT = 0.85  # difflib's likeness from which a name is another one, misspelt


@dataclass(frozen=True)
class Truth:
    """What a simulated line saw; all arrays [n], NaN where there is no such thing."""

    x_mm: Floats  # the spot
    z_mm: Floats
    position_px: Floats  # its image; NaN where the camera does not see it
    surface: Ints  # index into ``names``, -1 without a spot
    names: tuple[str, ...]


@dataclass(frozen=True)
class Lines:
    """n sensor lines with what the chain needs to know of each.

    Whatever makes light (a recording, the simple scene, a full simulator) ends in this type.
    """

    lines: Pixels  # counts [n, length]
    angle_rad: Floats  # scan angle at the pulse's centre [n]
    power: Ints  # laser power [n], u16
    truth: Truth | None = None
    mirror_flags: Ints | int = 0  # [n] or one for all; bit 0 NOT_RUNNING, INDEX_FAULT, UNSETTLED

    def __len__(self) -> int:
        """Return the number of lines."""
        return len(self.lines)


def checked(recording: Lines, config: Config, *, pixels: bool = True) -> Lines:
    """Return lines as every engine takes them, or say what is wrong with them.

    Args:
        recording: n lines, n may be 0. Lines are uint16 of either byte order, angles of any
            floating-point type within +-pi rad, powers of any integer type from 0 to
            ``laser.power_max``, and flags of any integer type from 0 to 7.
        config: Its sensor says how long a line is and how many bits a pixel has.
        pixels: Whether to read every pixel. The engines do, so ``engines.run`` need not.

    Returns:
        The same lines in the machine's own types, with flags for each line [n].

    Raises:
        LinesError: naming the array, what it must be, and a value that is not.
    """
    lines = _checked_shape(recording.lines, config.sensor.line_length)
    count = len(lines)
    angle = checked_angles(_column("angle_rad", recording.angle_rad, count))
    power = _whole("power", recording.power, count, 0, config.laser.power_max)
    raised = _flags(recording.mirror_flags, count)
    if pixels:
        _check_pixels(lines, config.sensor.pixel_width)
    return replace(recording, lines=lines, angle_rad=angle, power=power, mirror_flags=raised)


def checked_words(
    lines: Pixels,
    angle: Ints,
    power: Ints,
    mirror_flags: Ints | int,
    *,
    line_length: int,
    pixel_width: int,
) -> tuple[Pixels, Ints, Ints, Ints]:
    """Return lines, angles, powers and flags as RTL and model take them; see ``checked``.

    Args:
        lines: uint16 [n, line_length], below 2**pixel_width.
        angle: Fractions of a turn as signed integers of 24 bits [n].
        power: Integers of 16 bits [n].
        mirror_flags: 0 to 7, [n] or one for all.
        line_length: Of the elaboration.
        pixel_width: Of the elaboration.

    Raises:
        LinesError: naming the array, what it must be, and a value that is not.
    """
    lines = _checked_shape(lines, line_length)
    count = len(lines)
    angle = _whole("angle", angle, count, -_ANGLE_HALF, _ANGLE_HALF - 1)
    power = _whole("power", power, count, 0, _POWER_LIMIT)
    raised = _flags(mirror_flags, count)
    _check_pixels(lines, pixel_width)
    return lines, angle, power, raised


def checked_angles(angle_rad: npt.ArrayLike) -> Floats:
    """Return angles as float64, any shape.

    Raises:
        LinesError: if they are not floating-point numbers within +-pi rad.
    """
    angle = np.asarray(angle_rad)
    if angle.dtype.kind != "f":
        raise LinesError(f"angle_rad must be floating point (is {angle.dtype})")
    angle = angle.astype(np.float64, copy=False)
    _check_limits("angle_rad", angle, np.abs(angle) <= np.pi, "-pi to pi")  # NaN compares false
    return angle


def read(path: Path, config: Config) -> Lines:
    """Return recorded lines from ``.npy`` or ``.npz``.

    An ``.npz`` holds ``lines`` and optionally ``angle_rad`` [n] (0 where it is not given, with an
    ``InputWarning``), ``power`` [n] (full power where it is not given) and ``mirror_flags`` [n] or
    one for all (0 where it is not given: the angle is good); other arrays in it are ignored, but
    not one that looks like a misspelt name of these, such as ``angle_deg`` without ``angle_rad``.

    Args:
        path: The file.
        config: Its sensor says how long a line is and how many bits a pixel has.

    Returns:
        The lines as ``checked`` gives them, n at least 1.

    Raises:
        InputError: naming the file and what is wrong, if it is missing, damaged or empty, or holds
            a misspelt name or what ``checked`` refuses.
    """
    arrays = _load(path)
    count = arrays["lines"].shape[:1]
    given = Lines(
        lines=arrays["lines"],
        angle_rad=arrays.get("angle_rad", np.zeros(count)),
        power=arrays.get("power", np.full(count, config.laser.power_max)),
        mirror_flags=arrays.get("mirror_flags", 0),
    )
    try:
        recording = checked(given, config)
    except LinesError as error:
        raise LinesError(f"{path}: {error}") from None
    if len(recording) == 0:
        raise InputError(f"{path}: no lines (shape {given.lines.shape})")
    if "angle_rad" not in arrays:
        text = "no angle_rad: every line is taken at angle 0, so every x is 0"
        hint = "an .npz takes angle_rad [n] beside lines"
        warnings.warn(f"{path}: {text} ({hint})", InputWarning, stacklevel=2)
    return recording


def write(recording: Lines, file: BinaryIO) -> None:
    """Write lines, and their truth if they have one, as an ``.npz`` that ``read`` reads.

    Args:
        recording: The lines.
        file: A binary file. Beside what ``read`` takes it gets ``true_x_mm``, ``true_z_mm``,
            ``true_position_px`` and ``surface`` [n], and ``surface_names``.

    Raises:
        LinesError: if powers or flags do not fit in what they are written as.
    """
    count = len(recording)
    arrays: dict[str, npt.NDArray[Any]] = {
        "lines": recording.lines,
        "angle_rad": recording.angle_rad,
        "power": _whole("power", recording.power, count, 0, _POWER_LIMIT).astype(np.uint16),
        "mirror_flags": _flags(recording.mirror_flags, count).astype(np.uint8),
    }
    truth = recording.truth
    if truth is not None:
        arrays |= {
            "true_x_mm": truth.x_mm,
            "true_z_mm": truth.z_mm,
            "true_position_px": truth.position_px,
            "surface": truth.surface,
            "surface_names": np.array(truth.names),
        }
    np.savez(file, allow_pickle=False, **arrays)


def _load(path: Path) -> dict[str, npt.NDArray[Any]]:
    """Return the arrays of a file that a recording may hold; a bare array is ``lines``."""
    try:
        with path.open("rb") as file, warnings.catch_warnings():
            warnings.simplefilter("ignore")  # numpy's doubts about a damaged header
            if not file.peek(1):
                raise InputError(f"{path}: empty file (0 bytes)")
            loaded = np.load(file, allow_pickle=False)
            if isinstance(loaded, np.ndarray):
                return {"lines": loaded}
            with loaded:
                _check_names(path, loaded.files)
                return {name: loaded[name] for name in _ARRAYS if name in loaded.files}
    except InputError:
        raise
    except OSError as error:
        raise InputError(f"{path}: {error.strerror or 'cannot read'}") from error
    except Exception as error:  # a damaged file makes numpy, zipfile, zlib and tokenize raise
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        if "pickle" in reason:  # numpy's way to say that it knows neither format nor type
            reason = "no array of plain numbers"
        raise InputError(f"{path}: not a .npy or .npz file of lines ({reason})") from error


def _check_names(path: Path, names: list[str]) -> None:
    """Refuse an archive without lines, or with a misspelt name of an array that it lacks."""
    known = ", ".join(_ARRAYS)
    if "lines" not in names:
        has = ", ".join(map(repr, names)) or "none"
        raise InputError(f"{path}: no array named lines (has {has}; known are {known})")
    for wanted, word in _WORDS.items():
        if wanted in names:
            continue
        for name in names:
            given = name.casefold()
            near = word in given or difflib.get_close_matches(given, [wanted], cutoff=_MISSPELT)
            if near and name not in _ARRAYS:
                has = f"but {name!r} (known are {known})"
                raise InputError(f"{path}: no array named {wanted}, {has}")


def _checked_shape(lines: Pixels, length: int) -> Pixels:
    """Return lines of the machine's byte order; what they hold is not looked at."""
    given = np.asarray(lines)
    if given.dtype.kind != "u" or given.dtype.itemsize != 2:
        raise LinesError(f"lines must be uint16 (are {given.dtype})")
    if given.ndim != 2 or given.shape[1] != length:
        raise LinesError(f"lines must have shape [n, {length}] (have {given.shape})")
    return given.astype(np.uint16, copy=False)


def _check_pixels(lines: Pixels, pixel_width: int) -> None:
    if int(np.bitwise_or.reduce(lines, axis=None)) >> pixel_width:  # faster than the maximum
        row, pixel = np.unravel_index(int(lines.argmax()), lines.shape)
        largest, full = lines[row, pixel], 2**pixel_width - 1
        raise LinesError(f"pixel above {full} ({largest} at line {row}, pixel {pixel})")


def _column(name: str, values: npt.ArrayLike, count: int) -> npt.NDArray[Any]:
    """Return values that are one a line."""
    column = np.asarray(values)
    if column.shape != (count,):
        raise LinesError(f"{name} must have shape ({count},) (has {column.shape})")
    return column


def _whole(name: str, values: npt.ArrayLike, count: int, low: int, high: int) -> Ints:
    """Return integers from low to high, one a line."""
    column = _column(name, values, count)
    if column.dtype.kind not in "iu":
        raise LinesError(f"{name} must be integers (is {column.dtype})")
    # Compared in their own type: no integer is too large to be told.
    _check_limits(name, column, (column >= low) & (column <= high), f"{low} to {high}")
    return column.astype(np.int64, copy=False)


def _flags(mirror_flags: npt.ArrayLike, count: int) -> Ints:
    """Return the mirror's flags of each line, which may be given as one for all."""
    given = np.asarray(mirror_flags)
    if given.ndim == 0:
        given = np.broadcast_to(given, count)
    return _whole("mirror_flags", given, count, 0, _FLAGS_LIMIT)


def _check_limits(name: str, values: npt.NDArray[Any], inside: Bools, limits: str) -> None:
    """Refuse values of which not all are inside, naming the first that is not."""
    outside = np.argwhere(~np.atleast_1d(inside))
    if len(outside):
        place = tuple(outside[0].tolist())
        value, line = np.atleast_1d(values)[place], ", ".join(map(str, place))
        raise LinesError(f"{name} outside {limits} ({value} at line {line})")
