"""ROS 1's bytes of a message and ROS 2's (CDR), made and read.

Both write the fields in order, little-endian; a text or an array of any length behind its length. CDR puts each number
at a multiple of its size, counted from behind four bytes in front, ends texts with a zero and leaves out a header's
`seq` (OMG, DDS-XTypes 1.3, 7.4.1; DDSI-RTPS 2.3, chapter 10). One writer for both is put together from the types'
definitions; numbers that follow one another go through one `struct`. rosbags reads.
"""

import struct
from collections.abc import Callable
from functools import cache, lru_cache
from itertools import groupby
from operator import attrgetter
from typing import Any, NamedTuple

import numpy as np
from rosbags.serde import SerdeError

from catenary.crtk.clock import SECOND
from catenary.crtk.message import HEADER, Message, has_header, message_class, message_fields
from catenary.errors import FileFormatError, InputError
from catenary.recording.messages import MESSAGES, NUMBERS, TIMES, Field, current_name, fields, ros2_name, typestore

NO_MESSAGE = (  # what rosbags raises of bytes, and `struct` of values, that do not fit
    SerdeError, struct.error, TypeError, ValueError, OverflowError, AttributeError, LookupError, AssertionError,
)  # fmt: skip
ANY = 2**26  # bytes of any message: beyond, a length is taken for nonsense
_EIGHT_BYTES = str.maketrans("lL", "qQ")  # NumPy's letters, in the standard sizes of `struct`
_ZEROS = tuple(bytes(k) for k in range(8))
_COUNT = struct.Struct("<I")  # of an array or a text, and a header's `seq`
_TIME = 8  # bytes
_Write = Callable[[list[bytes], int, Any], int]  # adds the bytes of values that begin at a place; gives where they end


class Encoding(NamedTuple):
    """What ROS 1's and ROS 2's bytes differ in."""

    ros: int
    front: bytes
    end: bytes  # of a text, counted with it
    align: int  # the largest alignment
    time: str  # how `struct` writes seconds and nanoseconds
    duration: str


ROS1 = Encoding(1, b"", b"", 1, "II", "ii")
CDR = Encoding(2, b"\0\1\0\0", b"\0", 8, "iI", "iI")  # little-endian, no options


class Codec(NamedTuple):
    """How messages of one type become bytes, and bytes messages."""

    encode: Callable[..., bytes]  # message, and for ROS 1 the number that goes into the header's `seq`
    decode: Callable[[bytes], Message]


@cache
def codec(name: str, encoding: Encoding = ROS1) -> Codec:
    """Return the codec of a message type, or of a service's Request or Response; InputError names a field."""
    if current_name(name) != name:
        return codec(current_name(name), encoding)
    kind, write, finish = message_class(name), _message_writer(name, encoding), _completion(name, encoding)
    store, rosbags_name, numbered = typestore(encoding.ros), ros2_name(name), encoding is ROS1 and has_header(name)
    read = store.deserialize_ros1 if encoding is ROS1 else store.deserialize_cdr

    def encode(message: Message, seq: int = 0) -> bytes:
        if type(message) is not kind:
            message_fields(name, message)  # says what it is instead
        parts = [encoding.front]
        try:
            write(parts, 0, message)
        except NO_MESSAGE as error:
            raise InputError(f"{name}: {_misfit(name, message, encoding) or error}") from error
        data = b"".join(parts)
        return _COUNT.pack(seq % 2**32) + data[_COUNT.size :] if numbered else data

    def decode(data: bytes) -> Message:
        try:
            return finish(read(data, rosbags_name))
        except NO_MESSAGE as error:
            raise FileFormatError(f"{name}: {len(data)} bytes are no such message ({error})") from error

    return Codec(encode, decode)


def _misfit(name: str, message: Message, encoding: Encoding) -> str | None:
    """Say which field of a message cannot be written, and why."""
    for field, value in message_fields(name, message):
        try:
            _fields_writer((field,), encoding)([], 0, (value,))
        except NO_MESSAGE as error:
            if field.length is None and field.type in MESSAGES and type(value) is message_class(field.type):
                return f"{field.name}: {_misfit(field.type, value, encoding)}"
            brackets = "" if field.length is None else f"[{field.length or ''}]"
            return f"{field.name}: expected {field.type}{brackets}, got {value!r} ({error})"
    return None


