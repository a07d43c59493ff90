"""Raw lines as an AXI4-Stream, the twin of ``rtl/axi/axis_lines.sv``."""

from dataclasses import dataclass

from vrscan.clocked.axis_ring import AxisRing
from vrscan.data import pkg
from vrscan.fixed.line_extent import LineExtent

LATENCY = 2  # clocks from line_end_i to tvalid
LANE_BITS = 16
_NUMBERS = 1 << pkg.LINE_NUMBER_WIDTH


@dataclass(frozen=True)
class LineUser:
    """What ``tuser`` says of a line.

    Attributes:
        number: Number of the line.
        mirror_flags: Flags of the mirror, ``FLAG_NOT_RUNNING`` in bit 0 and those above it.
        test: Whether it is a test line.
        superseded: Whether its angle is of the settings before the last commit.
        lost: Whether a line before it was dropped, or was no good one.
    """

    number: int
    mirror_flags: int = 0
    test: bool = False
    superseded: bool = False
    lost: bool = False

    @property
    def packed(self) -> int:
        """Return ``tuser``."""
        above = self.mirror_flags | self.test << 3 | self.superseded << 4 | self.lost << 5
        return self.number | above << pkg.LINE_NUMBER_WIDTH

    @classmethod
    def unpacked(cls, user: int) -> "LineUser":
        """Return what a ``tuser`` says."""
        above = user >> pkg.LINE_NUMBER_WIDTH
        bits = (bool(above >> k & 1) for k in (3, 4, 5))
        return cls(user % _NUMBERS, above & 7, *bits)


class AxisLines:
    """Clock-accurate stream of lines. A new one is in the state after a reset.

    Args:
        line_length: Pixels of a line, ``LineLength``.
        lanes: Pixels of a word, ``Lanes``.
        slots: Number of lines that are kept, ``Slots``.
        count_width: Bits at which the counter stops, ``CountWidth``.

    Attributes:
        stream: The outputs of the stream.
        lines_dropped: Number of good lines without room; stops at its largest value.

    Raises:
        ValueError: if ``lanes`` is no power of two that divides ``line_length``.
    """

    def __init__(
        self,
        line_length: int = 2048,
        lanes: int = 2,
        slots: int = 2,
        count_width: int = pkg.COUNTER_WIDTH,
    ) -> None:
        if lanes < 2 or lanes & (lanes - 1) or line_length % lanes:
            raise ValueError("axis_lines: lanes must be a power of two that divides line_length")
        self.stream = AxisRing(slots, line_length // lanes)
        self.lines_dropped = 0
        self._lanes = lanes
        self._count_max = (1 << count_width) - 1
        self._extent = LineExtent(line_length)
        self._word = 0  # its pixels so far, the newest one at the top
        self._number = -1  # of the line that comes
        self._takes = False
        self._lost = False

    def step(
        self,
        *,
        line_start: bool,
        line_end: bool,
        pixel_valid: bool,
        pixel: int,
        mirror_flags: int,
        test: bool,
        superseded: bool,
        ready: bool,
    ) -> None:
        """Advance by one clock; what belongs to a line is looked at with its end."""
        if line_start:
            self._takes = self.stream.room
            self._number = (self._number + 1) % _NUMBERS
        extent = self._extent.step(line_start, pixel_valid, line_end)
        write, place = False, 0
        if extent.index is not None:
            place, lane = divmod(extent.index, self._lanes)
            self._word = (0 if lane == 0 else self._word) | pixel << LANE_BITS * lane
            write = self._takes and lane == self._lanes - 1
        commit = extent.good and self._takes
        user = LineUser(self._number, mirror_flags, test, superseded, self._lost).packed
        if commit:
            self._lost = False
        elif extent.ends or extent.unfinished:
            self._lost = True
            if extent.good:
                self.lines_dropped = min(self.lines_dropped + 1, self._count_max)
        self.stream.step(
            ready=ready, write=write, place=place, data=self._word, commit=commit, user=user
        )
