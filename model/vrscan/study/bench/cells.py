"""A cell: named work with its parameters and its seed, the figures that result, and its key.

Work is named ``module:function``. The function takes parameters and seed and returns figures. So a
cell can be computed by any process that has the package. A result is kept under a key of
parameters, seed and code. The code is all that the module imports, and the other files that it
reads, which it names in ``READS``: files of the package or below ``rtl/`` and ``tb/``.
"""

import ast
import hashlib
import importlib.util
import json
import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import Any

from vrscan.data.config import Config
from vrscan.engines.tools import hardware_root

Figures = dict[str, Any]  # values that JSON can hold
MOST_SEED = 2**32 - 1

Work = Callable[[dict[str, Any], int], Figures]

_PACKAGE = Path(__file__).parents[2]
_BESIDE = ("rtl/", "tb/")  # patterns that begin with these belong to the repository


@dataclass(frozen=True)
class Cell:
    """One piece of work.

    Attributes:
        work: Name of the work, ``module:function``.
        parameters: Values that JSON can hold; the configuration, where it matters, is one of them.
        seed: Seed of all random numbers.
        timed: Whether it measures time: it then runs alone, on this machine, and its figures belong
            to this machine.
    """

    work: str
    parameters: dict[str, Any] = field(hash=False)
    seed: int
    timed: bool = False

    def key(self, machine: str = "") -> str:
        """Return the name under which the figures are kept: a hash of all that they depend on.

        Args:
            machine: Machine that measures the time; it is part of the key of timed cells only.
        """
        known = [self.work, self.parameters, self.seed, machine if self.timed else ""]
        text = json.dumps([*known, version(self.work)], sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:32]


def resolve(work: str) -> Work:
    """Return the function of a named work.

    Raises:
        ImportError: if there is no such module.
        AttributeError: if it has no such function.
    """
    name, _, function = work.partition(":")
    found: Work = getattr(importlib.import_module(name), function)
    return found


@cache
def version(work: str) -> str:
    """Return a hash of all code that a work depends on: modules, the files they read, libraries.

    Raises:
        ImportError: if there is no such module.
        FileNotFoundError: if a file that it names in ``READS`` does not exist.
    """
    digest = hashlib.sha256()
    for name, file in files(work).items():
        digest.update(name.encode())
        digest.update(file.read_bytes())
    distributions = _distributions()
    for library in sorted(_closure(work)[1]):
        for each in sorted(set(distributions.get(library, ()))):
            digest.update(f"{each} {metadata.version(each)}".encode())
    return digest.hexdigest()


_distributions = cache(metadata.packages_distributions)  # it reads the contents of every package


def files(work: str) -> dict[str, Path]:
    """Return the files that a work depends on, by names that are the same on every machine.

    They are its module with all that this imports of the package, directly or not, and what its
    ``READS`` names.

    Raises:
        ImportError: if there is no such module.
        FileNotFoundError: if a file that it names in ``READS`` does not exist.
    """
    found = dict(_closure(work)[0])
    module = importlib.import_module(work.partition(":")[0])
    for pattern in getattr(module, "READS", ()):
        base = hardware_root() if pattern.startswith(_BESIDE) else _PACKAGE
        read = {str(file.relative_to(base)): file for file in base.glob(pattern)}
        if not read:
            raise FileNotFoundError(f"{work}: no file {pattern}")
        found |= read
    return dict(sorted(found.items()))


@cache
def _closure(work: str) -> tuple[dict[str, Path], frozenset[str]]:
    """Return the modules of the package that a work's module needs, and the names of the libraries.

    An import counts wherever it stands, also in a function, except one for types only.
    """
    first = work.partition(":")[0]
    spec = importlib.util.find_spec(first)
    if spec is None or spec.origin is None:
        raise ImportError(f"no module {first}")
    found = {first: Path(spec.origin)}
    libraries = set()
    waiting = [first]
    while waiting:
        name = waiting.pop()
        imported = _imported(found[name], found[name].read_bytes())
        for each in {name.rpartition(".")[0] or name, *imported} - found.keys():
            if each.partition(".")[0] != _PACKAGE.name:
                libraries.add(each.partition(".")[0])
            elif (file := _file(each)) is not None:
                found[each] = file
                waiting.append(each)
    return found, frozenset(libraries - sys.stdlib_module_names)


def _file(module: str) -> Path | None:
    """Return the file of a module of the package, None where the name is not one of a module."""
    place = _PACKAGE.parent.joinpath(*module.split("."))
    return next((x for x in (place.with_suffix(".py"), place / "__init__.py") if x.exists()), None)


@cache  # works share most of their modules, and parsing these takes the time
def _imported(file: Path, source: bytes) -> frozenset[str]:
    """Return what a file imports: names of modules, and of what may be modules in them."""
    names: set[str] = set()
    waiting: list[ast.AST] = [ast.parse(source)]
    while waiting:
        node = waiting.pop()
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
            waiting += node.orelse
            continue
        if isinstance(node, ast.Import):
            names |= {each.name for each in node.names}
        elif isinstance(node, ast.ImportFrom):
            if node.level or node.module is None:
                raise ImportError(f"{file}: a relative import, in line {node.lineno}")
            names |= {node.module, *(f"{node.module}.{each.name}" for each in node.names)}
        waiting += ast.iter_child_nodes(node)
    return frozenset(names)


def do(work: str, parameters: dict[str, Any], seed: int) -> tuple[str, Figures]:
    """Compute a cell; return the version of the code that computed it, and the figures.

    The figures have been through JSON, so that fresh and kept figures are equal.
    """
    figures = resolve(work)(parameters, seed)
    return version(work), json.loads(json.dumps(figures))


def plain(config: Config) -> dict[str, Any]:
    """Return a configuration as a parameter of a cell."""
    return config.model_dump(mode="json")


def configuration(parameters: dict[str, Any]) -> Config:
    """Return the configuration from a cell's parameters."""
    return Config.model_validate(parameters["config"])
