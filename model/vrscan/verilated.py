"""RTL behind a C interface: Verilated, compiled with its harness, built once a source state."""

import hashlib
import os
import shutil
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from filelock import FileLock

from vrscan.errors import InputError
from vrscan.tools import (
    build_folder,
    rtl_closure,
    rtl_folders,
    rtl_packages,
    verilator_environment,
)


def _call(command: Sequence[str], environment: Mapping[str, str]) -> None:
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    if done.returncode:
        print(done.stdout + done.stderr, file=sys.stderr)
        raise InputError(f"rtl engine: {Path(command[0]).name} failed; its messages are above")


def _verilator_root(environment: Mapping[str, str]) -> str:
    command = ["verilator", "--getenv", "VERILATOR_ROOT"]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    return done.stdout.strip()


@dataclass(frozen=True)
class Design:
    """A top module, and what it is made of besides the RTL."""

    top: Path
    parameters: Mapping[str, int | float]
    devices: Sequence[Path] = ()

    def prefix(self) -> str:
        """Return the name of its C++ class."""
        return f"V{self.top.stem}"


def build(name: str, harness: Path, ports: str, designs: Sequence[Design]) -> Path:
    """Return the shared object of a harness and its designs, built if the sources have changed.

    Args:
        name: Of the shared object, for messages.
        harness: C++ in ``tb/engine`` with the C functions; it knows a design as V and its module.
        ports: What the harness includes as ``ports.h``: the ports, listed once, in Python.
        designs: What is Verilated.

    Raises:
        InputError: if a tool is missing or fails.
    """
    environment = verilator_environment()
    compiler = os.environ.get("CXX", "g++")
    found = {tool: shutil.which(tool, path=environment["PATH"]) for tool in ("verilator", compiler)}
    for tool, path in found.items():
        if path is None:
            raise InputError(f"rtl engine: {tool} is missing: apt install {tool}")
    parameters = [dict(design.parameters) for design in designs]
    digest = hashlib.sha256(repr((parameters, ports, found)).encode())
    for design in designs:
        for source in _sources(design):
            digest.update(source.read_bytes())
    for source in (harness, Path(__file__)):
        digest.update(source.read_bytes())
    folder = build_folder() / "engine"
    folder.mkdir(exist_ok=True)
    library = folder / f"{name}_{digest.hexdigest()[:16]}.so"
    with FileLock(f"{library}.lock"):
        if library.exists():
            return library
        print(f"vrscan: building the RTL engine {name}", file=sys.stderr)
        work = library.with_suffix(".work")  # the same name in every try: ccache knows it
        work.mkdir(exist_ok=True)
        (work / "ports.h").write_text(ports)
        for design in designs:
            _call(
                [
                    str(found["verilator"]), "--cc", "--build", "-j", str(os.cpu_count() or 1),
                    "-O3", "--noassert", "--x-assign", "fast", "-CFLAGS", "-fPIC",
                    "-MAKEFLAGS", "OPT_FAST=-O2",
                    "--top-module", design.top.stem, "--prefix", design.prefix(),
                    "--Mdir", str(work / design.prefix()),
                    *(f"-G{key}={value!r}" for key, value in design.parameters.items()),
                    *(part for place in rtl_folders() for part in ("-y", str(place))),
                    *(str(file) for file in (*rtl_packages(), *design.devices, design.top)),
                ],
                environment,
            )  # fmt: skip
        include = Path(environment.get("VERILATOR_ROOT") or _verilator_root(environment))
        include = include / "include"
        linked = work / library.name
        made = [work / design.prefix() for design in designs]
        _call(
            [
                str(found[compiler]), "-shared", "-fPIC", "-O2", "-std=c++17", "-pthread",
                f"-I{work}", *(f"-I{place}" for place in made),
                f"-I{include}", f"-I{include / 'vltstd'}", str(harness),
                *(str(place / f"{place.name}__ALL.a") for place in made),
                str(made[0] / "libverilated.a"), "-o", str(linked),
            ],
            environment,
        )  # fmt: skip
        linked.replace(library)
        shutil.rmtree(work)
    return library


def _sources(design: Design) -> list[Path]:
    """Return every file whose change asks for a new build."""
    if design.devices:
        return [*rtl_packages(), *design.devices, design.top]
    return rtl_closure(design.top)
