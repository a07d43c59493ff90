"""Amplitude, confidence and health of the mirror, the twin of ``rtl/mirror/amplitude_control.sv``.

VR-SCAN IV-C and IV-D: the measured amplitude is controlled to a constant value. The error detects
shocks and gives the confidence in the scan angle.
"""

from dataclasses import dataclass, fields

from vrscan.data import pkg

LATENCY = 44  # clocks from valid_i to the outputs
CONFIDENCE_FRACTION = 20  # fraction bits of confidence_gain
MOST_IDLE = 1 << 40
COUNT_WIDTH = 8

_COMMIT = LATENCY - 1
_ALIGN = pkg.INTEGRAL_FRACTION - pkg.PROPORTIONAL_FRACTION
_HALF = 1 << (pkg.INTEGRAL_FRACTION - 1)
_RATE_HALF = 1 << (pkg.TRIM_GAIN_FRACTION - 1)
_CONFIDENCE_HALF = 1 << (CONFIDENCE_FRACTION - 1)
_CONFIDENCE_ONE = (1 << pkg.CONFIDENCE_WIDTH) - 1
_COUNT_MAX = (1 << COUNT_WIDTH) - 1
_SIGNED = {"trim_min": pkg.TRIM_WIDTH, "trim_max": pkg.TRIM_WIDTH}
_UNSIGNED = {
    "amplitude_set": pkg.AMPLITUDE_WIDTH,
    "k_p": pkg.CONTROL_GAIN_WIDTH,
    "k_i": pkg.CONTROL_GAIN_WIDTH,
    "trim_step": pkg.TRIM_STEP_WIDTH,
    "trim_gain": pkg.CONTROL_GAIN_WIDTH,
    "trim_up": 1,
    "settle_limit": pkg.AMPLITUDE_WIDTH,
    "shock_limit": pkg.AMPLITUDE_WIDTH,
    "phase_limit": pkg.ERROR_WIDTH,
    "settle_count": COUNT_WIDTH,
    "hold_count": COUNT_WIDTH,
    "confidence_gain": pkg.GAIN_WIDTH,
}  # and the levels


@dataclass(frozen=True)
class Settings:
    """The configuration.

    Attributes:
        amplitude_set: Amplitude to hold; u26, turns, 28 fraction bits, like all amplitudes.
        k_p: Proportional gain, level steps per amplitude step; u18, 16 fraction bits.
        k_i: Integral gain, level steps per amplitude step and measurement; u18, 20 fraction bits.
        level_min, level_max: Limits of the level; u20, like all levels.
        level_low, level_high: Levels below and above which the frequency begins to step.
        level_nominal: Level at which the frequency stops stepping; also the level before the loop
            is closed.
        trim_step: Largest step of the frequency word per measurement; u24.
        trim_gain: Word steps per step of the level from its nominal; u18, 16 fraction bits.
        trim_min, trim_max: Limits of the trim; s32.
        trim_up: Whether a higher word gives more amplitude.
        settle_limit, shock_limit: Largest amplitude error that is good, and largest one that is no
            shock.
        phase_limit: Largest phase error that is good; u28, turns, 28 fraction bits.
        settle_count, hold_count: Numbers of good measurements in a row that settle the loop, and
            that end an index fault; u8, 0 counts as 1.
        confidence_gain: Confidence lost per amplitude step; u24, 20 fraction bits.

    Raises:
        ValueError: if a value does not fit.
    """

    amplitude_set: int
    k_p: int
    k_i: int
    level_min: int
    level_max: int
    level_low: int
    level_high: int
    level_nominal: int
    trim_step: int
    trim_gain: int
    trim_min: int
    trim_max: int
    trim_up: int
    settle_limit: int
    shock_limit: int
    phase_limit: int
    settle_count: int
    hold_count: int
    confidence_gain: int

    def __post_init__(self) -> None:
        """Check the widths."""
        for field in fields(self):
            if field.name in _SIGNED:
                width = _SIGNED[field.name]
                legal = range(-1 << (width - 1), 1 << (width - 1))
            else:
                width = _UNSIGNED.get(field.name, pkg.LEVEL_WIDTH)
                legal = range(1 << width)
            if getattr(self, field.name) not in legal:
                raise ValueError(f"amplitude_control: {field.name} does not fit in {width} bits")


def _within(value: int, low: int, high: int) -> int:
    """Return a value within its limits; the upper one is applied first."""
    return high if value >= high else max(value, low)


