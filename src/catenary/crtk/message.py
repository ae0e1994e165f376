"""Messages as Python sees them: one immutable tuple type per message type, made from recording's definitions.

Fields have ROS's names. A time or duration is a whole number of nanoseconds; a string is a `str`; `string[]` and
arrays of messages are tuples; arrays of numbers are NumPy arrays. Messages are the same over every transport.

ROS 1's bytes of a message and ROS 2's (CDR) are made and read by rosbags. Before it writes them, values become what it
takes, and what NumPy would convert without a word is refused.
"""

import struct
from collections import namedtuple
from collections.abc import Callable, Iterator
from functools import cache, lru_cache
from operator import attrgetter
from typing import Any, NamedTuple

import numpy as np
from rosbags.serde import SerdeError

from catenary.errors import FileFormatError, InputError
from catenary.recording.messages import MESSAGES, NUMBERS, TIMES, Field, current_name, fields, ros2_name, typestore
from catenary.topics import SECOND

# made at run time, so mypy sees no fields; `MESSAGES` says which there are
Message = Any
HEADER = "std_msgs/Header"
_MISFIT_ERRORS = (  # what rosbags raises of bytes, and of values, that do not fit
    SerdeError, struct.error, TypeError, ValueError, OverflowError, AttributeError, LookupError, AssertionError,
)  # fmt: skip
MESSAGE_BYTES = 2**26  # bytes of any message: beyond, a length is taken for nonsense
_COUNT = struct.Struct("<I")  # of a header's `seq`, of an array's numbers
_JOINT_STATE = "sensor_msgs/JointState"
_Change = Callable[[Any], Any]


@cache
def message_class(name: str) -> Any:
    """Return the tuple type of a message type, such as crtk_msgs/StringStamped; what is not given is zero or empty."""
    if current_name(name) != name:
        return message_class(current_name(name))
    parts = fields(name)
    make: Any = namedtuple  # its checkers want literals
    made = make(name.rpartition("/")[2], [field.name for field in parts], defaults=[_default(field) for field in parts])
    made.__doc__ = f"{name}: {', '.join(f'{field.type} {field.name}' for field in parts)}"
    return made


def header(stamp: int, frame_id: str = "") -> Message:
    """Return a message header; `seq` is counted by the publisher.

    Args:
        stamp, frame_id: Time [ns], and frame of the message's numbers.
    """
    return message_class(HEADER)(0, stamp, frame_id)


def has_header(name: str) -> bool:
    """Return True if a type begins with a header."""
    parts = fields(name)
    return bool(parts) and parts[0].type == HEADER and parts[0].length is None


def stamp_of(message: Message) -> int | None:
    """Return the stamp [ns] of a message's header, or None if it has no header."""
    first = message[0] if message else None
    return first.stamp if isinstance(first, message_class(HEADER)) else None


def message_fields(name: str, message: Message) -> Iterator[tuple[Field, Any]]:
    """Return the fields of a message with their values."""
    if not isinstance(message, message_class(name)):
        raise InputError(f"expected a message {current_name(name)}, got {type(message).__name__}: {message!r}")
    return zip(fields(name), message, strict=True)


def _default(field: Field) -> Any:
    if field.type in NUMBERS:
        if field.length is not None:
            zeros = np.zeros(field.length, dtype=NUMBERS[field.type])
            zeros.setflags(write=False)  # shared by all messages that do not give it
            return zeros
        return False if field.type == "bool" else 0.0 if field.type.startswith("float") else 0
    if field.length is not None:
        single = _default(field._replace(length=None))
        return (single,) * field.length
    if field.type in TIMES:
        return 0
    if field.type in MESSAGES:
        return message_class(field.type)()
    return ""


class Encoding(NamedTuple):
    """Differences between the encodings of ROS 1 and ROS 2."""

    ros: int
    front: bytes


ROS1 = Encoding(1, b"")
CDR = Encoding(2, b"\0\1\0\0")  # little-endian, no options


class Codec(NamedTuple):
    """Codec between messages of one type and bytes."""

    encode: Callable[..., bytes]  # message, and for ROS 1 the number that goes into the header's `seq`
    decode: Callable[[bytes], Message]


class _Time(NamedTuple):
    sec: int
    nanosec: int


