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
        mixed: Whether it raises MIXED, too, which only a fit does.
        at_one: The same with one window, ``window = "threshold"``, where they are others.
        true: Position of the spot, px; None where there is none, or none that could be known.
        window: First and last pixel of the one-pass window, px; None: those of the equations.
        position: Position by (8) with T = N over the one-pass window, px; None: that of the
            equations.
    """

    pixels: Pixels
    flags: frozenset[str] | None = frozenset()
    at_one: frozenset[str] | None = None
    mixed: bool = False
    true: float | None = None
    window: tuple[int, int] | None = None
    position: float | None = None

    def raises(self, window: str) -> frozenset[str] | None:
        """Return its flags with this window, a value of ``peak.window``."""
        if window == "threshold" and self.at_one is not None:
            return self.at_one
        more = frozenset({"MIXED"} if self.mixed and window == "fit" else ())
        return None if self.flags is None else self.flags | more

    def measured(self, window: str) -> bool | None:
        """Return whether it has a position; None where its flags are not stated."""
        flags = self.raises(window)
        return None if flags is None else not flags & UNMEASURED
