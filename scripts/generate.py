"""Write what is generated from a single home elsewhere; with --check only say what is stale.

* ``rtl/vrscan_pkg.sv`` -> ``model/vrscan/data/pkg.py``: every width and flag bit.
* ``rtl/link/link_pkg.sv`` -> ``model/vrscan/data/link_pkg.py``: the numbers of the protocol.
* ``vrscan.fixed.quarter_wave.table()`` -> ``rtl/trig/quarter_wave_rom.sv``.
* ``vrscan.fixed.cordic_vector`` -> ``rtl/trig/cordic_pkg.sv``: the angles of the iterations.
* ``vrscan.fixed.peak_refine`` -> ``rtl/peak/spot_sigma_pkg.sv``: a spot's width by its harmonic.
* ``rtl/link/registers.toml`` -> ``rtl/link/register_file.sv``, ``register_pkg.sv`` and
  ``register_bank.sv``, ``docs/registers.md`` and ``model/vrscan/registers/register_map.py``: every
  register.
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


def package() -> str:
    """Return pkg.py: the localparams of vrscan_pkg.sv as Python constants."""
    source = "rtl/vrscan_pkg.sv"
    lines = [f'"""Widths and flag bits, written from {source} by scripts/generate.py."""', ""]
    flags = []
    for name, constant, value in _localparams(source):
        lines.append(f"{constant} = {value}")
        if name.startswith("Flag") and name != "FlagWidth":
            flags.append((constant.removeprefix("FLAG_"), constant))
    lines += ["", "FLAGS = {"]
    lines += [f'    "{short}": {constant},' for short, constant in flags]
    lines += ["}", ""]
    return "\n".join(lines)


def quarter_wave_rom() -> str:
    """Return the block RAM with the quarter wave."""
    from vrscan.fixed.quarter_wave import rom_source

    return rom_source()


def cordic_package() -> str:
    """Return the package with the arc tangents."""
    from vrscan.fixed.cordic_vector import package_source

    return package_source()


def spot_sigma_package() -> str:
    """Return the package with the spots' widths."""
    from vrscan.fixed.peak_refine import table_source

    return table_source()


def register_file() -> str:
    """Return the module that holds the registers."""
    from registers import described, register_file

    return register_file(described())


def odd_register_file() -> str:
    """Return the same for the tests' registers, which have every shape there is."""
    from registers import described, register_file

    return register_file(described("tb/devices/odd_registers.toml"), "odd_registers")


def register_map() -> str:
    """Return the registers as the host knows them."""
    from registers import described, register_map

    return register_map(described())


def register_page() -> str:
    """Return the page that lists the registers."""
    from registers import described, document

    return document(described())


def register_package() -> str:
    """Return the package with the registers as structs."""
    from register_structs import register_pkg
    from registers import described

    return register_pkg(described())


def register_bank() -> str:
    """Return the wrapper of register_file that has those for ports."""
    from register_structs import register_bank
    from registers import described

    return register_bank(described())


TARGETS: dict[str, Callable[[], str]] = {
    "model/vrscan/data/pkg.py": package,
    "model/vrscan/data/link_pkg.py": link_package,
    "rtl/trig/quarter_wave_rom.sv": quarter_wave_rom,
    "rtl/trig/cordic_pkg.sv": cordic_package,
    "rtl/peak/spot_sigma_pkg.sv": spot_sigma_package,
    "rtl/link/register_file.sv": register_file,
    "rtl/link/register_pkg.sv": register_package,
    "rtl/link/register_bank.sv": register_bank,
    "model/vrscan/registers/register_map.py": register_map,
    "docs/registers.md": register_page,
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
