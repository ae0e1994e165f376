"""A recording as MCAP and its robot as URDF, for viewers such as Foxglove, PlotJuggler and Rerun.

All messages are ROS 2's own. Link frames bear the URDF's names; those of the calibrated and of the measured arm stand
behind `calibrated/` and `measured/`. `world` (`level_world` for a robot with a frame of that name) has its z axis up,
so that the robot's base is tilted as gravity says.
"""

import heapq
import shutil
import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from rosbags.interfaces import Connection, Qos, QosDurability, QosHistory, QosLiveliness, QosReliability, QosTime
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore
from rosbags.typesys.store import Typestore
from scipy.spatial.transform import Rotation

from catenary.arrays import Floats
from catenary.dynamics.kinematics import link_poses
from catenary.errors import FileFormatError, UnsupportedModelError
from catenary.files import write_atomically, written_whole
from catenary.plant import MotionLog
from catenary.recording.layout import layout_of
from catenary.recording.messages import Field, fields_of, ros2_name
from catenary.robots.geometry import Shape
from catenary.robots.model import RobotModel
from catenary.robots.urdf_export import fixed_frames, urdf_text
from catenary.spatial import LEVEL, Pose, identity_pose, quaternion_from_rotation
from catenary.view.replay import RecordedArm
from catenary.view.scene import base_orientation

POSE_SPACING = 0.02  # [s] between two poses of the links at least; joints have every row
BLOCK = 4096  # messages that are made at once
SECOND = 1_000_000_000
GRAVITY = ("gravity:x", "gravity:y", "gravity:z")
ROS2_VERSION = 8  # of what a bag says of itself
_NEVER = QosTime(0, 0)
_LATCHED = Qos(
    QosHistory.KEEP_LAST, 1, QosReliability.RELIABLE, QosDurability.TRANSIENT_LOCAL, _NEVER, _NEVER,
    QosLiveliness.AUTOMATIC, _NEVER, False,
)  # fmt: skip


class McapSummary(NamedTuple):
    """What was written."""

    file: Path
    urdf: Path | None  # None for a robot that no URDF can describe
    messages: Mapping[str, int]  # by topic
    notes: tuple[str, ...]


class _Messages(NamedTuple):
    """Messages of a topic that differ in their numbers alone."""

    topic: str
    type: str
    first: Any  # with all texts, and sequences as long as they are
    time: Floats  # (K,) [s] ascending
    numbers: Mapping[str, Floats]  # by path of a field, (K,) or (K, m)
    stamps: tuple[str, ...] = ()  # paths of stamps


def write_mcap(arm: RecordedArm, log: MotionLog, out: Path, shapes: tuple[Shape, ...] = ()) -> McapSummary:
    """Write a recording as MCAP, and its robot, of these shapes, as URDF next to it; older files are replaced.

    The rows are of the robot's joints, calibrated where there is a model; the log adds its torques and gravity.
    """
    store = get_typestore(Stores.LATEST)
    notes: list[str] = []
    try:
        description = urdf_text(arm.model, shapes)
    except UnsupportedModelError as error:
        description = None
        notes.append(f"no URDF is written: {error}")
    gravity = _gravity(log)
    if gravity is None:
        notes.append("the recording tells nothing of the base: /gravity is that of a level one")
    start = 0.0 if log.time is None else float(log.time[0])
    sets = [
        *_joints(store, arm, log),
        *_transforms(store, arm, gravity),
        _vector(store, arm, gravity),
        *([] if description is None else [_description(store, description)]),
    ]
    counts: dict[str, int] = {}
    for one in sets:
        counts[one.topic] = counts.get(one.topic, 0) + len(one.time)
    urdf = None if description is None else out.with_suffix(".urdf")
    place = out
    try:
        with tempfile.TemporaryDirectory() as folder:
            place = Path(folder)
            made = _write_bag(place / "bag", store, sets, round(start * SECOND))
            with made.open("rb") as source, written_whole(out) as file:
                shutil.copyfileobj(source, file)
    except OSError as error:
        raise FileFormatError(f"{place}: cannot be written: {error.strerror or error}") from error
    if urdf is not None and description is not None:
        write_atomically(urdf, description.encode())
    return McapSummary(out, urdf, counts, tuple(notes))


