"""A few registers on the bus of the link, in plain Python: every status is among their answers."""

from vrscan.clocked.command_executor import Access, Answer
from vrscan.data import link_pkg

FIRST = 0x100  # of the free registers
COUNT = 64
READ_ONLY = 0x150
LOCKED = 0x151
KEY = 0x152  # a write of 1 locks DOOR for good
DOOR = 0x153
SMALL = 0x154  # values up to 99
NOTHING = 0x160


class BusRegisters:
    """FIRST to FIRST + COUNT - 1 hold anything, those above have their moods, others are none.

    Attributes:
        words: What they hold, by address.
        accesses: Every access there was.
    """

    def __init__(self) -> None:
        self.words = dict.fromkeys(
            [*range(FIRST, FIRST + COUNT), READ_ONLY, LOCKED, KEY, DOOR, SMALL], 0
        )
        self.words[READ_ONLY] = 0xFEED_F00D
        self.accesses: list[Access] = []

    def __call__(self, access: Access) -> Answer:
        """Answer an access."""
        self.accesses.append(access)
        kind, address, data = access
        if address not in self.words:
            return Answer(link_pkg.STATUS_NO_ADDRESS, 0xDEAD_DEAD)
        if kind != link_pkg.ACCESS_READ:
            closed = address == LOCKED or (address == DOOR and self.words[KEY] == 1)
            if address == READ_ONLY:
                return Answer(link_pkg.STATUS_READ_ONLY, 0)
            if closed:
                return Answer(link_pkg.STATUS_LOCKED, 0)
            if address == SMALL and data > 99:
                return Answer(link_pkg.STATUS_BAD_VALUE, 0)
        if kind == link_pkg.ACCESS_WRITE:
            self.words[address] = data
        return Answer(link_pkg.STATUS_OK, self.words[address])