@cache
def _message_writer(name: str, encoding: Encoding) -> _Write:
    """Return what writes a message of a type."""
    kind, listed = message_class(name), fields(name)
    drops_seq = encoding is CDR and name == HEADER
    write_fields = _fields_writer(listed[1:] if drops_seq else listed, encoding)

    def write(parts: list[bytes], at: int, message: Message) -> int:
        if type(message) is not kind:
            raise TypeError(f"{type(message).__name__} in place of {name}")
        return write_fields(parts, at, message[1:] if drops_seq else message)

    return write


@cache
def _fields_writer(listed: tuple[Field, ...], encoding: Encoding) -> _Write:
    """Return what writes a tuple of fields' values, one after the other, numbers that follow one another at once."""
    if not listed:
        return _placeholder if encoding is CDR else lambda parts, at, values: at
    steps: list[_Write] = []
    first = 0
    for are_numbers, grouped in groupby(listed, _is_number):
        run = tuple(grouped)
        if are_numbers:
            steps.append(_numbers_writer(run, first, len(listed), encoding))
        else:
            steps += [_at_place(first + k, _value_writer(field, encoding)) for k, field in enumerate(run)]
        first += len(run)
    if len(steps) == 1:
        return steps[0]

    def write(parts: list[bytes], at: int, values: Any) -> int:
        for step in steps:
            at = step(parts, at, values)
        return at

    return write


def _placeholder(parts: list[bytes], at: int, values: Any) -> int:
    """Write ROS 2's member of a type that has none."""
    parts.append(b"\0")
    return at + 1


def _at_place(place: int, write: _Write) -> _Write:
    return lambda parts, at, values: write(parts, at, values[place])


def _is_number(field: Field) -> bool:
    return field.length is None and (field.type in NUMBERS or field.type in TIMES)


def _numbers_writer(run: tuple[Field, ...], first: int, whole: int, encoding: Encoding) -> _Write:
    """Return what writes numbers and times that follow one another, from `first` on in a tuple of `whole` values."""
    packed = [struct.Struct(_layout(run, encoding, at)) for at in range(encoding.align)]
    times = [k for k, field in enumerate(run) if field.type in TIMES]
    is_all, last, align = len(run) == whole, first + len(run), encoding.align

    def write(parts: list[bytes], at: int, values: Any) -> int:
        numbers = values if is_all else values[first:last]
        if times:
            numbers = list(numbers)
            for k in reversed(times):
                numbers[k : k + 1] = divmod(numbers[k], SECOND)
        one = packed[at % align]
        parts.append(one.pack(*numbers))
        return at + one.size

    return write


def _layout(run: tuple[Field, ...], encoding: Encoding, at: int) -> str:
    """Return the letters of `struct` for numbers and times that begin at a place, with the gaps before them."""
    letters, place = "<", at
    for field in run:
        kind = None if field.type in TIMES else np.dtype(NUMBERS[field.type])
        size = 4 if kind is None else kind.itemsize
        gap = -place % min(size, encoding.align)
        letters += "x" * gap + (getattr(encoding, field.type) if kind is None else kind.char.translate(_EIGHT_BYTES))
        place += gap + (_TIME if kind is None else size)
    return letters


def _value_writer(field: Field, encoding: Encoding) -> _Write:
    """Return what writes the value of a field that is neither a number nor a time."""
    if field.length is not None:
        return _array_writer(field, encoding) if field.type in NUMBERS else _sequence_writer(field, encoding)
    if field.type != "string":
        return _message_writer(field.type, encoding)
    return lambda parts, at, text: _write_text(parts, at, text, encoding)


def _write_text(parts: list[bytes], at: int, text: str, encoding: Encoding) -> int:
    data = text.encode() + encoding.end
    at = _write_count(parts, at, len(data), encoding)
    parts.append(data)
    return at + len(data)


