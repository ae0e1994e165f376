"""How large a message may be that somebody takes in: told from its bytes, before anybody decodes them."""

import struct
from collections.abc import Callable
from functools import cache
from typing import NamedTuple

import numpy as np

from catenary.recording.messages import NUMBERS, TIMES, Field, current_name, fields

ANY = 2**26  # bytes of any message: beyond, a length is taken for nonsense
_COUNT = struct.Struct("<I")  # of an array or a string
_TIME = 8  # bytes
_Pass = Callable[[bytes, int], int]  # over a field that begins at a byte, to where the next one begins


class Bounds(NamedTuple):
    """Of a message that is taken in."""

    entries: int  # numbers or names of an array
    text: int  # bytes of a text


@cache
def most_bytes(name: str, bounds: Bounds) -> int:
    """Return the bytes of a type's largest message within bounds."""
    return sum(_most_bytes(field, bounds) for field in fields(current_name(name)))


def _most_bytes(field: Field, bounds: Bounds) -> int:
    if field.length is not None:
        single = _most_bytes(field._replace(length=None), bounds)
        return field.length * single if field.length else _COUNT.size + bounds.entries * single
    if field.type in NUMBERS:
        return np.dtype(NUMBERS[field.type]).itemsize
    if field.type in TIMES:
        return _TIME
    return _COUNT.size + bounds.text if field.type == "string" else most_bytes(field.type, bounds)


class _TooMany(Exception):
    """An array has more entries than its bound."""


@cache
def names_within(name: str, bounds: Bounds) -> Callable[[bytes], bool]:
    """Return what tells of a message's bytes whether its arrays of names, or of messages, have few enough entries.

    Numbers cost next to nothing, and the message's bytes bound them; 1,200 empty names take a millisecond to decode.
    Bytes that are no such message are for the decoder to refuse.
    """
    passes = _passes(current_name(name), bounds)

    def tell(data: bytes) -> bool:
        at = 0
        try:
            for over in passes:
                at = over(data, at)
        except _TooMany:
            return False
        except struct.error:  # it ends before that
            return True
        return True

    return tell


def _passes(name: str, bounds: Bounds) -> tuple[_Pass, ...]:
    """Return what passes over a type's fields, up to the last one that has entries to be counted."""
    parts = fields(name)
    last = max((k for k, field in enumerate(parts) if _is_counted(field)), default=-1)
    return tuple(_pass(field, bounds) for field in parts[: last + 1])


def _is_counted(field: Field) -> bool:
    if field.type in NUMBERS or field.type in TIMES:
        return False
    if field.length is not None:
        return True
    return field.type != "string" and any(map(_is_counted, fields(field.type)))


def _pass(field: Field, bounds: Bounds) -> _Pass:
    if field.length is not None:
        over, size, single = _pass(field._replace(length=None), bounds), field.length, _width(field)
        most = bounds.entries if _is_counted(field) else 2**32

        def many(data: bytes, at: int) -> int:
            count = size
            if not size:
                (count,) = _COUNT.unpack_from(data, at)
                at += _COUNT.size
                if count > most:
                    raise _TooMany
            if single is not None:
                return at + count * single
            for _ in range(count):
                at = over(data, at)
            return at

        return many
    width = _width(field)
    if width is not None:
        return lambda data, at: at + width
    if field.type == "string":
        return lambda data, at: at + _COUNT.size + int(_COUNT.unpack_from(data, at)[0])
    inner = tuple(_pass(part, bounds) for part in fields(field.type))

    def whole(data: bytes, at: int) -> int:
        for over in inner:
            at = over(data, at)
        return at

    return whole


def _width(field: Field) -> int | None:
    """Return the bytes of one entry of a field whose type is a number or a time, else None."""
    if field.type in NUMBERS:
        return np.dtype(NUMBERS[field.type]).itemsize
    return _TIME if field.type in TIMES else None
