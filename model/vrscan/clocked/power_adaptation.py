"""The laser's power from line to line, the twin of ``rtl/actuators/power_adaptation.sv``.

VR-SCAN IV-B: the power follows the peak of the line before.
"""

from vrscan.fixed.multiply import latency as multiply_latency
from vrscan.registers.settings import AdaptationSettings

GAIN_FRACTION = 13
FACTOR_FRACTION = 14
FACTOR_MAX = (1 << 17) - 1
POWER_LATENCY = 2 * multiply_latency(17, 18) + 9  # clocks from point_valid_i to the new power


def next_power(
    settings: AdaptationSettings, power: int, height: int, *, measured: bool, saturated: bool
) -> int:
    """Return the power that a point demands.

    Args:
        settings: The configuration.
        power: Power that the point's line had; u16.
        height: Height of its peak above the background; u16, left-aligned counts.
        measured: Whether the point has a peak.
        saturated: Whether that peak is saturated.
    """
    if saturated:
        factor = settings.cut
    elif not measured:
        factor = (1 << FACTOR_FRACTION) + settings.search
    else:
        error = settings.target - height
        product = error * (settings.down if error < 0 else settings.up)
        shift = 16 + GAIN_FRACTION - FACTOR_FRACTION
        factor = (1 << FACTOR_FRACTION) + ((product + (1 << (shift - 1))) >> shift)
        factor = min(max(factor, 0), FACTOR_MAX)
    scaled = (power * factor + (1 << (FACTOR_FRACTION - 1))) >> FACTOR_FRACTION
    scaled += not saturated and not measured
    if scaled >= settings.power_max:
        return settings.power_max
    return max(scaled, settings.power_min, 1)


class PowerAdaptation:
    """Clock-accurate adaptation. A new one is in the state after a reset.

    Args:
        settings: The registers. ``settings`` may be replaced between two steps; the values from
            which the next power is computed must stay while ``busy``.

    Attributes:
        power: The power that is wanted; u16.
        inward_power, outward_power: The next power of each direction; u16.
    """

    def __init__(self, settings: AdaptationSettings) -> None:
        self.settings = settings
        self.power = 0
        self.inward_power = 0
        self.outward_power = 0
        self._pulse = False
        self._point = (0, 0, False, False, False)
        self._age = 0
        self._first = self._least = 0

    @property
    def busy(self) -> bool:
        """Return whether a point is being processed."""
        return self._age != 0

    def step(
        self,
        *,
        pulse: bool,
        armed: bool,
        inward: bool,
        point_valid: bool = False,
        point_measured: bool = False,
        point_saturated: bool = False,
        point_maximum: int = 0,
        point_background: int = 0,
        point_power: int = 0,
        point_inward: bool = False,
        point_test: bool = False,
    ) -> None:
        """Advance by one clock; the arguments are the input ports and fields of the point.

        ``point_maximum`` and ``point_background`` are aligned to 16 bits.
        """
        settings = self.settings
        if (self._pulse and not pulse) or not armed:
            if not settings.adapt:
                self.power = settings.power
            elif settings.shared or inward:
                self.power = self.inward_power
            else:
                self.power = self.outward_power
        self._pulse = pulse

        none_inward, none_outward = not self.inward_power, not self.outward_power
        if self._age == POWER_LATENCY - 1:
            self._commit()
            self._age = 0
        elif self._age:
            self._age += 1
        if point_valid and not point_test and point_power:
            height = max(point_maximum - point_background, 0)
            self._point = (point_power, height, point_measured, point_saturated, point_inward)
            self._age = 1
        still = not settings.adapt or not settings.enable
        if still:
            self._age = 0
        if still or none_inward:
            self.inward_power = self._first
        if still or none_outward:
            self.outward_power = self._first
        self._first = max(settings.power, self._least)
        self._least = max(settings.power_min, 1)

    def _commit(self) -> None:
        """Give one direction or both the power that the last point demands."""
        power, height, measured, saturated, inward = self._point
        new = next_power(self.settings, power, height, measured=measured, saturated=saturated)
        if self.settings.shared or inward:
            self.inward_power = new
        if self.settings.shared or not inward:
            self.outward_power = new
