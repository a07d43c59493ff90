"""Power and interlock of the laser, the twin of ``rtl/actuators/laser_control.sv``.

VR-SCAN IV-B and (10): the power follows the peak of the line before, and the power that a pulse
really had is stored with its line. The limits of the light are applied on top;
``docs/laser-safety.md`` describes them.
"""

from dataclasses import dataclass, fields

from vrscan.data import pkg
from vrscan.fixed.multiply import latency as multiply_latency

CUT_WIDTH = 14  # bits of cut and search, all fraction
GAIN_FRACTION = 13
FACTOR_FRACTION = 14
FACTOR_MAX = (1 << 17) - 1
PHASE_WIDTH = 16
BUCKET_MARGIN = 4 << pkg.POWER_WIDTH  # margin of the bucket: four clocks of the largest power
POWER_LATENCY = 2 * multiply_latency(17, 18) + 9  # clocks from point_valid_i to the new power
INTERLOCK_LATENCY = 1  # clocks from state_i, index_alive_i, laser_enable_i to dark
GUARD_LATENCY = 3  # clocks from guard_ok_i to dark
WINDOW_LATENCY = 3  # clocks from phase_i to index_light_o
LIMIT_LATENCY = 2  # clocks from a limit to power_o, startup_o
WATCHDOG_LATENCY = 3  # clocks that the light outlasts the watchdog's time

_LEVELS = 1 << pkg.POWER_WIDTH
_PHASE_MASK = (1 << PHASE_WIDTH) - 1
_CLKS_MAX = (1 << pkg.LINE_CLKS_WIDTH) - 1
_ARMED = 2  # number of line starts
_SEEKING = (pkg.MIRROR_SWEEP, pkg.MIRROR_SETTLE)


@dataclass(frozen=True)
class Ceilings:
    """The largest values that a register can take effect with: parameters of the module.

    Attributes:
        power, startup, drain: Powers; u16.
        pulse_clks: Length of a pulse, below 2**20 - 1.
        bucket: Energy as power times clocks, below 2**31.
        watchdog_clks: Time of the watchdog, 1 to below 2**31.
    """

    power: int = 65_535
    startup: int = 1_311
    pulse_clks: int = 1_250
    drain: int = 4_096
    bucket: int = 268_435_456
    watchdog_clks: int = 134_217_728


@dataclass(frozen=True)
class Settings:
    """The configuration: the ports ``laser_*_i`` without that prefix.

    Attributes:
        enable, adapt, shared: Switches, one bit each.
        power: Power without ``adapt``; u16, like all powers.
        power_min, power_max: Range of the adapted power.
        startup: Level of the start-up channel.
        target: Target height of a peak above its background; u16, left-aligned counts.
        cut: Factor of the power after saturation; u14, all fraction.
        down, up: Gains above and below the target; u16, 13 fraction bits.
        search: Relative growth of the power where nothing is measured; u14, all fraction.
        index_begin, index_end: Phases between which the start-up channel is on in RUN; u16, turns.
        limit_power, limit_startup: Limits of the two channels' powers; u16.
        limit_pulse_clks: Limit of a pulse's length; u20.
        limit_drain: Power that leaves the bucket, per clock; u16.
        limit_bucket: Energy of the bucket, power times clocks; u32.
        watchdog_clks: Time of the watchdog; u32; 0 means the ceiling.

    Raises:
        ValueError: if a value does not fit.
    """

    enable: int = 0
    adapt: int = 0
    shared: int = 0
    power: int = 0
    power_min: int = 0
    power_max: int = 0
    startup: int = 0
    target: int = 0
    cut: int = 0
    down: int = 0
    up: int = 0
    search: int = 0
    index_begin: int = 0
    index_end: int = 0
    limit_power: int = 0
    limit_startup: int = 0
    limit_pulse_clks: int = 0
    limit_drain: int = 0
    limit_bucket: int = 0
    watchdog_clks: int = 0

    def __post_init__(self) -> None:
        """Check the widths."""
        for field in fields(self):
            width = WIDTHS.get(field.name, 16)
            if getattr(self, field.name) not in range(1 << width):
                raise ValueError(f"laser_control: {field.name} does not fit in {width} bits")

    @property
    def ports(self) -> dict[str, int]:
        """Return the values under the names of their ports, without ``_i``."""
        return {port(field.name): getattr(self, field.name) for field in fields(self)}


WIDTHS = {
    "enable": 1,
    "adapt": 1,
    "shared": 1,
    "cut": CUT_WIDTH,
    "search": CUT_WIDTH,
    "limit_pulse_clks": pkg.LINE_CLKS_WIDTH,
    "limit_bucket": 32,
    "watchdog_clks": 32,
}  # bits of these settings; all others have 16 bits