class _Empty(NamedTuple):
    """ROS 2's member of a type that has none."""

    structure_needs_at_least_one_member: int = 0


@cache
def codec(name: str, encoding: Encoding = ROS1) -> Codec:
    """Return the codec of a message type, or a service's Request or Response; its InputError names the field.

    Args:
        encoding: Encoding of ROS 1, or CDR of ROS 2.
    """
    if current_name(name) != name:
        return codec(current_name(name), encoding)
    kind, write, finish = message_class(name), _writer(name, encoding), _completion(name, encoding)
    store, rosbags_name, numbered = typestore(encoding.ros), ros2_name(name), encoding is ROS1 and has_header(name)
    read = store.deserialize_ros1 if encoding is ROS1 else store.deserialize_cdr

    def encode(message: Message, seq: int = 0) -> bytes:
        if type(message) is not kind:
            message_fields(name, message)  # says what it is instead
        try:
            data = write(message)
        except _MISFIT_ERRORS as error:
            raise InputError(f"{name}: {_misfit(name, message, encoding) or error}") from error
        return _COUNT.pack(seq % 2**32) + data[_COUNT.size :] if numbered else data

    def decode(data: bytes) -> Message:
        try:
            return finish(read(data, rosbags_name))
        except _MISFIT_ERRORS as error:
            raise FileFormatError(f"{name}: {len(data)} bytes are no such message ({error})") from error

    return Codec(encode, decode)


@cache
def _writer(name: str, encoding: Encoding) -> Callable[[Message], bytes]:
    """Return the serialiser of a message type; it raises NO_MESSAGE for values that do not fit."""
    return _joint_state_writer(encoding) if name == _JOINT_STATE else _rosbags_writer(name, encoding)


def _rosbags_writer(name: str, encoding: Encoding) -> Callable[[Message], bytes]:
    store, rosbags_name, prepare = typestore(encoding.ros), ros2_name(name), _preparation(name, encoding)
    if encoding is ROS1:
        return lambda message: bytes(store.serialize_ros1(prepare(message), rosbags_name))
    return lambda message: bytes(store.serialize_cdr(prepare(message), rosbags_name, little_endian=True))


def _joint_state_writer(encoding: Encoding) -> Callable[[Message], bytes]:
    """Return the serialiser of joint states, the most frequent type, four times as fast as rosbags'.

    Rosbags writes what stands before the numbers, once for a frame and names; stamp and arrays go in here.
    """
    kind, write, head_kind = message_class(_JOINT_STATE), _rosbags_writer(_JOINT_STATE, encoding), message_class(HEADER)
    pack_stamp = struct.Struct("<II" if encoding is ROS1 else "<iI").pack_into
    # where the stamp is; from where numbers are aligned; by how much
    place, origin, size = (4, 0, 1) if encoding is ROS1 else (len(CDR.front), len(CDR.front), 8)
    floats = np.dtype(float)

    @lru_cache(maxsize=64)
    def front(frame_id: str, names: tuple[str, ...]) -> bytes:
        whole = write(kind(head_kind(0, 0, frame_id), names))
        return whole[: -3 * _COUNT.size]  # less the counts of three empty arrays

    def write_joint_state(message: Message) -> bytes:
        head, names, *arrays = message
        if type(head) is not head_kind or type(names) is not tuple:
            return write(message)
        data = bytearray(front(head.frame_id, names))
        pack_stamp(data, place, *_seconds(head.stamp))
        for values in arrays:
            array = _array(values, floats, 0)
            data += _COUNT.pack(len(array))
            if len(array):
                data += bytes((origin - len(data)) % size) + array.tobytes()
        return bytes(data)

    return write_joint_state


def _misfit(name: str, message: Message, encoding: Encoding) -> str | None:
    for field, value in message_fields(name, message):
        try:
            _writer(name, encoding)(message_class(name)(**{field.name: value}))
        except _MISFIT_ERRORS as error:
            if field.length is None and field.type in MESSAGES and type(value) is message_class(field.type):
                return f"{field.name}: {_misfit(field.type, value, encoding)}"
            brackets = "" if field.length is None else f"[{field.length or ''}]"
            return f"{field.name}: expected {field.type}{brackets}, got {value!r} ({error})"
    return None


