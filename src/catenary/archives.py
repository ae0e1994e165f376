"""NumPy's files and packed bytes, checked for how far they unpack before they do; nothing in them is executed."""

import math
import tokenize
import zipfile
import zlib
from collections.abc import Collection
from pathlib import Path
from struct import error as StructError
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from catenary.bounded_parsers import cut, no_file, reading, shortened
from catenary.errors import FileFormatError

# [B] that any file may unpack to, as numbers of 8 bytes; a longer one to MAX_UNPACKED_RATIO times its length
MAX_UNPACKED_BYTES = 128 * 2**20
MAX_UNPACKED_RATIO = 20
MAX_ARRAYS = 1000  # of an archive; a model of many joints has some 50
_TOLD = 8  # names of arrays that a message lists
_PLAIN = "biufcSU"  # kinds of numbers and texts
# what zipfile and NumPy raise on a file that is no archive, damaged, encrypted, or holds something else
UNREADABLE = (
    *(OSError, ValueError, EOFError, LookupError, TypeError, ArithmeticError, RuntimeError, MemoryError),
    *(SyntaxError, AttributeError, StructError, tokenize.TokenError, zipfile.BadZipFile, zlib.error),
)


def read_arrays(path: Path) -> dict[str, NDArray[Any]]:
    """Read every array of a `.npz`, of numbers and texts."""
    if not path.is_file():
        raise FileFormatError(no_file(path))
    with reading(path, "an .npz archive of plain arrays", UNREADABLE), zipfile.ZipFile(path) as archive:
        max_bytes, members = max(MAX_UNPACKED_BYTES, MAX_UNPACKED_RATIO * path.stat().st_size), archive.infolist()
        if len(members) > MAX_ARRAYS:
            raise ValueError(f"{len(members)} files in it, expected {MAX_ARRAYS} at most")
        if len({member.filename for member in members}) < len(members):
            raise ValueError("two files in it have the same name")
        if (total := sum(member.file_size for member in members)) > max_bytes:
            raise ValueError(f"would unpack to {total} bytes, expected {max_bytes} at most")
        arrays: dict[str, NDArray[Any]] = {}
        for member in members:
            key = member.filename.removesuffix(".npy")
            if key == member.filename:
                raise ValueError(f'"{cut(key)}" is not an array')
            with archive.open(member) as file:
                arrays[key] = np.lib.format.read_array(file, allow_pickle=False)
                if file.read(1):  # at the end of an array its checksum is checked
                    raise ValueError(f"{shortened(member.filename)} goes on behind its array")
            max_bytes -= _memory_of(arrays[key], max_bytes)
    return arrays


def content_in_words(names: Collection[str]) -> str:
    """Return a description of an archive that was mistaken for something else: its kind, or its first arrays."""
    if {"structure", "combination"} <= set(names):
        return "it holds an arm's parameters, written by catenary identify"
    if {"structure", "card"} <= set(names):
        return "it holds a calibration model, written by catenary fit"
    more = f" and {len(names) - _TOLD} more" if len(names) > _TOLD else ""
    return f"it holds {', '.join(cut(name) for name in list(names)[:_TOLD]) or 'nothing'}{more}"


def read_array(path: Path) -> NDArray[Any]:
    """Read a `.npy` file of numbers or texts."""
    if not path.is_file():
        raise FileFormatError(no_file(path))
    with reading(path, "an .npy file of a plain array", UNREADABLE), path.open("rb") as file:
        array: NDArray[Any] = np.lib.format.read_array(file, allow_pickle=False)
        _memory_of(array, max(MAX_UNPACKED_BYTES, MAX_UNPACKED_RATIO * path.stat().st_size))
    return array


def decompressed(data: bytes, kind: Literal["bz2", "lz4", "zstd"], max_bytes: int) -> bytes:
    """Return decompressed bytes; ValueError where they are damaged, or more than a limit.

    Args:
        data, kind: Compressed bytes, and compression.
        max_bytes: Largest number of bytes that are decompressed.
    """
    import pyarrow as pa

    try:
        with pa.CompressedInputStream(pa.BufferReader(data), kind) as stream:
            content: bytes = stream.read(max_bytes + 1)
    except (pa.ArrowException, OSError, MemoryError) as error:
        raise ValueError(f"{len(data)} bytes cannot be unpacked as {kind}: {error}") from error
    if len(content) > max_bytes:
        raise ValueError(f"{len(data)} bytes of {kind} unpack to more than {max_bytes} bytes")
    return content


def _memory_of(array: NDArray[Any], max_bytes: int) -> int:
    """Return the bytes of an array as numbers of 8 bytes, `max_bytes` at most; refuse what is no plain array."""
    if array.dtype.kind not in _PLAIN:
        raise ValueError(f"an array of {cut(str(array.dtype))}, expected plain numbers or texts")
    taken = array.size * max(array.dtype.itemsize, 8)
    # no rows take no bytes, and columns are named all the same
    within = 8 * math.prod(max(1, length) for length in array.shape)
    if max(taken, within) > max_bytes:
        raise ValueError(f"an array of shape {shortened(array.shape)} has more than {max_bytes} bytes")
    return taken