class AmplitudeControl:
    """Clock-accurate controller. A new one is in the state after a reset.

    Args:
        settings: The configuration ports.

    Attributes:
        level: Level of the drive; u20.
        trim: Trim of the frequency word; s32.
        settled: Whether enough measurements in a row were good.
        unsettled: Whether a shock, a jump of phase or the start is not over yet.
        index_fault: Whether an index fault is not over yet.
        confidence: Confidence in the scan angle; u8, 255 is full confidence.
        error_amplitude: The set amplitude less the last measured one; s27, turns, 28 fraction bits.
    """

    def __init__(self, settings: Settings) -> None:
        self.settings = settings
        self.level = 0
        self.trim = 0
        self.settled = False
        self.unsettled = True
        self.index_fault = False
        self.confidence = 0
        self.error_amplitude = 0
        self._age = 0  # clocks since valid, 0 when idle
        self._e = 0
        self._phase_error = 0
        self._integrator = 0  # in level steps, pkg.INTEGRAL_FRACTION fraction bits
        self._more = False  # whether the frequency steps towards more amplitude
        self._less = False
        self._good_count = 0

    def step(
        self, *, state: int, valid: bool, measured: int, error: int, acquired: bool, broken: bool
    ) -> None:
        """Advance by one clock."""
        if valid:
            self._age = 1
            self._e = self.settings.amplitude_set - measured
            self._phase_error = error
        elif self._age == _COMMIT:
            self._age = 0
            self._measure()
        elif self._age:
            self._age += 1

        active = state in (pkg.MIRROR_SETTLE, pkg.MIRROR_RUN)
        if acquired or broken or not active:
            self.settled = False
            self._good_count = 0
            self.confidence = 0
        if acquired or not active:
            self.unsettled = True
        if broken:
            self.index_fault = True
        if not active:
            self._age = 0
            self.level = self.settings.level_nominal
            self._integrator = self.settings.level_nominal << pkg.INTEGRAL_FRACTION
            self.trim = 0
            self._more = self._less = False

    def _measure(self) -> None:
        """Update all outputs with a measurement."""
        e = self._e
        settings = self.settings
        self.error_amplitude = e
        self._set_level(e)
        self._set_trim()

        size = abs(e)
        shock = size > settings.shock_limit or abs(self._phase_error) > settings.phase_limit
        if size <= settings.settle_limit and not shock:
            self._good_count = min(self._good_count + 1, _COUNT_MAX)
            self.settled = self._good_count >= settings.settle_count
            if self._good_count >= settings.hold_count:
                self.index_fault = False
        else:
            self._good_count = 0
            self.settled = False
        self.unsettled = shock or (self.unsettled and not self.settled)
        if self.unsettled or self.index_fault:
            self.confidence = 0
        else:
            lost = (size * settings.confidence_gain + _CONFIDENCE_HALF) >> CONFIDENCE_FRACTION
            self.confidence = max(_CONFIDENCE_ONE - lost, 0)

    def _set_level(self, e: int) -> None:
        low, high = self.settings.level_min, self.settings.level_max
        proportional = (self.settings.k_p * e) << _ALIGN
        integrator = self._integrator
        # To nearest, half up, here and below.
        level = (integrator + proportional + _HALF) >> pkg.INTEGRAL_FRACTION
        if not (level <= low if e < 0 else level >= high):
            integrator += self.settings.k_i * e
        integrator = _within(
            integrator, low << pkg.INTEGRAL_FRACTION, high << pkg.INTEGRAL_FRACTION
        )
        self._integrator = integrator
        level = (integrator + proportional + _HALF) >> pkg.INTEGRAL_FRACTION
        self.level = _within(level, low, high)

    def _set_trim(self) -> None:
        settings = self.settings
        level = self.level
        high, low = level > settings.level_high, level < settings.level_low
        self._more, self._less = (
            high or (self._more and not low and level > settings.level_nominal),
            not high and (low or (self._less and level < settings.level_nominal)),
        )
        if self._more or self._less:
            up = self._more == bool(settings.trim_up)
            rate = abs(level - settings.level_nominal) * settings.trim_gain + _RATE_HALF
            step = min(rate >> pkg.TRIM_GAIN_FRACTION, settings.trim_step)
            trim = self.trim + (step if up else -step)
            self.trim = _within(trim, settings.trim_min, settings.trim_max)

    def idle(
        self, *, state: int, valid: bool, measured: int, error: int, acquired: bool, broken: bool
    ) -> int:
        """Return for how many clocks these inputs change nothing but the age of a measurement."""
        del measured, error
        if valid or acquired or broken:
            return 0
        if state in (pkg.MIRROR_SETTLE, pkg.MIRROR_RUN):
            return _COMMIT - self._age if self._age else MOST_IDLE
        # All that such a state sets, including the integrator, follows the level.
        nominal = self.settings.level_nominal
        there = (
            self.level == nominal
            and self._integrator == nominal << pkg.INTEGRAL_FRACTION
            and not (self.trim or self.settled or self.confidence or self._age)
            and not (self._more or self._less or self._good_count)
            and self.unsettled
        )
        return MOST_IDLE if there else 0

    def skip(
        self,
        clocks: int,
        *,
        state: int,
        valid: bool,
        measured: int,
        error: int,
        acquired: bool,
        broken: bool,
    ) -> None:
        """Take ``clocks`` steps at once, at most as many as ``idle`` returns for these inputs."""
        del state, valid, measured, error, acquired, broken
        if self._age:
            self._age += clocks
