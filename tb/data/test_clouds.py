"""Clouds in every format, each read back by a reader that shares no code with its writer."""

import io
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pye57
import pytest
import yaml
from mcap.reader import make_reader
from ros_reader import messages

from vrscan.data import clouds, poses, ros
from vrscan.data.config import Config
from vrscan.data.errors import InputError
from vrscan.data.points import table
from vrscan.data.range_image import sweeps
from vrscan.data.recordings import Writer
from vrscan.data.table import Table

RATE_HZ = 37374.9
LINES = 1000
PERIOD = 170.0  # lines of a period of the mirror


def scan() -> Table:
    """Return points on a rough wall, with holes, flags, times and a scanner that moves."""
    from test_points import random_points

    rng = np.random.default_rng(7)
    points = table(random_points()).of(np.arange(4000) < LINES)
    line = np.arange(LINES)
    angle = 0.35 * np.cos(2.0 * np.pi * line / PERIOD)
    z = 400.0 + 20.0 * np.sin(9.0 * angle) + rng.normal(0.0, 0.05, LINES)
    return replace(
        points,
        line=line,
        angle_rad=angle,
        x_mm=z * np.tan(angle),
        z_mm=z,
        sigma_z_mm=rng.uniform(0.01, 2.0, LINES),
        located=rng.random(LINES) < 0.8,
        measured=np.ones(LINES, np.bool_),
        time_s=1.5 + line / RATE_HZ,
        power=np.full(LINES, 32768.0),
        y_mm=line * 1e-3,
        maximum=rng.integers(100, 4096, LINES),
        background=np.full(LINES, 60.0),
    )


@pytest.fixture(scope="module")
def found() -> clouds.Cloud:
    return clouds.cloud(scan())


def file_of(cloud: clouds.Cloud, suffix: str, folder: Path, **more: Any) -> Path:
    path = folder / f"cloud{suffix}"
    with path.open("wb") as file:
        clouds.write(cloud, suffix, file, name="points.csv", **more)
    return path


def test_ply_by_trimesh(found: clouds.Cloud, tmp_path: Path) -> None:
    import trimesh

    read = trimesh.load(file_of(found, ".ply", tmp_path))
    assert np.allclose(read.vertices, found.places_mm, atol=1e-4)
    data = read.metadata["_ply_raw"]["vertex"]["data"]
    points = found.points
    for name, want in {
        "sigma_z": points.sigma_z_mm,
        "confidence": points.c_obj,
        "time": points.time_s,
        "power": points.power,
        "intensity": points.intensity,
        "flags": found.flags,
        "line": points.line,
    }.items():
        assert np.allclose(np.ravel(data[name]), want, rtol=1e-6), name


def test_pcd_by_pypcd4(found: clouds.Cloud, tmp_path: Path) -> None:
    import pypcd4

    read = pypcd4.PointCloud.from_path(file_of(found, ".pcd", tmp_path))
    points = found.points
    assert read.points == len(found)
    metres = np.stack([read.pc_data[axis] for axis in "xyz"], 1)
    assert np.allclose(metres, 1e-3 * found.places_mm, atol=1e-7)
    assert np.allclose(read.pc_data["sigma"], 1e-3 * points.sigma_z_mm, rtol=1e-6)
    assert np.allclose(read.pc_data["intensity"], points.intensity, rtol=1e-6)
    assert np.allclose(read.pc_data["confidence"], points.c_obj, rtol=1e-6)
    assert np.array_equal(read.pc_data["flags"], found.flags)
    assert np.array_equal(read.pc_data["line"], points.line)
    assert np.array_equal(read.pc_data["time"], points.time_s)


def test_xyz_by_trimesh(found: clouds.Cloud, tmp_path: Path) -> None:
    path = file_of(found, ".xyz", tmp_path)
    rows = [[float(word) for word in line.split()] for line in path.read_text().splitlines()]
    points = found.points
    columns = [points.intensity, points.sigma_z_mm, points.c_obj, found.flags, points.time_s]
    want = np.column_stack([found.places_mm, *columns])
    assert np.allclose(rows, want, rtol=1e-9, atol=6e-4)


