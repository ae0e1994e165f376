"""A journal as it is found: whole, torn by a crash, or damaged; what is whole is read, what is not is counted."""

import json
import mmap
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple
from zlib import crc32

from catenary.errors import FileFormatError
from catenary.recording.journal import (
    FOOTER,
    HEAD,
    HEADER,
    MAGIC,
    MARKER,
    MAX_RECORD,
    NOTE,
    About,
    JournalTopic,
)
from catenary.recording.layout import Encoding
from catenary.recording.messages import check_ros1_type
from catenary.recording.topics import require_topics


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
    notes: list[str] = field(default_factory=list)  # of the recorder; they tell of no loss
    lost: int = 0  # messages that are known to be missing
    closed: bool = False  # the recording was finished, not cut off


class JournalReader:
    """Reads a recording: its folder, or one of its files.

    `report` tells what was missing or damaged; it is complete when `messages` has been read to its end.
    """

    encoding: Encoding = "ros1"

    def __init__(self, path: Path) -> None:
        """Read the header.

        Raises:
            FileFormatError: No such recording, nothing in it is whole, or its message types are not ours.
        """
        self.path = path
        self._files = sorted(path.glob("*.journal")) if path.is_dir() else [path]
        if not self._files or not self._files[0].is_file():
            raise FileFormatError(f"{path}: no journal there; expected a folder of .journal files, or one")
        self.report = JournalReport()
        self._header = self._first_header()
        self.topics = tuple(JournalTopic(t["name"], t["type"]) for t in self._header["topics"])
        self.about: About | None = About.from_mapping(self._header)
        for topic in self._header["topics"]:
            check_ros1_type(path, topic["name"], topic["type"], topic["md5"], topic["definition"])

    @property
    def problems(self) -> list[str]:
        """What was found missing or damaged so far, in words, and the recorder's own notes."""
        return [*self.report.problems, *self.report.notes]

    def messages(self, topics: Collection[str] | None = None) -> Iterator[tuple[str, int, bytes]]:
        """Yield topic, arrival stamp [ns] and bytes of every whole message, in the order of arrival.

        Args:
            topics: Those to give; None for all. All are counted.

        Raises:
            FileFormatError: A topic is not in the recording.
        """
        names = [topic.name for topic in self.topics]
        require_topics(self.path, topics, names)
        report = self.report = JournalReport(messages=dict.fromkeys(names, 0))
        wanted = [topics is None or name in topics for name in names]
        expected: int | None = None  # number of the next record
        for file in self._files:
            report.closed = False
            for record in _records(file, report):
                expected = self._count_missing(file, record.number, expected)
                if record.topic == FOOTER:
                    report.closed = bool(json.loads(record.data)["last"])
                elif record.topic == NOTE:
                    report.notes.append(f"{file}: {json.loads(record.data)['note']}")
                elif record.topic < len(names):
                    report.messages[names[record.topic]] += 1
                    if wanted[record.topic]:
                        yield names[record.topic], record.stamp, record.data
        if not report.closed:
            report.problems.append(
                f"{self.path}: was not closed: the recording ended with a crash, or files at its end are missing"
            )

    def _count_missing(self, file: Path, number: int, expected: int | None) -> int:
        if expected is None and number != 0:
            self.report.problems.append(f"{file}: {number} records before it are in files that are not there")
        elif expected is not None and number > expected:
            self.report.lost += number - expected
            self.report.problems.append(
                f"{file}: {number - expected} record(s) before record {number} are missing"
            )
        return number + 1

    def _first_header(self) -> Mapping[str, Any]:
        for file in self._files:
            for record in _records(file, JournalReport()):
                if record.topic == HEADER:
                    header: dict[str, Any] = json.loads(record.data)
                    if header.get("format") != "catenary.journal.1":
                        raise FileFormatError(
                            f"{file}: format {header.get('format')!r}, expected catenary.journal.1"
                        )
                    return header
                break
        raise FileFormatError(
            f"{self.path}: no whole header in its {len(self._files)} file(s): nothing can be read"
        )


def _records(file: Path, report: JournalReport) -> Iterator[_Record]:
    """Yield the whole records of a file; what lies between them goes into the report."""
    with file.open("rb") as opened:
        size = opened.seek(0, 2)
        if size == 0:  # killed between making the file and writing to it
            report.problems.append(f"{file}: is empty")
            return
        with mmap.mmap(opened.fileno(), 0, access=mmap.ACCESS_READ) as content:
            position = len(MAGIC) if content[: len(MAGIC)] == MAGIC else _next_record(content, 0)
            if position is None:
                report.problems.append(f"{file}: does not begin as a journal, and holds no whole record")
                return
            while position < size:
                record = _record_at(content, position, size)
                if record is not None:
                    position += HEAD.size + len(record.data)
                    yield record
                    continue
                following = _next_record(content, position + 1)
                if following is None:
                    report.problems.append(
                        f"{file}: its last {size - position} bytes, from {position} on, are no whole record"
                    )
                    return
                report.problems.append(f"{file}: bytes {position} to {following} are damaged")
                position = following


def _record_at(content: mmap.mmap, position: int, size: int) -> _Record | None:
    """Return the record that begins there, or None when none does or it is not whole."""
    start = position + HEAD.size
    if start > size:
        return None
    marker, checksum, length, topic, _, number, stamp = HEAD.unpack_from(content, position)
    if marker != MARKER or length > MAX_RECORD or start + length > size:
        return None
    data = content[start : start + length]
    if crc32(data, crc32(content[position + 8 : start])) != checksum:
        return None
    return _Record(topic, number, stamp, data)


def _next_record(content: mmap.mmap, position: int) -> int | None:
    """Return where the next whole record begins, or None."""
    size = len(content)
    while (position := content.find(MARKER, position)) >= 0:
        if _record_at(content, position, size) is not None:
            return position
        position += 1
    return None
