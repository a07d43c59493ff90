"""Packets of one length as an AXI4-Stream, the twin of ``rtl/axi/axis_ring.sv``."""

from collections import deque

LATENCY = 2  # clocks from commit_i to tvalid


class AxisRing:
    """Clock-accurate ring. A new one is in the state after a reset.

    Args:
        slots: Number of packets that fit, ``Slots``.
        words: Words of a packet, ``Words``.

    Attributes:
        valid: Whether there is a word, ``tvalid``.
        data, last, user: The word, whether it is the packet's last, and what belongs to the
            packet; defined with ``valid``.

    Raises:
        ValueError: if ``slots`` or ``words`` is out of range.
    """

    def __init__(self, slots: int = 4, words: int = 16) -> None:
        if slots < 2 or slots & (slots - 1):
            raise ValueError("axis_ring: slots must be a power of two from 2 on")
        if words < 2:
            raise ValueError("axis_ring: words must be at least 2")
        self.valid = False
        self.data = 0
        self.last = False
        self.user = 0
        self._slots = slots
        self._words = words
        self._writing = [0] * words
        self._packets: deque[tuple[tuple[int, ...], int]] = deque()
        self._place = 0  # of the word that goes out next

    @property
    def room(self) -> bool:
        """Return whether a slot is free."""
        return len(self._packets) < self._slots

    def step(
        self,
        *,
        ready: bool,
        write: bool = False,
        place: int = 0,
        data: int = 0,
        commit: bool = False,
        user: int = 0,
    ) -> None:
        """Advance by one clock with these inputs; ``ready`` is ``tready``."""
        if ready or not self.valid:
            self.valid = bool(self._packets)
            if self.valid:
                words, self.user = self._packets[0]
                self.data = words[self._place]
                self._place += 1
                self.last = self._place == self._words
                if self.last:
                    self._packets.popleft()
                    self._place = 0
        if write:
            self._writing[place] = data
        if commit:
            self._packets.append((tuple(self._writing), user))
