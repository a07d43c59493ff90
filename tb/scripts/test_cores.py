"""The lists of files: FuseSoC builds with them, Bender's are there, a prefixed copy compiles."""

import importlib
import re
import subprocess
import sys
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
PARTS = ("trig", "chain", "top")


@pytest.mark.parametrize("part", PARTS)
def test_fusesoc_lints_each_part(part: str, tmp_path: Path) -> None:
    """FuseSoC finds the parts below by itself; its Verilator takes no files but the core's."""
    environment = verilator_environment()
    (tmp_path / "bin").mkdir()
    program = tmp_path / "bin" / "verilator"  # FuseSoC calls it by this name
    program.write_text(f'#!/bin/sh\nexec {verilator_program()} "$@"\n')
    program.chmod(0o755)
    environment["PATH"] = f"{program.parent}:{environment['PATH']}"
    environment["HOME"] = environment["XDG_CONFIG_HOME"] = str(tmp_path)
    fusesoc = Path(sys.executable).with_name("fusesoc")
    work = tmp_path / "work"
    command = [fusesoc, "--cores-root", ROOT, "run", "--target=lint", "--work-root", work]
    done = subprocess.run(
        [*command, f"dlr-vrscan:vrscan:{part}"],
        cwd=tmp_path,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    listed = "".join(file.read_text() for file in work.glob("*.vc"))
    for file in cores.files(part):
        assert f"/{file.name}" in listed, file


def test_the_parts_hold_every_module_once() -> None:
    held = [file for part in PARTS for file in cores.files(part)]
    assert len(held) == len(set(held))
    assert {file.stem for file in rtl_sources()} - {file.stem for file in held} <= {
        "reset_bridge",  # of the boards
        "pixel_fifo",
        "laser_guard",
    }


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
    options = ["--lint-only", "-Wno-MULTITOP", "--top-module", "vrs_vrscan_axi"]
    done = subprocess.run(
        [verilator_program(), *options, ROOT / "scripts" / "verilator.vlt", *made, other],
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
