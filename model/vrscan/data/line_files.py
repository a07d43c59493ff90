"""Files of recorded sensor lines, read whole or a block at a time.

They are recordings (``recording``), numpy's arrays, pictures (``line_pictures``) or a logic
analyser's tables (of ``line_signals``).
"""

import contextlib
import math
import warnings
import zipfile
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any, BinaryIO, Protocol

import numpy as np
import numpy.typing as npt

from vrscan.data import line_pictures, line_signals, recordings
from vrscan.data.config import Config
from vrscan.data.contract import checked
from vrscan.data.csv_files import csv_fields
from vrscan.data.errors import InputError, InputWarning, LinesError, alike, one_line, unread
from vrscan.data.lines import Lines, joined, part

# What an .npz holds.
_ARRAYS = ("lines", "angle_rad", "power", "mirror_flags", "lens", "time_s", "y_mm")
_SIGNALS = ".csv"
_OTHERS = (*line_pictures.SUFFIXES, _SIGNALS)  # endings of files without numpy's arrays
_WORDS = {"angle_rad": "angle", "power": "power", "mirror_flags": "flag"}  # in misspelt names
_MISSPELT = 0.85  # likeness from which a name counts as misspelt


def read(path: Path, config: Config, angles: Path | None = None) -> Lines:
    """Return recorded lines.

    Pictures are ``.png``, ``.tif`` or a folder of them, each row a line; ``.csv`` is a recording of
    the sensor's pins; what has another name is ``.npy`` or ``.npz``.

    An ``.npz`` holds ``lines`` and optionally ``angle_rad`` [n] (by default 0, with an
    ``InputWarning``), ``power`` [n] (by default full power), ``mirror_flags`` [n] or one for all
    (by default 0: the angle is good), ``lens`` [n] (by default where ``[map]`` says), ``time_s``
    [n] (by default not known) and ``y_mm`` [n] (by default 0). Other arrays in it are ignored, but
    a name that looks like a misspelt one of these, such as ``angle_deg`` without ``angle_rad``, is
    refused.

    Args:
        path: The file.
        config: The configuration, whose sensor gives the line's length and the bits of a pixel.
        angles: A CSV file with a row for each line and the columns ``angle_rad`` and, if wanted,
            ``power``, ``mirror_flags``, ``time_s`` and ``y_mm``, for lines that come without.

    Returns:
        The lines as ``checked`` gives them, n at least 1.

    Raises:
        InputError: naming the file and what is wrong, if it is missing, damaged or empty, or holds
            a misspelt name or what ``checked`` refuses.
    """
    if path.is_dir() or path.suffix.lower() in (*_OTHERS, recordings.SUFFIX):
        with opened(path, config, angles) as recorded:
            return joined(list(recorded.blocks(recorded.count)))
    arrays = _load(path)
    arrays |= _beside(path, angles, arrays, arrays["lines"])
    found = _checked(path, arrays, config)
    if "angle_rad" not in arrays:
        _warn(path)
    return found


@dataclass(frozen=True)
class Recording:
    """Recorded lines that are read a block at a time.

    Attributes:
        count: Number of lines.
        blocks: Returns an iterator over blocks of at most the given number of lines; may be called
            once.
    """

    count: int
    blocks: Callable[[int], Iterator[Lines]]


@contextlib.contextmanager
def opened(path: Path, config: Config, angles: Path | None = None) -> Iterator[Recording]:
    """Open a file that ``read`` reads, to read and check its lines block by block.

    Only an array in Fortran order, of which no line is in one piece, and a logic analyser's table
    are read whole.

    Args:
        path: The file.
        config: The configuration, as in ``read``.
        angles: A file of angles, as in ``read``.

    Raises:
        InputError: as ``read``, here or from ``blocks``.
    """
    if recordings.is_recording(path):
        if angles is not None:
            raise InputError(f"{angles}: angles are in {path}, too")
        yield Recording(*recordings.read_lines(path, config))
        return
    with contextlib.ExitStack() as stack:
        columns = _columns(path, config, stack)
        more = _beside(path, angles, columns, columns["lines"].kind)
        columns |= {name: _Given(array) for name, array in more.items()}
        kinds = {name: column.kind for name, column in columns.items()}
        _checked(path, kinds, config, pixels=False)
        count = len(kinds["lines"])

        def blocks(size: int) -> Iterator[Lines]:
            whole = None
            if not columns["lines"].in_order:
                whole = _checked(path, _load(path) | more, config)
            for start in range(0, count, size):
                rows = slice(start, min(start + size, count))
                if whole is not None:
                    yield part(whole, rows)
                    continue
                with _as_input_error(path):
                    arrays = {n: c.rows(rows.stop - start) for n, c in columns.items()}
                    if rows.stop == count:
                        for column in columns.values():
                            column.end()
                yield _checked(path, arrays, config, first=start)
            if "angle_rad" not in columns:  # warns only of a file that is good otherwise
                _warn(path)

        yield Recording(count, blocks)


