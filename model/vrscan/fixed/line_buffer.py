"""The line store with its replay, the twin of ``rtl/sensor/line_buffer.sv``."""

from dataclasses import dataclass, field

LATENCY = 3  # clocks from replay_i to the first valid_o


@dataclass
class LineBuffer:
    """Two banks of ``line_length`` pixels: one is written, the last good line is replayed.

    The model keeps whole lines. In the hardware the replayed pixels begin to come after ``LATENCY``
    clocks, one per clock.
    """

    line_length: int = 2048
    _writing: dict[int, int] = field(default_factory=dict, init=False)
    _readable: dict[int, int] = field(default_factory=dict, init=False)

    def write(self, index: int, pixel: int) -> None:
        """Store a pixel of the incoming line."""
        self._writing[index] = pixel

    def good(self) -> None:
        """Make the incoming line the readable one."""
        self._writing, self._readable = self._readable, self._writing

    def replay(self) -> list[int]:
        """Return the last good line, first pixel first.

        Raises:
            KeyError: if a pixel of it was never written.
        """
        return [self._readable[index] for index in range(self.line_length)]
