"""One figure of the number table."""

import math
from dataclasses import dataclass

from vrscan.data.arrays import Floats

SEED = 20100301  # seed of every measurement; each adds its own words


@dataclass(frozen=True)
class Figure:
    """A measured number with its prediction and its limit; NaN where there is none.

    Attributes:
        group: Group of figures, which names what is measured.
        name: Name of the figure within its group.
        unit: Unit of all four numbers.
        measured: Result of the measurement.
        predicted: The bound that follows from the widths; measured must not pass it.
        floor: Error that the output's own rounding leaves, however good the rest is.
        limit: Value that is asked for.
        at_least: Whether ``limit`` is a lower limit.
        headline: Row of the summary, which shows its figure nearest to the limit; none if empty.
    """

    group: str
    name: str
    unit: str
    measured: float
    predicted: float = math.nan
    floor: float = math.nan
    limit: float = math.nan
    at_least: bool = False
    headline: str = ""

    def __str__(self) -> str:
        """Return one line: measured / predicted / floor / limit."""
        known = (self.predicted, self.floor, self.limit)
        others = " / ".join("-" if math.isnan(value) else f"{value:.4g}" for value in known)
        return f"{self.group}, {self.name}: {self.measured:.4g} / {others} {self.unit}"

    @property
    def judged(self) -> bool:
        """Return whether there is a bound or a limit to keep."""
        return not (math.isnan(self.predicted) and math.isnan(self.limit))

    @property
    def nearness(self) -> float:
        """Return the nearness to the limit: 1 at it, above 1 beyond; without a limit the number."""
        if math.isnan(self.limit):
            return self.measured
        return self.limit / self.measured if self.at_least else self.measured / self.limit

    @property
    def passes(self) -> bool:
        """Return whether every existing bound and limit was kept."""
        if math.isnan(self.measured):
            return not self.judged
        if self.at_least:
            return not self.measured < self.limit
        return not (self.measured > self.predicted or self.measured > self.limit)


def mean(values: Floats) -> float:
    """Return the mean; 0 of no value."""
    return float(values.mean()) if values.size else 0.0


def largest(values: Floats) -> float:
    """Return the largest absolute value; NaN for no values."""
    return float(abs(values).max()) if values.size else math.nan
