"""What is said where a library that an extra brings is not installed."""

import importlib
import re
import subprocess
import sys
import tomllib
from importlib import metadata
from pathlib import Path

import numpy as np
import pytest
from packaging.specifiers import SpecifierSet

from vrscan.data.errors import InputError
from vrscan.data.extras import BRINGS, MissingError, install, named
from vrscan.data.parallel import processors, workers
from vrscan.engines.tools import repository_root

ROOT = repository_root()
FREE = """
import sys
sys.modules.update(dict.fromkeys({absent!r}))
{code}
"""


def without(absent: list[str], code: str, folder: Path) -> subprocess.CompletedProcess[str]:
    """Run a script in a Python in which some modules cannot be imported."""
    return subprocess.run(
        [sys.executable, "-c", FREE.format(absent=absent, code=code)],
        env={"PYTHONPATH": str(ROOT / "model")},
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
    )


def test_a_known_library_is_named_with_what_brings_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "scipy", None)
    with pytest.raises(MissingError) as caught, named():
        importlib.import_module("scipy")
    assert str(caught.value) == f"scipy is missing: {install('scene')}"
    assert isinstance(caught.value, InputError) and isinstance(caught.value, ImportError)


def test_a_mistake_of_the_program_stays_one() -> None:
    with pytest.raises(ModuleNotFoundError, match="vrscan_misspelt"), named():
        importlib.import_module("vrscan_misspelt")


def test_without_loky_one_process_works_and_more_are_refused(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setitem(sys.modules, "loky", None)
    assert processors() == 1
    with workers(np.square, 1) as do:
        assert list(do([2, 3])) == [4, 9]
    with pytest.raises(MissingError, match="loky is missing"), workers(np.square, 2):
        pass


@pytest.mark.parametrize(
    "module",
    [
        "vrscan",
        "vrscan.data.clouds",
        "vrscan.data.line_files",
        "vrscan.engines.engine",
        "vrscan.fixed.vrscan_chain",
        "vrscan.ideal.chain",
        "vrscan.registers.load",
        "vrscan.calibrate.motion_fit",
        "vrscan.link.device",
    ],
)
def test_a_detector_and_a_host_need_numpy_and_pydantic_alone(module: str, tmp_path: Path) -> None:
    done = without(sorted(BRINGS), f"import {module}", tmp_path)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize(
    ("absent", "arguments", "brings"),
    [
        ("typer", ["--version"], "cli"),
        ("rich", ["--version"], "cli"),
        ("scipy", ["scan", "--out", "scan"], "scene"),
        ("matplotlib", ["scan", "--out", "scan"], "study"),
        ("serial", ["link", "info", "--port", "none"], "link"),
    ],
)
def test_a_command_says_what_to_install(
    absent: str, arguments: list[str], brings: str, tmp_path: Path
) -> None:
    code = f"sys.argv = ['vrscan', *{arguments!r}]\nfrom vrscan.__main__ import main\nmain()"
    done = without([absent], code, tmp_path)
    assert done.returncode == 2, done.stderr
    (line,) = done.stderr.splitlines()
    assert line.startswith("vrscan: ")
    assert line.endswith(f"{absent} is missing: {install(brings)}")
    assert list(tmp_path.iterdir()) == []


# What Windows' Python does not have.
NOT_OF_WINDOWS = ["fcntl", "grp", "pty", "pwd", "resource", "termios", "tty"]


@pytest.mark.parametrize(
    "code",
    [
        "import vrscan",
        "import vrscan.link.device",
        "sys.argv = ['vrscan', '--help']\nfrom vrscan.__main__ import main\nmain()",
        "sys.argv = ['vrscan', '--version']\nfrom vrscan.__main__ import main\nmain()",
        "sys.argv = ['vrscan', 'link', 'info', '--help']\nfrom vrscan.__main__ import main\nmain()",
    ],
)
def test_nothing_starts_with_what_windows_lacks(code: str, tmp_path: Path) -> None:
    done = without(NOT_OF_WINDOWS, code, tmp_path)
    assert (done.returncode, done.stderr) == (0, ""), done.stderr


def test_every_library_is_in_the_extra_that_is_named_and_has_its_version_pinned() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    pinned = re.findall(r"^([\w.-]+)==", (ROOT / "requirements.txt").read_text(), re.MULTILINE)
    known = {name.lower() for name in pinned}
    called = {"PIL": "pillow", "serial": "pyserial", "dask": "distributed", "rerun": "rerun-sdk"}
    called |= {"mcap_ros2": "mcap-ros2-support"}
    extras = project["optional-dependencies"]
    for library, brings in BRINGS.items():
        assert called.get(library, library) in extras[brings], library
    wanted = {*project["dependencies"], *(name for names in extras.values() for name in names)}
    assert project["dependencies"] == ["numpy", "pydantic"]
    assert {name.lower() for name in wanted if not name.startswith("vrscan[")} <= known


def test_every_pinned_version_takes_the_python_of_debian_12() -> None:
    wanted = {one.name: one.metadata.get("Requires-Python", "") for one in metadata.distributions()}
    assert not {n for n, python in wanted.items() if "3.11.2" not in SpecifierSet(python)}
