"""Messages to ROS 1's bytes and back: written by functions put together from the types' definitions, read by rosbags.

A message's bytes are its fields' in their order: numbers as they are, little-endian; a string, or an array of any
length, behind its length; a time as seconds and nanoseconds, which are whole nanoseconds in our messages. rosbags
writes the same bytes in three times the time, which a robot that publishes fifteen topics a millisecond does not have.
"""

import struct
from collections.abc import Callable
from contextlib import suppress
from functools import cache, lru_cache
from operator import attrgetter
from typing import Any, NamedTuple

import numpy as np
from rosbags.serde import SerdeError

from catenary.crtk.clock import SECOND
from catenary.crtk.message import HEADER, Message, has_header, message_class, message_fields
from catenary.crtk.packing import Encoding, number_bytes, number_letter, packer
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

_Write = Callable[[Any], bytes]  # a value
_Change = Callable[[Any], Any]  # of what rosbags gives, into our values
NO_MESSAGE = (  # what rosbags raises of bytes, and `struct` of values, that do not fit
    SerdeError, struct.error, TypeError, ValueError, OverflowError, AttributeError, LookupError, AssertionError,
)  # fmt: skip
_COUNT = struct.Struct("<I")  # of an array or a string, and a header's `seq`


class Codec(NamedTuple):
    """How messages of one type become bytes, and bytes messages."""

    encode: Callable[[Message, int], bytes]  # message, number that goes into the header's `seq`
    decode: Callable[[bytes], Message]


@cache
def codec(name: str) -> Codec:
    """Return the codec of a message type, or of a service's Request or Response.

    `encode` raises InputError, naming the field, when a value does not fit; `decode` raises FileFormatError when the
    bytes are no such message. Arrays of decoded messages are the receiver's own.
    """
    name = current_name(name)
    kind, write, finish = message_class(name), _message_writer(name), completion(name)
    store, rosbags_name, numbered = typestore(), ros2_name(name), has_header(name)
    pack = packer(name, _ENCODING)

    def encode(message: Message, seq: int) -> bytes:
        if pack is not None:
            with suppress(*NO_MESSAGE):  # what does not fit is told below
                return pack(message, seq % 2**32)
        if type(message) is not kind:
            message_fields(name, message)  # says what it is instead
        try:
            data = write(message)
        except NO_MESSAGE as error:
            raise misfit(name, message, error) from error
        return _COUNT.pack(seq % 2**32) + data[_COUNT.size :] if numbered else data

    def decode(data: bytes) -> Message:
        try:
            return finish(store.deserialize_ros1(data, rosbags_name))
        except NO_MESSAGE as error:
            raise FileFormatError(f"{name}: {len(data)} bytes are no such message ({error})") from error

    return Codec(encode, decode)


def misfit(name: str, message: Message, error: Exception) -> InputError:
    """Return the error of a message that cannot be written, which names the field."""
    return InputError(f"{name}: {_misfit(name, message) or error}")


def _misfit(name: str, message: Message) -> str | None:
    """Say which field of a message cannot be written, and why."""
    for field, value in message_fields(name, message):
        try:
            _writer(field)(value)
        except NO_MESSAGE as error:
            if field.length is None and field.type in MESSAGES and type(value) is message_class(field.type):
                return f"{field.name}: {_misfit(field.type, value)}"
            brackets = "" if field.length is None else f"[{field.length or ''}]"
            return f"{field.name}: expected {field.type}{brackets}, got {value!r} ({error})"
    return None


@cache
def _message_writer(name: str) -> _Write:
    """Return what writes a message of a type: its fields, one after the other."""
    kind, parts = message_class(name), fields(name)
    are_numbers = all(field.type in NUMBERS and field.length is None for field in parts)
    pack = struct.Struct("<" + "".join(map(number_letter, parts)) if are_numbers else "").pack
    writers = [_writer(field) for field in parts]

    def write(message: Message) -> bytes:
        if type(message) is not kind:
            raise TypeError(f"{type(message).__name__} in place of {name}")
        if are_numbers:  # a vector, a quaternion: all at once
            return pack(*message)
        return b"".join([write(value) for write, value in zip(writers, message, strict=True)])

    return write


@cache
def _writer(field: Field) -> _Write:
    """Return what writes a field's value."""
    if field.type in NUMBERS:
        return (
            struct.Struct("<" + number_letter(field)).pack if field.length is None else _array_writer(field)
        )
    if field.length is not None:
        return _sequence_writer(field)
    if field.type in TIMES:
        pack = struct.Struct("<II" if field.type == "time" else "<ii").pack
        return lambda nanoseconds: pack(*divmod(nanoseconds, SECOND))
    return _text if field.type == "string" else _message_writer(field.type)


def _text(text: str) -> bytes:
    data = text.encode()
    return _COUNT.pack(len(data)) + data


@lru_cache(maxsize=256)
def _texts(texts: tuple[str, ...]) -> bytes:
    return b"".join(map(_text, texts))  # names of joints, which are the same each time


def _sequence_writer(field: Field) -> _Write:
    """Return what writes an array of strings, times or messages."""
    length, single = field.length, _writer(field._replace(length=None))

    def write(values: Any) -> bytes:
        if isinstance(values, str | bytes):
            raise TypeError("a single text")
        values = tuple(values)
        if length and len(values) != length:
            raise ValueError(f"{len(values)} in place of {length}")
        data = _texts(values) if single is _text else b"".join(map(single, values))
        return data if length else _COUNT.pack(len(values)) + data

    return write


def _array_writer(field: Field) -> _Write:
    """Return what writes an array of numbers."""
    numbers, length = number_bytes(field), field.length

    def write(value: Any) -> bytes:
        count, data = numbers(value)
        return data if length else _COUNT.pack(count) + data

    return write


_ENCODING = Encoding(b"", False, True, "II", lambda field, value, at: _writer(field)(value))


@cache
def completion(name: str, ros: int = 1) -> _Change:
    """Return what makes a message out of rosbags' object of a type, of ROS 1 or 2, whose headers have no `seq`."""
    lacking = (0,) if ros == 2 and name == HEADER else ()
    kind, parts = message_class(name), fields(name)[len(lacking) :]
    changes = [(k, change) for k, field in enumerate(parts) if (change := _completed(field, ros))]
    if not parts:
        return lambda given: kind()
    values_of = attrgetter(*(field.name for field in parts))

    def complete(given: Any) -> Message:
        values = [values_of(given)] if len(parts) == 1 else list(values_of(given))
        for k, change in changes:
            values[k] = change(values[k])
        return kind._make((*lacking, *values) if lacking else values)

    return complete


def _completed(field: Field, ros: int) -> _Change | None:
    """Return what makes a field's value out of rosbags'; None where it is as it is."""
    if field.type in NUMBERS:
        return None if field.length is None else np.array  # aligned, and the receiver's own
    if field.length is not None:
        single = _completed(field._replace(length=None), ros)
        return tuple if single is None else lambda values: tuple(map(single, values))
    if field.type in TIMES:
        return lambda time: time.sec * SECOND + time.nanosec
    return None if field.type == "string" else completion(field.type, ros)