def _write_count(parts: list[bytes], at: int, count: int, encoding: Encoding) -> int:
    parts.append(_ZEROS[-at % min(_COUNT.size, encoding.align)] + _COUNT.pack(count))
    return at + len(parts[-1])


@lru_cache(maxsize=256)
def _texts(texts: tuple[str, ...], at: int, encoding: Encoding) -> bytes:
    """Return a sequence of texts that begins `at` bytes behind a multiple of four: names of joints are the same."""
    parts: list[bytes] = []
    at = _write_count(parts, at, len(texts), encoding)
    for text in texts:
        at = _write_text(parts, at, text, encoding)
    return b"".join(parts)


def _array_writer(field: Field, encoding: Encoding) -> _Write:
    """Return what writes an array of numbers."""
    kind, length = np.dtype(NUMBERS[field.type]), field.length
    is_whole, size = kind.kind in "iu", min(kind.itemsize, encoding.align)

    def write(parts: list[bytes], at: int, value: Any) -> int:
        array = value if type(value) is np.ndarray else np.asarray(value)
        if array.ndim != 1:
            raise ValueError(f"{array.ndim} dimensions")
        count = len(array)
        if length and count != length:
            raise ValueError(f"{count} in place of {length}")
        if array.dtype is not kind and array.dtype != kind and count:
            if array.dtype.kind not in ("iub" if is_whole else "iuf"):
                raise TypeError(f"NumPy type {array.dtype}")  # NumPy would convert it without a word
            if is_whole and not np.array_equal(array.astype(kind), array):
                raise OverflowError(f"out of the range of {kind}")
            array = array.astype(kind)
        if not length:
            at = _write_count(parts, at, count, encoding)
        if not count:
            return at
        gap = -at % size
        if gap:
            parts.append(_ZEROS[gap])
        parts.append(array.tobytes())
        return at + gap + len(parts[-1])

    return write


def _sequence_writer(field: Field, encoding: Encoding) -> _Write:
    """Return what writes an array of texts, times or messages."""
    length = field.length
    single = _fields_writer((field._replace(length=None),), encoding)

    def write(parts: list[bytes], at: int, values: Any) -> int:
        if isinstance(values, str | bytes):
            raise TypeError("a single text")
        values = tuple(values)
        if length and len(values) != length:
            raise ValueError(f"{len(values)} in place of {length}")
        if field.type == "string" and not length:
            parts.append(_texts(values, at % 4, encoding))
            return at + len(parts[-1])
        if not length:
            at = _write_count(parts, at, len(values), encoding)
        for value in values:
            at = single(parts, at, (value,))
        return at

    return write


@cache
def _completion(name: str, encoding: Encoding) -> Callable[[Any], Any]:
    """Return what makes a message out of rosbags' object of a type, of ROS 1 or 2, whose headers have no `seq`."""
    lacking = (0,) if encoding is CDR and name == HEADER else ()
    kind, parts = message_class(name), fields(name)[len(lacking) :]
    changes = [(k, change) for k, field in enumerate(parts) if (change := _completed(field, encoding))]
    if not parts:
        return lambda given: kind()
    values_of = attrgetter(*(field.name for field in parts))

    def complete(given: Any) -> Message:
        values = [values_of(given)] if len(parts) == 1 else list(values_of(given))
        for k, change in changes:
            values[k] = change(values[k])
        return kind._make((*lacking, *values) if lacking else values)

    return complete


def _completed(field: Field, encoding: Encoding) -> Callable[[Any], Any] | None:
    """Return what makes a field's value out of rosbags'; None where it is as it is."""
    if field.type in NUMBERS:
        return None if field.length is None else np.array  # aligned, and the receiver's own
    if field.length is not None:
        single = _completed(field._replace(length=None), encoding)
        return tuple if single is None else lambda values: tuple(map(single, values))
    if field.type in TIMES:
        return lambda time: time.sec * SECOND + time.nanosec
    return None if field.type == "string" else _completion(field.type, encoding)
