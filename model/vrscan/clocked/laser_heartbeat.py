"""Beats while two interlocks agree, the twin of ``rtl/safety/laser_heartbeat.sv``."""

DIFFERENCE_LATENCY = 2  # clocks from a difference to the first one that does not count


class LaserHeartbeat:
    """Clock-accurate heartbeat. A new one is in the state after a reset.

    Args:
        heartbeat_bits: Half the period of the beat, ``HeartbeatBits``.
    """

    def __init__(self, heartbeat_bits: int = 5) -> None:
        self._bits = heartbeat_bits
        self._beat = 0
        self._same = True
        self._broken = False

    @property
    def heartbeat(self) -> bool:
        """Return the core's sign of life for the guard."""
        return bool(self._beat >> self._bits)

    def step(self, *, enable: bool, first: int = 0, second: int = 0) -> None:
        """Advance by one clock; the arguments are the input ports."""
        if self._same and not self._broken:
            self._beat = (self._beat + 1) % (2 << self._bits)
        self._broken = not self._same or (self._broken and enable)
        self._same = first == second
