"""Bags that say of themselves what is not so."""

import sqlite3
import struct
from pathlib import Path

import pyarrow as pa
import pytest
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer

from catenary.errors import CatenaryError, FileFormatError
from catenary.recording.bag_reader import open_recording
from catenary.recording.bag_records import _MAX_UNPACKED_BYTES, MAX_TOPICS
from catenary.recording.bag_stream import BagStream
from catenary.recording.messages import typestore

TEXT = typestore(2).serialize_cdr(typestore(2).types["std_msgs/msg/String"](data="a"), "std_msgs/msg/String")


def _ros2(folder: Path, kind: str, *, packed: str | None = None) -> Path:
    writer = Writer(folder, version=8, storage_plugin=StoragePlugin[kind])
    if packed is not None:
        writer.set_compression(CompressionMode[packed], CompressionFormat.ZSTD)
    with writer as bag:
        to = bag.add_connection("/a", "std_msgs/msg/String", typestore=typestore(2))
        for i in range(5):
            bag.write(to, i, TEXT)
    return folder


def _refused(path: Path, said: str) -> None:
    """Refused, or told as damage, by its file."""
    try:
        source = open_recording(path)
        list(source.messages())
        told = "; ".join(source.problems)
    except FileFormatError as error:
        told = str(error)
    assert said in told
    assert str(path) in told


@pytest.mark.parametrize(
    ("kind", "packed"), [("MCAP", None), ("MCAP", "STORAGE"), ("SQLITE3", None), ("SQLITE3", "MESSAGE")]
)
def test_bags_of_ros2_are_read_packed_or_not(tmp_path: Path, kind: str, packed: str | None) -> None:
    source = open_recording(_ros2(tmp_path / "a", kind, packed=packed))
    assert list(source.messages()) == [("/a", i, bytes(TEXT)) for i in range(5)]


def _record(kind: int, data: bytes) -> bytes:
    return struct.pack("<BQ", kind, len(data)) + data


def _text(text: str) -> bytes:
    return struct.pack("<I", len(text)) + text.encode()


def _mcap(*records: bytes) -> bytes:
    magic = b"\x89MCAP0\r\n"
    head = _record(1, struct.pack("<I", 4) + b"ros2" + struct.pack("<I", 0))
    return magic + head + b"".join(records) + _record(2, bytes(20)) + magic


def _chunk(stated: int, name: bytes, data: bytes, taken: int | None = None) -> bytes:
    head = struct.pack("<QQQII", 0, 1, stated, 0, len(name)) + name
    return _record(6, head + struct.pack("<Q", len(data) if taken is None else taken) + data)


BOMB = pa.compress(bytes(_MAX_UNPACKED_BYTES + 1), "zstd", asbytes=True)
CLAIMS = {
    "a record beyond the file": (struct.pack("<BQ", 5, 2**62), "is cut off"),
    "a length beyond 63 bits": (struct.pack("<BQ", 5, 2**64 - 1), "is cut off"),
    "a chunk that unpacks too far": (_chunk(len(BOMB) * 10**6, b"zstd", BOMB), "would unpack to"),
    "a chunk that unpacks further than it states": (_chunk(10, b"zstd", BOMB), "more than 10 bytes"),
    "a chunk that unpacks to less": (_chunk(10, b"zstd", pa.compress(b"x", "zstd", asbytes=True)), "and states 10"),
    "a chunk of another length": (_chunk(10, b"", bytes(9)), "unpacked 10"),
    "a chunk whose data end elsewhere": (_chunk(9, b"", bytes(9), 8), "states 8"),
    "an unknown packing": (_chunk(9, b"rar", bytes(9)), "unknown compression rar"),
    "a record beyond its chunk": (_chunk(9, b"", struct.pack("<BQ", 5, 2**40)), "do not fill it"),
    "very many channels": (
        _record(3, struct.pack("<H", 1) + _text("a/B") + _text("ros2msg") + _text("int8 a"))
        + b"".join(
            _record(4, struct.pack("<HH", i, 1) + _text(f"/{i}") + _text("cdr") + bytes(4))
            for i in range(MAX_TOPICS + 1)
        ),
        f"more than {MAX_TOPICS} topics",
    ),
}