def _members(path: Path, file: BinaryIO, stack: contextlib.ExitStack) -> dict[str, IO[bytes]]:
    """Return the arrays of a file that belong to a recording, as open files; see ``_load``."""
    start = file.read(2)
    file.seek(0)
    if start != b"PK":
        return {"lines": file}
    packed = stack.enter_context(zipfile.ZipFile(file))
    there = {name.removesuffix(".npy"): name for name in packed.namelist()}
    _check_names(path, list(there))
    return {
        name: stack.enter_context(packed.open(there[name])) for name in _ARRAYS if name in there
    }


def _columns(path: Path, config: Config, stack: contextlib.ExitStack) -> dict[str, "_Source"]:
    """Return the arrays of a file, open to read them row by row."""
    suffix = path.suffix.lower()
    if path.is_dir() or suffix in line_pictures.SUFFIXES:
        pictures = line_pictures.Pictures(path, config.sensor.pixel_width)
        stack.callback(pictures.end)
        return {"lines": pictures}
    if suffix == _SIGNALS:
        return {"lines": _Given(line_signals.read(path, config.sensor.line_length))}
    with _as_input_error(path):
        file = stack.enter_context(path.open("rb"))
        if not file.peek(1):
            raise InputError(f"{path}: empty file (0 bytes)")
        return {name: _Column(each) for name, each in _members(path, file, stack).items()}


def _beside(
    path: Path, angles: Path | None, there: Iterable[str], lines: npt.NDArray[Any]
) -> dict[str, npt.NDArray[Any]]:
    """Return what a file of angles has for the lines of another file."""
    if angles is None:
        return {}
    header, *rows = [row for row in csv_fields(angles) if row] or [[]]
    names = [name.strip() for name in header]
    wrong = [name for name in names if name not in _ARRAYS[1:]]
    if wrong or "angle_rad" not in names or len(set(names)) < len(names):
        raise InputError(
            f"{angles}: columns {','.join(names)!r}, known are {','.join(_ARRAYS[1:])}"
        )
    both = sorted(set(names) & set(there))
    if both:
        raise InputError(f"{angles}: {both[0]} is in {path}, too")
    count = math.prod(lines.shape[:1])
    if len(rows) != count:
        raise InputError(f"{angles}: {len(rows)} rows for the {count} lines of {path}")
    found: dict[str, npt.NDArray[Any]] = {}
    for place, name in enumerate(names):
        kind = int if name in ("power", "mirror_flags") else float
        column = []
        for number, row in enumerate(rows, start=2):
            try:
                column.append(kind(row[place]))
            except (ValueError, IndexError):
                text = row[place] if place < len(row) else ""
                told = f"{angles}: line {number}: {name} {text!r} is no number"
                raise InputError(told) from None
        found[name] = np.array(column, np.int64 if kind is int else np.float64)
    return found


class _Source(Protocol):
    """An array whose rows are read one after the other; see ``_Column``."""

    kind: npt.NDArray[Any]
    in_order: bool

    def rows(self, count: int) -> npt.NDArray[Any]: ...

    def end(self) -> None: ...


class _Given:
    """An array in memory, in the form of ``_Column``."""

    in_order = True

    def __init__(self, array: npt.NDArray[Any]) -> None:
        self.kind = array
        self._next = 0

    def rows(self, count: int) -> npt.NDArray[Any]:
        """Return the next rows."""
        self._next += count
        return self.kind[self._next - count : self._next]

    def end(self) -> None:
        """Do nothing, as there is no file."""


