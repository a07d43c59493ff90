"""The harness: a simulation that passed stands while nothing that it read has changed."""

import json
import subprocess
import sys
from pathlib import Path

import harness
import pytest

TB = Path(harness.__file__).parent


def run(folder: Path, script: str) -> list[str]:
    """Run a script as the simulator runs a test, and return what it is said to have read."""
    target = folder / "reads.json"
    code = f"import sys; sys.path[:0] = {[str(TB), str(folder / 'code')]}; import reads; {script}"
    environment = {"VRSCAN_READS": str(target), "PATH": ""}
    (folder / "run").mkdir(exist_ok=True)
    subprocess.run([sys.executable, "-c", code], env=environment, cwd=folder / "run", check=True)
    return json.loads(target.read_text())


def test_every_file_that_a_simulation_opens_is_noted(tmp_path: Path) -> None:
    """A module compiled before, one imported in a function, data: all; no library, no own file."""
    code = tmp_path / "code"
    (code / "part").mkdir(parents=True)
    (code / "part" / "__init__.py").write_text("")
    (code / "part" / "late.py").write_text("VALUE = 3\n")
    (code / "first.py").write_text(
        "from pathlib import Path\n"
        "import numpy\n"
        "def work():\n"
        "    from part import late\n"
        "    Path('own').write_text('x')\n"
        "    return late, Path(__file__).with_name('data.toml').read_text()\n"
    )
    (code / "data.toml").write_text("a = 1\n")
    (code / "other.py").write_text("")
    wanted = {code / "part" / "__init__.py", code / "part" / "late.py", code / "data.toml"}
    wanted |= {code / "first.py", TB / "reads.py"}
    for _ in range(2):  # the second time from what Python compiled
        assert {Path(n) for n in run(tmp_path, "import first; first.work()")} == wanted


@pytest.mark.parametrize("change", ["model", "rtl", "gone", "circumstances", None])
def test_a_change_of_anything_that_was_read_ends_what_stood(
    tmp_path: Path, change: str | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv(harness.ANEW, raising=False)
    files = {name: tmp_path / name for name in ("model", "rtl.sv", "gone")}
    for file in files.values():
        file.write_text("before")
    reads, verilated, kept = (tmp_path / n for n in ("reads.json", "ver.d", "kept.json"))
    reads.write_text(json.dumps([str(files["model"]), str(files["gone"])]))
    verilated.write_text(f"Vtop.cpp Vtop.h : {files['rtl.sv']} /usr/bin/verilator")
    assert not harness._stands(kept, ["version 1"])
    harness._keep(kept, reads, verilated, ["version 1"])
    if change == "gone":
        files["gone"].unlink()
    elif change in ("model", "rtl"):
        files["model" if change == "model" else "rtl.sv"].write_text("after")
    now = ["version 2" if change == "circumstances" else "version 1"]
    assert harness._stands(kept, now) == (change is None)
    monkeypatch.setenv(harness.ANEW, "1")
    assert not harness._stands(kept, now)
