"""A recording to read, whatever kind of file it is in; MCAP files and ROS 2 bags are read here, by their index.

A ROS 2 bag of which a file or the metadata is damaged, missing or of another name is read file by file.
"""

import contextlib
import re
from collections import Counter
from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path, PurePath
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from rosbags.interfaces import Connection
from rosbags.rosbag2 import Reader
from rosbags.rosbag2.reader import DirectoryReader

from catenary.archives import unpacked
from catenary.documents import cut, shortened
from catenary.errors import FileFormatError
from catenary.recording.bag_checks import MOST_DEFINITIONS, MOST_TOPICS, MOST_YAML, check_bag, unpacked_at_most
from catenary.recording.bag_chunks import Block
from catenary.recording.bag_search import SqliteRows
from catenary.recording.bag_stream import BagConnection, BagStream, about_of, whole_text
from catenary.recording.journal import About, JournalTopic
from catenary.recording.journal_reader import JournalReader, is_journal
from catenary.recording.layout import Encoding
from catenary.recording.losses import Hole
from catenary.recording.messages import MESSAGES, check_type, current_name
from catenary.recording.topic_samples import ABOUT_TOPIC, require_topics

METADATA = "metadata.yaml"
AT_ONCE = 8192  # messages of a topic that are in memory at once
FILES = (".mcap", ".db3")  # that a ROS 2 bag consists of
_LISTED = re.compile(r"""(?m)^\s*-\s+(?:&\w+\s+)?["']?([^\s"']+\.(?:mcap|db3)(?:\.zstd)?)["']?\s*$""")
_PACKED = b"\x28\xb5\x2f\xfd"  # how what zstd packed begins [RFC 8878]; a message in CDR begins with 0


class Source(Protocol):
    """Messages of a recording, in the order of arrival."""

    @property
    def topics(self) -> tuple[JournalTopic, ...]: ...  # noqa: D102
    @property
    def about(self) -> About | None: ...  # noqa: D102  None where the file does not say
    @property
    def encoding(self) -> Encoding: ...  # noqa: D102
    @property
    def problems(self) -> list[str]: ...  # noqa: D102  complete once all messages were read
    @property
    def damage(self) -> list[str]: ...  # noqa: D102  those of them that are no mere remarks
    @property
    def holes(self) -> list[Hole]: ...  # noqa: D102  where messages are missing that were there
    @property
    def ends_early(self) -> bool: ...  # noqa: D102  it was cut off

    def messages(self, topics: Collection[str] | None = None) -> Iterator[tuple[str, int, bytes]]:
        """Yield topic, arrival stamp [ns] and bytes of the messages of these topics, or of all."""
        ...


