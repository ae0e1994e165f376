"""A journal as it is found: whole, torn by a crash, or damaged; what is whole is read, what is not is counted."""

import mmap
from collections import Counter
from collections.abc import Collection, Iterator
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import NamedTuple
from zlib import crc32

from catenary.documents import json_table, shortened
from catenary.errors import FileFormatError
from catenary.recording.bag_stream import BagConnection
from catenary.recording.journal import (
    FOOTER,
    FORMAT,
    HEAD,
    HEADER,
    MAGIC,
    MARKER,
    MAX_HEADER,
    MAX_RECORD,
    NOTE,
    About,
    JournalTopic,
)
from catenary.recording.layout import Encoding
from catenary.recording.losses import Hole
from catenary.recording.messages import check_ros1_type, full_definition, md5_sum
from catenary.recording.topics import require_topics

# times a file's size: bytes that are checked in vain for where the next whole record begins. Damage to every record of
# a file takes one; what takes more was made to
SEARCHED = 8
MOST_PROBLEMS = 1000  # that are told one by one
LONGEST_REMARK = 500  # characters


class _Record(NamedTuple):
    topic: int
    number: int
    stamp: int
    data: bytes


@dataclass
class JournalReport:
    """Counts and damage found in a journal; complete once all its messages were read."""

    messages: dict[str, int] = field(default_factory=dict)  # by topic
    problems: list[str] = field(default_factory=list)  # in words, with places
    remarks: list[str] = field(default_factory=list)  # of the recorder; they tell of no loss
    lost: int = 0  # messages that are known to be missing
    holes: list[Hole] = field(default_factory=list)  # where they are
    closed: bool = False  # the recording was finished, not cut off

    def note(self, problem: str) -> None:
        """Keep a problem, unless there are too many."""
        if len(self.problems) < MOST_PROBLEMS:
            self.problems.append(problem)
        elif len(self.problems) == MOST_PROBLEMS:
            self.problems.append(f"more than {MOST_PROBLEMS} places are damaged; further ones are not told")

    def remark(self, file: Path, data: bytes) -> None:
        """Keep what the recorder noted, unless it is none or there are too many."""
        try:
            text = json_table(data, f"{file}: note").get("note")
        except FileFormatError as error:
            self.note(str(error))
            return
        if isinstance(text, str) and len(self.remarks) < MOST_PROBLEMS:
            self.remarks.append(f"{file}: {text[:LONGEST_REMARK]}")


class JournalReader:
    """Reads a recording: its folder, or one of its files.

    `report` tells what was missing or damaged; it is complete when `messages` has been read to its end.
    """

    encoding: Encoding = "ros1"

    def __init__(self, path: Path) -> None:
        """Read the header."""
        self.path = path
        self._files = sorted(path.glob("*.journal")) if path.is_dir() else [path]
        if not self._files or not self._files[0].is_file():
            raise FileFormatError(f"{path}: no journal there; expected a folder of .journal files, or one")
        self.report = JournalReport()
        self.about: About | None
        self.topics, self.about = self._first_header()

    @property
    def connections(self) -> dict[str, BagConnection]:
        """Topics as it defines them."""
        return {
            name: BagConnection(name, kind, md5_sum(kind), full_definition(kind))
            for name, kind in self.topics
        }

    @cached_property
    def counts(self) -> dict[str, int]:
        """Number of messages by topic."""
        return dict(Counter(name for name, _, _ in self.messages()))

    @property
    def problems(self) -> list[str]:
        """What was found missing or damaged so far, in words, and the recorder's own notes."""
        return [*self.report.problems, *self.report.remarks]

    @property
    def damage(self) -> list[str]:
        """What was found missing or damaged so far, in words."""
        return self.report.problems

    @property
    def holes(self) -> list[Hole]:
        """Where records are missing that were there."""
        return self.report.holes

    @property
    def ends_early(self) -> bool:
        """Whether the recording was cut off, once all messages were read."""
        return not self.report.closed

    def messages(self, topics: Collection[str] | None = None) -> Iterator[tuple[str, int, bytes]]:
        """Yield topic, arrival stamp [ns] and bytes of every whole message, in the order of arrival.

        Args:
            topics: Those to give; None for all. All are counted.
        """
        names = [topic.name for topic in self.topics]
        require_topics(self.path, topics, names)
        report = self.report = JournalReport(messages=dict.fromkeys(names, 0))
        wanted = [topics is None or name in topics for name in names]
        expected: int | None = None  # number of the next record
        last: int | None = None  # [ns] arrival of the message before
        for file in self._files:
            report.closed = False
            for record in _records(file, report):
                if expected is not None and record.number > expected:
                    report.holes.append((last, record.stamp))
                expected, last = self._count_missing(file, record.number, expected), record.stamp
                if record.topic == FOOTER:
                    report.closed = self._is_last(file, record)
                elif record.topic == NOTE:
                    report.remark(file, record.data)
                elif record.topic < len(names):
                    report.messages[names[record.topic]] += 1
                    if wanted[record.topic]:
                        yield names[record.topic], record.stamp, record.data
        if not report.closed:
            report.note(
                f"{self.path}: was not closed: the recording ended with a crash, or files at its end are missing"
            )

    def _is_last(self, file: Path, record: _Record) -> bool:
        try:
            last = json_table(record.data, f"{file}: footer").get("last")
        except FileFormatError as error:
            self.report.note(str(error))
            return False
        if not isinstance(last, bool):
            self.report.note(f"{file}: footer: last: expected true or false, got {shortened(last)}")
        return last is True

    def _count_missing(self, file: Path, number: int, expected: int | None) -> int:
        if expected is None and number != 0:
            self.report.note(f"{file}: {number} records before it are in files that are not there")
        elif expected is not None and number > expected:
            self.report.lost += number - expected
            self.report.note(f"{file}: {number - expected} record(s) before record {number} are missing")
        elif expected is not None and number < expected:
            self.report.note(
                f"{file}: record {number} comes after record {expected - 1}: out of order, or again"
            )
        return number + 1

    def _first_header(self) -> tuple[tuple[JournalTopic, ...], About]:
        """Return topics and origin by the first header that is whole; it comes again and again."""
        for file in self._files:
            for record in _records(file, JournalReport()):
                if record.topic == HEADER:
                    return _header(file, record.data)
        raise FileFormatError(
            f"{self.path}: no whole header in its {len(self._files)} file(s): nothing can be read"
        )


