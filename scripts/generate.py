"""Write what is generated from a single home elsewhere; with --check only say what is stale.

* ``rtl/vrscan_pkg.sv`` -> ``model/vrscan/data/pkg.py``: every width, flag bit and struct.
* ``rtl/link/link_pkg.sv`` -> ``model/vrscan/data/link_pkg.py``: the numbers of the protocol.
* ``vrscan.fixed.quarter_wave.table()`` -> ``rtl/trig/quarter_wave_rom.sv``.
* ``vrscan.fixed.peak_fit.rom()`` -> ``rtl/peak/peak_fit_rom.sv``, and
  ``vrscan.fixed.triangulate.rom()`` -> ``rtl/geometry/triangulate_rom.sv``.
* ``vrscan.fixed.cordic_vector`` -> ``rtl/trig/cordic_pkg.sv``: the angles of the iterations.
* ``vrscan.fixed.peak_refine`` -> ``rtl/peak/spot_sigma_pkg.sv``: a spot's width by its harmonic.
* ``rtl/link/registers.toml`` -> ``rtl/link/register_file.sv`` and ``register_pkg.sv``,
  ``docs/registers.md`` and ``model/vrscan/registers/register_map.py``: every register.
* ``rtl/`` -> ``vrscan_*.core`` and ``Bender.yml``: which files belong to which part; and
  ``vrscan.vlt``: what Verilator's -Wall is not to report of them.
"""

import argparse
import re
import sys
from collections.abc import Callable
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "model"))


def _localparams(source: str) -> list[tuple[str, str, int]]:
    """Return the localparams of a package: their name, that of the Python constant, the value."""
    found = re.findall(r"localparam int unsigned (\w+) = ([^;]+);", (ROOT / source).read_text())
    return [(n, re.sub(r"(?<!^)(?=[A-Z])", "_", n).upper(), int(value)) for n, value in found]


def link_package() -> str:
    """Return link_pkg.py: the localparams of link_pkg.sv as Python constants."""
    source = "rtl/link/link_pkg.sv"
    lines = [
        f'"""The serial protocol\'s numbers, written from {source} by scripts/generate.py."""',
        "",
    ]
    lines += [f"{constant} = {value}" for _, constant, value in _localparams(source)]
    return "\n".join([*lines, ""])


def _structs(source: str) -> list[str]:
    """Return the structs of a package as Python: name, bits or struct, sign of each field."""
    constants = {name: constant for name, constant, _ in _localparams(source)}
    text = re.sub(r" *//.*", "", (ROOT / source).read_text())
    lines = ["# The fields of each struct, the highest first: name, bits or struct, signed."]
    lines.append("STRUCTS: dict[str, tuple[tuple[str, int | str, bool], ...]] = {")
    for body, name in re.findall(r"typedef struct packed \{\n(.*?)\n  \} (\w+);", text, re.DOTALL):
        lines.append(f'    "{name}": (')
        for row in body.splitlines():
            field = re.fullmatch(r" +logic( signed)?(?: \[(\w+)-1:0\])? (\w+);", row)
            inner = re.fullmatch(r" +(\w+) (\w+);", row)
            if inner and inner[1] != "logic":
                lines.append(f'        ("{inner[2]}", "{inner[1]}", False),')
            elif field:
                bits = constants[field[2]] if field[2] else 1
                lines.append(f'        ("{field[3]}", {bits}, {field[1] is not None}),')
            else:
                raise ValueError(f"{source}: a field of {name} is not understood: {row.strip()}")
        lines.append("    ),")
    return [*lines, "}"]


def package() -> str:
    """Return pkg.py: the localparams and structs of vrscan_pkg.sv in Python."""
    source = "rtl/vrscan_pkg.sv"
    lines = [f'"""Widths, flag bits, structs, written from {source} by scripts/generate.py."""', ""]
    flags = []
    for name, constant, value in _localparams(source):
        lines.append(f"{constant} = {value}")
        if name.startswith("Flag") and name != "FlagWidth":
            flags.append((constant.removeprefix("FLAG_"), constant))
    lines += ["", "FLAGS = {"]
    lines += [f'    "{short}": {constant},' for short, constant in flags]
    lines += ["}", "", *_structs(source), ""]
    return "\n".join(lines)


