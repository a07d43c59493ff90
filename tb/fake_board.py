"""A board made of the twins, on a pty: real frames, real registers, and a line that can be bad.

Commands are executed by the twin. Frames and packets are put together here as docs/link.md has them
and not by ``vrscan.link``, which is what reads them.
"""

import contextlib
import os
import pty
import random
import select
import struct
import termios
import threading
import time
import tty
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from frame_oracle import frame

from vrscan.clocked.command_executor import Access, Answer, Outcome, bad_frame, execute
from vrscan.clocked.frame_decoder import FrameDecoder, Status
from vrscan.clocked.point_packer import most_records
from vrscan.clocked.register_file import RegisterFile
from vrscan.data import link_pkg, records
from vrscan.data.arrays import Pixels
from vrscan.data.records import Records

CLOCK_HZ = 100_000_000
LINE_LENGTH = 1024
MOST_DUE = 100.0  # lines that are made at once, where the machine is busy

# Packets and records, byte by byte.
POINTS, PIXELS, LAST = 0x40, 0x48, 0x49
CHUNK = 100  # pixels
FULL_RECORD = struct.Struct("<I4H4I2H4i2H2BH2BHI")
FIELDS = (
    "line", "flags", "left", "right", "maximum", "row_mean", "row_variance", "background", "noise",
    "snr", "sigma", "position", "angle", "x", "z", "sigma_z", "power", "c_obj", "c_sfm", "doubt",
    "confidence", "bits", "lost", "time",
)  # fmt: skip
GATHERED = {1: 0x0047, 2: 0x0008, 3: 0x0010, 4: 0x0020, 5: 0x0600, 6: 0xE000, 7: 0x1800}
NO_PLACE = 0x0600  # NO_RANGE, OUT_OF_RANGE


def full_bytes(record: np.void) -> bytes:
    """Return a full record's 64 bytes."""
    return FULL_RECORD.pack(*(int(record[name]) for name in FIELDS))


def compact_bytes(record: np.void) -> bytes:
    """Return a compact record's 8 bytes."""
    flags = int(record["flags"])
    bits = int(record["bits"]) & 1 if not flags & NO_PLACE else 0
    bits |= sum(1 << bit for bit, mask in GATHERED.items() if flags & mask)
    bits |= (int(record["bits"]) >> 3 & 1) << 4  # MIXED counts as a rival
    place = (int(record[name]).to_bytes(3, "little", signed=True) for name in ("x", "z"))
    return b"".join(place) + bytes([record["c_obj"], bits])


def space_bytes(record: np.void) -> bytes:
    """Return the 9 bytes of a point or a free beam."""
    data = compact_bytes(record)
    if not data[7] & 1:
        ends = [int(record[name]) >> 8 & 0xFFFF for name in ("x", "z")]
        angle = int(record["angle"]) >> 8 & 0xFFFF
        data = struct.pack("<3HBB", angle, *ends, int(record["c_sfm"]), data[7])
    return data + bytes([int(record["bits"]) >> 1 << 7 & 0x80 | int(record["confidence"]) >> 1])


ENCODED = (compact_bytes, full_bytes, space_bytes)


@dataclass
class Faults:
    """What the line does to bytes, either way.

    Attributes:
        drop: Share of bytes that are lost.
        flip: Share of bytes with a bit that is wrong.
        delay_s: Until a reply goes out.
        silent: Nothing goes out.
        lose_replies: So many of the next replies are lost.
    """

    drop: float = 0.0
    flip: float = 0.0
    delay_s: float = 0.0
    silent: bool = False
    lose_replies: int = 0


