"""Tells which files of the project a simulation reads: all its result can depend on.

The simulator imports it before the tests, so that it sees every file that they open.  When it
ends without a failure, the names are in the file that ``VRSCAN_READS`` names.
"""

import atexit
import json
import os
import sys
from pathlib import Path

_read: set[str] = set()


def _watch(event: str, arguments: tuple[object, ...]) -> None:
    if event == "open" and isinstance(arguments[0], str | bytes | os.PathLike):
        _read.add(os.path.abspath(os.fsdecode(arguments[0])))


def _source(name: str) -> str:
    """Return the source of what Python keeps compiled, and any other file as it is."""
    file = Path(name)
    if file.parent.name != "__pycache__":
        return name
    # pytest's own names have the version's points in them.
    return str(file.parent.with_name(file.name.partition(".")[0] + ".py"))


def _write(target: str, own: Path) -> None:
    libraries = {str(Path(p).resolve()) for p in (sys.base_prefix, sys.prefix)}
    libraries |= {p for p in sys.path if "site-packages" in p}
    system = ("/dev/", "/proc/", "/sys/", f"{own}/")
    names = {_source(name) for name in _read}
    names |= {m.__file__ for m in list(sys.modules.values()) if getattr(m, "__file__", None)}
    kept = [
        name
        for name in sorted(names)
        if not name.startswith(system)
        and not any(name.startswith(f"{place}/") for place in libraries)
        and Path(name).is_file()
    ]
    Path(target).write_text(json.dumps(kept))


if "VRSCAN_READS" in os.environ:
    sys.addaudithook(_watch)
    atexit.register(_write, os.environ["VRSCAN_READS"], Path.cwd())
