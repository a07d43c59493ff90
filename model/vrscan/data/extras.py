"""Libraries that only some of the package needs, and what to install where one is missing.

A detector needs numpy and pydantic alone. All else comes with an extra of the package, and is
imported by what uses it, so its absence shows only there.
"""

import contextlib
import signal
import threading
from collections.abc import Iterator
from pathlib import Path
from types import FrameType

from vrscan.data.errors import InputError

_CLONE = Path(__file__).resolve().parents[3]  # where this is no installed package

# The names by which libraries are imported, and the extra that brings each.
BRINGS = {
    "PIL": "scene",
    "bokeh": "view",
    "dask": "study",
    "distributed": "study",
    "embreex": "scene",
    "filelock": "sim",
    "jinja2": "study",
    "laspy": "formats",
    "lazrs": "formats",
    "loky": "scene",
    "matplotlib": "study",
    "mcap": "formats",
    "mcap_ros2": "formats",
    "pandas": "scene",
    "platformdirs": "sim",
    "pvlib": "scene",
    "pye57": "formats",
    "rerun": "rerun",
    "rich": "cli",
    "scipy": "scene",
    "serial": "link",
    "tornado": "view",
    "trimesh": "scene",
    "typer": "cli",
}


class MissingError(InputError, ImportError):
    """A library is not installed; the text is one line that says how to install it."""


def install(extra: str) -> str:
    """Return the command that installs an extra from where this package came from.

    That is the clone that it runs in, or the folder or wheel that pip was told.
    """
    import json
    from importlib import metadata
    from urllib.parse import urlsplit
    from urllib.request import url2pathname

    place = str(_CLONE)
    if not (_CLONE / "pyproject.toml").exists():
        place = "FOLDER OF A CLONE"
        with contextlib.suppress(metadata.PackageNotFoundError):
            text = metadata.distribution("vrscan").read_text("direct_url.json")
            came = url2pathname(urlsplit(json.loads(text)["url"]).path) if text else ""
            place = came if came and Path(came).exists() else place
    return f'pip install "{place}[{extra}]"'


def missing(what: str, brings: str) -> MissingError:
    """Return the error of something that is not installed.

    Args:
        what: Its name, for the message.
        brings: The command that installs it.
    """
    return MissingError(f"{what} is missing: {brings}")


@contextlib.contextmanager
def interrupt_held() -> Iterator[None]:
    """Hold Ctrl-C back until the block ends: some libraries catch it while they are imported."""
    before = signal.getsignal(signal.SIGINT)
    if threading.current_thread() is not threading.main_thread() or not callable(before):
        yield
        return
    come: list[tuple[int, FrameType | None]] = []
    signal.signal(signal.SIGINT, lambda *signalled: come.append(signalled))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
        if come:
            before(*come[0])


@contextlib.contextmanager
def named() -> Iterator[None]:
    """Turn the failed import of a library of ``BRINGS`` into the line that says what to install.

    Raises:
        MissingError: instead of the ``ModuleNotFoundError``.
    """
    try:
        yield
    except ModuleNotFoundError as error:
        library = (error.name or "").partition(".")[0]
        if library not in BRINGS:
            raise
        raise missing(library, install(BRINGS[library])) from error
