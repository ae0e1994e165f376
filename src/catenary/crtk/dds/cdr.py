"""Messages to ROS 2's bytes and back: CDR of version 1, written by functions put together from the types' definitions.

Four bytes in front say that numbers are little-endian. A number stands at a multiple of its size, counted from behind
these; a text is its length, its bytes and a zero, a sequence its length and its entries. (OMG, DDS-XTypes 1.3, 7.4.1,
and DDSI-RTPS 2.3, chapter 10.) rosbags reads them; to write them, by way of ROS 1's bytes and its converter, takes
three times as long.
"""

import struct
from collections.abc import Callable
from contextlib import suppress
from functools import cache, lru_cache
from typing import Any

import numpy as np

from catenary.crtk.clock import SECOND
from catenary.crtk.codec import NO_MESSAGE, completion, misfit
from catenary.crtk.message import HEADER, Message, message_class, message_fields
from catenary.crtk.packing import Encoding, number_bytes, number_letter, packer
from catenary.errors import FileFormatError
from catenary.recording.messages import NUMBERS, TIMES, Field, current_name, fields, ros2_name, typestore

FRONT = b"\0\1\0\0"  # CDR, little-endian, no options
_COUNT = struct.Struct("<I")
_ZEROS = tuple(bytes(k) for k in range(9))
_Write = Callable[
    [list[bytes], int, Any], int
]  # adds bytes of a value that begins at a byte; gives where it ends


@cache
def cdr_encoder(name: str) -> Callable[[Message], bytes]:
    """Return what makes a message's bytes; it raises InputError, naming the field, when a value does not fit."""
    name = current_name(name)
    kind, write, pack = message_class(name), _message_writer(name), packer(name, _ENCODING)

    def encode(message: Message) -> bytes:
        if pack is not None:
            with suppress(*NO_MESSAGE):  # what does not fit is told below
                return pack(message, 0)
        if type(message) is not kind:
            message_fields(name, message)  # says what it is instead
        parts = [FRONT]
        try:
            write(parts, 0, message)
        except NO_MESSAGE as error:
            raise misfit(name, message, error) from error
        return b"".join(parts)

    return encode


@cache
def cdr_decoder(name: str) -> Callable[[bytes], Message]:
    """Return what makes a message of bytes; it raises FileFormatError when they are no such message."""
    name = current_name(name)
    finish, store, rosbags_name = completion(name, 2), typestore(2), ros2_name(name)

    def decode(data: bytes) -> Message:
        try:
            return finish(store.deserialize_cdr(data, rosbags_name))
        except NO_MESSAGE as error:
            raise FileFormatError(f"{name}: {len(data)} bytes are no such message ({error})") from error

    return decode


@cache
def _message_writer(name: str) -> _Write:
    """Return what writes a message of a type: its fields, one after the other."""
    kind, listed = message_class(name), fields(name)
    writers = [None if name == HEADER and field.name == "seq" else _writer(field) for field in listed]
    sizes = {_size(field) if field.type in NUMBERS and field.length is None else 0 for field in listed}
    if len(sizes) == 1 and 0 not in sizes:  # a vector, a quaternion: all at once
        pack, (size,) = struct.Struct("<" + "".join(map(number_letter, listed))), sizes

        def write_numbers(parts: list[bytes], at: int, message: Message) -> int:
            if type(message) is not kind:
                raise TypeError(f"{type(message).__name__} in place of {name}")
            gap = -at % size
            parts.append(_ZEROS[gap] + pack.pack(*message))
            return at + gap + pack.size

        return write_numbers
    if not listed:

        def write_nothing(parts: list[bytes], at: int, message: Message) -> int:
            if type(message) is not kind:
                raise TypeError(f"{type(message).__name__} in place of {name}")
            parts.append(b"\0")  # ROS 2's member of a type that has none
            return at + 1

        return write_nothing

    def write(parts: list[bytes], at: int, message: Message) -> int:
        if type(message) is not kind:
            raise TypeError(f"{type(message).__name__} in place of {name}")
        for one, value in zip(writers, message, strict=True):
            if one is not None:
                at = one(parts, at, value)
        return at

    return write


@cache
def _writer(field: Field) -> _Write:
    """Return what writes a field's value."""
    if field.length is not None:
        return _numbers_writer(field) if field.type in NUMBERS else _sequence_writer(field)
    if field.type in NUMBERS:
        return _number_writer(field)
    if field.type in TIMES:
        return _write_time
    return _write_text if field.type == "string" else _message_writer(field.type)


def _size(field: Field) -> int:
    return np.dtype(NUMBERS[field.type]).itemsize


def _number_writer(field: Field) -> _Write:
    size, pack = _size(field), struct.Struct("<" + number_letter(field)).pack

    def write(parts: list[bytes], at: int, value: Any) -> int:
        gap = -at % size
        parts.append(_ZEROS[gap] + pack(value))
        return at + gap + size

    return write


_TIME = struct.Struct("<iI")


def _write_time(parts: list[bytes], at: int, nanoseconds: int) -> int:
    gap = -at % 4
    parts.append(_ZEROS[gap] + _TIME.pack(*divmod(nanoseconds, SECOND)))
    return at + gap + 8


def _write_text(parts: list[bytes], at: int, text: str) -> int:
    data, gap = text.encode(), -at % 4
    parts.append(b"%b%b%b\0" % (_ZEROS[gap], _COUNT.pack(len(data) + 1), data))
    return at + gap + 5 + len(data)


def _numbers_writer(field: Field) -> _Write:
    """Return what writes an array of numbers."""
    size, numbers, length = _size(field), number_bytes(field), field.length

    def write(parts: list[bytes], at: int, value: Any) -> int:
        count, data = numbers(value)
        if not length:
            gap = -at % 4
            parts.append(_ZEROS[gap] + _COUNT.pack(count))
            at += gap + 4
        if count:
            gap = -at % size
            parts.append(_ZEROS[gap] + data)
            at += gap + len(data)
        return at

    return write


@lru_cache(maxsize=256)
def _texts(texts: tuple[str, ...], at: int) -> bytes:
    """Return a sequence of texts that begins `at` bytes behind a multiple of four."""
    gap = -at % 4
    parts = [_ZEROS[gap] + _COUNT.pack(len(texts))]
    at += gap + 4
    for text in texts:
        at = _write_text(parts, at, text)
    return b"".join(parts)  # names of joints, which are the same each time


def _sequence_writer(field: Field) -> _Write:
    """Return what writes an array of texts, times or messages."""
    length, single = field.length, _writer(field._replace(length=None))
    is_texts = field.type == "string" and not length

    def write(parts: list[bytes], at: int, values: Any) -> int:
        if isinstance(values, str | bytes):
            raise TypeError("a single text")
        values = tuple(values)
        if length and len(values) != length:
            raise ValueError(f"{len(values)} in place of {length}")
        if is_texts:
            data = _texts(values, at % 4)
            parts.append(data)
            return at + len(data)
        if not length:
            gap = -at % 4
            parts.append(_ZEROS[gap] + _COUNT.pack(len(values)))
            at += gap + 4
        for value in values:
            at = single(parts, at, value)
        return at

    return write


def _written(field: Field, value: Any, at: int) -> bytes:
    parts: list[bytes] = []
    _writer(field)(parts, at, value)
    return b"".join(parts)


_ENCODING = Encoding(FRONT, True, False, "iI", _written)