@pytest.mark.parametrize(("record", "said"), CLAIMS.values(), ids=CLAIMS)
def test_what_an_mcap_file_says_of_itself_is_held_against_it(tmp_path: Path, record: bytes, said: str) -> None:
    (tmp_path / "a.mcap").write_bytes(_mcap(record))
    _refused(tmp_path / "a.mcap", said)


TABLES = {
    "a view": ("DROP TABLE topics; CREATE VIEW topics AS SELECT 1", "view 'topics'"),
    "a generated column": (
        "ALTER TABLE messages ADD COLUMN x BLOB GENERATED ALWAYS AS (zeroblob(1000000000)) VIRTUAL",
        "table 'messages'",
    ),
    "a trigger": ("CREATE TRIGGER t AFTER DELETE ON topics BEGIN SELECT 1; END", "trigger 't'"),
    "no tables": ("DROP TABLE messages", "cannot be read as SQLite to its end"),
    "bytes in place of a name": ("UPDATE topics SET name = x'ff'", "expected texts"),
    "a number in place of a message": ("UPDATE messages SET data = 3 WHERE id = 3", "a message without its bytes"),
}


@pytest.mark.parametrize(("change", "said"), TABLES.values(), ids=TABLES)
def test_what_a_database_says_of_itself_is_checked_first(tmp_path: Path, change: str, said: str) -> None:
    bag = _ros2(tmp_path / "a", "SQLITE3")
    database = sqlite3.connect(bag / "a.db3")
    database.executescript(change)
    database.close()
    _refused(bag, said)


def test_a_message_that_unpacks_too_far_is_refused(tmp_path: Path) -> None:
    bag = _ros2(tmp_path / "a", "SQLITE3", packed="MESSAGE")
    database = sqlite3.connect(bag / "a.db3")
    with database:
        database.execute("UPDATE messages SET data = ? WHERE id = 3", (BOMB,))
    database.close()
    _refused(bag, "unpack to more than")


def _bag(folder: Path, packing: str | None = None) -> bytearray:
    writer = Writer1(folder / "whole.bag")
    if packing is not None:
        writer.set_compression(Writer1.CompressionFormat[packing])
    with writer as bag:
        to = bag.add_connection("/a", "std_msgs/msg/String", typestore=typestore(1))
        for i in range(5):
            bag.write(to, i, b"\1\0\0\0a")
    return bytearray((folder / "whole.bag").read_bytes())


@pytest.mark.parametrize("packing", ["BZ2", "LZ4"])
@pytest.mark.parametrize(
    ("size", "said"), [(2**32 - 1, "would unpack to"), (1, "more than 1 bytes"), (10**6, "states")]
)
def test_a_chunk_is_unpacked_as_far_as_it_states(tmp_path: Path, packing: str, size: int, said: str) -> None:
    content = _bag(tmp_path, packing)
    place = content.index(b"size=") + 5
    content[place : place + 4] = struct.pack("<I", size)
    path = tmp_path / "a.bag"
    path.write_bytes(content)
    _refused(path, said)
    assert said in BagStream(path).problems[0]


@pytest.mark.parametrize("field", [b"size=", b"compression=", b"index_pos=", b"conn_count=", b"type=", b"topic="])
def test_a_header_that_lacks_a_field_is_refused_by_its_name(tmp_path: Path, field: bytes) -> None:
    content = bytes(_bag(tmp_path, "LZ4" if field == b"size=" else None))
    path = tmp_path / "a.bag"
    path.write_bytes(content.replace(field, b"x" * (len(field) - 1) + b"="))
    _refused(path, f"without {field[:-1].decode()}")


def test_a_topic_of_two_types_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.bag"
    with Writer1(path) as bag:
        for kind in ("String", "Bool"):
            to = bag.add_connection("/a", f"std_msgs/msg/{kind}", typestore=typestore(1))
            bag.write(to, 1, b"\0\0\0\0")
    with pytest.raises(CatenaryError, match="topic /a: is of type std_msgs/String and of std_msgs/Bool"):
        open_recording(path)
