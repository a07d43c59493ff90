"""``vrscan config`` and ``vrscan new``."""

import shlex
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

from vrscan.cli.app import app
from vrscan.cli.progress import step
from vrscan.data.boards import SHIPPED, with_clock
from vrscan.data.config import load
from vrscan.data.errors import InputError
from vrscan.registers.chain_registers import Registers
from vrscan.scene import description

METRE = {
    "near-mm": "400",
    "far-mm": "2500",
    "base-mm": "100",
    "bias-deg": "82",
    "focal-mm": "25",
    "f-number": "3",
    "line-length": "1024",
    "pitch-um": "14",
    "pixel-width": "10",
    "rate-hz": "20000",
    "clock-mhz": "100",
}


def new(file: Path, *more: str, answers: str = "", **changed: str | None):
    given = {**METRE, **{key.replace("_", "-"): value for key, value in changed.items()}}
    options = [word for k, v in given.items() if v is not None for word in (f"--{k}", v)]
    return CliRunner().invoke(app, ["new", str(file), *options, *more], input=answers)


def test_a_new_scanner_is_the_one_that_was_asked_for(tmp_path: Path) -> None:
    file, drawn, scene = (tmp_path / name for name in ("new.toml", "new.png", "board.toml"))
    result = new(file, "--picture", str(drawn), "--scene", str(scene))
    assert result.exit_code == 0, result.output
    made = load(file)
    assert made.model_dump() == load(Path("metre")).model_dump()
    board = description.load(str(scene)).target[0]
    assert board.position_mm[2] == pytest.approx(made.free.focus_mm, rel=1e-3)
    Registers.from_config(made)
    assert "field of view 32.0 degrees" in result.output
    for name in ("e_l (6)", "p_a (7)", "dwell", "spacing", "efficiency"):
        assert name in result.output
    assert max(map(len, result.output.splitlines()[:-1])) <= 120  # but for the next step
    assert drawn.read_bytes().startswith(b"\x89PNG")


def test_the_next_step_runs_as_it_is_printed(tmp_path: Path) -> None:
    """From wherever the program was started, and with a blank in a file's name."""
    file, scene = tmp_path / "my scanner.toml", tmp_path / "a scene.toml"
    result = new(file, "--scene", str(scene))
    assert result.exit_code == 0, result.output
    words = shlex.split(result.stdout.splitlines()[-1].partition(".toml: ")[2])
    assert words[:4] == [sys.executable, "-m", "vrscan", "scan"]
    few = ["--lines", "32", "--engine", "fixed", "--out", str(tmp_path / "out")]
    done = CliRunner().invoke(app, [*words[3:], *few])
    assert done.exit_code == 0, done.output


@pytest.mark.parametrize(
    ("called", "on_path", "shown"),
    [
        ("bin/vrscan", False, "bin/vrscan"),
        ("bin/vrscan", True, "vrscan"),
        ("x/__main__.py", False, ""),
    ],
)
def test_a_step_is_a_command_of_the_program_that_was_called(
    called: str, on_path: bool, shown: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    program = tmp_path / called
    program.parent.mkdir()
    program.touch(0o755)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PATH", str(program.parent) if on_path else "/nowhere")
    monkeypatch.setattr(sys, "argv", [str(program)])
    assert step("scan", "a b") == f"{shown or f'{sys.executable} -m vrscan'} scan 'a b'"


def test_a_far_range_takes_a_larger_unit_of_length(tmp_path: Path) -> None:
    file = tmp_path / "far.toml"
    for far, unit_mm in (("2047", 1), ("2048", 2), ("8000", 4)):
        result = new(file, near_mm="800", far_mm=far, base_mm="200", bias_deg="86")
        assert result.exit_code == 0, result.output
        made = load(file)
        assert made.geometry.unit_mm == unit_mm and made.geometry.range_mm == 2048 * unit_mm


def test_what_is_not_given_is_asked_for(tmp_path: Path) -> None:
    file = tmp_path / "new.toml"
    result = new(file, base_mm=None, answers="90\n")
    assert result.exit_code == 0, result.output
    assert load(file).geometry.base_mm == 90.0
    result = new(file, clock_mhz=None, rate_hz=None, line_length="2048", answers="\n\n")
    assert result.exit_code == 0, result.output  # a clock that a board has, and a rate that fits
    made = load(file)
    assert with_clock(made.clock.frequency_hz) is SHIPPED
    assert 0.999 < made.line.rate_hz / made.most_lines_hz <= 1.0
    silent = new(tmp_path / "none.toml", base_mm=None)
    assert str(silent.exception) == "--base-mm: neither given nor answered"


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"near_mm": "100"}, ["near_mm = 100", "focal_mm", "line_length", "bias_deg"]),
        ({"bias_deg": "60"}, ["both ends", "bias_deg = 81.8"]),
        ({"rate_hz": "60000"}, ["line.rate_hz", "at most"]),
        ({"pixel_width": "20"}, ["sensor.pixel_width", "20"]),
        ({"focal_mm": "5", "line_length": "4096"}, ["geometry.focal_mm", "outside"]),
    ],
)
def test_a_dead_end_is_one_line_and_leaves_no_file(
    tmp_path: Path, changed: dict[str, str], words: list[str]
) -> None:
    file = tmp_path / "new.toml"
    result = new(file, **changed)
    assert isinstance(result.exception, InputError)
    for word in words:
        assert word in str(result.exception)
    assert "\n" not in str(result.exception)
    assert list(tmp_path.iterdir()) == []


def test_config_prints_what_is_taken_again(tmp_path: Path) -> None:
    result = CliRunner().invoke(app, ["config", "--config", "metre"])
    assert result.exit_code == 0, result.output
    file = tmp_path / "all.toml"
    file.write_text(result.output)
    assert load(file).model_dump() == load(Path("metre")).model_dump()


def test_a_scene_in_the_place_of_the_configuration_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "new.toml"
    result = new(file, "--scene", str(tmp_path / "." / "new.toml"))
    assert isinstance(result.exception, InputError) and "--scene" in str(result.exception)
    result = new(file, "--picture", str(tmp_path / "a.png"), "--scene", str(tmp_path / "no" / "b"))
    assert result.exit_code != 0
    assert list(tmp_path.iterdir()) == []
