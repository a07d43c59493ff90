"""The files that points end in: every word comes back, and nothing half-written stays."""

import csv
import io
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from vrscan.data import pkg
from vrscan.data.errors import InputError
from vrscan.data.points import (
    COLUMNS,
    Points,
    atomic_file,
    csv_file,
    csv_rows,
    ply_file,
    ply_vertices,
    points_equal,
    read_csv,
    table,
    write_csv,
)

COUNT = 4000
SEED = 20100301


def random_points(pixel_width: int = 12) -> Points:
    rng = np.random.default_rng(SEED)

    def words(low: int, high: int) -> np.ndarray:
        values = rng.integers(low, high, COUNT)
        values[:2] = low, high - 1
        return values

    return Points(
        line=np.arange(COUNT),
        flags=words(0, 2**pkg.FLAG_WIDTH),
        left=words(0, 2048),
        right=words(0, 2048),
        width=words(0, 4),
        maximum=words(0, 2**pixel_width),
        row_mean=words(0, 2**24),
        row_variance=words(0, 2**32),
        background=words(0, 2**24),
        noise=words(0, 2**24),
        snr=words(0, 2**16),
        position=words(-(2**23), 2**23),
        sigma=words(0, 2**16),
        doubt=words(0, 2**16),
        angle=words(-(2**23), 2**23),
        x=words(-(2**23), 2**23),
        z=words(-(2**23), 2**23),
        sigma_z=words(0, 2**16),
        c_obj=words(0, 256),
        c_sfm=words(0, 256),
        free_from=words(0, 2**16),
        free_to=words(0, 2**16),
        measured=rng.random(COUNT) < 0.7,
        pixel_width=pixel_width,
    )


@pytest.mark.parametrize("pixel_width", [8, 10, 12, 16])
def test_every_word_is_read_back(pixel_width: int) -> None:
    points = random_points(pixel_width)
    file = io.BytesIO()
    write_csv(table(points), file)
    text = file.getvalue().decode()
    assert text.splitlines()[0] == COLUMNS
    rows = list(csv.DictReader(io.StringIO(text)))
    assert len(rows) == COUNT
    scale = {
        "maximum": (points.maximum, 1.0),
        "row_mean": (points.row_mean, 2.0 ** (24 - pixel_width)),
        "row_variance": (points.row_variance, 2.0 ** (32 - 2 * pixel_width)),
        "background": (points.background, 2.0 ** (24 - pixel_width)),
        "noise": (points.noise, 2.0 ** (24 - pixel_width)),
        "snr": (points.snr, 2.0**8),
        "angle_rad": (points.angle, 2.0**24 / (2.0 * np.pi)),
        "c_obj": (points.c_obj, 255.0),
        "c_sfm": (points.c_sfm, 255.0),
        "position_px": (points.position, 2.0**12),
        "sigma_px": (points.sigma, 2.0**12),
        "doubt_px": (points.doubt, 2.0**12),
        "x_mm": (points.x, 2.0**12),
        "z_mm": (points.z, 2.0**12),
        "sigma_z_mm": (points.sigma_z, 2.0**12),
    }
    no_place = (points.flags >> pkg.FLAG_NO_RANGE | points.flags >> pkg.FLAG_OUT_OF_RANGE) & 1 == 1
    empty = {name: np.zeros(COUNT, np.bool_) for name in scale}
    empty["position_px"] = empty["sigma_px"] = empty["doubt_px"] = ~points.measured
    empty["x_mm"] = empty["z_mm"] = empty["sigma_z_mm"] = ~points.measured | no_place
    for name, (words, step) in scale.items():
        for row, word, hollow in zip(rows, words.tolist(), empty[name].tolist(), strict=True):
            if hollow:
                assert row[name] == ""
            else:
                assert int(np.floor(float(row[name]) * step + 0.5)) == word, (name, row[name])
    for index, row in enumerate(rows):
        assert row["line"] == str(index)
        assert row["peak"] == "0"
        names = [n for n, bit in pkg.FLAGS.items() if points.flags[index] >> bit & 1]
        assert row["flags"] == "|".join(names)
        window = points.width[index] > 0
        assert row["left"] == (str(points.left[index]) if window else "")
        assert row["right"] == (str(points.right[index]) if window else "")


