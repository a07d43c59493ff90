"""The boards that ``make bitstream`` builds: the one place of their clocks."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Board:
    """A board as it is shipped, placed and routed.

    Attributes:
        title: Its name in texts.
        clock_hz: Clock of the core, which the routed design meets.
        index_oversample: Samples of the index a clock, of its input registers.
        preset: Name of the preset whose line rate the clock allows.
    """

    title: str
    clock_hz: int
    index_oversample: int
    preset: str


BOARDS = {"ulx3s": Board("ULX3S", 76_666_667, 2, "ulx3s")}

SHIPPED = BOARDS["ulx3s"]  # whose rates and latencies tables and pictures state


def with_clock(clock_hz: float) -> Board | None:
    """Return the board that has a clock, if one does."""
    return next((each for each in BOARDS.values() if each.clock_hz == round(clock_hz)), None)