def quarter_wave_rom() -> str:
    """Return the block RAM with the quarter wave."""
    from vrscan.fixed.quarter_wave import rom

    return rom()


def cordic_package() -> str:
    """Return the package with the arc tangents."""
    from vrscan.fixed.cordic_vector import package_source

    return package_source()


def spot_sigma_package() -> str:
    """Return the package with the spots' widths."""
    from vrscan.fixed.peak_refine import table_source

    return table_source()


def peak_fit_rom() -> str:
    """Return the tables of the fit."""
    from vrscan.fixed.peak_fit import rom

    return rom()


def triangulate_rom() -> str:
    """Return the table of the confidence."""
    from vrscan.fixed.triangulate import rom

    return rom()


def register_file() -> str:
    """Return the module that holds the registers."""
    from registers import described, register_file

    return register_file(described())


def register_package() -> str:
    """Return the package with the registers as structs."""
    from registers import described, register_pkg

    return register_pkg(described())


def odd_register_package() -> str:
    """Return the package of the tests' registers, which have every shape there is."""
    from registers import described, register_pkg

    return register_pkg(described("tb/devices/odd_registers.toml"), "odd_registers_pkg")


def odd_register_file() -> str:
    """Return their module."""
    from registers import described, register_file

    made = described("tb/devices/odd_registers.toml")
    return register_file(made, "odd_registers", "odd_registers_pkg")


def register_map() -> str:
    """Return the registers as the host knows them."""
    from registers import described, register_map

    return register_map(described())


def register_page() -> str:
    """Return the page that lists the registers."""
    from registers import described, document

    return document(described())


def fusesoc_core(name: str) -> Callable[[], str]:
    """Return the maker of a .core file."""

    def made() -> str:
        from cores import core

        return core(name)

    return made


def bender_manifest() -> str:
    """Return the list of files as Bender reads it."""
    from cores import manifest

    return manifest()


def verilator_waivers() -> str:
    """Return what Verilator's -Wall is not to report of the RTL."""
    from cores import waivers

    return waivers()


TARGETS: dict[str, Callable[[], str]] = {
    "model/vrscan/data/pkg.py": package,
    "model/vrscan/data/link_pkg.py": link_package,
    "rtl/trig/quarter_wave_rom.sv": quarter_wave_rom,
    "rtl/peak/peak_fit_rom.sv": peak_fit_rom,
    "rtl/geometry/triangulate_rom.sv": triangulate_rom,
    "rtl/trig/cordic_pkg.sv": cordic_package,
    "rtl/peak/spot_sigma_pkg.sv": spot_sigma_package,
    "rtl/link/register_file.sv": register_file,
    "rtl/link/register_pkg.sv": register_package,
    "model/vrscan/registers/register_map.py": register_map,
    "docs/registers.md": register_page,
    **{f"vrscan_{name}.core": fusesoc_core(name) for name in ("trig", "chain", "guard", "top")},
    "Bender.yml": bender_manifest,
    "vrscan.vlt": verilator_waivers,
    "tb/devices/odd_registers_pkg.sv": odd_register_package,
    "tb/devices/odd_registers.sv": odd_register_file,
}


def main() -> int:
    """Write or check every generated file; the exit status is 1 when one is stale."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--check", action="store_true", help="write nothing, fail on a stale file")
    arguments = parser.parse_args()
    stale = 0
    for name, make in TARGETS.items():
        path = ROOT / name
        text = make()
        if path.exists() and path.read_text() == text:
            continue
        if arguments.check:
            print(f"{name} is stale: run scripts/generate.py", file=sys.stderr)
            stale += 1
        else:
            path.write_text(text)
            print(f"wrote {name}", file=sys.stderr)
    return 1 if stale else 0


if __name__ == "__main__":
    sys.exit(main())