def _write_bag(folder: Path, store: Typestore, sets: list[_Messages], start: int) -> Path:
    """Write messages in the order of time [ns] as a ROS 2 bag, and return the MCAP file in it."""
    with Writer(folder, version=ROS2_VERSION, storage_plugin=StoragePlugin.MCAP) as writer:  # type: ignore[arg-type]
        connections: dict[str, Connection] = {}
        for one in sets:
            if one.topic not in connections:
                latched = [_LATCHED] if one.topic in ("/robot_description", "/tf_static") else []
                connections[one.topic] = writer.add_connection(
                    one.topic, one.type, typestore=store, offered_qos_profiles=latched
                )
        streams = [_encoded(store, one, start, place) for place, one in enumerate(sets)]
        for stamp, place, data in heapq.merge(*streams, key=lambda message: message[:2]):
            writer.write(connections[sets[place].topic], stamp, data)
    return next(folder.glob("*.mcap"))


def _encoded(store: Typestore, one: _Messages, start: int, place: int) -> Iterator[tuple[int, int, bytes]]:
    """Yield stamps [ns], the place of the set, and serialised messages."""

    def fields(name: str) -> tuple[Field, ...]:
        return fields_of(store.fielddefs[ros2_name(name)][1])

    blank = bytes(store.serialize_cdr(one.first, one.type))
    if not one.numbers:
        yield from ((start + round(t * SECOND), place, blank) for t in one.time.tolist())
        return
    layout = layout_of(one.type.replace("/msg/", "/"), blank, "cdr", fields)
    stamps = start + np.rint(one.time * SECOND).astype(np.int64)
    for first in range(0, len(stamps), BLOCK):
        rows = slice(first, first + BLOCK)
        here = stamps[rows]
        records: NDArray[np.void] = np.frombuffer(bytearray(blank * len(here)), layout)
        for path in one.stamps:
            records[f"{path}.sec"], records[f"{path}.nsec"] = here // SECOND, here % SECOND
        for path, values in one.numbers.items():
            records[path] = values[rows]
        data, size = records.tobytes(), layout.itemsize
        for k, stamp in enumerate(here.tolist()):
            yield stamp, place, data[k * size : (k + 1) * size]


def _joints(store: Typestore, arm: RecordedArm, log: MotionLog) -> list[_Messages]:
    """Return joint states: as reported, with all joints of the recording; calibrated and measured ones of the model."""

    def states(topic: str, names: tuple[str, ...], time: Floats, **columns: Floats | None) -> _Messages:
        known = {key: values for key, values in columns.items() if values is not None}
        blank = {key: np.zeros(len(names) if key in known else 0) for key in ("position", "velocity", "effort")}
        first = store.types["sensor_msgs/msg/JointState"](header=_header(store, ""), name=list(names), **blank)
        return _Messages(topic, "sensor_msgs/msg/JointState", first, time, known, ("header.stamp",))

    names, time = arm.model.joint_names, arm.time
    found = [states("/joint_states", log.joint_names, time, position=log.q_nominal, velocity=log.qd, effort=log.tau)]
    for name, rows in (("calibrated", arm.calibrated), ("measured", arm.true)):
        known = np.isfinite(rows).all(axis=1)
        if known.any():
            found.append(states(f"/{name}/joint_states", names, time[known], position=rows[known]))
    known = np.isfinite(arm.gravity_tau).all(axis=1)
    if known.any():
        found.append(states("/gravity_torque", names, time[known], effort=arm.gravity_tau[known]))
    return found


def _transforms(store: Typestore, arm: RecordedArm, gravity: Floats | None) -> list[_Messages]:
    """Return the poses of links in their parents' frames, and of what is fixed."""
    model, base = arm.model, arm.model.base
    world = "level_world" if "world" in model.frames else "world"
    chosen = np.flatnonzero(np.diff(np.floor(arm.time / POSE_SPACING + 1e-6), prepend=-1.0) != 0.0)
    fixed: list[tuple[str, str, Pose]] = []
    found: list[_Messages] = []
    for prefix, q in (("", arm.q), ("calibrated/", arm.calibrated), ("measured/", arm.true)):
        rows = chosen[np.isfinite(q[chosen]).all(axis=1)]
        if len(rows) == 0:
            continue
        if prefix:
            fixed.append((base, prefix + base, identity_pose()))
        fixed += [(prefix + frame.on, prefix + frame.name, frame.pose) for frame in fixed_frames(model)]
        found.append(_link_transforms(store, model, prefix, arm.time[rows], q[rows]))
    if gravity is None:
        fixed.append((world, base, identity_pose()))
    else:
        felt = chosen[np.isfinite(gravity[chosen]).all(axis=1)]
        wxyz = np.array([base_orientation(vector) for vector in gravity[felt]]).reshape(-1, 4)
        numbers = _pose_numbers(0, np.zeros((len(felt), 3)), np.roll(wxyz, -1, axis=1))
        found.append(_tf(store, "/tf", [(world, base)], arm.time[felt], numbers))
    at_first: dict[str, Floats] = {}
    for k, (_, _, pose) in enumerate(fixed):
        xyzw = np.roll(quaternion_from_rotation(pose.rotation), -1)
        at_first |= _pose_numbers(k, pose.position[None], xyzw[None])
    found.append(_tf(store, "/tf_static", [(a, b) for a, b, _ in fixed], np.zeros(1), at_first))
    return found