def port(setting: str) -> str:
    """Return the name of a setting's port and register."""
    return f"laser_{setting}"


def next_power(
    settings: Settings, power: int, height: int, *, measured: bool, saturated: bool
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


class LaserControl:
    """Clock-accurate control. A new one is in the state after a reset.

    ``pulse`` and ``line`` depend on inputs of their own clock, so they are functions of them; all
    other outputs are registers.

    Args:
        settings: The configuration ports. ``settings`` may be replaced between two steps; the
            values from which the next power is computed must stay while ``busy``.
        ceilings: Parameters of the module.
        heartbeat_bits: Period of the heartbeat, ``HeartbeatBits``.
        count_width: Bits of the counters, ``CountWidth``.

    Attributes:
        permit: The registered permission of a pulse.
        power, startup: Levels of the two channels; u16.
        power_pin, startup_pin: First-order sigma-delta outputs of these levels.
        index_light: Whether the start-up channel is on.
        power_inward, power_outward: The next power of each direction; u16.
        level: Level of the bucket, power times clocks.
        cut_count, duty_count, watchdog_count: Counters of the limits that acted, saturating.
    """

    def __init__(
        self,
        settings: Settings,
        ceilings: Ceilings | None = None,
        heartbeat_bits: int = 5,
        count_width: int = 16,
    ) -> None:
        self.settings = settings
        self.ceilings = ceilings or Ceilings()
        self.permit = False
        self.power = 0
        self.startup = 0
        self.power_pin = False
        self.startup_pin = False
        self.index_light = False
        self.power_inward = 0
        self.power_outward = 0
        self.level = 0
        self.cut_count = 0
        self.duty_count = 0
        self.watchdog_count = 0
        self._count_max = (1 << count_width) - 1
        self._limit_power = self._limit_startup = self._limit_pulse = self._drain = 0
        self._bucket = self._watchdog = 0
        self._threshold = -1
        self._silent = 0
        self._heard = self._tripped = False
        self._guard = (False, False)  # the newer sample first
        self._armed = 0
        self._clks = 0  # clocks for which the request has been high
        self._cut = False
        self._delta = 0
        self._full = self._full_before = True
        self._offset = self._span = 0
        self._inside = False
        self._laser = False
        self._request = 0
        self._whole = False
        self._line = (0, False)
        self._power_sigma = self._startup_sigma = 0
        self._beat = 0
        self._beat_bits = heartbeat_bits
        self._point = (0, 0, False, False, False)
        self._age = 0
        self._first = self._least = 0

    @property
    def heartbeat(self) -> bool:
        """Return the core's sign of life for the guard."""
        return bool(self._beat >> self._beat_bits)

    @property
    def status(self) -> int:
        """Return the bits of ``laser_status_o``."""
        bits = (self._heard, self._guard[1], self._armed == _ARMED, self._full, self._tripped)
        return sum(bit << k for k, bit in enumerate(bits))

    @property
    def busy(self) -> bool:
        """Return whether a point is being processed."""
        return self._age != 0

    def pulse(self, *, laser: bool) -> bool:
        """Return the output of the main channel in a clock with this request."""
        return laser and self.permit

    def line(self, *, laser: bool, centre: bool, phase: int) -> tuple[int, bool]:
        """Return the line's power and whether it is inward, in a clock with these inputs."""
        if not centre:
            return self._line
        return self.power if self.pulse(laser=laser) else 0, _inward(phase)

    def step(
        self,
        *,
        laser: bool,
        line_start: bool,
        centre: bool,
        state: int,
        index_alive: bool,
        phase: int,
        alive: bool,
        guard_ok: bool,
        point_valid: bool = False,
        point_measured: bool = False,
        point_saturated: bool = False,
        point_maximum: int = 0,
        point_background: int = 0,
        point_power: int = 0,
        point_inward: bool = False,
        point_test: bool = False,
    ) -> None:
        """Advance by one clock; the arguments are the input ports."""
        enable = bool(self.settings.enable)
        run = state == pkg.MIRROR_RUN
        seeking = state in _SEEKING
        late = self._silent >= self._watchdog
        awake = enable and self._heard and not self._tripped and self._guard[1]
        allowed = awake and run and index_alive
        pulse = self.pulse(laser=laser)

        # The line, and the counters, which follow the values of the registers.
        line = self.line(laser=laser, centre=centre, phase=phase)
        if self._whole and laser and not pulse and not centre:
            line = (0, line[1])
        self._line = line
        self._whole = laser and (pulse if centre else self._whole)
        tripping = enable and self._heard and late and not alive
        self.cut_count = self._counted(self.cut_count, self._cut and laser)
        self.duty_count = self._counted(self.duty_count, self._full and not self._full_before)
        self.watchdog_count = self._counted(self.watchdog_count, tripping and not self._tripped)
        self._full_before = self._full

        # The permission.
        room = self._clks + 1 < self._limit_pulse if laser else self._limit_pulse != 0
        self._cut = pulse and not room
        self.permit = (
            allowed
            and self._armed == _ARMED
            and room
            and not self._full
            and (self.permit or not laser)
        )
        self._clks = min(self._clks + 1, _CLKS_MAX) if laser else 0
        self._full = self.level > self._threshold or (self._full and self.level != 0)
        self.level = max(self.level + self._delta, 0)
        self._delta = (self.power if pulse else 0) - self._drain

        self._shine(phase, awake=awake, seeking=seeking, run=run)
        took = (self._laser and not laser) or self._armed != _ARMED
        self._set_power(phase, allowed=allowed, took=took)
        self._laser = laser
        if not allowed:
            self._armed = 0
        elif line_start:
            self._armed = min(self._armed + 1, _ARMED)

        # The host and the guard.
        self._tripped = enable and (self._tripped or tripping)
        self._heard = alive or (self._heard and not late)
        self._silent = 0 if alive else self._silent + (not late)
        self._guard = (guard_ok, self._guard[0])
        self._beat = (self._beat + 1) % (2 << self._beat_bits)
        self._limit()

        # The next power.
        none_inward, none_outward = not self.power_inward, not self.power_outward
        if self._age == POWER_LATENCY - 1:
            self._commit()
            self._age = 0
        elif self._age:
            self._age += 1
        if point_valid and not point_test and point_power:
            height = max(point_maximum - point_background, 0)
            self._point = (point_power, height, point_measured, point_saturated, point_inward)
            self._age = 1
        still = not self.settings.adapt or not enable
        if still:
            self._age = 0
        if still or none_inward:
            self.power_inward = self._first
        if still or none_outward:
            self.power_outward = self._first
        self._first = max(self.settings.power, self._least)
        self._least = max(self.settings.power_min, 1)

    def _shine(self, phase: int, *, awake: bool, seeking: bool, run: bool) -> None:
        """Update the start-up channel."""
        settings = self.settings
        total = self._startup_sigma + self.startup
        self.startup_pin, self._startup_sigma = total >= _LEVELS, total % _LEVELS
        lit = awake and (seeking or run)
        self.startup = min(settings.startup, self._limit_startup) if lit else 0
        self.index_light = awake and (seeking or (run and self._inside))
        self._inside = self._offset < self._span
        self._offset = (phase - settings.index_begin) & _PHASE_MASK
        self._span = (settings.index_end - settings.index_begin) & _PHASE_MASK

    def _set_power(self, phase: int, *, allowed: bool, took: bool) -> None:
        """Update the level of the main channel."""
        settings = self.settings
        total = self._power_sigma + self.power
        self.power_pin, self._power_sigma = total >= _LEVELS, total % _LEVELS
        self.power = min(self._request, self._limit_power) if allowed else 0
        if took:
            if not settings.adapt:
                self._request = settings.power
            elif settings.shared or _inward(phase):
                self._request = self.power_inward
            else:
                self._request = self.power_outward

    def _limit(self) -> None:
        """Store the limits, limited by their ceilings, in registers."""
        settings, ceilings = self.settings, self.ceilings
        self._threshold = self._bucket - BUCKET_MARGIN
        self._limit_power = min(settings.limit_power, ceilings.power)
        self._limit_startup = min(settings.limit_startup, ceilings.startup)
        self._limit_pulse = min(settings.limit_pulse_clks, ceilings.pulse_clks)
        self._drain = min(settings.limit_drain, ceilings.drain)
        self._bucket = min(settings.limit_bucket, ceilings.bucket)
        watchdog = settings.watchdog_clks or ceilings.watchdog_clks
        self._watchdog = min(watchdog, ceilings.watchdog_clks)

    def _commit(self) -> None:
        """Give one direction or both the power that the last point demands."""
        power, height, measured, saturated, inward = self._point
        new = next_power(self.settings, power, height, measured=measured, saturated=saturated)
        if self.settings.shared or inward:
            self.power_inward = new
        if self.settings.shared or not inward:
            self.power_outward = new

    def _counted(self, count: int, event: bool) -> int:
        return min(count + event, self._count_max)


def _inward(phase: int) -> bool:
    """Return whether the mirror is in the first half of its turn."""
    return phase < 1 << (PHASE_WIDTH - 1)
