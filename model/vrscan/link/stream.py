"""Points and lines as they come, with an account of those that did not.

The thread that reads the port fills a stream, and the program that iterates over it empties it.
Data that come while it is full are discarded and counted.
"""

import threading
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from types import TracebackType
from typing import Self

import numpy as np

from vrscan.data import link_pkg, pkg, records
from vrscan.data.arrays import Pixels
from vrscan.data.records import Form, Records
from vrscan.link.protocol import Batch, CapturePixels, CaptureRecord
from vrscan.link.transport import LinkError

DEPTH = 1 << 20  # records that wait for the program
CAPTURE_DEPTH = 64  # lines that wait for the program
COMPACT = np.dtype([("line", "<u4"), *records.COMPACT.descr])
SPACE = np.dtype([("line", "<u4"), *records.SPACE.descr])
DTYPES = {Form.COMPACT: COMPACT, Form.FULL: records.FULL, Form.SPACE: SPACE}
LINES = 1 << pkg.LINE_NUMBER_WIDTH  # line numbers wrap here
DROPPED = 1 << 16  # the packer's count wraps here
PACKETS = 1 << 8


@dataclass
class Account:
    """The numbers of records that a stream has brought and has lost.

    Attributes:
        records: Number of records that came.
        packets: Number of packets that came.
        missing: Number of lines between two records, or before the first packet's, that should have
            had a record.
        dropped: Number of the missing points for which the board had no room.
        packets_lost: Number of packets that were lost on the way, by their sequence numbers.
        bad_frames: Number of frames with a wrong CRC or another fault.
        overflow: Number of records that came and were discarded because the program was too slow.
        restarts: Number of times that the line number went back.
        disordered: Number of records whose own line number is not that of their place in the
            packet.
    """

    records: int = 0
    packets: int = 0
    missing: int = 0
    dropped: int = 0
    packets_lost: int = 0
    bad_frames: int = 0
    overflow: int = 0
    restarts: int = 0
    disordered: int = 0

    @property
    def lost(self) -> int:
        """Return the least number of records that should have come and did not; 0 without loss."""
        known = self.missing + self.overflow
        return known or int(self.packets_lost > 0 or self.dropped > 0)

    def __str__(self) -> str:
        """Return the account as one line of text."""
        parts = [f"{self.records} points", f"{self.missing} lines missing"]
        parts.append(f"{self.dropped} dropped by the board")
        parts.append(f"{self.packets_lost} packets lost")
        parts.append(f"{self.bad_frames} bad frames")
        if self.overflow:
            parts.append(f"{self.overflow} thrown away by the host")
        if self.restarts:
            parts.append(f"{self.restarts} restarts of the line number")
        if self.disordered:
            parts.append(f"{self.disordered} out of order")
        return ", ".join(parts)


class _Stream:
    """What comes from the board for another thread.

    Args:
        check: Function that raises the error of a port that is gone.
    """

    def __init__(self, check: Callable[[], None]) -> None:
        self._check = check
        self._arrived = threading.Condition()
        self._running = False

    def wake(self) -> None:
        """Wake the thread that waits, because nothing will come."""
        with self._arrived:
            self._arrived.notify_all()

    def _gone(self) -> bool:
        try:
            self._check()
        except LinkError:
            return True
        return False