@pytest.mark.parametrize("suffix", [".las", ".laz"])
def test_las_by_laszip(found: clouds.Cloud, suffix: str, tmp_path: Path) -> None:
    """The reader is LASzip, in C++, which the Rust of lazrs and laspy's numpy know nothing of."""
    import laszip

    # Format 6 of LAS 1.4, 30 bytes, and what the file declares after it.
    fields = "xyz=3i4 intensity=u2 returns=u1 bits=u1 class=u1 user=u1 scan_angle=i2 source=u2"
    fields += " time=f8 sigma=f4 confidence=f4 flags=u4 line=u4 power=u2"
    kind = np.dtype([tuple(each.split("=")) for each in fields.split()])
    with file_of(found, suffix, tmp_path).open("rb") as file:
        reader = laszip.LasUnZipper(file)
        header = reader.header
        assert (header.version_major, header.version_minor) == (1, 4)
        assert header.point_data_format & 0x7F == 6
        assert header.point_data_record_length == kind.itemsize
        assert header.extended_number_of_point_records == len(found)
        data = np.zeros(len(found), kind)
        reader.decompress_into(data.view(np.uint8))
        steps = [getattr(header, f"{axis}_scale_factor") for axis in "xyz"]
        offsets = [getattr(header, f"{axis}_offset") for axis in "xyz"]
        assert header.max_z == pytest.approx(1e-3 * found.places_mm[:, 2].max(), abs=2e-6)
    points = found.points
    assert np.allclose(data["xyz"] * steps + offsets, 1e-3 * found.places_mm, atol=1e-6)
    assert np.array_equal(data["time"], points.time_s)
    assert np.array_equal(data["intensity"], np.rint(points.intensity))
    assert np.allclose(data["scan_angle"] * 0.006, np.degrees(points.angle_rad), atol=0.003)
    assert np.allclose(data["sigma"], 1e-3 * points.sigma_z_mm, rtol=1e-6)
    assert np.allclose(data["confidence"], points.c_obj, rtol=1e-6)
    assert np.array_equal(data["flags"], found.flags)
    assert np.array_equal(data["line"], points.line)
    assert np.array_equal(data["power"], points.power)


def test_e57_by_the_rust_reader(found: clouds.Cloud, tmp_path: Path) -> None:
    """pye57 writes with libE57Format, in C++; the reader is the crate e57."""
    import e57

    path = file_of(found, ".e57", tmp_path)
    read = e57.read_points(str(path))
    assert np.allclose(read.points, 1e-3 * found.places_mm, atol=5e-8)  # single precision
    assert np.allclose(np.ravel(read.intensity), found.points.intensity, rtol=1e-6)
    text = e57.raw_xml(str(path))
    assert "rowIndex" in text and "columnIndex" in text


def points_of(message: Any) -> np.ndarray:
    kinds = {7: "<f4", 6: "<u4"}
    kind = np.dtype(
        {
            "names": [field.name for field in message.fields],
            "formats": [kinds[field.datatype] for field in message.fields],
            "offsets": [field.offset for field in message.fields],
            "itemsize": message.point_step,
        }
    )
    assert message.row_step == message.point_step * message.width
    return np.frombuffer(message.data.tobytes(), kind)


