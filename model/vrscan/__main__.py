"""The start of the ``vrscan`` command: Ctrl-C ends it with one line, even during imports."""

import os
import signal
import sys
from collections.abc import Callable
from types import FrameType

from vrscan.data.errors import EXIT_BAD_INPUT, EXIT_INTERRUPTED
from vrscan.data.extras import MissingError, named


def main() -> None:
    """Run the command; an interrupted command first removes what it has begun."""
    _on_interrupt(_end)
    try:
        with named():
            from vrscan.cli.app import main as command
    except MissingError as error:
        print(f"vrscan: the command line: {error}", file=sys.stderr)
        sys.exit(EXIT_BAD_INPUT)

    try:
        try:
            _on_interrupt(signal.default_int_handler)
            command()
        finally:
            _on_interrupt(_end)
    except KeyboardInterrupt:
        _end(signal.SIGINT, None)
    except SystemExit as end:
        if end.code == EXIT_INTERRUPTED:
            # All is tidied up. Python itself would end by the signal and not with the status where
            # the interrupt came within an exec(), of which imports have many.
            sys.stdout.flush()
            sys.stderr.flush()
            os._exit(EXIT_INTERRUPTED)
        raise


def _on_interrupt(handler: Callable[[int, FrameType | None], None]) -> None:
    """Install a handler of Ctrl-C, except in a shell's background job, which ignores Ctrl-C."""
    if signal.getsignal(signal.SIGINT) is not signal.SIG_IGN:
        signal.signal(signal.SIGINT, handler)


def _end(number: int, frame: FrameType | None) -> None:
    """End at once, while there is nothing to tidy up and an exception could surface anywhere."""
    os.write(2, b"vrscan: interrupted\n")
    os._exit(EXIT_INTERRUPTED)


if __name__ == "__main__":
    main()
