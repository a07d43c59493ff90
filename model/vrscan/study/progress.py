"""Work that processes share, and how much of it is done."""

from collections.abc import Callable, Iterable
from typing import TypeVar

from vrscan.data.parallel import workers

Progress = Callable[[int], None]  # called with the number of pieces of work done so far

_Given = TypeVar("_Given")
_Outcome = TypeVar("_Outcome")


def for_each(
    work: Callable[[_Given], _Outcome],
    given: Iterable[_Given],
    progress: Progress | None,
    jobs: int,
) -> list[_Outcome]:
    """Return what the work makes of each thing given, in their order.

    Args:
        work: The work.
        given: The things, each a piece of work.
        progress: Called with the number of pieces done so far.
        jobs: Number of processes, which share the pieces.
    """
    found: list[_Outcome] = []
    with workers(work, jobs) as do:
        for each in do(given):
            found.append(each)
            if progress is not None:
                progress(len(found))
    return found