def test_ros_messages_by_rosbags(found: clouds.Cloud, tmp_path: Path) -> None:
    from scipy.spatial.transform import Rotation

    read = messages(file_of(found, ".mcap", tmp_path, frame="head"))
    points = found.points
    count = len(np.unique(found.sweep))
    assert count == int(sweeps(scan().angle_rad)[-1]) + 1 > 10
    assert [len(read[topic]) for topic in ("/points", "/scan", "/tf_static")] == [count, count, 1]
    rows = np.concatenate([points_of(each) for each in read["/points"]])
    assert rows.dtype.names == (
        *("x", "y", "z", "intensity", "sigma", "confidence", "flags", "time"),
    )
    metres = np.stack([rows[axis] for axis in "xyz"], 1)
    assert np.allclose(metres, 1e-3 * found.places_mm, atol=1e-7)
    assert np.allclose(rows["sigma"], 1e-3 * points.sigma_z_mm, rtol=1e-6)
    assert np.array_equal(rows["flags"], found.flags)
    stamps = [each.header.stamp for each in read["/points"]]
    begin = np.repeat(
        [stamp.sec + 1e-9 * stamp.nanosec for stamp in stamps],
        [each.width for each in read["/points"]],
    )
    assert np.allclose(begin + rows["time"], points.time_s, atol=2e-9)
    assert {each.header.frame_id for each in read["/points"]} == {"head"}
    # The LaserScan, through the transform to the scanner's frame, is the same points.
    (placed,) = read["/tf_static"][0].transforms
    assert (placed.header.frame_id, placed.child_frame_id) == ("head", "head_laser")
    turn = placed.transform.rotation
    rotation = Rotation.from_quat([turn.x, turn.y, turn.z, turn.w])
    sides = rotation.apply(np.eye(3))
    assert np.allclose(sides, [[0, 0, 1], [1, 0, 0], [0, 1, 0]], atol=1e-12)
    for number, each in enumerate(read["/scan"]):
        assert each.header.frame_id == "head_laser"
        angle = each.angle_min + each.angle_increment * np.arange(len(each.ranges))
        assert angle[-1] == pytest.approx(each.angle_max, abs=1e-5)
        seen = np.isfinite(each.ranges)
        assert each.range_max > 16.0  # x and z in units of 8 mm
        assert ((each.ranges >= each.range_min) & (each.ranges <= each.range_max))[seen].all()
        flat = each.ranges * np.array([np.cos(angle), np.sin(angle), 0.0 * angle])
        back = rotation.apply(flat.T)[seen]
        own = 1e-3 * found.places_mm[found.sweep == number]
        near = np.linalg.norm(back[:, None, ::2] - own[None, :, ::2], axis=2).min(axis=1)
        # At most half a column aside, of which the wall's slope makes more.
        assert near.max() < 0.6 * each.angle_increment * 0.45
    assert each.scan_time == pytest.approx(0.5 * PERIOD / RATE_HZ, rel=0.05)


def test_poses_reach_cloud_and_transforms(tmp_path: Path) -> None:
    """A scanner that pans about x, at 10 mm before the axis, over a quarter turn."""
    path = tmp_path / "pose.csv"
    path.write_text(
        "time_s,x_mm,y_mm,z_mm,roll_deg,pitch_deg,yaw_deg\n1,0,0,10,0,0,0\n3,0,0,10,90,0,0\n"
    )
    points = scan()
    cloud = clouds.cloud(points, poses=poses.read(path))
    own = points.of(points.located)
    turn = np.radians(45.0 * (own.time_s - 1.0))
    want = np.stack([own.x_mm, -np.sin(turn) * own.z_mm, np.cos(turn) * own.z_mm + 10.0], 1)
    assert np.allclose(cloud.places_mm, want, atol=1e-9)
    read = messages(file_of(cloud, ".mcap", tmp_path))
    assert {each.header.frame_id for each in read["/points"]} == {ros.WORLD}
    assert len(read["/tf"]) == len(read["/points"])
    moved = read["/tf"][0].transforms[0]
    assert (moved.header.frame_id, moved.child_frame_id) == (ros.WORLD, "vrscan")
    assert moved.transform.translation.z == pytest.approx(0.01)
    assert moved.transform.rotation.x == pytest.approx(np.sin(turn[0] / 2.0), abs=1e-9)


