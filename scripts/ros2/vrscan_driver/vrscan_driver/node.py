"""The node: connects to a board, and publishes each sweep of its mirror.

``points`` has PointCloud2, ``scan`` LaserScan and ``/tf_static`` the frame of the latter, with the
fields that ``vrscan export`` writes, stamped with this machine's time of the first point. Where the
board is gone, the node says so and connects again when it is back.
"""

import contextlib
import sys
import time
from array import array
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import rclpy
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Quaternion, Transform, TransformStamped, Vector3
from rcl_interfaces.msg import ParameterDescriptor
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import LaserScan, PointCloud2, PointField
from std_msgs.msg import Header
from std_srvs.srv import Trigger
from tf2_msgs.msg import TFMessage

from vrscan.data import config, ros
from vrscan.data.errors import EXIT_BAD_INPUT, InputError
from vrscan.data.filters import min_confidence
from vrscan.data.range_image import range_image
from vrscan.data.recordings import Clock, full_table
from vrscan.data.records import Form
from vrscan.data.table import Table, flag_bits
from vrscan.link.device import BAUD, MOST_STEP, TIMEOUT_S, Device
from vrscan.link.stream import PointStream
from vrscan.link.sweeps import HostTime, Sweeps, columns
from vrscan.link.transport import LinkError

POLL_S = 0.005  # between two looks for points
RETRY_S = 0.5  # between two attempts to connect
SILENCE = 3.0  # timeouts without a point after which the board is looked for anew
DEPTH = 10  # messages that wait for a reader
LOSS_S = 10.0  # least time between two lines about lost points

# Name, default, least and largest number, and what it is.
PARAMETERS: dict[str, tuple[Any, float, float, str]] = {
    "port": ("/dev/ttyUSB0", 0, 0, "serial port of the board, or a URL of pyserial"),
    "baud": (BAUD, 1, 1e9, "rate of the board after a reset"),
    "stream_baud": (0, 0, 1e9, "rate while points come; 0 leaves it"),
    "timeout": (TIMEOUT_S, 0.01, 3600, "seconds to wait for a reply"),
    "frame": ("vrscan", 0, 0, "frame_id of the scanner"),
    "configuration": ("", 0, 0, "the board's, a TOML file or a preset; empty: the defaults"),
    "load": (False, 0, 1, "load the configuration into the board first"),
    "start": (False, 0, 1, "start lines, laser and mirror first"),
    "step": (0, 0, MOST_STEP, "publish every n-th line; 0: as many as the serial line carries"),
    "sweeps": (1, 1, 1000, "sweeps of a message"),
    "min_confidence": (0.0, 0, 1, "least c_obj of a point"),
}
# Messages by the field in which they lie.
KINDS = {
    "header": Header,
    "stamp": Time,
    "fields": PointField,
    "transforms": TransformStamped,
    "transform": Transform,
    "translation": Vector3,
    "rotation": Quaternion,
}


def filled(kind: type[Any], fields: ros.Message) -> Any:
    """Return a message of ROS with these fields."""
    return kind(**{name: _value(name, value) for name, value in fields.items()})


def _value(name: str, value: Any) -> Any:
    if isinstance(value, dict):
        return filled(KINDS[name], value)
    if isinstance(value, bytes):  # an array is taken whole, and bytes one by one
        return array("B", value)
    if isinstance(value, list) and value and isinstance(value[0], dict):
        return [filled(KINDS[name], each) for each in value]
    return value


FIELDS = {"fields": [filled(PointField, each) for each in ros.FIELDS]}  # the same in each message


