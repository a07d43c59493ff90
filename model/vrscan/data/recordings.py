"""Recordings: points, raw lines, index edges and the board's state in one MCAP file, as they come.

A file begins with its profile ``vrscan``, then the configuration and the correction maps. Rows
follow in chunks, each with a CRC of its own, so a file that was cut off is read up to there, and a
damaged chunk costs its own rows only. The schema of a channel is the layout of its rows, numpy's
``dtype.descr`` as JSON, so a reader of MCAP and numpy need nothing of this package.
"""

import contextlib
import hashlib
import io
import json
import os
import time
import warnings
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, fields, replace
from functools import cached_property, partial
from importlib import metadata
from pathlib import Path
from types import TracebackType
from typing import Any, BinaryIO, Self

import numpy as np
import numpy.typing as npt

from vrscan.data import contract, edges, pkg, records, table
from vrscan.data.arrays import Bools, Floats, Ints
from vrscan.data.config import Config, checked, load, parsed_toml, to_toml
from vrscan.data.contract import checked_flags, checked_power
from vrscan.data.errors import InputError, InputWarning, LinesError, unread
from vrscan.data.extras import named
from vrscan.data.lines import Lines, Truth, joined, part
from vrscan.data.points import check_writable, read_csv
from vrscan.data.points import table as in_units
from vrscan.data.ros import check_time
from vrscan.data.table import Table

Rows = npt.NDArray[np.void]
PROFILE, SUFFIX = "vrscan", ".mcap"
CHUNK_BYTES = 256 << 10  # at most so much is lost with a chunk, and one message
FLUSH_S = 0.1  # at most so much of what comes from outside is lost when a program dies
MOST_ROWS = {"lines": 64}  # rows of a message; 1,024 elsewhere
_MAGIC = b"\x89MCAP0\r\n"
_CLOCKS = 1 << 32  # a board's time wraps here
_EDGES = np.dtype([("time_s", "<f8"), ("comparator", "u1"), ("gate", "u1")])
_KINDS = {Ints: "<i8", Floats: "<f8"}
_POINTS = np.dtype(
    [(e.name, _KINDS.get(e.type, "?")) for e in fields(Table) if e.type in (*_KINDS, Bools)]
    + [("flags", "<u4")]
)
_TRUTH = ("x_mm", "z_mm", "position_px", "surface")


class Clock:
    """Times in s from a board's counter of 32 bits, block by block.

    It may wrap once between two records.
    """

    def __init__(self, clock_hz: int) -> None:
        self._hz, self._last, self._near = clock_hz, -1, -1

    def seconds(self, clocks: Ints) -> Floats:
        """Return the times of the next records [n]."""
        if not len(clocks):
            return np.zeros(0)
        found = clocks.astype(np.int64)
        first = found[0] if self._last < 0 else self._last + (found[0] - self._last) % _CLOCKS
        found = first + np.concatenate([[0], np.cumsum(np.diff(found) % _CLOCKS)])
        self._last = int(found[-1])
        return np.asarray(found / self._hz)

    def beside(self, clocks: Ints) -> Floats:
        """Return the times of moments less than half a turn of the counter off the last record.

        Before the first record they follow each other so.
        """
        last = self._near if self._last < 0 else self._last
        half = 0 if last < 0 else _CLOCKS // 2
        found = max(last, 0) + (clocks.astype(np.int64) - max(last, 0) + half) % _CLOCKS - half
        self._near = int(found[-1]) if len(found) else last
        return np.asarray(found / self._hz)


def full_table(found: records.Records, pixel_width: int, clock: Clock, unit_mm: int) -> Table:
    """Return full records in physical units, with their times and powers."""
    power = found["power"].astype(np.float64)
    points = in_units(records.points(found, pixel_width, unit_mm))
    return replace(points, power=power, time_s=clock.seconds(found["time"]))


