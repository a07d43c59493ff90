"""Packets of a raw line and the record of its point, the twin of ``rtl/link/line_capture.sv``."""

from collections.abc import Iterator

import numpy as np

from vrscan.data import link_pkg, pkg
from vrscan.fixed.line_extent import LineExtent

LATENCY = 3  # clocks from the line's line_end_i to valid_o
BETWEEN = 2  # clocks without valid_o between two packets that are ready
WITH_RECORD, WITHOUT_RECORD = 0, 1  # status in the last packet
_LINES = 1 << pkg.LINE_NUMBER_WIDTH


def record_clks(line_length: int) -> int:
    """Return the longest wait for a record, in clocks: ``WaitClks``."""
    return line_length + pkg.RECORD_CLKS + pkg.NEIGHBOUR_CLKS


class LineCapture:
    """Clock-accurate capture. A new one is in the state after a reset.

    Args:
        line_length: Number of pixels of a good line, ``LineLength``.

    Attributes:
        valid: Whether there is a byte of a packet.
        data, last: The byte, and whether it is the packet's last; defined with ``valid``.
        capture_busy: Whether a capture is running.

    Raises:
        ValueError: if ``line_length`` is out of range.
    """

    def __init__(self, line_length: int = 2048) -> None:
        if line_length not in range(64, 255 * link_pkg.CAPTURE_CHUNK + 1):
            raise ValueError("line_capture: line_length must be 64 to 25500")
        self.valid = False
        self.data = 0
        self.last = False
        self.capture_busy = False

        self._line_length = line_length
        self._sequences = {link_pkg.STREAM_CAPTURE_PIXELS: 0, link_pkg.STREAM_CAPTURE_RECORD: 0}

        # The command, and the inputs of this clock that the work uses.
        self._mode = link_pkg.CAPTURE_STOP
        self._argument = 0
        self._idle = True
        self._stop = False
        self._command: tuple[int, int] | None = None
        self._starts = False
        self._ready = False

        # The lines.
        self._number = 0  # number of the next line
        self._extent = LineExtent(line_length)
        self._pixels: list[int] = []  # pixels of the incoming line
        self._armed = False
        self._chosen = False  # whether the incoming line is wanted, if it is good
        self._origin: int | None = None  # number of a line from which on every n-th is wanted
        self._line = 0  # number of the line to send
        self._taken: list[int] = []  # pixels of that line, in the clock in which it ends
        self._failed = False  # whether the wanted line failed, in the clock when this is known

        # The record.
        self._sending = False
        self._clks = 0
        self._coming: bytearray | None = None
        self._record: bytes | None = None
        self._late = False
        self._missing = False  # whether there is no record, a clock later
        self._work = self._working()

    def step(
        self,
        line_start: bool,
        line_end: bool,
        pixel_valid: bool,
        pixel: int,
        record_valid: bool,
        record_index: int,
        record: int,
        ready: bool,
        capture_start: bool,
        capture_mode: int,
        capture_argument: int,
    ) -> None:
        """Advance by one clock with these inputs."""
        awaits = self._sending and self._record is None and not self._missing
        stops = bool(capture_start) and capture_mode == link_pkg.CAPTURE_STOP
        self._command = (capture_mode, capture_argument) if capture_start and not stops else None
        self._starts, self._ready = bool(line_start), bool(ready)
        self._follow(line_start, line_end, pixel_valid, pixel)
        next(self._work)
        if awaits and self._sending:
            self._wait(record_valid, record_index, record)
        self._stop = (self._stop or stops) and not self._idle

    def _follow(self, start: bool, end: bool, valid: bool, pixel: int) -> None:
        """Follow the incoming line, and note whether the wanted one has ended or has failed."""
        one_line = self._armed and self._mode == link_pkg.CAPTURE_LINE
        self._taken, self._failed = [], False
        if start:
            self._failed = self._chosen and one_line
            self._chosen = self._armed and self._wanted()
            if self._chosen:
                self._line = self._number
            self._number = (self._number + 1) % _LINES
            self._pixels = []
        extent = self._extent.step(start, valid, end)
        if extent.index is not None:
            self._pixels.append(pixel)
        if extent.ends:
            if self._chosen and extent.good:
                self._taken = self._pixels
            elif self._chosen:
                self._failed = one_line
            self._chosen = False

    def _wanted(self) -> bool:
        """Return whether the line that starts is wanted."""
        if self._mode == link_pkg.CAPTURE_LINE:
            return self._number == self._argument
        if self._mode == link_pkg.CAPTURE_EVERY and self._origin is not None:
            return (self._number - self._origin) % _LINES % max(self._argument, 1) == 0
        return True

    def _wait(self, valid: bool, index: int, byte: int) -> None:
        """Wait for the line's record."""
        if self._late or self._clks == record_clks(self._line_length):
            self._missing = True
        self._clks += 1
        if not valid or (index and self._coming is None):
            return
        if self._coming is None:
            self._coming = bytearray(link_pkg.FULL_BYTES)
        self._coming[index] = byte
        if index == 3:
            ahead = (int.from_bytes(self._coming[:4], "little") - self._line) % _LINES
            self._late = 0 < ahead < _LINES // 2
        if index == link_pkg.FULL_BYTES - 1:
            if self._coming[:4] == self._line.to_bytes(4, "little"):
                self._record = bytes(self._coming)
            self._coming = None

    def _working(self) -> Iterator[None]:
        """Do the work, one clock after the other."""
        while True:
            self._idle, self.capture_busy = True, False
            while self._command is None:
                yield
            self._mode, self._argument = self._command
            yield
            self._idle, self.capture_busy = False, True
            yield from self._capture()
            self._armed = self._chosen = self._sending = False
            yield

    def _capture(self) -> Iterator[None]:
        """Run a capture up to its last clock."""
        while self._starts and not self._stop:
            yield
        if self._stop:
            return
        one_line = self._mode == link_pkg.CAPTURE_LINE
        past = one_line and (self._argument - self._number) % _LINES > _LINES // 2
        self._origin = None
        while True:
            self._armed, self._sending = True, False
            yield
            while not (self._taken or self._failed or past or self._stop):
                yield
            if self._stop:
                return
            self._armed = self._chosen = False
            self._record, self._coming = None, None
            self._clks, self._late, self._sending = 0, False, True
            self._missing = past or self._failed
            if self._missing:
                self._line = self._argument
            self._origin = self._line
            pixels = [] if self._missing else self._taken
            for chunk, first in enumerate(range(0, len(pixels), link_pkg.CAPTURE_CHUNK)):
                part = pixels[first : first + link_pkg.CAPTURE_CHUNK]
                yield
                if self._stop:
                    return
                body = np.array(part, "<u2").tobytes()
                yield from self._send(link_pkg.STREAM_CAPTURE_PIXELS, chunk, len(part), body)
                if self._stop:
                    return
            yield
            while not (self._record or self._missing or self._stop):
                yield
            if self._stop:
                return
            status = WITH_RECORD if self._record else WITHOUT_RECORD
            yield from self._send(link_pkg.STREAM_CAPTURE_RECORD, status, 0, self._record or b"")
            if self._stop or self._mode != link_pkg.CAPTURE_EVERY:
                return

    def _send(self, kind: int, first: int, second: int, body: bytes) -> Iterator[None]:
        """Send a packet, up to the clock in which its last byte is taken."""
        header = bytes([kind, self._sequences[kind], first, second])
        self._sequences[kind] = (self._sequences[kind] + 1) % 256
        left = header + self._line.to_bytes(4, "little") + body
        yield
        while not (self.valid and self._ready and not left):
            if not self.valid or self._ready:
                self.valid, self.data, left = True, left[0], left[1:]
                self.last = not left
            yield
        self.valid = False
