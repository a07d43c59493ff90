"""Where a line begins and ends, the twin of ``rtl/sensor/line_extent.sv``."""

from dataclasses import dataclass, field


@dataclass(frozen=True)
class Extent:
    """The outputs of one clock; None where the hardware does not define a value.

    Attributes:
        index: Number of the pixel in its line, None where no pixel is taken.
        ends: Whether a line ends.
        short: Whether the line that ends has too few pixels.
        over: Whether the line that ends has too many pixels.
        unfinished: Whether a line begins though the one before has not ended.
    """

    index: int | None = None
    ends: bool = False
    short: bool | None = None
    over: bool | None = None
    unfinished: bool = False

    @property
    def good(self) -> bool:
        """Whether a line ends that has as many pixels as it should."""
        return self.ends and not self.short and not self.over


@dataclass
class LineExtent:
    """Follows the strobes of a sensor. A new one is as after a reset.

    Args:
        line_length: Number of pixels of a good line, ``LineLength``.
    """

    line_length: int = 2048
    _in_line: bool = field(default=False, init=False)
    _over: bool = field(default=False, init=False)
    _fill: int = field(default=0, init=False)

    def step(self, start: bool, valid: bool, end: bool) -> Extent:
        """Take the strobes of one clock and return the outputs in it."""
        unfinished = start and self._in_line
        if start:
            self._in_line, self._over, self._fill = True, False, 0
        if not self._in_line:
            return Extent()
        index = None
        if valid and self._fill < self.line_length:
            index = self._fill
            self._fill += 1
        elif valid:
            self._over = True
        self._in_line = not end
        if not end:
            return Extent(index, unfinished=unfinished)
        return Extent(index, True, self._fill < self.line_length, self._over, unfinished)
