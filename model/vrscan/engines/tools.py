"""The paths of the tools and of the build products, and the choice of Verilator."""

import os
import re
import shutil
import subprocess
import sys
import sysconfig
from collections.abc import Sequence
from functools import cache
from pathlib import Path

OLDEST_VERILATOR = (5, 36)


def repository_root() -> Path:
    """Return the folder that holds rtl/, tb/ and model/."""
    return Path(__file__).resolve().parents[3]


def build_folder() -> Path:
    """Return the folder for everything that is built; Git ignores it."""
    folder = repository_root() / "build"
    folder.mkdir(exist_ok=True)
    return folder


def rtl_sources() -> list[Path]:
    """Return every RTL file: packages first, then the others, in alphabetical order."""
    files = sorted((repository_root() / "rtl").rglob("*.sv"))
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


def rtl_boards() -> list[Path]:
    """Return the wrapper of every board; it contains cells of its vendor."""
    return sorted((repository_root() / "rtl" / "boards").glob("*.sv"))


@cache
def _verilator_on_path() -> bool:
    found = shutil.which("verilator")
    if found is None:
        return False
    answer = subprocess.run([found, "--version"], capture_output=True, text=True, check=False)
    version = re.search(r"Verilator (\d+)\.(\d+)", answer.stdout)
    return version is not None and (int(version[1]), int(version[2])) >= OLDEST_VERILATOR


def verilator_environment() -> dict[str, str]:
    """Return the environment in which ``verilator`` and the tools that it calls are found.

    A Verilator of 5.036 or newer on the PATH is used as it is. Otherwise the one of this Python
    environment is used. It needs its own folder first on the PATH, and calls ``python``, which a
    small Debian has only in that environment. ccache is used where it exists.
    """
    environment = dict(os.environ)
    if not _verilator_on_path():
        root = Path(sysconfig.get_paths()["purelib"]) / "verilator"
        environment["VERILATOR_ROOT"] = str(root)
        first = [str(root / "bin"), str(Path(sys.executable).parent)]
        environment["PATH"] = os.pathsep.join([*first, environment.get("PATH", "")])
    if shutil.which("ccache") and "OBJCACHE" not in environment:
        environment["OBJCACHE"] = "ccache"
    return environment