class Writer:
    """A recording that is written as its data come.

    The file begins with the first data, or at the end of a context without an error, so what ends
    before leaves no file.

    Args:
        target: The file, or one that is open and stays so.
        config: The configuration with which all was measured.
        maps: Contents of its file of correction maps; None: what the configuration names.
        about: Facts on the origin: the scene or the board, for instance.
        flush_s: Seconds after which data are on the disk, for what comes from outside; None leaves
            it to the size of a chunk, so that the bytes depend on the data alone.
        packed: Whether chunks are compressed; without, raw lines are written at their full rate.

    Raises:
        InputError: if the file cannot be written, or the maps cannot be read.
        MissingError: if mcap is not installed.
    """

    def __init__(
        self,
        target: Path | BinaryIO,
        config: Config,
        maps: bytes | None = None,
        about: Mapping[str, str] | None = None,
        flush_s: float | None = None,
        *,
        packed: bool = True,
    ) -> None:
        with named():
            from mcap.writer import CompressionType
            from mcap.writer import Writer as Container
        if isinstance(target, Path):
            check_writable(target)
        if maps is None and config.map.file is not None:
            source = Path(config.source).parent / config.map.file
            try:
                maps = source.read_bytes()
            except OSError as error:
                raise InputError(f"{source}: {error.strerror}") from error
        self._target, self._maps = target, maps
        how = CompressionType.ZSTD if packed else CompressionType.NONE
        self._kind = partial(Container, chunk_size=CHUNK_BYTES, compression=how)
        self._config, self._about = to_toml(config), dict(about or {})
        self._flush_s, self._flushed = flush_s, time.monotonic()
        self._file: BinaryIO | None = None
        self._into: Any = None
        self._channels: dict[str, tuple[int, np.dtype[Any]]] = {}
        self._sent: dict[str, int] = {}
        self._clock: Clock | None = None

    def _begin(self) -> Any:
        if self._into is None:
            given = self._target
            self._file = given.open("wb") if isinstance(given, Path) else given
            self._into = self._kind(self._file)
            about = {"version": metadata.version("vrscan")} | self._about
            held = {"toml": self._config, "sha256": _sha(self._config.encode())}
            if self._maps is not None:
                held["maps_sha256"] = _sha(self._maps)
            self._into.start(PROFILE, f"vrscan {about['version']}")
            self._into.add_metadata("configuration", held)
            self._into.add_metadata("about", about)
            if self._maps is not None:
                self._into.add_attachment(0, 0, "maps.npz", "application/zip", self._maps)
            self._file.flush()
        return self._into

    def _channel(self, topic: str, kind: np.dtype[Any] | None, facts: dict[str, str]) -> int:
        """Return the channel of this name; its first rows decide on its layout."""
        into = self._begin()
        if topic not in self._channels:
            encoding, schema = "json", 0
            if kind is not None:
                encoding, text = "numpy", json.dumps(kind.descr)
                schema = into.register_schema(f"vrscan/{topic}", "numpy", text.encode())
            number = into.register_channel(topic, encoding, schema, facts)
            self._channels[topic] = number, kind or np.dtype("u1")
        number, first = self._channels[topic]
        if kind is not None and kind != first:
            raise ValueError(f"{topic}: {kind}, and {first} before")
        return number

    def _message(self, topic: str, number: int, time_s: float, data: bytes) -> None:
        stamp = 0
        if not np.isnan(time_s):
            check_time(time_s, time_s)
            stamp = round(1e9 * time_s)
        sequence = self._sent.get(topic, 0)
        self._sent[topic] = sequence + 1
        self._into.add_message(number, stamp, data, stamp, sequence)
        now = time.monotonic()
        if self._flush_s is not None and now - self._flushed >= self._flush_s:
            self._flushed = now
            self._into.flush()

    def _rows(self, topic: str, rows: Rows, time_s: Floats, facts: dict[str, str]) -> None:
        number, most = self._channel(topic, rows.dtype, facts), MOST_ROWS.get(topic, 1024)
        for start in range(0, len(rows), most):
            data = rows[start : start + most].tobytes()
            self._message(topic, number, float(time_s[start]), data)

    def points(self, found: Table) -> None:
        """Write points in physical units."""
        rows = np.zeros(len(found), _POINTS)
        for name in _POINTS.names or ():
            if name != "flags":
                rows[name] = getattr(found, name)
        rows["flags"] = table.flag_bits(found.flags, len(found))
        self._rows("points", rows, found.time_s, {"pixel_width": str(found.pixel_width)})

    def clock(self, clock_hz: int) -> Clock:
        """Return the clock by which the times of full records are counted."""
        self._clock = self._clock or Clock(clock_hz)
        return self._clock

    def records(
        self, found: records.Records, clock_hz: int, pixel_width: int, unit_mm: int
    ) -> None:
        """Write records of a board as they came: full ones, or short ones with their lines."""
        facts = {"clock_hz": clock_hz, "pixel_width": pixel_width, "unit_mm": unit_mm}
        told = {name: str(value) for name, value in facts.items()}
        if "time" not in (found.dtype.names or ()):
            self._rows("short_records", found, np.zeros(len(found)), told)
            return
        rows = np.ascontiguousarray(found, records.FULL)
        self._rows("records", rows, self.clock(clock_hz).seconds(rows["time"]), told)

    def lines(self, found: Lines) -> None:
        """Write raw lines, with their truth if they have one."""
        count, truth = len(found), found.truth
        columns: dict[str, tuple[str, Any]] = {
            "angle_rad": ("<f8", found.angle_rad),
            "power": ("<u2", checked_power(found.power, count)),
            "mirror_flags": ("u1", checked_flags(found.mirror_flags, count)),
            "time_s": ("<f8", np.broadcast_to(found.time_s, count)),
            "y_mm": ("<f8", np.broadcast_to(found.y_mm, count)),
        }
        if found.lens is not None:
            columns["lens"] = "<u2", found.lens
        if found.number is not None:
            columns["number"] = "<u4", found.number
        if truth is not None:
            for name in _TRUTH:
                kind = "<i8" if name == "surface" else "<f8"
                columns[f"true_{name}"] = kind, getattr(truth, name)
        kinds: list[Any] = [(name, kind) for name, (kind, _) in columns.items()]
        rows = np.zeros(count, [*kinds, ("pixels", "<u2", (found.lines.shape[1],))])
        for name, (_, column) in columns.items():
            rows[name] = column
        rows["pixels"] = found.lines
        facts = {} if truth is None else {"surfaces": json.dumps(truth.names)}
        self._rows("lines", rows, rows["time_s"], facts)

    def edges(self, time_s: Floats, comparator: Ints, gate: Ints) -> None:
        """Write edges of the index, as ``edges.read`` returns them."""
        rows = np.zeros(len(time_s), _EDGES)
        for name, column in zip(_EDGES.names or (), (time_s, comparator, gate), strict=True):
            rows[name] = column
        self._rows("edges", rows, time_s, {})

    def board(self, state: Mapping[str, object], time_s: float = 0.0) -> None:
        """Write what a board says of itself, a JSON object."""
        number = self._channel("board", None, {})
        self._message("board", number, time_s, json.dumps(state).encode())

    def note(self, name: str, facts: Mapping[str, object]) -> None:
        """Write facts that are known later, such as the account of a stream."""
        self._begin().add_metadata(name, {key: str(value) for key, value in facts.items()})

    def close(self) -> None:
        """Write the index of the file, with which it is complete."""
        self._begin().finish()
        self._end()

    def _end(self) -> None:
        if self._file is not None and isinstance(self._target, Path):
            self._file.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if kind is None or self._into is not None:  # what has come is a recording, too
            self.close()


