"""Points: the results of RTL and fixed model for each line as raw words, and the files of points.

The files are written from a ``Table``, which the float engine fills too, so all three engines write
one format.
"""

import contextlib
import errno
import math
import os
import secrets
import shutil
import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import BinaryIO

import numpy as np

from vrscan.data import pkg
from vrscan.data.arrays import Bools, Floats, Ints, all_rows, some_rows
from vrscan.data.csv_files import read_table
from vrscan.data.errors import InputError, nearest, shown
from vrscan.data.table import Table, flag_bits, flag_texts

COLUMNS = (
    "line,peak,flags,left,right,maximum,row_mean,row_variance,background,noise,snr,"
    "position_px,sigma_px,doubt_px,angle_rad,x_mm,z_mm,sigma_z_mm,c_obj,c_sfm,"
    "free_from_mm,free_to_mm,y_mm,time_s,power,intensity"
)
_ADDED = ("y_mm", "time_s", "power", "intensity")  # columns that older files lack
_PLAIN = (  # columns of numbers that are empty where they are not known
    *("row_mean", "row_variance", "background", "noise", "snr", "angle_rad", "c_obj", "c_sfm"),
    *("time_s", "power"),
)
_DISK_ERRORS = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO, errno.EROFS)
_VERTEX = np.dtype(
    [(name, "<f4") for name in ("x", "y", "z", "sigma_z", "confidence")]
    + [("line", "<u4"), ("flags", "<u4"), ("time", "<f8"), ("power", "<f4"), ("intensity", "<f4")]
)
_PLY_KINDS = {"<f4": "float", "<f8": "double", "<u4": "uint"}
NO_PLACE = 1 << pkg.FLAG_NO_RANGE | 1 << pkg.FLAG_OUT_OF_RANGE  # flags of what has no x and z
_FORMATS = ("pixel_width", "unit_mm")  # of all points
SIGMA_MOST = (2**pkg.SIGMA_WIDTH - 1) * 2.0**-pkg.SIGMA_FRACTION  # px, or units of length
_CONFIDENCE_ONE = 2**pkg.CONFIDENCE_WIDTH - 1


def _decimals(fraction_bits: int) -> int:
    """Return the number of decimals from which a fixed-point number is read back exactly."""
    return int(np.ceil(fraction_bits * np.log10(2.0)))


@dataclass(frozen=True)
class Points:
    """One point for each line, as integers in the raw formats of ``vrscan_pkg``; all arrays [n].

    Attributes:
        line: Number of the line.
        flags: Bits of ``pkg.FLAGS``.
        left: First pixel of the window, px.
        right: Last pixel of the window, px.
        width: Number of pixels of the window; ``left`` and ``right`` mean nothing where it is 0.
        maximum: Largest pixel, counts.
        row_mean: Mean of the row, counts, u24, 24 - PixelWidth fraction bits; background and noise
            have the same format.
        row_variance: Variance of the row, counts squared, u32, 32 - 2 PixelWidth fraction bits.
        background: Mean of the background, or of the row with ROW_STATISTICS, counts.
        noise: Standard deviation of the background, or of the row with ROW_STATISTICS, counts.
        snr: Signal-to-noise ratio, u16, 8 fraction bits.
        position: Position of the peak, px, signed, 12 fraction bits.
        sigma: Standard deviation of the position, px, u16, 12 fraction bits.
        doubt: What the lines beside it add to sigma, in squares, px, in the same format.
        angle: Scan angle, fraction of a turn, s24.
        x: x of the point, s24, 12 fraction bits of a unit of length.
        z: z of the point, in the format of ``x``.
        sigma_z: Standard deviation of z, u16, 12 fraction bits.
        c_obj: Confidence in an object (9), u8, 255 is 1.0.
        c_sfm: Confidence in free space (10), u8, 255 is 1.0.
        free_from: Least z of the part of the beam that is free, u16, 4 fraction bits.
        free_to: Largest z of that part, in the same format; both 0 where nothing is free.
        measured: Whether the line has a position.
        pixel_width: Bits of a pixel.
        unit_mm: Unit of every length, mm.
    """

    line: Ints
    flags: Ints
    left: Ints
    right: Ints
    width: Ints
    maximum: Ints
    row_mean: Ints
    row_variance: Ints
    background: Ints
    noise: Ints
    snr: Ints
    position: Ints
    sigma: Ints
    doubt: Ints
    angle: Ints
    x: Ints
    z: Ints
    sigma_z: Ints
    c_obj: Ints
    c_sfm: Ints
    free_from: Ints
    free_to: Ints
    measured: Bools
    pixel_width: int = 12
    unit_mm: int = 1

    def __len__(self) -> int:
        """Return the number of points."""
        return len(self.line)

    def of(self, rows: slice) -> "Points":
        """Return some of the points."""
        return some_rows(self, rows, shared=_FORMATS)

    @classmethod
    def concatenate(cls, parts: Sequence["Points"]) -> "Points":
        """Return the points of one or more parts, all of the same formats, in order."""
        return all_rows(parts, shared=_FORMATS)