class PointStream(_Stream):
    """Points of every step-th line, from the board's start of the stream until its stop.

    Iterating yields the points that have come, as structured arrays: fields of ``records.FULL``, or
    of ``COMPACT`` or ``SPACE`` with the line's number in front. It ends when the stream is stopped.

    Args:
        form: Format of the records.
        step: Distance from the line of one record to that of the next.
        stop: Function that stops the board and waits until the last packet has come.
        bad_frames: Function that returns the number of bad frames so far.
        check: Function that raises the error of a port that is gone.
        depth: Largest number of records that wait.

    Attributes:
        account: The numbers of records that came and that did not.
    """

    def __init__(
        self,
        *,
        form: Form,
        step: int,
        stop: Callable[[], None],
        bad_frames: Callable[[], int],
        check: Callable[[], None],
        depth: int = DEPTH,
    ) -> None:
        super().__init__(check)
        self.account = Account()
        self.form = form
        self.step = step
        self._stop = stop
        self._bad_frames = bad_frames
        self._depth = depth
        self._waiting: deque[Records] = deque()
        self._waiting_records = 0  # number of records that wait
        self._stopped = False
        self._sequence = 0  # sequence number of the next packet
        self._line: int | None = None  # line of the next record
        self._dropped = 0  # the last packet's value
        self._bad_before = 0

    def begin(self) -> None:
        """Begin with an empty account: the next packet is the first."""
        with self._arrived:
            self.account = Account()
            self._waiting.clear()
            self._waiting_records = 0
            self._sequence, self._line, self._dropped = 0, None, 0
            self._bad_before = self._bad_frames()
            self._running = True

    def take(self, batch: Batch) -> None:
        """Take a packet; the reading thread calls this."""
        with self._arrived:
            if self._running and (batch.form, batch.step) == (self.form, self.step):
                self._enter(batch)
            self._arrived.notify_all()

    def _enter(self, batch: Batch) -> None:
        account, count = self.account, len(batch.records)
        account.packets += 1
        account.packets_lost += (batch.sequence - self._sequence) % PACKETS
        self._sequence = (batch.sequence + 1) % PACKETS
        account.dropped += (batch.dropped - self._dropped) % DROPPED
        self._dropped = batch.dropped
        if self._line is not None:
            ahead = (batch.first - self._line) % LINES
            if ahead < LINES // 2:
                account.missing += ahead // self.step
            else:
                account.restarts += 1
        self._line = (batch.first + count * self.step) % LINES
        lines = (batch.first + self.step * np.arange(count, dtype=np.int64)) % LINES
        if self.form is Form.FULL:
            found = batch.records
            account.disordered += int(np.count_nonzero(found["line"] != lines))
        else:
            found = np.zeros(count, DTYPES[self.form])
            found["line"] = lines
            for name in batch.records.dtype.names or ():
                found[name] = batch.records[name]
        account.records += count
        if self._waiting_records + count > self._depth:
            account.overflow += count
            return
        self._waiting.append(found)
        self._waiting_records += count

    def get(self, timeout: float | None = None) -> Records | None:
        """Return all points that wait, or the first that come within ``timeout`` s, or None.

        Raises:
            LinkError: if the port is gone.
        """
        with self._arrived:
            self._arrived.wait_for(lambda: self._waiting or self._stopped or self._gone(), timeout)
            found = list(self._waiting)
            self._waiting.clear()
            self._waiting_records = 0
            self.account.bad_frames = self._bad_frames() - self._bad_before
        if found:
            return np.concatenate(found)
        if not self._stopped:
            self._check()
        return None

    def stop(self) -> None:
        """Stop the board; points that have come until then can still be fetched."""
        if self._stopped:
            return
        try:
            self._stop()
        finally:
            with self._arrived:
                self._stopped = True
                self.account.bad_frames = self._bad_frames() - self._bad_before
                self._arrived.notify_all()

    def __iter__(self) -> Iterator[Records]:
        """Yield arrays of points until the stream is stopped and empty."""
        while True:
            found = self.get()
            if found is not None:
                yield found
            elif self._stopped:
                return

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        try:
            self.stop()
        except LinkError:
            if error is None:
                raise


@dataclass(frozen=True)
class Captured:
    """A raw line.

    Attributes:
        line: Number of the line.
        pixels: Pixels, uint16, counts.
        record: Its point, an array of one ``records.FULL``, or None where the line gave none.
    """

    line: int
    pixels: Pixels
    record: Records | None


@dataclass
class CaptureAccount:
    """The numbers of lines that captures have brought and lost.

    Attributes:
        lines: Number of whole lines.
        broken: Number of lines with a missing packet.
        overflow: Number of lines that the program did not fetch in time.
    """

    lines: int = 0
    broken: int = 0
    overflow: int = 0


class CaptureStream(_Stream):
    """Raw lines as they come.

    Args:
        line_length: Number of pixels of a line.
        check: Function that raises the error of a port that is gone.

    Attributes:
        account: The numbers of lines that came and that did not.
    """

    def __init__(self, line_length: int, check: Callable[[], None]) -> None:
        super().__init__(check)
        self.account = CaptureAccount()
        self._length = line_length
        self._line: int | None = None  # line whose pixels come
        self._pixels = np.zeros(line_length, np.uint16)
        self._filled = np.zeros(line_length, np.bool_)
        self._waiting: deque[Captured] = deque()

    def begin(self) -> None:
        """Discard what came: the next packet is the first of a line."""
        with self._arrived:
            self.account = CaptureAccount()
            self._waiting.clear()
            self._line = None
            self._running = True

    def take_pixels(self, chunk: CapturePixels) -> None:
        """Take pixels; the reading thread calls this."""
        with self._arrived:
            if not self._running:
                return
            if self._line != chunk.line:
                self._abandon()
                self._line = chunk.line
                self._filled[:] = False
            first = chunk.chunk * link_pkg.CAPTURE_CHUNK
            part = slice(first, first + len(chunk.pixels))
            if part.stop <= self._length:
                self._pixels[part] = chunk.pixels
                self._filled[part] = True

    def take_record(self, last: CaptureRecord) -> None:
        """Take the packet that ends a line; the reading thread calls this."""
        with self._arrived:
            if not self._running:
                return
            if self._line != last.line:
                self._abandon()
                self.account.broken += 1
            elif not self._filled.all():
                self._abandon()
            elif len(self._waiting) == CAPTURE_DEPTH:
                self.account.overflow += 1
            else:
                self.account.lines += 1
                record = None if last.record is None else np.array([last.record], records.FULL)
                self._waiting.append(Captured(last.line, self._pixels.copy(), record))
            self._line = None
            self._arrived.notify_all()

    def _abandon(self) -> None:
        """Discard the line whose end did not come."""
        if self._line is not None:
            self.account.broken += 1
            self._line = None
            self._arrived.notify_all()

    def get(self, timeout: float) -> Captured | None:
        """Return the next line, or None if none came within ``timeout`` s or one was broken.

        Raises:
            LinkError: if the port is gone.
        """
        with self._arrived:
            broken = self.account.broken
            self._arrived.wait_for(
                lambda: self._waiting or self.account.broken != broken or self._gone(), timeout
            )
            if self._waiting:
                return self._waiting.popleft()
        self._check()
        return None
