"""Amplitude, confidence and health of the mirror, the twin of ``rtl/mirror/amplitude_control.sv``.

VR-SCAN IV-C and IV-D: the measured amplitude is controlled to a constant value. The error detects
shocks and gives the confidence in the scan angle.
"""

from vrscan.clocked.idle import MOST_IDLE
from vrscan.data import pkg
from vrscan.registers.settings import AmplitudeSettings

LATENCY = 44  # clocks from valid_i to the outputs
CONFIDENCE_FRACTION = 20  # fraction bits of confidence_gain
COUNT_WIDTH = 8

_COMMIT = LATENCY - 1
_ALIGN = pkg.INTEGRAL_FRACTION - pkg.PROPORTIONAL_FRACTION
_HALF = 1 << (pkg.INTEGRAL_FRACTION - 1)
_RATE_HALF = 1 << (pkg.TRIM_GAIN_FRACTION - 1)
_CONFIDENCE_HALF = 1 << (CONFIDENCE_FRACTION - 1)
_CONFIDENCE_ONE = (1 << pkg.CONFIDENCE_WIDTH) - 1
_COUNT_MAX = (1 << COUNT_WIDTH) - 1


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
    """

    def __init__(self, settings: AmplitudeSettings) -> None:
        self.settings = settings
        self.level = 0
        self.trim = 0
        self.settled = False
        self.unsettled = True
        self.index_fault = False
        self.confidence = 0
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
        elif acquired:
            self._age = 0
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
