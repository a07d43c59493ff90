"""Decoding of a frame into a payload and a status, the twin of ``rtl/link/frame_decoder.sv``."""

from enum import IntEnum
from typing import NamedTuple

from vrscan.clocked.frame_encoder import CRC_INIT, crc_next

LATENCY = 2  # clocks from a byte to the byte that it releases, and from the 0x00 to done_o
CRC_BYTES = 2


class Status(IntEnum):
    """Outcome of a frame, ``status_o``."""

    OK = 0
    CRC = 1
    MALFORMED = 2
    TOO_LONG = 3
    TOO_SHORT = 4
    FRAMING = 5


class Event(NamedTuple):
    """The result of one byte: a byte of the payload, or the frame's status, or neither.

    Attributes:
        data: A byte of the payload.
        status: Status of the frame if it has ended.
    """

    data: int | None
    status: Status | None


_NOTHING = Event(None, None)


class FrameDecoder:
    """Clock-accurate decoder. A new one is in the state after a reset.

    ``take`` alone is the same without the clocks: what one byte after another lets go.

    Args:
        max_payload: Largest number of bytes of a payload, ``MaxPayload``.

    Attributes:
        valid: Whether ``data`` is a byte of the payload, which is good if the frame ends with OK.
        data: The byte; defined with ``valid``.
        done: Whether a frame has ended.
        status: Status of the frame; defined with ``done``.

    Raises:
        ValueError: if ``max_payload`` is out of range.
    """

    def __init__(self, max_payload: int = 1024) -> None:
        if max_payload not in range(1, 1 << 16):
            raise ValueError("frame_decoder: max_payload must be 1 to 65535")
        self.valid = False
        self.data = 0
        self.done = False
        self.status = Status.OK

        self._max_payload = max_payload
        self._waiting = _NOTHING
        self._begin()

    def _begin(self) -> None:
        """Set the state between two frames."""
        self._open = False
        self._framing = False
        self._remaining_bytes = 0  # remaining bytes of the block
        self._due = False  # whether the block before the next code ends in a zero
        self._count = 0  # bytes decoded
        self._crc = CRC_INIT
        self._newer = 0
        self._older = 0

    def step(self, valid: bool, data: int, error: bool) -> None:
        """Advance by one clock with these inputs."""
        event = self._waiting
        self._waiting = self.take(data, error) if valid else _NOTHING
        self.valid = event.data is not None
        if event.data is not None:
            self.data = event.data
        self.done = event.status is not None
        if event.status is not None:
            self.status = event.status

    def take(self, data: int, error: bool = False) -> Event:
        """Take a byte, ``error`` where it had no stop bit, and return its result."""
        if data == 0:
            if not self._open:
                return _NOTHING
            event = Event(None, self._verdict(error))
            self._begin()
            return event
        self._open = True
        self._framing = self._framing or bool(error)
        if self._remaining_bytes:
            self._remaining_bytes -= 1
            return self._decoded(data)
        due = self._due
        self._remaining_bytes = data - 1
        self._due = data != 255
        return self._decoded(0) if due else _NOTHING

    def _decoded(self, data: int) -> Event:
        """Pass a decoded byte through CRC and delay, and return the byte that leaves the delay."""
        index = self._count - CRC_BYTES  # index in the payload of the byte that leaves the delay
        out = self._older
        self._older, self._newer = self._newer, data
        self._count += 1
        self._crc = crc_next(self._crc, data)
        if 0 <= index < self._max_payload:
            return Event(out, None)
        return _NOTHING

    def _verdict(self, error: bool) -> Status:
        """Return the status of the frame that ends here."""
        if self._framing or error:
            return Status.FRAMING
        if self._remaining_bytes:
            return Status.MALFORMED
        if self._count > self._max_payload + CRC_BYTES:
            return Status.TOO_LONG
        if self._count <= CRC_BYTES:
            return Status.TOO_SHORT
        return Status.CRC if self._crc else Status.OK
