"""What Make calls: a missing tool is one line, and the registers that timing.py puts around."""

import re
import shutil
import subprocess
import sys
from collections import Counter
from pathlib import Path

import pytest

from vrscan.engines.tools import repository_root, rtl_boards, rtl_closure, rtl_module, rtl_sources

sys.path.insert(0, str(repository_root() / "scripts"))
import timing

SCRIPTS = repository_root() / "scripts"
NEEDED = ["cat", "dirname", "g++", "make", "python3", "sed", "sh", "sha256sum"]

# A python3 that lacks something, whatever the real one has.
WITHOUT_VENV = """
import importlib.util as util
find = util.find_spec
util.find_spec = lambda name: None if name == "ensurepip" else find(name)
"""
WITHOUT_LIBRARY = """
import sysconfig
sysconfig.get_config_vars = lambda *names: ["/nowhere", "libpython_of_nowhere.so"]
"""
TOO_OLD = """
sys.version_info = (3, 9, 2)
sys.version = "3.9.2 (main)"
"""


def tool(name: str) -> str:
    """Return where a tool is; this Python itself for python3, which may be a script elsewhere."""
    found = sys.executable if name == "python3" else shutil.which(name)
    assert found is not None
    return found


def setup_with(folder: Path, *, lacks: tuple[str, ...] = (), python: str = "") -> str:
    """Return what setup.sh says, as its only words, where the PATH lacks these tools."""
    for name in NEEDED:
        if name not in lacks:
            (folder / name).symlink_to(tool(name))
    if python:
        (folder / "python3").unlink()
        (folder / "edit.py").write_text(
            f"import sys\n{python}\nsys.argv = sys.argv[1:]\nexec(sys.stdin.read())\n"
        )
        wrapper = f'#!/bin/sh\nexec {sys.executable} {folder / "edit.py"} "$@"\n'
        (folder / "python3").write_text(wrapper)
        (folder / "python3").chmod(0o755)
    done = subprocess.run(
        [folder / "sh", SCRIPTS / "setup.sh", "simulate"],
        env={"PATH": str(folder)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 1
    assert done.stderr == ""
    return done.stdout


@pytest.mark.parametrize(
    ("lacks", "python", "words"),
    [
        (("g++",), "", "g++ is missing: apt install g++"),
        (("g++", "make"), "", "g++ make are missing: apt install g++ make"),
        (("python3",), "", "python3 is missing: apt install python3"),
        ((), WITHOUT_VENV, "python3-venv is missing: apt install python3-venv"),
        (
            (),
            WITHOUT_LIBRARY,
            "libpython{0}.{1} is missing: apt install libpython{0}.{1}".format(*sys.version_info),
        ),
        (
            (),
            TOO_OLD,
            "Python 3.9.2 is too old, 3.11 is the oldest: "
            "apt install python3 on Debian 12 or newer",
        ),
    ],
    ids=["compiler", "two_tools", "python", "venv", "libpython", "old_python"],
)
def test_what_is_missing_is_one_line(
    tmp_path: Path, lacks: tuple[str, ...], python: str, words: str
) -> None:
    assert setup_with(tmp_path, lacks=lacks, python=python) == f"vrscan: {words}\n"


def test_make_ends_with_that_line(tmp_path: Path) -> None:
    for name in set(NEEDED) - {"g++"}:
        (tmp_path / name).symlink_to(tool(name))
    done = subprocess.run(
        [tmp_path / "make", "-C", repository_root(), "--no-print-directory", "test"],
        env={"PATH": str(tmp_path)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode != 0
    assert done.stdout == ""
    assert done.stderr.count("\n") == 1
    assert "vrscan: g++ is missing: apt install g++" in done.stderr


def test_a_closure_holds_every_file_that_is_named() -> None:
    closure = [file.stem for file in rtl_closure(rtl_module("quarter_wave"))]
    assert closure[0] == "vrscan_pkg"  # packages first
    assert sorted(closure) == ["quarter_wave", "quarter_wave_rom", "vrscan_pkg"]


def test_no_sign_stands_before_a_cast_to_a_width() -> None:
    """Yosys takes the sign for a part of the width: ~Width'(1) is (~Width)'(1) there."""
    sign = re.compile(r"(?:[~!]|[=(?:,<>&|^*+]\s*-|[=(?:,<>*]\s*[+&|^])\s*(?!(?:un)?signed')\w+'\(")
    assert sign.search("a & ~Width'(1)") and sign.search("b <= -Width'(a)")
    assert not sign.search("a & ~(Width'(1)) - Width'(a) != Width'(1)")
    found = [
        f"{file.name}: {hit[0]}"
        for file in [*rtl_sources(), *rtl_boards()]
        for hit in sign.finditer(re.sub(r"//.*", "", file.read_text()))
    ]
    assert not found


def test_registers_around_a_netlist() -> None:
    """Three inputs besides the clock, five different outputs: 3 + 5 + 2 + 1 registers."""

    def net(*bits: int | str) -> dict[str, object]:
        return {"hide_name": 0, "bits": list(bits), "attributes": {}}

    def port(direction: str, *bits: int | str) -> dict[str, object]:
        return {"direction": direction, "bits": list(bits)}

    module = {
        "cells": {},
        "netnames": {"clk_i": net(2), "a_i": net(3, 4, 5), "b_o": net(6, 7, 8, 9)},
        "ports": {
            "clk_i": port("input", 2),
            "a_i": port("input", 3, 4, 5),
            "b_o": port("output", 6, 7, 8, 9, "0", 3, 6),
        },
    }
    timing.surround(module)
    assert list(module["ports"]) == ["clk_i", "serial_i", "folded_o"]
    kinds = Counter(cell["type"] for cell in module["cells"].values())
    assert kinds == {"TRELLIS_FF": 11, "LUT4": 3}

    registers = [c["connections"] for c in module["cells"].values() if c["type"] == "TRELLIS_FF"]
    source = {pins["Q"][0]: pins["DI"][0] for pins in registers}
    serial = module["ports"]["serial_i"]["bits"][0]
    assert [source[bit] for bit in (3, 4, 5)] == [serial, 3, 4]
    assert {3, 6, 7, 8, 9} <= set(source.values())


def test_a_row_of_the_timing_table_is_replaced_alone() -> None:
    """The others stay as they are, a module that is gone loses its row, and one without is told."""
    old = "| module | Fmax MHz |\n|---|--:|\n| divide | 1.0 |\n| gone | 2.0 |\n| multiply | 3.0 |\n"
    row = timing.Result("divide", 150.0, "heap 1", 10, 20, 0, 0.0, "", "")
    table, missing = timing.merged(old, [row], ["divide", "multiply", "square_root"])
    assert table.splitlines()[2:] == ["| divide | 150.0 | 10 | 20 | 0 | 0 |", "| multiply | 3.0 |"]
    assert missing == ["square_root"]
