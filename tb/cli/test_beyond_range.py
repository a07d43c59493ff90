"""A wall beyond the range behind a nearer one: it is measured, and nowhere is there a point of it.

The truth is the scene's, from ray casting: the spots of the far wall lie at z = 2300 mm, beyond the
2048 mm that a coordinate can be, and farther by its unit of length where a scanner has a larger.
"""

import csv
from pathlib import Path

import numpy as np
import pytest
import trimesh
from run_command import ended
from scanners import EACH_SCANNER, words

from vrscan.data import recordings, records
from vrscan.data.config import Config
from vrscan.fixed.point_record import point_record
from vrscan.fixed.vrscan_chain import run_fixed
from vrscan.registers.chain_registers import Registers, angle_turns

LINES = 300
pytestmark = EACH_SCANNER
SCENE = """
title = "a wall beyond the range"
[laser]
power_mw = 40
[lens]
focus_mm = {focus}
f_number = {f_number}
[material.wall]
reflectance = 0.9
[[target]]
kind = "plane"
name = "far"
position_mm = [0, 0, {far}]
material = "wall"
[[target]]
kind = "box"
name = "near"
position_mm = [{left}, 0, {near}]
size_mm = [{width}, 200, 20]
material = "wall"
"""


PLACES = {"focus": 1800, "far": 2300, "left": -150, "near": 1500, "width": 300}


@pytest.fixture
def scene(tmp_path: Path, config: Config) -> Path:
    path, unit_mm = tmp_path / "beyond.toml", config.geometry.unit_mm
    given = {name: unit_mm * place for name, place in PLACES.items()}
    # A lens as much wider gets as much light from there.
    path.write_text(SCENE.format(**given, f_number=config.free.f_number / unit_mm))
    return path


def scanned(scene: Path, engine: str, config: Config, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return the folder of a scan."""
    out = scene.with_name(engine)
    arguments = [str(scene), "--engine", engine, "--lines", str(LINES), "--keep-lines"]
    arguments += ["--fidelity", "defocus", "--jobs", "1", "--out", str(out), *words(config)]
    assert ended(monkeypatch, "scan", *arguments) == 0
    return out


@pytest.mark.parametrize("engine", ["rtl", "fixed", "ideal"])
def test_a_wall_beyond_the_range_is_in_no_file(
    scene: Path,
    engine: str,
    config: Config,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    out = scanned(scene, engine, config, monkeypatch)
    with (out / "points.csv").open() as file:
        rows = list(csv.DictReader(file))
    truth = recordings.read(out / "lines.mcap").lines.truth
    assert truth is not None
    surface, truth_mm = truth.surface, truth.z_mm
    seen = np.isfinite(truth.position_px)
    far, near = (truth.names.index(name) for name in ("far", "near"))
    beyond = seen & (surface == far)
    assert beyond.sum() > LINES // 10 and truth_mm[beyond].min() > config.geometry.range_mm
    measured = 0
    for k in np.flatnonzero(beyond):
        assert rows[k]["x_mm"] == rows[k]["z_mm"] == rows[k]["sigma_z_mm"] == ""
        assert float(rows[k]["c_obj"]) == 0.0
        measured += rows[k]["position_px"] != ""
        assert "OUT_OF_RANGE" in rows[k]["flags"].split("|") or not rows[k]["position_px"]
    assert measured > 0.9 * beyond.sum()
    found = [float(row["z_mm"]) for row in rows if row["z_mm"]]
    hit = int((seen & (surface == near)).sum())
    assert hit > LINES // 10 and abs(len(found) - hit) <= 3
    z = trimesh.load(out / "points.ply").vertices[:, 2]
    assert len(z) == len(found)
    unit_mm = config.geometry.unit_mm
    assert np.all(np.abs(z - 1500.0 * unit_mm) < 20.0 * unit_mm)
    cells = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert [str(beyond.sum()), "0"] in [row[1:3] for row in cells if row[:1] == ["far"]]


def test_a_wall_beyond_the_range_is_no_point_on_the_link(
    scene: Path, config: Config, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The bytes of compact records and of those of space: not measured, and nowhere a place."""
    out = scanned(scene, "ideal", config, monkeypatch)
    lines = recordings.read(out / "lines.mcap").lines
    given = lines.lines, angle_turns(lines.angle_rad), lines.power.astype(np.int64)
    truth = lines.truth
    assert truth is not None
    beyond = np.isfinite(truth.position_px) & (truth.z_mm > config.geometry.range_mm)
    registers = Registers.from_config(config)
    points = run_fixed(*given, registers=registers)
    none = np.zeros(LINES, np.int64)
    full = point_record(points, none, none, none.astype(bool), none.astype(bool), none)
    beyond &= points.measured
    assert beyond.sum() > LINES // 10
    for data, size in (
        (records.encode_compact(records.compact(full)), 8),
        (records.encode_space(records.space(full)), 9),
    ):
        some = np.frombuffer(data, np.uint8).reshape(LINES, size)[beyond]
        assert not (some[:, 7] & 1).any()
        assert (some[:, 7] >> 5 & 1).all()
        assert not some[:, 2:7].any()  # x and z, or the free interval, and the confidence
        if size == 8:
            assert not some[:, :2].any()
    some = np.frombuffer(records.encode_full(full), np.uint8).reshape(LINES, 64)[beyond]
    assert (some[:, 4:6].copy().view("<u2") >> 10 & 1).all()
    assert not some[:, 40:48].any() and not some[:, 52].any()
    assert np.all(some[:, 48:50] == 0xFF)
