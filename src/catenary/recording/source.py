"""A recording to read, whatever kind of file it is in; MCAP files and ROS 2 bags are read here, by their index."""

from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Protocol

from rosbags.interfaces import Connection
from rosbags.rosbag2 import Reader
from rosbags.rosbag2.reader import DirectoryReader

from catenary.archives import unpacked
from catenary.documents import cut, shortened
from catenary.errors import FileFormatError
from catenary.recording.bag_checks import MOST_DEFINITIONS, MOST_TOPICS, check_bag, unpacked_at_most
from catenary.recording.bag_stream import BagConnection, BagStream, about_of
from catenary.recording.journal import About, JournalTopic
from catenary.recording.journal_reader import JournalReader
from catenary.recording.layout import Encoding
from catenary.recording.losses import Hole
from catenary.recording.messages import MESSAGES, check_ros2_type, current_name
from catenary.recording.topics import ABOUT_TOPIC, require_topics


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
    """Reads an MCAP file, or a ROS 2 bag (folder), by its index."""

    encoding: Encoding = "cdr"

    def __init__(self, path: Path, *, foreign: bool = False) -> None:
        """Read the topics, and check their types against ours, but not with `foreign`.

        Raises:
            FileFormatError: No such file, cut off (the message says what can be saved), another kind of file, or
                types that are not ours.
        """
        self.path = path
        self.problems: list[str] = []
        self.damage, self.holes, self.ends_early = (
            self.problems,
            list[Hole](),
            False,
        )  # one that opens is whole
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
            if len(definitions) > MOST_DEFINITIONS and not foreign:
                raise FileFormatError(f"{path}: {len(definitions)} definitions of types that are ours")
            for connection in reader.connections:
                name, kind = connection.topic, connection.msgtype
                if not foreign:
                    check_ros2_type(path, name, kind, connection.msgdef.data)
                found = BagConnection(name, kind, "", connection.msgdef.data)
                if self.connections.setdefault(name, found).type != kind:
                    raise FileFormatError(f"{path}: topic {cut(name)}: is of two types, {cut(kind)} is one")
                self.counts[name] = self.counts.get(name, 0) + connection.msgcount
                if name != ABOUT_TOPIC:
                    types.setdefault(name, current_name(kind))
            own = [connection for connection in reader.connections if connection.topic == ABOUT_TOPIC]
            for _, _, data in self._messages(reader, own):
                self.about = about_of(path, data, self.encoding)
        self.topics = tuple(JournalTopic(topic, kind) for topic, kind in types.items())

    def messages(self, topics: Collection[str] | None = None) -> Iterator[tuple[str, int, bytes]]:
        """Yield topic, arrival stamp [ns] and bytes of the messages of these topics, or of all, as they arrived.

        Raises:
            FileFormatError: A topic is not in the bag, or the bag is damaged.
        """
        there = [topic.name for topic in self.topics]
        require_topics(self.path, topics, there)
        with self._open() as reader:
            wanted = there if topics is None else topics
            connections = [connection for connection in reader.connections if connection.topic in wanted]
            for connection, stamp, data in self._messages(reader, connections):
                yield connection.topic, stamp, data

    def _messages(
        self, reader: Reader, connections: Sequence[Connection]
    ) -> Iterator[tuple[Connection, int, bytes]]:
        """Yield messages of some connections; those that were packed one by one are unpacked here, within bounds."""
        storage = reader.storage
        is_packed = storage.metadata.compression_mode == "message"
        if is_packed and isinstance(storage, DirectoryReader):
            storage.metadata = storage.metadata._replace(compression_mode=None)
        size = sum(file.stat().st_size for file in self.path.iterdir()) if is_packed else 0
        left = unpacked_at_most(size)
        for connection, stamp, data in reader.messages(connections) if connections else ():
            if is_packed:
                data = unpacked(data, "zstd", left)
                left -= len(data)
            yield connection, stamp, data

    @contextmanager
    def _open(self) -> Iterator[Reader]:
        """Open the bag once it was checked; what rosbags raises over a damaged one is of any kind."""
        try:
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
            raise FileFormatError(f"{self.path}: cannot be read: {why}; {_saved(self.path)}") from error

    def _check_listed(self, reader: Reader) -> None:
        """Refuse a folder whose metadata lack a topic: rosbags would leave out its messages without a word."""
        listed = {(connection.topic, connection.msgtype) for connection in reader.connections}
        for storage in reader.storage.storages if isinstance(reader.storage, DirectoryReader) else ():
            for found in storage.connections:
                if found.msgcount and (found.topic, found.msgtype) not in listed:
                    raise FileFormatError(
                        f"{self.path}: metadata.yaml does not list topic {shortened(found.topic)} of type "
                        f"{shortened(found.msgtype)}, which has {found.msgcount} messages"
                    )


def open_recording(path: Path, *, salvage: bool = False) -> Source:
    """Open a journal (folder or file), a ROS 1 bag, an MCAP file or a ROS 2 bag (folder).

    Args:
        path: Of the recording.
        salvage: Open a bag, too, that was cut off or is damaged, to read what is whole.

    Raises:
        FileFormatError: No such file, another kind, truncated, or message types that are not ours.
    """
    if not path.exists():
        raise FileFormatError(f"{path}: no such recording")
    if path.suffix == ".journal" or (path.is_dir() and any(path.glob("*.journal"))):
        return JournalReader(path)
    if path.suffix == ".bag" and path.is_file():
        bag = BagStream(path)
        if bag.problems and not salvage:
            problem = bag.problems[0].removeprefix(f"{path}: ")
            raise FileFormatError(f"{path}: cannot be read: {problem}; {bag.whole_text()}")
        return bag
    if path.suffix == ".mcap" or (path.is_dir() and (path / "metadata.yaml").is_file()):
        try:
            return McapReader(path)
        except FileFormatError:
            file = min(path.glob("*.mcap"), default=None) if path.is_dir() else path
            if not salvage or file is None:
                raise
            return BagStream(file)
    raise FileFormatError(
        f"{path}: expected a folder of .journal files, a .bag, an .mcap or a folder with metadata.yaml"
    )


def open_recordings(paths: Sequence[Path], *, salvage: bool = False) -> tuple[Source, ...]:
    """Open several files of one recording, such as one bag per topic; a folder of bags stands for all of them.

    `salvage` as in `open_recording`.

    Raises:
        FileFormatError: None there, or one that cannot be opened.
    """
    found: list[Path] = []
    for path in paths:
        bags = sorted((*path.glob("*.bag"), *path.glob("*.mcap"))) if path.is_dir() else []
        found += bags if bags and not (path / "metadata.yaml").is_file() else [path]
    if not found:
        raise FileFormatError("recording: expected at least one file, got none")
    return tuple(open_recording(path, salvage=salvage) for path in found)


def _saved(path: Path) -> str:
    """Return in words what could still be read from a file that cannot be opened."""
    file = min(path.glob("*.mcap"), default=None) if path.is_dir() else path  # a recording in one file
    try:
        return "nothing in it can be saved" if file is None else BagStream(file).whole_text()
    except (FileFormatError, OSError):
        return "nothing in it can be saved"
