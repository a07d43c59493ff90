"""``import vrscan``: its functions against the command, and what they refuse."""

import contextlib
import doctest
import importlib
import io
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from fake_board import FakeBoard
from run_command import ended
from scanners import EACH_SCANNER, words

import vrscan
from vrscan.data import line_files, table
from vrscan.data.config import Config
from vrscan.data.errors import InputError, LinesError
from vrscan.data.extras import MissingError, install
from vrscan.data.points import COLUMNS, write_csv
from vrscan.data.table import Table
from vrscan.engines.tools import repository_root
from vrscan.scene.description import load


def csv(points: Table) -> str:
    file = io.BytesIO()
    write_csv(points, file)
    return file.getvalue().decode()


@pytest.fixture(scope="module")
def lines() -> vrscan.Lines:
    return vrscan.simulate("step", 300)


@pytest.mark.parametrize("name", sorted(vrscan._PLACES))
def test_each_name_has_an_example_that_runs(name: str, tmp_path: Path) -> None:
    """``Device`` meets a board of the twins."""
    module, _, attribute = vrscan._PLACES[name].partition(":")
    found = getattr(importlib.import_module(module), attribute)
    (example,) = doctest.DocTestFinder(recurse=False).find(found, attribute, globs={})
    assert example.examples
    with FakeBoard(tmp_path / "port") if name == "Device" else contextlib.nullcontext():
        example.globs["port"] = str(tmp_path / "port")
        told = io.StringIO()
        assert doctest.DocTestRunner().run(example, out=told.write).failed == 0, told.getvalue()


def test_the_other_examples_run() -> None:
    found = doctest.testmod(table)
    assert found.attempted > 4
    assert found.failed == 0


def test_every_name_is_there_and_listed() -> None:
    for name in vrscan.__all__:
        assert getattr(vrscan, name) is not None
        assert name in dir(vrscan)
    assert vrscan.Config is Config
    assert set(vrscan._PLACES) == set(vrscan.__all__) - {"__version__"}


def test_what_is_not_there_is_an_attribute_error() -> None:
    assert not hasattr(vrscan, "simulat")
    with pytest.raises(ImportError, match="cannot import name 'simulat'"):
        exec("from vrscan import simulat")


