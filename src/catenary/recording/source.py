"""A recording to read, whatever kind of file it is in; MCAP files and ROS 2 bags are read here, by their index."""

from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from struct import error as StructError
from typing import Protocol

from rosbags.rosbag2 import Reader, ReaderError

from catenary.errors import FileFormatError
from catenary.recording.bag_stream import BagStream, about_of
from catenary.recording.journal import About, JournalTopic
from catenary.recording.journal_reader import JournalReader
from catenary.recording.layout import Encoding
from catenary.recording.messages import check_ros2_type, current_name
from catenary.recording.topics import ABOUT_TOPIC, require_topics

# what rosbags raises over a file that ends too early or holds something else
_UNREADABLE = (ReaderError, OSError, StructError, ValueError, TypeError, KeyError, IndexError, EOFError)


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

    def messages(self, topics: Collection[str] | None = None) -> Iterator[tuple[str, int, bytes]]:
        """Yield topic, arrival stamp [ns] and bytes of the messages of these topics, or of all."""
        ...


class McapReader:
    """Reads an MCAP file, or a ROS 2 bag (folder), by its index."""

    encoding: Encoding = "cdr"

    def __init__(self, path: Path) -> None:
        """Read the topics, and check their types against ours.

        Raises:
            FileFormatError: No such file, cut off (the message says what can be saved), another kind of file, or
                types that are not ours.
        """
        self.path = path
        self.problems: list[str] = []
        self.about: About | None = None
        types: dict[str, str] = {}
        with self._open() as reader:
            for connection in reader.connections:
                name, kind = connection.topic, connection.msgtype
                check_ros2_type(path, name, kind, connection.msgdef.data)
                if name != ABOUT_TOPIC:
                    types.setdefault(name, current_name(kind))
            own = [connection for connection in reader.connections if connection.topic == ABOUT_TOPIC]
            for _, _, data in reader.messages(own) if own else ():
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
            for connection, stamp, data in reader.messages(connections) if connections else ():
                yield connection.topic, stamp, data

    @contextmanager
    def _open(self) -> Iterator[Reader]:
        try:
            with Reader(self.path) as reader:
                yield reader
        except _UNREADABLE as error:
            if isinstance(error, FileFormatError):
                raise
            raise FileFormatError(f"{self.path}: cannot be read: {error}; {_saved(self.path)}") from error


def open_recording(path: Path) -> Source:
    """Open a journal (folder or file), a ROS 1 bag, an MCAP file or a ROS 2 bag (folder).

    Raises:
        FileFormatError: No such file, another kind, truncated, or message types that are not ours.
    """
    if not path.exists():
        raise FileFormatError(f"{path}: no such recording")
    if path.suffix == ".journal" or (path.is_dir() and any(path.glob("*.journal"))):
        return JournalReader(path)
    if path.suffix == ".bag" and path.is_file():
        bag = BagStream(path)
        if bag.problems:
            problem = bag.problems[0].removeprefix(f"{path}: ")
            raise FileFormatError(f"{path}: cannot be read: {problem}; {bag.whole_text()}")
        return bag
    if path.suffix == ".mcap" or (path.is_dir() and (path / "metadata.yaml").is_file()):
        return McapReader(path)
    raise FileFormatError(
        f"{path}: expected a folder of .journal files, a .bag, an .mcap or a folder with metadata.yaml"
    )


def open_recordings(paths: Sequence[Path]) -> tuple[Source, ...]:
    """Open several files of one recording, such as one bag per topic; a folder of bags stands for all of them.

    Raises:
        FileFormatError: None there, or one that cannot be opened.
    """
    found: list[Path] = []
    for path in paths:
        bags = sorted((*path.glob("*.bag"), *path.glob("*.mcap"))) if path.is_dir() else []
        found += bags if bags and not (path / "metadata.yaml").is_file() else [path]
    if not found:
        raise FileFormatError("recording: expected at least one file, got none")
    return tuple(open_recording(path) for path in found)


def _saved(path: Path) -> str:
    """Return in words what could still be read from a file that cannot be opened."""
    file = min(path.glob("*.mcap"), default=None) if path.is_dir() else path  # a recording in one file
    try:
        return "nothing in it can be saved" if file is None else BagStream(file).whole_text()
    except (FileFormatError, OSError):
        return "nothing in it can be saved"
