"""Time base of the lines, the twin of ``rtl/timing/line_trigger.sv``."""

from vrscan.clocked.idle import MOST_IDLE
from vrscan.data import pkg
from vrscan.fixed.multiply import latency as multiply_latency
from vrscan.registers.settings import TriggerSettings

# Clocks from enable_i to the first line_start_o.
START_LATENCY = multiply_latency(pkg.WORD_WIDTH + 1, pkg.RATIO_WIDTH + 1) + 5
WRAP_LATENCY = 2  # clocks from the accumulator's wrap to line_start_o
MIN_LINE_CLKS = 32

_TURN = 1 << pkg.TURN_WIDTH
_STEP_MAX = _TURN // MIN_LINE_CLKS
_STEP_LATENCY = START_LATENCY - 3  # clocks from a sample of the word to the step
_NUMBER_MASK = (1 << pkg.LINE_NUMBER_WIDTH) - 1
_TIME_MAX = (1 << (pkg.LINE_CLKS_WIDTH + 1)) - 1
_RATIO_HALF = 1 << (pkg.RATIO_FRACTION - 1)


def line_step(word: int, ratio: int) -> int:
    """Return the accumulator's step: turns of a line per clock, 48 fraction bits.

    To nearest, half up, and at most a turn in 32 clocks.

    Args:
        word: Turns of the mirror per clock; u40, 48 fraction bits.
        ratio: Lines per mirror period; u44, 32 fraction bits.
    """
    return min((word * ratio + _RATIO_HALF) >> pkg.RATIO_FRACTION, _STEP_MAX)


