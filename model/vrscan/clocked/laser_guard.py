"""The laser's gate with a clock of its own, the twin of ``rtl/safety/laser_guard.sv``."""

from dataclasses import dataclass

HEARTBEAT_LATENCY = 4  # clocks that the light outlasts guard_clks after a sampled beat
PULSE_LATENCY = 3  # clocks that a pulse outlasts pulse_clks after a sampled rise
ENABLE_LATENCY = 3  # clocks from a sampled end of the enable to dark
BEAT_CLKS = 4  # of a level of the guard's own beat
FAULT_SILENT, FAULT_LONG, FAULT_SPENT, FAULT_LIT, FAULT_LEVEL = (1 << k for k in range(5))
DUTY_COST = 7  # of a lit sample: an eighth of the time may be lit
_IN_FLIGHT = 4  # samples that are lit after the last one of a budget


@dataclass(frozen=True)
class Parameters:
    """The parameters of the module, under their names.

    Raises:
        ValueError: if a value is out of range.
    """

    guard_clks: int = 16
    pulse_clks: int = 320
    burst_clks: int = 400
    index_clks: int = 320_000_000
    startup_clks: int = 64
    drive_clks: int = 100_000
    restart_beats: int = 16

    def __post_init__(self) -> None:
        """Check the ranges."""
        for name, value in vars(self).items():
            if value < (4 if name == "guard_clks" else 1):
                raise ValueError(f"laser_guard: {name} = {value} is too small")


class _Budget:
    """A level that lit samples raise and dark ones lower."""

    def __init__(self, cost: int, clks: int) -> None:
        self._cost, self._end = cost, cost * clks
        self._most = cost * (clks + _IN_FLIGHT)
        self._level = 0

    @property
    def spent(self) -> bool:
        return self._level >= self._end

    def step(self, on: bool) -> None:
        level = self._level + self._cost if on else self._level - 1
        self._level = max(0, min(level, self._most))


class LaserGuard:
    """Clock-accurate guard. A new one is in the state after a reset.

    Args:
        parameters: Parameters of the module.

    Attributes:
        ok: The registered permission of the light; each output is its request and this.
        moves: The same of the mirror's drive and level.
        fault: What tripped, ``FAULT_*``, until the next permission.
    """

    def __init__(self, parameters: Parameters | None = None) -> None:
        self.parameters = limits = parameters or Parameters()
        self.ok = self.moves = False
        self.fault = 0
        self._newer = self._older = (False,) * 6  # the synchroniser
        self._heartbeat = False
        self._fresh = False
        self._silent = limits.guard_clks
        self._beats = self._high = self._driven = self._clocks = 0
        self._burst = _Budget(DUTY_COST, limits.burst_clks)
        self._index = _Budget(1, limits.index_clks)
        self._startup = _Budget(DUTY_COST, limits.startup_clks)

    @property
    def beat(self) -> bool:
        """Return the guard's own beat."""
        return bool(self._clocks // BEAT_CLKS % 2)

    def step(
        self,
        *,
        heartbeat: bool,
        enable: bool,
        pulse: bool,
        index_light: bool,
        startup_pin: bool,
        drive: bool,
    ) -> None:
        """Advance by one clock."""
        limits = self.parameters
        beaten, enabled, lit, indexed, level, driven = self._older
        silent = self._silent == limits.guard_clks
        long = self._high == limits.pulse_clks
        ready = self._beats == limits.restart_beats
        held = self._driven == limits.drive_clks
        found = (silent, long, self._burst.spent, self._index.spent, self._startup.spent)
        faults = sum(bit << k for k, bit in enumerate(found))

        if enabled and faults and (self._fresh or not self.fault):
            self.fault = faults
        elif self.ok:
            self.fault = 0
        well = enabled and self._fresh and not faults and ready
        self.ok = well and (self.ok or not (lit or indexed))
        self.moves = ready and not silent and not held
        self._fresh = (not enabled and ready) or (self._fresh and not faults)

        beat = beaten != self._heartbeat
        self._beats = 0 if silent else self._beats + (beat and not ready)
        self._silent = 0 if beat else self._silent + (not silent)
        self._high = self._high + (not long) if lit else 0
        self._driven = self._driven + (not held) if driven else 0
        self._burst.step(lit)
        self._index.step(indexed)
        self._startup.step(level)
        self._clocks += 1
        self._heartbeat = beaten
        self._older = self._newer
        self._newer = (heartbeat, enable, pulse, index_light, startup_pin, drive)
