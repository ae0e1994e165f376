"""What a bag says of itself, held against the file before `rosbags` believes it."""

import re
import sqlite3
from pathlib import Path
from struct import Struct
from typing import BinaryIO, Literal, cast

from catenary.archives import RATIO, unpacked
from catenary.documents import shortened
from catenary.errors import FileFormatError

MOST_UNPACKED = 64 * 2**20  # [B] of all chunks of any bag; of a long one RATIO times its length
MOST_TOPICS = 1000
MOST_RECORDS = 500_000  # of MCAP; of a long file one for each ten bytes
MOST_DEFINITIONS = 48  # that differ, of the two dozen types that are ours: each takes a while to read
MOST_YAML = 2**18  # [B] of metadata.yaml; that of 500 topics has 200 kB
DEEPEST_YAML = 32  # lists and tables within each other
MOST_CHANNELS = 2**20  # [B] of all channels' own metadata, which is YAML again
MAGIC = b"\x89MCAP0\r\n"
_SCHEMA, _CHANNEL, _CHUNK, _CHUNK_INDEX = 3, 4, 6, 8  # records of MCAP [mcap.dev/spec]
_HEAD, _CHUNK_HEAD, _INDEX_HEAD = Struct("<BQ"), Struct("<QQQII"), Struct("<QQQQ")
# an anchor or an alias where a value stands, or a merge: some bytes of them can stand for gigabytes
_DEEP = re.compile(rb"(?m)^ {65}|(?:- ){33}")
_REPEATED = re.compile(rb"(?m)(?:^\s*|[:\-,\[{]\s+|[\[{,])[&*]\w+\s*(?:$|[,\]}])|<<")


def unpacked_at_most(size: int) -> int:
    """Return how many bytes all chunks of a bag of so many bytes may unpack to."""
    return max(MOST_UNPACKED, RATIO * size)


