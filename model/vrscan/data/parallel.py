"""Work on all cores: results come in order, and only so many of them are in flight."""

import contextlib
import signal
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from typing import Any, TypeVar

from vrscan.data.errors import InputError
from vrscan.data.extras import named

T = TypeVar("T")
R = TypeVar("R")

_AHEAD = 2  # items in flight for each process: one that it does and one that waits for it
_IDLE_S = 60.0  # after which a process ends whose parent was killed


def processors() -> int:
    """Return how many processors there are for this process; 1 where loky is not installed.

    Without it there are no other processes to use them.
    """
    try:
        from loky import cpu_count
    except ModuleNotFoundError:
        return 1
    return int(cpu_count())


@contextlib.contextmanager
def workers(work: Callable[[T], R], jobs: int) -> Iterator[Callable[[Iterable[T]], Iterator[R]]]:
    """Start processes that do one kind of work, and end them.

    The work goes to each process once, so it may hold what all items share. However it ends, by an
    error or an interrupt too, no process is left behind.

    Args:
        work: Picklable, unless it is done here.
        jobs: Processes; 1 does the work in this one.

    Yields:
        A function that takes items and yields the result of each, in their order. At most
        ``2 * jobs`` items are taken and not yet yielded, however many there are.

    Raises:
        InputError: if the work raises it, a process was killed, or loky is not installed, which
            starts them.
    """
    if jobs <= 1:
        yield lambda items: map(work, items)
        return
    with named():
        from loky import ProcessPoolExecutor
        from loky.process_executor import BrokenProcessPool

    # Not forked: a fork may hold a lock of the thread that draws the progress.
    pool = ProcessPoolExecutor(jobs, timeout=_IDLE_S, initializer=_begin, initargs=(work,))

    def ordered(items: Iterable[T]) -> Iterator[R]:
        waiting: deque[Any] = deque()
        for item in items:
            waiting.append(pool.submit(_do, item))
            if len(waiting) >= _AHEAD * jobs:
                yield waiting.popleft().result()
        while waiting:
            yield waiting.popleft().result()

    try:
        yield ordered
    except BrokenProcessPool as error:
        raise InputError("--jobs: a process was killed; fewer of them need less memory") from error
    finally:
        pool.shutdown(kill_workers=True)


_work: list[Callable[[Any], Any]] = []  # of this process


def _begin(work: Callable[[Any], Any]) -> None:
    for each in (signal.SIGINT, signal.SIGTERM):  # they are for who waits for the results
        signal.signal(each, signal.SIG_IGN)
    _work[:] = [work]


def _do(item: Any) -> Any:
    return _work[0](item)
