"""Packing of records of points into packets, the twin of ``rtl/points/point_packer.sv``."""

from collections import deque
from collections.abc import Iterator

from vrscan.data import link_pkg, pkg
from vrscan.data.records import (
    Form,
    Records,
    compact,
    decode_full,
    encode_compact,
    encode_full,
    encode_space,
    space,
)

# Largest number of records per packet, the bytes of each, and the packet's first byte.
_MOST = {Form.COMPACT: 28, Form.FULL: 3, Form.SPACE: 25}
_BYTES = {
    Form.COMPACT: link_pkg.COMPACT_BYTES,
    Form.FULL: link_pkg.FULL_BYTES,
    Form.SPACE: link_pkg.SPACE_BYTES,
}
KINDS = {
    Form.COMPACT: link_pkg.STREAM_POINTS_COMPACT,
    Form.FULL: link_pkg.STREAM_POINTS_FULL,
    Form.SPACE: link_pkg.STREAM_POINTS_SPACE,
}
SPACING = 160  # clocks between the first bytes of two records
_LINES = 1 << pkg.LINE_NUMBER_WIDTH


def record_bytes(form: int) -> int:
    """Return the number of bytes of a record of a ``Form``."""
    return _BYTES[Form(form)]


def most_records(form: int) -> int:
    """Return the number of records of the longest packet of a ``Form``."""
    return _MOST[Form(form)]


def _encoded(record: Records, form: Form) -> bytes:
    """Return one full record in a ``Form``."""
    if form is Form.FULL:
        return encode_full(record)
    return encode_space(space(record)) if form is Form.SPACE else encode_compact(compact(record))


def latency(form: int) -> int:
    """Return the clocks from the first byte of a batch's last record to ``valid_o``."""
    held = link_pkg.FULL_BYTES  # the whole record is there
    return held + 2 + record_bytes(form) + 2 + link_pkg.BATCH_HEADER_BYTES + 1


