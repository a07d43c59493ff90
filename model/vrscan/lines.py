"""Sensor lines: the type that every engine reads, and the reader of recorded ones."""

import contextlib
import math
import shutil
import tempfile
import warnings
import zipfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import IO, Any, BinaryIO

import numpy as np
import numpy.typing as npt

from vrscan.arrays import Bools, Floats, Ints, Pixels
from vrscan.config import Config
from vrscan.errors import InputError

ANGLE_LIMIT_RAD = np.pi
MIRROR_FLAGS_ALL = 7  # three bits
_WANTED = ("lines", "angle_rad", "power", "mirror_flags")  # arrays of a file


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
    _check_kinds(path, arrays, config)
    return _checked(path, arrays, config)


@dataclass(frozen=True)
class Recording:
    """Recorded lines that are read a block at a time.

    Attributes:
        count: Lines.
        blocks: Returns an iterator over all lines, so many at a time; to be called once.
    """

    count: int
    blocks: Callable[[int], Iterator[Lines]]


@contextlib.contextmanager
def opened(path: Path, config: Config) -> Iterator[Recording]:
    """Open what ``read`` reads, for blocks of lines that are checked as they are read.

    Only an array in Fortran order, of which no line is in one piece, is read whole.

    Args:
        path: The file.
        config: As for ``read``.

    Raises:
        InputError: as ``read``, here or from ``blocks``.
    """
    with contextlib.ExitStack() as stack:
        with _told(path):
            file = stack.enter_context(path.open("rb"))
            if not file.peek(1):
                raise InputError(f"{path}: empty file (0 bytes)")
            columns = {name: _Column(each) for name, each in _members(file, stack).items()}
        kinds = {name: column.kind for name, column in columns.items()}
        _check_kinds(path, kinds, config)
        count = len(kinds["lines"])

        def blocks(size: int) -> Iterator[Lines]:
            whole = None if columns["lines"].in_order else read(path, config)
            for start in range(0, count, size):
                rows = slice(start, min(start + size, count))
                if whole is not None:
                    yield part(whole, rows)
                    continue
                with _told(path):
                    read_rows = {n: c.rows(rows.stop - start) for n, c in columns.items()}
                    if rows.stop == count:
                        for column in columns.values():
                            column.end()
                yield _checked(path, read_rows, config, start)

        yield Recording(count, blocks)


@contextlib.contextmanager
def archive(
    file: BinaryIO, count: int, length: int, names: tuple[str, ...], folder: Path | None = None
) -> Iterator[Callable[[Lines], None]]:
    """Begin an ``.npz`` that ``read`` reads; yields a function that takes lines and their truth.

    Args:
        file: A binary file. Beside what ``read`` takes it gets ``true_x_mm``, ``true_z_mm``,
            ``true_position_px`` and ``surface`` [n], and ``surface_names``.
        count: Lines, in all.
        length: Pixels of a line.
        names: Of the surfaces.
        folder: Where the columns wait, in files without a name, until the lines are there; the
            system's for temporary files if None.
    """
    types = {"angle_rad": "<f8", "power": "<u2", "true_x_mm": "<f8", "true_z_mm": "<f8"}
    types |= {"true_position_px": "<f8", "surface": "<i8"}
    with contextlib.ExitStack() as stack:
        packed = stack.enter_context(zipfile.ZipFile(file, "w"))
        waiting = {name: stack.enter_context(tempfile.TemporaryFile(dir=folder)) for name in types}
        with _member(packed, "lines", "<u2", (count, length)) as pixels:

            def write(recording: Lines) -> None:
                truth = recording.truth
                if truth is None:
                    raise ValueError("archive: lines without truth")
                pixels.write(np.ascontiguousarray(recording.lines, "<u2").data)
                columns = (
                    recording.angle_rad,
                    recording.power,
                    truth.x_mm,
                    truth.z_mm,
                    truth.position_px,
                    truth.surface,
                )
                for (name, kind), column in zip(types.items(), columns, strict=True):
                    waiting[name].write(np.ascontiguousarray(column, kind).data)

            yield write
        for name, kind in types.items():
            with _member(packed, name, kind, (count,)) as member:
                waiting[name].seek(0)
                shutil.copyfileobj(waiting[name], member)
        words = np.array(names)
        with _member(packed, "surface_names", words.dtype.str, words.shape) as member:
            member.write(words.tobytes())


