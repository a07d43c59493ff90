"""The type of a section, and the looks that its pictures share."""

import io
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from matplotlib.figure import Figure

from vrscan.data.config import Config
from vrscan.show.style import COLOURS, INK, QUIET
from vrscan.study.bench.bench_page import Block
from vrscan.study.bench.cells import Cell, Figures, plain

KEYS = {"threshold": "one-pass", "two_pass": "two-pass", "fit": "fit"}  # of the modes' detectors
Found = Callable[[Cell], Figures]  # the figures of a cell that the section has asked for

BOUND: dict[str, Any] = {"color": INK, "linestyle": (0, (4, 2)), "linewidth": 1.1, "zorder": 5}


@dataclass(frozen=True)
class Order:
    """The order for a page, which is the same for all sections."""

    config: Config
    seed: int
    quick: bool  # whether to do a tenth of the work only

    def size(self, full: int, quick: int) -> int:
        """Return how much is computed."""
        return quick if self.quick else full

    def cell(
        self,
        work: str,
        parameters: Mapping[str, Any],
        *,
        seed: int | None = None,
        timed: bool = False,
    ) -> Cell:
        """Return a cell for the configuration.

        Args:
            work: Name of the work.
            parameters: Parameters of the work, beside the configuration.
            seed: Seed of the cell; the order's own where None.
            timed: Whether it measures time.
        """
        given = {"config": plain(self.config), **parameters}
        return Cell(work, given, self.seed if seed is None else seed, timed)


@dataclass(frozen=True)
class Section:
    """A section of the page.

    Attributes:
        key: Id of the section on the page.
        title: Heading of the section.
        cells: Function that returns the cells that it needs.
        blocks: Function that returns its blocks from the figures of those cells.
    """

    key: str
    title: str
    cells: Callable[[Order], Sequence[Cell]]
    blocks: Callable[[Order, Found], Sequence[Block[Any]]]


@dataclass(frozen=True)
class Look:
    """Style of a detector's curve."""

    colour: str
    marker: str
    dashes: str = "-"
    width: float = 1.0


_FALLBACK = Look(QUIET, "x", ":")
_LOOKS = {
    "printed": Look(COLOURS[0], "v", "--"),
    "one-pass": Look(COLOURS[0], "o", width=2.2),
    "float": Look("#7fb2d1", "."),
    "two-pass": Look("#0b3c5d", "D", width=2.2),
    "fit": Look("#e07a1f", "*", width=2.2),
    "centroid-noise": Look(COLOURS[1], "s"),
    "centroid-height": Look("#e8a598", "s", "--"),
    "parabola": Look(COLOURS[2], "^"),
    "gaussian-3": Look("#8fbf93", "^", "--"),
    "blais-rioux-4": Look(COLOURS[3], "<"),
    "blais-rioux-8": Look("#b795bf", ">", "--"),
    "matched": Look("#b8860b", "P"),
    "least-squares": Look("#6b705c", "X"),
    "likelihood": Look("#d1495b", "h"),
    "root": Look("#1b998b", "p"),
    "third-root": Look("#66c2a5", "p", "--"),
    "logarithm": Look("#8d6a9f", "d"),
    "flanks": Look("#a07855", "H"),
    "one-step": Look("#f2b077", "*", "--"),
}


def look(key: str) -> Look:
    """Return the style of a detector."""
    return _LOOKS.get(key, _FALLBACK)


def is_own(key: str, config: Config) -> bool:
    """Return whether a detector is that of a configuration."""
    return key == KEYS[config.peak.window]


def png(figure: Figure) -> bytes:
    """Return a figure as a file; equal figures give equal files."""
    file = io.BytesIO()
    figure.savefig(file, format="png", dpi=120, metadata={"Software": None})
    return file.getvalue()
