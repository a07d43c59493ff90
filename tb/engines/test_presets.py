"""Every shipped scanner, end to end: its light, the RTL as its twin, and points that are true."""

import re
from pathlib import Path

import numpy as np
import pytest
from scanners import SCANNERS
from typer.testing import CliRunner

from vrscan.cli.app import app
from vrscan.data.config import load
from vrscan.data.points import csv_rows
from vrscan.engines.board import Board
from vrscan.engines.engine import Engine, run
from vrscan.link import selftest
from vrscan.link.device import Device
from vrscan.scene.simulate import take
from vrscan.study import layout

LINES = 160
BOARDS_MM = {"metre": (450.0, 700.0, 1100.0), "polygon": (280.0, 420.0, 800.0)}
PRESETS = [name for name in SCANNERS if name != "default"]
RUNS = ("moving peak", "saturated", "across the edges", "much noise")
CLOCK_HZ, RATE_HZ = 25e6, 6_000.0  # of the virtual board: a quarter of the preset's clocks a line


def scanned(tmp_path: Path, name: str, z_mm: float, *more: str) -> str:
    file = tmp_path / "board.toml"
    file.write_text(layout.scene(load(Path(name)), z_mm))
    words = ["--config", name, "--engine", "fixed", "--jobs", "1", "--out", str(tmp_path / "out")]
    result = CliRunner().invoke(app, ["scan", str(file), *words, *more])
    assert result.exit_code == 0, result.output
    return result.stdout


@pytest.mark.parametrize("name", PRESETS)
def test_a_preset_measures_a_plane_as_its_twin_and_as_it_is(name: str) -> None:
    config = load(Path(name))
    lines = take("plane", LINES, config, "minimal").lines
    assert lines.lines.shape == (LINES, config.sensor.line_length)
    assert lines.lines.max() < 2**config.sensor.pixel_width
    rtl, twin, ideal = (run(engine, lines, config) for engine in Engine)
    assert csv_rows(rtl) == csv_rows(twin)
    truth = lines.truth
    assert truth is not None
    for points in (twin, ideal):
        visible = np.isfinite(truth.position_px)  # the camera sees a part of the scan
        seen = points.located & visible
        assert visible.sum() > LINES / 3 and seen.sum() > 0.9 * visible.sum()
        error = points.z_mm[seen] - truth.z_mm[seen]
        assert np.median(np.abs(error)) < 3.0 * np.median(points.sigma_z_mm[seen])
        assert np.abs(error).max() < 0.01 * truth.z_mm[seen].max()


@pytest.mark.parametrize(("name", "z_mm"), [(name, z) for name in PRESETS for z in BOARDS_MM[name]])
def test_a_preset_measures_a_board_in_its_range(name: str, z_mm: float, tmp_path: Path) -> None:
    said = scanned(tmp_path, name, z_mm, "--lines", "2000", "--fidelity", "full")
    row = re.search(r"all +(\d+) +(\d+) +([\d.]+) % +0 +[-\d.]+ +[\d.]+ +[\d.]+ +([\d.]+) ", said)
    ratio = re.search(r"error/sigma ([\d.]+), 2 sigma holds ([\d.]+) %", said)
    assert row and ratio, said
    print(f"{name} at {z_mm:g} mm: rms {row[4]} %, error/sigma {ratio[1]}")
    assert int(row[1]) > 200 and float(row[3]) > 94.0  # at the metre's best focus a spot is 2 px
    assert float(row[4]) < 0.1 and 0.7 < float(ratio[1]) < 1.4 and float(ratio[2]) > 85.0


@pytest.mark.parametrize("name", PRESETS)
def test_a_presets_loops_follow_a_board(name: str, tmp_path: Path) -> None:
    far = BOARDS_MM[name][-1]
    said = scanned(
        tmp_path, name, far, "--lines", "3000", "--power", "adaptive", "--focus", "automatic"
    )
    row = re.search(r"all +(\d+) +(\d+) +([\d.]+) % +0 +[-\d.]+ +[\d.]+ +[\d.]+ +([\d.]+) ", said)
    assert row and float(row[3]) > 90.0 and float(row[4]) < 0.2, said


@pytest.mark.timeout(1800)
def test_the_virtual_board_of_a_preset_passes_its_self_test(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With the metre's sensor; a clock and a line rate of a quarter keep it short."""
    monkeypatch.setattr(selftest, "LINES", 10)
    metre = load(Path("metre"))
    own = {
        "clock": metre.clock.model_copy(update={"frequency_hz": CLOCK_HZ}),
        "line": metre.line.model_copy(update={"rate_hz": RATE_HZ}),
    }
    config = metre.model_copy(update=own)
    port = tmp_path / "port"
    with Board("plane", config, port=port) as _, Device(str(port), timeout=60.0) as host:
        build = host.build
        assert (build.line_length, build.pixel_width) == (1024, 10)
        host.load(config)
        test = selftest.SelfTest(host)
        with selftest.arranged(host):
            settings = selftest.runs(build.line_length)
            found = [test.run(name, settings[name], True, 0, 1000) for name in RUNS]
    assert [each.difference for each in found] == [None] * len(RUNS)
    assert all(each.lines == 10 for each in found)