class Driver(Node):
    """The node ``vrscan``.

    Raises:
        InputError: naming the parameter, if one is out of range or its file cannot be read.
    """

    def __init__(self) -> None:
        super().__init__("vrscan")
        self._asked = {name: self._parameter(name) for name in PARAMETERS}
        ros.check_frame("frame", self._asked["frame"])
        named = self._asked["configuration"]
        self._config = config.load(Path(named) if named else None)
        self._stack = contextlib.ExitStack()  # the connection
        self._device: Device | None = None
        self._prepared = False  # configuration and start are for the first connection alone
        self._started = False
        self._retry_s = -np.inf
        self._said = ""
        self._points = self.create_publisher(PointCloud2, ros.POINTS, DEPTH)
        self._scan = self.create_publisher(LaserScan, ros.SCAN, DEPTH)
        kept = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._placed = self.create_publisher(TFMessage, f"/{ros.TF_STATIC}", kept)
        laser = ros.laser_placed(self._asked["frame"], self._now())
        self._placed.publish(filled(TFMessage, laser))
        self.create_service(Trigger, "~/start", lambda _, answer: self._obey(answer, on=True))
        self.create_service(Trigger, "~/stop", lambda _, answer: self._obey(answer, on=False))
        self.create_timer(POLL_S, self._poll)

    def close(self) -> None:
        """Stop what was started, and close the port."""
        if self._device is not None and self._started:
            with contextlib.suppress(LinkError):
                self._device.stop()
        self._disconnect()

    def _parameter(self, name: str) -> Any:
        default, least, most, text = PARAMETERS[name]
        told = ParameterDescriptor(description=text, read_only=True)
        value = self.declare_parameter(name, default, told).value
        if not isinstance(default, str) and not least <= value <= most:
            raise InputError(f"{name}: must be {least:g} to {most:g} ({value:g})")
        return value

    def _now(self) -> float:
        return 1e-9 * float(self.get_clock().now().nanoseconds)

    def _say(self, text: str) -> None:
        """Say something once, until something else happens."""
        if text != self._said:
            self._said = text
            self.get_logger().warning(text)

    # ---- the board ----

    def _poll(self) -> None:
        """Publish what has come; connect where no board answers."""
        try:
            if self._device is None:
                if time.monotonic() < self._retry_s:
                    return
                self._connect()
            self._take()
        except LinkError as error:
            self._say(f"{error}; the board is looked for")
            self._disconnect()

    def _connect(self) -> None:
        asked, first = self._asked, not self._prepared
        self._device = device = self._stack.enter_context(
            Device(asked["port"], baud=asked["baud"], timeout=asked["timeout"])
        )
        if first and asked["load"]:
            device.load(self._config, force=True)
        if asked["stream_baud"]:
            device.set_baud(asked["stream_baud"])
        if first and asked["start"]:
            self._started = True
            device.start()
        self._prepared = True
        self._stream = self._begin(device)
        self._stack.callback(lambda: self._stream.stop())
        resting = "; laser and mirror are not started again" if self._started and not first else ""
        self.get_logger().info(f"{asked['port']}: board {device.build.board_id} answers{resting}")

    def _begin(self, device: Device) -> PointStream:
        """Begin a stream of points, whose step follows from the lines' present rate."""
        asked = self._asked
        step = asked["step"] or device.least_step(Form.FULL)
        self._sweeps, self._host = Sweeps(asked["sweeps"]), HostTime()
        self._clock = Clock(device.build.clock_hz)
        self._columns = columns(self._config, step, asked["sweeps"])
        self._begun_s = np.nan  # of the last message, in the board's time
        self._heard_s = self._published_s = time.monotonic()
        self._lost = 0
        return device.stream(Form.FULL, step)

    def _disconnect(self) -> None:
        self._device, self._retry_s = None, time.monotonic() + RETRY_S
        with contextlib.suppress(LinkError):
            self._stack.close()

    def _obey(self, answer: Any, *, on: bool) -> Any:
        """Start or stop lines, laser and mirror, as a service was asked to."""
        try:
            if self._device is None:
                raise LinkError(f"{self._asked['port']}: no board answers at present")
            self._started = on
            if on:
                self._device.start()
                self._stream.stop()
                self._stream = self._begin(self._device)
            else:
                self._device.stop()
            answer.success = True
        except LinkError as error:
            answer.success, answer.message = False, str(error)
        return answer

    # ---- points ----

    def _take(self) -> None:
        """Publish the sweeps that have become whole."""
        device, stream = self._device, self._stream
        assert device is not None
        found, now = stream.get(0.0), time.monotonic()
        quiet_s = SILENCE * self._asked["timeout"]
        if found is None:
            if now - self._heard_s > quiet_s:
                reason = device.darkness() or "the board does not say why"
                raise LinkError(f"{device.port}: no point for {quiet_s:g} s: {reason}")
            return
        self._heard_s = now
        build = device.build
        points = full_table(found, build.pixel_width, self._clock, build.length_unit)
        ahead_s = self._host.ahead(float(points.time_s[-1]), self._now())
        for sweep in self._sweeps.take(points):
            self._publish(min_confidence(sweep, self._asked["min_confidence"]), ahead_s)
        if now - self._published_s > quiet_s:
            dark = device.darkness() or "nothing is seen in the laser's light"
            self._say(f"{device.port}: lines come, and no point has a place: {dark}")
        if stream.account.lost > self._lost:
            self._lost = stream.account.lost
            told = f"{device.port}: points are lost: {stream.account}"
            self.get_logger().warning(told, throttle_duration_sec=LOSS_S)

    def _publish(self, sweep: Table, ahead_s: float) -> None:
        """Publish the points of a sweep that have a place, if there are any."""
        found = sweep.of(sweep.located)
        if not len(found) or not self.context.ok():
            return
        frame, begun_s = self._asked["frame"], float(found.time_s[0])
        flags = flag_bits(found.flags, len(found))
        rows = ros.point_rows(found, 1e-3 * found.places_mm, flags, found.time_s - begun_s)
        cloud = ros.point_cloud(rows, frame, begun_s + ahead_s)
        self._points.publish(filled(PointCloud2, cloud | FIELDS))
        period_s = 0.0 if np.isnan(self._begun_s) else begun_s - self._begun_s
        inside = found.of(self._columns.inside(found.angle_rad))
        if len(inside):
            (ranges,) = range_image(inside, np.zeros(len(inside), np.int64), self._columns)
            scan = ros.laser_scan(ranges, self._columns, period_s, frame, begun_s + ahead_s)
            self._scan.publish(filled(LaserScan, scan))
        self._begun_s, self._published_s, self._said = begun_s, time.monotonic(), ""


def main(args: Sequence[str] | None = None) -> int:
    """Run the node until it is stopped; return the exit status."""
    rclpy.init(args=args)
    node: Driver | None = None
    try:
        node = Driver()
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    except InputError as error:
        print(f"vrscan_driver: {error}", file=sys.stderr)
        return EXIT_BAD_INPUT
    finally:
        if node is not None:
            node.close()
            node.destroy_node()
        rclpy.try_shutdown()
    return 0
