"""A recording to read, whatever kind of file it is in."""

from collections.abc import Collection, Iterator, Sequence
from pathlib import Path
from typing import Protocol

from catenary.errors import FileFormatError
from catenary.recording.bag_stream import BagStream
from catenary.recording.journal import About, JournalTopic
from catenary.recording.journal_reader import JournalReader
from catenary.recording.layout import Encoding
from catenary.recording.mcap_reader import McapReader


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