class McapReader:
    """Reads a file of a ROS 2 bag (MCAP or SQLite), or all of it (a folder), by its index."""

    encoding: Encoding = "cdr"

    def __init__(self, path: Path, *, any_types: bool = False, salvage: str = "") -> None:
        """Read the topics, and check their types against ours, but not with `any_types`.

        With `salvage`, what is wrong with a SQLite file, it is read row by row, up to where it is damaged.
        """
        self.path, self._salvage = path, salvage
        self.problems: list[str] = []
        self.damage, self.holes, self.ends_early = list[str](), list[Hole](), False
        self.about: About | None = None
        self._is_checked = False
        self.connections: dict[str, BagConnection] = {}  # by topic
        self.counts: dict[str, int] = {}  # of messages
        types: dict[str, str] = {}
        with self._open() as reader:
            if len(reader.connections) > MOST_TOPICS:
                raise FileFormatError(f"{path}: more than {MOST_TOPICS} topics")
            definitions = {
                (connection.msgtype, connection.msgdef.data)
                for connection in reader.connections
                if current_name(connection.msgtype) in MESSAGES
            }
            if len(definitions) > MOST_DEFINITIONS and not any_types:
                raise FileFormatError(f"{path}: {len(definitions)} definitions of types that are ours")
            for connection in reader.connections:
                name, kind = connection.topic, connection.msgtype
                if not isinstance(name, str) or not isinstance(kind, str):
                    raise FileFormatError(f"{path}: topic {shortened(name)}: expected texts for it and its type")
                if not any_types:
                    check_type(path, name, kind, connection.msgdef.data)
                found = BagConnection(name, kind, "", connection.msgdef.data)
                if self.connections.setdefault(name, found).type != kind:
                    raise FileFormatError(f"{path}: topic {cut(name)}: is of two types, {cut(kind)} is one")
                self.counts[name] = self.counts.get(name, 0) + connection.msgcount
                if name != ABOUT_TOPIC:
                    types.setdefault(name, current_name(kind))
            own = [connection for connection in reader.connections if connection.topic == ABOUT_TOPIC]
            for _, _, data in self._messages(reader, own):
                self.about = about_of(path, data, self.encoding)
            if isinstance(reader, SqliteRows):
                self.damage = [f"{salvage}; read around the damage: {sum(self.counts.values())} messages"]
                self.holes, self.ends_early = reader.holes, reader.ends_early
        others = [name for name in listed_files(path.parent) if name != path.name] if path.is_file() else []
        if others:
            self.problems.append(f"warning: {path}: is one file of a bag; not read were {', '.join(others)}")
        self.problems += self.damage
        self.topics = tuple(JournalTopic(topic, kind) for topic, kind in types.items())

    def messages(self, topics: Collection[str] | None = None) -> Iterator[tuple[str, int, bytes]]:
        """Yield topic, arrival stamp [ns] and bytes of the messages of these topics, or of all, as they arrived."""
        there = [topic.name for topic in self.topics]
        require_topics(self.path, topics, there)
        with self._open() as reader:
            wanted = there if topics is None else topics
            connections = [connection for connection in reader.connections if connection.topic in wanted]
            for connection, stamp, data in self._messages(reader, connections):
                yield connection.topic, stamp, data

    def _messages(
        self, reader: "Reader | SqliteRows", connections: Sequence[Connection]
    ) -> Iterator[tuple[Connection, int, bytes]]:
        """Yield messages of some connections; those that were packed one by one are unpacked here, within bounds."""
        storage = None if isinstance(reader, SqliteRows) else reader.storage
        if isinstance(storage, DirectoryReader) and storage.metadata.compression_mode == "message":
            storage.metadata = storage.metadata._replace(compression_mode=None)
        left = unpacked_at_most(sum(f.stat().st_size for f in (*self.path.glob("*"), self.path)))
        for connection, stamp, data in reader.messages(connections) if connections else ():
            if data[:4] == _PACKED:
                data = unpacked(data, "zstd", left)
                left -= len(data)
            yield connection, stamp, data

    @contextmanager
    def _open(self) -> Iterator["Reader | SqliteRows"]:
        """Open the bag once it was checked; what rosbags raises over a damaged one is of any kind."""
        try:
            if self._salvage:
                yield SqliteRows(self.path)
                return
            if not self._is_checked:
                check_bag(self.path)
                self._is_checked = True
            with Reader(self.path) as reader:
                self._check_listed(reader)
                yield reader
        except Exception as error:
            why = cut(str(error).removeprefix(f"{self.path}: ") or repr(error))
            if isinstance(error, FileFormatError) and self._is_checked:
                raise
            raise FileFormatError(f"{self.path}: cannot be read: {why}") from error

    def _check_listed(self, reader: Reader) -> None:
        """Refuse a folder whose metadata lack a topic: rosbags would leave out its messages without a word."""
        if not isinstance(reader.storage, DirectoryReader):
            return
        listed = {(connection.topic, connection.msgtype) for connection in reader.connections}
        self.problems = _strays(self.path, listed_files(self.path))
        held = sum(found.msgcount for storage in reader.storage.storages for found in storage.connections)
        if held < reader.message_count:
            raise FileFormatError(
                f"{self.path}: {METADATA} counts {reader.message_count} messages, its files hold {held}"
            )
        for storage in reader.storage.storages:
            for found in storage.connections:
                if found.msgcount and (found.topic, found.msgtype) not in listed:
                    raise FileFormatError(
                        f"{self.path}: metadata.yaml does not list topic {shortened(found.topic)} of type "
                        f"{shortened(found.msgtype)}, which has {found.msgcount} messages"
                    )