def chunks_at_most(size: int) -> int:
    """Return how many chunks a ROS 1 bag of so many bytes may have: one for each 500, where `rosbag` writes 768 kB."""
    return max(10_000, size // 500)


def check_bag(path: Path) -> None:
    """Check an MCAP file, or a ROS 2 bag (folder) of MCAP or SQLite."""
    if not path.is_dir():
        (_check_sqlite if path.suffix == ".db3" else _check_mcap)(path)
        return
    size = (path / "metadata.yaml").stat().st_size
    if size > MOST_YAML:
        raise FileFormatError(f"{path}/metadata.yaml: has {size} bytes, expected {MOST_YAML} at most")
    _check_yaml((path / "metadata.yaml").read_bytes(), f"{path}/metadata.yaml")
    for file in sorted(path.iterdir()):
        if file.suffix == ".mcap":
            _check_mcap(file)
        elif file.suffix == ".db3":
            _check_sqlite(file)
        elif file.suffix == ".zstd":
            _check_packed(file)


def _check_mcap(path: Path) -> None:
    size = path.stat().st_size
    left = unpacked_at_most(size)
    chunks: dict[int, int] = {}  # length of each record, by where it begins
    indexed: set[int] = set()
    channels = _Channels(path)
    with path.open("rb") as file:
        position = len(MAGIC)
        while position + _HEAD.size <= size - len(MAGIC):
            file.seek(position)
            kind, length = _HEAD.unpack(file.read(_HEAD.size))
            if position + _HEAD.size + length > size:
                raise FileFormatError(
                    f"{path}: the record at byte {position} has {length} bytes, the file ends after "
                    f"{size - position - _HEAD.size}"
                )
            if kind == _CHUNK:
                chunks[position] = _HEAD.size + length
                left -= _check_chunk(file, length, f"{path}: the chunk at byte {position}", left, channels)
            elif kind in (_SCHEMA, _CHANNEL):
                channels.check(kind, file.read(length))
            elif kind == _CHUNK_INDEX:
                start, taken = _check_index(file.read(length), f"{path}: the index at byte {position}")
                if start in indexed or chunks.get(start) != taken:
                    raise FileFormatError(
                        f"{path}: the index at byte {position} is of a chunk that is not there, or of one twice"
                    )
                indexed.add(start)
            position += _HEAD.size + length


class _Channels:
    """Schemas and channels that were found so far."""

    def __init__(self, path: Path) -> None:
        self._path, self._count, self._bytes = path, 0, 0
        self._records, self._most_records = 0, max(MOST_RECORDS, path.stat().st_size // 10)

    def count(self) -> None:
        """Count a record of a chunk."""
        self._records += 1
        if self._records > self._most_records:
            raise FileFormatError(f"{self._path}: more than {self._most_records} messages in a file of its size")

    def check(self, kind: int, data: bytes) -> None:
        self._count += 1
        self._bytes += len(data)
        # each stands in a chunk and in the summary
        if self._count > 4 * MOST_TOPICS or self._bytes > 4 * MOST_CHANNELS:
            raise FileFormatError(
                f"{self._path}: more than {MOST_TOPICS} schemas and channels, or {MOST_CHANNELS} bytes of them"
            )
        if kind == _CHANNEL:
            _check_yaml(data, f"{self._path}: a channel")


def _check_chunk(file: BinaryIO, length: int, where: str, left: int, channels: _Channels) -> int:
    """Check a chunk, whose data follow; return how many bytes it unpacks to."""
    if length < _CHUNK_HEAD.size + 8:
        raise FileFormatError(f"{where} has {length} bytes, expected {_CHUNK_HEAD.size + 8} at least")
    stated: int
    _, _, stated, _, name_length = _CHUNK_HEAD.unpack(file.read(_CHUNK_HEAD.size))
    inside = length - _CHUNK_HEAD.size - name_length - 8
    name = file.read(min(name_length, 32))
    packed = int.from_bytes(file.read(8), "little")
    if inside < 0 or name not in (b"", b"lz4", b"zstd"):
        raise FileFormatError(f"{where} is packed by {shortened(name)}, expected lz4, zstd or nothing")
    if packed != inside or (not name and stated != packed):
        raise FileFormatError(f"{where} has {inside} bytes, and states {packed}, unpacked {stated}")
    if stated > left:
        raise FileFormatError(f"{where} would unpack to {stated} bytes; {left} are left of what is read")
    data = file.read(packed)
    if name:
        try:
            data = unpacked(data, cast("Literal['lz4', 'zstd']", name.decode()), stated)
        except ValueError as error:
            raise FileFormatError(f"{where}: {error}") from error
    if len(data) != stated:
        raise FileFormatError(f"{where} unpacks to {len(data)} bytes, and states {stated}")
    position = 0
    while position + _HEAD.size <= len(data):
        kind, size = _HEAD.unpack_from(data, position)
        channels.count()
        if position + _HEAD.size + size > len(data):
            raise FileFormatError(f"{where}: a record in it has {size} bytes, and goes beyond the chunk")
        if kind in (_SCHEMA, _CHANNEL):
            channels.check(kind, data[position + _HEAD.size : position + _HEAD.size + size])
        position += _HEAD.size + size
    return stated


def _check_index(data: bytes, where: str) -> tuple[int, int]:
    if len(data) < _INDEX_HEAD.size:
        raise FileFormatError(f"{where} has {len(data)} bytes, expected {_INDEX_HEAD.size} at least")
    _, _, start, taken = _INDEX_HEAD.unpack_from(data)
    return start, taken


def _check_sqlite(path: Path) -> None:
    """Check that the tables hold what they say, and that nothing is worked out when they are read."""
    size = path.stat().st_size
    try:
        database = sqlite3.connect(f"{path.absolute().as_uri()}?immutable=1&mode=ro", uri=True)
        try:
            plain_tables(path, database)
            (topics,) = database.execute("SELECT count(*) FROM topics").fetchone()
            if topics > MOST_TOPICS:
                raise FileFormatError(f"{path}: has {topics} topics, expected {MOST_TOPICS} at most")
            (taken,) = database.execute("SELECT total(length(data)) FROM messages").fetchone()
            if taken > size:
                raise FileFormatError(f"{path}: its messages take {taken:.0f} bytes, the file has {size}")
            columns = [column for _, column, *_ in database.execute("PRAGMA table_info(topics)")]
            if "offered_qos_profiles" in columns:
                for (text,) in database.execute("SELECT offered_qos_profiles FROM topics"):
                    data = text if isinstance(text, bytes) else str(text).encode()
                    if len(data) > MOST_CHANNELS // 16:
                        raise FileFormatError(f"{path}: quality of service takes {len(data)} bytes")
                    _check_yaml(data, f"{path}: a topic")
        finally:
            database.close()
    except (sqlite3.Error, ValueError, OverflowError) as error:
        if isinstance(error, FileFormatError):
            raise
        raise FileFormatError(f"{path}: cannot be read as SQLite: {error}") from error


def plain_tables(path: Path, database: sqlite3.Connection) -> set[str]:
    """Return the names of tables and indices in a file, once it is certain that nothing is worked out when read."""
    database.execute("PRAGMA trusted_schema = OFF")
    names = set()
    for kind, name, text in database.execute("SELECT type, name, sql FROM sqlite_master"):
        computed = re.search(r"\bVIRTUAL\b|\bGENERATED\b|\bAS\s*\(|\bWHERE\b", str(text or ""), re.IGNORECASE)
        if kind not in ("table", "index") or computed:
            raise FileFormatError(f"{path}: {kind} {shortened(name)}: expected plain tables and indices")
        names.add(name)
    return names


def _check_packed(path: Path) -> None:
    data = path.read_bytes()
    try:
        unpacked(data, "zstd", unpacked_at_most(len(data)))
    except ValueError as error:
        raise FileFormatError(f"{path}: {error}") from error


def _check_yaml(data: bytes, where: str) -> None:
    """Refuse YAML that stands for more than it holds, or is nested deep: its reader's time grows with the square."""
    found = _REPEATED.search(data)
    if found:
        raise FileFormatError(
            f"{where}: expected plain YAML, without anchors, aliases and merges; got {shortened(found.group())}"
        )
    most = DEEPEST_YAML
    if _DEEP.search(data):
        raise FileFormatError(f"{where}: YAML is nested more than {most} levels deep")
    depth = 0
    for bracket in re.findall(rb"[\[\]{}]", data):
        depth += 1 if bracket in b"[{" else -1
        if depth > most:
            raise FileFormatError(f"{where}: YAML is nested more than {most} levels deep")
