"""Frames and payloads of the serial protocol, as a host sends and reads them.

The functions convert between bytes and values only; the caller handles the port, its time and its
sequence numbers. docs/link.md defines the payloads.
"""

import binascii
import struct
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from vrscan.clocked.frame_decoder import CRC_BYTES
from vrscan.clocked.frame_decoder import Status as FrameStatus
from vrscan.clocked.frame_encoder import CRC_INIT
from vrscan.clocked.point_packer import KINDS, record_bytes
from vrscan.data import link_pkg, records
from vrscan.data.arrays import Pixels
from vrscan.data.records import Records

_BLOCK = 254  # bytes without a zero that one code can count
_MOST = link_pkg.MAX_PAYLOAD + CRC_BYTES
_MOST_CODED = _MOST + -(-_MOST // _BLOCK)  # longest frame without its 0x00

_DECODED = {
    records.Form.COMPACT: records.decode_compact,
    records.Form.FULL: records.decode_full,
    records.Form.SPACE: records.decode_space,
}
_BATCH = struct.Struct("<BBBBIH")
_PIXELS = struct.Struct("<BBBBI")
_RECORD = struct.Struct("<BBBBI")


class Command(IntEnum):
    """The first byte of a command."""

    PING = link_pkg.COMMAND_PING
    READ = link_pkg.COMMAND_READ
    WRITE = link_pkg.COMMAND_WRITE
    STREAM_START = link_pkg.COMMAND_STREAM_START
    STREAM_STOP = link_pkg.COMMAND_STREAM_STOP
    CAPTURE = link_pkg.COMMAND_CAPTURE


class Status(IntEnum):
    """The status of a reply."""

    OK = link_pkg.STATUS_OK
    UNKNOWN_COMMAND = link_pkg.STATUS_UNKNOWN_COMMAND
    BAD_LENGTH = link_pkg.STATUS_BAD_LENGTH
    NO_ADDRESS = link_pkg.STATUS_NO_ADDRESS
    READ_ONLY = link_pkg.STATUS_READ_ONLY
    LOCKED = link_pkg.STATUS_LOCKED
    BAD_VALUE = link_pkg.STATUS_BAD_VALUE
    BUSY = link_pkg.STATUS_BUSY
    BAD_FRAME = link_pkg.STATUS_BAD_FRAME


class CaptureMode(IntEnum):
    """The mode of a CAPTURE."""

    STOP = link_pkg.CAPTURE_STOP
    NEXT = link_pkg.CAPTURE_NEXT
    LINE = link_pkg.CAPTURE_LINE
    EVERY = link_pkg.CAPTURE_EVERY


COMMANDS = {int(command): command.name for command in Command}
BAD_FRAME = link_pkg.REPLY_BIT | link_pkg.COMMAND_NONE  # first byte of the reply to a bad frame


# ---- frames ----


def encode_frame(payload: bytes) -> bytes:
    """Return the frame of a payload, with its 0x00 at the end.

    Raises:
        ValueError: if it is empty or too long.
    """
    if not 1 <= len(payload) <= link_pkg.MAX_PAYLOAD:
        raise ValueError(f"a payload has 1 to {link_pkg.MAX_PAYLOAD} bytes, not {len(payload)}")
    data = payload + binascii.crc_hqx(payload, CRC_INIT).to_bytes(CRC_BYTES, "big")
    coded = bytearray()
    pieces = data.split(b"\0")
    for number, piece in enumerate(pieces, 1):
        blocks = [piece[k : k + _BLOCK] for k in range(0, len(piece), _BLOCK)] or [b""]
        for block in blocks:
            coded.append(len(block) + 1)
            coded += block
        if len(blocks[-1]) == _BLOCK and number < len(pieces):
            coded.append(1)  # a full block is not followed by a zero
    coded.append(0)
    return bytes(coded)


def decode_frame(coded: bytes) -> tuple[FrameStatus, bytes]:
    """Return the status of a frame, and its payload if it is good.

    Args:
        coded: The frame without its 0x00; not empty.
    """
    if len(coded) > _MOST_CODED:
        return FrameStatus.TOO_LONG, b""
    data = bytearray()
    at = 0
    while at < len(coded):
        code = coded[at]
        data += coded[at + 1 : at + code]
        at += code
        if code <= _BLOCK and at < len(coded):
            data.append(0)
    if at > len(coded):
        return FrameStatus.MALFORMED, b""
    if len(data) > _MOST:
        return FrameStatus.TOO_LONG, b""
    if len(data) <= CRC_BYTES:
        return FrameStatus.TOO_SHORT, b""
    if binascii.crc_hqx(data, CRC_INIT):
        return FrameStatus.CRC, b""
    return FrameStatus.OK, bytes(data[:-CRC_BYTES])


class FrameReader:
    """Decoder that takes bytes as they come and returns the payloads of good frames.

    After a bad frame it continues behind the next 0x00.

    Attributes:
        good: Number of good frames.
        bad: Number of bad frames, by the name of their fault.
    """

    def __init__(self) -> None:
        self.good = 0
        self.bad: Counter[str] = Counter()
        self._open = bytearray()  # bytes since the last 0x00; at most one too many

    def feed(self, data: bytes) -> list[bytes]:
        """Take any number of bytes, and return the payloads of the good frames that end in them."""
        *ends, rest = data.split(b"\0")
        payloads = []
        for end in ends:
            coded = bytes(self._open) + end
            self._open.clear()
            if not coded:
                continue
            status, payload = decode_frame(coded)
            if status == FrameStatus.OK:
                self.good += 1
                payloads.append(payload)
            else:
                self.bad[status.name.lower()] += 1
        self._open += rest[: _MOST_CODED + 1 - len(self._open)]
        return payloads

    def reset(self) -> None:
        """Discard the bytes since the last 0x00."""
        self._open.clear()


# ---- commands ----


def command(operation: int, sequence: int, data: bytes = b"") -> bytes:
    """Return the payload of a command.

    Args:
        operation: One of ``Command``.
        sequence: Sequence number, u8; the reply returns it.
        data: Data from ``read``, ``write``, ``stream_start`` or ``capture``.
    """
    return bytes([operation, sequence]) + data


def read(address: int, count: int) -> bytes:
    """Return the data of a READ of ``count`` words that begin at an address."""
    _check_words(address, count)
    return struct.pack("<HB", address, count)


def write(address: int, words: Sequence[int]) -> bytes:
    """Return the data of a WRITE of words that begin at an address."""
    _check_words(address, len(words))
    return struct.pack(f"<H{len(words)}I", address, *words)


def _check_words(address: int, count: int) -> None:
    if not 1 <= count <= link_pkg.MAX_WORDS:
        raise ValueError(f"a command takes 1 to {link_pkg.MAX_WORDS} words, not {count}")
    if address not in range(1 << link_pkg.ADDRESS_WIDTH):
        raise ValueError(f"there is no address {address:#x}")


def stream_start(form: int, step: int) -> bytes:
    """Return the data of a STREAM_START: records of a ``Form``, of every ``step``-th line."""
    if step not in range(1, 256):
        raise ValueError(f"a stream takes every 1st to 255th line, not every {step}th")
    return bytes([form, step])


def capture(mode: int, argument: int = 0) -> bytes:
    """Return the data of a CAPTURE.

    Args:
        mode: One of ``CaptureMode``.
        argument: Number of the line for LINE, the n for EVERY; u32.
    """
    mode = CaptureMode(mode)
    if argument not in range(1 << 32) or (mode == CaptureMode.EVERY and argument == 0):
        raise ValueError(f"capture {mode.name} does not take {argument}")
    return struct.pack("<BI", mode, argument)


# ---- replies ----


@dataclass(frozen=True)
class Reply:
    """The reply to a command, or to a bad frame.

    Attributes:
        operation: First byte of the command; ``link_pkg.COMMAND_NONE`` for a bad frame.
        sequence: Sequence number of the command.
        status: Status of the command.
        data: Data after the status.
    """

    operation: int
    sequence: int
    status: Status
    data: bytes


@dataclass(frozen=True)
class Words:
    """The reply to a READ or a WRITE.

    Attributes:
        status: Status of the command.
        words: Words that were read, or read back; none where the status is not OK.
        address: Address of the first word that was refused, None if none was.
    """

    status: Status
    words: tuple[int, ...]
    address: int | None


def reply(payload: bytes) -> Reply:
    """Return a payload as a reply.

    Raises:
        ValueError: if it is not a reply.
    """
    if len(payload) < 3 or not payload[0] & link_pkg.REPLY_BIT:
        raise ValueError("no reply")
    operation = payload[0] ^ link_pkg.REPLY_BIT
    return Reply(operation, payload[1], Status(payload[2]), payload[3:])


def words(payload: bytes) -> Words:
    """Return a payload as a reply to a READ or a WRITE.

    Raises:
        ValueError: if it is not such a reply.
    """
    found = reply(payload)
    status, data = found.status, found.data
    if not data and status != Status.OK:
        return Words(status, (), None)
    if status != Status.OK and len(data) == 3 and data[0] == 0:
        return Words(status, (), int.from_bytes(data[1:], "little"))
    if status == Status.OK and data and len(data) == 1 + 4 * data[0]:
        return Words(status, struct.unpack(f"<{data[0]}I", data[1:]), None)
    raise ValueError("no reply to a READ or a WRITE")


# ---- streams ----


@dataclass(frozen=True)
class Batch:
    """A packet of points.

    Attributes:
        sequence: Sequence number among the packets of points, u8.
        form: Format of the records.
        step: Distance from the line of one record to that of the next.
        first: Line of the first record, u32.
        dropped: Number of points for which the board had no room so far, u16.
        records: An array of ``records.FULL``, ``records.COMPACT`` or ``records.SPACE``.
    """

    sequence: int
    form: records.Form
    step: int
    first: int
    dropped: int
    records: Records


@dataclass(frozen=True)
class CapturePixels:
    """A packet of a raw line.

    Attributes:
        sequence: Sequence number among the packets of pixels, u8.
        chunk: Number of the packet; its pixels begin with number
            ``link_pkg.CAPTURE_CHUNK * chunk``.
        line: Number of the line, u32.
        pixels: Pixels, uint16, counts.
    """

    sequence: int
    chunk: int
    line: int
    pixels: Pixels


@dataclass(frozen=True)
class CaptureRecord:
    """The packet that ends a raw line.

    Attributes:
        sequence: Sequence number among these packets, u8.
        line: Number of the line, u32.
        record: One ``records.FULL``, None where the line gave no point.
    """

    sequence: int
    line: int
    record: Records | None


def points(payload: bytes) -> Batch:
    """Return a payload as a packet of points.

    Raises:
        ValueError: if it is not such a packet.
    """
    if len(payload) < _BATCH.size or payload[0] not in KINDS.values():
        raise ValueError("no packet of points")
    kind, sequence, count, step, first, dropped = _BATCH.unpack_from(payload)
    form = next(each for each, number in KINDS.items() if number == kind)
    data = payload[_BATCH.size :]
    if len(data) != count * record_bytes(form):
        raise ValueError(f"a packet of {count} points has {len(data)} bytes of them")
    return Batch(sequence, form, step, first, dropped, _DECODED[form](data))


def capture_pixels(payload: bytes) -> CapturePixels:
    """Return a payload as pixels of a raw line.

    Raises:
        ValueError: if it is not such a packet.
    """
    if len(payload) < _PIXELS.size or payload[0] != link_pkg.STREAM_CAPTURE_PIXELS:
        raise ValueError("no pixels")
    _, sequence, chunk, count, line = _PIXELS.unpack_from(payload)
    if len(payload) != _PIXELS.size + 2 * count:
        raise ValueError(f"{count} pixels in {len(payload) - _PIXELS.size} bytes")
    return CapturePixels(sequence, chunk, line, np.frombuffer(payload, "<u2", offset=_PIXELS.size))


def capture_record(payload: bytes) -> CaptureRecord:
    """Return a payload as the end of a raw line.

    Raises:
        ValueError: if it is not such a packet.
    """
    if len(payload) < _RECORD.size or payload[0] != link_pkg.STREAM_CAPTURE_RECORD:
        raise ValueError("no end of a raw line")
    _, sequence, absent, _, line = _RECORD.unpack_from(payload)
    data = payload[_RECORD.size :]
    if absent not in (0, 1) or len(data) != link_pkg.FULL_BYTES * (1 - absent):
        raise ValueError("the record of a raw line is not whole")
    return CaptureRecord(sequence, line, None if absent else records.decode_full(data)[0])
