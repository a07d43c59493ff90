"""Crossings of the index mark, the twin of ``rtl/mirror/index_capture.sv``.

VR-SCAN IV-D and IV-F: a two-field photodiode. Its comparator shows on which side of the mark the
beam is, and its gate shows whether there is a beam.
"""

from vrscan.clocked.idle import MOST_IDLE
from vrscan.data import pkg
from vrscan.registers.settings import IndexSettings

LATENCY = 4  # clocks from the last clock that settles a level to valid_o
PERIOD_CEILING = 1_250_000

_STEP = 1 << pkg.SUB_WIDTH
_AGES = 1 << pkg.AGE_WIDTH


class IndexCapture:
    """Clock-accurate capture. A new one is in the state after a reset.

    Args:
        settings: The configuration ports.
        index_oversample: Samples per clock, ``IndexOversample``: 1, 2, 4 or 8.
        count_width: Bits of the counters, ``CountWidth``.
        period_ceiling: Largest period and width in clocks, ``PeriodCeilingClks``.

    Attributes:
        valid: Whether a crossing is reported in this clock.
        outward: Whether the crossing is outward; defined with ``valid``.
        time: Time of the crossing, 1/16 clocks, modulo 2**36; defined with ``valid``.
        age: Time from ``time`` to this clock, 1/16 clocks; defined with ``valid``.
        missing, doubled, impossible: Faults of this clock.
        alive: Whether there was a pair and no deadline has passed since.
        missing_count, doubled_count, impossible_count, glitch_count: Numbers of faults, saturating.

    Raises:
        ValueError: if ``index_oversample`` is none of these.
    """

    def __init__(
        self,
        settings: IndexSettings,
        index_oversample: int = 4,
        count_width: int = 16,
        period_ceiling: int = PERIOD_CEILING,
    ) -> None:
        if index_oversample not in (1, 2, 4, 8):
            raise ValueError("index_capture: index_oversample must be 1, 2, 4 or 8")
        self.valid = False
        self.outward = False
        self.age = 0
        self.missing = False
        self.doubled = False
        self.impossible = False
        self.alive = False
        self.missing_count = 0
        self.doubled_count = 0
        self.impossible_count = 0
        self.glitch_count = 0

        self._samples = index_oversample
        self._all = (1 << index_oversample) - 1
        self._weight = _STEP // index_oversample  # weight of a sample
        self._base_age = (LATENCY - 1) * _STEP + self._weight // 2
        self._run_clks = max(settings.glitch_clks, 1)
        self._width_min = settings.width_min_clks
        self._width_max = min(settings.width_max_clks, period_ceiling)
        self._period_max = min(settings.period_max_clks, period_ceiling)
        self._count_max = (1 << count_width) - 1

        self._now = 0  # clocks since the reset, unlimited
        # The samples of a clock together; one clock later, the time for which they have agreed.
        self._open = False
        self._ones = 0
        self._open_before = False
        self._ones_before = 0
        self._value: bool | None = None  # value in which all samples agreed
        self._run = 0  # clocks for which they have agreed, at most ``_run_clks``
        # Bursts.
        self._level: bool | None = None  # the settled level
        self._burst = False
        self._burst_age = self._base_age
        self._crossing = False
        self._crossing_outward = False
        self._crossing_age = 0
        self._glitch = False
        # Pairs, with the clock in which a limit passes.
        self._pending = False
        self._before: bool | None = None  # whether the crossing before was outward
        self._period_end: int | None = None
        self._width_end = 0
        self._width_begin = 0
        self._near_end = 0

    def step(self, comparator: int, gate: int) -> None:
        """Take one clock's samples, bit 0 the oldest, and advance to the next clock."""
        now = self._now
        self._now = now + 1
        if self.missing:
            self.missing_count = min(self.missing_count + 1, self._count_max)
        if self.doubled:
            self.doubled_count = min(self.doubled_count + 1, self._count_max)
        if self.impossible:
            self.impossible_count = min(self.impossible_count + 1, self._count_max)
        if self._glitch:
            self.glitch_count = min(self.glitch_count + 1, self._count_max)
        self._pair(now)
        self._settle()

        if self._open and self._ones in (0, self._samples):
            value = self._ones != 0
            self._run = min(self._run + 1, self._run_clks) if value is self._value else 1
            self._value = value
        else:
            self._run = 0
            self._value = None
        self._open_before = self._open
        self._ones_before = self._ones
        self._open = gate == self._all
        self._ones = comparator.bit_count()

    def _settle(self) -> None:
        """Update the settled level."""
        self._crossing = self._glitch = False
        if not self._open_before:
            self._level = None
            self._burst = False
            return
        level = self._level
        if level is not None:
            fresh = self._samples - self._ones_before if level else self._ones_before
            if fresh or self._burst:
                if not self._burst:
                    self._burst_age = self._base_age
                self._burst = True
                self._burst_age += fresh * self._weight
        if self._run == self._run_clks:
            if self._burst:
                self._crossing = self._value is not level
                self._crossing_outward = self._value is True
                self._crossing_age = self._burst_age
                self._glitch = self._value is level
            self._level = self._value
            self._burst = False

    def _pair(self, now: int) -> None:
        """Check the deadlines, then judge a crossing."""
        late = self._pending and now >= self._width_end
        if self._period_end is not None and now >= self._period_end:
            late = True
            self._period_end = now + max(self._period_max, 1)
        if late:
            self._pending = self.alive = False
            self._before = None
        self.missing = late
        self.valid = self.doubled = self.impossible = False
        if not self._crossing:
            return
        outward = self._crossing_outward
        early = self._pending and not outward and now < self._width_begin
        if now < self._near_end or early or self._crossing_age >= _AGES:
            self.impossible = True
            self._pending = False
        else:
            self.valid = True
            self.outward = outward
            self.age = self._crossing_age
            self.doubled = self._before is outward
            if outward:
                self._period_end = now + self._period_max + 1
                self._width_end = now + self._width_max + 1
                self._width_begin = now + self._width_min
            elif self._pending:
                self.alive = True
            self._pending = outward
        self._before = outward
        self._near_end = now + pkg.MIN_CROSSING

    def idle(self, comparator: int, gate: int) -> int:
        """Return for how many clocks these samples change nothing but the time."""
        if (
            self._crossing
            or self._glitch
            or self._burst
            or self.valid
            or self.missing
            or self.doubled
            or self.impossible
        ):
            return 0
        if gate == self._all:
            settled = (
                self._open_before
                and self._run == self._run_clks
                and self._value is self._level
                and comparator in (0, self._all)
                and (comparator != 0) is self._level
                and self._ones == comparator.bit_count()
                and self._open
            )
            if not settled:
                return 0
        elif self._open or self._open_before or self._level is not None:
            return 0
        end = self._now + MOST_IDLE
        if self._period_end is not None:
            end = min(end, self._period_end)
        if self._pending:
            end = min(end, self._width_end)
        return max(end - self._now, 0)

    def skip(self, n: int, comparator: int, gate: int) -> None:
        """Do ``n`` clocks with these samples at once; ``n`` is at most what ``idle`` returns."""
        del comparator, gate
        self._now += n
