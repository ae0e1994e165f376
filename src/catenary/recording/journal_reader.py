"""A journal as it is found: whole, torn by a crash, or damaged; what is whole is read, what is not is counted."""

from collections.abc import Collection, Iterator, Sequence
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from catenary.documents import cut
from catenary.errors import FileFormatError
from catenary.recording.bag_chunks import Block
from catenary.recording.bag_stream import BagConnection, BagStream
from catenary.recording.journal import LIBRARY, MAGIC, About, JournalTopic, LeftOff, is_journal_name
from catenary.recording.layout import Encoding
from catenary.recording.losses import Hole
from catenary.recording.sqlite_bag import SqliteBag
from catenary.recording.topic_samples import require_topics


def is_journal(path: Path) -> bool:
    """Return whether a folder holds a journal's files, or a file is one."""
    if path.is_dir():
        return not (path / "metadata.yaml").is_file() and any(map(is_journal_name, path.glob("*.mcap")))
    if path.suffix != ".mcap" or not path.is_file():
        return False
    with path.open("rb") as file:
        begin = file.read(200)
    return LIBRARY.encode() in begin and begin.startswith(MAGIC)


class FilesInARow:
    """A recording in several files, each read to its end before the next."""

    def __init__(self, path: Path, parts: Sequence[BagStream | SqliteBag]) -> None:
        """Take in what the files say of their topics."""
        self.path, self.parts = path, parts
        self.connections: dict[str, BagConnection] = {}
        types: dict[str, JournalTopic] = {}
        for part in parts:
            self.connections |= part.connections
            for topic in part.topics:
                if types.setdefault(topic.name, topic) != topic:
                    raise FileFormatError(f"{part.path}: topic {cut(topic.name)}: is of another type than before")
        self.topics = tuple(types.values())
        self.encoding: Encoding = parts[0].encoding if parts else "ros1"
        self.about: About | None = next((part.about for part in parts if part.about is not None), None)
        self.damage, self.holes, self.ends_early = list[str](), list[Hole](), False

    @property
    def first(self) -> int | None:
        """Arrival of the first message [ns]."""
        return next((part.first for part in self.parts if part.first is not None), None)

    def messages(self, topics: Collection[str] | None = None) -> Iterator[tuple[str, int, bytes]]:
        """Yield topic, arrival stamp [ns] and bytes of the messages of these topics, or of all, file by file."""
        require_topics(self.path, topics, [topic.name for topic in self.topics])
        for part, there in self._each():
            yield from part.messages([name for name in there if topics is None or name in topics])

    def blocks(self, topics: Collection[str]) -> Iterator[tuple[str, NDArray[np.int64], Block]]:
        """Yield topic, arrival stamps [ns] (N,) and messages, file by file."""
        for part, there in self._each():
            yield from part.blocks([name for name in there if name in topics])

    def _each(self) -> Iterator[tuple[BagStream | SqliteBag, list[str]]]:
        """Yield the files and their topics; a file is read to its end before the next is asked for."""
        for part in self.parts:
            yield part, [topic.name for topic in part.topics]


class JournalReader(FilesInARow):
    """Reads a recording: its folder, or one of its files.

    What was missing or damaged is known when `messages` has been read to its end.
    """

    parts: Sequence[BagStream]

    def __init__(self, path: Path) -> None:
        """Find the topics."""
        files = sorted(filter(is_journal_name, path.glob("*.mcap"))) if path.is_dir() else [path]
        if not files or not files[0].is_file():
            raise FileFormatError(f"{path}: no journal there; expected a folder of .mcap files, or one")
        parts, self._unread = list[BagStream](), list[str]()
        for file in files:
            if file.stat().st_size == 0:  # killed between making the file and writing to it
                self._unread.append(f"{file}: is empty")
                continue
            try:
                parts.append(BagStream(file))
            except FileFormatError as error:
                if not str(error).endswith("nothing in it can be saved"):
                    raise
                self._unread.append(str(error))
        super().__init__(path, parts)
        if not self.topics:
            raise FileFormatError(f"{path}: no whole topic in its {len(files)} file(s): nothing can be read")
        self.remarks = list[str]()  # of the recorder, of no loss
        self.lost = 0  # messages that are known to be missing

    def left_off(self, *, in_passes: bool) -> LeftOff | None:
        """Return from where it goes on: from its last whole pass, or its last message; None where nothing is kept.

        A pass is whole when the next one has begun.
        """
        files = sorted(filter(is_journal_name, self.path.glob("*.mcap")))
        last_pass = max((part.begins for part in self.parts if part.begins is not None), default=0.0)
        kept = [part for part in self.parts if not in_passes or (part.begins is not None and part.begins < last_pass)]
        numbers: dict[str, int] = {}
        last: int | None = None
        for part in kept:
            part.follow(numbers, last)
            for _ in part.messages():
                pass
            last = part.last
        if last is None:
            return None
        dropped = tuple(file for file in files if in_passes and file not in [part.path for part in kept])
        part_number = int(dropped[0].stem if dropped else files[-1].stem) + (not dropped)
        whole = [part for part in self.parts if part.begins == last_pass]
        first = next((part.first for part in whole if part.first is not None), last)
        begins = last_pass if in_passes else last_pass + (last - first) * 1e-9
        return LeftOff(begins, part_number, numbers, last, dropped)

    @cached_property
    def counts(self) -> dict[str, int]:
        """Number of messages by topic."""
        found = {topic.name: 0 for topic in self.topics}
        for name, arrivals, _ in self.blocks(found):
            found[name] += len(arrivals)
        return found

    @property
    def problems(self) -> list[str]:
        """What was found missing or damaged so far, in words, and the recorder's own notes."""
        return [*self.damage, *self.remarks]

    def _each(self) -> Iterator[tuple[BagStream, list[str]]]:
        """Yield the files; behind the last one it is known what is missing."""
        self.damage, self.remarks, self.lost, self.holes = list(self._unread), [], 0, []
        self.ends_early = True
        following: dict[str, int] = {}  # number of the next message, by topic
        last: int | None = None  # [ns] arrival of the message before
        for part in self.parts:
            part.follow(following, last)
            yield part, [topic.name for topic in part.topics]
            self.ends_early, last = not part.is_last, part.last
            self.lost += part.lost
            self.holes += part.holes
            self.damage += part.damage
            self.remarks += part.remarks
        if self.ends_early:
            self.damage = [problem for problem in self.damage if "lacks its index" not in problem]
            self.damage.append(
                f"{self.path}: was not closed: the recording ended with a crash, or files at its end are missing"
            )