class _Column:
    """An array in a file, whose rows are read one after the other.

    Attributes:
        kind: An array of the same type and shape without meaningful values.
        in_order: Whether the rows lie one after the other in the file.
    """

    def __init__(self, file: IO[bytes]) -> None:
        self._file = file
        version = np.lib.format.read_magic(file)
        if version == (1, 0):
            shape, fortran, dtype = np.lib.format.read_array_header_1_0(file)
        elif version == (2, 0):
            shape, fortran, dtype = np.lib.format.read_array_header_2_0(file)
        else:
            raise ValueError("no array of plain numbers")
        if dtype.hasobject:
            raise ValueError("no array of plain numbers")
        self._dtype = dtype
        self.kind = np.broadcast_to(np.zeros((), dtype.newbyteorder("=")), shape)
        self._one: npt.NDArray[Any] | None = None
        self.in_order = not fortran or len(shape) < 2

    def rows(self, count: int) -> npt.NDArray[Any]:
        """Return the next rows; an array without rows is returned whole."""
        if self._one is not None:
            return self._one
        shape = (count, *self.kind.shape[1:]) if self.kind.ndim else ()
        size = math.prod(shape) * self._dtype.itemsize
        data = self._file.read(size)
        if len(data) < size:
            raise ValueError("it ends too early")
        found = np.frombuffer(data, self._dtype).reshape(shape)
        self._one = None if shape else found
        return found

    def end(self) -> None:
        """Read the rest, because the checksum of an array in an archive is compared at its end."""
        while self._file.read(1 << 20):
            pass


@contextlib.contextmanager
def _as_input_error(path: Path) -> Iterator[None]:
    """Turn the errors of reading a file into an ``InputError``."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # warnings of numpy about a damaged header
            yield
    except InputError:
        raise
    except OSError as error:
        told = unread(error, path, ".npy", ".npz", recordings.SUFFIX)
        raise InputError(f"{path}: {told}") from error
    except Exception as error:  # a damaged file makes numpy, zipfile, zlib and tokenize raise
        reason = one_line(error)
        if "pickle" in reason:  # numpy knows neither the format nor the type
            reason = "no array of plain numbers"
        raise InputError(f"{path}: not a .npy or .npz file of lines ({reason})") from error


def _load(path: Path) -> dict[str, npt.NDArray[Any]]:
    """Return the arrays of a file that belong to a recording; a bare array is ``lines``."""
    with _as_input_error(path), path.open("rb") as file:
        if not file.peek(1):
            raise InputError(f"{path}: empty file (0 bytes)")
        loaded = np.load(file, allow_pickle=False)
        if isinstance(loaded, np.ndarray):
            return {"lines": loaded}
        with loaded:
            _check_names(path, loaded.files)
            return {name: loaded[name] for name in _ARRAYS if name in loaded.files}


def _checked(
    path: Path,
    arrays: Mapping[str, npt.NDArray[Any]],
    config: Config,
    *,
    first: int = 0,
    pixels: bool = True,
) -> Lines:
    """Return the lines of a file's arrays; the arguments are those of ``checked``."""
    count = arrays["lines"].shape[:1]
    given = Lines(
        lines=arrays["lines"],
        angle_rad=arrays.get("angle_rad", np.broadcast_to(0.0, count)),
        power=arrays.get("power", np.broadcast_to(config.laser.power_max, count)),
        mirror_flags=arrays.get("mirror_flags", 0),
        lens=arrays.get("lens"),
        time_s=arrays.get("time_s", math.nan),
        y_mm=arrays.get("y_mm", 0.0),
    )
    try:
        found = checked(given, config, first=first, pixels=pixels)
    except LinesError as error:
        raise LinesError(f"{path}: {error}") from None
    if len(found) == 0:
        raise InputError(f"{path}: no lines (shape {given.lines.shape})")
    return found


def _warn(path: Path) -> None:
    text = "no angle_rad: every line is taken at angle 0, so every x is 0"
    hint = "an .npz takes angle_rad [n] beside lines, --angles a file of them"
    warnings.warn(f"{path}: {text} ({hint})", InputWarning, stacklevel=3)


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
            near = word in given or alike(given, [wanted], likeness=_MISSPELT)
            if near and name not in _ARRAYS:
                has = f"but {name!r} (known are {known})"
                raise InputError(f"{path}: no array named {wanted}, {has}")
