"""The lists of files that FuseSoC and Bender read; and, with --prefix, a copy of the RTL.

FuseSoC compiles all files with ``logical_name`` into a library of that name, so that names such as
multiply or divide do not meet those of other designs.  For tools with one room for all names,

    cores.py --prefix vrs_ build/prefixed

writes a copy of rtl/ in which every module and package begins with the prefix.  vrscan.vlt, in each
of them, is what Verilator's -Wall is not to report.
"""

import argparse
import re
import sys
from pathlib import Path

from vrscan.data.errors import InputError
from vrscan.engines.tools import (
    repository_root,
    rtl_boards,
    rtl_modules,
    rtl_packages,
    rtl_sources,
)
from vrscan.registers.register_map import REGISTERS

ROOT = repository_root()
OPEN = re.compile(r"\.\w+ *\(\)")
STRUCT = re.compile(r"input +wire +\w+_pkg::\w+_t +(\w+)")
MADE = "Written by scripts/generate.py from what the modules of rtl/ name."
# Where a file of rtl/ names a module or package: in its own head, before a parameter list or an
# instance, or before two colons.  A signal or a field may have the same name.
NAMED = re.compile(r"(?<=\bmodule )\w+|(?<=\bpackage )\w+|(?<![.\w])\w+(?=::| *#\(| +u_\w+ *\()")
TOPS = {
    "chain": ["vrscan_chain"],
    "guard": ["laser_guard", "pixel_fifo", "reset_bridge"],
    "top": ["vrscan_guarded"],
}
WAIVERS = "vrscan.vlt"  # in the lowest part, so that every part brings them
WHAT = {
    "trig": "VR-SCAN's arithmetic: multiply, divide, square root, CORDIC, sine table",
    "chain": "VR-SCAN's signal chain: from the pixels of a line to a point",
    "guard": "What VR-SCAN has in clocks of their own: the laser's guard, the pixels' FIFO, resets",
    "top": "VR-SCAN, a laser triangulation scanner, with UART, AXI4-Lite, AXI4-Stream and guard",
}
BELOW = {"trig": (), "chain": ("trig",), "guard": (), "top": ("chain", "guard")}


def version() -> str:
    """Return the version of the registers, which is that of the RTL."""
    word = REGISTERS["version"].reset[0]
    return f"{word >> 16}.{word >> 8 & 255}.{word & 255}"


def code_of(line: str) -> tuple[str, str]:
    """Return a line's code and its comment."""
    code, mark, comment = line.partition("//")
    return code, mark + comment


def closure(tops: list[str]) -> set[Path]:
    """Return the files that modules need, with their own."""
    sources = {file.stem: file for file in rtl_sources()}
    waiting, found = set(tops), set()
    while waiting:
        file = sources[waiting.pop()]
        found.add(file)
        code = "".join(code_of(line)[0] for line in file.read_text().splitlines(keepends=True))
        waiting |= {name for name in NAMED.findall(code) if name in sources}
        waiting -= {each.stem for each in found}
    return found


def files(name: str) -> list[Path]:
    """Return the files of a part that are not in the parts that it depends on, packages first."""
    in_trig = [file.stem for file in rtl_sources() if file.parent.name == "trig"]
    needed = closure(TOPS.get(name, in_trig))
    below = {file for part in _all_below(name) for file in files(part)}
    return [file for file in rtl_sources() if file in needed - below]


def _all_below(name: str) -> list[str]:
    return [each for part in BELOW[name] for each in (part, *_all_below(part))]