class FakeBoard:
    """A board behind a link to a pty, in a thread of its own, until ``close``.

    Args:
        path: The link, the port's name.
        map_hash: To be another board.
        seed: Of the faults.

    Attributes:
        faults: Of the line.
        file: The registers.
        lines_per_s: While lines run and their records are given.
        clocks: Says how many have passed since the reset.
        executed: How often a command of each first byte was.
        sent_points, sent_lines: Points and raw lines in the packets that it has sent.
        room: Packets that may wait; points beyond are dropped.
        silent_lines: Lines that give no record.
    """

    def __init__(self, path: Path, *, map_hash: int | None = None, seed: int = 1) -> None:
        self.path = path
        self.faults = Faults()
        self.file = RegisterFile()
        self.lines_per_s = 2000.0
        self.executed: dict[int, int] = {}
        self.sent_points = self.sent_lines = 0
        self.room = 100
        self.silent_lines: set[int] = set()
        self._map_hash = map_hash
        self._random = random.Random(seed)
        self._stop = threading.Event()
        self._master = self._slave = -1
        start = time.monotonic()
        self.clocks: Callable[[], int] = lambda: int((time.monotonic() - start) * CLOCK_HZ)
        self._decoder = FrameDecoder(256)
        self._payload = bytearray()
        self._line = 1000  # the next one
        self._due = 0.0  # lines that have not been made yet
        self._streaming: tuple[int, int] | None = None
        self._sequence = self._dropped = 0
        self._batch: list[np.void] = []
        self._capture: tuple[int, int] | None = None
        self._capture_sequence = {PIXELS: 0, LAST: 0}
        self._packets: deque[bytes] = deque()
        self.pixels: Pixels = np.zeros((1, LINE_LENGTH), np.uint16)
        self.made: Records = np.zeros(1, records.FULL)  # of the lines, again and again
        self.timed = False  # records have the time of the counter, not what was made
        self.test = False  # lines are the test's
        self._inputs()
        self.plug()
        self._thread = threading.Thread(target=self._work, daemon=True)
        self._thread.start()

    def __enter__(self) -> "FakeBoard":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End it."""
        self._stop.set()
        self._thread.join()
        self.unplug()

    # ---- the port ----

    def plug(self) -> None:
        """Make the port."""
        self._master, self._slave = pty.openpty()
        tty.setraw(self._slave)
        os.set_blocking(self._master, False)
        with contextlib.suppress(FileNotFoundError):
            self.path.unlink()
        self.path.symlink_to(os.ttyname(self._slave))

    def unplug(self) -> None:
        """Take the port away, in the middle of whatever."""
        master, slave = self._master, self._slave
        self._master = self._slave = -1
        self.path.unlink(missing_ok=True)
        for end in (master, slave):
            if end >= 0:
                os.close(end)

    def unplug_at_rate(self) -> None:
        """Take the port away when the host next changes its rate."""
        drain = termios.tcdrain

        def leave(file: int) -> None:
            termios.tcdrain = drain
            self.unplug()
            drain(file)

        termios.tcdrain = leave

    def reset(self) -> None:
        """Do what a loss of power does."""
        self.file = RegisterFile()
        self._inputs()
        self._streaming = self._capture = None
        self._packets.clear()

    def _inputs(self) -> None:
        self.file.inputs.update(
            clock_hz=CLOCK_HZ,
            line_length=LINE_LENGTH,
            pixel_width=12,
            max_window=255,
            lanes=1,
            index_oversample=4,
            board_id=7,
        )

    def _send(self, payload: bytes) -> None:
        if not self.faults.silent:
            self._write(self._spoiled(frame(payload)))

    def send_raw(self, data: bytes) -> None:
        """Send bytes that are no frame."""
        self._write(data)

    def _write(self, data: bytes) -> None:
        while data and self._master >= 0:
            try:
                data = data[os.write(self._master, data) :]
            except BlockingIOError:
                time.sleep(0.001)
                if self._stop.is_set():
                    return
            except OSError:
                return

    def _spoiled(self, data: bytes) -> bytes:
        faults, chance = self.faults, self._random.random
        if not (faults.drop or faults.flip):
            return data
        kept = bytearray(byte for byte in data if chance() >= faults.drop)
        for k in range(len(kept)):
            if chance() < faults.flip:
                kept[k] ^= 1 << self._random.randrange(8)
        return bytes(kept)

    # ---- what it does ----

    def _work(self) -> None:
        before = time.monotonic()
        while not self._stop.is_set():
            try:
                ready = self._master >= 0 and select.select([self._master], [], [], 0.002)[0]
                data = os.read(self._master, 4096) if ready else b""
            except (OSError, ValueError):  # unplugged meanwhile
                data = b""
            if self._master < 0:
                time.sleep(0.002)
            for byte in self._spoiled(data):
                self._hear(byte)
            now = time.monotonic()
            self._make_lines((now - before) * self.lines_per_s)
            before = now
            for _ in range(8):
                if self._packets:
                    packet = self._packets.popleft()
                    self._send(packet)
                    self.sent_lines += packet[0] == LAST
                    self.sent_points += packet[2] if packet[0] < PIXELS else 0

    def _hear(self, byte: int) -> None:
        event = self._decoder.take(byte)
        if event.data is not None:
            self._payload.append(event.data)
        if event.status is None:
            return
        payload = bytes(self._payload)
        self._payload.clear()
        if event.status != Status.OK:
            self._count(f"frames_{event.status.name.lower()}")
            self._send(bad_frame(event.status))
            return
        self._count("frames_good")
        outcome = self._execute(payload)
        if outcome.status in (link_pkg.STATUS_UNKNOWN_COMMAND, link_pkg.STATUS_BAD_LENGTH):
            self._count("commands_bad")
        if self.faults.delay_s:
            time.sleep(self.faults.delay_s)
        if self.faults.lose_replies:
            self.faults.lose_replies -= 1
            return
        self._send(outcome.reply)

    def _count(self, name: str) -> None:
        value = self.file.inputs[name]
        assert isinstance(value, int)
        self.file.inputs[name] = min(value + 1, 0xFFFF)

    def _execute(self, payload: bytes) -> Outcome:
        self.executed[payload[0]] = self.executed.get(payload[0], 0) + 1
        sent = not any(packet[0] in (PIXELS, LAST) for packet in self._packets)
        self.file.inputs["capture_busy"] = int(self._capture is not None or not sent)
        self.file.inputs["uptime"] = self.clocks()
        run = execute(payload, self._capture is not None)
        try:
            access = next(run)
            while True:
                access = run.send(self._access(access))
        except StopIteration as end:
            outcome: Outcome = end.value
        if outcome.effect is not None:
            self._obey(*outcome.effect)
        return outcome

    def _access(self, access: Access) -> Answer:
        if self._map_hash is not None and access.address == 1:
            return Answer(link_pkg.STATUS_OK, self._map_hash)
        answer = Answer(*self.file.access(*access))
        if self.file.written and self.file.written[-1].name == "commit":
            self.file.written.clear()
            self.file.take()
            bit = self.file.inputs["configuration"]
            assert isinstance(bit, int)
            self.file.inputs["configuration"] = 1 - bit
        return answer

    def _obey(self, strobe: str, beside: dict[str, int]) -> None:
        if strobe == "capture_start":
            mode = beside["capture_mode"]
            self._capture = None if mode == link_pkg.CAPTURE_STOP else (
                mode, beside["capture_argument"]
            )  # fmt: skip
            return
        self._close_batch()
        if strobe == "stream_start":
            self._streaming = beside["stream_format"], beside["stream_step"]
            self._sequence = self._dropped = 0
        else:
            self._streaming = None

    # ---- lines ----

    def run_test(self, pixels: Pixels, made: Records) -> None:
        """Give these lines, once."""
        for row, record in zip(pixels, made, strict=True):
            self._give(row, record.copy())
        self._close_batch()

    def _make_lines(self, more: float) -> None:
        if not self.file.values["line_enable"][0]:
            self._due = 0.0
            return
        self._due = min(self._due + more, MOST_DUE)
        while self._due >= 1.0:
            self._due -= 1.0
            k = self._line % len(self.made)
            record = self.made[k].copy()
            if self.timed:
                record["time"] = self.clocks() % (1 << 32)
            self._give(self.pixels[k % len(self.pixels)], record)

    def _give(self, pixels: Pixels, record: np.void) -> None:
        line = self._line
        self._line = (line + 1) % (1 << 32)
        record["line"] = line
        if self._capture is not None:
            self._captured(line, pixels, record)
        if self._streaming is None or line in self.silent_lines:
            return
        form, step = self._streaming
        if line % step:
            return
        if self._batch and line != (int(self._batch[-1]["line"]) + step) % (1 << 32):
            self._close_batch()
        if len(self._packets) >= self.room:
            self._dropped = (self._dropped + 1) % (1 << 16)
            return
        self._batch.append(record)
        if len(self._batch) == most_records(form):
            self._close_batch()

    def _close_batch(self) -> None:
        if not self._batch or self._streaming is None:
            self._batch = []
            return
        form, step = self._streaming
        batch, self._batch = self._batch, []
        header = struct.pack(
            "<BBBBIH",
            POINTS + form,
            self._sequence,
            len(batch),
            step,
            int(batch[0]["line"]),
            self._dropped,
        )
        self._sequence = (self._sequence + 1) & 0xFF
        self._packets.append(header + b"".join(map(ENCODED[form], batch)))

    def _captured(self, line: int, pixels: Pixels, record: np.void) -> None:
        assert self._capture is not None
        mode, argument = self._capture
        if mode == link_pkg.CAPTURE_LINE and line != argument:
            return
        if mode == link_pkg.CAPTURE_EVERY and (line % argument or self._packets):
            return
        if mode != link_pkg.CAPTURE_EVERY:
            self._capture = None
        for chunk in range(-(-len(pixels) // CHUNK)):
            part = pixels[chunk * CHUNK : (chunk + 1) * CHUNK].astype("<u2")
            head = struct.pack("<BBBBI", PIXELS, self._tick(PIXELS), chunk, len(part), line)
            self._packets.append(head + part.tobytes())
        head = struct.pack("<BBBBI", LAST, self._tick(LAST), 0, 0, line)
        self._packets.append(head + full_bytes(record))

    def _tick(self, kind: int) -> int:
        sequence = self._capture_sequence[kind]
        self._capture_sequence[kind] = (sequence + 1) & 0xFF
        return sequence