def test_the_cloud_holds_the_located_points() -> None:
    points = random_points()
    y_mm, time_s, power = np.arange(COUNT) * 0.25, np.arange(COUNT) / 37374.9, np.arange(COUNT) % 9
    result = replace(table(points), y_mm=y_mm, time_s=time_s, power=power.astype(float))
    file = io.BytesIO()
    with ply_file(file) as write:
        write(ply_vertices(result))
    header, _, body = file.getvalue().partition(b"end_header\n")
    assert header.startswith(b"ply\nformat binary_little_endian 1.0\n")
    rows = np.flatnonzero(result.located)
    assert f"element vertex {len(rows)}\n".encode() in header
    kinds = {"float": "<f4", "double": "<f8", "uint": "<u4"}
    fields = [line.split() for line in header.decode().splitlines() if line.startswith("property")]
    vertices = np.frombuffer(body, np.dtype([(name, kinds[kind]) for _, kind, name in fields]))
    assert len(vertices) == len(rows)
    assert np.array_equal(vertices["x"], result.x_mm[rows].astype(np.float32))
    assert np.array_equal(vertices["z"], result.z_mm[rows].astype(np.float32))
    assert np.array_equal(vertices["y"], y_mm[rows].astype(np.float32))
    assert np.array_equal(vertices["time"], time_s[rows])
    assert np.array_equal(vertices["power"], power[rows].astype(np.float32))
    height = np.maximum(result.maximum - result.background, 0.0)[rows]
    lit = power[rows] > 0  # and all of them are measured
    assert np.isnan(vertices["intensity"][~lit]).all()
    want = height[lit] * 65535 / power[rows][lit]
    assert vertices["intensity"][lit] == pytest.approx(want, rel=1e-6)
    assert np.array_equal(vertices["flags"], points.flags[rows])
    assert np.array_equal(vertices["line"], rows)


@pytest.mark.parametrize("size", [1, 999, COUNT])
def test_files_grow_by_blocks_to_what_they_are_at_once(size: int) -> None:
    y_mm = np.arange(float(COUNT))
    result = replace(table(random_points()), y_mm=y_mm)
    at_once, cloud, grown, grown_cloud = (io.BytesIO() for _ in range(4))
    write_csv(result, at_once)
    with ply_file(cloud) as write:
        write(ply_vertices(result))
    with csv_file(grown) as write_rows, ply_file(grown_cloud) as write_vertices:
        for start in range(0, COUNT, size):
            rows = np.zeros(COUNT, np.bool_)
            rows[start : start + size] = True
            write_rows(csv_rows(result.of(rows)))
            write_vertices(ply_vertices(result.of(rows)))
    assert grown.getvalue() == at_once.getvalue()
    assert grown_cloud.getvalue() == cloud.getvalue()


@pytest.mark.parametrize("pixel_width", [8, 10, 12, 16])
def test_a_table_that_is_read_is_written_again_as_it_was(tmp_path: Path, pixel_width: int) -> None:
    power = np.where(np.arange(COUNT) % 5, 40_000.0, np.nan)
    result = replace(table(random_points(pixel_width)), power=power, y_mm=np.arange(COUNT) * 0.25)
    result = replace(result, time_s=np.where(np.arange(COUNT) % 3, np.arange(COUNT) / 7.0, np.nan))
    path, again = tmp_path / "points.csv", io.BytesIO()
    with atomic_file(path) as file:
        write_csv(result, file)
    found = read_csv(path)
    write_csv(found, again)
    both = [text.decode().splitlines() for text in (again.getvalue(), path.read_bytes())]
    for got, want in zip(*([line.rpartition(",") for line in each] for each in both), strict=True):
        assert got[0] == want[0]
        if got[2] != want[2]:  # the intensity is computed anew, from rounded counts
            assert float(got[2]) == pytest.approx(float(want[2]), abs=2e-3)
    assert np.array_equal(found.located, result.located)
    assert np.array_equal(found.measured, result.measured)
    assert found.flags.keys() == result.flags.keys()


