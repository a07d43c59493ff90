"""Points as ROS 2 messages, one of each kind for a sweep of the mirror, and in an MCAP file.

The functions of one message return its fields by their names, which the file's writer takes as they
are and a node puts into a message of its own.

``/points`` has PointCloud2 and ``/scan`` LaserScan. The scanner's own frame has z along the view, x
along the sensor and y across the scan plane. A LaserScan lies in the plane of x and y of its frame
with angle 0 along x, so it has a frame of its own, which ``/tf_static`` places: its x is the
scanner's z, its y the scanner's x, its z the scanner's y. With poses ``/points`` is in the frame
``world``, and ``/tf`` has the scanner in it at the first point of each sweep.
"""

from math import sqrt
from typing import Any, BinaryIO

import numpy as np
import numpy.typing as npt

from vrscan.data.arrays import Floats, Ints
from vrscan.data.config import UNITS_MM, Geometry
from vrscan.data.extras import named
from vrscan.data.poses import Poses
from vrscan.data.range_image import Grid, Image, range_image
from vrscan.data.table import Table

Message = dict[str, Any]
Rows = npt.NDArray[np.void]
WORLD = "world"
POINTS, SCAN, TF_STATIC = "points", "scan", "tf_static"  # topics
POINT = np.dtype(
    [(name, "<f4") for name in ("x", "y", "z", "intensity", "sigma", "confidence")]
    + [("flags", "<u4"), ("time", "<f4")]
)
LASER = "_laser"  # ending of the frame of the LaserScan
LASER_TURN = (-0.5, -0.5, -0.5, 0.5)  # of its axes in the scanner's, a quaternion x, y, z, w
# Of x and z in the largest unit of length: points do not tell which one was theirs.
RANGE_M = (0.0, 1e-3 * sqrt(2.0) * Geometry(unit_mm=UNITS_MM[-1]).range_mm)
_KINDS = {"<f4": 7, "<u4": 6}  # FLOAT32 and UINT32 of PointField
FIELDS: list[Message] = [  # of POINT, for a PointCloud2
    {"name": name, "offset": offset, "datatype": _KINDS[kind.str], "count": 1}
    for name, (kind, offset, *_) in (POINT.fields or {}).items()
]
_HEADER = """
std_msgs/Header header
"""
_COMMON = """
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""
_CLOUD = f"""{_HEADER}uint32 height
uint32 width
sensor_msgs/PointField[] fields
bool is_bigendian
uint32 point_step
uint32 row_step
uint8[] data
bool is_dense
{_COMMON.strip()}
================================================================================
MSG: sensor_msgs/PointField
uint8 INT8=1
uint8 UINT8=2
uint8 INT16=3
uint8 UINT16=4
uint8 INT32=5
uint8 UINT32=6
uint8 FLOAT32=7
uint8 FLOAT64=8
string name
uint32 offset
uint8 datatype
uint32 count
""".lstrip()
_SCAN = f"""{_HEADER}float32 angle_min
float32 angle_max
float32 angle_increment
float32 time_increment
float32 scan_time
float32 range_min
float32 range_max
float32[] ranges
float32[] intensities
{_COMMON.strip()}
""".lstrip()
_TRANSFORMS = f"""geometry_msgs/TransformStamped[] transforms
================================================================================
MSG: geometry_msgs/TransformStamped
{_HEADER.strip()}
string child_frame_id
geometry_msgs/Transform transform
================================================================================
MSG: geometry_msgs/Transform
geometry_msgs/Vector3 translation
geometry_msgs/Quaternion rotation
================================================================================
MSG: geometry_msgs/Vector3
float64 x
float64 y
float64 z
================================================================================
MSG: geometry_msgs/Quaternion
float64 x
float64 y
float64 z
float64 w
{_COMMON.strip()}
"""


def write(
    file: BinaryIO,
    points: Table,
    places_m: Floats,
    sweep: Ints,
    columns: Grid,
    flags: Ints,
    poses: Poses | None,
    frame: str,
) -> None:
    """Write the messages.

    Args:
        file: A binary file.
        points: n points with a place and a time.
        places_m: Their places in the frame of ``/points`` [n, 3].
        sweep: Number of the sweep of each [n].
        columns: Angles of the LaserScan.
        flags: Bits of ``pkg.FLAGS`` of each [n].
        poses: Poses of the scanner in the world; None leaves the points in its own frame.
        frame: The frame_id of the scanner.

    Raises:
        MissingError: if mcap or mcap_ros2 is not installed.
    """
    with named():
        from mcap_ros2.writer import Writer

    parts = np.split(np.arange(len(points)), np.flatnonzero(np.diff(sweep)) + 1)
    first = points.time_s[[part[0] for part in parts]]
    period = float(np.median(np.diff(first))) if len(parts) > 1 else 0.0
    row = np.cumsum(np.diff(sweep, prepend=sweep[0]) != 0)
    records = point_rows(points, places_m, flags, points.time_s - first[row])
    image = range_image(points, row, columns)
    with Writer(file) as writer:
        clouds = writer.register_msgdef("sensor_msgs/msg/PointCloud2", _CLOUD)
        scans = writer.register_msgdef("sensor_msgs/msg/LaserScan", _SCAN)
        transforms = writer.register_msgdef("tf2_msgs/msg/TFMessage", _TRANSFORMS)

        def send(topic: str, kind: Any, time_s: float, message: Message) -> None:
            writer.write_message(f"/{topic}", kind, message, log_time=round(1e9 * time_s))

        send(TF_STATIC, transforms, float(first[0]), laser_placed(frame, float(first[0])))
        for part, time, ranges in zip(parts, first.tolist(), image, strict=True):
            if poses is not None:
                place, turn = poses.at(np.array([time]))
                moved = _transform(WORLD, frame, time, 1e-3 * place[0], turn[0])
                send("tf", transforms, time, moved)
            within = frame if poses is None else WORLD
            send(POINTS, clouds, time, point_cloud(records[part], within, time))
            send(SCAN, scans, time, laser_scan(ranges, columns, period, frame, time))


def point_rows(points: Table, places_m: Floats, flags: Ints, since_s: Floats) -> Rows:
    """Return points as the rows of a PointCloud2, an array of ``POINT``.

    Args:
        points: n points.
        places_m: Their places in the frame of the message [n, 3].
        flags: Bits of ``pkg.FLAGS`` of each [n].
        since_s: Their times since the stamp of the message [n].
    """
    rows = np.zeros(len(points), POINT)
    for axis, column in zip("xyz", places_m.T, strict=True):
        rows[axis] = column
    rows["intensity"], rows["confidence"] = points.intensity, points.c_obj
    rows["sigma"], rows["flags"], rows["time"] = 1e-3 * points.sigma_z_mm, flags, since_s
    return rows


def point_cloud(rows: Rows, frame: str, time_s: float) -> Message:
    """Return the fields of a PointCloud2 of ``point_rows``, stamped with a time."""
    return {
        "header": _header(frame, time_s),
        "height": 1,
        "width": len(rows),
        "fields": FIELDS,
        "is_bigendian": False,
        "point_step": POINT.itemsize,
        "row_step": POINT.itemsize * len(rows),
        "data": rows.tobytes(),
        "is_dense": True,
    }


def laser_scan(
    ranges_mm: Floats | Image, columns: Grid, period_s: float, frame: str, time_s: float
) -> Message:
    """Return the fields of a LaserScan.

    Args:
        ranges_mm: Distance of each column's point, NaN where there is none [columns.count].
        columns: Angles of the columns.
        period_s: Time between two sweeps.
        frame: The frame_id of the scanner, in which ``laser_placed`` places that of the message.
        time_s: Time of the first point.
    """
    return {
        "header": _header(frame + LASER, time_s),
        "angle_min": columns.first_rad,
        "angle_max": columns.first_rad + columns.step_rad * (columns.count - 1),
        "angle_increment": columns.step_rad,
        "time_increment": 0.0,  # the mirror moves to and fro, and not evenly
        "scan_time": period_s,
        "range_min": RANGE_M[0],
        "range_max": RANGE_M[1],
        "ranges": (1e-3 * ranges_mm).tolist(),
        "intensities": [],
    }


def laser_placed(frame: str, time_s: float) -> Message:
    """Return the fields of the TFMessage that places the frame of the LaserScan."""
    return _transform(frame, frame + LASER, time_s, (0.0, 0.0, 0.0), LASER_TURN)


def _header(frame: str, time_s: float) -> Message:
    seconds, rest = divmod(round(1e9 * time_s), 10**9)
    return {"stamp": {"sec": seconds, "nanosec": rest}, "frame_id": frame}


def _transform(parent: str, child: str, time_s: float, place_m: Any, turn: Any) -> Message:
    """Return the fields of the TFMessage that says where a frame is in another."""
    placed = {
        "header": _header(parent, time_s),
        "child_frame_id": child,
        "transform": {
            "translation": dict(zip("xyz", map(float, place_m), strict=True)),
            "rotation": dict(zip("xyzw", map(float, turn), strict=True)),
        },
    }
    return {"transforms": [placed]}
