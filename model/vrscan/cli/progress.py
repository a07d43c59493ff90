"""What commands show while they work, and where their tables go."""

import contextlib
import os
import shlex
import shutil
import sys
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeRemainingColumn,
)

from vrscan.data.errors import InputWarning


def console() -> Console:
    """Return the output; where it is no terminal it is wide enough for the tables."""
    return Console(width=None if sys.stdout.isatty() else 120)


@contextlib.contextmanager
def telling() -> Iterator[None]:
    """Print what is warned of input meanwhile, a line each, once all has gone well."""
    with warnings.catch_warnings(record=True, action="always", category=InputWarning) as told:
        yield
    for each in told:
        print(f"vrscan: {each.message}", file=sys.stderr)


@contextlib.contextmanager
def bar(text: str, total: int) -> Iterator[Callable[[int], None]]:
    """Show a bar on the error stream; yield a function that is called with the number done.

    The bar disappears if the work fails, so that only the error message is left to read.
    """
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
    )
    shown = Console(stderr=True)
    with Progress(*columns, console=shown) as progress:
        task = progress.add_task(text, total=total)
        try:
            yield lambda done: progress.update(task, completed=done)
        except BaseException:
            progress.live.transient = True
            shown.quiet = not shown.is_terminal
            raise


def step(*words: str | Path) -> str:
    """Return a command of this program, as it runs from here when it is typed."""
    called = Path(sys.argv[0])
    found = shutil.which("vrscan")
    program = [sys.executable, "-m", "vrscan"]  # as which it was started, too
    if found is not None and called.exists() and called.samefile(found):
        program = ["vrscan"]
    elif called.name == "vrscan" and os.access(called, os.X_OK):
        inside = called.is_relative_to(Path.cwd())
        program = [str(called.relative_to(Path.cwd()) if inside else called)]
    return shlex.join([*program, *map(str, words)])