@dataclass(frozen=True)
class Recording:
    """A recording that was read.

    Attributes:
        path: The file.
        config: The configuration in it; its maps are those of the recording.
        about: Facts on the origin.
        notes: Other facts by their name, as of ``Writer.note``.
        complete: Whether the file has its end.
        lost: Least number of messages, up to 64 lines or 1,024 rows of others each, that are
            damaged or missing among those that are there.
        rows: Number of rows in each channel.
    """

    path: Path
    config: Config
    about: Mapping[str, str]
    notes: Mapping[str, Mapping[str, str]]
    complete: bool
    lost: int
    rows: Mapping[str, int] = field(default_factory=dict)

    def point_blocks(self) -> Iterator[Table]:
        """Yield the points in the blocks of the file."""
        clock: Clock | None = None
        for topic, rows, facts in _messages(self.path):
            unit_mm = int(facts.get("unit_mm", 1))
            if topic == "records":
                clock = clock or Clock(int(facts["clock_hz"]))
                yield full_table(rows, int(facts["pixel_width"]), clock, unit_mm)
            elif topic == "short_records":
                short = records.short_points(rows, int(facts["pixel_width"]), unit_mm)
                yield in_units(short)
            elif topic == "points":
                yield _points_of(rows, int(facts["pixel_width"]))

    def line_blocks(self) -> Iterator[Lines]:
        """Yield the raw lines in the blocks of the file."""
        for topic, rows, facts in _messages(self.path):
            if topic == "lines":
                yield _lines_of(rows, facts)

    @cached_property
    def points(self) -> Table:
        """Return all points."""
        return Table.joined(list(self.point_blocks()) or [self._none("points")])

    @cached_property
    def lines(self) -> Lines:
        """Return all raw lines."""
        return joined(list(self.line_blocks()) or [self._none("raw lines")])

    @cached_property
    def edges(self) -> tuple[Floats, Ints, Ints]:
        """Return all edges of the index, as ``edges.read`` does."""
        parts = [rows for topic, rows, _ in _messages(self.path) if topic == "edges"]
        rows = np.concatenate(parts or [self._none("edges")])
        comparator, gate = (rows[name].astype(np.int64) for name in ("comparator", "gate"))
        return rows["time_s"], comparator, gate

    @cached_property
    def board(self) -> list[dict[str, Any]]:
        """Return what the board said of itself."""
        return [
            json.loads(bytes(rows)) for topic, rows, _ in _messages(self.path) if topic == "board"
        ]

    def _none(self, what: str) -> Any:
        raise InputError(f"{self.path}: no {what}")

    def told(self) -> str:
        """Return what is wrong with the file in one line, or an empty text."""
        faults = [] if self.complete else ["cut off before its end"]
        faults += [f"{self.lost} blocks damaged or missing"] if self.lost else []
        return f"{self.path}: {', '.join(faults)}; the rest is read" if faults else ""


