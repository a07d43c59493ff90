"""Clouds of points in the formats that other programs read.

PLY and XYZ are in mm, as points.csv is; all others in metres, as their standards or their readers
want it. Every format keeps what it has a place for of sigma, confidence, flags, time and intensity.
"""

import os
import shutil
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import BinaryIO

import numpy as np

from vrscan.data import ros
from vrscan.data.arrays import Floats, Ints
from vrscan.data.errors import InputError
from vrscan.data.extras import named
from vrscan.data.points import ply_file, ply_vertices, widened
from vrscan.data.poses import Poses
from vrscan.data.range_image import Grid, grid, sweeps
from vrscan.data.table import Table, flag_bits

_METRE = 1e-3  # m in a mm
_FAR_MM = 2.0**15  # from here on single precision moves a point by a micrometre and more
_AXES = ",".join(f'AXIS["{axis}",OTHER]' for axis in "xyz")
_WKT = f'LOCAL_CS["vrscan",LOCAL_DATUM["vrscan",0],UNIT["metre",1],{_AXES}]'
_PCD = np.dtype(
    [(name, "<f4") for name in ("x", "y", "z", "intensity", "sigma", "confidence")]
    + [("flags", "<u4"), ("line", "<u4"), ("time", "<f8")]
)
_PCD_KINDS = {"f": "F", "u": "U"}
_LAS_STEP_M = 1e-6  # of a coordinate, of which there are 2**32
_LAS_SPAN_M = 2000.0  # largest cloud with that step
_LAS_COARSE_M = 1e-4
_LAS_ANGLE_DEG = 0.006  # of the standard's scan_angle
_MOST_ROWS = 2**16  # of an image in an .e57 that pye57 writes


@dataclass(frozen=True)
class Cloud:
    """n points with a place; all arrays [n].

    Attributes:
        points: The points, all of them located.
        places_mm: x, y and z in the frame of the cloud [n, 3].
        sweep: Number of the sweep of the mirror.
        columns: Angles over the whole scan, evenly spaced.
        poses: Poses of the scanner, if the frame is that of the world.
        flags: Bits of ``pkg.FLAGS``.
    """

    points: Table
    places_mm: Floats
    sweep: Ints
    columns: Grid
    poses: Poses | None
    flags: Ints

    def __len__(self) -> int:
        """Return the number of points."""
        return len(self.points)

    @property
    def offset_mm(self) -> Floats:
        """Return what formats of single precision take off places, 0 where these are near [3].

        It is a whole number of metres, so it is exact in every unit.
        """
        if np.abs(self.places_mm).max() < _FAR_MM:
            return np.zeros(3)
        return np.asarray(np.floor(self.places_mm.min(axis=0) * _METRE) / _METRE)

    @property
    def far(self) -> bool:
        """Return whether places are too far from the origin for single precision."""
        return bool(self.offset_mm.any())

    def note(self, suffix: str) -> str:
        """Return how a file has places far from the origin, "" where there is nothing to tell."""
        x, y, z = _METRE * self.offset_mm
        if not self.far or suffix not in _FAR:
            return ""
        return _FAR[suffix].format(f"x {x:.0f}, y {y:.0f}, z {z:.0f} m")


# What is told of the files of far places; the others lose nothing.
_FAR = {
    ".ply": "in double precision",
    ".pcd": "in double precision",
    ".e57": "the pose of the scan adds {}",
    ".mcap": "/tf_static adds {}",
    ".rrd": "offset_m of cloud has {} to add",
}


def cloud(
    points: Table,
    *,
    name: str = "points",
    poses: Poses | None = None,
    rate_hz: float | None = None,
    columns: int | None = None,
) -> Cloud:
    """Return the points that have a place, in the frame of the scanner or of the world.

    Args:
        points: Points of a whole scan, in the order of their lines.
        name: Name for messages, of a file for instance.
        poses: Poses of the scanner in the world. They say all of its place: y_mm is left out.
        rate_hz: Lines a second, for points whose time is not known; line 0 is at time 0.
        columns: Number of columns of an image or a laser scan, as for ``grid``.

    Raises:
        InputError: if no point has a place, there are poses and a time is not known or beyond
            them, or the number of columns is out of range.
        MissingError: if there are poses and scipy is not installed.
    """
    if rate_hz is not None:
        time = np.where(np.isnan(points.time_s), points.line / rate_hz, points.time_s)
        points = replace(points, time_s=time)
    if not points.located.any():
        raise InputError(f"{name}: no point has a place")
    found = points.of(points.located)
    places = found.places_mm
    if poses is not None:
        check_times(found, name, "poses")
        places[:, 1] = 0.0
        places = poses.to_world(places, found.time_s)
    return Cloud(
        points=found,
        places_mm=places,
        sweep=sweeps(points.angle_rad)[points.located],
        columns=grid(points.angle_rad, columns),
        poses=poses,
        flags=flag_bits(found.flags, len(found)),
    )


