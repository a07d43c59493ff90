"""Bad input at the command: one line on the error stream, status 2, nothing left behind."""

import contextlib
import re
import resource
import signal
import subprocess
import sys
import time
import tomllib
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from run_command import ended

from vrscan.cli import app as cli
from vrscan.cli import view_commands
from vrscan.engines.tools import repository_root


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with inputs, good and bad, which is also the working directory."""
    good = np.full((3, 2048), 60, np.uint16)
    np.savez(tmp_path / "good.npz", lines=good)
    np.savez(tmp_path / "nan.npz", lines=good, angle_rad=np.array([0.0, np.nan, 0.0]))
    np.savez(tmp_path / "pi.npz", lines=good, angle_rad=np.array([0.0, 0.0, 3.2]))
    np.savez(tmp_path / "degrees.npz", lines=good, angle_deg=np.zeros(3))
    np.savez(tmp_path / "flag.npz", lines=good, mirror_flags=np.array([0, 0, 8], np.uint8))
    np.save(tmp_path / "bright.npy", good + np.uint16(4096))
    np.save(tmp_path / "short.npy", good[:, :100])
    np.save(tmp_path / "float.npy", good + 0.5)
    (tmp_path / "empty.npy").write_bytes(b"")
    (tmp_path / "broken.npz").write_bytes((tmp_path / "good.npz").read_bytes()[:500])
    (tmp_path / "key.toml").write_text("[peak]\nk_nose = 3\n")
    (tmp_path / "value.toml").write_text("[peak]\nmin_width = 1\n")
    (tmp_path / "register.toml").write_text("[geometry]\nk1 = 1\n")
    (tmp_path / "two_pass.toml").write_text('[peak]\nwindow = "two_pass"\nperiod = "n-1"\n')
    (tmp_path / "rate.toml").write_text("[clock]\nfrequency_hz = 1e8\n[line]\nrate_hz = 70000.0\n")
    (tmp_path / "long.toml").write_text(
        "[sensor]\nline_length = 4096\n[geometry]\ncentre_px = 2047.5\n"
    )
    plane = '[[target]]\nkind = "plane"\n'
    night = "2015-06-24T01:30:00+08:00"
    (tmp_path / "target.toml").write_text('[[target]]\nkind = "plan"\n')
    (tmp_path / "map.toml").write_text(plane + 'map = { kind = "cheker" }\n')
    (tmp_path / "lamp.toml").write_text(plane + '[[lamp]]\nkind = "halogene"\n')
    (tmp_path / "material.toml").write_text(plane + 'material = "withe"\n[material.white]\n')
    (tmp_path / "night.toml").write_text(f"[sun]\ntime = {night}\n{plane}")
    (tmp_path / "site.toml").write_text(f"[[moment]]\ntime = {night}\n")
    (tmp_path / "mesh.toml").write_text('[[target]]\nkind = "mesh"\nfile = "prt.stl"\n')
    (tmp_path / "broken.toml").write_text('[[target]]\nkind = "mesh"\nfile = "part.stl"\n')
    (tmp_path / "part.stl").write_text("solid nothing of the sort")
    (tmp_path / "odd.toml").write_text(f"[laser]\npower_mw = 0\n{plane}")
    (tmp_path / "folder.csv").mkdir()
    (tmp_path / "null.csv").symlink_to("/dev/null")
    monkeypatch.chdir(tmp_path)
    return tmp_path


IDEAL = ["--engine", "ideal"]
REPLAY = ["--out", "out.csv", *IDEAL]
CASES = {
    "missing_lines": (["replay", "none.npy", *REPLAY], ["none.npy"]),
    "empty_lines": (["replay", "empty.npy", *REPLAY], ["empty.npy", "0 bytes"]),
    "broken_lines": (["replay", "broken.npz", *REPLAY], ["broken.npz"]),
    "bright_pixel": (["replay", "bright.npy", *REPLAY], ["bright.npy", "4156"]),
    "short_lines": (["replay", "short.npy", *REPLAY], ["short.npy", "(3, 100)"]),
    "floating_lines": (["replay", "float.npy", *REPLAY], ["float.npy", ".5 at line 0"]),
    "nan_angle": (["replay", "nan.npz", *REPLAY], ["nan.npz", "nan at line 1"]),
    "large_angle": (["replay", "pi.npz", *REPLAY], ["pi.npz", "3.2 at line 2"]),
    "large_flag": (["replay", "flag.npz", *REPLAY], ["flag.npz", "mirror_flags", "8 at line 2"]),
    "misspelt_angle": (
        ["replay", "degrees.npz", *REPLAY],
        ["degrees.npz", "no array named angle_rad, but 'angle_deg'", "mirror_flags"],
    ),
    "missing_config": (["replay", "good.npz", *REPLAY, "--config", "no.toml"], ["no.toml"]),
    "unknown_key": (
        ["replay", "good.npz", *REPLAY, "--config", "key.toml"],
        ["key.toml", "k_nose"],
    ),
    "bad_value": (
        ["replay", "good.npz", *REPLAY, "--config", "value.toml"],
        ["value.toml", "peak.min_width = 1"],
    ),
    "rate_of_lines": (
        ["scan", "--out", "s", *IDEAL, "--config", "rate.toml"],
        ["rate.toml", "line.rate_hz = 70000", "2048 px at 100 MHz", "at most 48063 Hz"],
    ),
    "rate_of_a_board": (
        ["board", "--config", "rate.toml"],
        ["rate.toml", "line.rate_hz = 70000", "2048 px at 100 MHz", "at most 48063 Hz"],
    ),
    "rate_of_long_lines": (
        ["scan", "--out", "s", *IDEAL, "--config", "long.toml"],
        ["long.toml", "line.rate_hz = 37374.9", "4096 px at 125 MHz", "at most 30156 Hz"],
    ),
    "bad_register": (
        ["replay", "good.npz", *REPLAY, "--config", "register.toml"],
        ["register.toml", "geometry.k1"],
    ),
    "two_pass_period": (
        ["replay", "good.npz", *REPLAY, "--config", "two_pass.toml"],
        ["two_pass.toml", 'needs period = "n"'],
    ),
    "no_such_folder": (["replay", "good.npz", "--out", "no/out.csv", *IDEAL], ["no/out.csv"]),
    "out_is_folder": (["replay", "good.npz", "--out", "folder.csv", *IDEAL], ["folder.csv"]),
    "out_is_device": (["replay", "good.npz", "--out", "null.csv", *IDEAL], ["null.csv"]),
    "out_is_picture": (
        ["replay", "good.npz", "--out", "out.png", *IDEAL],
        ["out.png", ".csv or .ply"],
    ),
    "out_is_nothing_known": (["replay", "good.npz", "--out", "out", *IDEAL], [".csv or .ply"]),
    "mirror_into_its_picture": (["mirror", "--out", "mirror.png"], ["mirror.png", ".csv"]),
    "unwritable": (["replay", "good.npz", "--out", "/proc/out.csv", *IDEAL], ["/proc/out.csv"]),
    "scan_into_unwritable": (["scan", "--out", "/proc", *IDEAL], ["/proc/points.csv"]),
    "scan_into_file": (["scan", "--out", "good.npz", *IDEAL], ["good.npz"]),
    "scan_below_nothing": (["scan", "--out", "no/where", *IDEAL], ["no/where"]),
    "unknown_scene": (["scan", "moon", "--out", "scan", *IDEAL], ["moon", "default"]),
    "misspelt_scene": (["scan", "shiny-conrer", "--out", "s", *IDEAL], ["mean 'shiny-corner'?"]),
    "unknown_target": (
        ["scan", "target.toml", "--out", "s", *IDEAL],
        ["target.toml: target.0.kind = 'plan'", "sphere", "did you mean 'plane'?"],
    ),
    "unknown_map": (
        ["scan", "map.toml", "--out", "s", *IDEAL],
        ["map.toml", "map.kind = 'cheker'", "did you mean 'checker'?"],
    ),
    "unknown_lamp": (
        ["scan", "lamp.toml", "--out", "s", *IDEAL],
        ["lamp.toml: lamp.0.kind = 'halogene'", "did you mean 'halogen'?"],
    ),
    "unknown_material": (
        ["budget", "material.toml"],
        ["material.toml", "'withe'", "did you mean 'white'?"],
    ),
    "unknown_effect": (
        ["budget", "--fidelity", "specle"],
        ["--fidelity", "'specle'", "did you mean 'speckle'?"],
    ),
    "night": (
        ["scan", "night.toml", "--out", "s", *IDEAL],
        ["night.toml: sun: at latitude 1.3", "below the horizon"],
    ),
    "night_at_a_site": (
        ["detectability", "site.toml"],
        ["site.toml: sun: at latitude", "below the horizon"],
    ),
    "missing_mesh": (
        ["bench", "light", "mesh.toml", "--out", "s"],
        ["mesh.toml: ", "prt.stl: no such mesh", "did you mean 'part.stl'?"],
    ),
    "broken_mesh": (["budget", "broken.toml"], ["broken.toml: ", "part.stl"]),
    "scan_with_bad_config": (["scan", "--out", "scan", *IDEAL, "--config", "key.toml"], ["k_nose"]),
    "scan_with_bad_register": (
        ["scan", "--out", "scan", "--lines", "10", *IDEAL, "--config", "register.toml"],
        ["geometry.k1"],
    ),
    "no_lines": (["scan", "--out", "scan", *IDEAL, "--lines", "0"], ["--lines", "(0)"]),
    "lines_no_number": (["scan", "--out", "scan", *IDEAL, "--lines", "x"], ["--lines", "x"]),
    "unknown_engine": (
        ["replay", "good.npz", "--out", "out.csv", "--engine", "abacus"],
        ["abacus"],
    ),
    "no_out": (["replay", "good.npz"], ["--out"]),
    "unknown_option": (["replay", "good.npz", "--fast"], ["--fast"]),
    "unknown_command": (["play"], ["play"]),
    "bare_group": (["link"], ["link: which command?", "info, registers, read"]),
    "bare_group_in_a_group": (["link", "maps"], ["link maps: which command? load, read"]),
    "file_and_board": (["view", "--file", "a.csv", "--board"], ["--file or --board: only one"]),
    "file_and_port": (["view", "--file", "a.csv", "--port", "p"], ["--file or --port: only one"]),
    "board_and_port": (["view", "--board", "--port", "p"], ["--board or --port: only one"]),
    "misspelt_config": (
        ["replay", "good.npz", *REPLAY, "--config", "two-pass.toml"],
        ["two-pass.toml: No such file", "did you mean 'two_pass.toml'?"],
    ),
    "misspelt_lines": (["replay", "god.npz", *REPLAY], ["god.npz: ", "mean 'good.npz'?"]),
    "misspelt_scene_file": (
        ["scan", "nigt.toml", "--out", "s", *IDEAL],
        ["nigt.toml: No such file", "did you mean 'night.toml'?"],
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_bad_input(
    folder: Path,
    case: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    arguments, wanted = CASES[case]
    before = sorted(folder.rglob("*"))
    assert ended(monkeypatch, *arguments) == 2
    output = capsys.readouterr()
    assert output.out == ""
    assert output.err.startswith("vrscan: ")
    assert output.err.count("\n") == 1, output.err
    for part in wanted:
        assert part in output.err
    assert sorted(folder.rglob("*")) == before


# Commands whose result has nowhere to go, and the work that must not begin then.
NOWHERE = {
    "bench_light_below_nothing": (
        ["bench", "light", "--out", "no/where"],
        "study.report.fidelity.run",
    ),
    "bench_light_into_file": (["bench", "light", "--out", "good.npz"], "study.report.fidelity.run"),
    "bench_light_into_unwritable": (
        ["bench", "light", "--out", "/proc"],
        "study.report.fidelity.run",
    ),
    "bench_light_rewrites_nothing": (["bench", "light", "--write"], "study.report.fidelity.run"),
    "bench_report_into_unwritable": (
        ["bench", "report", "--quick", "--out", "/proc"],
        "study.bench.bench_report.run",
    ),
    "numbers_below_nothing": (
        ["numbers", "--csv", "no/numbers.csv"],
        "study.report.accuracy.cordic_accuracy.measure",
    ),
    "numbers_rewrites_nothing": (
        ["numbers", "--write"],
        "study.report.accuracy.cordic_accuracy.measure",
    ),
    "cases_rewrites_nothing": (["cases", "--write"], "study.cases.case_page.measure"),
    "stray_below_nothing": (
        ["stray", "--csv", "no/stray.csv"],
        "study.report.stray_report.stray_budget",
    ),
    "budget_below_nothing": (["budget", "--csv", "no/budget.csv"], "study.plan.plan"),
    "mirror_below_nothing": (
        ["mirror", "--out", "no/mirror.csv"],
        "study.report.mirror_report.simulate",
    ),
    "board_below_file": (["board", "--port-file", "good.npz/port"], "engines.board.build"),
    "board_into_unwritable": (["board", "--port-file", "/proc/port"], "engines.board.build"),
}


@pytest.mark.parametrize("case", NOWHERE)
def test_what_cannot_be_written_is_told_before_the_work(
    folder: Path,
    case: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    arguments, work = NOWHERE[case]

    def began(*_: object, **__: object) -> None:
        raise AssertionError(f"{work} began")

    monkeypatch.setattr(f"vrscan.{work}", began)
    if "--write" in arguments:
        for module in ("engines.tools", "study.cases.case_page"):
            monkeypatch.setattr(
                f"vrscan.{module}.repository_root", lambda: folder / "root", raising=False
            )
    before = sorted(folder.rglob("*"))
    assert ended(monkeypatch, *arguments) == 2
    error = capsys.readouterr().err
    assert error.startswith("vrscan: ") and error.count("\n") == 1, error
    assert sorted(folder.rglob("*")) == before


@pytest.mark.parametrize("scene", ["bolts", "mesh.toml"])
def test_a_scene_is_read_before_the_engine_is_prepared(
    folder: Path, scene: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def prepared(*_: object) -> None:
        raise AssertionError("the engine was prepared")

    monkeypatch.setattr("vrscan.engines.engine.prepare", prepared)
    assert ended(monkeypatch, "scan", scene, "--out", "s") == 2
    assert capsys.readouterr().err.startswith(f"vrscan: {scene}: ")
    assert not (folder / "s").exists()


def test_a_view_tells_that_its_port_is_not_there(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(
        view_commands, "interrupted", lambda *_: contextlib.nullcontext(lambda: signal.SIGINT)
    )
    told = "vrscan: port: no such port yet; it is waited for\n"
    for wanted in (told, ""):
        arguments = ["view", "--port", "port", "--out", "views", "--http-port", "0"]
        assert ended(monkeypatch, *arguments) == 0
        output = capsys.readouterr()
        assert output.err == wanted and output.out.startswith("http://")
        (folder / "port").touch()


@pytest.mark.parametrize(
    "arguments",
    [["scan", "odd.toml", "--out", "s", *IDEAL, "--lines", "100"], ["budget", "odd.toml"]],
    ids=["scan", "budget"],
)
def test_an_absurd_scene_is_questioned_and_measures_nothing(
    folder: Path,
    arguments: list[str],
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert ended(monkeypatch, *arguments) == 0
    output = capsys.readouterr()
    told = [line for line in output.err.splitlines() if line.startswith("vrscan")]
    assert told == ["vrscan: odd.toml: laser.power_mw = 0: no light of the laser"]
    (line,) = [line for line in output.out.splitlines() if "nothing was measured" in line]
    assert line.startswith("odd.toml: nothing was measured: no line has a point, because no light")
    assert "0.0000 px" not in output.out


def replayed(
    name: str, out: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> list[str]:
    """Replay a file and return the lines on the error stream, the bar's left out."""
    assert ended(monkeypatch, "replay", name, "--out", out, *IDEAL) == 0
    return [line for line in capsys.readouterr().err.splitlines() if line.startswith("vrscan")]


