"""A line of an entry, with its defined result."""

from dataclasses import dataclass

from vrscan.data.arrays import Pixels

UNMEASURED = frozenset({"LOW_SNR", "TOO_NARROW", "TOO_WIDE", "NO_PHASE"})


@dataclass(frozen=True)
class Line:
    """One sensor line with its defined result.

    Attributes:
        pixels: Counts [length].
        flags: Names of exactly the flags that it raises; None: those of the equations.
        true: Position of the spot, px; None where there is none, or none that could be known.
        window: First and last pixel of the one-pass window, px; None: those of the equations.
        position: Position by (8) with T = N over the one-pass window, px; None: that of the
            equations.
    """

    pixels: Pixels
    flags: frozenset[str] | None = frozenset()
    true: float | None = None
    window: tuple[int, int] | None = None
    position: float | None = None

    @property
    def measured(self) -> bool | None:
        """Return whether it has a position; None where its flags are not stated."""
        return None if self.flags is None else not self.flags & UNMEASURED
