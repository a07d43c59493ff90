"""A cell: named work with its parameters and its seed, the figures it comes to, and its key.

Work is named ``module:function``. The function takes parameters and seed and returns figures, and
the module says in ``SOURCES`` which files of the package it depends on. So a cell can be done by
any process that has the package, and a result is kept under a key of parameters, seed and code.
"""

import hashlib
import importlib
import json
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import Any

from vrscan.config import Config
from vrscan.tools import repository_root

Figures = dict[str, Any]  # what JSON holds
Work = Callable[[dict[str, Any], int], Figures]

_PACKAGE = Path(__file__).parents[1]
_BESIDE = ("rtl/", "tb/")  # patterns that begin so are of the repository
_LIBRARIES = ("numpy", "scipy")  # whose versions change numbers, or may


@dataclass(frozen=True)
class Cell:
    """One piece of work.

    Attributes:
        work: ``module:function``.
        parameters: What JSON holds; the configuration, where it matters, is one of them.
        seed: Of all its random numbers.
        timed: It measures time: it runs alone, on this machine, and its figures are this machine's.
    """

    work: str
    parameters: dict[str, Any] = field(hash=False)
    seed: int
    timed: bool = False

    def key(self, machine: str = "") -> str:
        """Return the name under which the figures are kept: a hash of all that they depend on.

        Args:
            machine: What measures the time; it is part of the key of a timed cell alone.
        """
        known = [self.work, self.parameters, self.seed, machine if self.timed else ""]
        text = json.dumps([*known, version(self.work)], sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:32]


def resolve(work: str) -> tuple[Work, tuple[str, ...]]:
    """Return the function of a work and the patterns of the files that it depends on.

    Raises:
        ImportError: if there is no such module.
        AttributeError: if it has no such function, or no ``SOURCES``.
    """
    name, _, function = work.partition(":")
    module = importlib.import_module(name)
    return getattr(module, function), module.SOURCES


@cache
def version(work: str) -> str:
    """Return a hash of the code that a work depends on: its files, and libraries."""
    digest = hashlib.sha256()
    for pattern in resolve(work)[1]:
        base = repository_root() if pattern.startswith(_BESIDE) else _PACKAGE
        found = sorted(base.glob(pattern))
        if not found:
            raise FileNotFoundError(f"{work}: no file {pattern}")
        for file in found:
            digest.update(str(file.relative_to(base)).encode())
            digest.update(file.read_bytes())
    for library in _LIBRARIES:
        digest.update(f"{library} {metadata.version(library)}".encode())
    return digest.hexdigest()


def do(work: str, parameters: dict[str, Any], seed: int) -> tuple[str, Figures]:
    """Do a cell's work; returns the version of the code that did it, and the figures.

    The figures have been through JSON, so that fresh and kept ones are the same.
    """
    figures = resolve(work)[0](parameters, seed)
    return version(work), json.loads(json.dumps(figures))


def plain(config: Config) -> dict[str, Any]:
    """Return a configuration as a parameter of a cell."""
    return config.model_dump(mode="json")


def configuration(parameters: dict[str, Any]) -> Config:
    """Return the configuration that is among a cell's parameters."""
    return Config.model_validate(parameters["config"])
