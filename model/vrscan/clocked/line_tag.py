"""The data of the line that is being read out, the twin of ``rtl/timing/line_tag.sv``."""

from dataclasses import dataclass

from vrscan.data import pkg

LATENCY = 4  # clocks from line_start_i, or angle_valid_i where that is later, to the outputs

_TIME_MASK = (1 << pkg.TIME_WIDTH) - 1


@dataclass(frozen=True)
class Tag:
    """The outputs; those of an untagged line are the defaults.

    Attributes:
        angle: Angle of the line of sight; s24, turns.
        power: Power of the laser; u16.
        mirror_flags: ``FLAG_NOT_RUNNING`` and those above it; an untagged line is UNSETTLED.
        confidence: Confidence in the angle; u8.
        inward: Whether the mirror moves inward.
        time_clks: Time of the pulse's centre; u32, clocks since the reset.
    """

    angle: int = 0
    power: int = 0
    mirror_flags: int = 1 << (pkg.FLAG_UNSETTLED - pkg.FLAG_NOT_RUNNING)
    confidence: int = 0
    inward: int = 0
    time_clks: int = 0


class LineTag:
    """Clock-accurate table. A new one is in the state after a reset.

    Args:
        depth: Number of lines from a centre to the end of its readout, ``Depth``.
        count_width: Bits of the counter, ``CountWidth``.

    Attributes:
        tag: The outputs.
        tagged: Whether the outputs belong to a line.
        untagged_count: Number of lines that were not tagged at their end; stops at its largest
            value.
        unread_count: Number of exposures that another one followed, to its end, before their
            readout began; stops likewise.
    """

    def __init__(self, depth: int = 4, count_width: int = 16) -> None:
        self.tag = Tag()
        self.tagged = False
        self.untagged_count = self.unread_count = 0
        self._depth = depth
        self._count_max = (1 << count_width) - 1
        self._clock = 0
        # By the line's number modulo depth: power; number, inward, time; and number, angle ...
        self._powers: dict[int, int] = {}
        self._centres: dict[int, tuple[int, int, int]] = {}
        self._last_centre: int | None = None
        self._angles: dict[int, tuple[int, int, int, int]] = {}
        self._exposed: int | None = None  # line that is being exposed
        self._ended: int | None = None  # last exposed line that has not been read out
        self._wanted: int | None = None  # line of the readout
        self._open = False
        self._found: list[Tag | None] = []  # tags on the way to the outputs

    def step(
        self,
        *,
        exposure: bool,
        line: int,
        centre: bool,
        power: int,
        inward: bool,
        angle_valid: bool,
        angle_line: int,
        angle: int,
        mirror_flags: int,
        confidence: int,
        line_start: bool,
        line_end: bool,
    ) -> None:
        """Advance by one clock."""
        if self._exposed is not None and not exposure and self._last_centre == self._exposed:
            self._powers[self._exposed % self._depth] = power
        if centre:
            slot = line % self._depth
            self._last_centre = line
            self._powers[slot] = power
            self._centres[slot] = (line, int(inward), self._clock)
            self._angles.pop(slot, None)
        if angle_valid:
            self._angles[angle_line % self._depth] = (angle_line, angle, mirror_flags, confidence)
        self._clock = (self._clock + 1) & _TIME_MASK

        if not exposure:
            if self._exposed is not None:
                if self._ended is not None:
                    self.unread_count = min(self.unread_count + 1, self._count_max)
                self._ended = self._exposed
            self._exposed = None
        elif self._exposed is None:
            self._exposed = line

        if line_end and (line_start or (self._open and not self.tagged)):
            self.untagged_count = min(self.untagged_count + 1, self._count_max)
        self._open = (self._open or line_start) and not line_end
        if line_start:
            self._wanted, self._ended = self._ended, None
            self._found = []
            self.tag, self.tagged = Tag(), False
        self._found.append(self._look_up())
        if len(self._found) == LATENCY:
            found = self._found.pop(0)
            if found is not None and not self.tagged:
                self.tag, self.tagged = found, True

    def _look_up(self) -> Tag | None:
        """Return the table's data of the line that is read out, or None."""
        if self._wanted is None:
            return None
        slot = self._wanted % self._depth
        centre, angle = self._centres.get(slot), self._angles.get(slot)
        if centre is None or angle is None or not centre[0] == angle[0] == self._wanted:
            return None
        return Tag(angle[1], self._powers[slot], angle[2], angle[3], centre[1], centre[2])
