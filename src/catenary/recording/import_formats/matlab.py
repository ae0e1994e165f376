"""MATLAB files up to version 7, read by scipy after a look at how far they unpack and how deep they are nested."""

import struct
import zlib
from math import prod
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catenary.archives import MOST, MOST_ARRAYS, RATIO
from catenary.documents import cut, shortened
from catenary.errors import FileFormatError

DEEPEST = 8  # structs and cells within each other
_MATRIX, _COMPRESSED = 14, 15  # kinds of elements [MAT-File Format, table 1-1]
_HEAD = 128  # [B] before the elements of a file of version 5
_HDF5 = b"\x89HDF\r\n\x1a\n"


def read_matlab(path: Path) -> dict[str, NDArray[Any]]:
    """Read the arrays of numbers of a `.mat`; those within structs are called `struct.field`."""
    from scipy.io import loadmat

    try:
        data = path.read_bytes()
        if data[:4] != b"\0\0\0\0" and (
            data[512:520] == _HDF5 or data[:8] == _HDF5 or b"MATLAB 7.3" in data[:128]
        ):
            raise FileFormatError(
                f"{path}: is of MATLAB's version 7.3, which is not read; in MATLAB load it, and "
                "save('log.mat', '-v7'), or writetable to a CSV"
            )
        _check(data)
        content = loadmat(path, simplify_cells=True, verify_compressed_data_integrity=True)
    except FileFormatError:
        raise
    except Exception as error:  # what scipy raises over bytes that are no such file is of any kind
        raise FileFormatError(
            f"{path}: cannot be read as a MATLAB file: {cut(str(error) or repr(error))}"
        ) from error
    arrays: dict[str, NDArray[Any]] = {}
    _collect({key: value for key, value in content.items() if not key.startswith("__")}, "", arrays)
    return arrays


def _collect(content: dict[str, Any], prefix: str, arrays: dict[str, NDArray[Any]], depth: int = 0) -> None:
    for key, value in content.items():
        if isinstance(value, dict) and depth < DEEPEST:
            _collect(value, f"{prefix}{key}.", arrays, depth + 1)
            continue
        array = np.asarray(value)
        if array.dtype.kind in "biufSU" and len(arrays) < MOST_ARRAYS:
            arrays[prefix + key] = array


def _check(data: bytes) -> None:
    """Check lengths and nesting of a file of version 5 to 7; version 4 has neither."""
    if data[:1] == b"\0" or 0 in data[:4]:
        return
    order = "<" if data[126:128] == b"IM" else ">"
    left = max(MOST, RATIO * len(data))
    position, count = _HEAD, 0
    while position + 8 <= len(data):
        kind, length = struct.unpack_from(f"{order}II", data, position)
        inside = data[position + 8 : position + 8 + length]
        if len(inside) != length:
            raise ValueError(f"an element of {length} bytes at byte {position}, where {len(inside)} are left")
        if kind == _COMPRESSED:
            unpacker = zlib.decompressobj()
            inside = unpacker.decompress(inside, left + 1)
            left -= len(inside)
            if left < 0:
                raise ValueError("it unpacks to more than is read")
        count += _elements(inside, order, 0) if kind == _COMPRESSED else _inside(kind, inside, order, 0)
        if count > 100 * MOST_ARRAYS:
            raise ValueError(f"more than {100 * MOST_ARRAYS} parts")
        position += 8 + length


def _inside(kind: int, data: bytes, order: str, depth: int) -> int:
    if kind != _MATRIX:
        return 1
    # behind the flags: scipy makes room for as many cells as the dimensions say before it reads one
    count = min(*struct.unpack_from(f"{order}I", data.ljust(24, b"\0"), 20), len(data) - 24, 4 * 32) // 4
    lengths = struct.unpack_from(f"{order}{count}i", data, 24) if count > 0 else ()
    if 8 * prod(max(1, length) for length in lengths) > max(MOST, RATIO * len(data)):
        raise ValueError(f"an array of shape {shortened(lengths)} in {len(data)} bytes")
    return _elements(data, order, depth + 1)


def _elements(data: bytes, order: str, depth: int) -> int:
    """Count the elements in bytes, those within them too."""
    if depth > DEEPEST:
        raise ValueError(f"structs and cells are nested more than {DEEPEST} deep")
    position, count = 0, 0
    while position + 8 <= len(data):
        kind, length = struct.unpack_from(f"{order}II", data, position)
        if kind >> 16:  # a short element: four bytes of data within its head
            position, count = position + 8, count + 1
            continue
        if position + 8 + length > len(data):
            raise ValueError(f"an element of {length} bytes, where {len(data) - position - 8} are left")
        count += _inside(kind, data[position + 8 : position + 8 + length], order, depth)
        position += 8 + length + (-length % 8 if kind != _COMPRESSED else 0)
        if count > 100 * MOST_ARRAYS:
            break
    return count
