"""Work on all cores: results come in order, and the number of items in flight is limited."""

import contextlib
import os
import signal
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Executor
from typing import Any, TypeVar

from vrscan.data.errors import InputError
from vrscan.data.extras import named

T = TypeVar("T")
R = TypeVar("R")

_AHEAD = 2  # items in flight per process: one in work and one waiting
_ORPHAN_S = 1.0  # time after which a process without a parent ends


def processors() -> int:
    """Return the number of processors that this process may use; 1 where loky is not installed.

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

    The work is sent to each process once, so it may hold data that all items share. No process is
    left behind at the end, not even after an error or an interrupt.

    Args:
        work: The function that is applied to each item. It must be picklable unless ``jobs`` is 1.
        jobs: Number of processes; 1 does the work in this process.

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
    with executor(jobs, work) as pool:

        def ordered(items: Iterable[T]) -> Iterator[R]:
            waiting: deque[Any] = deque()
            for item in items:
                waiting.append(pool.submit(_do, item))
                if len(waiting) >= _AHEAD * jobs:
                    yield waiting.popleft().result()
            while waiting:
                yield waiting.popleft().result()

        yield ordered


@contextlib.contextmanager
def executor(jobs: int, work: Callable[[Any], Any] | None = None) -> Iterator[Executor]:
    """Start processes, and end them; the process that waits for them handles interrupts.

    Args:
        jobs: Number of processes.
        work: The work that the processes do for ``workers``.

    Raises:
        InputError: if a process was killed, or loky is not installed, which starts them.
    """
    with named():
        from loky import ProcessPoolExecutor
        from loky.process_executor import BrokenProcessPool

    # Not forked: a fork may hold a lock of the thread that draws the progress.
    pool = ProcessPoolExecutor(jobs, initializer=_begin, initargs=(work, os.getpid()))
    try:
        yield pool
    except BrokenProcessPool as error:
        raise InputError("--jobs: a process was killed; fewer of them need less memory") from error
    finally:
        pool.shutdown(kill_workers=True)


_work: list[Callable[[Any], Any]] = []  # the work of this process


def _begin(work: Callable[[Any], Any] | None, parent: int) -> None:
    for each in (signal.SIGINT, signal.SIGTERM):  # the waiting process handles them
        signal.signal(each, signal.SIG_IGN)
    threading.Thread(target=_end_after, args=(parent,), daemon=True).start()
    _work[:] = [] if work is None else [work]


def _end_after(parent: int) -> None:
    """End this process after its parent, which may be killed while a result is on its way.

    Nobody takes the result then, and the process would wait for ever: it holds the reading end of
    its pipe, too.
    """
    while os.getppid() == parent:
        time.sleep(_ORPHAN_S)
    os._exit(1)


def _do(item: Any) -> Any:
    return _work[0](item)