def read(path: Path) -> Recording:
    """Return a recording; its rows are checked now and read when they are asked for.

    Raises:
        InputError: naming the file, if it cannot be read, is none of ours, or is damaged or cut off
            within its configuration.
        MissingError: if mcap is not installed.
    """
    walk = _Walk(path)
    rows: dict[str, int] = {}
    for topic, found, _ in walk.messages():
        rows[topic] = rows.get(topic, 0) + (1 if topic == "board" else len(found))
    notes = dict(walk.notes)
    held = notes.pop("configuration", {})
    text = held.get("toml", "")
    if _sha(text.encode()) != held.get("sha256"):
        raise InputError(f"{path}: damaged or cut off within its configuration")
    values = parsed_toml(text, f"{path}: its configuration")
    if "maps_sha256" in held:
        table = values.setdefault("map", {})
        if isinstance(table, dict):
            table["file"] = path.name
    config = checked(Config, values, str(path))
    config._source = str(path)
    about = notes.pop("about", {})
    return Recording(path, config, about, notes, walk.complete, walk.lost, rows)


def read_points(path: Path) -> Table:
    """Return the points of a recording or of a points.csv; faults of a recording are warned of.

    Raises:
        InputError: as ``read`` and ``points.read_csv``, or if there are none.
    """
    return told(read(path)).points if is_recording(path) else read_csv(path)


def read_edges(path: Path, columns: Mapping[str, str] | None = None) -> tuple[Floats, Ints, Ints]:
    """Return the edges of a recording or of a table; faults of a recording are warned of.

    Args:
        path: The file.
        columns: Names of a table's columns, as those of ``edges.read``.

    Raises:
        InputError: as ``read`` and ``edges.read``, or if there are none.
    """
    if not is_recording(path):
        return edges.read(path, columns)
    if columns:
        raise InputError(f"--columns: {path} is no table")
    return told(read(path)).edges


