"""The commands that end well: their files and what they print."""

import csv
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from harness import in_volume
from run_command import ended
from scanners import EACH_SCANNER, SCANNERS, words

from vrscan.cli.app import _folder
from vrscan.data import edges, recordings
from vrscan.data.arrays import Pixels
from vrscan.data.config import Config, to_toml
from vrscan.data.points import COLUMNS
from vrscan.engines.loops import Controls
from vrscan.engines.tools import repository_root
from vrscan.scene import simulate
from vrscan.scene.description import shipped
from vrscan.scene.simulate import Around, take
from vrscan.study import scan as scans
from vrscan.study import scan_store

# Meshes, mirrors, glass, the sun, a panning scanner: every kind of light.
FEW = ("default", "bolt", "bust", "glossy", "sunlit", "window-ghost")
DEFAULT = SCANNERS["default"]
OTHERS = [(name, config) for name, config in SCANNERS.items() if config is not DEFAULT]
# Every scene by the default scanner, and one scene by the others.
SCENES = pytest.mark.parametrize(
    ("scene", "config"),
    [
        *((pytest.param if scene in FEW else in_volume)(scene, DEFAULT) for scene in shipped()),
        *(pytest.param("default", config, id=name) for name, config in OTHERS),
    ],
)


@SCENES
def test_a_scan_writes_its_files_and_its_table(
    tmp_path: Path,
    scene: str,
    config: Config,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    out = tmp_path / "scan"
    arguments = ["scan", scene, "--out", str(out), "--engine", "ideal", "--lines", "300"]
    arguments += ["--fidelity", "full", *words(config)]
    assert ended(monkeypatch, *arguments) == 0
    names = ["edges.csv", "picture.png", "points.csv", "points.ply", "reliability.png", "space.png"]
    assert sorted(p.name for p in out.iterdir()) == names
    assert (out / "picture.png").read_bytes().startswith(b"\x89PNG")
    with (out / "points.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 300
    assert ",".join(rows[0]) == COLUMNS
    located = sum(row["z_mm"] != "" for row in rows)
    assert f"element vertex {located}\n".encode() in (out / "points.ply").read_bytes()
    output = capsys.readouterr()
    assert f"300 lines, {located} points" in output.out
    assert "error/sigma" in output.out
    # A second scan into the same folder replaces the files, and removes what a killed one has left.
    left = out / f".points.csv.{'0' * 16}"
    left.touch()
    assert ended(monkeypatch, *arguments) == 0
    assert not left.exists()
    # Two at the same time are refused.
    capsys.readouterr()
    before = (out / "points.csv").read_bytes()
    with _folder(out):
        assert ended(monkeypatch, *arguments) == 2
    assert f"{out}: another command writes there" in capsys.readouterr().err
    assert (out / "points.csv").read_bytes() == before


@pytest.mark.soak
@pytest.mark.parametrize("scene", shipped())
def test_a_scene_in_full_has_the_same_points_whoever_computes_them(
    tmp_path: Path, scene: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A block and a bit: RTL in one process, its model in two, with a fit and with one window."""
    plain = tmp_path / "threshold.toml"
    plain.write_text('[peak]\nwindow = "threshold"\n')
    for mode in ([], ["--config", str(plain)]):
        points = []
        for engine, jobs in (("rtl", "1"), ("fixed", "2")):
            out = tmp_path / f"{engine}{len(mode)}"
            how = ["--engine", engine, "--jobs", jobs, "--lines", "1100", "--fidelity", "full"]
            assert ended(monkeypatch, "scan", scene, "--out", str(out), *how, *mode) == 0
            points.append((out / "points.csv").read_bytes())
        assert points[0] == points[1]
        assert points[0].count(b"\n") == 1101


@EACH_SCANNER
def test_replay_of_a_scan_gives_its_points(
    config: Config,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """The recording brings its configuration; every format of export is written at once."""
    scan, points = tmp_path / "scan", tmp_path / "points.csv"
    arguments = ["--out", str(scan), "--engine", "ideal", "--lines", "200", "--keep-lines"]
    arguments += words(config)
    assert ended(monkeypatch, "scan", "--fidelity", "minimal", *arguments) == 0
    lines = scan / "lines.mcap"
    assert recordings.read(lines).config.model_dump() == config.model_dump()
    ended(monkeypatch, "replay", str(lines), "--out", str(points), "--engine", "ideal")
    assert points.read_bytes() == (scan / "points.csv").read_bytes()
    found = sum(row["z_mm"] != "" for row in csv.DictReader(points.open()))
    assert f"{points}: {found} points of 200 lines" in capsys.readouterr().out
    clouds = [str(tmp_path / name) for name in ("replayed.xyz", "exported.xyz")]
    assert ended(monkeypatch, "replay", str(lines), "--out", clouds[0], "--engine", "ideal") == 0
    assert ended(monkeypatch, "export", str(points), clouds[1]) == 0
    assert Path(clouds[0]).read_bytes() == Path(clouds[1]).read_bytes()
    truth = recordings.read(lines).lines.truth
    assert truth is not None
    seen = np.isfinite(truth.position_px)
    assert seen.any()
    assert set(truth.surface[seen]) <= set(range(len(truth.names)))


@pytest.mark.parametrize(
    ("engine", "lines", "config"),
    [
        ("ideal", "2100", DEFAULT),
        ("rtl", "1100", DEFAULT),
        in_volume("rtl", "2100", DEFAULT),
        *(pytest.param("ideal", "1100", config, id=name) for name, config in OTHERS),
        *(in_volume("rtl", "1100", config) for _, config in OTHERS),
    ],
)
def test_files_do_not_depend_on_the_number_of_processes(
    engine: str, lines: str, config: Config, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A scan of a block or two and a bit, and a replay of its lines: the same bytes."""
    monkeypatch.chdir(tmp_path)
    arguments = ["--engine", engine, "--lines", lines, "--fidelity", "minimal", "--keep-lines"]
    arguments += words(config)
    for jobs in ("1", "2"):
        assert ended(monkeypatch, "scan", "--out", jobs, "--jobs", jobs, *arguments) == 0
    for name in ("points.csv", "points.ply", "edges.csv", "picture.png", "reliability.png",
                 "space.png", "lines.mcap"):  # fmt: skip
        assert (tmp_path / "1" / name).read_bytes() == (tmp_path / "2" / name).read_bytes(), name
    arguments = ["2/lines.mcap", "--engine", engine, "--jobs", "2", "--out", "points.csv"]
    assert ended(monkeypatch, "replay", *arguments) == 0
    assert (tmp_path / "points.csv").read_bytes() == (tmp_path / "1" / "points.csv").read_bytes()


@pytest.mark.parametrize(("signum", "status"), [(signal.SIGTERM, 143), (signal.SIGINT, 130)])
def test_an_interrupt_of_all_processes_leaves_no_file_and_no_process(
    tmp_path: Path, signum: signal.Signals, status: int
) -> None:
    """The signal goes to the whole group, as Ctrl-C does, when blocks are on their way."""
    arguments = ["--lines", "30000", "--engine", "ideal", "--jobs", "2", "--fidelity", "minimal"]
    process = subprocess.Popen(
        [sys.executable, "-m", "vrscan", "scan", "--out", "scan", *arguments],
        env=os.environ | {"PYTHONPATH": str(repository_root() / "model")},
        cwd=tmp_path,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )

    def written() -> int:
        return sum(path.stat().st_size for path in tmp_path.glob("scan/.points.csv.*"))

    deadline = time.monotonic() + 120
    while written() < 100_000 and time.monotonic() < deadline:
        assert process.poll() is None, process.communicate()[1]
        time.sleep(0.02)
    os.killpg(process.pid, signum)
    _, err = process.communicate(timeout=60)
    assert process.returncode == status, err
    assert "Traceback" not in err
    assert not (tmp_path / "scan").exists()
    deadline = time.monotonic() + 10
    while _group_lives(process.pid) and time.monotonic() < deadline:
        time.sleep(0.02)
    assert not _group_lives(process.pid)


def _group_lives(group: int) -> bool:
    try:
        os.killpg(group, 0)
    except ProcessLookupError:
        return False
    return True


@EACH_SCANNER
def test_a_scans_edges_are_a_mirrors_recording(
    config: Config,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    scan, mirror, own = tmp_path / "scan", tmp_path / "mirror.csv", words(config)
    arguments = ["--out", str(scan), "--engine", "ideal", "--lines", "1500", *own]
    assert ended(monkeypatch, "scan", "--fidelity", "minimal", *arguments) == 0
    table, recording = scan / "edges.csv", tmp_path / "edges.mcap"
    with recordings.Writer(recording, config) as into:
        into.edges(*edges.read(table))
    made = []
    for path in (table, recording):
        given = ["--replay", str(path), "--out", str(mirror), *own]
        assert ended(monkeypatch, "mirror", *given) == 0
        made.append(mirror.read_bytes())
    assert made[0] == made[1] and made[0].count(b"\n") > 1000
    recording.write_bytes(recording.read_bytes()[:-20])
    assert ended(monkeypatch, "mirror", *given) == 0
    told = [line for line in capsys.readouterr().err.splitlines() if "cut off" in line]
    assert told == [f"vrscan: {recording}: cut off before its end; the rest is read"]


@SCENES
def test_a_budget_tells_what_each_effect_does(
    tmp_path: Path,
    scene: str,
    config: Config,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    table, link = tmp_path / "budget.csv", tmp_path / "link.csv"
    files = ["--csv", str(table), "--link-csv", str(link), *words(config)]
    assert ended(monkeypatch, "budget", scene, "--lines", "512", *files) == 0
    printed = capsys.readouterr().out
    assert "bound with speckle" in printed
    with link.open() as file:
        for row in csv.DictReader(file):
            assert float(row["bound_px"]) < float(row["speckled_px"])
            assert float(row["least_reflectance"]) > 0.0
    assert "speckle" in printed
    assert "Laser safety" in printed
    with table.open() as file:
        rows = {row["effect"]: row for row in csv.DictReader(file)}
    assert float(rows["speckle"]["near_rms_px"]) > 0.01


def test_the_effects_of_a_scan_can_be_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["scan", "--out", str(tmp_path / "scan"), "--engine", "ideal", "--lines", "100"]
    assert ended(monkeypatch, *arguments, "--fidelity", "defocus, shot") == 0
    assert "2 of" in capsys.readouterr().out


def _bright_lines(count: int, config: Config) -> Pixels:
    """Return lines that have a point."""
    recording = take("plane", 10 * count, config, "minimal").lines
    truth, length = recording.truth, config.sensor.line_length
    assert truth is not None
    middle = np.abs(truth.position_px / length - 0.5) < 0.4
    return recording.lines[middle][:count]


@EACH_SCANNER
@pytest.mark.parametrize("engine", ["ideal", "fixed"])
def test_the_mirrors_flags_reach_the_points(
    engine: str, config: Config, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Recorded flags stand in the points, whose positions they leave alone."""
    good, bad = tmp_path / "good.npz", tmp_path / "bad.npz"
    lines = _bright_lines(4, config)
    np.savez(good, lines=lines)
    np.savez(bad, lines=lines, mirror_flags=np.array([0, 1, 2, 4], np.uint8))
    rows = {}
    for path in (good, bad):
        points = path.with_suffix(".csv")
        arguments = [str(path), "--out", str(points), "--engine", engine, *words(config)]
        assert ended(monkeypatch, "replay", *arguments) == 0
        with points.open() as file:
            rows[path] = list(csv.DictReader(file))
    names = ["", "NOT_RUNNING", "INDEX_FAULT", "UNSETTLED"]
    for before, after, name in zip(rows[good], rows[bad], names, strict=True):
        assert [n for n in after["flags"].split("|") if n not in before["flags"].split("|")] == (
            [name] if name else []
        )
        assert before["position_px"] != ""
        assert after | {"flags": ""} == before | {"flags": ""}


def test_the_configuration_reaches_the_points(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    lines, config = tmp_path / "lines.npz", tmp_path / "config.toml"
    np.savez(lines, lines=_bright_lines(20, DEFAULT))

    def widths(peak: str) -> list[int]:
        config.write_text(f'[peak]\nwindow = "threshold"\n{peak}\n')
        out = tmp_path / "points.csv"
        arguments = ["replay", str(lines), "--engine", "ideal", "--config", str(config)]
        ended(monkeypatch, *arguments, "--out", str(out))
        with out.open() as file:
            rows = csv.DictReader(file)
            return [int(row["right"]) - int(row["left"]) for row in rows if row["left"]]

    assert max(widths("k_height = 0.5")) < min(widths(""))


@EACH_SCANNER
def test_speed_is_of_one_core_and_of_more(
    config: Config, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["speed", "--engine", "ideal", "--lines", "300", *words(config)]
    line = 2 * config.sensor.line_length  # bytes
    for jobs, headings in (("1", ["one core"]), ("2", ["one core", "2 cores"])):
        assert ended(monkeypatch, *arguments, "--jobs", jobs) == 0
        printed = capsys.readouterr().out
        row = next(line for line in printed.splitlines() if line.startswith("ideal "))
        rates = [float(word) for word in row.split()[1:]]
        assert len(rates) == (1 if jobs == "1" else 3)
        assert min(rates) > 0.0
        assert all(f"{heading}, lines/s" in printed for heading in headings)
        rows = [line.split() for line in printed.splitlines() if "on the disk" not in line]
        (loose,) = (float(words[-1]) for words in rows if words[:3] == ["as", "they", "are"])
        (packed,) = (float(words[-1]) for words in rows if words[:1] == ["packed"])
        assert 0.2 * loose < packed < 0.6 * loose and line < loose < line + 204


@pytest.mark.parametrize("name", ["scan", "replay", "efficiency", "speed"])
def test_every_command_explains_itself(
    name: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert ended(monkeypatch, name, "--help") == 0
    assert "--engine" in capsys.readouterr().out


FOLLOWS = ["--power", "adaptive", "--focus", "automatic"]


@pytest.mark.parametrize(
    ("follows", "config"),
    [
        ([], DEFAULT),
        (FOLLOWS, DEFAULT),
        *(pytest.param([], config, id=name) for name, config in OTHERS),
        *(in_volume(FOLLOWS, config) for _, config in OTHERS),
    ],
)
def test_a_long_scan_goes_on_where_it_was_cut_off(
    tmp_path: Path, follows: list[str], config: Config, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Cut off behind a piece, and given again: the files of a scan that nobody cut."""
    monkeypatch.setattr(scan_store, "LEAST_LINES", 1)
    monkeypatch.setattr(scan_store, "PIECE", 1)
    monkeypatch.setattr(scans, "PIECE", 1)
    monkeypatch.setattr(simulate, "TOGETHER", 1)
    arguments = ["scan", "--engine", "fixed", "--lines", "3100", "--fidelity", "minimal"]
    arguments += ["--jobs", "1", "--keep-lines", *follows, *words(config)]
    whole, cut = tmp_path / "whole", tmp_path / "cut"
    assert ended(monkeypatch, *arguments, "--out", str(whole)) == 0
    assert not (whole / "parts").exists()
    made: list[int] = []
    work = scans._Work._part

    def interrupted(self: scans._Work, given: Around, controls: Controls | None) -> scans.Part:
        made.append(given.number)
        if len(made) == 3:
            raise KeyboardInterrupt
        return work(self, given, controls)

    monkeypatch.setattr(scans._Work, "_part", interrupted)
    assert ended(monkeypatch, *arguments, "--out", str(cut)) == 130
    assert [path.name for path in cut.iterdir()] == ["parts"]
    assert ended(monkeypatch, *arguments, "--out", str(cut)) == 0
    assert made == [0, 1, 2, 2, 3]
    for path in whole.iterdir():
        assert path.read_bytes() == (cut / path.name).read_bytes(), path.name
    # Parts of another scan do not count.
    (cut / "parts").mkdir()
    (cut / "parts" / "scan.json").write_text("{}")
    (cut / "parts" / "piece-000000.pickle").write_bytes(b"no")
    assert ended(monkeypatch, *arguments, "--out", str(cut)) == 0
    assert made[5:] == [0, 1, 2, 3]
    assert not (cut / "parts").exists()


@EACH_SCANNER
def test_a_replay_knows_where_the_lens_was(
    config: Config, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The lines of a scan with a lens that moves, and their positions of it: the same points.

    The recording brings its configuration.
    """
    own, scan, points = tmp_path / "own.toml", tmp_path / "scan", tmp_path / "points.csv"
    quick = {"average_points": 64, "hold_points": 32}
    focus = config.focus.model_copy(update=quick)
    maps = config.map.model_copy(update={"thin_lens": True})
    own.write_text(to_toml(config.model_copy(update={"focus": focus, "map": maps})))
    arguments = ["scan", "plane", "--out", str(scan), "--lines", "1000", "--keep-lines"]
    arguments += ["--fidelity", "minimal", "--focus", "automatic", "--jobs", "1"]
    assert ended(monkeypatch, *arguments, "--engine", "fixed", "--config", str(own)) == 0
    lines = scan / "lines.mcap"
    ended(monkeypatch, "replay", str(lines), "--out", str(points), "--engine", "fixed")
    assert points.read_bytes() == (scan / "points.csv").read_bytes()
    lens = recordings.read(lines).lines.lens
    assert lens is not None and len(set(lens.tolist())) > 1


@EACH_SCANNER
def test_power_and_lens_of_a_scan_that_follows_are_written(
    config: Config, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """loops.csv has a row for each line, whatever the engine and the number of processes."""
    found, count = [], 2100 if config is DEFAULT else 600
    runs = [("ideal", "1"), ("fixed", "1")] + [("ideal", "2")] * (config is DEFAULT)
    for engine, jobs in runs:
        out = tmp_path / f"{engine}{jobs}"
        arguments = ["scan", "--engine", engine, "--lines", str(count), "--fidelity", "minimal"]
        arguments += ["--jobs", jobs, "--power", "adaptive", "--out", str(out), *words(config)]
        assert ended(monkeypatch, *arguments) == 0
        found.append((out / "loops.csv").read_bytes())
    assert len(set(found)) == 1
    rows = list(csv.DictReader(found[0].decode().splitlines()))
    assert [int(row["line"]) for row in rows] == list(range(count))
    assert len({row["power"] for row in rows}) > 100
    assert float(rows[0]["light_mw"]) == pytest.approx(5.0, abs=1e-3)
