"""Messages that a robot sends every millisecond, as ROS 1's bytes in which only stamps and numbers change.

A frame is a message with its length in front, as it goes over a socket. A server sends the same few messages for ever,
and in each only a stamp and some numbers differ, so making each anew takes more of a tick than all the physics. A frame
says where its numbers lie, and which they are of all that a server writes (`sheet.Sheet`). All of them begin with a
header; its `seq` is written by whoever sends them.
"""

import struct
from typing import NamedTuple

import numpy as np

from catenary.crtk.clock import SECOND
from catenary.crtk.message import Message, header, message_class
from catenary.crtk.wire import codec
from catenary.errors import InputError
from catenary.plant import OperatingState
from catenary.recording.messages import NUMBERS, TIMES, Field, fields

LENGTH = struct.Struct("<I")
SEQ, SEQ_AT, SEQ_MOST = struct.Struct("<I"), 4, 2**32 - 1  # where a frame holds its header's seq
STAMP_AT = 8
STAMP = slice(STAMP_AT, STAMP_AT + 8)  # and its stamp
_STAMP = struct.Struct("<II")
_DOUBLE = 8  # bytes
KINDS = ("<f8", "<f4", "<i4")  # types of numbers that are written


class Numbers(NamedTuple):
    """Numbers of a frame that change from tick to tick."""

    place: int  # byte of the frame at which they begin
    kind: str  # one of KINDS; whole numbers are truncated
    source: int  # the first of them among the numbers that are written
    many: int
    factor: float = 1.0  # from those numbers to the message's
    plus: int | None = None  # the first of others that are added to them before


class Frame(NamedTuple):
    """A message, and what of it changes."""

    content: bytes
    numbers: tuple[Numbers, ...] = ()
    room: int = 0  # bytes that another content may have, where that is more


def stamp_bytes(stamp: int) -> bytes:
    """Give a stamp [ns] as a header holds it."""
    return _STAMP.pack(*divmod(stamp, SECOND))


def frame_of(type_name: str, message: Message) -> bytearray:
    """Give a message of a type with its length in front.

    Raises:
        InputError: A value does not fit its field.
    """
    data = codec(type_name).encode(message, 0)
    return bytearray(LENGTH.pack(len(data)) + data)


def joint_state_frame(
    names: tuple[str, ...], source: int, step: int, frame_id: str = "", *, parts: str = "qvt"
) -> Frame:
    """Give a sensor_msgs/JointState of the same joints for ever.

    Args:
        names: The joints.
        source: Where the positions begin among the numbers that are written.
        step: From there to the velocities, and from those to the efforts.
        frame_id: Of its header.
        parts: Which it has: positions q, velocities v, efforts t; the others are left empty.
    """
    n = len(names)
    given = [part in parts for part in "qvt"]
    values = [np.zeros(n if there else 0) for there in given]
    content = bytes(
        frame_of(
            "sensor_msgs/JointState",
            message_class("sensor_msgs/JointState")(header(0, frame_id), names, *values),
        )
    )
    # they come last, each behind its count
    place, numbers = len(content) - sum(LENGTH.size + value.nbytes for value in values), []
    for k, there in enumerate(given):
        place += LENGTH.size
        if there:
            numbers.append(Numbers(place, "<f8", source + k * step, n))
            place += _DOUBLE * n
    return Frame(content, tuple(numbers))


def pose_frame(source: int, frame_id: str, child: str | None = None) -> Frame:
    """Give a PoseStamped, or a TransformStamped where there is a child: x, y, z [m], unit quaternion x, y, z, w."""
    name = "geometry_msgs/PoseStamped" if child is None else "geometry_msgs/TransformStamped"
    named = {} if child is None else {"child_frame_id": child}
    return _ends_in_numbers(name, message_class(name)(header(0, frame_id), **named), source, 7)


def twist_frame(source: int, frame_id: str) -> Frame:
    """Give a TwistStamped: three numbers [m/s] and three [rad/s]."""
    name = "geometry_msgs/TwistStamped"
    return _ends_in_numbers(name, message_class(name)(header(0, frame_id)), source, 6)


def _ends_in_numbers(type_name: str, message: Message, source: int, count: int) -> Frame:
    content = bytes(frame_of(type_name, message))
    return Frame(content, (Numbers(len(content) - _DOUBLE * count, "<f8", source, count),))


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


class NumberFields:
    """Where the numbers of a message's fields lie in its frame."""

    def __init__(self, type_name: str, message: Message) -> None:
        """Take a message of a type whose fields behind the header are numbers, times, or arrays of fixed length."""
        self._name = type_name
        head, *rest = fields(type_name)
        place = LENGTH.size + len(codec(head.type).encode(message[0], 0))
        self._fields: dict[str, tuple[int, Field]] = {}
        for field in rest:
            self._fields[field.name] = place, field
            place += _size(field)

    def numbers(
        self, name: str, source: int, count: int = 1, *, first: int = 0, factor: float = 1.0
    ) -> Numbers:
        """Give `count` numbers of a field, from its `first` on.

        Raises:
            InputError: There is no such field of numbers, or it has fewer.
        """
        place, field = self._fields.get(name, (0, Field(name, "", 0)))
        kind = NUMBERS.get(field.type)
        if kind not in KINDS or first + count > (field.length or 1):
            raise InputError(
                f"{self._name}: expected a field {name} of at least {first + count} numbers, each one of "
                f"{', '.join(KINDS)}"
            )
        return Numbers(place + first * np.dtype(kind).itemsize, kind, source, count, factor)


def _size(field: Field) -> int:
    """Bytes of a field of numbers or times."""
    number = 8 if field.type in TIMES else np.dtype(NUMBERS[field.type]).itemsize
    return number * (field.length or 1)