def points_equal(first: Points, second: Points) -> str | None:
    """Return None if both are the same in every field, else one line about the first difference."""
    if len(first) != len(second):
        return f"{len(first)} points, want {len(second)}"
    for name in _FORMATS:
        if getattr(first, name) != getattr(second, name):
            return f"{name} is {getattr(first, name)}, want {getattr(second, name)}"
    for field in fields(Points):
        if field.name in _FORMATS:
            continue
        got, want = getattr(first, field.name), getattr(second, field.name)
        wrong = np.flatnonzero(np.asarray(got, np.int64) != np.asarray(want, np.int64))
        if len(wrong):
            row = wrong[0]
            return f"row {row}: {field.name} is {got[row]}, want {want[row]} ({len(wrong)} differ)"
    return None


def table(points: Points) -> Table:
    """Return integer points in physical units; exact but for the angle's factor of 2 pi.

    Args:
        points: n points.

    Returns:
        A table of n rows. Rows with NO_RANGE or OUT_OF_RANGE are measured but not located: their x
        and z are placeholders. Time and power are not known, and y is 0.
    """
    flags = {name: (points.flags >> bit & 1).astype(np.bool_) for name, bit in pkg.FLAGS.items()}
    count = pkg.COUNT_WIDTH - points.pixel_width
    measured = points.measured.astype(np.bool_)
    return Table(
        line=points.line,
        flags=flags,
        left=points.left,
        right=points.right,
        width=points.width,
        maximum=points.maximum,
        row_mean=_scaled(points.row_mean, count),
        row_variance=_scaled(points.row_variance, pkg.VARIANCE_WIDTH - 2 * points.pixel_width),
        background=_scaled(points.background, count),
        noise=_scaled(points.noise, count),
        snr=_scaled(points.snr, pkg.SNR_FRACTION),
        position_px=_scaled(points.position, pkg.POSITION_FRACTION),
        sigma_px=_scaled(points.sigma, pkg.SIGMA_FRACTION),
        doubt_px=_scaled(points.doubt, pkg.SIGMA_FRACTION),
        angle_rad=_scaled(points.angle, pkg.ANGLE_WIDTH) * (2.0 * np.pi),
        x_mm=_scaled(points.x, pkg.LENGTH_FRACTION) * points.unit_mm,
        z_mm=_scaled(points.z, pkg.LENGTH_FRACTION) * points.unit_mm,
        sigma_z_mm=_scaled(points.sigma_z, pkg.SIGMA_FRACTION) * points.unit_mm,
        c_obj=points.c_obj.astype(np.float64) / _CONFIDENCE_ONE,
        c_sfm=points.c_sfm.astype(np.float64) / _CONFIDENCE_ONE,
        free_from_mm=_scaled(points.free_from, pkg.FREE_FRACTION) * points.unit_mm,
        free_to_mm=_scaled(points.free_to, pkg.FREE_FRACTION) * points.unit_mm,
        measured=measured,
        located=measured & (points.flags & NO_PLACE == 0),
        y_mm=np.zeros(len(points)),
        time_s=np.full(len(points), np.nan),
        power=np.full(len(points), np.nan),
        pixel_width=points.pixel_width,
    )