def test_far_places_keep_their_micrometres(tmp_path: Path) -> None:
    """A scanner in UTM, 5,400 km from the origin: each format by another reader, and told."""
    import e57
    import pypcd4
    import trimesh

    path = tmp_path / "pose.csv"
    path.write_text(
        "time_s,x_mm,y_mm,z_mm,roll_deg,pitch_deg,yaw_deg\n"
        "1,468523123.25,5426791555.5,120500,0,0,0\n3,468523123.25,5426791555.5,120500,0,0,0\n"
    )
    cloud = clouds.cloud(scan(), poses=poses.read(path))
    want, offset = 1e-3 * cloud.places_mm, 1e-3 * cloud.offset_mm
    assert offset[1] > 5e6 and np.array_equal(offset, np.rint(offset))
    ply = trimesh.load(file_of(cloud, ".ply", tmp_path), process=False)
    pcd = pypcd4.PointCloud.from_path(file_of(cloud, ".pcd", tmp_path))
    place = file_of(cloud, ".e57", tmp_path)
    with pye57.E57(str(place)) as file:
        assert np.array_equal(file.get_header(0).translation, offset)
    (sent,) = messages(file_of(cloud, ".mcap", tmp_path))["/tf_static"]
    static = {each.child_frame_id: each for each in sent.transforms}
    assert static[ros.NEAR].header.frame_id == ros.WORLD
    origin = static[ros.NEAR].transform.translation
    read = messages(tmp_path / "cloud.mcap")["/points"]
    assert {each.header.frame_id for each in read} == {ros.NEAR}
    rows = np.concatenate([points_of(each) for each in read])
    found = {
        ".ply": 1e-3 * ply.vertices,
        ".pcd": np.stack([pcd.pc_data[axis] for axis in "xyz"], 1),
        ".e57": e57.read_points(str(place)).points,  # which adds the pose
        ".mcap": np.stack([rows[axis] for axis in "xyz"], 1)
        + np.array([origin.x, origin.y, origin.z]),
    }
    for suffix, places in found.items():
        off = np.abs(places - want).max()
        print(f"{suffix}: {1e6 * off:.3f} um")
        assert off < 2e-6 and cloud.note(suffix), suffix
    program = Path(sys.executable).parent / "rerun"
    words = [program, "rrd", "print", "-vvv", file_of(cloud, ".rrd", tmp_path)]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert "offset_m" in done.stdout and f"{offset[1]:.1f}" in done.stdout, done.stderr
    assert not clouds.cloud(scan()).far and not clouds.cloud(scan()).note(".ply")


def test_a_las_file_of_format_6_says_that_its_place_is_in_wkt(
    found: clouds.Cloud, tmp_path: Path
) -> None:
    data = file_of(found, ".las", tmp_path).read_bytes()
    assert int.from_bytes(data[6:8], "little") & 16
    assert b"LASF_Projection" in data and b'LOCAL_CS["vrscan"' in data


def test_later_readers_get_the_static_transform(found: clouds.Cloud, tmp_path: Path) -> None:
    """As rosbag2 reads the profile, in YAML."""
    with file_of(found, ".mcap", tmp_path).open("rb") as file:
        channels = make_reader(file).get_summary().channels.values()
    (static,) = [each for each in channels if each.topic == "/tf_static"]
    (profile,) = yaml.safe_load(static.metadata["offered_qos_profiles"])
    assert profile["durability"] == profile["reliability"] == 1 and profile["depth"] == 1


@pytest.mark.parametrize("time_s", [-1e-3, 2.0**31])
def test_a_time_that_no_stamp_has_is_told(time_s: float, tmp_path: Path) -> None:
    points = scan()
    points = replace(points, time_s=np.full(LINES, time_s))
    with pytest.raises(InputError, match=r"^time_s = .*: a message's stamp has 0 to 2\^31 s$"):
        clouds.write(clouds.cloud(points), ".mcap", io.BytesIO(), name="a.csv")
    with pytest.raises(InputError, match=r"^time_s = "), Writer(io.BytesIO(), Config()) as into:
        into.points(points)


def test_rerun_by_its_own_program(found: clouds.Cloud, tmp_path: Path) -> None:
    """There is no other reader; the program that prints the file is the viewer's, in Rust."""
    path = file_of(found, ".rrd", tmp_path)
    program = Path(sys.executable).parent / "rerun"
    done = subprocess.run(
        [program, "rrd", "print", path], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    for part in ("/cloud", "/sweep", "Points3D:positions", "confidence", "time"):
        assert part in done.stdout, part


def test_times_come_from_a_rate_and_are_asked_for() -> None:
    timeless = replace(scan(), time_s=np.full(LINES, np.nan))
    cloud = clouds.cloud(timeless, rate_hz=1000.0)
    assert np.array_equal(cloud.points.time_s, cloud.points.line / 1000.0)
    with pytest.raises(InputError, match=r"a\.csv: no time_s, .*--rate"):
        clouds.write(clouds.cloud(timeless, name="a.csv"), ".mcap", io.BytesIO(), name="a.csv")
    for suffix in set(clouds.SUFFIXES) - {".mcap", ".rrd"}:
        file = io.BytesIO()
        clouds.write(clouds.cloud(timeless), suffix, file, name="a.csv")
        assert file.getvalue()


def test_nothing_to_write_is_told() -> None:
    empty = replace(scan(), located=np.zeros(LINES, np.bool_))
    with pytest.raises(InputError, match=r"a\.csv: no point has a place"):
        clouds.cloud(empty, name="a.csv")
