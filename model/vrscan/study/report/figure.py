"""One figure of the number table."""

import math
from dataclasses import dataclass

import numpy as np

from vrscan.data.arrays import Floats

SEED = 20100301  # of every measurement; each adds its own words to it


@dataclass(frozen=True)
class Figure:
    """A measured number beside what is known of it; NaN where there is no such thing.

    Attributes:
        group: What is measured.
        name: Which of its figures.
        unit: Of all four numbers.
        measured: What came out.
        predicted: The bound that follows from the widths; measured must not pass it.
        floor: What the output's own rounding leaves, however good the rest is.
        limit: What is asked for.
        at_least: Whether ``limit`` is a lower one.
        headline: Its row in the summary, which shows the one nearest to its limit; none if empty.
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
        """Whether there is a bound or a limit to keep."""
        return not (math.isnan(self.predicted) and math.isnan(self.limit))

    @property
    def nearness(self) -> float:
        """How near the limit is: 1 is at it, above 1 beyond; the bare number without a limit."""
        if math.isnan(self.limit):
            return self.measured
        return self.limit / self.measured if self.at_least else self.measured / self.limit

    @property
    def passes(self) -> bool:
        """Whether every bound and limit that there is was kept."""
        if math.isnan(self.measured):
            return not self.judged
        if self.at_least:
            return not self.measured < self.limit
        return not (self.measured > self.predicted or self.measured > self.limit)


def rms(values: Floats, nothing: float = math.nan) -> float:
    """Return the root of the mean square, ``nothing`` of no value."""
    return float(np.sqrt(np.mean(np.square(values)))) if values.size else nothing


def mean(values: Floats) -> float:
    """Return the mean; 0 of no value."""
    return float(values.mean()) if values.size else 0.0


def largest(values: Floats) -> float:
    """Return the largest absolute value; NaN of nothing."""
    return float(abs(values).max()) if values.size else math.nan
