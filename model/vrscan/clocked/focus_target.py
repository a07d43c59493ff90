"""Where the lens should be, the twin of ``rtl/actuators/focus_target.sv``."""

from vrscan.registers.focus_registers import FRACTION_WIDTH, TABLE_SIZE, Mode
from vrscan.registers.settings import FocusSettings

LATENCY = 18  # clocks from a distance to the target

_COMPARE = 14  # age of a distance in clocks
_DECIDE = LATENCY - 1


def position(distance: int, z_begin: int, z_shift: int, table: list[int]) -> int:
    """Return the lens's position for a distance.

    Args:
        distance: Distance, s24, 12 fraction bits, mm, like ``z_begin``.
        z_begin: Distance of the table's first entry.
        z_shift: The entries are 2**(z_shift + FRACTION_WIDTH) steps of a distance apart.
        table: ``TABLE_SIZE`` positions.

    Returns:
        The position, linear between the entries, to nearest, half up; beyond the table its end.
    """
    entries = max(distance - z_begin, 0) >> z_shift
    index, fraction = entries >> FRACTION_WIDTH, entries & (1 << FRACTION_WIDTH) - 1
    if index >= TABLE_SIZE - 1:
        return table[-1]
    moved = (table[index + 1] - table[index]) * fraction
    return table[index] + ((moved >> FRACTION_WIDTH - 1) + 1 >> 1)


class FocusTarget:
    """Clock-accurate choice of the target. A new one is in the state after a reset.

    Args:
        settings: The configuration; it may be changed between two steps.

    Attributes:
        table: ``TABLE_SIZE`` positions.
        busy: Whether a distance is at work.
        target: Target of the lens; u16.
        known: Whether there is one.
    """

    def __init__(self, settings: FocusSettings) -> None:
        self.settings = settings
        self.table = [0] * TABLE_SIZE
        self.busy = False
        self.target = 0
        self.known = False

        self._age = 0  # clocks since a distance, 0 when idle
        self._off = 0  # distance of the candidate from the target
        self._candidate = 0
        self._far_count = 0
        self._taken = False  # whether the target comes from the table

    def step(
        self,
        *,
        valid: bool,
        distance: int,
        lapse: bool,
        table_write: bool = False,
        table_index: int = 0,
        table_position: int = 0,
    ) -> None:
        """Advance by one clock with these inputs."""
        settings, age = self.settings, self._age
        if age == _COMPARE:
            self._candidate = position(distance, settings.z_begin, settings.z_shift, self.table)
            self._off = abs(self._candidate - self.target)
        if table_write:
            self.table[table_index] = table_position

        if lapse:
            self._far_count = 0
        if settings.mode == Mode.MANUAL:
            self.target = settings.manual
        if settings.mode != Mode.AUTOMATIC:
            self._taken = False
            self._far_count = 0
        elif age == _DECIDE:
            self._decide()
        self.known = settings.mode == Mode.MANUAL or self._taken
        if valid:
            self._age = 1
        elif age:
            self._age = (age + 1) % LATENCY
        self.busy = self._age > 0

    def _decide(self) -> None:
        """Take the candidate as target, or wait."""
        far = self._off > self.settings.hysteresis
        if not self._taken or (far and self._far_count + 1 >= self.settings.hold_points):
            self.target = self._candidate
            self._taken = True
            self._far_count = 0
        else:
            self._far_count = self._far_count + 1 if far else 0
