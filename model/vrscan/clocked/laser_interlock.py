"""Permission and limits of the laser's light, the twin of ``rtl/safety/laser_interlock.sv``.

``docs/laser-safety.md`` describes the limits.
"""

from dataclasses import dataclass

from vrscan.data import pkg
from vrscan.registers.settings import InterlockSettings

PHASE_WIDTH = 16
BUCKET_MARGIN = 4 << pkg.POWER_WIDTH  # margin of the bucket: four clocks of the largest power
INTERLOCK_LATENCY = 1  # clocks from state_i .. startup_ok_i, guard_ok_i, laser_enable to dark
WINDOW_LATENCY = 3  # clocks from phase_i to index_light_o
LIMIT_LATENCY = 2  # clocks from a limit to power_o, startup_o
WATCHDOG_LATENCY = 3  # clocks that the light outlasts the watchdog's time

_PHASE_MASK = (1 << PHASE_WIDTH) - 1
_CLKS_MAX = (1 << pkg.LINE_CLKS_WIDTH) - 1
_ARMED = 2  # number of line starts
_THRESHOLD_MASK = (1 << 33) - 1
_DELTA_MASK = (1 << (pkg.POWER_WIDTH + 2)) - 1


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


class LaserInterlock:
    """Clock-accurate interlock. A new one is in the state after a reset.

    ``gate`` depends on an input of its own clock, so it is a function of it; all other outputs are
    registers.

    Args:
        settings: The registers. ``settings`` may be replaced between two steps.
        ceilings: Parameters of the module.
        count_width: Bits of the counters, ``CountWidth``.

    Attributes:
        permit: The registered permission of a pulse.
        power, startup: Levels of the two channels; u16.
        index_light: Whether the start-up channel is on.
        level: Level of the bucket, power times clocks.
        signature: Parity of every register that has a say about light, a clock ago.
        cut_count, duty_count, watchdog_count: Counters of the limits that acted, saturating.
    """

    def __init__(
        self, settings: InterlockSettings, ceilings: Ceilings | None = None, count_width: int = 16
    ) -> None:
        self.settings = settings
        self.ceilings = ceilings or Ceilings()
        self.permit = False
        self.power = 0
        self.startup = 0
        self.index_light = False
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
        self._guard = False
        self.signature = False
        self._armed = 0
        self._clks = 0  # clocks for which the request has been high
        self._cut = False
        self._delta = 0
        self._full = self._full_before = True
        self._offset = self._span = 0
        self._inside = False
        self._scan = (False, False)  # scanning and startup_ok

    @property
    def armed(self) -> bool:
        """Return whether the second line has started with all well."""
        return self._armed == _ARMED

    @property
    def status(self) -> int:
        """Return the bits of ``status_o``."""
        bits = (self._heard, self._guard, self.armed, self._full, self._tripped, *self._scan)
        return sum(bit << k for k, bit in enumerate(bits))

    def gate(self, pulse: bool) -> bool:
        """Return the output of the main channel in a clock with this request."""
        return pulse and self.permit

    def step(
        self,
        *,
        pulse: bool,
        power: int,
        line_start: bool,
        state: int,
        index_alive: bool,
        scanning: bool,
        startup_ok: bool,
        phase: int,
        alive: bool,
        guard_ok: bool,
    ) -> None:
        """Advance by one clock; the arguments are the input ports."""
        self.signature = self._parity()
        enable = bool(self.settings.enable)
        run = state == pkg.MIRROR_RUN
        late = self._silent >= self._watchdog
        self._scan = (scanning, startup_ok)
        awake = enable and self._heard and not self._tripped and guard_ok
        allowed = awake and run and index_alive and scanning
        lit = self.gate(pulse)

        # The counters follow the values of the registers.
        tripping = enable and self._heard and late and not alive
        self.cut_count = self._counted(self.cut_count, self._cut and pulse)
        self.duty_count = self._counted(self.duty_count, self._full and not self._full_before)
        self.watchdog_count = self._counted(self.watchdog_count, tripping and not self._tripped)
        self._full_before = self._full

        # The permission.
        room = self._clks + 1 < self._limit_pulse if pulse else self._limit_pulse != 0
        self._cut = lit and not room
        self.permit = (
            allowed and self.armed and room and not self._full and (self.permit or not pulse)
        )
        self._clks = min(self._clks + 1, _CLKS_MAX) if pulse else 0
        if not allowed:
            self._armed = 0
        elif line_start:
            self._armed = min(self._armed + 1, _ARMED)

        # The bucket and the power.
        self._full = self.level > self._threshold or (self._full and self.level != 0)
        self.level = max(self.level + self._delta, 0)
        self._delta = (self.power if lit else 0) - self._drain
        self.power = min(power, self._limit_power) if allowed else 0

        # The host.
        self._tripped = enable and (self._tripped or tripping)
        self._heard = alive or (self._heard and not late)
        self._silent = 0 if alive else self._silent + (not late)
        self._guard = guard_ok

        self._shine(phase, awake=awake and startup_ok, settling=state == pkg.MIRROR_SETTLE, run=run)
        self._limit()

    def _shine(self, phase: int, *, awake: bool, settling: bool, run: bool) -> None:
        """Update the start-up channel."""
        settings = self.settings
        lit = awake and (settling or run)
        self.startup = min(settings.startup, self._limit_startup) if lit else 0
        self.index_light = awake and (settling or (run and self._inside))
        self._inside = self._offset < self._span
        self._offset = (phase - settings.index_begin) & _PHASE_MASK
        self._span = (settings.index_end - settings.index_begin) & _PHASE_MASK

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

    def _parity(self) -> bool:
        """Return the parity of the registers as they are."""
        armed = 0b11 if self.armed else self._armed
        words = (
            *(self._limit_power, self._limit_startup, self._limit_pulse, self._drain),
            *(self._bucket, self._watchdog, self._silent, self._clks, self.power, self.level),
            *(self._offset, self._span, self.startup, armed, self._heard, self._tripped),
            *(self.permit, self._cut, self._full, self._inside, self.index_light),
            # Signed ones, in as many bits as they have.
            self._threshold & _THRESHOLD_MASK,
            self._delta & _DELTA_MASK,
        )
        return bool(sum(int(word).bit_count() for word in words) & 1)

    def _counted(self, count: int, event: bool) -> int:
        return min(count + event, self._count_max)
