"""ROS messages of a file, read with what shares no code with their writer."""

from pathlib import Path
from typing import Any


def messages(path: Path) -> dict[str, list[Any]]:
    """Return the messages of a file by topic, read by rosbags, with ROS's own definitions."""
    from rosbags.highlevel import AnyReader
    from rosbags.typesys import Stores, get_typestore

    found: dict[str, list[Any]] = {}
    with AnyReader([path], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as reader:
        for connection, logged, data in reader.messages():
            decoded = reader.deserialize(data, connection.msgtype)
            stamped = decoded if hasattr(decoded, "header") else decoded.transforms[0]
            stamp = stamped.header.stamp
            assert stamp.sec * 10**9 + stamp.nanosec == logged
            found.setdefault(connection.topic, []).append(decoded)
    return found
