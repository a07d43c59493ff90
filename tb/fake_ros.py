"""As much of ROS 2's Python as the driver uses, where there is no ROS.

Messages take what rosidl's take, by the definitions of ROS that rosbags brings: keywords alone, and
each of its own type. What is published goes through CDR, by rosbags, and is kept as that read it.
"""

import sys
import threading
import time
from array import array
from collections.abc import Callable, Mapping
from queue import Queue
from types import ModuleType, SimpleNamespace
from typing import Any, ClassVar

import numpy as np
import pytest
from rosbags.typesys import Stores, get_typestore

STORE = get_typestore(Stores.ROS2_JAZZY)
BASE, NAME, SEQUENCE = 1, 2, 4
USED = {
    "builtin_interfaces": ["Time"],
    "geometry_msgs": ["Quaternion", "Transform", "TransformStamped", "Vector3"],
    "rcl_interfaces": ["ParameterDescriptor"],
    "sensor_msgs": ["LaserScan", "PointCloud2", "PointField"],
    "std_msgs": ["Header"],
    "tf2_msgs": ["TFMessage"],
}
FLOAT32_MOST = float(np.finfo(np.float32).max)


class Message:
    """A message; its class has the name of its type and its fields' kinds."""

    TYPE: ClassVar[str]
    KINDS: ClassVar[dict[str, Any]]

    def __init__(self, **values: Any) -> None:
        assert set(values) <= set(self.KINDS), f"{self.TYPE}: {set(values) - set(self.KINDS)}"
        for name, kind in self.KINDS.items():
            setattr(self, name, values.get(name, default(kind)))

    def __setattr__(self, name: str, value: Any) -> None:
        assert name in self.KINDS, f"{self.TYPE}: no field {name}"
        assert fits(self.KINDS[name], value), f"{self.TYPE}.{name}: {value!r}"
        object.__setattr__(self, name, value)


MADE: dict[str, type[Message]] = {}


def message(name: str) -> type[Message]:
    """Return the class of a type, such as ``std_msgs/msg/Header``."""
    if name not in MADE:
        kinds = dict(STORE.fielddefs[name][1])
        MADE[name] = type(name.rpartition("/")[2], (Message,), {"TYPE": name, "KINDS": kinds})
    return MADE[name]


def default(kind: Any) -> Any:
    node, what = int(kind[0]), kind[1]
    if node == NAME:
        return message(what)()
    if node == SEQUENCE:
        return []
    base = what[0]
    return {"string": "", "bool": False}.get(base, 0.0 if base.startswith("float") else 0)


def fits(kind: Any, value: Any) -> bool:
    """Return whether rosidl would take a value: 1 is no float there, and numpy's numbers no int."""
    node, what = int(kind[0]), kind[1]
    if node == NAME:
        return type(value) is message(what)
    if node == SEQUENCE:
        if isinstance(value, array):
            return int(what[0][0]) == BASE and value.typecode == np.dtype(what[0][1][0]).char
        return isinstance(value, list) and all(fits(what[0], each) for each in value)
    base = what[0]
    if base in ("string", "bool"):
        return isinstance(value, str if base == "string" else bool)
    if base.startswith("float"):
        return isinstance(value, float) and not FLOAT32_MOST < abs(value) < np.inf
    most = np.iinfo(base)
    return type(value) is int and most.min <= value <= most.max


def native(sent: Message) -> Any:
    """Return a message as rosbags has it."""

    def of(kind: Any, value: Any) -> Any:
        node, what = int(kind[0]), kind[1]
        if node == NAME:
            return native(value)
        if node == SEQUENCE and int(what[0][0]) == BASE:
            return np.array(value, what[0][1][0])
        if node == SEQUENCE:
            return [of(what[0], each) for each in value]
        return value

    fields = {name: of(kind, getattr(sent, name)) for name, kind in sent.KINDS.items()}
    return STORE.types[sent.TYPE](**fields)


class Publisher:
    """Keeps what is published as a reader of its CDR sees it."""

    def __init__(self, kind: type[Message], topic: str, qos: Any) -> None:
        self.kind, self.topic, self.qos = kind, topic, qos
        self.sent: list[Any] = []

    def publish(self, sent: Message) -> None:
        assert type(sent) is self.kind
        data = STORE.serialize_cdr(native(sent), sent.TYPE)
        self.sent.append(STORE.deserialize_cdr(data, sent.TYPE))