class SplitBag:
    """A ROS 2 bag (folder) that cannot be opened as a whole: what is whole of each file, in the order of time."""

    encoding: Encoding = "cdr"

    def __init__(self, path: Path, why: str, *, any_types: bool = False) -> None:
        """Open its files.

        Args:
            path: The folder.
            why: It cannot be opened as a whole.
            any_types: As for `McapReader`.
        """
        self.path = path
        listed = listed_files(path)
        there = sorted(file.name for file in path.iterdir() if file.suffix in FILES)
        missing = [name for name in listed if not (path / name).is_file()]
        chosen = there if missing or not listed else [name for name in there if name in listed]
        self.damage = [f"{path / name}: is listed in {METADATA} and missing" for name in missing]
        self.parts: list[McapReader | BagStream] = []
        for name in chosen:
            try:
                self.parts.append(_part(path / name, any_types=any_types))
            except FileFormatError as error:
                self.damage.append(str(error))
        self.damage += [
            f"{file}: is packed, and was not read; `zstd -d {file.name}` unpacks it" for file in path.glob("*.zstd")
        ]
        if not self.parts:
            raise FileFormatError("; ".join([why, *self.damage]))
        self.parts.sort(key=first_arrival)
        self._said = [f"{why}; its files were read one by one: {', '.join(part.path.name for part in self.parts)}"]
        self._said += _strays(path, chosen)
        self.about = next((part.about for part in self.parts if part.about is not None), None)
        self.connections: dict[str, BagConnection] = {}
        self.counts = Counter[str]()
        types: dict[str, JournalTopic] = {}
        for part in self.parts:
            self.counts.update(part.counts)
            self.connections |= part.connections
            for topic in part.topics:
                if types.setdefault(topic.name, topic) != topic:
                    raise FileFormatError(f"{part.path}: topic {cut(topic.name)}: is of another type than before")
        self.topics = tuple(types.values())
        self.damage += [problem for part in self.parts for problem in part.damage]
        self.holes = list[Hole]()
        self.ends_early = self.parts[-1].ends_early or listed[-1:] == missing[-1:] != []

    @property
    def problems(self) -> list[str]:
        """What was said of the folder, and what is missing."""
        said = dict.fromkeys([*self._said, *self.damage])
        return [problem if problem.startswith("warning: ") else f"warning: {problem}" for problem in said]

    def messages(self, topics: Collection[str] | None = None) -> Iterator[tuple[str, int, bytes]]:
        """Yield topic, arrival stamp [ns] and bytes of the messages of these topics, or of all, file by file."""
        require_topics(self.path, topics, [topic.name for topic in self.topics])
        holes: list[Hole] = []
        for part in self.parts:
            here = [t.name for t in part.topics if topics is None or t.name in topics]
            last = None
            for message in part.messages(here) if here else ():
                last = message[1]
                yield message
            holes += [*part.holes, *([(last, None)] if self.damage else [])]
        self.holes = holes


def open_any_types(path: Path) -> "JournalReader | McapReader | BagStream | SplitBag":
    """Open a journal, a bag of any make or a ROS 2 bag for what is whole in it; its types may be any."""
    if is_journal(path):
        return JournalReader(path)
    if path.suffix == ".bag" and path.is_file():
        return BagStream(path, any_types=True)
    return open_ros2(path, any_types=True)


def blocks_of(source: "Source | SplitBag", topics: Sequence[str]) -> Iterator[tuple[str, NDArray[np.int64], Block]]:
    """Yield topic, arrival stamps [ns] and messages, as many at once as the source has or AT_ONCE."""
    if isinstance(source, BagStream | JournalReader):
        yield from source.blocks(topics)
        return
    waiting: dict[str, tuple[list[int], list[bytes]]] = {name: ([], []) for name in topics}
    for name, stamp, data in source.messages(topics):
        stamps, messages = waiting[name]
        stamps.append(stamp)
        messages.append(data)
        if len(messages) == AT_ONCE:
            yield name, np.array(stamps), Block.of(messages)
            waiting[name] = [], []
    for name, (stamps, messages) in waiting.items():
        if messages:
            yield name, np.array(stamps), Block.of(messages)


