"""What a script that runs tools for minutes owes to whoever waits for it."""

import contextlib
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

EVERY_S = 4.0
INTERRUPTED = 130


def _tools() -> list[int]:
    """Return the processes that this one has started, and theirs."""
    parents = {}
    for place in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            parents[int(place.name)] = int(
                (place / "stat").read_text().rpartition(")")[2].split()[1]
            )
    found = [os.getpid()]
    for each in found:  # grows meanwhile
        found += [child for child, parent in parents.items() if parent == each]
    return found[1:]


def ends_with_its_tools(name: str) -> None:
    """Let Ctrl-C end this script at once, with one line and with all the tools that it runs."""

    def end(*_: object) -> None:
        for tool in _tools():
            with contextlib.suppress(OSError):
                os.kill(tool, signal.SIGKILL)
        os.write(2, f"\n{name}: interrupted\n".encode())
        os._exit(INTERRUPTED)

    if signal.getsignal(signal.SIGINT) is not signal.SIG_IGN:
        signal.signal(signal.SIGINT, end)


@contextlib.contextmanager
def told(name: str, total: int) -> Iterator[Callable[[], None]]:
    """Say every few seconds how much is done; yield a function to call when a piece is."""
    begun, ended, done = time.monotonic(), threading.Event(), 0
    last = "\r" if sys.stderr.isatty() else "\n"

    def tell() -> None:
        while not ended.wait(EVERY_S):
            seconds = time.monotonic() - begun
            print(
                f"{name}: {done} of {total}, {seconds:.0f} s", end=last, file=sys.stderr, flush=True
            )

    def step() -> None:
        nonlocal done
        done += 1

    teller = threading.Thread(target=tell, daemon=True)
    teller.start()
    try:
        yield step
    finally:
        ended.set()
        teller.join()
