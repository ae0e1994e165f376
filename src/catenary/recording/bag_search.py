"""The records of a bag, read within bounds; in a damaged one the next chunk, the next message, rows before the damage.

[wiki.ros.org/Bags/Format/2.0, mcap.dev/spec]
"""

import contextlib
import re
import sqlite3
from collections import Counter, deque
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from struct import Struct, error
from typing import BinaryIO, Literal, cast

from rosbags.interfaces import Connection, ConnectionExtRosbag2, MessageDefinition, MessageDefinitionFormat

from catenary.archives import unpacked
from catenary.recording.bag_checks import MOST_TOPICS, plain_tables

_U32, _U64 = Struct("<I"), Struct("<Q")
_BLOCK = 2**20  # [B] looked through at once
_REACH = 128  # [B] of a chunk's head; more than any has
_ROS1_CHUNK = re.compile(rb"op=\x05")
# op 6, length, times, size, checksum, then the name of the compression [mcap.dev/spec]
_MCAP_CHUNK = re.compile(rb"\x06(?=.{36}(?:\0{4}|\x03\0{3}lz4|\x04\0{3}zstd))", re.DOTALL)
_ROWS = "SELECT id, topic_id, timestamp, data FROM messages WHERE id > ? ORDER BY id"
_MESSAGE_HEAD = 38  # [B] of a message's header: conn, op, time [wiki.ros.org/Bags/Format/2.0]
# what reading damaged bytes raises
DAMAGE = (error, LookupError, ValueError, OSError, EOFError, RuntimeError, ArithmeticError, MemoryError)
MAX_HEADER = 2**20  # [B] of a record's header, or of a connection's


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
    file: BinaryIO, position: int, size: int, sign: re.Pattern[bytes], begin_of: Callable[[bytes, int], int | None]
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


class SqliteRows:
    """A SQLite file of a ROS 2 bag that is damaged, as `Reader` gives one, row by row, up to where it is damaged."""

    def __init__(self, path: Path) -> None:
        self.holes: list[tuple[int | None, int | None]] = []
        self.ends_early = False
        self._database = sqlite3.connect(f"{path.absolute().as_uri()}?immutable=1&mode=ro", uri=True)
        self._size = path.stat().st_size
        self._database.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, self._size)
        self._database.execute("PRAGMA writable_schema = ON")  # else one that was cut off is not opened at all
        plain_tables(path, self._database)
        read = self._database.execute
        texts = dict[str, str]()
        with contextlib.suppress(sqlite3.Error):  # older bags have none, and types of ROS's own are known
            texts |= dict(read("SELECT topic_type, encoded_message_definition FROM message_definitions"))
        self.connections = [
            Connection(
                number, name, kind, MessageDefinition(MessageDefinitionFormat.MSG, texts.get(kind, "")), "", 0,
                ConnectionExtRosbag2("cdr", []), self,
            )
            for number, name, kind in read("SELECT id, name, type FROM topics LIMIT ?", (MOST_TOPICS + 1,))
        ]  # fmt: skip
        counts = Counter(connection.id for connection, _, _ in self.messages(self.connections))
        self.connections = [each._replace(msgcount=counts[each.id]) for each in self.connections]

    def messages(self, connections: Sequence[Connection]) -> Iterator[tuple[Connection, int, bytes]]:
        """Yield connection, arrival stamp [ns] and bytes of each message before the damage, and of those behind it.

        Those within a page of the damage are left out: they may be of a page that is there in part.
        """
        wanted, read = {connection.id: connection for connection in connections}, self._database.execute
        (page,) = read("PRAGMA page_size").fetchone()
        left, seen, last, skipped, waiting, self.holes = (self._size, -1, None, 0, deque[tuple[int, int, bytes]](), [])
        for _ in range(2):
            with contextlib.suppress(sqlite3.Error):
                for place, number, stamp, data in read(_ROWS, (seen,)):
                    seen, is_whole = place, isinstance(data, bytes) and isinstance(stamp, int)
                    left, skipped = left - len(data or ()), max(0, skipped - len(data or ()) - 1)
                    if left < 0:  # pages that stand for more than there is
                        return
                    if not is_whole:
                        skipped = page
                        waiting.clear()
                        self.holes.append((last, None))
                    elif not skipped:
                        waiting.append((number, stamp, data))
                        while sum(len(each) for _, _, each in waiting) - len(waiting[0][2]) >= page:
                            number, last, data = waiting.popleft()
                            if number in wanted:
                                yield wanted[number], last, data
                yield from ((wanted[number], stamp, data) for number, stamp, data in waiting if number in wanted)
                return
            self.holes.append((last, None))
            waiting.clear()
            behind, skipped = seen, page
            with contextlib.suppress(sqlite3.Error):
                for (place,) in read("SELECT id FROM messages WHERE id > ? ORDER BY id DESC", (seen,)):
                    behind = place
            self.ends_early = behind == seen
            seen = behind - 1


def header_fields(data: bytes) -> dict[bytes, bytes]:
    """Return the fields of a record's header in a ROS 1 bag."""
    if len(data) > MAX_HEADER:
        raise ValueError(f"a header of {len(data)} bytes, expected {MAX_HEADER} at most")
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
    try:
        return ({} if head is None else header_fields(head)), data
    except DAMAGE:
        return {}, data


def chunk_of(values: dict[bytes, bytes], data: bytes, left: int) -> bytes:
    """Return a chunk of a ROS 1 bag, unpacked to the size that its header states."""
    kind = field_of(values, b"compression")
    if kind == b"none":
        return data
    stated = _U32.unpack(field_of(values, b"size", 4))[0]
    if kind not in (b"bz2", b"lz4"):
        raise ValueError(f"unknown compression {kind.decode(errors='replace')}")
    if stated > left:
        raise ValueError(f"a chunk would unpack to {stated} bytes; {left} are left of what is read")
    chunk = unpacked(data, cast("Literal['bz2', 'lz4']", kind.decode()), stated)
    if len(chunk) != stated:
        raise ValueError(f"a chunk unpacks to {len(chunk)} bytes, and states {stated}")
    return chunk


def text_at(data: bytes, position: int) -> tuple[str, int]:
    """Return the text of MCAP that stands there behind its length, and where it ends."""
    length = _U32.unpack_from(data, position)[0]
    end = position + 4 + length
    if end > len(data):
        raise ValueError(f"a text of {length} bytes, its record ends after {len(data) - position - 4}")
    return data[position + 4 : end].decode(), end