@pytest.mark.parametrize("name", ["good.npz", "good.npy"])
def test_a_recording_without_angles_is_told_in_one_line(
    folder: Path, name: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    lines = np.full((3, 2048), 60, np.uint16)
    np.save("good.npy", lines)
    (told,) = replayed(name, "out.csv", monkeypatch, capsys)
    assert told.startswith(f"vrscan: {name}: no angle_rad: every line is taken at angle 0")
    np.savez("angles.npz", lines=lines, angle_rad=np.zeros(3))
    assert replayed("angles.npz", "out.csv", monkeypatch, capsys) == []


def test_a_suffix_says_what_is_written(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for out, begin in (("out.csv", b"line,peak,"), ("out.ply", b"ply\nformat binary")):
        replayed("good.npz", out, monkeypatch, capsys)
        assert (folder / out).read_bytes().startswith(begin)


def start(
    *arguments: str, options: Sequence[str] = (), largest: int | None = None
) -> subprocess.Popen[str]:
    """Start a command, which may write files of so many bytes."""

    def fill() -> None:
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (largest or 0, largest or 0))

    environment = {"PYTHONPATH": str(repository_root() / "model")}
    if largest is not None:
        environment |= {"PYTHONDONTWRITEBYTECODE": "1"}  # Python would keep cut ones
    return subprocess.Popen(
        [sys.executable, *options, "-m", "vrscan", *arguments],
        env=environment,
        preexec_fn=None if largest is None else fill,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


@pytest.mark.parametrize(
    ("arguments", "largest"),
    [
        (["scan", "--lines", "200", "--keep-lines", "--out", "new"], 0),
        (["scan", "--lines", "200", "--keep-lines", "--out", "new"], 60_000),
        (["replay", "long.npz", "--out", "new.csv"], 5_000),
        (["replay", "long.npz", "--out", "new.ply"], 300),
    ],
)
def test_a_full_disk_leaves_no_file(folder: Path, arguments: list[str], largest: int) -> None:
    lines = np.full((100, 2048), 60, np.uint16)
    lines[:, 1000:1010] = 2000
    np.savez_compressed(folder / "long.npz", lines=lines, angle_rad=np.zeros(100))
    before = sorted(folder.rglob("*"))
    process = start(*arguments, *IDEAL, "--jobs", "1", largest=largest)
    _, err = process.communicate(timeout=100)
    assert process.returncode == 2, err
    # The disk is the same for all files of a folder, so any of them may be the one that is named.
    assert re.fullmatch(r"vrscan: new\S*: cannot write \(File too large\)", err.splitlines()[-1]), (
        err
    )
    assert sorted(folder.rglob("*")) == before


def test_the_process_says_one_line_and_ends_with_two(folder: Path) -> None:
    process = start("replay", "none.npy", *REPLAY)
    out, err = process.communicate(timeout=60)
    assert process.returncode == 2
    assert out == ""
    assert err == "vrscan: none.npy: No such file or directory\n"


# What Python says it has imported when the interrupt comes, from the start into the command.
MOMENTS = (
    "csv",
    "numpy",
    "pydantic",
    "vrscan.engines.engine",
    "vrscan.cli.app",
    "matplotlib",
    "vrscan.scene.simulate",
)


@pytest.mark.parametrize("moment", MOMENTS)
def test_an_interrupt_while_it_starts_is_one_line(folder: Path, moment: str) -> None:
    arguments = ["scan", "--out", "scan", "--lines", "200000", *IDEAL]
    with start(*arguments, options=["-X", "importtime"]) as process:
        assert process.stderr is not None
        imported = re.compile(rf"\|\s+({moment})$")
        assert any(imported.search(line.rstrip()) for line in process.stderr), "not imported"
        process.send_signal(signal.SIGINT)
        rest = [x for x in process.stderr if not x.startswith("import time:")]
    assert process.returncode == 130, rest
    assert "".join(rest).strip() == "vrscan: interrupted"
    assert not (folder / "scan").exists()


def test_the_version_is_the_packages(folder: Path) -> None:
    described = tomllib.loads((repository_root() / "pyproject.toml").read_text())
    with start("--version") as process:
        out, err = process.communicate(timeout=60)
    assert (process.returncode, err) == (0, "")
    assert out == f"vrscan {described['project']['version']}\n"


@pytest.mark.parametrize(("signum", "status"), [(signal.SIGTERM, 143), (signal.SIGINT, 130)])
def test_an_interrupted_scan_leaves_nothing(
    folder: Path, signum: signal.Signals, status: int
) -> None:
    process = start("scan", "--out", "scan", "--lines", "200000", *IDEAL)
    deadline = time.monotonic() + 60
    while not list(folder.glob("scan/.points.csv.*")) and time.monotonic() < deadline:
        time.sleep(0.02)
    process.send_signal(signum)
    _, err = process.communicate(timeout=60)
    assert process.returncode == status, err
    assert "Traceback" not in err
    assert err.count("vrscan: ") == (signum == signal.SIGINT)
    assert not (folder / "scan").exists()


@pytest.mark.parametrize("kept", [False, True], ids=["alone", "with_a_file_of_others"])
def test_a_signal_before_the_guard_stands(folder: Path, *, kept: bool) -> None:
    left = folder / "scan" / f".points.csv.{16 * 'a'}"
    with contextlib.suppress(SystemExit), cli._folder(folder / "scan"):
        left.touch()
        if kept:
            (folder / "scan" / "notes.txt").touch()
        sys.exit(143)
    assert (folder / "scan").exists() == kept and not left.exists()