def read_config(path: Path, given: Path | None) -> Config:
    """Return the configuration that a user gave, else that of a recording, else the defaults."""
    return read(path).config if given is None and is_recording(path) else load(given)


def read_lines(path: Path, config: Config) -> tuple[int, Callable[[int], Iterator[Lines]]]:
    """Return the number of raw lines, and what yields them in blocks of a size; faults are told.

    Raises:
        InputError: as ``read``, if there are none, or from the blocks, if an engine refuses them.
    """
    found = told(read(path))
    if not found.rows.get("lines"):
        raise InputError(f"{path}: no raw lines")

    def good(parts: list[Lines], first: int) -> Lines:
        try:
            return contract.checked(joined(parts), config, first=first)
        except LinesError as error:
            raise LinesError(f"{path}: {error}") from None

    def blocks(size: int) -> Iterator[Lines]:
        first, held, parts = 0, 0, list[Lines]()
        for block in found.line_blocks():
            for start in range(0, len(block), size):
                some = part(block, slice(start, start + size))
                if held + len(some) > size:
                    yield good(parts, first)
                    first, held, parts = first + held, 0, []
                parts.append(some)
                held += len(some)
        yield good(parts, first)

    return found.rows["lines"], blocks


def told(found: Recording) -> Recording:
    """Return a recording after a warning of what is wrong with its file."""
    if found.told():
        warnings.warn(found.told(), InputWarning, stacklevel=3)
    return found


def is_recording(path: Path) -> bool:
    """Return whether a file has the ending of recordings."""
    return path.suffix.lower() == SUFFIX


def maps_file(path: Path) -> BinaryIO:
    """Return the file of maps that a recording holds.

    Raises:
        InputError: naming the recording, if there is none, or it is damaged.
    """
    walk = _Walk(path)
    for _ in walk.messages(rows=False):
        pass
    if _sha(walk.maps) != walk.notes.get("configuration", {}).get("maps_sha256"):
        raise InputError(f"{path}: no maps in it, or damaged ones")
    return io.BytesIO(walk.maps)


