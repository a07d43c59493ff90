"""Sensor lines: the type that every engine reads, and the reader of recorded ones."""

import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import numpy.typing as npt

from vrscan.arrays import Floats, Ints, Pixels
from vrscan.config import Config
from vrscan.errors import InputError

ANGLE_LIMIT_RAD = np.pi
MIRROR_FLAGS_ALL = 7  # three bits


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


def read(path: Path, config: Config) -> Lines:
    """Return recorded lines from ``.npy`` or ``.npz``.

    An ``.npz`` holds ``lines`` and optionally ``angle_rad`` [n] (0 where it is not given),
    ``power`` [n] (full power where it is not given) and ``mirror_flags`` [n] (0 where it is not
    given: the angle is good); other arrays in it are ignored.

    Args:
        path: The file.
        config: Its sensor says how long a line is and how many bits a pixel has.

    Returns:
        The lines, uint16 [n, line_length], n at least 1.

    Raises:
        InputError: naming the file and the value, if it is missing, damaged, or holds anything
            but lines of that length and width, angles within +-pi rad, and flags of 0 to 7.
    """
    arrays = _load(path)
    if "lines" not in arrays:
        raise InputError(f"{path}: no array named lines (has {', '.join(arrays) or 'none'})")
    lines = arrays["lines"]
    _check_lines(path, lines, config)
    count = len(lines)
    angle = arrays.get("angle_rad", np.zeros(count))
    _check_column(path, "angle_rad", angle, count, "f")
    bad = np.flatnonzero(~(np.abs(angle) <= ANGLE_LIMIT_RAD))  # NaN compares false
    if len(bad):
        raise InputError(
            f"{path}: angle_rad outside -pi to pi ({angle[bad[0]]:g} at line {bad[0]})"
        )
    power = arrays.get("power", np.full(count, config.laser.power_max, np.uint16))
    _check_column(path, "power", power, count, "u")
    bad = np.flatnonzero(power > config.laser.power_max)
    if len(bad):
        limit = config.laser.power_max
        raise InputError(f"{path}: power above {limit} ({power[bad[0]]} at line {bad[0]})")
    raised = arrays.get("mirror_flags", np.zeros(count, np.uint8))
    _check_column(path, "mirror_flags", raised, count, "u")
    bad = np.flatnonzero(raised > MIRROR_FLAGS_ALL)
    if len(bad):
        limit = MIRROR_FLAGS_ALL
        raise InputError(f"{path}: mirror_flags above {limit} ({raised[bad[0]]} at line {bad[0]})")
    return Lines(
        lines=np.ascontiguousarray(lines, np.uint16),
        angle_rad=angle.astype(np.float64),
        power=power.astype(np.int64),
        mirror_flags=raised.astype(np.int64),
    )


def write(recording: Lines, file: BinaryIO) -> None:
    """Write lines, and their truth if they have one, as an ``.npz`` that ``read`` reads.

    Args:
        recording: The lines.
        file: A binary file. Beside what ``read`` takes it gets ``true_x_mm``, ``true_z_mm``,
            ``true_position_px`` and ``surface`` [n], and ``surface_names``.
    """
    arrays: dict[str, npt.NDArray[Any]] = {
        "lines": recording.lines,
        "angle_rad": recording.angle_rad,
        "power": recording.power.astype(np.uint16),
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
    wanted = ("lines", "angle_rad", "power", "mirror_flags")
    try:
        with path.open("rb") as file, warnings.catch_warnings():
            warnings.simplefilter("ignore")  # numpy's doubts about a damaged header
            if not file.peek(1):
                raise InputError(f"{path}: empty file (0 bytes)")
            loaded = np.load(file, allow_pickle=False)
            if isinstance(loaded, np.ndarray):
                return {"lines": loaded}
            with loaded:
                return {name: loaded[name] for name in wanted if name in loaded.files}
    except InputError:
        raise
    except OSError as error:
        raise InputError(f"{path}: {error.strerror or 'cannot read'}") from error
    except Exception as error:  # a damaged file makes numpy, zipfile, zlib and tokenize raise
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        if "pickle" in reason:  # numpy's way to say that it knows neither format nor type
            reason = "no array of plain numbers"
        raise InputError(f"{path}: not a .npy or .npz file of lines ({reason})") from error


def _check_lines(path: Path, lines: npt.NDArray[Any], config: Config) -> None:
    length = config.sensor.line_length
    if lines.dtype.kind != "u" or lines.dtype.itemsize != 2:
        raise InputError(f"{path}: lines must be uint16 (are {lines.dtype})")
    if lines.ndim != 2 or lines.shape[1] != length:
        raise InputError(f"{path}: lines must have shape [n, {length}] (have {lines.shape})")
    if len(lines) == 0:
        raise InputError(f"{path}: no lines (shape {lines.shape})")
    full = 2**config.sensor.pixel_width - 1
    largest = int(lines.max())
    if largest > full:
        row, pixel = np.unravel_index(int(lines.argmax()), lines.shape)
        raise InputError(f"{path}: pixel above {full} ({largest} at line {row}, pixel {pixel})")


def _check_column(path: Path, name: str, column: npt.NDArray[Any], count: int, kind: str) -> None:
    if column.dtype.kind != kind:
        wanted = {"f": "floating point", "u": "unsigned integers"}[kind]
        raise InputError(f"{path}: {name} must be {wanted} (is {column.dtype})")
    if column.shape != (count,):
        raise InputError(f"{path}: {name} must have shape ({count},) (has {column.shape})")