def test_an_import_imports_nothing_yet(tmp_path: Path) -> None:
    code = "import sys, vrscan; print([n for n in sys.modules if n.startswith('vrscan.')])"
    done = subprocess.run(
        [sys.executable, "-c", code],
        env={"PYTHONPATH": str(repository_root() / "model")},
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout.strip() == "[]"


def test_a_type_checker_knows_the_types(tmp_path: Path) -> None:
    (tmp_path / "use.py").write_text(
        "import vrscan\n"
        "points: vrscan.Table = vrscan.detect(vrscan.simulate('plane', 64), mode='two_pass')\n"
        "version: str = vrscan.__version__\n"
        "wrong: int = vrscan.fit_motion(points.x_mm, points.z_mm, 249.0)\n"
        "vrscan.simulat\n"
        "vrscan.detect(vrscan.simulate('plane', 64), engine='rlt')\n"
    )
    done = subprocess.run(
        [sys.executable, "-m", "mypy", "--strict", str(tmp_path / "use.py")],
        env={"PYTHONPATH": str(repository_root() / "model"), "MYPYPATH": "model"},
        cwd=repository_root(),
        capture_output=True,
        text=True,
        check=False,
    )
    told = [line.split("use.py:")[1].split(":")[0] for line in done.stdout.splitlines()[:-1]]
    assert told == ["4", "5", "6"], done.stdout


@EACH_SCANNER
def test_lines_are_those_of_the_command(
    config: Config, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    lines = vrscan.simulate("step", 300, config=config)
    given = ["scan", "step", "--lines", "300", "--engine", "fixed", "--keep-lines", "--out", "out"]
    assert ended(monkeypatch, *given, *words(config)) == 0
    kept = line_files.read(tmp_path / "out" / "lines.mcap", config)
    assert np.array_equal(kept.lines, lines.lines)
    assert np.array_equal(kept.angle_rad, lines.angle_rad)
    assert np.array_equal(kept.power, lines.power)
    assert (tmp_path / "out" / "points.csv").read_text() == csv(vrscan.detect(lines, config=config))


def test_a_scene_is_a_name_a_path_or_itself(lines: vrscan.Lines, tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text((repository_root() / "model/vrscan/scene/scenes/step.toml").read_text())
    for scene in (path, str(path), load("step")):
        found = vrscan.simulate(scene, 300)
        assert np.array_equal(found.lines, lines.lines)


def test_a_mode_is_that_of_the_configuration(lines: vrscan.Lines, tmp_path: Path) -> None:
    found = {}
    mode: Any
    for mode in ("threshold", "two_pass", "fit"):
        path = tmp_path / f"{mode}.toml"
        path.write_text(f'[peak]\nwindow = "{mode}"\n')
        found[mode] = csv(vrscan.detect(lines, mode))
        assert csv(vrscan.detect(lines, config=path)) == found[mode]
        assert csv(vrscan.detect(lines, "fit", config=path)) == csv(vrscan.detect(lines))
    assert len(set(found.values())) == 3
    assert csv(vrscan.detect(lines)) == found["fit"]


@pytest.mark.parametrize("engine", ["fixed", "ideal", "rtl"])
def test_engines_agree_and_processes_do_not_matter(engine: Any, lines: vrscan.Lines) -> None:
    many = vrscan.simulate("plane", 1100, fidelity="minimal")
    told: list[int] = []
    one = vrscan.detect(many, engine=engine)
    two = vrscan.detect(many, engine=engine, jobs=2, progress=told.append)
    assert csv(one) == csv(two)
    assert told == [1024, 1100]
    if engine == "rtl":
        assert csv(vrscan.detect(lines, engine="rtl")) == csv(vrscan.detect(lines))


def test_a_frame_is_the_file(lines: vrscan.Lines) -> None:
    dark = np.zeros((2, 2048), np.uint16)
    mixed = vrscan.Lines(
        np.concatenate([dark, lines.lines]),
        np.concatenate([np.zeros(2), lines.angle_rad]),
        np.concatenate([[1, 1], lines.power]),
    )
    points = vrscan.detect(mixed)
    frame = vrscan.to_frame(points)
    assert ",".join(frame.columns) == COLUMNS
    read = pd.read_csv(io.StringIO(csv(points)), dtype={"left": "Int64", "right": "Int64"})
    read["flags"] = read["flags"].fillna("")
    assert frame.x_mm.isna()[:2].all() and frame.left.isna()[:2].all()
    assert frame["flags"][0] != ""
    pd.testing.assert_frame_equal(frame, read, check_dtype=False, rtol=0.0, atol=2e-3)


WRONG: Any = "rlt"
REFUSED = {
    "no scene": lambda: vrscan.simulate("bolts"),
    "no line": lambda: vrscan.simulate("plane", 0),
    "no effect": lambda: vrscan.simulate("plane", 64, fidelity=["speckles"]),
    "no fidelity": lambda: vrscan.simulate("plane", 64, fidelity="most"),
    "jobs": lambda: vrscan.simulate("plane", 64, jobs=-1),
    "no file": lambda: vrscan.detect(DARK, config="none.toml"),
    "no engine": lambda: vrscan.detect(DARK, engine=WRONG),
    "no mode": lambda: vrscan.detect(DARK, mode=WRONG),
    "mode and period": lambda: vrscan.detect(DARK, "two_pass", config=ODD),
    "detect's jobs": lambda: vrscan.detect(DARK, jobs=-1),
    "shape": lambda: vrscan.detect(vrscan.Lines(DARK.lines[:, 1:], DARK.angle_rad, DARK.power)),
}
DARK = vrscan.Lines(np.zeros((2, 2048), np.uint16), np.zeros(2), np.ones(2, np.int64))
ODD = Config.model_validate({"peak": {"window": "threshold", "period": "n-1"}})


@pytest.mark.parametrize("case", REFUSED)
def test_what_is_wrong_is_one_line(case: str) -> None:
    with pytest.raises(InputError) as caught:
        REFUSED[case]()
    assert "\n" not in str(caught.value)


def test_a_bad_line_has_its_number_with_many_processes() -> None:
    pixels = np.zeros((1500, 2048), np.uint16)
    pixels[1300, 7] = 5000
    bad = vrscan.Lines(pixels, np.zeros(1500), np.ones(1500, np.int64))
    for jobs in (1, 2):
        with pytest.raises(LinesError, match="5000 at line 1300, pixel 7"):
            vrscan.detect(bad, jobs=jobs)


def test_a_first_try_with_something_else_is_told_what_is_wanted() -> None:
    pixels = np.zeros((3, 2048), np.uint16)
    for given, what in ((pixels, "ndarray [3, 2048] of uint16"), ("lines.npy", "str")):
        with pytest.raises(LinesError, match=r"^detect: lines must be vrscan.Lines\(") as caught:
            vrscan.detect(given)
        assert str(caught.value).endswith(what)
    with pytest.raises(InputError, match=r"^config must be .* not dict$"):
        vrscan.detect(DARK, config={"peak": {}})
    with pytest.raises(InputError, match=r"^simulate: scene must be .* not Lines$"):
        vrscan.simulate(DARK)
    with pytest.raises(InputError, match=r"^to_frame: points must be .* not Lines$"):
        vrscan.to_frame(DARK)


def test_without_its_library_a_function_says_what_to_install(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    points = vrscan.detect(DARK)
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(MissingError) as caught:
        vrscan.to_frame(points)
    assert str(caught.value) == f"pandas is missing: {install('scene')}"
    monkeypatch.setitem(sys.modules, "vrscan.scene.description", None)
    monkeypatch.delitem(vars(vrscan), "Scene", raising=False)
    with pytest.raises(ModuleNotFoundError):  # a mistake in the package is not hidden
        _ = importlib.import_module("vrscan").Scene