def check_times(points: Table, name: str, what: str) -> None:
    """Check that the time of each point is known.

    Raises:
        InputError: naming the points and what needs their time.
    """
    if np.isnan(points.time_s).any():
        raise InputError(f"{name}: no time_s, which {what} need: give --rate, the lines a second")


def write(cloud: Cloud, suffix: str, file: BinaryIO, *, name: str, frame: str = "vrscan") -> None:
    """Write a cloud.

    Args:
        cloud: The cloud.
        suffix: One of ``SUFFIXES``, which says the format.
        file: A binary file.
        name: Name of the points for messages.
        frame: The frame_id of the scanner, for ``.mcap``.

    Raises:
        InputError: if the format needs times that are not known.
        MissingError: if a library of the format is not installed.
    """
    if suffix == ".mcap":
        check_times(cloud.points, name, "ROS messages")
        ros.write(
            file,
            cloud.points,
            cloud.places_mm * _METRE,
            cloud.offset_mm * _METRE,
            cloud.sweep,
            cloud.columns,
            cloud.flags,
            cloud.poses,
            frame,
        )
    else:
        _WRITERS[suffix](cloud, file)


def _write_ply(cloud: Cloud, file: BinaryIO) -> None:
    with ply_file(file, double=cloud.far) as take:
        take(ply_vertices(cloud.points, cloud.places_mm, double=cloud.far))


def _write_pcd(cloud: Cloud, file: BinaryIO) -> None:
    """Write a PCD of version 0.7 with binary data."""
    kind = widened(_PCD) if cloud.far else _PCD
    found = np.zeros(len(cloud), kind)
    for axis, column in zip("xyz", (cloud.places_mm * _METRE).T, strict=True):
        found[axis] = column
    points = cloud.points
    found["intensity"], found["sigma"] = points.intensity, points.sigma_z_mm * _METRE
    found["confidence"], found["flags"] = points.c_obj, cloud.flags
    found["line"], found["time"] = points.line, points.time_s
    names = kind.names or ()
    kinds = [kind[name] for name in names]
    header = [
        "# .PCD v0.7 - Point Cloud Data file format",
        "VERSION 0.7",
        "FIELDS " + " ".join(names),
        "SIZE " + " ".join(str(kind.itemsize) for kind in kinds),
        "TYPE " + " ".join(_PCD_KINDS[kind.kind] for kind in kinds),
        "COUNT" + " 1" * len(names),
        f"WIDTH {len(cloud)}",
        "HEIGHT 1",
        "VIEWPOINT 0 0 0 1 0 0 0",
        f"POINTS {len(cloud)}",
        "DATA binary",
    ]
    file.write(("\n".join(header) + "\n").encode("ascii"))
    file.write(found.tobytes())


def _write_xyz(cloud: Cloud, file: BinaryIO) -> None:
    """Write x, y, z, intensity, sigma, confidence, flags and time of a point in each line."""
    points = cloud.points
    columns = [cloud.places_mm, points.intensity, points.sigma_z_mm, points.c_obj, cloud.flags]
    found = np.column_stack([*columns, points.time_s])
    np.savetxt(file, found, "%.4f %.4f %.4f %.3f %.4f %.3f %d %.9f")


