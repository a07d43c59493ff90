"""The order of a commit, the twin of ``rtl/link/commit_control.sv``."""

EMPTY_CLKS = 8  # clocks from the rise of hold until the chain's emptiness is looked at
SETTLE_CLKS = 8  # clocks from take until the mirror is


class CommitControl:
    """Clock-accurate state machine. A new one is in the state after a reset: in a commit.

    Args:
        entries: Entries of the largest table, ``Entries``.

    Attributes:
        waiting, configuration: The two bits of the status.
        copy, index: Whether an entry is copied, and which.
        hold, take, superseding: The other outputs.
    """

    def __init__(self, entries: int = 1024) -> None:
        self._entries = entries
        self.waiting = self.copy = True
        self.configuration = 1
        self.index = 0
        self.hold = self.take = self.superseding = False
        self._left = 0  # clocks until a condition is looked at
        self._phase = "copy"

    def step(self, *, strobe: bool, empty: bool, renewing: bool) -> None:
        """Take the inputs of one clock and advance to the next."""
        taken, self.take = self.take, False
        if not self.waiting:
            self.waiting = self.copy = strobe
            self._phase = "copy"
        elif self.copy:
            self.index = (self.index + 1) % self._entries
            if not self.index:
                self.copy, self.hold, self._left = False, True, EMPTY_CLKS
                self._phase = "drain"
        elif taken:
            self.configuration ^= 1
            self._left = SETTLE_CLKS
            self._phase = "settle"
        elif self._left:
            self._left -= 1
        elif self._phase == "drain":
            self.take = self.superseding = empty
        elif self._phase == "settle":
            self.hold = False
            self._phase = "renew"
        elif not renewing:
            self.waiting = self.superseding = False
