"""``vrscan calibrate`` on recordings: a scan is the same whatever it was recorded in."""

from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest
from run_command import ended

from vrscan.calibrate import recording, verify
from vrscan.data import edges, recordings
from vrscan.data.config import Config, load
from vrscan.data.points import read_csv

SETUP = ["--kind", "plane", "--z-mm", "400", "--focus-mm", "400"]
SCENE = """
[[target]]
kind = "plane"
position_mm = [0.0, 0.0, 400.0]
[lens]
focus_mm = 400.0
[laser]
power_mw = 7.0
"""


@pytest.fixture(scope="module")
def scanned(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a scan of a plane, and with recordings of its points and edges."""
    folder = tmp_path_factory.mktemp("calibrate")
    (folder / "plane.toml").write_text(SCENE)
    words = ["scan", str(folder / "plane.toml"), "--out", str(folder / "plane"), "--jobs", "1"]
    with pytest.MonkeyPatch.context() as patch:
        how = ["--engine", "ideal", "--lines", "1501", "--fidelity", "minimal"]
        assert ended(patch, *words, *how) == 0
    points = read_csv(folder / "plane" / "points.csv")
    with recordings.Writer(folder / "both.mcap", Config()) as into:
        into.points(points)
        into.edges(*edges.read(folder / "plane" / "edges.csv"))
    with recordings.Writer(folder / "points.mcap", Config(), flush_s=0.0) as into:
        into.points(points)
    return folder


@pytest.fixture
def folder(scanned: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(scanned)
    return scanned


def test_a_scan_of_files_and_of_recordings_is_the_same(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    sources = {
        "folder.mcap": ["plane"],
        "other.mcap": ["points.mcap", "--edges", "plane/edges.csv"],
        "clock.mcap": ["both.mcap"],  # the scan's own times, which points.csv rounds to 1 ns
    }
    found = {}
    for name, words in sources.items():
        assert ended(monkeypatch, "calibrate", "record", *words, *SETUP, "--out", name) == 0
        found[name] = recording.read(Path(name))
    told = capsys.readouterr().out
    first = found["folder.mcap"]
    assert f"folder.mcap: {len(first)} points, {len(first.out_s)} pairs of crossings" in told
    assert len(first) > 400 and len(first.out_s) >= 9
    for name, each in found.items():
        assert each.setup == first.setup
        for kind in fields(recording.Recording)[2:]:
            got, want = getattr(each, kind.name), getattr(first, kind.name)
            assert np.allclose(got, want, rtol=0.0, atol=1e-9), (name, kind.name)
    with Path("folder.npz").open("wb") as file:
        recording.write(first, file)
    rows = []
    for name in ("folder.mcap", "folder.npz"):
        assert ended(monkeypatch, "calibrate", "verify", name) == 0
        rows.append([line for line in capsys.readouterr().out.splitlines() if "400" in line])
    assert rows[0] and rows[0] == rows[1]


def test_what_is_no_scan_is_one_line(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    record = ["record", "points.mcap", *SETUP, "--out"]
    Path("cut.mcap").write_bytes(Path("points.mcap").read_bytes()[:-3000])
    assert ended(monkeypatch, "calibrate", "record", "plane", *SETUP, "--out", "one.mcap") == 0
    capsys.readouterr()
    for words, told in (
        ([*record, "a.mcap"], "points.mcap: no edges"),
        ([*record, "a.npz"], "a.npz: must end in .mcap"),
        (["verify", "points.mcap"], "points.mcap: no calibration scan"),
        (["mirror", "one.mcap", "--out", "a.toml"], "one"),
        (["verify", "one.mcap", "--config", "polygon"], "one.mcap: a scan of a resonant mirror"),
        (["mirror", "motion.csv", "--config", "polygon"], "takes scans of a plane"),
        (["run-all", "--out", "a.run", "--config", "polygon"], "the steps themselves work"),
    ):
        assert ended(monkeypatch, "calibrate", *words) == 2
        output = capsys.readouterr()
        assert output.err.startswith("vrscan: ") and output.err.count("\n") == 1, output.err
        assert told in output.err
        assert not list(folder.glob("a.*")), words
    words = ["cut.mcap", "--edges", "plane/edges.csv", *SETUP, "--out", "cut-scan.mcap"]
    assert ended(monkeypatch, "calibrate", "record", *words) == 0
    assert "vrscan: cut.mcap: cut off before its end" in capsys.readouterr().err


def test_a_scan_with_a_polygon_is_recorded_with_its_facets(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Of an instrument that is as believed ``verify`` shows no error beyond speckle."""
    own = ["--config", "polygon"]
    words = ["plane.toml", "--out", "turned", "--jobs", "1", "--engine", "ideal", "--lines", "500"]
    assert ended(monkeypatch, "scan", *words, "--fidelity", "minimal", *own) == 0
    record = ["turned", *SETUP, "--out", "turned.mcap"]
    assert ended(monkeypatch, "calibrate", "record", *record, *own) == 0
    made = recording.read(Path("turned.mcap"))
    assert made.setup.facets == 12 and len(made) > 200
    settings = load(Path("polygon"))
    assert abs(verify.verified(made, settings, None).mean_mm) < 0.05
    mark = np.radians(settings.mirror.index_deg)
    told = recording.angles(made, mark, settings.mirror.harmonics)
    inside = (made.time_s > made.in_s[0]) & (made.time_s < made.out_s[-1])
    assert np.abs(told - made.angle_rad)[inside].max() < 1e-5
    capsys.readouterr()
    assert ended(monkeypatch, "calibrate", "verify", "turned.mcap", *own) == 0
    assert "400" in capsys.readouterr().out
    assert ended(monkeypatch, "calibrate", "verify", "turned.mcap") == 2
    assert "a scan of a polygon of 12 facets" in capsys.readouterr().err