@cache
def _preparation(name: str, encoding: Encoding) -> _Change:
    kind = message_class(name)
    changes = [(k, change) for k, field in enumerate(fields(name)) if (change := _prepared(field, encoding))]
    is_empty = encoding is CDR and not fields(name)

    def prepare(message: Message) -> Any:
        if type(message) is not kind:
            raise TypeError(f"{type(message).__name__} in place of {name}")
        if is_empty:
            return _Empty()
        if not changes:
            return message
        values = list(message)
        for k, change in changes:
            values[k] = change(values[k])
        return kind._make(values)

    return prepare


def _prepared(field: Field, encoding: Encoding) -> _Change | None:
    """Return the conversion of a field's value to rosbags'; None if it is unchanged."""
    length = field.length
    if field.type in NUMBERS:
        kind = np.dtype(NUMBERS[field.type])
        return None if length is None else lambda value: _array(value, kind, length)
    if length is None:
        if field.type in TIMES:
            return _unsigned if encoding is ROS1 and field.type == "time" else _seconds
        return None if field.type == "string" else _preparation(field.type, encoding)
    single = _prepared(field._replace(length=None), encoding)

    def prepare(values: Any) -> tuple[Any, ...]:
        if isinstance(values, str | bytes):
            raise TypeError("a single text")
        values = tuple(values)
        if length and len(values) != length:
            raise ValueError(f"{len(values)} in place of {length}")
        return values if single is None else tuple(map(single, values))

    return prepare


def _seconds(time: int) -> _Time:
    return _Time(*divmod(time, SECOND))


def _unsigned(time: int) -> _Time:
    """Return a time of ROS 1, whose seconds are unsigned (to 2106) where rosbags' are signed: the same bytes."""
    sec, nanosec = _seconds(time)
    if not 0 <= sec < 2**32:
        raise OverflowError("not from 1970 to 2106")
    return _Time((sec + 2**31) % 2**32 - 2**31, nanosec)


def _array(value: Any, kind: "np.dtype[Any]", length: int) -> Any:
    """Return numbers (length,), or (N,) where it is 0, of a type that holds them."""
    if type(value) is np.ndarray and value.dtype is kind and value.ndim == 1 and len(value) == (length or len(value)):
        return value if value.flags.c_contiguous else value.copy()  # as nearly all of a robot's, in each tick
    array = np.asarray(value)
    if array.ndim != 1:
        raise ValueError(f"{array.ndim} dimensions")
    if length and len(array) != length:
        raise ValueError(f"{len(array)} in place of {length}")
    if array.dtype != kind and len(array):
        is_whole = kind.kind in "iu"
        if array.dtype.kind not in ("iub" if is_whole else "iuf"):
            raise TypeError(f"NumPy type {array.dtype}")  # NumPy would convert it without a word
        if is_whole and not np.array_equal(array.astype(kind), array):
            raise OverflowError(f"out of the range of {kind}")
    return np.ascontiguousarray(array, kind)


@cache
def _completion(name: str, encoding: Encoding) -> _Change:
    """Return the conversion of rosbags' object, of ROS 1 or 2, whose headers have no `seq`, to a message."""
    lacking = (0,) if encoding is CDR and name == HEADER else ()
    kind, parts = message_class(name), fields(name)[len(lacking) :]
    changes = [(k, change) for k, field in enumerate(parts) if (change := _completed(field, encoding))]
    if not parts:
        return lambda fields: kind()
    values_of = attrgetter(*(field.name for field in parts))

    def complete(fields: Any) -> Message:
        values = [values_of(fields)] if len(parts) == 1 else list(values_of(fields))
        for k, change in changes:
            values[k] = change(values[k])
        return kind._make((*lacking, *values) if lacking else values)

    return complete


def _completed(field: Field, encoding: Encoding) -> _Change | None:
    """Return the conversion of a field's value from rosbags'; None if it is unchanged."""
    if field.type in NUMBERS:
        return None if field.length is None else np.array  # aligned, and the receiver's own
    if field.length is not None:
        single = _completed(field._replace(length=None), encoding)
        return tuple if single is None else lambda values: tuple(map(single, values))
    if field.type in TIMES:
        return lambda time: time.sec * SECOND + time.nanosec
    return None if field.type == "string" else _completion(field.type, encoding)
