"""Topics of any message type from ROS 1 bags, ROS 2 bags and MCAP files, message by message, as columns of numbers."""

import re
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catenary.documents import cut
from catenary.errors import FileFormatError
from catenary.recording.bag_stream import BagStream
from catenary.recording.import_formats.columns import Stream
from catenary.recording.import_formats.definitions import fields_by_definition
from catenary.recording.layout import COUNT, Encoding, FieldsOf, read_messages
from catenary.recording.messages import current_name
from catenary.recording.parquet_files import MOST_COLUMNS
from catenary.recording.source import first_arrival, open_ros2
from catenary.recording.topics import SECOND

SAMPLED = 1000  # messages of a topic, evenly over the bag, from which its columns, rate and range are told
LONGEST = 65_536  # [B] of a message that is looked at for a proposal: images and clouds are longer
MOST_DEFINED = 1_000_000  # characters of all definitions that differ: reading them takes time
_BATCH = 4096
_MOST_JOINTS = 1000
_NAMES = ("name", "names", "joint_names")  # fields that name the elements of the arrays beside them


class Bag:
    """A ROS 1 bag, an MCAP file or a ROS 2 bag (folder), whose types may be any."""

    def __init__(self, path: Path) -> None:
        """Open it."""
        self.path = path
        is_ros1 = path.suffix == ".bag" and path.is_file()
        self._reader = BagStream(path, any_types=True) if is_ros1 else open_ros2(path, any_types=True)
        self.encoding: Encoding = self._reader.encoding
        self._known: dict[str, FieldsOf] = {}  # by topic
        self._parsed: dict[tuple[str, str], FieldsOf] = {}  # by type and definition
        self.counts = {name: count for name, count in self._reader.counts.items() if count}

    @property
    def first_arrival(self) -> int:
        """When its first message arrived [ns]."""
        return first_arrival(self._reader)

    @property
    def problems(self) -> list[str]:
        """What was damaged; complete once messages were read."""
        return self._reader.problems

    def sample(self) -> list[Stream]:
        """Return some messages of every topic, evenly over the recording; topics that cannot be read have a note."""
        streams: list[Stream] = []
        every = {name: -(-count // SAMPLED) for name, count in self.counts.items()}
        seen = dict.fromkeys(self.counts, 0)

        def chosen(topic: str, data: bytes) -> bool:
            seen[topic] += 1
            return (seen[topic] - 1) % every[topic] == 0 and len(data) <= LONGEST

        readable = {}
        for name in self.counts:
            kind = self._reader.connections[name].type
            try:
                readable[name] = self._fields(name)
            except FileFormatError as error:
                streams.append(Stream(name, kind, {}, self.counts[name], notes=(str(error),)))
        for name, columns in self._collected(readable, None, chosen).items():
            try:
                streams.append(self._stream(name, columns))
            except FileFormatError as error:  # harms no other topic
                kind = self._reader.connections[name].type
                streams.append(Stream(name, kind, {}, self.counts[name], notes=(str(error),)))
        return [s for name in self.counts for s in streams if s.name == name]

    def read(self, wanted: Mapping[str, Collection[str]]) -> list[Stream]:
        """Return topics with the columns that are wanted of each, all messages."""
        fields = {name: self._fields(name) for name in wanted}
        collected = self._collected(fields, wanted, lambda topic, data: True)
        return [self._stream(name, columns) for name, columns in collected.items()]

    def _fields(self, topic: str) -> FieldsOf:
        if topic not in self._known:
            connection = self._reader.connections[topic]
            key = (connection.type, connection.definition)
            if key not in self._parsed:
                read = sum(len(text) for _, text in self._parsed)
                if read > MOST_DEFINED:
                    raise FileFormatError(
                        f"{self.path}: topic {cut(topic)}: types before it have {read} characters, "
                        f"{MOST_DEFINED} are read"
                    )
                self._parsed[key] = fields_by_definition(self.path, connection, self.encoding)
            self._known[topic] = self._parsed[key]
        return self._known[topic]

    def _stream(self, name: str, columns: "_TopicColumns") -> Stream:
        return columns.stream(name, self.counts[name], f"{self.path}: topic {cut(name)}")

    def _collected(
        self,
        fields: Mapping[str, FieldsOf],
        wanted: Mapping[str, Collection[str]] | None,
        chosen: Callable[[str, bytes], bool],
    ) -> dict[str, "_TopicColumns"]:
        connections = self._reader.connections
        columns = {
            name: _TopicColumns(connections[name].type, self.encoding, fields[name], wanted and wanted[name])
            for name in fields
        }
        for name, stamp, data in self._reader.messages(list(fields)) if fields else ():
            if chosen(name, data):
                columns[name].add(stamp, data)
        return columns


@dataclass
class _TopicColumns:
    """Numbers of a topic's messages as they come."""

    type: str
    encoding: Encoding
    fields_of: FieldsOf
    wanted: Collection[str] | None  # all when None
    _stamps: list[int] = field(default_factory=list)
    _waiting: list[bytes] = field(default_factory=list)
    _parts: list[tuple[int, dict[str, NDArray[Any]]]] = field(default_factory=list)
    _joints: dict[str, tuple[str, ...]] = field(default_factory=dict)
    _notes: dict[str, None] = field(default_factory=dict)

    def add(self, stamp: int, data: bytes) -> None:
        self._stamps.append(stamp)
        self._waiting.append(data)
        if len(self._waiting) >= _BATCH:
            self._read()

    def stream(self, name: str, rows: int, where: str) -> Stream:
        """Return what came, in the order in which it arrived."""
        try:
            self._read()
        except FileFormatError as error:
            raise FileFormatError(f"{where}: {error}") from error
        count = sum(length for length, _ in self._parts)
        names = dict.fromkeys(column for _, part in self._parts for column in part if column)
        if len(names) > MOST_COLUMNS:
            raise FileFormatError(f"{where}: {len(names)} columns, expected {MOST_COLUMNS} at most")
        columns = {column: np.full(count, np.nan) for column in names}
        stamp = np.zeros(count, dtype=np.int64)
        first = 0
        for length, part in self._parts:
            for column, values in part.items():
                (columns[column] if column else stamp)[first : first + length] = values
            first += length
        arrival = np.array(self._stamps, dtype=np.int64)
        return Stream(name, self.type, columns, rows, stamp, arrival, self._joints, notes=tuple(self._notes))

    def _read(self) -> None:
        """Turn the messages that wait into columns; those of one shape together."""
        waiting, self._waiting = self._waiting, []
        part: dict[str, NDArray[Any]] = {}
        if not waiting:
            return
        for rows, records in read_messages(current_name(self.type), waiting, self.encoding, self.fields_of):
            for inside, column, values in self._numbers(records):
                if len(part) > MOST_COLUMNS:  # before as many arrays are made
                    raise FileFormatError(f"more than {MOST_COLUMNS} columns")
                if column == "" and column not in part:
                    part[""] = np.zeros(len(waiting), dtype=np.int64)
                elif column not in part:
                    part[column] = np.full(len(waiting), np.nan)
                part[column][rows[inside]] = values
        self._parts.append((len(waiting), part))

    def _numbers(self, records: NDArray[np.void]) -> Iterator[tuple[NDArray[np.int64], str, NDArray[Any]]]:
        """Yield rows, column and numbers; the stamp of the header as the column "" [ns]."""
        every = np.arange(len(records))
        kinds: Mapping[str, Any] = records.dtype.fields or {}
        stamp = _stamp_path(kinds)
        if stamp is not None:
            seconds = records[f"{stamp}.sec"].astype(np.int64)
            yield every, "", seconds * SECOND + records[f"{stamp}.nsec"].astype(np.int64)
        named = _named_arrays(kinds)
        orders = {names: _orders(records, kinds, names) for names in set(named.values())}
        for path, (kind, *_) in kinds.items():
            if path.startswith(COUNT) or kind.base.kind not in "iuf" or path.endswith((".sec", ".nsec")):
                continue
            column = re.sub(r"\.(\d+)(?=\.|$)", r"[\1]", path)
            if not kind.shape:
                if self._is_wanted(column):
                    yield every, column, records[path].astype(np.float64)
                continue
            if path in named:
                for rows, joints in orders[named[path]]:
                    for i, target in enumerate(self._joint_columns(column, joints, kind.shape[0])):
                        if self._is_wanted(target):
                            yield rows, target, records[path][rows, i].astype(np.float64)
                continue
            for i in range(kind.shape[0]):
                if self._is_wanted(f"{column}[{i}]"):
                    yield every, f"{column}[{i}]", records[path][:, i].astype(np.float64)

    def _is_wanted(self, column: str) -> bool:
        return self.wanted is None or column in self.wanted

    def _joint_columns(self, array: str, joints: Sequence[str], count: int) -> list[str]:
        """Return the column of each element: by its joint's name where it has one."""
        if len(joints) != count or len(set(joints)) != count:
            return [f"{array}[{i}]" for i in range(count)]
        known = self._joints.setdefault(array, tuple(joints))
        if tuple(joints) != known:
            note = "joints change their order or number between messages; they were followed by name"
            self._notes[note] = None
            new = tuple(joint for joint in joints if joint not in known)
            self._joints[array] = (known + new)[:_MOST_JOINTS]
        return [f"{array}[{joint}]" for joint in joints]


def _stamp_path(kinds: Mapping[str, Any]) -> str | None:
    """Return the path of a message's own stamp: of its header, or its first field that is a time."""
    stamps = [path.removesuffix(".sec") for path in kinds if re.fullmatch(r"\w+(\.stamp)?\.sec", path)]
    headers = [path for path in stamps if path.endswith(".stamp")]
    plain = [path for path in stamps if path in ("stamp", "time", "timestamp")]
    return next(iter([*headers, *plain]), None)


def _named_arrays(kinds: Mapping[str, Any]) -> dict[str, str]:
    """Return arrays of numbers whose elements a list of texts beside them names."""
    named = {}
    for path, (kind, *_) in kinds.items():
        prefix = path[: path.rfind(".") + 1]
        names = next((prefix + name for name in _NAMES if f"{COUNT}{prefix}{name}" in kinds), None)
        if kind.shape and names is not None and f"{names}.0" in kinds:
            named[path] = names
    return named


def _orders(
    records: NDArray[np.void], kinds: Mapping[str, Any], names: str
) -> list[tuple[NDArray[np.int64], list[str]]]:
    """Return the orders of joints that occur, each with its rows."""
    fields: list[str] = []
    while f"{names}.{len(fields)}" in kinds and len(fields) < _MOST_JOINTS:
        fields.append(f"{names}.{len(fields)}")
    texts = [bytes(records[0][one]) for one in fields]
    same = np.ones(len(records), dtype=bool)
    for one in fields:
        same &= records[one] == records[one][0]
    groups: dict[tuple[bytes, ...], list[int]] = {}
    for row in np.flatnonzero(~same).tolist():
        groups.setdefault(tuple(bytes(records[row][one]) for one in fields), []).append(row)
    found = [(np.flatnonzero(same), texts)]
    found += [(np.array(rows, dtype=np.int64), list(order)) for order, rows in groups.items()]
    return [(rows, [text.rstrip(b"\0").decode(errors="replace") for text in order]) for rows, order in found]
