"""Messages' bytes by one `struct` a message: what one has in common with the last ones is laid out once.

A robot's messages differ in their numbers. Texts and lengths of arrays, and by them the place of every number, stay:
they are the key of a layout, whose `struct` then takes all numbers at once. That is a third of the time of writing
field by field, as codec.py (ROS 1) and dds/cdr.py (ROS 2) do it; they write what has no layout, and say what is wrong.
"""

import struct
from collections.abc import Callable
from functools import cache
from operator import attrgetter, itemgetter
from typing import Any, NamedTuple

import numpy as np

from catenary.crtk.clock import SECOND
from catenary.crtk.message import HEADER, Message, message_class
from catenary.recording.messages import MESSAGES, NUMBERS, TIMES, Field, fields

MOST = 64  # layouts of a type that are kept; a type with more of them has other texts each time
_EIGHT_BYTES = str.maketrans("lL", "qQ")  # NumPy's letters, in the standard sizes of `struct`
Pack = Callable[[Message, int], bytes]  # a message, the number that goes into its header


class Encoding(NamedTuple):
    """What ROS 1's and ROS 2's bytes differ in."""

    front: bytes  # before everything; places are counted from behind it
    is_aligned: bool  # whether a number stands at a multiple of its size
    has_seq: bool  # whether headers have a number
    time: str  # how `struct` writes a time's seconds and nanoseconds
    write: Callable[[Field, Any, int], bytes]  # bytes of a field's value that begins at a place


class _Leaf(NamedTuple):
    """A field of a message or of one within it, which is none itself."""

    path: str
    field: Field


class _Layout(NamedTuple):
    """The bytes of messages whose texts and lengths are alike."""

    pack: Callable[..., bytes]
    pick: Callable[[list[Any]], Any]  # puts numbers, arrays' bytes and `fixed` into the order of the bytes
    fixed: tuple[bytes, ...]


def packer(name: str, encoding: Encoding) -> Pack | None:
    """Return what makes a type's bytes; None where its messages have nothing in common that is worth a layout.

    It raises any of `codec.NO_MESSAGE` of a message that does not fit.
    """
    nodes, leaves = _parts(name, encoding.has_seq)
    numbers = [one for one in leaves if one.field.length is None and one.field.type in NUMBERS]
    times = [one for one in leaves if one.field.length is None and one.field.type in TIMES]
    arrays = [one for one in leaves if one.field.length is not None and one.field.type in NUMBERS]
    texts = [one for one in leaves if one not in numbers and one not in times and one not in arrays]
    if not (numbers or arrays) or not all(_is_key(one.field) for one in texts):
        return None
    kinds = [message_class(name), *(kind for _, kind in nodes)]
    nodes_of, numbers_of, times_of, arrays_of, texts_of = (
        _getter(paths)
        for paths in (
            [path for path, _ in nodes],
            *([one.path for one in listed] for listed in (numbers, times, arrays, texts)),
        )
    )
    bytes_of = [number_bytes(one.field) for one in arrays]
    first = fields(name)[0]
    numbered = first.type == HEADER and bool(numbers) and numbers[0].path == f"{first.name}.seq"
    layouts: dict[Any, _Layout] = {}

    def pack(message: Message, seq: int) -> bytes:
        if [type(message), *map(type, nodes_of(message))] != kinds:
            raise TypeError("a message of another type within it")
        changing = [*numbers_of(message)]
        if numbered:
            changing[0] = seq
        for nanoseconds in times_of(message):
            changing += divmod(nanoseconds, SECOND)
        key = [*texts_of(message)]
        for write, values in zip(bytes_of, arrays_of(message), strict=True):
            count, data = write(values)
            changing.append(data)
            key.append(count)
        shape = tuple(key)
        found = layouts.get(shape)
        if found is None:
            if len(layouts) >= MOST:
                layouts.clear()
            found = layouts[shape] = _laid_out(leaves, (numbers, times, arrays, texts), key, encoding)
        changing += found.fixed
        return found.pack(*found.pick(changing))

    return pack


