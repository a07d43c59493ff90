"""Two hosts on the bus to the registers, the twin of ``rtl/link/bus_arbiter.sv``."""

from collections.abc import Sequence

from vrscan.clocked.command_executor import Access

LATENCY = 1  # clocks from valid_i to bus_valid_o, and from bus_done_i to done_o
LINGER_CLKS = 24  # for which source 0 keeps the bus behind its answer


class BusArbiter:
    """Clock-accurate arbiter. A new one is in the state after a reset.

    Args:
        linger_clks: ``LingerClks``.

    Attributes:
        bus: The access that begins on the bus, or None.
        done: Source whose access is answered, or None.
        status, data: The answer; defined with ``done``.

    Raises:
        ValueError: if ``linger_clks`` is out of range.
    """

    def __init__(self, linger_clks: int = LINGER_CLKS) -> None:
        if linger_clks not in range(1, 256):
            raise ValueError("bus_arbiter: linger_clks must be 1 to 255")
        self.bus: Access | None = None
        self.done: int | None = None
        self.status = self.data = 0
        self._linger_clks = linger_clks
        self._waits = [False, False]
        self._owner: int | None = None  # of the access that is under way
        self._linger = 0

    def step(
        self,
        *,
        valid: int,
        accesses: Sequence[Access],
        bus_done: bool,
        bus_status: int,
        bus_data: int,
    ) -> None:
        """Advance by one clock.

        Args:
            valid: Which sources raise ``valid_i``, a bit each.
            accesses: What each source has at its ports.
            bus_done: Whether the bus answers.
            bus_status: Status of the answer.
            bus_data: Word of the answer.
        """
        owner = self._owner
        self._waits = [waits or bool(valid >> k & 1) for k, waits in enumerate(self._waits)]
        self.bus = None
        if owner is None:
            turn = 0 if self._waits[0] else 1 if self._waits[1] and not self._linger else None
            if turn is not None:
                self._waits[turn] = False
                self._owner, self.bus = turn, accesses[turn]
        self._linger = max(self._linger - 1, 0)
        self.done, self.status, self.data = None, bus_status, bus_data
        if owner is not None and bus_done:
            self.done, self._owner = owner, None
            if owner == 0:
                self._linger = self._linger_clks
