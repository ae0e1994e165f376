"""Where a bag goes on behind what is damaged in it: the next chunk of a file, the next message of a chunk."""

import re
from collections.abc import Callable
from struct import Struct, error
from typing import BinaryIO

from catenary.recording.bag_records import header_fields

_U32, _U64 = Struct("<I"), Struct("<Q")
_BLOCK = 2**20  # [B] looked through at once
_REACH = 128  # [B] of a chunk's head; more than any has
_ROS1_CHUNK = re.compile(rb"op=\x05")
# op 6, length, times, size, checksum, then the name of the compression [mcap.dev/spec]
_MCAP_CHUNK = re.compile(rb"\x06(?=.{36}(?:\0{4}|\x03\0{3}lz4|\x04\0{3}zstd))", re.DOTALL)
_MESSAGE_HEAD = 38  # [B] of a message's header: conn, op, time [wiki.ros.org/Bags/Format/2.0]


def next_chunk(file: BinaryIO, position: int, size: int) -> int | None:
    """Return where the next chunk of a ROS 1 bag begins, or None; the file is left anywhere."""
    return _found(file, position, size, _ROS1_CHUNK, _ros1_chunk)


def next_mcap_chunk(file: BinaryIO, position: int, size: int) -> int | None:
    """Return where the next chunk of an MCAP file begins, or None; the file is left anywhere."""
    return _found(file, position, size, _MCAP_CHUNK, _mcap_chunk)


def next_message(chunk: bytes, position: int) -> int | None:
    """Return where the next message of a ROS 1 bag's chunk begins, or None."""
    mark = _U32.pack(_MESSAGE_HEAD)
    while (position := chunk.find(mark, position)) >= 0:
        head = _fields(chunk[position + 4 : position + 4 + _MESSAGE_HEAD])
        end = position + 4 + _MESSAGE_HEAD
        if head.get(b"op") == b"\x02" and head.keys() == {b"op", b"conn", b"time"} and end + 4 <= len(chunk):
            return position
        position += 1
    return None


def _found(
    file: BinaryIO,
    position: int,
    size: int,
    sign: re.Pattern[bytes],
    begin_of: Callable[[bytes, int], int | None],
) -> int | None:
    """Return the first place, from `position` on, at which a sign stands in the head of a chunk."""
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
    try:
        return header_fields(data)
    except (error, ValueError):
        return {}
