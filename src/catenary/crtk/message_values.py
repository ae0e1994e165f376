"""Messages to what catenary computes with, and back: joint states by name, poses, operating states, stamps.

The RAVEN-II's own `raven_state` is in `reader`.
"""

import logging
from functools import lru_cache
from math import hypot
from typing import cast, get_args

import numpy as np
from numpy.typing import ArrayLike

from catenary.arrays import Floats, as_array
from catenary.crtk.message import Message, header, message_class
from catenary.crtk.transport import Clock
from catenary.errors import InputError
from catenary.plant import JointState, OperatingState, StateName
from catenary.spatial import Pose, quaternion_of_rows, rotation_from_quaternion
from catenary.topics import SECOND

_Point, _Quaternion, _Vector3, _Pose, _Transform, _PoseStamped, _TransformStamped = (
    message_class(f"geometry_msgs/{name}")
    for name in ("Point", "Quaternion", "Vector3", "Pose", "Transform", "PoseStamped", "TransformStamped")
)
_NUMBERS = ("position", "velocity", "effort")
_CLOCK_LEAP_NS = SECOND // 2  # [ns] by which a clock has to be set for stamps to leap back with it
_logger = logging.getLogger(__name__)


def joint_state_message(
    names: tuple[str, ...], stamp: int, position: ArrayLike = (), velocity: ArrayLike = (), effort: ArrayLike = ()
) -> Message:
    """Return a sensor_msgs/JointState.

    Args:
        names, stamp: Joint names, and time [ns].
        position, velocity, effort: (n,) [rad|m], [rad/s|m/s], [Nm|N]; empty to leave it out.
    """
    values = []
    for field, numbers in zip(_NUMBERS, (position, velocity, effort), strict=True):
        array = as_array(field, numbers, (None,))
        if len(array) not in (0, len(names)):
            raise InputError(f"{field}: expected {len(names)} numbers, one per joint, got {len(array)}")
        values.append(array)
    return message_class("sensor_msgs/JointState")(header(stamp), names, *values)


def named_joints(message: Message, names: tuple[str, ...]) -> tuple[str, ...]:
    """Return the joints of ours that a sensor_msgs/JointState names, in its order."""
    return tuple(name for name in _own_names(tuple(message.name[: 2 * len(names)]), names) if name in names)


def joint_values(
    message: Message, names: tuple[str, ...], field: str = "position", *, unnamed: Floats | None = None
) -> Floats:
    """Return the numbers (n,) of a sensor_msgs/JointState in the order of our joints.

    Numbers go to the joints of their names, a RAVEN-II's own (gold_ins, of either arm) too; without names the first n
    count, in our order, as the RAVEN-II takes them.

    Args:
        message, names: The message, and our joints.
        field: "position", "velocity" or "effort".
        unnamed: Numbers of joints that are not named (n,); None refuses them.
    """
    values = as_array(f"JointState.{field}", getattr(message, field), (None,))
    named = tuple(message.name)
    if named and named != names and len(named) <= 2 * len(names):
        named = _own_names(named, names)
    if len(named) > 2 * len(names):  # no need to compare so many one by one
        raise InputError(f"JointState.name: {len(named)} names, expected {', '.join(names)}")
    if not named:
        if len(values) < len(names):
            raise InputError(
                f"JointState.{field}: {len(values)} numbers without names, expected {len(names)}: {', '.join(names)}"
            )
        return values[: len(names)]
    if len(values) != len(named):
        raise InputError(f"JointState.{field}: {len(values)} numbers for {len(named)} names {', '.join(named)}")
    if named == names:
        return values
    by_name = dict(zip(named, values, strict=True))
    unknown = [name for name in named if name not in names]
    absent = [] if unnamed is not None else [name for name in names if name not in by_name]
    twice = sorted({name for name in named if named.count(name) > 1})
    if unknown or absent or twice:
        faults = [("unknown", unknown), ("missing", absent), ("given twice", twice)]
        text = "; ".join(f"{fault}: {', '.join(which)}" for fault, which in faults if which)
        raise InputError(f"JointState.name: {text}; the joints are {', '.join(names)}")
    if unnamed is not None:
        by_name = dict(zip(names, unnamed, strict=True)) | by_name
    return np.array([by_name[name] for name in names])


