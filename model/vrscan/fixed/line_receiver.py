"""From the sensor's strobes to complete lines, the twin of ``rtl/sensor/line_receiver.sv``."""

from dataclasses import dataclass, field

from vrscan.data import pkg
from vrscan.fixed.line_extent import LineExtent

LATENCY = 1  # clocks from pixel_valid_i to valid_o and from line_end_i to good_o


@dataclass(frozen=True)
class Received:
    """Registered outputs of one clock; None where the hardware does not define a value."""

    pixel: int | None = None
    index: int | None = None
    good: bool = False
    line_number: int | None = None
    lost: bool | None = None


@dataclass
class LineReceiver:
    """Clock-accurate receiver.

    Args:
        line_length: Number of pixels of a good line, ``LineLength``.
        min_period: Least number of clocks between the ends of two good lines, ``MinPeriod``; 0 for
            no limit.
        count_width: Bits of the fault counters, ``CountWidth``; they stop at their largest value.

    Attributes:
        short, long, unfinished, early, skipped: Numbers of dropped lines by fault.
    """

    line_length: int = 2048
    min_period: int = 0
    count_width: int = 16
    short: int = 0
    long: int = 0
    unfinished: int = 0
    early: int = 0
    skipped: int = 0
    _extent: LineExtent = field(init=False)
    _lost: bool = field(default=False, init=False)
    _number: int = field(default=0, init=False)
    _period: int = field(default=0, init=False)

    def __post_init__(self) -> None:
        """Set the state after a reset: no line has ended recently."""
        self._extent = LineExtent(self.line_length)
        self._period = self.min_period

    def _count(self, value: int) -> int:
        return min(value + 1, (1 << self.count_width) - 1)

    def step(
        self,
        start: bool,
        valid: bool,
        pixel: int,
        end: bool,
        skip: bool = False,
        forget: bool = False,
    ) -> Received:
        """Take the strobes of one clock and return the outputs after it."""
        number_mask = (1 << pkg.LINE_NUMBER_WIDTH) - 1
        dropped = False
        extent = self._extent.step(start, valid, end)
        if extent.unfinished:
            self.unfinished = self._count(self.unfinished)
            dropped = True
        if start:
            self._number = (self._number + 1) & number_mask
        good = False
        if extent.ends:
            if extent.short:
                self.short = self._count(self.short)
            elif extent.over:
                self.long = self._count(self.long)
            elif self._period < self.min_period:
                self.early = self._count(self.early)
            elif skip:
                self.skipped = self._count(self.skipped)
            else:
                good = True
            dropped = dropped or not good
        lost = self._lost
        self._lost = (self._lost or dropped) and not good
        self._period = 1 if good else min(self._period + 1, self.min_period)
        if forget:
            self._period = 1 << 12  # the longest there is
        return Received(
            pixel=pixel if extent.index is not None else None,
            index=extent.index,
            good=good,
            line_number=(self._number - 1) & number_mask if good else None,
            lost=lost if good else None,
        )