def _parts(name: str, has_seq: bool, path: str = "") -> tuple[list[tuple[str, Any]], list[_Leaf]]:
    """Return the messages within a type, with their classes, and its leaves, both by their paths and in order."""
    nodes: list[tuple[str, Any]] = []
    leaves = []
    for field in fields(name):
        if name == HEADER and field.name == "seq" and not has_seq:
            continue
        place = f"{path}{field.name}"
        if field.length is None and field.type in MESSAGES:
            within = _parts(field.type, has_seq, f"{place}.")
            nodes += [(place, message_class(field.type)), *within[0]]
            leaves += within[1]
        else:
            leaves.append(_Leaf(place, field))
    return nodes, leaves


def _is_key(field: Field) -> bool:
    """Return whether a field's value can be told from others by being equal: it has no arrays of numbers in it."""
    if field.type not in MESSAGES:
        return True
    return all(_is_key(one) and (one.length is None or one.type not in NUMBERS) for one in fields(field.type))


def _getter(paths: list[str]) -> Callable[[Any], tuple[Any, ...]]:
    """Return what gives a tuple of the values at some paths."""
    if not paths:
        return lambda _: ()
    get = attrgetter(*paths)
    return get if len(paths) > 1 else lambda message: (get(message),)


def _laid_out(
    leaves: list[_Leaf], sorts: tuple[list[_Leaf], ...], key: list[Any], encoding: Encoding
) -> _Layout:
    """Lay out messages of these texts and lengths of arrays, which are the key, texts first."""
    numbers, times, arrays, texts = sorts
    begin = len(numbers) + 2 * len(times)
    letters, order, at = ["<"], list[int](), 0
    fixed: list[bytes] = []

    def add(form: str, size: int, place: int) -> None:
        nonlocal at
        letters.append(form)
        order.append(place)
        at += size

    def align(size: int) -> None:
        nonlocal at
        gap = -at % size if encoding.is_aligned else 0
        letters.append("x" * gap)
        at += gap

    def fix(data: bytes) -> None:
        add(f"{len(data)}s", len(data), begin + len(arrays) + len(fixed))
        fixed.append(data)

    if encoding.front:
        fix(encoding.front)
        at = 0
    for leaf in leaves:
        size = _size(leaf.field)
        if leaf in numbers:
            align(size)
            add(number_letter(leaf.field), size, numbers.index(leaf))
        elif leaf in times:
            align(4)
            for k, letter in enumerate(encoding.time):
                add(letter, 4, len(numbers) + 2 * times.index(leaf) + k)
        elif leaf in texts:
            fix(encoding.write(leaf.field, key[texts.index(leaf)], at))
        else:
            k = arrays.index(leaf)
            count = key[len(texts) + k]
            if not leaf.field.length:
                align(4)
                fix(struct.pack("<I", count))
            if count:
                align(size)
            add(f"{count * size}s", count * size, begin + k)
    pick = itemgetter(*order) if len(order) > 1 else lambda values: [values[order[0]]]
    return _Layout(struct.Struct("".join(letters)).pack, pick, tuple(fixed))


def _size(field: Field) -> int:
    return np.dtype(NUMBERS[field.type]).itemsize if field.type in NUMBERS else 1


def number_letter(field: Field) -> str:
    """Return the letter by which `struct` knows a number."""
    return "?" if field.type == "bool" else np.dtype(NUMBERS[field.type]).char.translate(_EIGHT_BYTES)


@cache
def number_bytes(field: Field) -> Callable[[Any], tuple[int, bytes]]:
    """Return what checks an array of numbers, and makes its bytes; it gives their number, too."""
    kind, length = np.dtype(NUMBERS[field.type]), field.length
    is_whole = kind.kind in "iu"

    def write(value: Any) -> tuple[int, bytes]:
        array = value if type(value) is np.ndarray else np.asarray(value)
        if array.ndim != 1:
            raise ValueError(f"{array.ndim} dimensions")
        if length and len(array) != length:
            raise ValueError(f"{len(array)} in place of {length}")
        if array.dtype is not kind and array.dtype != kind and len(array):
            if array.dtype.kind not in ("iub" if is_whole else "iuf"):
                raise TypeError(f"NumPy type {array.dtype}")  # NumPy would convert it without a word
            if is_whole and not np.array_equal(array.astype(kind), array):
                raise OverflowError(f"out of the range of {kind}")
            array = array.astype(kind)
        return len(array), array.tobytes()

    return write
