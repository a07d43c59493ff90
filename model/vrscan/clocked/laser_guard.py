"""The laser's gate with a clock of its own, the twin of ``rtl/safety/laser_guard.sv``."""

from dataclasses import dataclass

HEARTBEAT_LATENCY = 4  # clocks that the light outlasts guard_clks after a sampled beat
PULSE_LATENCY = 3  # clocks that a pulse outlasts pulse_clks after a sampled rise
FAULT_HEARTBEAT = 1
FAULT_PULSE = 2


@dataclass(frozen=True)
class Parameters:
    """The parameters of the module, under their names.

    Raises:
        ValueError: if a value is out of range.
    """

    guard_clks: int = 16
    pulse_clks: int = 300
    restart_beats: int = 16
    count_width: int = 16

    def __post_init__(self) -> None:
        """Check the ranges."""
        if self.guard_clks < 4 or self.pulse_clks < 1 or self.restart_beats < 1:
            raise ValueError("laser_guard: guard_clks >= 4, pulse_clks and restart_beats >= 1")


class LaserGuard:
    """Clock-accurate guard. A new one is in the state after a reset.

    Args:
        parameters: Parameters of the module.

    Attributes:
        ok: The registered permission; each output is its request and this permission.
        fault: The last reason for closing the gates, ``FAULT_*``.
        heartbeat_trips, pulse_trips: Numbers of closures for each reason, saturating.
    """

    def __init__(self, parameters: Parameters | None = None) -> None:
        self.parameters = parameters or Parameters()
        self.ok = False
        self.fault = 0
        self.heartbeat_trips = 0
        self.pulse_trips = 0
        self._heartbeat = (False, False, False)  # the newest sample first
        self._pulse = (False, False)
        self._silent = self.parameters.guard_clks
        self._high = 0
        self._beats = 0

    def step(self, *, heartbeat: bool, pulse: bool) -> None:
        """Advance by one clock."""
        limits = self.parameters
        beat = self._heartbeat[2] != self._heartbeat[1]
        high = self._pulse[1]
        silent = self._silent == limits.guard_clks
        long = self._high == limits.pulse_clks
        ready = self._beats == limits.restart_beats
        if self.ok and (silent or long):
            self.fault = FAULT_HEARTBEAT * silent + FAULT_PULSE * long
            most = (1 << limits.count_width) - 1
            self.heartbeat_trips = min(self.heartbeat_trips + silent, most)
            self.pulse_trips = min(self.pulse_trips + long, most)
        self.ok = ready and not silent and not long and (self.ok or not high)
        if silent or long:
            self._beats = 0
        elif beat and not ready:
            self._beats += 1
        self._silent = 0 if beat else self._silent + (not silent)
        self._high = self._high + (not long) if high else 0
        self._heartbeat = (heartbeat, *self._heartbeat[:2])
        self._pulse = (pulse, self._pulse[0])