class LineTrigger:
    """Clock-accurate time base. A new one is in the state after a reset.

    Args:
        settings: The configuration ports; ``settings`` may be replaced between two steps, which
            takes effect at the next line.
        count_width: Bits of the counter, ``CountWidth``.

    Attributes:
        line_start: Whether a line starts in this clock.
        line: Number of the line, modulo 2**32.
        exposure, laser: Signals to the sensor and the laser.
        centre: Whether this clock holds the middle of the laser's pulse.
        centre_half: Whether that middle is half a clock later.
        overrun: With ``line_start``: whether the line before had not ended.
        overrun_count: Number of overruns, saturating.
    """

    def __init__(self, settings: TriggerSettings, count_width: int = 16) -> None:
        self.settings = settings
        self.line_start = False
        self.line = 0
        self.exposure = False
        self.laser = False
        self.centre = False
        self.centre_half = False
        self.overrun = False
        self.overrun_count = 0
        self._count_max = (1 << count_width) - 1
        # The next line's step: the one in work, and the clocks until it is ready; 0 is idle.
        self._coming = 0
        self._remaining_clks = 0
        self._arrived = False
        self._next = 0
        self._run = False
        self._wrap = False
        self._turn = 0
        self._step = 0
        # The line.
        self._first = False
        self._live = False
        self._late = False
        self._time = 0  # clocks since the line's start
        self._exposure = (0, 0)  # begin and end
        self._exposed = False
        self._pulse = (0, 0)
        self._centre = 0
        self._half = False
        self._skip_laser = False
        self._skip_exposure = False
        self._number = 0

    def step(self, *, enable: bool, word: int) -> None:
        """Advance by one clock."""
        if not enable:
            self._stop()
            return
        wrap = self._wrap
        time = self._time
        live = self._live
        first = self._first

        # The line's outputs.
        pulse_left = live and time < self._pulse[1]
        exposure_left = live and time < self._exposure[1]
        pulse = pulse_left and time >= self._pulse[0]
        exposure = exposure_left and time >= self._exposure[0]
        self.line_start = first
        self.overrun = self._late
        if first:
            self._skip_laser = self.laser and pulse
            self._skip_exposure = self.exposure and exposure
            self.line = self._number
            self._number = (self._number + 1) & _NUMBER_MASK
            if self._late and self.overrun_count < self._count_max:
                self.overrun_count += 1
        self.laser = pulse and not self._skip_laser
        self.exposure = exposure and not self._skip_exposure
        self.centre = live and time == self._centre
        self.centre_half = self._half
        self._first = wrap
        self._late = wrap and (pulse_left or (exposure_left and self._exposed))
        if wrap:
            self._begin()
        elif time < _TIME_MAX:
            self._time = time + 1

        # The accumulator.
        run = self._run
        sample = self.samples
        if wrap:
            self._step = self._next
            self._run = self._next != 0
        self._wrap = False
        if run and self._run:
            turn = self._turn + self._step
            self._wrap = turn >= _TURN
            self._turn = turn & (_TURN - 1)
        elif not run and self._arrived and self._next:
            self._run = self._wrap = True
            self._turn = 0

        # The next step.
        self._arrived = False
        if sample:
            self._coming = line_step(word, self.settings.ratio)
            self._remaining_clks = _STEP_LATENCY - 1
        elif self._remaining_clks:
            self._remaining_clks -= 1
            if not self._remaining_clks:
                self._next = self._coming
                self._arrived = True

    def _begin(self) -> None:
        """Begin a line with the present settings."""
        settings = self.settings
        begin = settings.exposure_delay_clks
        self._exposure = (begin, begin + settings.exposure_clks)
        self._exposed = settings.exposure_clks != 0
        begin = settings.pulse_delay_clks
        self._pulse = (begin, begin + settings.pulse_clks)
        self._centre = begin + settings.pulse_clks // 2
        self._half = settings.pulse_clks % 2 == 1
        self._time = 0
        self._live = True

    def _stop(self) -> None:
        """Advance by one clock with ``enable`` low."""
        self.line_start = self.exposure = self.laser = self.centre = self.overrun = False
        self.centre_half = self._half
        if self._wrap:
            self._begin()
        self._remaining_clks = 0
        self._arrived = self._run = self._wrap = False
        self._first = self._live = self._late = False

    @property
    def samples(self) -> bool:
        """Return whether a step of this clock takes the word, if enabled; no other step does."""
        return self._wrap or not (self._run or self._remaining_clks or self._arrived)

    def idle(self, *, enable: bool, word: int) -> int:
        """Return for how many clocks these inputs change nothing but accumulators and counters."""
        del word
        strobe = self.line_start or self.centre or self.overrun
        if strobe or self._wrap or self._first or self.centre_half != self._half:
            return 0
        if not enable:
            quiet = not (
                self.laser or self.exposure or self._run or self._live or self._remaining_clks
            )
            return MOST_IDLE if quiet and not self._arrived else 0
        if self._run:
            # The last of these clocks is the one before the wrap.
            most = (_TURN - 1 - self._turn) // self._step
        elif self._remaining_clks:
            most = self._remaining_clks - 1
        else:
            return 0
        if self._live:
            time = self._time
            pulse = self._pulse[0] <= time < self._pulse[1] and not self._skip_laser
            exposure = self._exposure[0] <= time < self._exposure[1] and not self._skip_exposure
            if time == self._centre or pulse != self.laser or exposure != self.exposure:
                return 0
            for edge in (*self._pulse, *self._exposure, self._centre):
                if time < edge < time + most:
                    most = edge - time
        return most if most < MOST_IDLE else MOST_IDLE

    def skip(self, clocks: int, *, enable: bool, word: int) -> None:
        """Take ``clocks`` steps at once, at most as many as ``idle`` returns for these inputs."""
        del word
        if clocks <= 0 or not enable:
            return
        self._time = min(self._time + clocks, _TIME_MAX)
        if self._run:
            self._turn += clocks * self._step
        if self._remaining_clks:
            self._arrived = self._remaining_clks == clocks
            self._remaining_clks = max(self._remaining_clks - clocks, 0)
            if not self._remaining_clks:
                self._next = self._coming
        else:
            self._arrived = False