def first_arrival(source: "Source | SplitBag") -> int:
    """Return when the first message of a recording arrived [ns]; the latest time there is without one."""
    if isinstance(source, BagStream) and source.first is not None:
        return source.first
    return next((stamp for _, stamp, _ in source.messages()), 2**63)


def listed_files(path: Path) -> list[str]:
    """Return the names of the files that a ROS 2 bag's metadata list, as far as they can be read."""
    try:
        with (path / METADATA).open("rb") as file:
            return [PurePath(name).name for name in _LISTED.findall(file.read(MOST_YAML).decode(errors="replace"))]
    except OSError:
        return []


def bags_in(path: Path) -> list[Path]:
    """Return the bag, or those in a folder that is none itself."""
    if not path.is_dir() or (path / METADATA).is_file() or is_journal(path):
        return [path]
    inside = [p for p in path.iterdir() if p.suffix in (".bag", *FILES) or (p / METADATA).is_file()]
    return sorted(inside) or [path]


def open_ros2(path: Path, *, any_types: bool = False) -> McapReader | BagStream | SplitBag:
    """Open an MCAP or SQLite file, or a ROS 2 bag (folder): as a whole, or else what is whole of each file."""
    try:
        return McapReader(path, any_types=any_types)
    except FileFormatError as error:
        if path.is_dir():
            return SplitBag(path, str(error), any_types=any_types)
        return _part(path, any_types=any_types)


def _part(path: Path, *, any_types: bool) -> McapReader | BagStream:
    """Open a file of a ROS 2 bag, or what is whole of it."""
    try:
        return McapReader(path, any_types=any_types)
    except FileFormatError as error:
        with contextlib.suppress(FileFormatError):
            saved = (
                BagStream(path, any_types=any_types)
                if path.suffix == ".mcap"
                else McapReader(path, any_types=any_types, salvage=str(error))
            )
            if any(saved.counts.values()):
                return saved
        raise FileFormatError(f"{error}; nothing in it can be saved") from error


def _strays(path: Path, known: Collection[str]) -> list[str]:
    """Return remarks on files in a bag's folder that were not read."""
    return [
        f"warning: {file}: lies in the folder, and {METADATA} does not list it: it was not read"
        for file in sorted(path.iterdir())
        if file.suffix in FILES and file.name not in known
    ]


def open_recording(path: Path, *, salvage: bool = False) -> Source:
    """Open a journal (folder or file), a ROS 1 bag, an MCAP file or a ROS 2 bag (folder).

    Args:
        path: Of the recording.
        salvage: Open a bag, too, that was cut off or is damaged, to read what is whole.
    """
    if not path.exists():
        raise FileFormatError(f"{path}: no such recording")
    if is_journal(path):
        return JournalReader(path)
    if path.suffix == ".bag" and path.is_file():
        bag = BagStream(path)
        if bag.problems and not salvage:
            problem = bag.problems[0].removeprefix(f"{path}: ")
            raise FileFormatError(f"{path}: cannot be read: {problem}; {whole_text(bag.counts)}")
        return bag
    if path.suffix in FILES or (path.is_dir() and (path / METADATA).is_file()):
        found = open_ros2(path)
        if found.damage and not salvage:
            problem = found.damage[0].removeprefix(f"{path}: ").removeprefix("cannot be read: ")
            raise FileFormatError(f"{path}: cannot be read: {problem}; {whole_text(found.counts)}")
        return found
    raise FileFormatError(f"{path}: expected a journal, a .bag, an .mcap, a .db3 or a folder with {METADATA}")


def open_recordings(paths: Sequence[Path], *, salvage: bool = False) -> tuple[Source, ...]:
    """Open several files of one recording, such as one bag per topic; a folder of bags stands for all of them.

    `salvage` as in `open_recording`.
    """
    found = [bag for path in paths for bag in bags_in(path)]
    if not found:
        raise FileFormatError("recording: expected at least one file, got none")
    sources = [open_recording(path, salvage=salvage) for path in found]
    return tuple(sorted(sources, key=first_arrival) if len(sources) > 1 else sources)
