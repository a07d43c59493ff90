"""``vrscan export`` and ``vrscan filter``: files that they write, and what they say instead."""

import csv
import shutil
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from run_command import ended
from scanners import SCANNERS, words

from vrscan.data import recordings
from vrscan.data.clouds import SUFFIXES
from vrscan.data.config import Config
from vrscan.data.extras import install
from vrscan.data.points import read_csv

PLYS = ("scan/points.ply", "cloud.ply")
BEGINS = {
    ".ply": b"ply\nformat binary_little_endian",
    ".pcd": b"# .PCD v0.7",
    ".las": b"LASF",
    ".laz": b"LASF",
    ".e57": b"ASTM-E57",
    ".mcap": b"\x89MCAP0\r\n",
    ".rrd": b"RRF2",
}


@pytest.fixture(scope="module", params=SCANNERS)
def config(request: pytest.FixtureRequest) -> Config:
    return SCANNERS[request.param]


@pytest.fixture(scope="module")
def scanned(tmp_path_factory: pytest.TempPathFactory, config: Config) -> Path:
    out = tmp_path_factory.mktemp("scanned") / "scan"
    given = ["scan", "default", "--lines", "600", "--engine", "ideal", "--fidelity", "full"]
    with pytest.MonkeyPatch.context() as patch:
        assert ended(patch, *given, "--out", str(out), "--keep-lines", *words(config)) == 0
    return out


