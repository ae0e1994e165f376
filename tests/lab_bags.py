"""Bags as other laboratories record them, written by rosbags alone, with the truth known."""

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, Literal

import numpy as np
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

Kind = Literal["ros1", "sqlite", "mcap"]
KINDS: tuple[Kind, ...] = ("ros1", "sqlite", "mcap")
START = 1_700_000_000_000_000_000  # [ns]
JOINTS = ("outer_yaw", "outer_pitch", "outer_insertion")
LATE = 2_000_000  # [ns] from a stamp to its message's arrival
Message = tuple[float, str, Callable[[Any, Any], Any]]  # time [s], topic, what makes the message


def true_q(time: Any) -> np.ndarray:
    """Where the joints are, (N, 3) [rad, rad, m]."""
    t = np.asarray(time)
    return np.stack([0.5 * np.sin(t), 0.4 * np.sin(1.3 * t + 0.3), 0.12 + 0.03 * np.sin(0.7 * t)], axis=-1)


def write_bag(
    path: Path,
    kind: Kind,
    topics: dict[str, str],
    messages: Iterable[Message],
    *,
    late: dict[str, int] | None = None,
    types: dict[str, str] | None = None,
) -> Path:
    """Write messages in order of time; `topics` are types by topic, `late` how long each one's are on their way [ns].

    `types` are the definitions of types that ROS does not have, by their names.
    """
    ros1 = kind == "ros1"
    store = get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.ROS2_HUMBLE)
    own = {"tf2_msgs/msg/TFMessage": "geometry_msgs/TransformStamped[] transforms"} | (types or {})
    for name, text in own.items():
        if name not in store.types:
            store.register(get_types_from_msg(text, name))
    plugin = StoragePlugin.MCAP if kind == "mcap" else StoragePlugin.SQLITE3
    path = path.with_suffix(".bag") if ros1 else path
    writer = Writer1(path) if ros1 else Writer2(path, version=8, storage_plugin=plugin)
    serialise = store.serialize_ros1 if ros1 else store.serialize_cdr
    with writer:
        connections = {topic: writer.add_connection(topic, name, typestore=store) for topic, name in topics.items()}
        for time, topic, make in sorted(messages, key=lambda message: message[0]):
            stamp = START + round(time * 1e9)
            message = make(store, header(store, stamp, ros1=ros1))
            writer.write(connections[topic], stamp + (late or {}).get(topic, LATE), serialise(message, topics[topic]))
    return path


def header(store: Any, stamp: int, *, ros1: bool) -> Any:
    time = store.types["builtin_interfaces/msg/Time"](stamp // 10**9, stamp % 10**9)
    extra = {"seq": 0} if ros1 else {}
    return store.types["std_msgs/msg/Header"](stamp=time, frame_id="base", **extra)


def joint_state(
    names: Iterable[str], q: Any, qd: Any = (), tau: Any = (), *, stamped: bool = True
) -> Callable[[Any, Any], Any]:
    """What makes a JointState."""

    def make(store: Any, head: Any) -> Any:
        if not stamped:
            head.stamp = store.types["builtin_interfaces/msg/Time"](0, 0)
        arrays = (np.asarray(values, dtype=np.float64) for values in (q, qd, tau))
        return store.types["sensor_msgs/msg/JointState"](head, list(names), *arrays)

    return make


def pose(position: Any, quaternion_wxyz: Any) -> Callable[[Any, Any], Any]:
    """What makes a PoseStamped."""

    def make(store: Any, head: Any) -> Any:
        types = store.types
        w, x, y, z = map(float, quaternion_wxyz)
        point = types["geometry_msgs/msg/Point"](*map(float, position))
        turned = types["geometry_msgs/msg/Quaternion"](x, y, z, w)
        return types["geometry_msgs/msg/PoseStamped"](head, types["geometry_msgs/msg/Pose"](point, turned))

    return make


JOINT_STATE = "sensor_msgs/msg/JointState"
POSE = "geometry_msgs/msg/PoseStamped"


def two_topics(path: Path, kind: Kind, *, seconds: float = 10.0, error: float = 0.02) -> Path:
    """A command at 100 Hz, and a camera's joints in its own order at 30 Hz, from 1 s on."""
    messages: list[Message] = []
    for t in np.arange(0.0, seconds, 0.01):
        messages.append((t, "/raven/joint_cmd", joint_state(JOINTS, true_q(t))))
    for t in np.arange(1.0, seconds - 1.0, 1 / 30):
        order = [2, 0, 1] if int(t) % 2 else [1, 2, 0]
        names = [JOINTS[i] for i in order]
        messages.append((t, "/optitrack/joints", joint_state(names, (true_q(t) + error)[order])))
    return write_bag(path, kind, {"/raven/joint_cmd": JOINT_STATE, "/optitrack/joints": JOINT_STATE}, messages)
