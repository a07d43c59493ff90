"""The data of the line that is being read out, the twin of ``rtl/timing/line_tag.sv``."""

from dataclasses import dataclass
from enum import Enum

from vrscan.data import pkg
from vrscan.registers.settings import ReadoutSettings

LATENCY = 5  # clocks from line_start_i to the outputs
ANGLE_LATENCY = 4  # clocks from angle_valid_i to the outputs, where that is later

_MOST_WAITING = 5  # exposures without a readout, before the first one
_JUDGE = 4  # clocks from line_start_i until the age of its exposure is judged
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
        superseded: Whether the angle is of the configuration before the last commit.
        lens: Position of the lens with the pulse's centre; u16, steps.
    """

    angle: int = 0
    power: int = 0
    mirror_flags: int = 1 << (pkg.FLAG_UNSETTLED - pkg.FLAG_NOT_RUNNING)
    confidence: int = 0
    inward: int = 0
    time_clks: int = 0
    superseded: int = 0
    lens: int = 0


class _State(Enum):
    FIRST, IN_STEP, LOST = range(3)


class LineTag:
    """Clock-accurate table. A new one is in the state after a reset.

    Args:
        settings: Which exposure a readout belongs to.
        depth: Number of lines from a centre to the end of its readout, ``Depth``.
        count_width: Bits of the counter, ``CountWidth``.

    Attributes:
        tag: The outputs.
        tagged: Whether the outputs belong to a line.
        untagged_count: Number of lines that were not tagged at their end; stops at its largest
            value.
        unread_count: Number of exposures whose readout never came; stops likewise.
        mistimed_count: Number of readouts that were not of the exposure that the lag says, or not
            in its window of time; stops likewise.
    """

    def __init__(self, settings: ReadoutSettings, depth: int = 8, count_width: int = 16) -> None:
        self.settings = settings
        self.tag = Tag()
        self.tagged = False
        self.untagged_count = self.unread_count = self.mistimed_count = 0
        self._depth = depth
        self._count_max = (1 << count_width) - 1
        self._clock = 0
        # By the line's number modulo depth: power; number, inward, time, lens; number, angle ...
        self._powers: dict[int, int] = {}
        self._centres: dict[int, tuple[int, int, int, int]] = {}
        self._superseded: set[int] = set()  # slots
        self._last_centre: int | None = None
        self._angles: dict[int, tuple[int, int, int, int]] = {}
        self._exposed: int | None = None  # line that is being exposed
        self._ended: list[tuple[int, int]] = []  # line and time of the last ends, the last first
        self._wanted: int | None = None  # line of the readout
        self._state = _State.FIRST
        self._enable = False
        self._lag = settings.readout_lag
        self._waiting = self._stale = 0  # exposures without a readout, and readouts without one
        self._news = False, False  # of the clock before: an exposure has ended, a readout begun
        # Whether each readout of the last clocks is right; None where none began.
        self._judged: list[bool | None] = [None] * (_JUDGE - 1)
        self._open = False
        self._found: list[Tag | None] = []  # tags on the way to the outputs

    def step(
        self,
        *,
        enable: bool,
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
        superseding: bool = False,
        lens: int = 0,
    ) -> None:
        """Advance by one clock."""
        self._step_number(enable)
        ended = self._exposed is not None and not exposure
        self._news = ended, line_start
        if self._exposed is not None and ended:
            self._ended = [(self._exposed, self._clock), *self._ended][: _MOST_WAITING - 1]
        if self._exposed is not None and not exposure and self._last_centre == self._exposed:
            self._powers[self._exposed % self._depth] = power
        if centre:
            slot = line % self._depth
            self._last_centre = line
            self._powers[slot] = power
            self._centres[slot] = (line, int(inward), self._clock, lens)
            self._angles.pop(slot, None)
            self._superseded.discard(slot)
        if superseding:
            self._superseded.update(range(self._depth))
        if angle_valid:
            self._angles[angle_line % self._depth] = (angle_line, angle, mirror_flags, confidence)
        self._clock = (self._clock + 1) & _TIME_MASK

        if not exposure:
            self._exposed = None
        elif self._exposed is None:
            self._exposed = line

        if line_end and (line_start or (self._open and not self.tagged)):
            self.untagged_count = min(self.untagged_count + 1, self._count_max)
        self._open = (self._open or line_start) and not line_end
        self._found.append(self._look_up())
        if len(self._found) == ANGLE_LATENCY:
            found = self._found.pop(0)
            if found is not None and not self.tagged:
                self.tag, self.tagged = found, True
        if line_start:
            self._found = []
            self.tag, self.tagged = Tag(), False

    def _step_number(self, enable: bool) -> None:
        """Number the exposures and readouts of the clock before."""
        ended, begun = self._news
        state, lag = self._state, self._lag
        most = lag + 1 if state is _State.IN_STEP else _MOST_WAITING
        if ended and self._waiting >= most:
            self.unread_count = min(self.unread_count + 1, self._count_max)
        elif ended:
            self._waiting += 1
        verdict = None
        if begun:
            stale = state is _State.FIRST and self._stale > 0
            due = state is not _State.LOST and not stale and self._waiting == lag + 1
            self._wanted, self._found = None, []
            if due:
                line, time = self._ended[lag]
                age = (self._clock - 1 - time) & _TIME_MASK
                verdict = self.settings.readout_min_clks <= age <= self.settings.readout_max_clks
                self._wanted = line if verdict else None
            elif not stale and self._waiting and enable:
                verdict = False
            if stale:
                self._stale -= 1
            elif self._waiting and (due or state is not _State.IN_STEP):
                self._waiting -= 1

        self._judged.append(verdict)
        verdict = self._judged.pop(0)
        if verdict is False:
            self.mistimed_count = min(self.mistimed_count + 1, self._count_max)
        if verdict is not None and state is _State.FIRST:
            self._state = _State.IN_STEP if verdict else _State.LOST
        if self._lag != self.settings.readout_lag:
            self._lag, self._state = self.settings.readout_lag, _State.LOST
        if enable and not self._enable:
            self._state, self._waiting = _State.FIRST, 0
            self._stale = self._lag if self.settings.readout_stale else 0
            self._judged = [None] * (_JUDGE - 1)
        self._enable = enable

    def _look_up(self) -> Tag | None:
        """Return the table's data of the line that is read out, or None."""
        if self._wanted is None:
            return None
        slot = self._wanted % self._depth
        centre, angle = self._centres.get(slot), self._angles.get(slot)
        if centre is None or angle is None or not centre[0] == angle[0] == self._wanted:
            return None
        late = int(slot in self._superseded)
        _, inward, time, lens = centre
        return Tag(angle[1], self._powers[slot], angle[2], angle[3], inward, time, late, lens)