def _link_transforms(store: Typestore, model: RobotModel, prefix: str, time: Floats, q: Floats) -> _Messages:
    rotations, positions = link_poses(model, q)
    numbers: dict[str, Floats] = {}
    pairs = []
    for i, (name, parent) in enumerate(zip(model.link_names, model.tree.parent, strict=True)):
        turned, moved = rotations[:, i], positions[:, i]
        if parent >= 0:
            back = rotations[:, parent].transpose(0, 2, 1)
            turned = back @ turned
            moved = (back @ (moved - positions[:, parent])[:, :, None])[:, :, 0]
        numbers |= _pose_numbers(i, moved, Rotation.from_matrix(turned).as_quat())
        pairs.append((prefix + (model.base if parent < 0 else model.link_names[parent]), prefix + name))
    return _tf(store, "/tf", pairs, time, numbers)


def _pose_numbers(place: int, positions: Floats, xyzw: Floats) -> dict[str, Floats]:
    path = f"transforms.{place}.transform"
    found = {f"{path}.translation.{axis}": positions[:, k] for k, axis in enumerate("xyz")}
    return found | {f"{path}.rotation.{axis}": xyzw[:, k] for k, axis in enumerate("xyzw")}


def _tf(
    store: Typestore, topic: str, pairs: list[tuple[str, str]], time: Floats, numbers: Mapping[str, Floats]
) -> _Messages:
    types = store.types
    blank = types["geometry_msgs/msg/Transform"](
        translation=types["geometry_msgs/msg/Vector3"](x=0.0, y=0.0, z=0.0),
        rotation=types["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=0.0, w=1.0),
    )
    stamped = types["geometry_msgs/msg/TransformStamped"]
    parts = [stamped(header=_header(store, a), child_frame_id=b, transform=blank) for a, b in pairs]
    stamps = tuple(f"transforms.{k}.header.stamp" for k in range(len(parts)))
    first = types["tf2_msgs/msg/TFMessage"](transforms=parts)
    return _Messages(topic, "tf2_msgs/msg/TFMessage", first, time, numbers, stamps)


def _vector(store: Typestore, arm: RecordedArm, gravity: Floats | None) -> _Messages:
    rows = np.tile(LEVEL, (len(arm.time), 1)) if gravity is None else gravity
    types = store.types
    first = types["geometry_msgs/msg/Vector3Stamped"](
        header=_header(store, arm.model.base), vector=types["geometry_msgs/msg/Vector3"](x=0.0, y=0.0, z=0.0)
    )
    known = np.isfinite(rows).all(axis=1)
    numbers = {f"vector.{axis}": rows[known, k] for k, axis in enumerate("xyz")}
    return _Messages("/gravity", "geometry_msgs/msg/Vector3Stamped", first, arm.time[known], numbers, ("header.stamp",))


def _description(store: Typestore, text: str) -> _Messages:
    first = store.types["std_msgs/msg/String"](data=text)
    return _Messages("/robot_description", "std_msgs/msg/String", first, np.zeros(1), {})


def _header(store: Typestore, frame: str) -> Any:
    types = store.types
    return types["std_msgs/msg/Header"](stamp=types["builtin_interfaces/msg/Time"](sec=0, nanosec=0), frame_id=frame)


def _gravity(log: MotionLog) -> Floats | None:
    """Return gravity (N, 3) [m/s2] in the base frame; None where the recording has none."""
    if not all(name in log.signals for name in GRAVITY):
        return None
    return np.column_stack([log.signals[name] for name in GRAVITY])
