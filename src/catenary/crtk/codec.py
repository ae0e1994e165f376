"""Messages to ROS 1's bytes and back, by rosbags' codec.

rosbags takes any object with a type's fields, so our tuples go in nearly as they are. Prepared here are times, whole
nanoseconds in our messages, and arrays, which rosbags writes without a look at their type.
"""

import struct
from collections.abc import Callable
from functools import cache
from operator import attrgetter
from typing import Any, NamedTuple

import numpy as np
from rosbags.serde import SerdeError

from catenary.crtk.clock import SECOND
from catenary.crtk.message import HEADER, Message, has_header, message_class, message_fields
from catenary.errors import FileFormatError, InputError
from catenary.recording.messages import (
    MESSAGES,
    NUMBERS,
    TIMES,
    Field,
    current_name,
    fields,
    ros2_name,
    typestore,
)

Change = Callable[[Any], Any]  # of a value, into what rosbags takes, or out of what it gives
_WRONG = (SerdeError, struct.error, TypeError, ValueError, OverflowError, AttributeError)


class Codec(NamedTuple):
    """How messages of one type become bytes, and bytes messages."""

    encode: Callable[[Message, int], bytes]  # message, number that goes into the header's `seq`
    decode: Callable[[bytes], Message]


class _Time(NamedTuple):
    sec: int
    nanosec: int


@cache
def codec(name: str) -> Codec:
    """Return the codec of a message type, or of a service's Request or Response.

    `encode` raises InputError, naming the field, when a value does not fit; `decode` raises FileFormatError when the
    bytes are no such message. Arrays of decoded messages are the receiver's own.

    Raises:
        FileFormatError: catenary does not know the type.
    """
    name = current_name(name)
    kind, prepare, finish = message_class(name), _preparation(name), _completion(name)
    store, rosbags_name, numbered = typestore(), ros2_name(name), has_header(name)

    def encode(message: Message, seq: int) -> bytes:
        if type(message) is not kind:
            message_fields(name, message)  # says what it is instead
        try:
            if numbered:
                head = message[0]
                message = kind(type(head)(seq % 2**32, head.stamp, head.frame_id), *message[1:])
            return bytes(store.serialize_ros1(prepare(message), rosbags_name))
        except _WRONG as error:
            raise InputError(f"{name}: {_misfit(name, message) or error}") from error

    def decode(data: bytes) -> Message:
        try:
            return finish(store.deserialize_ros1(data, rosbags_name))
        except _WRONG as error:
            raise FileFormatError(f"{name}: {len(data)} bytes are no such message ({error})") from error

    return Codec(encode, decode)


def _misfit(name: str, message: Message) -> str | None:
    """Say which field of a message cannot be written, and why."""
    store, empty = typestore(), message_class(name)()
    for field, value in message_fields(name, message):
        alone = empty._replace(**{field.name: value})
        try:
            store.serialize_ros1(_preparation(name)(alone), ros2_name(name))
        except _WRONG as error:
            if field.length is None and field.type in MESSAGES and type(value) is message_class(field.type):
                return f"{field.name}: {_misfit(field.type, value)}"
            brackets = "" if field.length is None else f"[{field.length or ''}]"
            return f"{field.name}: expected {field.type}{brackets}, got {value!r} ({error})"
    return None


@cache
def _preparation(name: str) -> Change:
    """Return what makes a message of a type ready for rosbags."""
    kind = message_class(name)
    changes = [(k, change) for k, field in enumerate(fields(name)) if (change := _prepared(field))]

    def prepare(message: Message) -> Any:
        if type(message) is not kind:
            raise TypeError(f"{type(message).__name__} in place of {name}")
        values = list(message)
        for k, change in changes:
            values[k] = change(values[k])
        return kind._make(values)

    return prepare


def _prepared(field: Field) -> Change | None:
    """Return what makes a field's value ready for rosbags; None where it is as it is."""
    if field.type in NUMBERS:
        return None if field.length is None else _array_of(NUMBERS[field.type])
    if field.length is not None:
        single = _prepared(field._replace(length=None))

        def prepare_each(values: Any) -> Any:
            if isinstance(values, str | bytes):
                raise TypeError("a single text")
            return list(values) if single is None else [single(value) for value in values]

        return prepare_each
    if field.type == HEADER:
        return _header  # nearly every message has one
    if field.type == "time":
        return _time
    if field.type == "duration":
        return _duration
    is_ready = field.type == "string" or not any(map(_prepared, fields(field.type)))
    return None if is_ready else _preparation(field.type)


def _header(header: Message) -> Any:
    if type(header) is not message_class(HEADER):
        raise TypeError(f"{type(header).__name__} in place of {HEADER}")
    return type(header)(header.seq, _time(header.stamp), header.frame_id)


def _time(stamp: int) -> _Time:
    if stamp < 0:
        raise ValueError("before 1970")
    return _Time(*divmod(stamp, SECOND))


def _duration(nanoseconds: int) -> _Time:
    return _Time(*divmod(nanoseconds, SECOND))


def _array_of(number: str) -> Change:
    kind = np.dtype(number)
    whole = kind.kind in "iu"

    def prepare(value: Any) -> Any:
        array = value if type(value) is np.ndarray else np.asarray(value)
        if array.dtype is kind and array.ndim == 1 and array.flags.c_contiguous:
            return array
        if array.ndim != 1:
            raise ValueError(f"{array.ndim} dimensions")
        if array.dtype != kind and len(array):
            if array.dtype.kind not in ("iub" if whole else "iuf"):
                raise TypeError(f"NumPy type {array.dtype}")  # NumPy would convert it without a word
            if whole and not np.array_equal(array.astype(kind), array):
                raise OverflowError(f"out of the range of {kind}")
        return np.ascontiguousarray(array, kind)

    return prepare


@cache
def _completion(name: str) -> Change:
    """Return what makes a message out of rosbags' object of a type."""
    kind, parts = message_class(name), fields(name)
    changes = [(k, change) for k, field in enumerate(parts) if (change := _completed(field))]
    if not parts:
        return lambda given: kind()
    values_of = attrgetter(*(field.name for field in parts))

    def complete(given: Any) -> Message:
        values = [values_of(given)] if len(parts) == 1 else list(values_of(given))
        for k, change in changes:
            values[k] = change(values[k])
        return kind._make(values)

    return complete


def _completed(field: Field) -> Change | None:
    """Return what makes a field's value out of rosbags'; None where it is as it is."""
    if field.type in NUMBERS:
        return None if field.length is None else np.array  # aligned, and the receiver's own
    if field.length is not None:
        single = _completed(field._replace(length=None))
        return tuple if single is None else lambda values: tuple(map(single, values))
    if field.type in TIMES:
        return lambda time: time.sec * SECOND + time.nanosec
    return None if field.type == "string" else _completion(field.type)
