"""Records of points as an AXI4-Stream, the twin of ``rtl/axi/axis_points.sv``."""

from vrscan.clocked.axis_ring import AxisRing
from vrscan.data import link_pkg, pkg
from vrscan.data.records import (
    CONFIGURATION,
    FULL,
    INWARD,
    MEASURED,
    MORE_FLAGS,
    TEST,
    decode_full,
)

LATENCY = link_pkg.FULL_BYTES + 1  # clocks from a record's first byte to tvalid
WORD_BYTES = 4
WORDS = link_pkg.FULL_BYTES // WORD_BYTES
MEASURED_BIT, CONFIGURATION_BIT, INWARD_BIT, TEST_BIT = range(pkg.FLAG_WIDTH, pkg.FLAG_WIDTH + 4)
assert FULL.fields is not None
_AT_FLAGS, _AT_LOST = FULL.fields["flags"][1], FULL.fields["lost"][1]
_BITS = {
    MEASURED_BIT: MEASURED,
    CONFIGURATION_BIT: CONFIGURATION,
    INWARD_BIT: INWARD,
    TEST_BIT: TEST,
}


def user_of(record: bytes) -> int:
    """Return ``tuser`` of a record: its flags by their numbers, and above them four bits."""
    fields = decode_full(record)[0]
    bits = int(fields["bits"])
    user = int(fields["flags"])
    user |= sum((bits >> place & 1) << flag for place, flag in MORE_FLAGS.items())
    return user | sum(1 << place for place, mask in _BITS.items() if bits & mask)


class AxisPoints:
    """Clock-accurate stream of records. A new one is in the state after a reset.

    Args:
        slots: Number of records that are kept, ``Slots``.
        count_width: Bits at which counters stop, ``CountWidth``.

    Attributes:
        stream: The outputs of the stream.
        points_dropped: Number of dropped records; stops at its largest value.
    """

    def __init__(self, slots: int = 16, count_width: int = pkg.COUNTER_WIDTH) -> None:
        self.stream = AxisRing(slots, WORDS)
        self.points_dropped = 0
        self._count_max = (1 << count_width) - 1
        self._lost = 0  # since the last record that was kept
        self._coming: bytearray | None = None

    def step(self, *, record_valid: bool, record_index: int, record: int, ready: bool) -> None:
        """Advance by one clock."""
        write = commit = False
        word = user = 0
        if record_valid and record_index == 0:
            self._coming = bytearray() if self.stream.room else None
            if self._coming is None:
                self.points_dropped = min(self.points_dropped + 1, self._count_max)
                self._lost = min(self._lost + 1, self._count_max)
        if record_valid and self._coming is not None:
            self._coming.append(self._told(record_index, record))
            write = record_index % WORD_BYTES == WORD_BYTES - 1
            word = int.from_bytes(self._coming[-WORD_BYTES:], "little")
            commit = record_index == link_pkg.FULL_BYTES - 1
            if commit:
                user = user_of(bytes(self._coming))
                self._coming, self._lost = None, 0
        self.stream.step(
            ready=ready,
            write=write,
            place=record_index // WORD_BYTES,
            data=word,
            commit=commit,
            user=user,
        )

    def _told(self, index: int, byte: int) -> int:
        """Return a byte of a record that tells how many were dropped before it."""
        if index == _AT_LOST:
            return self._lost & 0xFF
        if index == _AT_LOST + 1:
            return self._lost >> 8
        lost = index == _AT_FLAGS + 1 and self._lost
        return byte | 1 << pkg.FLAG_POINTS_LOST - 8 if lost else byte
