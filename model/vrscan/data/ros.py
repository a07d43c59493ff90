"""Points as ROS 2 messages, one of each kind for a sweep of the mirror, and in an MCAP file.

The functions of one message return its fields by their names, which the file's writer takes as they
are and a node puts into a message of its own.

``/points`` has PointCloud2 and ``/scan`` LaserScan. The scanner's own frame has z along the view, x
along the sensor and y across the scan plane. A LaserScan lies in the plane of x and y of its frame
with angle 0 along x, so it has a frame of its own, which ``/tf_static`` places: its x is the
scanner's z, its y the scanner's x, its z the scanner's y. With poses ``/points`` is in the frame
``world``, or far from its origin in ``world_near``, which ``/tf_static`` places in it, and ``/tf``
has the scanner in it at the first point of each sweep.
"""

from math import sqrt
from typing import Any, BinaryIO

import numpy as np
import numpy.typing as npt

from vrscan.data.arrays import Floats, Ints
from vrscan.data.config import UNITS_MM, Geometry
from vrscan.data.errors import InputError
from vrscan.data.extras import named
from vrscan.data.poses import Poses
from vrscan.data.range_image import Grid, Image, range_image
from vrscan.data.table import Table

Message = dict[str, Any]
Rows = npt.NDArray[np.void]
WORLD = "world"
NEAR = "world_near"  # of points that are far from the world's origin
MOST_S = 2.0**31  # of a stamp, whose seconds have 32 bits with a sign
# Of /tf_static, whose last message every later reader gets: a list of profiles in YAML, as rosbag2
# keeps them; 1 is keep last, reliable and transient local, and the times are endless.
LATCHED = """- history: 1
  depth: 1
  reliability: 1
  durability: 1
  deadline: {sec: 9223372036, nsec: 854775807}
  lifespan: {sec: 9223372036, nsec: 854775807}
  liveliness: 1
  liveliness_lease_duration: {sec: 9223372036, nsec: 854775807}
  avoid_ros_namespace_conventions: false
"""
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
    offset_m: Floats,
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
        places_m: Their places in the scanner's frame, or with poses in the world's [n, 3].
        offset_m: Origin in the world of the frame of ``/points``, 0 where places are near [3].
        sweep: Number of the sweep of each [n].
        columns: Angles of the LaserScan.
        flags: Bits of ``pkg.FLAGS`` of each [n].
        poses: Poses of the scanner in the world; None leaves the points in its own frame.
        frame: The frame_id of the scanner.

    Raises:
        InputError: if a time is none that ROS has.
        MissingError: if mcap or mcap_ros2 is not installed.
    """
    with named():
        from mcap_ros2.writer import Writer

    parts = np.split(np.arange(len(points)), np.flatnonzero(np.diff(sweep)) + 1)
    first = points.time_s[[part[0] for part in parts]]
    period = float(np.median(np.diff(first))) if len(parts) > 1 else 0.0
    row = np.cumsum(np.diff(sweep, prepend=sweep[0]) != 0)
    check_time(float(points.time_s.min()), float(points.time_s.max()))
    records = point_rows(points, places_m - offset_m, flags, points.time_s - first[row])
    within = frame if poses is None else NEAR if offset_m.any() else WORLD
    image = range_image(points, row, columns)
    with Writer(file) as writer:
        clouds = writer.register_msgdef("sensor_msgs/msg/PointCloud2", _CLOUD)
        scans = writer.register_msgdef("sensor_msgs/msg/LaserScan", _SCAN)
        transforms = writer.register_msgdef("tf2_msgs/msg/TFMessage", _TRANSFORMS)

        def send(topic: str, kind: Any, time_s: float, message: Message) -> None:
            writer.write_message(f"/{topic}", kind, message, log_time=round(1e9 * time_s))

        placed = laser_placed(frame, float(first[0]))
        if within == NEAR:
            none = (0.0, 0.0, 0.0, 1.0)
            placed["transforms"] += _transform(WORLD, NEAR, float(first[0]), offset_m, none)[
                "transforms"
            ]
        _latched(writer, f"/{TF_STATIC}", transforms)
        send(TF_STATIC, transforms, float(first[0]), placed)
        for part, time, ranges in zip(parts, first.tolist(), image, strict=True):
            if poses is not None:
                place, turn = poses.at(np.array([time]))
                moved = _transform(WORLD, frame, time, 1e-3 * place[0], turn[0])
                send("tf", transforms, time, moved)
            send(POINTS, clouds, time, point_cloud(records[part], within, time))
            send(SCAN, scans, time, laser_scan(ranges, columns, period, frame, time))


def _latched(writer: Any, topic: str, kind: Any) -> None:
    """Register a topic whose last message later readers get, too; the library has no way for it."""
    writer._channel_ids[topic] = writer._writer.register_channel(
        topic=topic,
        message_encoding="cdr",
        schema_id=kind.id,
        metadata={"offered_qos_profiles": LATCHED},
    )


def check_time(first_s: float, last_s: float) -> None:
    """Check that a stamp can have times.

    Raises:
        InputError: naming the first that it cannot have.
    """
    for time_s in (first_s, last_s):
        if not 0.0 <= time_s < MOST_S:
            raise InputError(f"time_s = {time_s:.9g}: a message's stamp has 0 to 2^31 s")


def check_frame(name: str, frame: str) -> None:
    """Check a frame_id.

    Raises:
        InputError: naming the option, if tf2 refuses it.
    """
    if not frame or frame.startswith("/"):
        raise InputError(f"{name}: must not be empty or begin with a slash ({frame!r})")


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
