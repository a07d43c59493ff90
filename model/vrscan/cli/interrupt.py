"""Ctrl-C that ends a loop and not the command."""

import contextlib
import signal
from collections.abc import Callable, Iterator


@contextlib.contextmanager
def interrupted() -> Iterator[Callable[[], bool]]:
    """Let Ctrl-C only end a loop; yield a function that returns whether it was pressed."""
    pressed = False

    def note(*_: object) -> None:
        nonlocal pressed
        pressed = True

    before = signal.signal(signal.SIGINT, note)
    try:
        yield lambda: pressed
    finally:
        signal.signal(signal.SIGINT, before)