def _scaled(words: Ints, fraction_bits: int) -> Floats:
    """Return fixed-point words as numbers."""
    return words.astype(np.float64) * 2.0**-fraction_bits


@contextlib.contextmanager
def atomic_file(path: Path) -> Iterator[BinaryIO]:
    """Open a file that appears under its name only when everything is written.

    Args:
        path: The file; its folder must exist. An existing regular file is replaced at the end.

    Yields:
        A binary file in the same folder under a temporary name, removed on any failure.

    Raises:
        InputError: if the folder is missing or unwritable, or ``path`` is no regular file.
    """
    temporary = _beside(path)
    try:
        with _created(temporary, path) as file:
            yield file
        os.replace(temporary, path)
    except OSError as error:
        if error.errno not in _DISK_ERRORS:  # an error of the caller's block, not of this file
            raise
        raise InputError(f"{path}: cannot write ({error.strerror})") from error
    finally:
        with contextlib.suppress(OSError):
            temporary.unlink()


def check_writable(path: Path) -> None:
    """Check that ``atomic_file`` could open a file, before the work whose result goes there.

    Raises:
        InputError: as ``atomic_file``.
    """
    temporary = _beside(path)
    try:
        _created(temporary, path).close()
    finally:
        with contextlib.suppress(OSError):
            temporary.unlink()


def _beside(path: Path) -> Path:
    """Return the name of a file that does not exist yet, in the folder of another file."""
    if path.exists() and not path.is_file():
        raise InputError(f"{path}: not a regular file")
    if not path.parent.is_dir():
        raise InputError(f"{path}: no such folder ({path.parent})")
    return path.with_name(f".{path.name}.{secrets.token_hex(8)}")


def unfinished(folder: Path) -> Iterator[Path]:
    """Return the temporary files of a folder, left where a signal came before their guard stood."""
    return folder.glob(".*." + 16 * "[0-9a-f]")


def _created(temporary: Path, path: Path) -> BinaryIO:
    """Return a new file that will replace ``path``."""
    try:
        return temporary.open("xb")
    except OSError as error:
        raise InputError(f"{path}: cannot write ({error.strerror})") from error


def write_csv(result: Table, file: BinaryIO) -> None:
    """Write points.csv: the columns ``COLUMNS``, and ``csv_rows``.

    Args:
        result: The points.
        file: A binary file.
    """
    with csv_file(file) as write:
        write(csv_rows(result))


@contextlib.contextmanager
def csv_file(file: BinaryIO) -> Iterator[Callable[[bytes], object]]:
    """Begin a points.csv; yield a function that takes ``csv_rows`` of points, in their order."""
    file.write(f"{COLUMNS}\n".encode())
    yield file.write


