"""Messages that a robot sends every millisecond, kept as ROS 1's bytes: only what changes is written into them.

A frame is a message with its length in front, as it goes over a socket. A server sends the same few messages for ever,
and in each only a stamp and some numbers differ, so making each anew takes more of a tick than all the physics. All of
them begin with a header; its `seq` is written by the publisher (`Publisher.publish_frame`).
"""

import struct
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catenary.arrays import Floats
from catenary.crtk.clock import SECOND
from catenary.crtk.message import Message, header, message_class
from catenary.crtk.wire import codec
from catenary.errors import InputError
from catenary.plant import OperatingState
from catenary.recording.messages import NUMBERS, TIMES, Field, fields

LENGTH = struct.Struct("<I")
SEQ, SEQ_AT, SEQ_MOST = struct.Struct("<I"), 4, 2**32 - 1  # where a frame holds its header's seq
STAMP = slice(8, 16)  # and its stamp
_STAMP = struct.Struct("<II")


def stamp_bytes(stamp: int) -> bytes:
    """Give a stamp [ns] as a header holds it."""
    return _STAMP.pack(*divmod(stamp, SECOND))


def frame_of(type_name: str, message: Message) -> bytearray:
    """Give a message of a type as a frame.

    Raises:
        InputError: A value does not fit its field.
    """
    data = codec(type_name).encode(message, 0)
    return bytearray(LENGTH.pack(len(data)) + data)


class JointStateFrame:
    """A sensor_msgs/JointState of the same joints for ever."""

    __slots__ = ("_effort", "_position", "_velocity", "bytes")

    def __init__(self, names: tuple[str, ...], frame_id: str = "") -> None:
        """Prepare for joints."""
        n = len(names)
        zeros = np.zeros(n)
        message = message_class("sensor_msgs/JointState")(header(0, frame_id), names, zeros, zeros, zeros)
        self.bytes = frame_of("sensor_msgs/JointState", message)
        # the numbers come last: three times a count and n of them
        places = (len(self.bytes) - k * (4 + 8 * n) + 4 for k in (3, 2, 1))
        self._position, self._velocity, self._effort = (
            np.frombuffer(self.bytes, "<f8", n, place) for place in places
        )

    def fill(self, q: Floats | float, qd: Floats | float, tau: Floats | float) -> None:
        """Write positions, velocities and efforts, each (n,), or a number of a single joint."""
        self._position[:] = q
        self._velocity[:] = qd
        self._effort[:] = tau


class NumbersFrame:
    """A message that ends in numbers, all of which change: a pose, a velocity."""

    __slots__ = ("_pack", "_place", "bytes")

    def __init__(self, type_name: str, message: Message, count: int) -> None:
        """Prepare a message whose last `count` numbers change."""
        numbers = struct.Struct(f"<{count}d")
        self.bytes = frame_of(type_name, message)
        self._place = len(self.bytes) - numbers.size
        self._pack = numbers.pack_into

    def fill(self, *numbers: float) -> None:
        """Write the numbers."""
        self._pack(self.bytes, self._place, *numbers)


def pose_frame(frame_id: str, child: str | None = None) -> NumbersFrame:
    """Give a frame of poses: x, y, z [m], unit quaternion x, y, z, w; a TransformStamped where there is a child."""
    name = "geometry_msgs/PoseStamped" if child is None else "geometry_msgs/TransformStamped"
    named = {} if child is None else {"child_frame_id": child}
    return NumbersFrame(name, message_class(name)(header(0, frame_id), **named), 7)


def twist_frame(frame_id: str) -> NumbersFrame:
    """Give a frame of velocities, three numbers [m/s] and three [rad/s]."""
    name = "geometry_msgs/TwistStamped"
    return NumbersFrame(name, message_class(name)(header(0, frame_id)), 6)


class OperatingStateFrames:
    """A crtk_msgs/OperatingState for each of the few states that there are."""

    def __init__(self) -> None:
        self._frames: dict[OperatingState, bytearray] = {}

    def frame(self, state: OperatingState) -> bytearray:
        """Give the frame of a state."""
        found = self._frames.get(state)
        if found is None:
            made = message_class("crtk_msgs/OperatingState")(header(0), *state)
            found = self._frames[state] = frame_of("crtk_msgs/OperatingState", made)
        return found


def number_view(frame: bytearray, type_name: str, message: Message, names: tuple[str, ...]) -> NDArray[Any]:
    """Give a view of fields in a message's frame, one row for each: (len(names), width of a field).

    Args:
        frame: As `frame_of` made it.
        type_name: A type whose fields behind the header are numbers, times, or arrays of numbers of fixed length.
        message: What the frame was made of; its header says where the numbers begin.
        names: Fields that follow each other, of the same type and width.

    Raises:
        InputError: They do not.
    """
    head, *rest = fields(type_name)
    begin = [field.name for field in rest].index(names[0])
    chosen = rest[begin : begin + len(names)]
    kinds = {(field.type, field.length) for field in chosen}
    if tuple(field.name for field in chosen) != names or len(kinds) != 1:
        raise InputError(f"{type_name}: {', '.join(names)} are no fields of one type that follow each other")
    place = LENGTH.size + len(codec(head.type).encode(message[0], 0)) + sum(map(_size, rest[:begin]))
    kind, width = np.dtype(NUMBERS[chosen[0].type]), chosen[0].length or 1
    return np.ndarray((len(names), width), kind, frame, place)


def _size(field: Field) -> int:
    """Bytes of a field of numbers or times."""
    number = 8 if field.type in TIMES else np.dtype(NUMBERS[field.type]).itemsize
    return number * (field.length or 1)
