"""Signals that end a loop and not the command."""

import contextlib
import signal
from collections.abc import Callable, Iterator


@contextlib.contextmanager
def interrupted(*signals: signal.Signals) -> Iterator[Callable[[], int | None]]:
    """Let signals only end a loop; yield a function that returns the first that came, or None.

    Args:
        signals: The signals; Ctrl-C alone if none is given. One that the command ignores, as a
            shell's background job ignores Ctrl-C, stays ignored.
    """
    come: int | None = None

    def note(number: int, _: object) -> None:
        nonlocal come
        come = number if come is None else come

    heard = [s for s in signals or (signal.SIGINT,) if signal.getsignal(s) is not signal.SIG_IGN]
    before = {number: signal.signal(number, note) for number in heard}
    try:
        yield lambda: come
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