def core(name: str) -> str:
    """Return the .core file of a part."""
    lines = [
        "CAPI=2:",
        f"# {MADE}",
        f"name: dlr-vrscan:vrscan:{name}:{version()}",
        f'description: "{WHAT[name]}"',
        "",
        "filesets:",
        "  rtl:",
        "    file_type: systemVerilogSource",
        "    logical_name: vrscan",
    ]
    if BELOW[name]:
        parts = ", ".join(f'"dlr-vrscan:vrscan:{part}"' for part in BELOW[name])
        lines.append(f"    depend: [{parts}]")
    lines += ["    files:", *(f"      - {f.relative_to(ROOT)}" for f in files(name))]
    sets = "rtl"
    if not BELOW[name]:
        sets = "rtl, waivers"
        lines += ["  waivers:", "    file_type: vlt", f"    files: [{WAIVERS}]"]
    lines += ["", "targets:", "  default:", f"    filesets: [{sets}]"]
    lines += ["  lint:", f"    filesets: [{sets}]", "    default_tool: verilator"]
    lines += [f"    toplevel: {TOPS.get(name, ['cordic_vector'])[0]}"]
    lines += ["    tools:", "      verilator:", "        mode: lint-only"]
    return "\n".join([*lines, ""])


def manifest() -> str:
    """Return Bender.yml."""
    lines = [f"# {MADE}", "package:", "  name: vrscan", "", "sources:"]
    for name in WHAT:
        lines += [f"  # {WHAT[name]}", "  - files:"]
        lines += [f"      - {file.relative_to(ROOT)}" for file in files(name)]
    return "\n".join([*lines, ""])


def waivers(prefix: str = "") -> str:
    """Return what Verilator's -Wall is not to report of these files, and of no others.

    Args:
        prefix: How the names of the files begin in a copy.
    """

    def off(rule: str, file: Path) -> str:
        place = f"{prefix}{file.name}" if prefix else file.relative_to(ROOT)
        return f'lint_off -rule {rule} -file "*{place}"'

    lines = [f"// {MADE}", "`verilator_config", ""]
    lines += ["// A package serves all modules: no module alone uses all of it."]
    lines += [off("UNUSEDPARAM", file) for file in rtl_packages()]
    lines += [
        "",
        "// An output is left open on purpose, as `.overflow_o()`; a forgotten one is PINMISSING.",
    ]
    lines += ["// A module takes a struct whole, and uses what is its own."]
    for file in [*rtl_modules(), *rtl_boards()]:
        code = "".join(code_of(line)[0] for line in file.read_text().splitlines(keepends=True))
        if OPEN.search(code):
            lines.append(off("PINCONNECTEMPTY", file))
        for port in STRUCT.findall(code):
            words = f"Bits of signal are not used: '{port}'*"
            lines.append(f'{off("UNUSEDSIGNAL", file)} -match "{words}"')
    return "\n".join([*lines, ""])


def prefixed(prefix: str, folder: Path) -> int:
    """Write a copy of the RTL whose modules and packages begin with a prefix.

    Args:
        prefix: Letters, digits and underscores.
        folder: Where the files go, by their folders; made if missing.

    Returns:
        The number of files.

    Raises:
        InputError: if the prefix is no beginning of a name, or the folder holds something.
    """
    if not re.fullmatch(r"[A-Za-z_]\w*", prefix):
        raise InputError(f"--prefix: letters, digits and underscores ({prefix})")
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise InputError(f"{folder}: is not an empty folder")
    sources = rtl_sources()
    stems = {file.stem for file in sources}

    def renamed(found: re.Match[str]) -> str:
        return prefix * (found[0] in stems) + found[0]

    for file in sources:
        lines = map(code_of, file.read_text().splitlines(keepends=True))
        target = folder / file.relative_to(ROOT / "rtl").with_name(prefix + file.name)
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_text("".join(NAMED.sub(renamed, code) + more for code, more in lines))
    (folder / WAIVERS).write_text(waivers(prefix))
    return len(sources)


def main() -> int:
    """Write the copy; the exit status is 2 where that cannot be done."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--prefix", required=True, help="how modules and packages begin")
    parser.add_argument("folder", type=Path, help="an empty folder, or none yet")
    arguments = parser.parse_args()
    try:
        count = prefixed(arguments.prefix, arguments.folder)
    except InputError as error:
        print(f"cores: {error}", file=sys.stderr)
        return 2
    print(f"{count} files in {arguments.folder}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
