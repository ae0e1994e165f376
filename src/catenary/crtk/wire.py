"""Messages to ROS 1's bytes and back, quickly enough for all topics of a robot at 1 kHz.

The format: fields in order without padding, little-endian; a string is its length and its bytes, an array of
variable length is preceded by its count, a time is seconds and nanoseconds [wiki.ros.org/roscpp, Serialization].
"""

import struct
from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from catenary.crtk.clock import SECOND
from catenary.crtk.message import HEADER, Message, has_header, message_class, message_fields
from catenary.errors import CatenaryError, FileFormatError, InputError
from catenary.recording.messages import NUMBERS, TIMES, Field, current_name, fields

Write = Callable[[Any, list[bytes]], None]  # value, where its bytes go
Read = Callable[[bytes, int], tuple[Any, int]]  # bytes, offset -> value, offset behind it
_COUNT = struct.Struct("<I")
_HEADER = struct.Struct("<IIII")  # seq, seconds, nanoseconds, length of frame_id
# NumPy's names of numbers -> those of `struct` and `array`
CODES = {
    "u1": "B",
    "i1": "b",
    "i2": "h",
    "u2": "H",
    "i4": "i",
    "u4": "I",
    "i8": "q",
    "u8": "Q",
    "f4": "f",
    "f8": "d",
}
_WRONG = (struct.error, TypeError, ValueError, OverflowError, AttributeError)


class Codec(NamedTuple):
    """How messages of one type become bytes, and again messages."""

    encode: Callable[[Message, int], bytes]  # message, number that goes into the header's `seq`
    decode: Callable[[bytes], Message]


def codec(name: str) -> Codec:
    """Codec of a message type.

    `encode` raises InputError, naming the field, when a value does not fit; `decode` raises FileFormatError when the
    bytes are no such message. Arrays that it gives are the receiver's own.

    Raises:
        FileFormatError: The type is not one that catenary knows.
    """
    return _codec(current_name(name))


@cache
def _codec(name: str) -> Codec:
    kind, write, read = message_class(name), _message_writer(name), _message_reader(name)
    numbered = has_header(name)

    def encode(message: Message, seq: int) -> bytes:
        if type(message) is not kind:
            message_fields(name, message)
        out: list[bytes] = []
        try:
            write(message, out)
        except _WRONG as error:
            raise InputError(f"{name}: {_culprit(name, message) or error}") from error
        if numbered:
            out[0] = _COUNT.pack(seq % 2**32) + out[0][4:]
        return b"".join(out)

    def decode(data: bytes) -> Message:
        try:
            message, end = read(data, 0)
        except _WRONG as error:
            raise FileFormatError(f"{name}: {len(data)} bytes are no such message ({error})") from error
        if end != len(data):
            raise FileFormatError(f"{name}: expected {end} bytes, got {len(data)}")
        return message

    return Codec(encode, decode)


def _culprit(name: str, message: Message) -> str | None:
    """Say which field of a message cannot be written, and why."""
    for field, value in message_fields(name, message):
        try:
            _writer(field)(value, [])
        except _WRONG as error:
            if field.length is None and "/" in field.type:
                try:
                    inner = _culprit(field.type, value)
                except CatenaryError as wrong_type:
                    inner = str(wrong_type)
                return f"{field.name}: {inner}"
            brackets = "" if field.length is None else f"[{field.length or ''}]"
            return f"{field.name}: expected {field.type}{brackets}, got {value!r} ({error})"
    return None


def _write_header(value: Any, out: list[bytes]) -> None:
    """Write a header, which begins nearly every message, in one piece."""
    seq, stamp, frame = value
    data = frame.encode()
    out.append(_HEADER.pack(seq, *divmod(stamp, SECOND), len(data)) + data)


def _message_writer(name: str) -> Write:
    if name == HEADER:
        return _write_header
    parts = fields(name)
    packer = _packer(parts)
    if packer is not None:
        pack = packer.pack
        return lambda message, out: out.append(pack(*message))
    writers = tuple(_writer(field) for field in parts)

    def write(message: Any, out: list[bytes]) -> None:
        for one, value in zip(writers, message, strict=True):
            one(value, out)

    return write


def _message_reader(name: str) -> Read:
    parts, kind = fields(name), message_class(name)
    packer = _packer(parts)
    if packer is not None:
        unpack, size = packer.unpack_from, packer.size
        flags = [i for i, field in enumerate(parts) if field.type == "bool"]

        def read_packed(data: bytes, offset: int) -> tuple[Any, int]:
            values = list(unpack(data, offset))
            for i in flags:
                values[i] = bool(values[i])
            return kind(*values), offset + size

        return read_packed
    readers = tuple(_reader(field) for field in parts)

    def read(data: bytes, offset: int) -> tuple[Any, int]:
        values = []
        for one in readers:
            value, offset = one(data, offset)
            values.append(value)
        return kind(*values), offset

    return read


def _packer(parts: tuple[Field, ...]) -> struct.Struct | None:
    """One packer for all fields where all are single numbers."""
    if not parts or any(field.length is not None or field.type not in NUMBERS for field in parts):
        return None
    return struct.Struct("<" + "".join(_code(field.type) for field in parts))


def _code(kind: str) -> str:
    return CODES[NUMBERS[kind].lstrip("<")]


