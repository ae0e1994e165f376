"""The files of one recording, whatever format they are in, opened as streams of columns; messages thousands at once.

Types are read as the bag defines them, or ROS where the bag does not say. A RAVEN-II's raven_state comes in SI, its
elements by name, `jpos[gold_elbow]`: `raven2/topics.py` knows what the robot publishes.
"""

import re
import time
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import chain
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from catenary.arrays import Integers
from catenary.bounded_parsers import cut
from catenary.errors import FileFormatError, InputError
from catenary.file_formats import format_of
from catenary.files import fingerprint, sha256_of
from catenary.raven2.topics import RAVENSTATE
from catenary.recording.bag_reader import bags_in, open_recording
from catenary.recording.bag_records import Block
from catenary.recording.import_formats.columns import Stream, joined
from catenary.recording.import_formats.csv_files import TextTable
from catenary.recording.import_formats.synchronisation import DIFFERENT_CLOCKS_S
from catenary.recording.import_formats.table_files import read_table_file
from catenary.recording.journal import About, same_origin
from catenary.recording.layout import COUNT, Encoding, FieldsOf, fields_by_definition, read_messages
from catenary.recording.messages import current_name
from catenary.recording.parquet_files import MOST_COLUMNS
from catenary.topics import SECOND

_SAMPLED_MESSAGES = 1000  # of a topic, evenly over the bag, from which its columns, rate and range are inferred
_MAX_SAMPLED_BYTES = 65_536  # [B] of a message that is looked at for a proposal: images and clouds are longer
_BATCH_MESSAGES = 4096
_MAX_JOINTS = 1000
_NAMES = ("name", "names", "joint_names", "interface_names")  # fields that name the elements of the arrays beside them
_Blocks = Iterator[tuple[str, Integers, Block]]


