"""Bags read from their first byte to their last, without the index at their end, which a bag that was cut off lacks."""

import bz2
from collections.abc import Callable, Collection, Iterator
from io import BytesIO
from pathlib import Path
from struct import Struct, error
from typing import BinaryIO, TypeVar

import numpy as np
from lz4.frame import decompress as lz4_decompress  # type: ignore[import-untyped]
from numpy.typing import NDArray

from catenary.documents import json_table
from catenary.errors import FileFormatError
from catenary.recording.bag_chunks import (
    CONNECTION,
    DATA,
    END,
    HEADER,
    KIND,
    TIME,
    Block,
    Records,
    chunk_records,
    gather,
)
from catenary.recording.journal import About, JournalTopic
from catenary.recording.layout import Encoding
from catenary.recording.messages import check_ros1_type, check_ros2_type, current_name
from catenary.recording.topics import ABOUT_TOPIC, require_topics

ROS1_MAGIC = b"#ROSBAG V2.0\n"
MCAP_MAGIC = b"\x89MCAP0\r\n"
# record types of a ROS 1 bag [wiki.ros.org/Bags/Format/2.0]
_MESSAGE, _BAG_HEADER, _CHUNK, _CHUNK_INFO, _CONNECTION = 2, 3, 5, 6, 7
_SCHEMA, _CHANNEL, _MCAP_MESSAGE, _MCAP_CHUNK, _DATA_END = 3, 4, 5, 6, 15  # of MCAP [mcap.dev/spec]
_CHUNK_HEAD = 60  # [B] before a chunk's records, at most; a shorter one holds none
_U16, _U32, _U64 = Struct("<H"), Struct("<I"), Struct("<Q")
_UNPACK = {b"none": bytes, b"bz2": bz2.decompress, b"lz4": lz4_decompress}

Read = TypeVar("Read")