def _writer(field: Field) -> Write:
    if field.type in NUMBERS:
        if field.length is not None:
            return _array_writer(NUMBERS[field.type], field.length)
        pack = struct.Struct("<" + _code(field.type)).pack
        return lambda value, out: out.append(pack(value))
    if field.length is not None:
        return _tuple_writer(_writer(field._replace(length=None)), field)
    if field.type in TIMES:
        return _time_writer("<ii" if field.type == "duration" else "<II")
    return _write_string if field.type == "string" else _message_writer(field.type)


def _reader(field: Field) -> Read:
    if field.type in NUMBERS:
        if field.length is not None:
            return _array_reader(NUMBERS[field.type], field.length)
        packer, flag = struct.Struct("<" + _code(field.type)), field.type == "bool"

        def read_number(data: bytes, offset: int) -> tuple[Any, int]:
            (value,) = packer.unpack_from(data, offset)
            return (bool(value) if flag else value), offset + packer.size

        return read_number
    if field.length is not None:
        return _tuple_reader(_reader(field._replace(length=None)), field.length)
    if field.type in TIMES:
        return _time_reader("<ii" if field.type == "duration" else "<II")
    return _read_string if field.type == "string" else _message_reader(field.type)


def _array_writer(number: str, length: int) -> Write:
    kind = np.dtype(number)
    whole = kind.kind in "iu"

    def write(value: Any, out: list[bytes]) -> None:
        array = value if type(value) is np.ndarray else np.asarray(value)
        if array.ndim != 1 or (length and len(array) != length):
            raise ValueError(f"{array.shape} numbers")
        if array.dtype == kind:
            data = array.tobytes()
        else:
            data = convert(array).tobytes()
        out.append(data if length else _COUNT.pack(len(array)) + data)

    def convert(array: NDArray[Any]) -> NDArray[Any]:
        if len(array):
            # a conversion that NumPy would make without a word
            if array.dtype.kind not in ("iub" if whole else "iuf"):
                raise TypeError(f"NumPy type {array.dtype}")
            if whole and not np.array_equal(array.astype(kind), array):
                raise OverflowError(f"out of the range of {kind}")
        return array.astype(kind)

    return write


def _array_reader(number: str, length: int) -> Read:
    kind = np.dtype(number)
    size = kind.itemsize

    def read(data: bytes, offset: int) -> tuple[Any, int]:
        count = length
        if not count:
            (count,) = _COUNT.unpack_from(data, offset)
            offset += 4
        # a copy: aligned, and the receiver's own
        return np.frombuffer(data, kind, count, offset).copy(), offset + count * size

    return read


def _tuple_writer(single: Write, field: Field) -> Write:
    length = field.length
    if field.type == "string":
        return lambda value, out: out.append(_strings(_as_tuple(value, length)))

    def write(value: Any, out: list[bytes]) -> None:
        values = _as_tuple(value, length)
        if not length:
            out.append(_COUNT.pack(len(values)))
        for one in values:
            single(one, out)

    return write


def _as_tuple(value: Any, length: int | None) -> tuple[Any, ...]:
    if isinstance(value, str | bytes):
        raise TypeError("a single text")
    values = tuple(value)
    if length and len(values) != length:
        raise ValueError(f"{len(values)} of them")
    return values


@cache
def _strings(values: tuple[str, ...]) -> bytes:
    """Bytes of names; a robot sends the same ones in every message."""
    out = [_COUNT.pack(len(values))]
    for value in values:
        _write_string(value, out)
    return b"".join(out)


def _tuple_reader(single: Read, length: int) -> Read:
    # the last value and its bytes: a robot sends the same names in every message
    last: tuple[bytes, tuple[Any, ...]] | None = None

    def read(data: bytes, offset: int) -> tuple[Any, int]:
        nonlocal last
        known = last
        if known is not None and data.startswith(known[0], offset):
            return known[1], offset + len(known[0])
        begin, count = offset, length
        if not count:
            (count,) = _COUNT.unpack_from(data, offset)
            offset += 4
        if count > len(data):
            raise ValueError(f"{count} elements claimed")
        values = []
        for _ in range(count):
            value, offset = single(data, offset)
            values.append(value)
        if offset > begin and not length:
            last = (data[begin:offset], tuple(values))
        return tuple(values), offset

    return read


def _time_writer(layout: str) -> Write:
    pack = struct.Struct(layout).pack

    def write(value: Any, out: list[bytes]) -> None:
        out.append(pack(*divmod(value, SECOND)))  # a float is refused by the packer

    return write


def _time_reader(layout: str) -> Read:
    unpack = struct.Struct(layout).unpack_from

    def read(data: bytes, offset: int) -> tuple[Any, int]:
        seconds, nanoseconds = unpack(data, offset)
        return seconds * SECOND + nanoseconds, offset + 8

    return read


def _write_string(value: Any, out: list[bytes]) -> None:
    data = value.encode()
    out.append(_COUNT.pack(len(data)))
    out.append(data)


def _read_string(data: bytes, offset: int) -> tuple[str, int]:
    (count,) = _COUNT.unpack_from(data, offset)
    begin = offset + 4
    if begin + count > len(data):
        raise ValueError(f"{count} characters claimed")
    return data[begin : begin + count].decode(errors="replace"), begin + count