@lru_cache(maxsize=64)
def _own_names(named: tuple[str, ...], names: tuple[str, ...]) -> tuple[str, ...]:
    """Return names of a message as ours where they are a RAVEN-II's: gold_ins for insertion, whichever arm's it is."""
    own = []
    for name in named:
        short = name.removeprefix("gold_").removeprefix("green_")
        short = "insertion" if short == "ins" else short
        own.append(short if name not in names and short in names else name)
    return tuple(own)


def joint_state(
    message: Message, names: tuple[str, ...], *, gravity: ArrayLike, gravity_age: float = np.inf
) -> JointState:
    """Return a sensor_msgs/JointState's, NaN if it has none; gravity (3,) [m/s2] is `gravity_age` [s] old."""
    q = joint_values(message, names)
    qd, tau = (
        joint_values(message, names, field) if len(getattr(message, field)) else np.full(len(names), np.nan)
        for field in ("velocity", "effort")
    )
    down = as_array("gravity", gravity, (3,))
    return JointState(message.header.stamp / SECOND, q, qd, tau, np.zeros(0), down, gravity_age)


def pose_message(pose: Pose, stamp: int, frame_id: str, *, child: str | None = None) -> Message:
    """Return a geometry_msgs/PoseStamped, or a TransformStamped, as older CRTK has it.

    Args:
        pose, stamp: Pose, and time [ns].
        frame_id, child: Frame that the pose is in; for a TransformStamped, frame whose pose it is.
    """
    quaternion = _Quaternion(*quaternion_of_rows(pose.rotation.tolist()))
    place = pose.position.tolist()
    if child is None:
        return _PoseStamped(header(stamp, frame_id), _Pose(_Point(*place), quaternion))
    return _TransformStamped(header(stamp, frame_id), child, _Transform(_Vector3(*place), quaternion))


def pose_of(message: Message) -> Pose:
    """Return the pose of a geometry_msgs/PoseStamped or TransformStamped."""
    if isinstance(message, _PoseStamped):
        place, turn = message.pose
    elif isinstance(message, _TransformStamped):
        place, turn = message.transform
    else:
        raise InputError(f"expected a PoseStamped or a TransformStamped, got {type(message).__name__}")
    return Pose(rotation_of(turn), as_array("position", tuple(place), (3,)))


def rotation_of(turn: Message) -> Floats:
    """Return the rotation matrix (3, 3) of a geometry_msgs/Quaternion, which is normalised."""
    quaternion = as_array("quaternion", (turn.w, turn.x, turn.y, turn.z), (4,))
    length = hypot(*quaternion.tolist())
    if abs(length - 1.0) > 0.01:
        raise InputError(f"quaternion (w, x, y, z) {quaternion.tolist()}: expected length 1, got {length:.3g}")
    return rotation_from_quaternion(quaternion)


def operating_state_message(state: OperatingState, stamp: int) -> Message:
    """Return a crtk_msgs/OperatingState, which is also what the RAVEN-II calls operating_state."""
    return message_class("crtk_msgs/OperatingState")(
        header(stamp), state.state, bool(state.is_homed), bool(state.is_busy)
    )


def operating_state(message: Message) -> OperatingState:
    """Return the operating state of a crtk_msgs/OperatingState."""
    if message.state not in get_args(StateName):
        raise InputError(f'operating state "{message.state}": expected {", ".join(get_args(StateName))}')
    return OperatingState(cast(StateName, message.state), message.is_homed, message.is_busy)


def command_message(command: str, stamp: int) -> Message:
    """Return a crtk_msgs/StringStamped that asks for a transition of the operating state."""
    return message_class("crtk_msgs/StringStamped")(header(stamp), command)


class Stamps:
    """Stamps of the time of day that strictly increase, as CRTK's clients demand.

    Where the clock is set back by up to half a second, they go at half speed until they are at it again; a larger step,
    either way, they follow at once, and it is logged.
    """

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._set, self._time, self._last = clock.set_by(), 0, 0  # [ns]

    def next(self, time: int) -> int:
        """Return the stamp [ns] of what happened at a time [ns] by the clock's `steady`."""
        by = self._clock.set_by()
        ahead = self._set - by
        if abs(ahead) > _CLOCK_LEAP_NS:
            _logger.warning("the clock was set by %+.3f s; stamps follow it", -ahead / SECOND)
            self._last = time + by - 1
        elif ahead > 0:
            by = self._set - min(ahead, max(0, time - self._time) // 2)
        self._set, self._time = by, time
        self._last = max(time + by, self._last + 1)
        return self._last
