"""The lists of files: FuseSoC builds with them, Bender's are there, a prefixed copy compiles."""

import importlib
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from vrscan.data.errors import InputError
from vrscan.engines.tools import (
    repository_root,
    rtl_packages,
    rtl_sources,
    verilator_environment,
    verilator_program,
)

ROOT = repository_root()
sys.path.insert(0, str(ROOT / "scripts"))
cores = importlib.import_module("cores")
PARTS = ("trig", "chain", "guard", "top")


def debian(folder: Path) -> dict[str, str]:
    """Return the environment of Debian 12's Verilator, the oldest that lints the cores."""
    command = ["sh", "-c", "apt-get download verilator && dpkg -x verilator_5.006*.deb ."]
    if subprocess.run(command, cwd=folder, capture_output=True, check=False).returncode:
        pytest.skip("Debian's verilator 5.006 cannot be had here")
    shutil.copytree(folder / "usr/bin", folder / "root/bin")
    (folder / "root/include").symlink_to(folder / "usr/share/verilator/include")
    bin_ = f"{folder}/root/bin:{Path(sys.executable).parent}:{os.environ['PATH']}"
    return os.environ | {"VERILATOR_ROOT": f"{folder}/root", "PATH": bin_}


def shipped(folder: Path) -> dict[str, str]:
    """Return the environment of our own Verilator, which FuseSoC calls by its name."""
    environment = verilator_environment()
    program = folder / "verilator"
    program.write_text(f'#!/bin/sh\nexec {verilator_program()} "$@"\n')
    program.chmod(0o755)
    environment["PATH"] = f"{folder}:{environment['PATH']}"
    return environment


VERILATORS = pytest.mark.parametrize("verilator", [shipped, debian])


def linted(
    name: str, folder: Path, verilator: Callable[[Path], dict[str, str]]
) -> subprocess.CompletedProcess[str]:
    """Let FuseSoC lint a core of ours or of a folder."""
    (folder / "tool").mkdir()
    environment = verilator(folder / "tool")
    environment["HOME"] = environment["XDG_CONFIG_HOME"] = str(folder)
    fusesoc = Path(sys.executable).with_name("fusesoc")
    roots = [word for root in (ROOT, folder) for word in ("--cores-root", root)]
    return subprocess.run(
        [fusesoc, *roots, "run", "--target=lint", "--work-root", folder / "work", name],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )


@VERILATORS
@pytest.mark.parametrize("part", PARTS)
def test_fusesoc_lints_each_part(
    part: str, verilator: Callable[[Path], dict[str, str]], tmp_path: Path
) -> None:
    """FuseSoC finds the parts below by itself; its Verilator takes no files but the core's."""
    done = linted(f"dlr-vrscan:vrscan:{part}", tmp_path, verilator)
    assert done.returncode == 0, done.stdout + done.stderr
    listed = "".join(file.read_text() for file in (tmp_path / "work").glob("*.vc"))
    for file in cores.files(part):
        assert f"/{file.name}" in listed, file


@VERILATORS
def test_a_strict_project_sees_its_own_warnings_alone(
    verilator: Callable[[Path], dict[str, str]], tmp_path: Path
) -> None:
    """With -Wall: pins that it leaves out and an output that it leaves open, in its own file."""
    (tmp_path / "mine.sv").write_text(
        "module mine;\n  vrscan_guarded u_block (.pulse_o());\nendmodule\n"
    )
    (tmp_path / "mine.core").write_text(
        "CAPI=2:\nname: me:mine:mine:1\n"
        "filesets: {rtl: {file_type: systemVerilogSource, files: [mine.sv],"
        ' depend: ["dlr-vrscan:vrscan:top"]}}\n'
        "targets: {default: {filesets: [rtl]}, lint: {filesets: [rtl], toplevel: mine,"
        " default_tool: verilator, tools: {verilator: {mode: lint-only,"
        ' verilator_options: ["-Wall"]}}}}\n'
    )
    done = linted("me:mine:mine", tmp_path, verilator)
    assert done.returncode
    warned = re.findall(r"%Warning-(\w+): (\S+?):", done.stdout + done.stderr)
    assert {rule for rule, _ in warned} == {"PINMISSING", "PINCONNECTEMPTY"}
    assert {Path(file).name for _, file in warned} == {"mine.sv"}


def test_the_parts_hold_every_module_once() -> None:
    held = [file for part in PARTS for file in cores.files(part)]
    assert len(held) == len(set(held))
    assert set(held) == set(rtl_sources())


def test_a_field_of_a_modules_name_is_no_use_of_it() -> None:
    assert "focus_target" not in {file.stem for file in cores.files("chain")}


def test_benders_files_are_there_packages_first() -> None:
    text = (ROOT / "Bender.yml").read_text()
    listed = [ROOT / name for name in re.findall(r"^ +- (rtl/\S+)$", text, re.MULTILINE)]
    assert listed and all(file.is_file() for file in listed)
    assert [file for part in PARTS for file in cores.files(part)] == listed
    import yaml

    read = yaml.safe_load(text)
    assert read["package"]["name"] == "vrscan"
    assert [ROOT / name for group in read["sources"] for name in group["files"]] == listed


def test_a_prefixed_copy_meets_no_other_name(tmp_path: Path) -> None:
    """Verilator reads it beside a module of another design that is called divide."""
    folder = tmp_path / "copy"
    script = [sys.executable, ROOT / "scripts" / "cores.py", "--prefix", "vrs_", folder]
    said = subprocess.run(script, capture_output=True, text=True, check=True).stdout
    assert said == f"{len(rtl_sources())} files in {folder}\n"
    other = tmp_path / "divide.sv"
    other.write_text("module divide; endmodule\n")
    made = sorted(folder.rglob("*.sv"), key=lambda file: not file.stem.endswith("_pkg"))
    assert {file.stem for file in made} == {f"vrs_{file.stem}" for file in rtl_sources()}
    order = [f"vrs_{file.stem}" for file in rtl_packages()]
    made.sort(key=lambda f: order.index(f.stem) if f.stem in order else len(order))
    options = ["--lint-only", "-Wall", "-Wno-MULTITOP", "-Wno-DECLFILENAME"]
    options += ["--top-module", "vrs_vrscan_guarded"]
    done = subprocess.run(
        [verilator_program(), *options, folder / "vrscan.vlt", *made, other],
        env=verilator_environment(),
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr[-2000:]


@pytest.mark.parametrize(("prefix", "named"), [("1a", "--prefix"), ("", "--prefix")])
def test_a_bad_prefix_is_refused(prefix: str, named: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=named):
        cores.prefixed(prefix, tmp_path / "copy")
    assert not (tmp_path / "copy").exists()


def test_a_full_folder_is_refused(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match="not an empty folder"):
        cores.prefixed("a_", tmp_path)