def _header(file: Path, data: bytes) -> tuple[tuple[JournalTopic, ...], About]:
    """Check what a header says."""
    where = f"{file}: header"
    if len(data) > MAX_HEADER:
        raise FileFormatError(f"{where}: has {len(data)} bytes, expected {MAX_HEADER} at most")
    header = json_table(data, where, finite=False)
    if header.get("format") != FORMAT:
        raise FileFormatError(f"{where}: format {shortened(header.get('format'))}, expected {FORMAT}")
    listed = header.get("topics")
    if not isinstance(listed, list) or not 0 < len(listed) < NOTE:
        raise FileFormatError(f"{where}: topics: expected a list of them, got {shortened(listed)}")
    for topic in listed:
        for key in ("name", "type", "md5", "definition"):
            if not isinstance(topic, dict) or not isinstance(topic.get(key), str):
                raise FileFormatError(f"{where}: topic {shortened(topic)}: expected text as its {key}")
        check_ros1_type(file, topic["name"], topic["type"], topic["md5"], topic["definition"])
    topics = tuple(JournalTopic(topic["name"], topic["type"]) for topic in listed)
    if len({topic.name for topic in topics}) < len(topics):
        raise FileFormatError(f"{where}: topics: expected names that differ, got one of them twice")
    return topics, About.from_mapping(header, where)


def _records(file: Path, report: JournalReport) -> Iterator[_Record]:
    """Yield the whole records of a file; what lies between them goes into the report."""
    try:
        opened = file.open("rb")
    except OSError as error:
        raise FileFormatError(f"{file}: cannot be read: {error.strerror}") from error
    with opened:
        size = opened.seek(0, 2)
        if size == 0:  # killed between making the file and writing to it
            report.note(f"{file}: is empty")
            return
        with mmap.mmap(opened.fileno(), 0, access=mmap.ACCESS_READ) as content:
            search = _Search(content, SEARCHED * size)
            position = len(MAGIC) if content[: len(MAGIC)] == MAGIC else search.next_record(0)
            if position is None:
                report.note(f"{file}: does not begin as a journal, and holds no whole record")
                return
            while position < size:
                record = search.record_at(position)
                if record is not None:
                    position += HEAD.size + len(record.data)
                    yield record
                    continue
                following = search.next_record(position + 1)
                if following is None:
                    report.note(
                        f"{file}: its last {size - position} bytes, from {position} on, "
                        + (
                            "are no whole record"
                            if search.left > 0
                            else "have too many beginnings of records in vain"
                        )
                    )
                    return
                report.note(f"{file}: bytes {position} to {following} are damaged")
                position = following


class _Search:
    """Finds whole records in a file, checking no more than so many bytes in vain."""

    def __init__(self, content: mmap.mmap, left: int) -> None:
        self._content, self.left = content, left
        self._size = len(content)

    def record_at(self, position: int) -> _Record | None:
        """Return the record that begins there, or None when none does or it is not whole."""
        content, start = self._content, position + HEAD.size
        if start > self._size:
            return None
        marker, checksum, length, topic, _, number, stamp = HEAD.unpack_from(content, position)
        if marker != MARKER or length > MAX_RECORD or start + length > self._size:
            return None
        data = content[start : start + length]
        if crc32(data, crc32(content[position + 8 : start])) != checksum:
            self.left -= length
            return None
        return _Record(topic, number, stamp, data)

    def next_record(self, position: int) -> int | None:
        """Return where the next whole record begins, or None."""
        while self.left > 0 and (position := self._content.find(MARKER, position)) >= 0:
            if self.record_at(position) is not None:
                return position
            position += 1
        return None
