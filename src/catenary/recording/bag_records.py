"""Records of a bag: bounded, searched for behind damage, walked by compiled code [wiki.ros.org/Bags, mcap.dev/spec]."""

import re
from collections.abc import Sequence
from pathlib import Path
from struct import Struct, error
from typing import Any, BinaryIO, Literal, cast

import numpy as np
from numpy.typing import NDArray

from catenary.archives import MAX_UNPACKED_RATIO, decompressed
from catenary.arrays import Integers
from catenary.errors import FileFormatError
from catenary.kernels.compiled import compiled

_MAX_UNPACKED_BYTES = 64 * 2**20  # [B] of all chunks and messages of any bag; of a long one a ratio times its length
MAX_TOPICS = 1000
_PACKINGS = ("bz2", "lz4", "zstd")
_U32, _U64 = Struct("<I"), Struct("<Q")
_BLOCK_BYTES = 2**20  # [B] looked through at once
_REACH_BYTES = 128  # [B] of a chunk's head; more than any has
_ROS1_CHUNK = re.compile(rb"op=\x05")
# op 6, length, times, size, checksum, then the name of the compression [mcap.dev/spec]
_MCAP_CHUNK = re.compile(rb"\x06(?=.{36}(?:\0{4}|\x03\0{3}lz4|\x04\0{3}zstd))", re.DOTALL)
_PACKED = b"\x28\xb5\x2f\xfd"  # how what zstd packed begins [RFC 8878]; a message in CDR begins with 0
# what reading damaged bytes raises
DAMAGE = (error, LookupError, ValueError, OSError, EOFError, RuntimeError, ArithmeticError, MemoryError)
KIND, CONNECTION, TIME, HEADER, DATA, END = range(6)  # columns of a chunk's records
Records = Integers


def next_chunk(file: BinaryIO, position: int, size: int, *, is_ros1: bool) -> int | None:
    """Return the offset of the next chunk of a ROS 1 bag, or of MCAP, or None; the file position changes."""
    sign, begin_of = (_ROS1_CHUNK, _ros1_chunk) if is_ros1 else (_MCAP_CHUNK, _mcap_chunk)
    while position < size:
        file.seek(position)
        block = file.read(_BLOCK_BYTES + _REACH_BYTES)
        for match in sign.finditer(block):
            begin = begin_of(block, match.start())
            if begin is not None and match.start() < _BLOCK_BYTES:
                return position + begin
        position += _BLOCK_BYTES
    return None


