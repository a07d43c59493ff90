"""Computes cells on all cores of this machine or on a Dask cluster, and keeps the results.

Every cell makes its own random numbers from its own seed, so it does not matter which process
computes it, and in which order. Local processes and workers of a cluster run the same code: a
worker whose code differs is an error, not another number. On processors of another kind the last
digits of a sum may still differ.
"""

import asyncio
import contextlib
import logging
import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import (
    CancelledError,
    Executor,
    Future,
    as_completed,
)
from typing import Any

from vrscan.data import parallel
from vrscan.data.errors import InputError, one_line
from vrscan.study.bench.cells import Cell, Figures, do, version
from vrscan.study.bench.keep import Keep
from vrscan.study.progress import Progress

PATIENCE_S = 5.0  # longest wait for an answer of a scheduler


def run(
    cells: Sequence[Cell],
    keep: Keep,
    *,
    scheduler: str | None = None,
    jobs: int = 0,
    progress: Progress | None = None,
) -> list[Figures]:
    """Return the figures of each cell, in their order.

    Kept results are not computed again. A new result is kept at once, so an interrupted run
    continues where it ended. Timed cells come last, one by one, in this process.

    Args:
        cells: The work; the same cell twice is computed once.
        keep: Store of the figures.
        scheduler: Address of a Dask scheduler; without one, local processes are used.
        jobs: Number of local processes; 0 is one for each processor.
        progress: Called with the number of cells done so far.

    Raises:
        InputError: if the scheduler does not answer, has no worker, is lost, or has workers with
            other code.
    """
    found: dict[str, Figures] = {}
    waiting: dict[str, Cell] = {}
    for cell in cells:
        key, held = cell.key(keep.machine), keep.get(cell)
        if held is not None:
            found[key] = held
        elif key not in found:
            waiting[key] = cell

    def done(key: str, figures: Figures) -> None:
        keep.put(waiting[key], figures)
        found[key] = figures
        tell()

    def tell() -> None:
        if progress is not None:
            progress(len(cells) - sum(1 for key in keys if key not in found))

    keys = [cell.key(keep.machine) for cell in cells]
    tell()
    anywhere = {key: cell for key, cell in waiting.items() if not cell.timed}
    if scheduler is not None:
        check(scheduler)
    if anywhere:
        workers = min(jobs or os.cpu_count() or 1, len(anywhere))
        with _executor(scheduler, workers) as executor:
            _collect(executor, anywhere, done, scheduler)
    for key, cell in waiting.items():
        if cell.timed:
            done(key, do(cell.work, cell.parameters, cell.seed)[1])
    return [found[key] for key in keys]


def _collect(
    executor: Executor,
    cells: dict[str, Cell],
    done: Callable[[str, Figures], None],
    scheduler: str | None,
) -> None:
    futures: dict[Future[tuple[str, Figures]], str] = {}
    try:
        for key, cell in cells.items():
            futures[executor.submit(do, cell.work, cell.parameters, cell.seed)] = key
        for future in as_completed(futures):
            key = futures[future]
            code, figures = future.result()
            if code != version(cells[key].work):
                raise InputError(_other(scheduler, cells[key]))
            done(key, figures)
    finally:
        for future in futures:
            future.cancel()


def _other(scheduler: str | None, cell: Cell) -> str:
    if scheduler is None:
        return f"the code of {cell.work} has changed while it ran: start again"
    return f"--scheduler: a worker of {scheduler} has other code than this machine ({cell.work})"


@contextlib.contextmanager
def _executor(scheduler: str | None, workers: int) -> Iterator[Executor]:
    """Yield the executor of the work."""
    if scheduler is None:
        with parallel.executor(workers) as pool:
            yield pool
        return
    from distributed import Client, KilledWorker  # takes half a second to import
    from distributed.comm.core import CommClosedError

    logging.getLogger("distributed").setLevel(logging.CRITICAL)  # one error line is enough
    connect: Callable[..., Client] = Client
    with connect(scheduler, timeout=PATIENCE_S, set_as_default=False) as client:
        try:
            yield client.get_executor(pure=False)
        except (CommClosedError, CancelledError, KilledWorker, OSError) as error:
            reason = one_line(error)
            raise InputError(f"--scheduler: {scheduler} was lost ({reason})") from error


def check(scheduler: str) -> None:
    """Check that a Dask scheduler answers and has a worker.

    Raises:
        InputError: if it does not.
    """
    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    try:
        workers = asyncio.run(asyncio.wait_for(_workers(scheduler), PATIENCE_S))
    except Exception as error:  # any kind, because any program may listen there
        reason = str(error).splitlines()[0] if str(error) else f"within {PATIENCE_S:g} s"
        raise InputError(f"--scheduler: no Dask scheduler at {scheduler} ({reason})") from error
    if not workers:
        raise InputError(f"--scheduler: {scheduler} has no workers")


async def _workers(scheduler: str) -> int:
    """Ask a scheduler for its number of workers."""
    from distributed.core import rpc

    ask: Callable[..., Any] = rpc
    async with ask(scheduler, timeout=PATIENCE_S) as remote:
        identity = await remote.identity()
        return len(identity["workers"])
