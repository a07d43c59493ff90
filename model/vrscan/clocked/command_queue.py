"""Frames that wait for their execution, the twin of ``rtl/link/command_queue.sv``."""

from typing import NamedTuple

from vrscan.clocked.frame_decoder import Status as FrameStatus

LATENCY = 1  # clocks from the end of a frame to ``waits``
PLACES = 7  # frames that wait or are executed
BAD_FRAME_PLACES = 4  # a bad frame is kept while fewer are taken

FRAME_COUNTERS = {
    FrameStatus.OK: "frames_good",
    FrameStatus.CRC: "frames_crc",
    FrameStatus.MALFORMED: "frames_malformed",
    FrameStatus.TOO_LONG: "frames_too_long",
    FrameStatus.TOO_SHORT: "frames_too_short",
    FrameStatus.FRAMING: "frames_framing",
}


class Frame(NamedTuple):
    """A frame that was received.

    Attributes:
        status: How it ended.
        payload: All bytes of its payload.
    """

    status: FrameStatus
    payload: bytes


class CommandQueue:
    """Clock-accurate queue. A new one is in the state after a reset.

    Args:
        count_width: Bits of the counters, ``CountWidth``.

    Attributes:
        counters: Numbers of frames by their status, and of lost commands, by the ports' names.
    """

    def __init__(self, count_width: int = 16) -> None:
        self._count_max = (1 << count_width) - 1
        self.counters = dict.fromkeys([*FRAME_COUNTERS.values(), "commands_lost"], 0)
        self._received = bytearray()
        self._frames = [Frame(FrameStatus.OK, b"")] * (PLACES + 1)
        # Places of the frame that is executed, of the first that waits, of the one to come.
        self._oldest = self._head = self._tail = 0
        self._executed = False

    @property
    def waits(self) -> bool:
        """Return whether a frame waits."""
        return self._head != self._tail

    @property
    def frame(self) -> Frame:
        """Return the frame that is executed, or that is the next to be."""
        return self._frames[self._oldest]

    def step(
        self,
        *,
        valid: bool,
        data: int,
        done: bool,
        status: int,
        halt: bool,
        take: bool,
        release: bool,
    ) -> None:
        """Advance by one clock."""
        tail, kept = self._tail, (self._tail - self._oldest) % len(self._frames)
        if release:
            self._oldest = self._head
            self._executed = False
        if take:
            self._head = (self._head + 1) % len(self._frames)
            self._executed = True
        if done:
            self._end(FrameStatus(status), kept)
        elif valid:
            self._received.append(data)
        if halt:
            self._head = tail
            if not self._executed:
                self._oldest = tail

    def _end(self, status: FrameStatus, kept: int) -> None:
        """Keep the frame that has ended if there is a place for it."""
        payload = bytes(self._received)
        self._received.clear()
        self._count(FRAME_COUNTERS[status])
        good = status == FrameStatus.OK
        if kept < (PLACES if good else BAD_FRAME_PLACES):
            self._frames[self._tail] = Frame(status, payload)
            self._tail = (self._tail + 1) % len(self._frames)
        elif good:
            self._count("commands_lost")

    def _count(self, name: str) -> None:
        """Add one to a counter, which stops at its largest value."""
        self.counters[name] = min(self.counters[name] + 1, self._count_max)