def _member(
    packed: zipfile.ZipFile, name: str, kind: str, shape: tuple[int, ...]
) -> contextlib.AbstractContextManager[IO[bytes]]:
    """Begin an array of an ``.npz``."""
    member = packed.open(f"{name}.npy", "w", force_zip64=True)
    header = {"descr": kind, "fortran_order": False, "shape": shape}
    np.lib.format.write_array_header_1_0(member, header)
    return member


def part(recording: Lines, rows: slice | Bools) -> Lines:
    """Return some of the lines, with their truth if they have one."""
    truth, raised = recording.truth, recording.mirror_flags
    if truth is not None:
        truth = Truth(
            x_mm=truth.x_mm[rows],
            z_mm=truth.z_mm[rows],
            position_px=truth.position_px[rows],
            surface=truth.surface[rows],
            names=truth.names,
        )
    return Lines(
        lines=recording.lines[rows],
        angle_rad=recording.angle_rad[rows],
        power=recording.power[rows],
        truth=truth,
        mirror_flags=raised if isinstance(raised, int) else raised[rows],
    )


def bare(recording: Lines) -> Lines:
    """Return the lines without their pixels: of length 0."""
    return replace(recording, lines=np.empty((len(recording), 0), np.uint16))


def joined(parts: Sequence[Lines]) -> Lines:
    """Return all lines of ``parts``, at least one; with truth if the first have it."""
    truths = [each.truth for each in parts if each.truth is not None]
    truth = None
    if parts[0].truth is not None:
        truth = Truth(
            x_mm=np.concatenate([each.x_mm for each in truths]),
            z_mm=np.concatenate([each.z_mm for each in truths]),
            position_px=np.concatenate([each.position_px for each in truths]),
            surface=np.concatenate([each.surface for each in truths]),
            names=truths[0].names,
        )
    return Lines(
        lines=np.concatenate([each.lines for each in parts]),
        angle_rad=np.concatenate([each.angle_rad for each in parts]),
        power=np.concatenate([each.power for each in parts]),
        truth=truth,
        mirror_flags=np.concatenate(
            [np.broadcast_to(np.asarray(each.mirror_flags), len(each)) for each in parts]
        ),
    )


def _members(file: BinaryIO, stack: contextlib.ExitStack) -> dict[str, IO[bytes]]:
    """Return the arrays of a file that a recording may hold, as files; see ``_load``."""
    start = file.read(2)
    file.seek(0)
    if start != b"PK":
        return {"lines": file}
    packed = stack.enter_context(zipfile.ZipFile(file))
    there = {name.removesuffix(".npy"): name for name in packed.namelist()}
    return {
        name: stack.enter_context(packed.open(there[name])) for name in _WANTED if name in there
    }


class _Column:
    """An array in a file, whose rows are read one after the other.

    Attributes:
        kind: An array of its type and shape, whose values are nothing.
        in_order: Whether rows lie one after the other.
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
        self.kind = np.broadcast_to(np.zeros((), dtype), shape)
        self.in_order = not fortran or len(shape) < 2

    def rows(self, count: int) -> npt.NDArray[Any]:
        """Return the next rows."""
        shape = (count, *self.kind.shape[1:])
        size = math.prod(shape) * self.kind.itemsize
        data = self._file.read(size)
        if len(data) < size:
            raise ValueError("it ends too early")
        return np.frombuffer(data, self.kind.dtype).reshape(shape)

    def end(self) -> None:
        """Read what is left: the checksum of an archive's array is compared at its end."""
        while self._file.read(1 << 20):
            pass


