"""Sensor lines: the type that every engine reads, and the reader of recorded ones."""

import difflib
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import numpy.typing as npt

from vrscan.arrays import Floats, Ints, Pixels
from vrscan.config import Config
from vrscan.contract import checked, checked_flags, checked_power
from vrscan.errors import InputError, InputWarning, LinesError

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
        "power": checked_power(recording.power, count).astype(np.uint16),
        "mirror_flags": checked_flags(recording.mirror_flags, count).astype(np.uint8),
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
