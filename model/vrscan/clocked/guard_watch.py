"""What the core knows of the laser's guard, the twin of ``rtl/safety/guard_watch.sv``."""

OK_LATENCY = 2  # clocks from guard_ok_i to ok
BEAT_LATENCY = 3  # clocks that ok outlasts beat_clks after the guard's last beat


class GuardWatch:
    """Clock-accurate watch. A new one is in the state after a reset.

    Args:
        beat_clks: Clocks without a beat after which the guard is dead, ``BeatClks``.
        count_width: Bits of the counter, ``CountWidth``.

    Attributes:
        fault: What the last trip had, bits as ``laser_guard.FAULT_*``.
        trip_count: Number of trips, saturating.
    """

    def __init__(self, beat_clks: int = 64, count_width: int = 16) -> None:
        self.fault = 0
        self.trip_count = 0
        self._count_max = (1 << count_width) - 1
        self._beat_clks = self._silent = beat_clks
        self._newer = self._older = (False, False, 0)  # the synchroniser
        self._beat = self._tripped = False

    @property
    def ok(self) -> bool:
        """Return whether the guard lives and lets light through."""
        return self._older[0] and self._silent != self._beat_clks

    def step(self, *, guard_ok: bool, guard_beat: bool, guard_fault: int) -> None:
        """Advance by one clock; the arguments are the input ports."""
        _, beat, fault = self._older
        if fault:
            self.fault = fault
            self.trip_count = min(self.trip_count + (not self._tripped), self._count_max)
        self._tripped = bool(fault)
        self._silent = 0 if beat != self._beat else min(self._silent + 1, self._beat_clks)
        self._beat = beat
        self._older = self._newer
        self._newer = (guard_ok, guard_beat, guard_fault)