@contextlib.contextmanager
def _told(path: Path) -> Iterator[None]:
    """Turn what reading a file raises into an ``InputError``."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # numpy's doubts about a damaged header
            yield
    except InputError:
        raise
    except OSError as error:
        raise InputError(f"{path}: {error.strerror or 'cannot read'}") from error
    except Exception as error:  # a damaged file makes numpy, zipfile, zlib and tokenize raise
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        if "pickle" in reason:  # numpy's way to say that it knows neither format nor type
            reason = "no array of plain numbers"
        raise InputError(f"{path}: not a .npy or .npz file of lines ({reason})") from error


def _load(path: Path) -> dict[str, npt.NDArray[Any]]:
    """Return the arrays of a file that a recording may hold; a bare array is ``lines``."""
    with _told(path), path.open("rb") as file:
        if not file.peek(1):
            raise InputError(f"{path}: empty file (0 bytes)")
        loaded = np.load(file, allow_pickle=False)
        if isinstance(loaded, np.ndarray):
            return {"lines": loaded}
        with loaded:
            return {name: loaded[name] for name in _WANTED if name in loaded.files}


def _check_kinds(path: Path, arrays: Mapping[str, npt.NDArray[Any]], config: Config) -> None:
    """Check types and shapes; no value is looked at."""
    if "lines" not in arrays:
        raise InputError(f"{path}: no array named lines (has {', '.join(arrays) or 'none'})")
    lines, length = arrays["lines"], config.sensor.line_length
    if lines.dtype.kind != "u" or lines.dtype.itemsize != 2:
        raise InputError(f"{path}: lines must be uint16 (are {lines.dtype})")
    if lines.ndim != 2 or lines.shape[1] != length:
        raise InputError(f"{path}: lines must have shape [n, {length}] (have {lines.shape})")
    if len(lines) == 0:
        raise InputError(f"{path}: no lines (shape {lines.shape})")
    for name, kind in (("angle_rad", "f"), ("power", "u"), ("mirror_flags", "u")):
        if name in arrays:
            _check_column(path, name, arrays[name], len(lines), kind)


def _checked(
    path: Path, arrays: Mapping[str, npt.NDArray[Any]], config: Config, first: int = 0
) -> Lines:
    """Return lines of the right types and shapes, their values checked; ``first`` is a number."""
    lines = arrays["lines"]
    count = len(lines)
    full = 2**config.sensor.pixel_width - 1
    largest = int(lines.max())
    if largest > full:
        row, pixel = np.unravel_index(int(lines.argmax()), lines.shape)
        place = f"line {first + row}, pixel {pixel}"
        raise InputError(f"{path}: pixel above {full} ({largest} at {place})")
    angle = arrays.get("angle_rad", np.zeros(count))
    bad = np.flatnonzero(~(np.abs(angle) <= ANGLE_LIMIT_RAD))  # NaN compares false
    if len(bad):
        place = f"{angle[bad[0]]:g} at line {first + bad[0]}"
        raise InputError(f"{path}: angle_rad outside -pi to pi ({place})")
    power = arrays.get("power", np.full(count, config.laser.power_max, np.uint16))
    raised = arrays.get("mirror_flags", np.zeros(count, np.uint8))
    for name, column, limit in (
        ("power", power, config.laser.power_max),
        ("mirror_flags", raised, MIRROR_FLAGS_ALL),
    ):
        bad = np.flatnonzero(column > limit)
        if len(bad):
            place = f"{column[bad[0]]} at line {first + bad[0]}"
            raise InputError(f"{path}: {name} above {limit} ({place})")
    return Lines(
        lines=np.ascontiguousarray(lines, np.uint16),
        angle_rad=angle.astype(np.float64),
        power=power.astype(np.int64),
        mirror_flags=raised.astype(np.int64),
    )


def _check_column(path: Path, name: str, column: npt.NDArray[Any], count: int, kind: str) -> None:
    if column.dtype.kind != kind:
        wanted = {"f": "floating point", "u": "unsigned integers"}[kind]
        raise InputError(f"{path}: {name} must be {wanted} (is {column.dtype})")
    if column.shape != (count,):
        raise InputError(f"{path}: {name} must have shape ({count},) (has {column.shape})")
