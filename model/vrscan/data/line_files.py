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
from vrscan.data.csv_files import read_matrix, read_table, whole
from vrscan.data.errors import (
    InputError,
    InputWarning,
    LinesError,
    alike,
    listed,
    reading,
)
from vrscan.data.lines import Lines, joined, part

# What an .npz holds.
_ARRAYS = ("lines", "angle_rad", "power", "mirror_flags", "lens", "time_s", "y_mm")
_WHOLE = ("power", "mirror_flags", "lens")  # of these, what holds whole numbers
_TABLE = ".csv"
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
    with opened(path, config, angles) as recorded:
        return joined(list(recorded.blocks(recorded.count)))


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
def opened(
    path: Path,
    config: Config,
    angles: Path | None = None,
    called: Mapping[str, str] | None = None,
) -> Iterator[Recording]:
    """Open a file that ``read`` reads, to read and check its lines block by block.

    Only an array in Fortran order, of which no line is in one piece, and a logic analyser's table
    are read whole.

    Args:
        path: The file.
        config: The configuration, as in ``read``.
        angles: A file of angles, as in ``read``.
        called: Names of the columns of a logic analyser's table, as ``line_signals.read`` takes.

    Raises:
        InputError: as ``read``, here or from ``blocks``.
    """
    if recordings.is_recording(path):
        if angles is not None:
            raise InputError(f"{angles}: angles are in {path}, too")
        yield Recording(*recordings.read_lines(path, config))
        return
    with contextlib.ExitStack() as stack:
        columns = _columns(path, config, stack, called)
        more = _beside(path, angles, columns, columns["lines"].kind)
        columns |= {name: _Given(array) for name, array in more.items()}
        kinds = {name: column.kind for name, column in columns.items()}
        if kinds["lines"].dtype.kind in "iuf":  # the blocks' pixels are checked
            kinds["lines"] = np.broadcast_to(np.uint16(0), kinds["lines"].shape)
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
                with _reading(path):
                    arrays = {n: c.rows(rows.stop - start) for n, c in columns.items()}
                    if rows.stop == count:
                        for column in columns.values():
                            column.end()
                yield _checked(path, arrays, config, first=start)
            if "angle_rad" not in columns:  # warns only of a file that is good otherwise
                _warn(path)

        yield Recording(count, blocks)


def _members(path: Path, file: BinaryIO, stack: contextlib.ExitStack) -> dict[str, "_Source"]:
    """Return the arrays of a file that belong to a recording, open; see ``_load``."""
    start = file.read(2)
    file.seek(0)
    if start != b"PK":
        return {"lines": _Column(file, path.stat().st_size)}
    packed = stack.enter_context(zipfile.ZipFile(file))
    there = {each.filename.removesuffix(".npy"): each for each in packed.infolist()}
    _check_names(path, list(there))
    return {
        name: _Column(stack.enter_context(packed.open(there[name])), there[name].file_size)
        for name in _ARRAYS
        if name in there
    }


def _columns(
    path: Path,
    config: Config,
    stack: contextlib.ExitStack,
    called: Mapping[str, str] | None,
) -> dict[str, "_Source"]:
    """Return the arrays of a file, open to read them row by row."""
    suffix = path.suffix.lower()
    if path.is_dir() or suffix in line_pictures.SUFFIXES:
        pictures = line_pictures.Pictures(path, config.sensor.pixel_width)
        stack.callback(pictures.end)
        return {"lines": pictures}
    if suffix == _TABLE:
        matrix = read_matrix(path)
        if matrix is not None:
            return {"lines": _Given(matrix)}
        return {"lines": _Given(line_signals.read(path, config.sensor.line_length, called))}
    with _reading(path):
        file = stack.enter_context(path.open("rb"))
        if not file.peek(1):
            raise InputError(f"{path}: empty file (0 bytes)")
        return _members(path, file, stack)


def _beside(
    path: Path, angles: Path | None, there: Iterable[str], lines: npt.NDArray[Any]
) -> dict[str, npt.NDArray[Any]]:
    """Return what a file of angles has for the lines of another file."""
    if angles is None:
        return {}
    table = read_table(angles)
    wrong = [name for name in table.names if name not in _ARRAYS[1:]]
    if wrong or "angle_rad" not in table.names:
        raise InputError(
            f"{angles}: columns {listed(table.names)}, known are {','.join(_ARRAYS[1:])}"
        )
    table.need(table.names)
    both = sorted(set(table.names) & set(there))
    if both:
        raise InputError(f"{angles}: {both[0]} is in {path}, too")
    count = math.prod(lines.shape[:1])
    if len(table.rows) != count:
        raise InputError(f"{angles}: {len(table.rows)} rows for the {count} lines of {path}")
    return {name: table.column(name, whole if name in _WHOLE else float) for name in table.names}


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

    def __init__(self, file: IO[bytes], size: int) -> None:
        """Read the header of an array in a file of ``size`` bytes."""
        self._file = file
        version = np.lib.format.read_magic(file)
        if version == (1, 0):
            shape, fortran, dtype = np.lib.format.read_array_header_1_0(file)
        elif version in ((2, 0), (3, 0)):  # which differ in names of fields, of which it has none
            shape, fortran, dtype = np.lib.format.read_array_header_2_0(file)
        else:
            raise ValueError(f"its header has version {version}")
        if dtype.hasobject or dtype.names:
            raise ValueError("no array of plain numbers")
        there, wanted = size - file.tell(), math.prod(shape) * dtype.itemsize
        if there < wanted:
            raise ValueError(f"it ends too early: {there} bytes of {wanted:.15g} for {shape}")
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


def _reading(path: Path) -> contextlib.AbstractContextManager[None]:
    wrong = "not a .npy or .npz file of lines"
    return reading(path, wrong, ".npy", ".npz", recordings.SUFFIX)


def _load(path: Path) -> dict[str, npt.NDArray[Any]]:
    """Return the arrays of a file that belong to a recording; a bare array is ``lines``."""
    with _reading(path):
        loaded = np.load(path, allow_pickle=False)
        if isinstance(loaded, np.ndarray):
            return {"lines": loaded}
        with loaded:
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