def csv_rows(result: Table) -> bytes:
    """Return the rows of points.csv, one for each peak, in the columns ``COLUMNS``.

    Every fixed-point number has just the decimals from which its word is read back. Fields without
    meaning are empty: left and right without a window, position, sigma and doubt without a valid
    peak, x, z and sigma_z of a point without a place, free_from and free_to where nothing is known
    to be free, time and power where they are not known, intensity without a peak of known power.

    Args:
        result: The points.
    """
    # The numbers of the float engine are limited to the range of the formats.
    count = f"%.{_decimals(pkg.COUNT_WIDTH - result.pixel_width)}f"
    variance = f"%.{_decimals(pkg.VARIANCE_WIDTH - 2 * result.pixel_width)}f"
    snr, angle = f"%.{_decimals(pkg.SNR_FRACTION)}f", f"%.{_decimals(pkg.ANGLE_WIDTH - 3)}f"
    position, length = _decimals(pkg.POSITION_FRACTION), _decimals(pkg.LENGTH_FRACTION)
    sigma, free = f"%.{_decimals(pkg.SIGMA_FRACTION)}f", pkg.FREE_FRACTION  # exact
    statistics = f"%d,{count},{variance},{count},{count},{snr}"

    def text(form: str, rows: Bools, *columns: Ints | Floats) -> list[str]:
        """Return a text for each row: the columns in ``form`` in ``rows``, commas elsewhere."""
        texts = ["," * form.count(",")] * len(result)
        chosen = np.flatnonzero(rows)
        values = zip(*(column[chosen].tolist() for column in columns), strict=True)
        for row, value in zip(chosen.tolist(), values, strict=True):
            texts[row] = form % value
        return texts

    everywhere = np.ones(len(result), np.bool_)
    snr_limit = (2**pkg.SNR_WIDTH - 1) * 2.0**-pkg.SNR_FRACTION
    columns = (
        text("%d,0", everywhere, result.line),
        flag_texts(result.flags, len(result)),
        text("%d,%d", result.width > 0, result.left, result.right),
        text(
            statistics,
            everywhere,
            result.maximum,
            result.row_mean,
            result.row_variance,
            result.background,
            result.noise,
            np.minimum(result.snr, snr_limit),
        ),
        text(
            f"%.{position}f,{sigma},{sigma}",
            result.measured,
            result.position_px,
            np.minimum(result.sigma_px, SIGMA_MOST),
            np.minimum(result.doubt_px, SIGMA_MOST),
        ),
        text(angle, everywhere, result.angle_rad),
        text(
            f"%.{length}f,%.{length}f,{sigma}",
            result.located,
            result.x_mm,
            result.z_mm,
            result.sigma_z_mm,
        ),
        text("%.3f,%.3f", everywhere, result.c_obj, result.c_sfm),
        text(
            f"%.{free}f,%.{free}f",
            result.free_to_mm > 0.0,
            result.free_from_mm,
            result.free_to_mm,
        ),
        text("%.4f", everywhere, result.y_mm + 0.0),  # no -0
        text("%.9f", np.isfinite(result.time_s), result.time_s),
        text("%d", np.isfinite(result.power), result.power),
        text("%.3f", np.isfinite(result.intensity), result.intensity),
    )
    rows = map(",".join, zip(*columns, strict=True))
    return "".join(f"{row}\n" for row in rows).encode()


def read_csv(path: Path) -> Table:
    """Return the points of a points.csv.

    Args:
        path: A file with the columns ``COLUMNS``, in any order; an older one may lack those from
            y_mm on.

    Returns:
        A table of n rows, n at least 1, of which ``write_csv`` makes the same file, but for the
        last digit of intensity, which follows from the rounded counts.

    Raises:
        InputError: naming the file, and the line if one is wrong, if it is missing, has no row or
            lacks a column, a number is none, or a flag is not known.
    """
    table = read_table(path, "a table of points")
    lacking = [name for name in COLUMNS.split(",") if name not in (*table.names, *_ADDED)]
    if lacking:
        raise InputError(f"{path}: no column {lacking[0]}: not a points.csv with full points")
    rows = table.rows
    if not rows:
        raise InputError(f"{path}: no points")
    texts = dict(zip(table.names, zip(*rows, strict=True), strict=True))
    empty = ("",) * len(rows)

    def numbers(name: str, otherwise: float = math.nan) -> Floats:
        """Return a column as numbers; an empty field has a number of its own."""
        column = texts.get(name, empty)
        with contextlib.suppress(ValueError):
            found = np.array([float(text) if text else otherwise for text in column])
            if np.isfinite(found).sum() >= len(column) - column.count(""):
                return found
        for number, text in zip(table.line, column, strict=True):
            with contextlib.suppress(ValueError):
                if math.isfinite(float(text or "0")):
                    continue
            raise InputError(f"{path}: line {number}: {name} {shown(text)} is no number")
        raise AssertionError(name)

    def whole(name: str) -> Ints:
        return numbers(name, 0.0).astype(np.int64)

    kinds = {kind: set(kind.split("|")) - {""} for kind in set(texts["flags"])}
    for kind, names in kinds.items():
        for name in sorted(names - set(pkg.FLAGS)):
            number = table.line[texts["flags"].index(kind)]
            raise InputError(
                f"{path}: line {number}: no such flag: {shown(name)}{nearest(name, pkg.FLAGS)}"
            )
    places = {name: numbers(name, 0.0) for name in ("position_px", "x_mm", "z_mm")}
    fractions = [len(texts[name][0].partition(".")[2]) for name in ("row_mean", "row_variance")]
    widths = [width for width in range(8, 17) if fractions == _fractions(width)]
    window = np.array([text != "" for text in texts["left"]])
    left, right = whole("left"), whole("right")
    return Table(
        line=whole("line"),
        flags={name: np.array([name in kinds[k] for k in texts["flags"]]) for name in pkg.FLAGS},
        left=left,
        right=right,
        width=np.where(window, np.maximum(right - left + 1, 1), 0),
        maximum=whole("maximum"),
        sigma_px=numbers("sigma_px", 0.0),
        doubt_px=numbers("doubt_px", 0.0),
        sigma_z_mm=numbers("sigma_z_mm", 0.0),
        free_from_mm=numbers("free_from_mm", 0.0),
        free_to_mm=numbers("free_to_mm", 0.0),
        measured=np.array([text != "" for text in texts["position_px"]]),
        located=np.array([text != "" for text in texts["z_mm"]]),
        y_mm=numbers("y_mm", 0.0),
        pixel_width=widths[0] if widths else 12,
        **places,
        **{name: numbers(name) for name in _PLAIN},
    )