def test_a_table_of_before_has_no_time(tmp_path: Path) -> None:
    path, file = tmp_path / "points.csv", io.BytesIO()
    write_csv(table(random_points()), file)
    rows = [line.rsplit(",", 4)[0] for line in file.getvalue().decode().splitlines()]
    path.write_text("\n".join(rows))
    found = read_csv(path)
    assert np.isnan(found.time_s).all() and np.isnan(found.power).all()
    assert not found.y_mm.any()


def changed(number: int, name: str, text: str) -> str:
    """Return a points.csv with another text in a row."""
    file = io.BytesIO()
    write_csv(table(random_points()), file)
    lines = file.getvalue().decode().splitlines()[:6]
    fields = lines[number - 1].split(",")
    fields[COLUMNS.split(",").index(name)] = text
    lines[number - 1] = ",".join(fields)
    return "\n".join(lines)


BAD_TABLES = {
    "": ["no column line"],
    "line,x_mm,z_mm,c_obj,flags\n1,2,3,0.5,\n": ["no column peak"],
    f"{COLUMNS}\n": ["no points"],
    f"{COLUMNS}\n1,2,3\n": ["line 2: 3 fields, want 26"],
    changed(4, "angle_rad", "east"): ["line 4", "angle_rad 'east'"],
    changed(3, "row_mean", "nan"): ["line 3", "row_mean 'nan'"],
    changed(2, "flags", "MIXD"): ["line 2", "MIXD", "did you mean 'MIXED'"],
}


@pytest.mark.parametrize("text", BAD_TABLES, ids=range(len(BAD_TABLES)))
def test_a_bad_table_is_one_line(tmp_path: Path, text: str) -> None:
    path = tmp_path / "points.csv"
    path.write_text(text)
    with pytest.raises(InputError) as caught:
        read_csv(path)
    message = str(caught.value)
    assert "\n" not in message
    for part in [str(path), *BAD_TABLES[text]]:
        assert part in message, message
    with pytest.raises(InputError, match="No such file"):
        read_csv(tmp_path / "none.csv")


def test_the_first_difference_is_named() -> None:
    first, second = random_points(), random_points()
    assert points_equal(first, second) is None
    second.snr[17] += 1
    assert "row 17: snr" in str(points_equal(first, second))


def test_a_failure_leaves_the_old_file_and_nothing_else(tmp_path: Path) -> None:
    path = tmp_path / "points.csv"
    path.write_text("old")

    def fail() -> None:
        with atomic_file(path) as file:
            file.write(b"half")
            raise RuntimeError

    with pytest.raises(RuntimeError):
        fail()
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]
    with atomic_file(path) as file:
        file.write(b"new")
    assert path.read_text() == "new"
    assert list(tmp_path.iterdir()) == [path]
    mask = os.umask(0)
    os.umask(mask)
    assert path.stat().st_mode & 0o777 == 0o666 & ~mask


@pytest.mark.parametrize("place", ["missing/points.csv", "folder", "file/points.csv"])
def test_what_cannot_be_written_is_named(tmp_path: Path, place: str) -> None:
    (tmp_path / "folder").mkdir()
    (tmp_path / "file").write_text("")
    before = sorted(tmp_path.rglob("*"))
    with pytest.raises(InputError, match=str(tmp_path / place)), atomic_file(tmp_path / place):
        pass
    assert sorted(tmp_path.rglob("*")) == before