class BagStream:
    """Reads a ROS 1 bag, or an MCAP file that was cut off, from its beginning, in the order it was recorded in.

    It reads up to the last whole message, or the last whole chunk where chunks are compressed. `problems` says
    where that was; a bag without its index has one, too.
    """

    def __init__(self, path: Path) -> None:
        """Read the file once, to find its topics.

        Raises:
            FileFormatError: No such kind of file, or message types that are not ours.
        """
        self.path = path
        self.problems: list[str] = []
        with path.open("rb") as file:
            begin = file.read(len(ROS1_MAGIC))
        self.has_blocks = begin == ROS1_MAGIC  # `blocks` can read it: a ROS 1 bag
        if not self.has_blocks and not begin.startswith(MCAP_MAGIC):
            raise FileFormatError(
                f"{path}: cannot be read: begins neither as a ROS 1 bag nor as MCAP; nothing in it can be saved"
            )
        self.encoding: Encoding = "ros1" if self.has_blocks else "cdr"
        self.about: About | None = None
        self._types: dict[str, str] = {}
        self.counts: dict[str, int] = {}
        found = self._guarded(self._bag_counts) if self.has_blocks else self._guarded(self._mcap_counts)
        for name, number, first in found:
            if name == ABOUT_TOPIC:
                self.about = about_of(path, first, self.encoding)
            else:
                self.counts[name] = self.counts.get(name, 0) + number
        self.topics = tuple(JournalTopic(n, t) for n, t in self._types.items() if n != ABOUT_TOPIC)

    def whole_text(self) -> str:
        """Return in words what can still be read."""
        if not self.counts:
            return "no whole message is in it, nothing can be saved"
        found = ", ".join(f"{count} messages of {topic}" for topic, count in self.counts.items())
        return f"{found} can be saved: extract(..., salvage=True) reads them"

    def messages(self, topics: Collection[str] | None = None) -> Iterator[tuple[str, int, bytes]]:
        """Yield topic, arrival stamp [ns] and bytes of every whole message of these topics, or of all.

        Raises:
            FileFormatError: A topic is not in the bag.
        """
        require_topics(self.path, topics, self._types)
        self.problems.clear()
        for message in self._guarded(self._bag_messages if self.has_blocks else self._mcap):
            if message[0] != ABOUT_TOPIC and (topics is None or message[0] in topics):
                yield message

    def blocks(self, topics: Collection[str]) -> Iterator[tuple[str, NDArray[np.int64], Block]]:
        """Yield topic, arrival stamps [ns] (N,) and messages of every chunk of a ROS 1 bag, no object for each.

        Within a topic messages keep their order.
        """
        self.problems.clear()
        for chunk, name, records in self._guarded(self._bag_topics):
            if name in topics:
                yield name, records[:, TIME], gather(chunk, records)

    def _guarded(self, read: Callable[[BinaryIO, int], Iterator[Read]]) -> Iterator[Read]:
        """Read up to what is damaged, which becomes a problem."""
        with self.path.open("rb") as file:
            size = file.seek(0, 2)
            file.seek(len(ROS1_MAGIC) if self.has_blocks else len(MCAP_MAGIC))
            try:
                yield from read(file, size)
            except (error, KeyError, ValueError, OSError, EOFError, RuntimeError) as problem:
                if isinstance(problem, FileFormatError):
                    raise
                self.problems.append(f"{self.path}: damaged before byte {file.tell()}: {problem}")

    def _cut_off(self, left: int) -> None:
        self.problems.append(f"{self.path}: is cut off within its last {left} bytes")

    def _unpacked(self, file: BinaryIO, size: int) -> Iterator[bytes]:
        """Yield the chunks of a ROS 1 bag."""
        missing = None  # records that the bag's header promises behind the chunks
        while file.tell() < size:
            start = file.tell()
            head = _sized(file, size)
            data = None if head is None else _sized(file, size)
            values = {} if head is None else _header(head)
            if data is None:
                if values.get(b"compression") == b"none":
                    yield file.read()
                self._cut_off(size - start)
                return
            kind = values[b"op"][0]
            if kind == _BAG_HEADER and _U64.unpack(values[b"index_pos"])[0]:
                missing = _U32.unpack(values[b"conn_count"])[0] + _U32.unpack(values[b"chunk_count"])[0]
            elif kind in (_CHUNK_INFO, _CONNECTION) and missing is not None:
                missing -= 1
            elif kind == _CHUNK:
                unpack = _UNPACK.get(values[b"compression"])
                if unpack is None:
                    raise ValueError(f"unknown compression {values[b'compression'].decode(errors='replace')}")
                yield unpack(data)
        if missing != 0:
            self.problems.append(f"{self.path}: lacks its index, or part of it: it was cut off or not closed")

    def _bag_chunks(self, file: BinaryIO, size: int) -> Iterator[tuple[bytes, Records, dict[int, str]]]:
        """Yield every chunk, the records of its messages, and the topics of connections by number."""
        names: dict[int, str] = {}
        for chunk in self._unpacked(file, size):
            records = chunk_records(chunk)
            damaged = np.flatnonzero(records[:, KIND] < 0)
            whole = records[: damaged[0]] if len(damaged) else records  # what comes before it can be read
            for row in whole[whole[:, KIND] == _CONNECTION].tolist():
                names[row[CONNECTION]] = self._bag_connection(chunk, row)
            yield chunk, whole[whole[:, KIND] == _MESSAGE], names
            if len(damaged):
                raise ValueError("the header of a record is damaged")

    def _bag_messages(self, file: BinaryIO, size: int) -> Iterator[tuple[str, int, bytes]]:
        for chunk, records, names in self._bag_chunks(file, size):
            for row in records.tolist():
                yield names[row[CONNECTION]], row[TIME], chunk[row[DATA] : row[END]]

    def _bag_topics(self, file: BinaryIO, size: int) -> Iterator[tuple[bytes, str, Records]]:
        """Yield every chunk with each topic that it has messages of, and their records."""
        for chunk, records, names in self._bag_chunks(file, size):
            numbers = records[:, CONNECTION]
            topics = {number: names[number] for number in dict.fromkeys(numbers.tolist())}
            for name in dict.fromkeys(topics.values()):
                own = [number for number, topic in topics.items() if topic == name]
                yield chunk, name, records if len(own) == len(topics) else records[np.isin(numbers, own)]

    def _bag_counts(self, file: BinaryIO, size: int) -> Iterator[tuple[str, int, bytes]]:
        for chunk, name, records in self._bag_topics(file, size):
            yield name, len(records), chunk[records[0, DATA] : records[0, END]]

    def _bag_connection(self, chunk: bytes, row: list[int]) -> str:
        """Check and keep the type of a connection's topic; return the topic."""
        values = _header(chunk[row[HEADER] : row[DATA] - 4])
        about = _header(chunk[row[DATA] : row[END]])
        name, kind = values[b"topic"].decode(), about[b"type"].decode()
        text = about[b"message_definition"].decode(errors="replace")
        check_ros1_type(self.path, name, kind, about[b"md5sum"].decode(), text)
        self._types[name] = current_name(kind)
        return name

    def _mcap_counts(self, file: BinaryIO, size: int) -> Iterator[tuple[str, int, bytes]]:
        for name, _, data in self._mcap(file, size):
            yield name, 1, data

    def _mcap(self, file: BinaryIO, size: int) -> Iterator[tuple[str, int, bytes]]:
        schemas: dict[int, tuple[str, str]] = {}
        names: dict[int, str] = {}
        for kind, data, is_whole in _mcap_records(file, size):
            records = [(kind, data)] if is_whole else []
            if kind == _DATA_END:
                return  # whole but for the index
            if kind == _MCAP_CHUNK and len(data) > _CHUNK_HEAD:
                compression, position = _text(data, 28)
                if compression and is_whole:
                    raise ValueError(f"chunks compressed by {compression} are not read here")
                inside = b"" if compression else data[position + 8 :]
                found = _mcap_records(BytesIO(inside), len(inside))
                records = [(kind, data) for kind, data, is_whole in found if is_whole]
            for kind, data in records:
                yield from self._mcap_record(kind, data, schemas, names)
            if not is_whole:
                self._cut_off(9 + len(data))

    def _mcap_record(
        self, kind: int, data: bytes, schemas: dict[int, tuple[str, str]], names: dict[int, str]
    ) -> Iterator[tuple[str, int, bytes]]:
        number = _U16.unpack_from(data)[0] if kind in (_SCHEMA, _CHANNEL, _MCAP_MESSAGE) else 0
        if kind == _SCHEMA:
            name, position = _text(data, 2)
            _, position = _text(data, position)
            schemas[number] = name, _text(data, position)[0]
        elif kind == _CHANNEL:
            name, _ = _text(data, 4)
            schema, text = schemas[_U16.unpack_from(data, 2)[0]]
            check_ros2_type(self.path, name, schema, text)
            names[number], self._types[name] = name, current_name(schema)
        elif kind == _MCAP_MESSAGE:
            yield names[number], _U64.unpack_from(data, 6)[0], data[22:]