def _fractions(pixel_width: int) -> list[int]:
    """Return the decimals of row_mean and row_variance, which tell the width of a pixel."""
    return [
        _decimals(pkg.COUNT_WIDTH - pixel_width),
        _decimals(pkg.VARIANCE_WIDTH - 2 * pixel_width),
    ]


def widened(kind: "np.dtype[np.void]") -> "np.dtype[np.void]":
    """Return a kind of row whose x, y and z are of double precision."""
    return np.dtype([(n, "<f8" if n in ("x", "y", "z") else kind[n]) for n in kind.names or ()])


@contextlib.contextmanager
def ply_file(
    file: BinaryIO, folder: Path | None = None, *, double: bool = False
) -> Iterator[Callable[[bytes], object]]:
    """Begin a PLY cloud; yield a function that takes ``ply_vertices``, in their order.

    Args:
        file: A binary file.
        double: Whether x, y and z have double precision.
        folder: Folder of the unnamed file that holds the vertices until their number, which the
            header needs, is known; the system's folder for temporary files if None.
    """
    kind = widened(_VERTEX) if double else _VERTEX
    with tempfile.TemporaryFile(dir=folder) as vertices:
        yield vertices.write
        header = [
            "ply",
            "format binary_little_endian 1.0",
            "comment x, y, z and sigma_z in mm, y of the scanner; time in s; intensity in counts",
            "comment flags by bit: " + " ".join(f"{b}={name}" for name, b in pkg.FLAGS.items()),
            f"element vertex {vertices.tell() // kind.itemsize}",
            *(f"property {_PLY_KINDS[kind[name].str]} {name}" for name in kind.names or ()),
            "end_header",
        ]
        file.write(("\n".join(header) + "\n").encode("ascii"))
        vertices.seek(0)
        shutil.copyfileobj(vertices, file)


def ply_vertices(result: Table, places_mm: Floats | None = None, *, double: bool = False) -> bytes:
    """Return the located points as vertices of a PLY cloud.

    Args:
        result: The points.
        places_mm: x, y and z of each row instead of its own [n, 3].
        double: Whether x, y and z have double precision.

    Returns:
        For each point x, y, z and sigma_z in mm, the confidence 0 to 1, the number of the line, the
        flag bits of ``vrscan_pkg``, the time in s, the laser's power and the intensity, NaN where
        one is not known. y is that of the scanner, and so of the scan plane.
    """
    rows = np.flatnonzero(result.located)
    vertices = np.zeros(len(rows), widened(_VERTEX) if double else _VERTEX)
    if places_mm is None:
        places_mm = result.places_mm
    for name, column in zip("xyz", places_mm[rows].T, strict=True):
        vertices[name] = column
    vertices["time"] = result.time_s[rows]
    vertices["power"], vertices["intensity"] = result.power[rows], result.intensity[rows]
    vertices["sigma_z"], vertices["confidence"] = result.sigma_z_mm[rows], result.c_obj[rows]
    vertices["line"] = result.line[rows]
    vertices["flags"] = flag_bits(result.flags, len(result))[rows]
    return vertices.tobytes()