def _ros1_chunk(block: bytes, sign: int) -> int | None:
    """Return the offset of the chunk whose header has its op at `sign`."""
    for begin in range(max(0, sign - _REACH_BYTES // 2), sign - 7):
        length = _U32.unpack_from(block, begin)[0]
        if sign < begin + 4 + length <= begin + _REACH_BYTES:
            head = whole_fields(block[begin + 4 : begin + 4 + length])
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


def whole_fields(data: bytes) -> dict[bytes, bytes]:
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
    field = values.get(key)
    if field is None:
        raise ValueError(f"a header without {key.decode()}")
    if length not in (None, len(field)):
        raise ValueError(f"{key.decode()} has {len(field)} bytes, expected {length}")
    return field


def sized(file: BinaryIO, size: int) -> bytes | None:
    """Bytes behind their length, or None if the file ends first."""
    if file.tell() + 4 > size:
        return None
    length = _U32.unpack(file.read(4))[0]
    return file.read(length) if file.tell() + length <= size else None  # else what is there can still be read


class Unpacking:
    """Unpacks the chunks and messages of a bag: of a small file not gigabytes."""

    def __init__(self, path: Path) -> None:
        """Begin, with the bounds that a file of this length has."""
        self._path, self._left = path, max(_MAX_UNPACKED_BYTES, MAX_UNPACKED_RATIO * path.stat().st_size)

    def chunk(self, data: bytes, kind: str, stated: int) -> bytes:
        """Return a chunk, unpacked to the size that its bag states."""
        if kind in ("", "none"):
            return data
        if kind not in _PACKINGS:
            raise ValueError(f"unknown compression {kind}")
        if stated > self._left:
            raise ValueError(f"a chunk would unpack to {stated} bytes; {self._left} are left of what is read")
        chunk = decompressed(data, cast("Literal['bz2', 'lz4', 'zstd']", kind), stated)
        self._left -= stated
        if len(chunk) != stated:
            raise ValueError(f"a chunk unpacks to {len(chunk)} bytes, and states {stated}")
        return chunk

    def message(self, data: bytes) -> bytes:
        """Return a message of ROS 2, unpacked where messages were packed one by one."""
        if data[:4] != _PACKED:
            return data
        try:
            plain = decompressed(data, "zstd", self._left)
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


class Block:
    """N messages one behind the other in one piece of memory."""

    def __init__(self, data: NDArray[np.uint8], lengths: Integers) -> None:
        self.data, self.lengths = data, lengths
        self._ends = np.cumsum(lengths)

    def __len__(self) -> int:
        """Return the number of messages."""
        return len(self.lengths)

    def __getitem__(self, index: int) -> bytes:
        """Return the bytes of a message."""
        end = self._ends[index]
        return self.data[end - self.lengths[index] : end].tobytes()

    @classmethod
    def of(cls, messages: Sequence[bytes]) -> "Block":
        """Return a block of these messages."""
        lengths = np.fromiter(map(len, messages), dtype=np.int64, count=len(messages))
        return cls(np.frombuffer(b"".join(messages), dtype=np.uint8), lengths)

    @classmethod
    def joined(cls, blocks: Sequence["Block"]) -> "Block":
        """Return one block of all messages of several."""
        if len(blocks) == 1:
            return blocks[0]
        every = [cls.of([]), *blocks]
        return cls(np.concatenate([block.data for block in every]), np.concatenate([block.lengths for block in every]))


def chunk_records(chunk: bytes, *, is_ros1: bool) -> Records:
    """Return the records of an unpacked chunk up to its last whole one, (N, 6).

    Columns: op (-1 where the header is damaged), connection or channel, time [ns], where header, data and record begin,
    begin and end. MCAP's records but messages tell only their kind, and where they begin and end.
    """
    data = np.frombuffer(chunk, dtype=np.uint8)
    records = np.empty((len(data) // 8, 6), dtype=np.int64)
    return records[: (_walk if is_ros1 else _walk_mcap)(data, records)]


def messages_of_records(chunk: bytes, records: Records) -> Block:
    """Return the messages of a chunk's records."""
    parts = map(chunk.__getitem__, map(slice, records[:, DATA].tolist(), records[:, END].tolist()))
    return Block(np.frombuffer(b"".join(parts), dtype=np.uint8), records[:, END] - records[:, DATA])


@compiled
def _u32(data: NDArray[np.uint8], position: int) -> Any:
    value = np.int64(0)
    for k in range(4):
        value |= np.int64(data[position + k]) << 8 * k
    return value


@compiled
def _walk(data: NDArray[np.uint8], records: Records) -> int:
    size, position, count = len(data), 0, 0
    while position + 4 <= size:
        header = position + 4
        middle = header + _u32(data, position)
        if middle + 4 > size:
            break
        end = middle + 4 + _u32(data, middle)
        if end > size:
            break
        row = records[count]
        row[0], row[1], row[2], row[3], row[4], row[5] = 0, -1, -1, header, middle + 4, end
        field = header
        while field < middle:
            if field + 4 > middle:
                row[0] = -1
                break
            begin = field + 4
            stop = begin + _u32(data, field)
            if stop > middle:
                row[0] = -1
                break
            length = stop - begin
            first = data[begin] if length else np.uint8(0)
            # op=?, conn=????, time=????????: distinguished by their first letter and length
            if length == 4 and first == 111 and data[begin + 2] == 61:
                row[0] = data[begin + 3]
            elif length == 9 and first == 99 and data[begin + 4] == 61:
                row[1] = _u32(data, begin + 5)
            elif length == 13 and first == 116 and data[begin + 4] == 61:
                row[2] = _u32(data, begin + 5) * 1_000_000_000 + _u32(data, begin + 9)
            field = stop
        count += 1
        position = end
    return count


@compiled
def _walk_mcap(data: NDArray[np.uint8], records: Records) -> int:
    size, position, count = len(data), 0, 0
    while position + 9 <= size:
        begin = position + 9
        length = _u32(data, position + 1) | _u32(data, position + 5) << 32
        if length < 0 or length > size - begin:
            break
        row = records[count]
        row[0], row[1], row[2], row[3], row[4], row[5] = data[position], -1, -1, begin, begin, begin + length
        if row[0] == 5:
            if length < 22:
                row[0] = -1
            else:
                row[1] = np.int64(data[begin]) | np.int64(data[begin + 1]) << 8
                row[2] = _u32(data, begin + 6) | _u32(data, begin + 10) << 32
                row[4] = begin + 22
        count += 1
        position = begin + length
    return count