def about_of(path: Path, data: bytes, encoding: Encoding) -> About:
    """Read the message on `/catenary/recording`.

    Raises:
        FileFormatError: It does not hold what is written there.
    """
    where = f"{path}: {ABOUT_TOPIC}"
    text = data[4:] if encoding == "ros1" else data[8:].rstrip(b"\0")
    return About.from_mapping(json_table(text, where, finite=False), where)


def _mcap_records(file: BinaryIO, size: int) -> Iterator[tuple[int, bytes, bool]]:
    """Yield kind and data of every record, and whether it is whole: the last one may not be."""
    while len(head := file.read(9)) == 9:
        length = _U64.unpack_from(head, 1)[0]
        data = file.read(min(length, size))
        yield head[0], data, len(data) == length


def _sized(file: BinaryIO, size: int) -> bytes | None:
    """Bytes behind their length, or None where the file ends first."""
    if file.tell() + 4 > size:
        return None
    length = _U32.unpack(file.read(4))[0]
    return file.read(length) if file.tell() + length <= size else None  # else what is there can still be read


def _header(data: bytes) -> dict[bytes, bytes]:
    values, position = {}, 0
    while position < len(data):
        length = _U32.unpack_from(data, position)[0]
        key, _, value = data[position + 4 : position + 4 + length].partition(b"=")
        values[key] = value
        position += 4 + length
    return values


def _text(data: bytes, position: int) -> tuple[str, int]:
    length = _U32.unpack_from(data, position)[0]
    end = position + 4 + length
    return data[position + 4 : end].decode(), end
