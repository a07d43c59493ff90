"""Tables of numbers that the next process need not make again, in the user's cache.

A table's file is named after all that it depends on: its arguments, the code that makes it, and the
libraries that compute it. A file that is damaged, that another user owns or that others may write
is made anew. Without platformdirs, or where nothing can be written, nothing is kept.
"""

import contextlib
import hashlib
import inspect
import os
import stat
import zipfile
import zlib
from collections.abc import Callable, Sequence
from functools import cache
from importlib import metadata
from pathlib import Path

import numpy as np
import numpy.typing as npt

from vrscan.data.errors import InputError
from vrscan.data.points import atomic_file

Array = npt.NDArray[np.generic]

_MOST = 32  # files, of up to 6 MB; the oldest go
_UNREADABLE = (OSError, ValueError, EOFError, KeyError, zipfile.BadZipFile, zlib.error)


def kept(
    make: Callable[..., dict[str, Array]], *arguments: float, names: Sequence[str]
) -> dict[str, Array]:
    """Return the arrays that a function makes, from the cache if it has them.

    Args:
        make: A function whose result follows from its arguments and the module that it is in.
        arguments: Its arguments.
        names: Names of the arrays.
    """
    folder = _folder()
    if folder is None:
        return make(*arguments)
    path = folder / f"{make.__name__.strip('_')}-{_key(make, arguments)}.npz"
    with contextlib.suppress(*_UNREADABLE):
        return _read(path, names)
    made = make(*arguments)
    # Where the cache cannot be written, the next process makes them again.
    with contextlib.suppress(OSError, InputError):
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        with atomic_file(path) as file:
            os.chmod(file.fileno(), 0o600)
            np.savez(file, allow_pickle=False, **made)
        old = sorted(folder.glob("*.npz"), key=lambda each: each.stat().st_mtime)[:-_MOST]
        for each in old:
            each.unlink(missing_ok=True)
    return made


def _read(path: Path, names: Sequence[str]) -> dict[str, Array]:
    """Return the arrays of a file of this user's own, which zip's checksums prove whole."""
    with open(os.open(path, os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0)), "rb") as file:
        found = os.fstat(file.fileno())
        foreign = hasattr(os, "geteuid") and found.st_uid != os.geteuid()
        if foreign or not stat.S_ISREG(found.st_mode) or found.st_mode & 0o022:
            raise ValueError(f"{path}: not a file of this user's own")
        with np.load(file, allow_pickle=False) as arrays:
            return {name: arrays[name] for name in names}


def _folder() -> Path | None:
    try:
        from platformdirs import user_cache_path
    except ModuleNotFoundError:
        return None
    return user_cache_path("vrscan", appauthor=False) / "tables"


def _key(make: Callable[..., dict[str, Array]], arguments: tuple[float, ...]) -> str:
    known = [_code(inspect.getsourcefile(make) or ""), make.__qualname__, *map(repr, arguments)]
    known += [f"{name} {metadata.version(name)}" for name in ("numpy", "scipy")]
    return hashlib.sha256("\n".join(known).encode()).hexdigest()[:32]


@cache
def _code(source: str) -> str:
    return hashlib.sha256(Path(source).read_bytes()).hexdigest()