class Bag:
    """A ROS 1 bag, an MCAP file, a ROS 2 bag (folder) or a journal, whose types may be any."""

    def __init__(self, path: Path, progress: Callable[[float], object] = lambda done: None) -> None:
        """Open it; `progress` is called with the share of its messages that were read."""
        self.path, self._progress = path, progress
        self._reader = open_recording(path)
        self.encoding: Encoding = self._reader.encoding
        self._parsed: dict[tuple[str, str], FieldsOf] = {}  # by type and definition
        self.counts = {name: count for name, count in self._reader.counts.items() if count}
        self.about = self._reader.about
        self.first_arrival = 2**63 if self._reader.first is None else self._reader.first  # [ns]

    @property
    def problems(self) -> list[str]:
        """What was damaged; complete once messages were read."""
        return self._reader.problems

    def sample(self) -> list[Stream]:
        """Return some messages of every topic, evenly over the recording; topics that cannot be read have a note."""
        streams: dict[str, Stream] = {}
        columns: dict[str, _TopicColumns] = {}
        for name in self.counts:
            try:
                columns[name] = self._columns(name, None)
            except FileFormatError as error:  # harms no other topic
                streams[name] = self._unread(name, error)
        for name, arrivals, block in self._evenly(columns):
            columns[name].add(arrivals, block)
        for name, column in columns.items():
            try:
                streams[name] = replace(column.taken(), rows=self.counts[name])
            except FileFormatError as error:
                streams[name] = self._unread(name, error)
        return [streams[name] for name in self.counts]

    def parts(self, requested: Mapping[str, Collection[str]]) -> Iterator[list[Stream]]:
        """Yield the columns that are wanted of topics, thousands of messages at once, in the order of arrival."""
        columns = {name: self._columns(name, those) for name, those in requested.items()}
        seen, every = 0, max(1, sum(self.counts[name] for name in columns))
        in_chunk = set[str]()  # topics, whose messages come topic by topic
        for name, arrivals, block in self._reader.blocks(tuple(columns)):
            if name in in_chunk:
                in_chunk.clear()
                if max(column.waiting for column in columns.values()) >= _BATCH_MESSAGES:
                    yield [column.taken() for column in columns.values()]
            in_chunk.add(name)
            columns[name].add(arrivals, block)
            seen += len(block)
            self._progress(min(1.0, seen / every))
        yield [column.taken() for column in columns.values()]

    def _evenly(self, topics: Collection[str]) -> _Blocks:
        """Yield _SAMPLED_MESSAGES messages of each topic at most, and no long ones."""
        seen, read = dict.fromkeys(topics, 0), 0
        for name, arrivals, block in self._reader.blocks(tuple(topics)) if topics else ():
            every = -(-self.counts[name] // _SAMPLED_MESSAGES)
            rows = np.flatnonzero((seen[name] + np.arange(len(block))) % every == 0)
            seen[name] += len(block)
            read += len(block)
            self._progress(min(1.0, read / sum(self.counts[topic] for topic in topics)))
            rows = rows[block.lengths[rows] <= _MAX_SAMPLED_BYTES]
            if len(rows):
                yield name, arrivals[rows], Block.of([block[row] for row in rows.tolist()])

    def _columns(self, topic: str, requested: Collection[str] | None) -> "_TopicColumns":
        connection = self._reader.connections[topic]
        key, where = (connection.type, connection.definition), f"{self.path}: topic {cut(topic)}"
        if key not in self._parsed:
            self._parsed[key] = fields_by_definition(where, *key, self.encoding)
        return _TopicColumns(topic, connection.type, self.encoding, self._parsed[key], requested, where)

    def _unread(self, name: str, error: FileFormatError) -> Stream:
        return Stream(name, self._reader.connections[name].type, {}, self.counts[name], notes=(str(error),))


@dataclass
class _TopicColumns:
    """Numbers of a topic's messages, in order of arrival."""

    name: str
    type: str
    encoding: Encoding
    fields_of: FieldsOf
    requested: Collection[str] | None  # all when None
    where: str  # of the topic, for errors
    waiting: int = 0  # messages
    _blocks: list[tuple[Integers, Block]] = field(default_factory=list)
    _joints: dict[str, tuple[str, ...]] = field(default_factory=dict)
    _notes: dict[str, None] = field(default_factory=dict)

    def __post_init__(self) -> None:
        # the columns whose numbers are not in SI, by their path in a message
        not_in_si = RAVENSTATE.columns if current_name(self.type) == RAVENSTATE.type else ()
        self._own = {column.path: column for column in not_in_si}
        self._joints |= {path: own.labels for path, own in self._own.items() if own.width > 1}

    def add(self, arrivals: Integers, block: Block) -> None:
        self._blocks.append((arrivals, block))
        self.waiting += len(block)

    def taken(self) -> Stream:
        """Return the messages that wait as columns, in the order in which they arrived; those wanted that none has."""
        arrivals = np.concatenate([np.zeros(0, dtype=np.int64), *(came for came, _ in self._blocks)])
        waiting, self._blocks, self.waiting = Block.joined([block for _, block in self._blocks]), [], 0
        pieces: dict[str, list[tuple[Integers, NDArray[Any]]]] = {}
        of, count = list[Integers](), 0  # the message that each row is of
        try:
            for messages, records in read_messages(current_name(self.type), waiting, self.encoding, self.fields_of):
                for own, part_of in _by_child(messages, records):
                    numbers = list(self._numbers(part_of))
                    if part_of is not records and not any(column for _, column, _ in numbers):
                        continue  # a child that nobody wants
                    for inside, column, values in numbers:
                        pieces.setdefault(column, []).append((count + inside, values))
                        if len(pieces) > MOST_COLUMNS:  # before as many arrays are made
                            raise FileFormatError(f"more than {MOST_COLUMNS} columns")
                    of.append(own)
                    count += len(own)
        except FileFormatError as error:
            raise FileFormatError(f"{self.where}: {error}") from error
        rows = np.concatenate([np.zeros(0, dtype=np.int64), *of])
        order = np.argsort(rows, kind="stable")
        columns: dict[str, NDArray[Any]] = {name: np.full(count, np.nan) for name in self.requested or ()}
        for column, numbers_of in {"": [], **pieces}.items():
            whole = np.full(count, np.nan) if column else np.zeros(count, dtype=np.int64)
            for at, values in numbers_of:
                whole[at] = values
            columns[column] = whole[order]
        stamp = columns.pop("")
        joints, notes = dict(self._joints), tuple(self._notes)
        return Stream(self.name, self.type, columns, count, stamp, arrivals[rows[order]], joints, notes=notes)

    def _numbers(self, records: NDArray[np.void]) -> Iterator[tuple[Integers, str, NDArray[Any]]]:
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
            if path.endswith(".nsec") and path.removesuffix(".nsec") in self._own:  # a duration
                base = path.removesuffix(".nsec")
                if self._is_wanted(base):
                    yield every, base, records[f"{base}.sec"] + records[path] / SECOND
                continue
            if path.startswith(COUNT) or kind.base.kind not in "iuf" or path.endswith((".sec", ".nsec")):
                continue
            column = re.sub(r"\.(\d+)(?=\.|$)", r"[\1]", path)
            values, to_si = records[path].reshape(len(records), -1), 1.0
            joint = _joint_of(path, records, kinds)
            if path in named and joint:
                orders_of_names = [
                    (rows, [f"{name}[{joint}]" for name in names]) for rows, names in orders[named[path]]
                ]
                for name in orders_of_names[0][1]:
                    array = name.partition("[")[0]
                    self._joints[array] = tuple(dict.fromkeys((*self._joints.get(array, ()), joint)))
            elif path in named:
                orders_of_names = [
                    (rows, self._joint_columns(column, joints, values.shape[1])) for rows, joints in orders[named[path]]
                ]
            elif path in self._own:
                to_si = self._own[path].to_si
                orders_of_names = [(every, [f"{path}[{label}]" if label else path for label in self._own[path].labels])]
            else:
                orders_of_names = [
                    (every, [f"{column}[{i}]" for i in range(values.shape[1])] if kind.shape else [column])
                ]
            for rows, targets in orders_of_names:
                for i, target in enumerate(targets[: values.shape[1]]):
                    if self._is_wanted(target):
                        some = values[:, i] if rows is every else values[rows, i]
                        with np.errstate(invalid="ignore"):  # of NaN that signals; it stays NaN
                            yield rows, target, np.multiply(some, to_si, dtype=np.float64)

    def _is_wanted(self, column: str) -> bool:
        return self.requested is None or column in self.requested

    def _joint_columns(self, array: str, joints: Sequence[str], count: int) -> list[str]:
        """Return the column of each element: by its joint's name where it has one."""
        if len(joints) != count or len(set(joints)) != count:
            return [f"{array}[{i}]" for i in range(count)]
        known = self._joints.setdefault(array, tuple(joints))
        if tuple(joints) != known:
            note = "joints change their order or number between messages; they were followed by name"
            self._notes[note] = None
            new = tuple(joint for joint in joints if joint not in known)
            self._joints[array] = (known + new)[:_MAX_JOINTS]
        return [f"{array}[{joint}]" for joint in joints]


def _by_child(messages: Integers, records: NDArray[np.void]) -> Iterator[tuple[Integers, NDArray[np.void]]]:
    """Yield messages with their records; of transforms in a row (/tf) each alone, its fields by the child's name."""
    kinds: Mapping[str, Any] = records.dtype.fields or {}
    places = [match[1] for path in kinds if (match := re.fullmatch(r"(\w+\.\d+)\.child_frame_id", path))]
    if not places:
        yield messages, records
    for place in places:
        inside = [path for path in kinds if path.startswith(f"{place}.")]
        texts = [bytes(text).rstrip(b"\0") for text in records[f"{place}.child_frame_id"].tolist()]
        for child in dict.fromkeys(texts):
            name = child.decode(errors="replace").lstrip("/")
            ends = [path.removeprefix(f"{place}.") for path in inside]
            names = [end if end.startswith("header.") else f"{place.split('.')[0]}[{name}].{end}" for end in ends]
            kind = np.dtype({
                "names": names, "formats": [kinds[path][0] for path in inside],
                "offsets": [kinds[path][1] for path in inside], "itemsize": records.dtype.itemsize,
            })  # fmt: skip
            rows = np.flatnonzero([text == child for text in texts])
            yield messages[rows], records[rows].view(kind)


def _stamp_path(kinds: Mapping[str, Any]) -> str | None:
    """Return the path of a message's own stamp: of its header, its first field that is a time, or one within it."""
    stamps = [path.removesuffix(".sec") for path in kinds if re.fullmatch(r"\w+(\.stamp)?\.sec", path)]
    headers = [path for path in stamps if path.endswith(".stamp")]
    plain = [path for path in stamps if path in ("stamp", "time", "timestamp")]
    within = [path.removesuffix(".sec") for path in kinds if path.endswith(".header.stamp.sec")]
    return next(iter([*headers, *plain, *within]), None)


def _joint_of(path: str, records: NDArray[np.void], kinds: Mapping[str, Any]) -> str:
    """Return the joint whose values by interface these are, as of a DynamicJointState; "" where they are not."""
    place = re.fullmatch(r"interface_values\.(\d+)\.values", path)
    name = f"joint_names.{place[1]}" if place else ""
    return bytes(records[name][0]).rstrip(b"\0").decode(errors="replace") if name in kinds and len(records) else ""


def _named_arrays(kinds: Mapping[str, Any]) -> dict[str, str]:
    """Return arrays of numbers whose elements a list of texts beside them names."""
    named = {}
    for path, (kind, *_) in kinds.items():
        prefix = path[: path.rfind(".") + 1]
        every = [front + name for front in (prefix, "") for name in _NAMES]  # beside it, or beside all of them
        names = next((name for name in every if f"{COUNT}{name}" in kinds), None)
        if kind.shape and names is not None and f"{names}.0" in kinds:
            named[path] = names
    return named


def _orders(records: NDArray[np.void], kinds: Mapping[str, Any], names: str) -> list[tuple[Integers, list[str]]]:
    """Return the orders of joints that occur, each with its rows."""
    fields: list[str] = []
    while f"{names}.{len(fields)}" in kinds and len(fields) < _MAX_JOINTS:
        fields.append(f"{names}.{len(fields)}")
    texts = [bytes(records[0][one]) for one in fields]
    same = np.ones(len(records), dtype=bool)
    for one in fields:
        same &= records[one] == records[one][0]
    groups: dict[tuple[bytes, ...], list[int]] = {}
    for row in np.flatnonzero(~same).tolist():
        groups.setdefault(tuple(bytes(records[row][one]) for one in fields), []).append(row)
    orders = [(np.flatnonzero(same), texts)]
    orders += [(np.array(rows, dtype=np.int64), list(order)) for order, rows in groups.items()]
    return [(rows, [text.rstrip(b"\0").decode(errors="replace") for text in order]) for rows, order in orders]


_LONG_FILE_BYTES = 64 << 20  # from which a file is not held whole, where its format is read in parts

Progress = Callable[[float], object]


class Sources:
    """Bags and tables of one recording."""

    def __init__(self, paths: Sequence[Path], progress: Progress = lambda done: None) -> None:
        """Open them: of topics a sample is looked at, of a long text the first rows; `progress` counts both."""
        self.today = time.time()  # which bounds what their clocks read [s since 1970]
        if not paths:
            raise FileFormatError("recording: expected at least one file, got none")
        self.paths = tuple(paths)
        self.notes: list[str] = []
        self._bags: list[Bag | TextTable] = []
        self._whole: list[Stream] = []
        shares: dict[Path, float] = {}  # of the bags and long texts, that were read

        def share_of(path: Path) -> Progress:
            def report(done: float) -> None:
                shares[path] = done
                progress(sum(shares.values()) / len(self._bags))

            return report

        for path in paths:
            container, episode = container_of(path)
            form = format_of(container)
            if not container.exists():
                raise FileFormatError(f"{path}: no such file")
            if form.holds == "messages":
                self._bags += [Bag(part, share_of(part)) for part in bags_in(path)]
            elif form.reader_in_parts and path.stat().st_size > _LONG_FILE_BYTES:
                self._bags.append(form.reads(path, form.reader_in_parts)(path, share_of(path)))
            else:
                self._whole += read_table_file(container, episode)
        self._bags.sort(key=lambda bag: bag.first_arrival)
        self.about: About | None = same_origin([bag.about for bag in self._bags])
        every = [*self._whole, *(stream for bag in self._bags for stream in bag.sample())]
        first = {stream.name: stream for stream in reversed(every)}
        for stream in every:
            own = first[stream.name]
            if stream is not own and (stream.type == "table" or own.type != stream.type):
                twice = f"{stream.name}: is there twice, as {own.type} and as {stream.type}"
                raise InputError(f"{twice}; expected parts of one recording")
        self.streams = _joined(every)
        if not any(stream.columns for stream in self.streams):
            notes = [note for stream in self.streams for note in stream.notes]
            why = "; ".join([*notes, *self.problems])
            raise FileFormatError(f"{', '.join(map(str, paths))}: holds no numbers{f'; {why}' if why else ''}")

    @classmethod
    def of(cls, paths: Sequence[Path], streams: Sequence[Stream]) -> Self:
        """Return sources of streams that were read already."""
        made = cls.__new__(cls)
        made.paths, made.notes, made._bags, made.about, made.today = tuple(paths), [], [], None, time.time()
        made._whole = made.streams = list(streams)
        return made

    @property
    def problems(self) -> list[str]:
        """What was damaged; complete once they were read."""
        return [note for bag in self._bags for note in bag.problems]

    @property
    def is_in_parts(self) -> bool:
        """Whether it is read in parts: one long text table alone, or bags alone that were recorded by one clock."""
        texts = sum(isinstance(bag, TextTable) for bag in self._bags)
        if self._whole or not self._bags or (texts and len(self._bags) > 1):
            return False
        early = [
            float(np.median(one.arrival - one.stamp)) / SECOND
            for one in self.streams
            if one.stamp is not None and one.arrival is not None and one.stamp.any()
        ]
        return len(self._bags) == 1 or not early or max(early) - min(early) <= DIFFERENT_CLOCKS_S

    def parts(self, requested: Mapping[str, Collection[str]]) -> Iterator[list[Stream]]:
        """Yield thousands of rows as they arrived; of the first topic only up to where all others were read."""
        base, reached = next(iter(requested)), [bag.first_arrival for bag in self._bags]
        here = [{name: those for name, those in requested.items() if name in bag.counts} for bag in self._bags]
        reading = {i: bag.parts(here[i]) for i, bag in enumerate(self._bags) if here[i]}
        waiting: dict[int, list[Stream]] = {}
        while reading:
            i = min(reading, key=reached.__getitem__)
            yield waiting.pop(i, [])
            some = next(reading[i], None)
            if some is None:
                del reading[i]
                continue
            came = [int(one.arrival[-1]) for one in some if one.arrival is not None and one.rows]
            reached[i] = max([reached[i], *came])
            waiting[i] = [one for one in some if one.name == base]
            yield [one for one in some if one.name != base]

    def holding(self, streams: Sequence[Stream]) -> Self:
        """Return the sources with other streams; attributes of columns stay."""
        self.sha256  # noqa: B018  once for all pieces
        made = copy(self)
        made._whole, made._bags, made.notes = list(streams), [], []
        return made

    @property
    def name(self) -> str:
        """What the recording is called: as its first file, and its episode in it."""
        container, episode = container_of(self.paths[0])
        return " ".join([container.stem, *episode.split("/")[-1:]]).strip()

    @cached_property
    def sha256(self) -> str | None:
        """Hash of the recording's file; None for several files."""
        container, episode = container_of(self.paths[0])
        if len(self.paths) > 1 or not container.is_file():
            return None
        return fingerprint([sha256_of(container), episode]) if episode else sha256_of(container)

    def read(self, requested: Mapping[str, Collection[str]]) -> dict[str, Stream]:
        """Return streams with the columns wanted of each, whole."""
        streams = [stream for stream in self._whole if stream.name in requested]
        for bag in self._bags:
            here = {name: columns for name, columns in requested.items() if name in bag.counts}
            streams += chain.from_iterable(bag.parts(here) if here else ())
            self.notes += [note for note in bag.problems if note not in self.notes]
        return {stream.name: stream for stream in _joined(streams)}


def container_of(path: Path) -> tuple[Path, str]:
    """Return the file or folder of a recording and, of CONTAINER/EPISODE, the episode in it; "" for all."""
    for outer in path.parents if not path.exists() else ():
        if outer.exists():
            is_one = format_of(outer).has_episodes
            return (outer, path.relative_to(outer).as_posix()) if is_one else (path, "")
    return path, ""


def needs_mapping(path: Path) -> bool:
    """Return True if a file, folder or episode needs a mapping, or advice, by its format alone."""
    container, episode = container_of(path)
    form = format_of(container)
    return bool(episode or form.advice) or (form.holds == "columns" and not form.has_layouts)


def _joined(streams: Sequence[Stream]) -> list[Stream]:
    """Return streams with the parts of a topic that lie in several bags put one behind the other."""
    pieces: dict[str, list[Stream]] = {}
    for stream in streams:
        pieces.setdefault(stream.name, []).append(stream)
    return list(map(joined, pieces.values()))
