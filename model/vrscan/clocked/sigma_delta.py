"""A level as the share of time that a pin is high, the twin of ``rtl/actuators/sigma_delta.sv``."""

from dataclasses import dataclass, field


@dataclass
class SigmaDelta:
    """Modulator of the first order. A new one is in the state after a reset.

    Args:
        width: Bits of the level, ``Width``.

    Attributes:
        pin: The output.
    """

    width: int
    pin: bool = field(default=False, init=False)
    _sum: int = field(default=0, init=False)

    def step(self, level: int, clocks: int = 1) -> None:
        """Advance by some clocks, at least one, with the same level."""
        end = 1 << self.width
        total = (self._sum + (clocks - 1) * level) % end + level
        self.pin, self._sum = total >= end, total % end