@pytest.fixture
def folder(scanned: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with the points of a scan and poses, which is the working directory."""
    monkeypatch.chdir(tmp_path)
    shutil.copytree(scanned, "scan")
    (tmp_path / "pose.csv").write_text(
        "time_s,x_mm,y_mm,z_mm,roll_deg,pitch_deg,yaw_deg\n0,0,0,0,0,0,0\n1,0,100,0,0,0,0\n"
    )
    return tmp_path


def rows(path: str) -> list[dict[str, str]]:
    with open(path) as file:
        return list(csv.DictReader(file))


def test_an_ending_chooses_the_format(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    names = [f"cloud{suffix}" for suffix in SUFFIXES]
    capsys.readouterr()
    images = ["--range-image", "range.png", "--columns", "50"]
    assert ended(monkeypatch, "export", "scan/points.csv", *names, *images) == 0
    located = sum(row["z_mm"] != "" for row in rows("scan/points.csv"))
    assert capsys.readouterr().out.startswith(f"{located} points of 600 lines: cloud.ply, ")
    for suffix, begin in BEGINS.items():
        assert (folder / f"cloud{suffix}").read_bytes().startswith(begin), suffix
    assert len((folder / "cloud.xyz").read_text().splitlines()) == located
    assert Image.open("range.png").width == 50
    heads = [Path(name).read_bytes().partition(b"end_header")[0] for name in PLYS]
    assert heads[0] == heads[1]


def test_poses_make_a_pan_a_cloud(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    given = ["export", "scan/points.csv", "flat.xyz", "--pose", "pose.csv"]
    assert ended(monkeypatch, *given) == 0
    found = np.loadtxt("flat.xyz")
    assert np.allclose(found[:, 1], 100.0 * found[:, -1], atol=1e-4)


def test_filters_work_in_the_order_of_the_command(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    one, other = ["--median", "5"], ["--average", "3"]
    for name, given in (("a.csv", one + other), ("b.csv", other + one), ("c.csv", one)):
        assert ended(monkeypatch, "filter", "scan/points.csv", name, *given) == 0
    assert ended(monkeypatch, "filter", "c.csv", "d.csv", *other) == 0
    places = {name: [row["z_mm"] for row in rows(name)] for name in ("a.csv", "b.csv", "d.csv")}
    assert places["a.csv"] != places["b.csv"]
    a, d = (np.array([float(z or 0.0) for z in places[name]]) for name in ("a.csv", "d.csv"))
    assert np.abs(a - d).max() < 2.5e-4  # the file between them rounds to 1e-4
    capsys.readouterr()
    given = ["--without", "MIXED", "--min-confidence", "0.5", "--spike", "3", "--outlier", "5"]
    assert ended(monkeypatch, "filter", "scan/points.csv", "e.csv", *given) == 0
    left = [row for row in rows("e.csv") if row["z_mm"]]
    assert f"e.csv: {len(left)} points of " in capsys.readouterr().out
    assert all(float(row["c_obj"]) >= 0.5 and "MIXED" not in row["flags"] for row in left)
    assert [row["flags"] for row in rows("e.csv")] == [
        row["flags"] for row in rows("scan/points.csv")
    ]


def test_points_may_be_filtered_into_their_own_file(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    given = ["--median", "5", "--without", "MIXED"]
    whole = Path("scan/points.csv").read_bytes()
    assert ended(monkeypatch, "filter", "scan/points.csv", "other.csv", *given) == 0
    assert ended(monkeypatch, "filter", "scan/points.csv", "scan/points.csv", "--median", "4") == 2
    assert Path("scan/points.csv").read_bytes() == whole
    assert ended(monkeypatch, "filter", "scan/points.csv", "scan/points.csv", *given) == 0
    assert Path("scan/points.csv").read_bytes() == Path("other.csv").read_bytes() != whole


def test_pictures_of_lines_are_replayed(
    folder: Path, config: Config, monkeypatch: pytest.MonkeyPatch
) -> None:
    kept = recordings.read(Path("scan/lines.mcap")).lines
    Image.fromarray(kept.lines).save("lines.png")
    names = ("angle_rad", "power", "time_s", "y_mm")
    lines = zip(*(getattr(kept, name).tolist() for name in names), strict=True)
    text = "\n".join(",".join(map(repr, line)) for line in lines)
    Path("angles.csv").write_text(f"{','.join(names)}\n{text}\n")
    given = ["replay", "lines.png", "--angles", "angles.csv", "--engine", "ideal", *words(config)]
    assert ended(monkeypatch, *given, "--out", "again.csv") == 0
    assert Path("again.csv").read_bytes() == Path("scan/points.csv").read_bytes()


BAD = {
    "no_points": (["export", "none.csv", "a.ply"], ["none.csv", "No such file"]),
    "misspelt_points": (
        ["export", "scan/point.csv", "a.ply"],
        ["scan/point.csv: No such file", "did you mean 'points.csv'?"],
    ),
    "misspelt_recording": (
        ["replay", "scan/line.mcap", "--out", "a.csv"],
        ["scan/line.mcap: No such file", "did you mean 'lines.mcap'?"],
    ),
    "other_kind_of_lines": (
        ["replay", "scan/lines.npz", "--out", "a.csv"],
        ["scan/lines.npz: No such file", "did you mean 'lines.mcap'?"],
    ),
    "points_for_lines": (
        ["replay", "scan/points.csv", "--out", "a.csv"],
        ["scan/points.csv: holds points, not lines"],
    ),
    "no_table": (["export", "pose.csv", "a.ply"], ["pose.csv", "no column line"]),
    "no_out": (["export", "scan/points.csv"], ["no file to write"]),
    "no_format": (["export", "scan/points.csv", "a.stl"], ["a.stl", ".ply or .pcd"]),
    "no_image": (
        ["export", "scan/points.csv", "--range-image", "a.jpg"],
        ["a.jpg", ".png or .tif"],
    ),
    "no_folder": (["export", "scan/points.csv", "no/a.ply"], ["no/a.ply", "no such folder"]),
    "twice": (["export", "scan/points.csv", "a.ply", "a.ply"], ["a.ply", "twice"]),
    "late_error": (["export", "scan/points.csv", "a.ply", "no/b.las"], ["no/b.las"]),
    "no_poses": (["export", "scan/points.csv", "a.ply", "--pose", "none.csv"], ["none.csv"]),
    "few_poses": (
        ["export", "scan/points.csv", "a.ply", "--pose", "short.csv"],
        ["short.csv", "poses from 0 to 0.001 s"],
    ),
    "no_columns": (
        ["export", "scan/points.csv", "a.mcap", "--columns", "0"],
        ["--columns", "(0)"],
    ),
    "no_rate": (["export", "scan/points.csv", "a.mcap", "--rate", "0"], ["--rate", "(0)"]),
    "no_filter": (["filter", "scan/points.csv", "a.csv"], ["no filter", "--median"]),
    "no_csv": (["filter", "scan/points.csv", "a.ply", "--median", "3"], ["a.ply", ".csv"]),
    "even": (["filter", "scan/points.csv", "a.csv", "--median", "4"], ["--median", "(4)"]),
    "no_angles": (
        [
            "replay",
            "scan/lines.mcap",
            "--out",
            "a.csv",
            "--angles",
            "none.csv",
            "--engine",
            "ideal",
        ],
        ["none.csv"],
    ),
}


def test_bad_input_is_one_line_and_leaves_nothing(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (folder / "short.csv").write_text(
        "time_s,x_mm,y_mm,z_mm,roll_deg,pitch_deg,yaw_deg\n0,0,0,0,0,0,0\n0.001,0,0,0,0,0,0\n"
    )
    before = sorted(folder.rglob("*"))
    capsys.readouterr()
    for case, (arguments, wanted) in BAD.items():
        refused(arguments, wanted, case, monkeypatch, capsys)
        assert sorted(folder.rglob("*")) == before, case


LIBRARIES = {
    ".las": ("laspy", "formats"),
    ".laz": ("lazrs", "formats"),
    ".e57": ("pye57", "formats"),
    ".mcap": ("mcap_ros2", "formats"),
    ".rrd": ("rerun", "rerun"),
    ".png": ("PIL", "scene"),
}


def test_a_missing_library_is_one_line(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    before = sorted(folder.rglob("*"))
    capsys.readouterr()
    for suffix, (library, extra) in LIBRARIES.items():
        given = ["--range-image", "a.png"] if suffix == ".png" else [f"a{suffix}"]
        with monkeypatch.context() as patch:
            for name in [n for n in sys.modules if n.partition(".")[0] == library]:
                patch.delitem(sys.modules, name)
            patch.setitem(sys.modules, library, None)
            text = f"{library} is missing: {install(extra)}"
            refused(["export", "scan/points.csv", *given], [text], suffix, patch, capsys)
        assert sorted(folder.rglob("*")) == before, suffix


def refused(
    arguments: list[str],
    wanted: list[str],
    case: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert ended(monkeypatch, *arguments) == 2, case
    output = capsys.readouterr()
    assert output.out == "", case
    assert output.err.startswith("vrscan: ") and output.err.count("\n") == 1, output.err
    for part in wanted:
        assert part in output.err, output.err


def test_a_recording_gives_what_its_arrays_and_table_give(
    folder: Path,
    config: Config,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    lines = recordings.read(Path("scan/lines.mcap")).lines
    columns = ("lines", "angle_rad", "power", "mirror_flags", "time_s", "y_mm")
    np.savez("lines.npz", **{name: getattr(lines, name) for name in columns})
    with recordings.Writer(Path("a.mcap"), config) as into:
        into.points(read_csv(Path("scan/points.csv")))
        into.lines(lines)
    for source, name in (("lines.npz", "n"), ("a.mcap", "m")):
        own = words(config) if name == "n" else []  # a recording brings its own
        given = ["replay", source, "--engine", "ideal", "--out", f"{name}.csv", "--jobs", "1"]
        assert ended(monkeypatch, *given, *own) == 0
    assert Path("m.csv").read_bytes() == Path("n.csv").read_bytes()
    for source, name in (("scan/points.csv", "n"), ("a.mcap", "m")):
        assert ended(monkeypatch, "export", source, f"{name}.xyz") == 0
        assert ended(monkeypatch, "filter", source, f"{name}.csv", "--median", "3") == 0
    assert Path("m.xyz").read_bytes() == Path("n.xyz").read_bytes()
    assert Path("m.csv").read_bytes() == Path("n.csv").read_bytes()
    capsys.readouterr()
    Path("cut.mcap").write_bytes(Path("a.mcap").read_bytes()[:-3000])
    assert ended(monkeypatch, "export", "cut.mcap", "cut.xyz") == 0
    assert "vrscan: cut.mcap: cut off before its end" in capsys.readouterr().err