def _sha(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()


def _messages(path: Path) -> Iterator[tuple[str, Rows, Mapping[str, str]]]:
    return _Walk(path).messages()


class _Walk:
    """A way through a file from its begin to where it ends.

    Attributes:
        notes: Metadata by their names.
        maps: The maps, if there are.
        complete: Whether the file has its end.
        lost: Least number of messages that are damaged or missing.
    """

    def __init__(self, path: Path) -> None:
        with named():
            import mcap.reader
            import mcap.records
            import mcap.stream_reader
            from mcap.data_stream import ReadDataStream
            from mcap.opcode import Opcode

        self._path, self._opcodes = path, Opcode
        self.notes: dict[str, Mapping[str, str]] = {}
        self.maps = b""
        self.complete = False
        self.lost = 0
        self._kinds: dict[int, str] = {}
        self._channels: dict[int, Any] = {}
        self._parsed: Callable[[Any, bytes], Any] = lambda kind, body: kind.read(
            ReadDataStream(io.BytesIO(body))
        )
        self._library, self._broken = mcap, mcap.stream_reader.breakup_chunk

    def _frames(self, file: BinaryIO) -> Iterator[tuple[int, bytes]]:
        """Yield kind and content of each record, up to the end of the data or of what is whole."""
        size = os.fstat(file.fileno()).st_size
        while len(head := file.read(9)) == 9:
            length = int.from_bytes(head[1:], "little")
            if length > size - file.tell() or head[0] == self._opcodes.DATA_END:
                return
            yield head[0], file.read(length)

    def _index(self, file: BinaryIO) -> dict[int, int]:
        """Return the number of messages of each channel by the file's end; empty without one."""
        with contextlib.suppress(Exception):  # what a damaged end makes the library raise
            summary = self._library.reader.make_reader(file).get_summary()
            if summary is not None and summary.statistics is not None:
                self._channels.update(summary.channels)
                self._kinds.update({n: each.data.decode() for n, each in summary.schemas.items()})
                self.complete = True
                return dict(summary.statistics.channel_message_counts)
        return {}

    def messages(self, *, rows: bool = True) -> Iterator[tuple[str, Rows, Mapping[str, str]]]:
        """Yield channel, rows and facts of each message that is whole."""
        path, records_ = self._path, self._library.records
        damaged, gaps = 0, 0
        following: dict[int, int] = {}
        try:
            with path.open("rb") as file:
                promised = self._index(file)
                file.seek(0)
                self._check_head(file)
                for opcode, body in self._frames(file):
                    try:
                        if opcode == self._opcodes.METADATA:
                            note = self._parsed(records_.Metadata, body)
                            self.notes[note.name] = note.metadata
                        elif opcode == self._opcodes.ATTACHMENT:
                            self.maps = self._parsed(records_.Attachment, body).data
                        elif opcode == self._opcodes.CHUNK and rows:
                            chunk = self._parsed(records_.Chunk, body)
                            inside: list[Any] = [*self._broken(chunk, validate_crc=True)]
                        elif opcode not in set(self._opcodes):
                            damaged += 1
                    except Exception:  # the errors of three libraries
                        damaged += 1
                        continue
                    if opcode != self._opcodes.CHUNK or not rows:
                        continue
                    for each in inside:
                        if isinstance(each, records_.Schema):
                            self._kinds[each.id] = each.data.decode()
                        elif isinstance(each, records_.Channel):
                            self._channels[each.id] = each
                        elif each.channel_id not in self._channels:
                            damaged += 1
                        else:
                            number = each.channel_id
                            gaps += each.sequence - following.get(number, 0)
                            following[number] = each.sequence + 1
                            channel = self._channels[number]
                            kind = _kind(self._kinds.get(channel.schema_id))
                            yield channel.topic, np.frombuffer(each.data, kind), channel.metadata
        except OSError as error:
            raise InputError(f"{path}: {unread(error, path)}") from error
        gaps += sum(max(n - following.get(k, 0), 0) for k, n in promised.items())
        self.lost = max(damaged, gaps)

    def _check_head(self, file: BinaryIO) -> None:
        """Check the begin of the file, whose profile tells a recording from ROS messages."""
        if file.read(8) != _MAGIC:
            raise InputError(f"{self._path}: not a recording (no MCAP file)")
        profile = ""
        for opcode, body in self._frames(file):
            if opcode == self._opcodes.HEADER:
                with contextlib.suppress(Exception):
                    profile = self._parsed(self._library.records.Header, body).profile
            break
        if profile != PROFILE:
            raise InputError(f"{self._path}: not a recording (profile {profile!r})")


def _kind(text: str | None) -> np.dtype[Any]:
    """Return the layout of rows from their schema; bytes without one."""
    if text is None:
        return np.dtype("u1")
    return np.dtype([(each[0], each[1], *map(tuple, each[2:])) for each in json.loads(text)])


def _points_of(rows: Rows, pixel_width: int) -> Table:
    columns = {name: rows[name] for name in _POINTS.names or () if name != "flags"}
    flags = {name: (rows["flags"] >> bit & 1).astype(np.bool_) for name, bit in pkg.FLAGS.items()}
    return Table(flags=flags, pixel_width=pixel_width, **columns)


def _lines_of(rows: Rows, facts: Mapping[str, str]) -> Lines:
    names = rows.dtype.names or ()
    truth = None
    if "surfaces" in facts:
        columns = {name: rows[f"true_{name}"] for name in _TRUTH}
        truth = Truth(names=tuple(json.loads(facts["surfaces"])), **columns)
    return Lines(
        lines=rows["pixels"],
        angle_rad=rows["angle_rad"],
        power=rows["power"],
        truth=truth,
        mirror_flags=rows["mirror_flags"],
        time_s=rows["time_s"],
        y_mm=rows["y_mm"],
        lens=rows["lens"] if "lens" in names else None,
        number=rows["number"] if "number" in names else None,
    )