class Ros:
    """ROS, with one node at most.

    Attributes:
        given: Values of parameters that the user gives.
        node: The node, once there is one.
        now_s: The time of its clock.
    """

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.given: Mapping[str, Any] = {}
        self.node: Any = None
        self.now_s: Callable[[], float] = time.time
        self.stopped = threading.Event()
        self.inits = 0
        self._calls = Queue[tuple[str, Queue[Any]]]()
        for name, module in self._modules().items():
            monkeypatch.setitem(sys.modules, name, module)

    def ok(self) -> bool:
        return self.inits > 0 and not self.stopped.is_set()

    def _modules(self) -> dict[str, ModuleType]:
        ros = self

        class Node:
            def __init__(self, node_name: str) -> None:
                assert ros.ok() and ros.node is None
                ros.node = self
                self.name, self.context = node_name, SimpleNamespace(ok=ros.ok)
                self.parameters: dict[str, Any] = {}
                self.publishers: dict[str, Publisher] = {}
                self.services: dict[str, Callable[[Any, Any], Any]] = {}
                self.timers: list[tuple[float, Callable[[], None]]] = []
                self.said: list[str] = []
                self.destroyed = False

            def declare_parameter(self, name: str, value: Any, descriptor: Any = None) -> Any:
                assert name not in self.parameters
                assert type(descriptor) is message("rcl_interfaces/msg/ParameterDescriptor")
                assert descriptor.description and descriptor.read_only
                found = ros.given.get(name, value)
                assert type(found) is type(value), f"{name}: {found!r}"  # InvalidParameterType
                self.parameters[name] = value
                return SimpleNamespace(name=name, value=found)

            def create_publisher(self, msg_type: Any, topic: str, qos_profile: Any) -> Publisher:
                assert topic not in self.publishers
                self.publishers[topic] = Publisher(msg_type, topic, qos_profile)
                return self.publishers[topic]

            def create_service(self, srv_type: Any, srv_name: str, callback: Any) -> None:
                assert srv_type is Trigger
                self.services[srv_name] = callback

            def create_timer(self, timer_period_sec: float, callback: Any) -> None:
                self.timers.append((timer_period_sec, callback))

            def get_logger(self) -> Any:
                def say(text: str, throttle_duration_sec: float = 0.0) -> None:
                    self.said.append(text)

                return SimpleNamespace(info=say, warning=say, error=say)

            def get_clock(self) -> Any:
                return SimpleNamespace(
                    now=lambda: SimpleNamespace(nanoseconds=round(1e9 * ros.now_s()))
                )

            def destroy_node(self) -> None:
                self.destroyed = True

        class Trigger:
            pass

        def init(*, args: Any = None) -> None:
            self.inits += 1

        def spin(node: Node) -> None:
            """As rclpy's: one thread calls everything, and it returns at the end of ROS."""
            while self.ok():
                for period, callback in node.timers:
                    callback()
                    time.sleep(period)
                while not self._calls.empty():
                    name, reply = self._calls.get()
                    answer = SimpleNamespace(success=False, message="")
                    reply.put(node.services[name](None, answer))

        def try_shutdown() -> None:
            self.stopped.set()

        parts: dict[str, dict[str, Any]] = {
            "rclpy": {"init": init, "spin": spin, "try_shutdown": try_shutdown, "ok": self.ok},
            "rclpy.node": {"Node": Node},
            "rclpy.executors": {
                "ExternalShutdownException": type("ExternalShutdownException", (Exception,), {})
            },
            "rclpy.qos": {
                "QoSProfile": SimpleNamespace,
                "DurabilityPolicy": SimpleNamespace(TRANSIENT_LOCAL="transient local"),
            },
            "std_srvs.srv": {"Trigger": Trigger},
        }
        for package, names in USED.items():
            parts[f"{package}.msg"] = {n: message(f"{package}/msg/{n}") for n in names}
        parts |= {
            name.partition(".")[0]: {} for name in parts if name.partition(".")[0] not in parts
        }
        found = {}
        for name, held in parts.items():
            found[name] = ModuleType(name)
            vars(found[name]).update(held)
        return found

    def call(self, name: str) -> Any:
        """Call a service, from another thread than the node's, and return its answer."""
        reply = Queue[Any]()
        self._calls.put((name, reply))
        return reply.get(timeout=60.0)
