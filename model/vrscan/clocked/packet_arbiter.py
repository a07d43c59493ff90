"""Packets of several sources on one serial line, the twin of ``rtl/link/packet_arbiter.sv``."""

LATENCY = 2  # clocks from valid_i to valid_o
PACKET_BUBBLE = 1  # clocks between two packets


class PacketArbiter:
    """Clock-accurate arbiter. A new one is in the state after a reset.

    Ports of the sources are packed: source k in bit k, or in byte k.

    Args:
        sources: Number of sources, ``Sources``.

    Attributes:
        valid: Whether ``data`` is a byte of a packet.
        data, last: The byte, and whether it is the packet's last; defined with ``valid``.
        busy: Whether a packet is being taken.

    Raises:
        ValueError: if ``sources`` is out of range.
    """

    def __init__(self, sources: int = 3) -> None:
        if sources not in range(2, 17):
            raise ValueError("packet_arbiter: sources must be 2 to 16")
        self.valid = False
        self.data = 0
        self.last = False
        self._sources = sources
        self._granted: int | None = None
        self._next = 1  # the stream whose turn it is

    @property
    def busy(self) -> bool:
        """Return whether a packet is being taken."""
        return self._granted is not None

    def ready(self, ready: bool) -> int:
        """Return ``ready_o``, which follows ``ready_i`` in the same clock."""
        if self._granted is None or (self.valid and not ready):
            return 0
        return 1 << self._granted

    def step(self, *, valid: int, data: int, last: int, hold: bool, ready: bool) -> None:
        """Advance by one clock."""
        granted = self._granted
        taken = bool(valid & self.ready(ready))
        if ready or not self.valid:
            self.valid = taken
            if taken and granted is not None:
                self.data = data >> 8 * granted & 0xFF
                self.last = bool(last >> granted & 1)
        if granted is None:
            self._granted = self._chosen(valid, hold)
        elif taken and self.last:
            self._granted = None

    def _chosen(self, valid: int, hold: bool) -> int | None:
        """Return the source that may begin a packet."""
        if valid & 1:
            return 0
        if hold:
            return None
        streams = self._sources - 1
        for k in range(streams):
            source = (self._next - 1 + k) % streams + 1
            if valid >> source & 1:
                self._next = source % streams + 1
                return source
        return None