class PointPacker:
    """Clock-accurate packer. A new one is in the state after a reset.

    Args:
        buffer_bytes: Bytes of the ring, ``BufferBytes``.
        timeout_width: Bits of a batch's age, ``TimeoutWidth``.
        count_width: Bits of the counter of dropped records, ``CountWidth``.

    Attributes:
        valid: Whether there is a byte of a packet.
        data, last: The byte, and whether it is the packet's last; defined with ``valid``.
        points_dropped: Number of dropped records; stops at its largest value.

    Raises:
        ValueError: if ``buffer_bytes`` or ``count_width`` is out of range.
    """

    def __init__(
        self, buffer_bytes: int = 4096, timeout_width: int = 24, count_width: int = 16
    ) -> None:
        if buffer_bytes not in {1 << k for k in range(8, 17)}:
            raise ValueError("point_packer: buffer_bytes must be a power of two from 256 to 65536")
        if count_width not in range(2, 17):
            raise ValueError("point_packer: count_width must be 2 to 16")
        self.valid = False
        self.data = 0
        self.last = False
        self.points_dropped = 0

        self._buffer_bytes = buffer_bytes
        self._age_max = (1 << timeout_width) - 1
        self._count_max = (1 << count_width) - 1
        self._used = 0  # used bytes of the ring
        self._seen = deque([0, 0, 0], maxlen=3)  # this number in the last clocks
        self._packets: deque[bytes] = deque()
        self._leaving = b""  # remaining bytes of the packet that is being sent

        # The stream, and the command for the next stream: whether it runs, its format, and step.
        self._running = False
        self._form = Form.COMPACT
        self._step = 0
        self._command: tuple[bool, int, int] | None = None
        self._began = False  # whether the stream began in this clock
        self._sequence = 0
        self._base: int | None = None  # number of a line of the stream

        # Dropped records: all of them, those since the last kept one, and those of this clock.
        self._dropped = 0
        self._lost = 0
        self._drops = 0

        # The incoming record, and the complete one.
        self._coming: bytearray | None = None
        self._complete_record: bytes | None = None

        # The open batch, if it has records.
        self._records: list[bytes] = []
        self._first = 0
        self._expected = 0
        self._age = 0
        self._expired = False
        self._limit = 0
        self._complete = False
        self._work = self._working()

    def step(
        self,
        record_valid: bool,
        record_index: int,
        record: int,
        ready: bool,
        stream_start: bool,
        stream_stop: bool,
        stream_format: int,
        stream_step: int,
        points_batch: int,
        points_timeout_clks: int,
    ) -> None:
        """Advance by one clock with these inputs."""
        accepts = self._running and self._command is None
        held = self._complete_record is not None
        count, form, age = len(self._records), self._form, self._age
        drops, self._drops = self._drops, 0
        self._seen.append(self._used)
        self._age = min(age + 1, self._age_max)
        self._began = False

        if not self.valid or ready:
            self._give()
        next(self._work)
        if not self._began:
            self._dropped = (self._dropped + drops) & self._count_max
            self._lost = min(self._lost + drops, self._count_max)
        self.points_dropped = min(self.points_dropped + drops, self._count_max)

        self._complete = count >= self._limit
        self._limit = min(points_batch, most_records(form))
        self._expired = bool(count and points_timeout_clks and age >= points_timeout_clks)
        if record_valid:
            self._receive(record_index, record, accepts, held)
        if stream_start or stream_stop:
            self._command = (not stream_stop, stream_format, stream_step)

    def _give(self) -> None:
        """Output the next byte if a packet is ready."""
        if not self._leaving and self._packets:
            self._leaving = self._packets.popleft()
        self.valid = bool(self._leaving)
        if self.valid:
            self.data, self.last = self._leaving[0], len(self._leaving) == 1
            self._leaving = self._leaving[1:]
            self._used -= 1

    def _receive(self, index: int, byte: int, accepts: bool, held: bool) -> None:
        """Take a byte of a record."""
        if index == 0 and accepts:
            self._drops += held or self._coming is not None
            if not held and self._coming is None:
                self._coming = bytearray(link_pkg.FULL_BYTES)
        if self._coming is not None:
            self._coming[index] = byte
            if index == link_pkg.FULL_BYTES - 1:
                self._complete_record, self._coming = bytes(self._coming), None

    def _working(self) -> Iterator[None]:
        """Process records and batches, one clock after the other."""
        while True:
            if self._complete_record is not None:
                yield from self._sort(self._complete_record)
                self._complete_record = None
                yield
                continue
            between = self._command is not None and self._coming is None
            if self._records and (between or self._complete or self._expired):
                yield
                yield from self._close()
                continue
            if between:
                self._begin()
            yield

    def _sort(self, record: bytes) -> Iterator[None]:
        """Keep a record or drop it, up to its last clock."""
        line = int.from_bytes(record[:4], "little")
        base = line if self._base is None else self._base
        if (line - base) % _LINES % self._step:
            return
        self._base = line
        yield
        if self._records and line != self._expected:
            yield from self._close()
        size = record_bytes(self._form)
        if not self._records:
            longest = link_pkg.BATCH_HEADER_BYTES + most_records(self._form) * size
            if self._seen[0] + longest > self._buffer_bytes:
                self._drops += 1
                return
            self._first, self._age = line, 0
            self._used += link_pkg.BATCH_HEADER_BYTES
        kept = decode_full(record).copy()
        kept["lost"], self._lost = self._lost, 0
        kept["flags"][kept["lost"] != 0] |= 1 << pkg.FLAG_POINTS_LOST
        yield
        for _ in range(size - 1):
            self._used += 1
            yield
        self._used += 1
        self._expected = (line + self._step) % _LINES
        self._records.append(_encoded(kept, self._form))

    def _close(self) -> Iterator[None]:
        """Write the header of the open batch, and hand the packet to the reader."""
        dropped = 0
        for place in range(link_pkg.BATCH_HEADER_BYTES - 1):
            if place == link_pkg.BATCH_HEADER_BYTES - 2:
                dropped = self._dropped
            yield
        header = bytes([KINDS[self._form], self._sequence, len(self._records), self._step])
        header += self._first.to_bytes(4, "little") + dropped.to_bytes(2, "little")
        self._packets.append(header + b"".join(self._records))
        self._sequence = (self._sequence + 1) % 256
        self._records = []
        yield

    def _begin(self) -> None:
        """Execute the command that waits."""
        assert self._command is not None
        self._running, form, step = self._command
        self._command = None
        if self._running:
            self._form, self._step = Form(form), step
            self._began = True
            self._sequence = 0
            self._dropped = 0
            self._lost = 0
            self._base = None
