"""The records of a bag, read within bounds, and in a damaged one the next chunk.

[wiki.ros.org/Bags/Format/2.0, mcap.dev/spec]
"""

import re
from pathlib import Path
from struct import Struct, error
from typing import BinaryIO, Literal, cast

from catenary.archives import RATIO, unpacked
from catenary.errors import FileFormatError

MOST_UNPACKED = 64 * 2**20  # [B] of all chunks and messages of any bag; of a long one RATIO times its length
MOST_TOPICS = 1000
PACKINGS = ("bz2", "lz4", "zstd")
_U32, _U64 = Struct("<I"), Struct("<Q")
_BLOCK = 2**20  # [B] looked through at once
_REACH = 128  # [B] of a chunk's head; more than any has
_ROS1_CHUNK = re.compile(rb"op=\x05")
# op 6, length, times, size, checksum, then the name of the compression [mcap.dev/spec]
_MCAP_CHUNK = re.compile(rb"\x06(?=.{36}(?:\0{4}|\x03\0{3}lz4|\x04\0{3}zstd))", re.DOTALL)
_PACKED = b"\x28\xb5\x2f\xfd"  # how what zstd packed begins [RFC 8878]; a message in CDR begins with 0
# what reading damaged bytes raises
DAMAGE = (error, LookupError, ValueError, OSError, EOFError, RuntimeError, ArithmeticError, MemoryError)


def next_chunk(file: BinaryIO, position: int, size: int, *, is_ros1: bool) -> int | None:
    """Return where the next chunk of a ROS 1 bag, or of MCAP, begins, or None; the file is left anywhere."""
    sign, begin_of = (_ROS1_CHUNK, _ros1_chunk) if is_ros1 else (_MCAP_CHUNK, _mcap_chunk)
    while position < size:
        file.seek(position)
        block = file.read(_BLOCK + _REACH)
        for match in sign.finditer(block):
            begin = begin_of(block, match.start())
            if begin is not None and match.start() < _BLOCK:
                return position + begin
        position += _BLOCK
    return None


def _ros1_chunk(block: bytes, sign: int) -> int | None:
    """Return where the chunk begins whose header has its op at `sign`."""
    for begin in range(max(0, sign - _REACH // 2), sign - 7):
        length = _U32.unpack_from(block, begin)[0]
        if sign < begin + 4 + length <= begin + _REACH:
            head = _fields(block[begin + 4 : begin + 4 + length])
            if head.keys() == {b"op", b"compression", b"size"} and len(head[b"size"]) == 4:
                return begin
    return None


def _mcap_chunk(block: bytes, sign: int) -> int | None:
    """Return `sign` where the lengths of a chunk that begins there agree."""
    name_at = sign + 37
    if name_at + 4 > len(block):
        return None
    named = _U32.unpack_from(block, name_at)[0]
    if name_at + 12 + named > len(block):
        return None
    length, inside = _U64.unpack_from(block, sign + 1)[0], _U64.unpack_from(block, name_at + 4 + named)[0]
    return sign if length == 40 + named + inside else None


def _fields(data: bytes) -> dict[bytes, bytes]:
    """Return the fields of a header; none of a damaged one."""
    try:
        return header_fields(data)
    except (error, ValueError):
        return {}


def header_fields(data: bytes) -> dict[bytes, bytes]:
    """Return the fields of a record's header in a ROS 1 bag."""
    values, position = {}, 0
    while position < len(data):
        length = _U32.unpack_from(data, position)[0]
        end = position + 4 + length
        if end > len(data):
            raise ValueError(f"a field of {length} bytes, its header ends after {len(data) - position - 4}")
        key, _, value = data[position + 4 : end].partition(b"=")
        values[key] = value
        position = end
    return values


def field_of(values: dict[bytes, bytes], key: bytes, length: int | None = None) -> bytes:
    """Return a field of a header."""
    found = values.get(key)
    if found is None:
        raise ValueError(f"a header without {key.decode()}")
    if length not in (None, len(found)):
        raise ValueError(f"{key.decode()} has {len(found)} bytes, expected {length}")
    return found


def sized(file: BinaryIO, size: int) -> bytes | None:
    """Bytes behind their length, or None where the file ends first."""
    if file.tell() + 4 > size:
        return None
    length = _U32.unpack(file.read(4))[0]
    return file.read(length) if file.tell() + length <= size else None  # else what is there can still be read


def bag_record(file: BinaryIO, size: int) -> tuple[dict[bytes, bytes], bytes | None]:
    """Return header and data of a record: no header where it is damaged, no data where the file ends first."""
    head = sized(file, size)
    data = None if head is None else sized(file, size)
    return _fields(head or b""), data


def most_unpacked(size: int) -> int:
    """Return how many bytes a file of so many may unpack to."""
    return max(MOST_UNPACKED, RATIO * size)


class Unpacking:
    """Unpacks the chunks and messages of a bag: of a small file not gigabytes."""

    def __init__(self, path: Path) -> None:
        """Begin, with the bounds that a file of this length has."""
        self._path, self._left = path, most_unpacked(path.stat().st_size)

    def chunk(self, data: bytes, kind: str, stated: int) -> bytes:
        """Return a chunk, unpacked to the size that its bag states."""
        if kind in ("", "none"):
            return data
        if kind not in PACKINGS:
            raise ValueError(f"unknown compression {kind}")
        if stated > self._left:
            raise ValueError(f"a chunk would unpack to {stated} bytes; {self._left} are left of what is read")
        chunk = unpacked(data, cast("Literal['bz2', 'lz4', 'zstd']", kind), stated)
        self._left -= stated
        if len(chunk) != stated:
            raise ValueError(f"a chunk unpacks to {len(chunk)} bytes, and states {stated}")
        return chunk

    def message(self, data: bytes) -> bytes:
        """Return a message of ROS 2, unpacked where messages were packed one by one."""
        if data[:4] != _PACKED:
            return data
        try:
            plain = unpacked(data, "zstd", self._left)
        except ValueError as error:
            raise FileFormatError(f"{self._path}: a message of {error}") from error
        self._left -= len(plain)
        return plain


def text_at(data: bytes, position: int) -> tuple[str, int]:
    """Return the text of MCAP that stands there behind its length, and where it ends."""
    length = _U32.unpack_from(data, position)[0]
    end = position + 4 + length
    if end > len(data):
        raise ValueError(f"a text of {length} bytes, its record ends after {len(data) - position - 4}")
    return data[position + 4 : end].decode(), end