def _write_las(cloud: Cloud, file: BinaryIO, *, packed: bool) -> None:
    """Write LAS 1.4 with points of format 6, which have a time and an angle."""
    with named():
        import laspy

        if packed:
            import lazrs  # noqa: F401  (laspy's own message is not of one line)

    points, places = cloud.points, cloud.places_mm * _METRE
    header = laspy.LasHeader(point_format=6, version="1.4")
    header.generating_software, header.system_identifier = "vrscan", "vrscan"
    header.global_encoding.wkt = True  # what points of format 6 ask for
    header.vlrs.append(laspy.vlrs.known.WktCoordinateSystemVlr(_WKT))
    header.offsets = np.floor(places.min(axis=0))
    fine = float(np.ptp(places, axis=0).max()) < _LAS_SPAN_M
    header.scales = np.full(3, _LAS_STEP_M if fine else _LAS_COARSE_M)
    more = {
        "sigma": (points.sigma_z_mm * _METRE, "<f4", "standard deviation of z, m"),
        "confidence": (points.c_obj, "<f4", "0 to 1"),
        "flags": (cloud.flags, "<u4", "bits of vrscan_pkg"),
        "line": (points.line, "<u4", "number of the sensor's line"),
        "power": (np.nan_to_num(points.power), "<u2", "of the laser, 0 to 65535"),
    }
    header.add_extra_dims(
        [laspy.ExtraBytesParams(name, kind, told) for name, (_, kind, told) in more.items()]
    )
    found = laspy.LasData(header)
    found.x, found.y, found.z = places.T
    count = np.ones(len(cloud), np.uint8)
    found.return_number, found.number_of_returns = count, count
    found.gps_time = np.nan_to_num(points.time_s)
    found.intensity = np.clip(np.rint(np.nan_to_num(points.intensity)), 0, 2**16 - 1)
    found.scan_angle = np.rint(np.degrees(points.angle_rad) / _LAS_ANGLE_DEG).astype(np.int16)
    for name, (column, kind, _) in more.items():
        found[name] = column.astype(kind)
    found.write(_Open(file), do_compress=packed)


class _Open:
    """A file that laspy writes and does not close."""

    def __init__(self, file: BinaryIO) -> None:
        self.write, self.seek, self.tell = file.write, file.seek, file.tell
        self.flush, self.close = file.flush, file.flush


def _write_e57(cloud: Cloud, file: BinaryIO) -> None:
    """Write E57: places, intensity, and row and column in the image of the scan."""
    with named():
        import pye57

    # The library writes single precision, and limits that have to hold for what it writes.
    near = (cloud.places_mm - cloud.offset_mm) * _METRE
    x, y, z = near.T.astype(np.float32).astype(np.float64)
    data = {"cartesianX": x, "cartesianY": y, "cartesianZ": z}
    data["intensity"] = np.nan_to_num(cloud.points.intensity).astype(np.float32)
    if cloud.sweep[-1] < _MOST_ROWS:
        data["rowIndex"] = cloud.sweep.astype(np.uint16)
        column = cloud.columns.columns(cloud.points.angle_rad)
        data["columnIndex"] = column.astype(np.uint16)
    with tempfile.TemporaryDirectory() as folder:  # the library wants a name
        path = Path(folder) / "cloud.e57"
        with pye57.E57(os.fspath(path), mode="w") as written:
            written.write_scan_raw(data, name="vrscan", translation=cloud.offset_mm * _METRE)
        with path.open("rb") as whole:
            shutil.copyfileobj(whole, file)


def _write_rrd(cloud: Cloud, file: BinaryIO) -> None:
    """Write a recording of Rerun: the whole cloud, and each sweep at its time."""
    with named():
        import rerun

    points, places = cloud.points, (cloud.places_mm - cloud.offset_mm) * _METRE
    stream = rerun.RecordingStream("vrscan", recording_id="points")
    found = stream.binary_stream()
    bright = np.nan_to_num(points.intensity)
    level = np.clip(bright / max(float(np.quantile(bright, 0.99)), 1e-9), 0.0, 1.0)
    grey = np.repeat((55 + 200 * level).astype(np.uint8)[:, None], 3, axis=1)
    stream.log("cloud", rerun.Points3D(places, colors=grey), static=True)
    columns = {
        "intensity": points.intensity,
        "sigma": points.sigma_z_mm * _METRE,
        "confidence": points.c_obj,
        "flags": cloud.flags,
        "line": points.line,
    }
    if cloud.far:
        columns["offset_m"] = cloud.offset_mm * _METRE
    stream.log("cloud", rerun.AnyValues(**columns), static=True)
    if not np.isnan(points.time_s).any():
        for each in np.split(np.arange(len(cloud)), np.flatnonzero(np.diff(cloud.sweep)) + 1):
            stream.set_time("time", duration=float(points.time_s[each[0]]))
            stream.log("sweep", rerun.Points3D(places[each], colors=grey[each]))
    stream.flush()
    file.write(found.read() or b"")


_WRITERS: dict[str, Callable[[Cloud, BinaryIO], None]] = {
    ".ply": _write_ply,
    ".pcd": _write_pcd,
    ".xyz": _write_xyz,
    ".las": partial(_write_las, packed=False),
    ".laz": partial(_write_las, packed=True),
    ".e57": _write_e57,
    ".rrd": _write_rrd,
}
SUFFIXES = (*_WRITERS, ".mcap")
