"""The distance of the scene by good points, the twin of ``rtl/actuators/focus_filter.sv``."""

from vrscan.data import pkg
from vrscan.registers.settings import FocusSettings

LATENCY = 8  # clocks from valid to the distance

FINE_WIDTH = 16  # bits of the average below those of z
BAD_FLAGS = sum(
    1 << bit
    for bit in (
        pkg.FLAG_NO_RANGE,
        pkg.FLAG_OUT_OF_RANGE,
        pkg.FLAG_NOT_RUNNING,
        pkg.FLAG_INDEX_FAULT,
        pkg.FLAG_UNSETTLED,
    )
)

_AVERAGE = 6  # age of a point in clocks
_DISTANCE = LATENCY - 1
_MOST_OTHERS = (1 << 16) - 1


def is_good(*, measured: bool, flags: int) -> bool:
    """Return whether a point counts for the distance, if it does not belong to a test line."""
    return measured and not flags & BAD_FLAGS


class FocusFilter:
    """Clock-accurate filter. A new one is in the state after a reset.

    Args:
        settings: The configuration; it may be changed between two steps.

    Attributes:
        valid: Whether there is a new distance in this clock.
        distance: Averaged distance; s24, 12 fraction bits, mm.
        lapse: Whether the good point at work is a first one after a lapse.
    """

    def __init__(self, settings: FocusSettings) -> None:
        self.settings = settings
        self.valid = False
        self.distance = 0
        self.lapse = False

        self._age = 0  # clocks since a good point, 0 when idle
        self._others = 0  # points in a row that were not good
        self._z = 0
        self._points = 0  # good points of the average so far, up to the whole average
        self._level = 0  # log2 of this number
        self._enough = False
        self._average = 0  # with FINE_WIDTH more bits than z

    @property
    def busy(self) -> bool:
        """Return whether a good point is at work."""
        return self._age != 0

    def step(
        self, *, valid: bool, measured: bool, flags: int, test: bool, z: int, busy: bool
    ) -> None:
        """Advance by one clock with these inputs."""
        age = self._age
        take = valid and not (test or age or self.valid or busy)
        self.valid = self.lapse = False
        if take and is_good(measured=measured, flags=flags):
            self._z = z
            self._age = 1
        elif take:
            self._others = min(self._others + 1, _MOST_OTHERS)
        if not age:
            return
        self._age += 1
        if age == 1:
            self.lapse = self._others > self.settings.lapse
            self._others = 0
            if self.lapse:
                self._level = self._points = 0
        elif age == _AVERAGE:
            self._take_average()
        elif age == _DISTANCE:
            self._age = 0
            if self._enough:
                self.valid = True
                self.distance = (self._average >> FINE_WIDTH - 1) + 1 >> 1

    def _take_average(self) -> None:
        """Update the average with a good point."""
        shift = min(self._level, self.settings.average_shift)
        self._enough = self._level >= self.settings.average_shift
        delta = (self._z << FINE_WIDTH) - self._average
        # To nearest, half up.
        self._average += (2 * delta >> shift) + 1 >> 1
        if not self._enough:
            self._points += 1
            self._level = (self._points + 1).bit_length() - 1
