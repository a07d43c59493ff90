"""All entries, by the group in which the page lists them."""

from collections.abc import Callable, Iterator
from functools import cache

from vrscan.study.cases import geometry_cases as geometry
from vrscan.study.cases import line_cases as lines
from vrscan.study.cases import phase_cases as phase
from vrscan.study.cases import statistics_cases as statistics
from vrscan.study.cases import timing_cases as timing
from vrscan.study.cases import window_cases as window
from vrscan.study.cases.case import Case

ROOMS: dict[str, Callable[[], Iterator[Case]]] = {
    "The line": lines.cases,
    "What lies under the spot": window.cases,
    "The phase": phase.cases,
    "Numbers, widths and lengths": statistics.cases,
    "The triangle": geometry.cases,
    "Time, counters and queues": timing.cases,
}


@cache
def rooms() -> dict[str, tuple[Case, ...]]:
    """Return the entries of every group, in the order of the page."""
    return {title: tuple(cases()) for title, cases in ROOMS.items()}


def every() -> tuple[Case, ...]:
    """Return all entries."""
    return tuple(case for cases in rooms().values() for case in cases)
