"""A recording while it grows: MCAP that survives a crash, a kill and a full disk.

A recording is a folder of `0000.mcap`, `0001.mcap`, ...: each at most about `max_bytes` long and readable by itself, by
any program that reads MCAP. What was appended becomes a chunk every half second, with its checksum; in front of it
stands what the recording is of, in it the topics with their types, so that a damaged chunk costs no other. Messages are
ROS 1's bytes, numbered by topic through all files, so that whatever is missing is noticed and counted. A file that was
closed has MCAP's index at its end. [mcap.dev/spec]

A recording that was cut off goes on in another file, which tells how much of the recording was there before.
"""

import json
import logging
import os
import threading
from bisect import bisect_right
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from struct import Struct
from types import TracebackType
from typing import Any, NamedTuple, Self
from zlib import crc32

from catenary.config import parse_json
from catenary.errors import InputError, RecordingError
from catenary.operating_system import OWN_FILE, sync_folder
from catenary.recording.messages import fields, full_definition

LIBRARY = "catenary journal 2"  # by which a file is known as a journal's
# names of metadata
ABOUT, NOTE, ENDED, PASS = "catenary_about", "catenary_note", "catenary_end", "catenary_pass"
MAGIC = b"\x89MCAP0\r\n"
# kinds of records [mcap.dev/spec]
_HEADER, _FOOTER, _SCHEMA, _CHANNEL, _MESSAGE, _CHUNK = 1, 2, 3, 4, 5, 6
_MESSAGE_INDEX, _CHUNK_INDEX, _STATISTICS, _METADATA, _DATA_END = 7, 8, 11, 12, 15
_FLUSH_INTERVAL_S = 0.5  # [s] a crash loses at most this and what the disk takes to write it
_CHUNK_BYTES = 2**16  # [B] from which the next message begins another chunk: damage costs one
MAX_FILE_BYTES = 64 * 2**20  # of a file
_MAX_PENDING_BYTES = 8 * 2**20  # [B] that wait for the disk; beyond it whoever appends waits too
_MAX_MESSAGE_BYTES = 64 * 2**20  # [B]; a longer message is refused
_RECORD, _U32, _TIMES = Struct("<BQ"), Struct("<I"), Struct("<QQ")
_MESSAGE_HEAD = Struct("<BQHIQQ")  # kind, length, channel, number, arrival, publication
_PROOF_BYTES = 23  # of a message's head, to its arrival: what proves the message before it in a torn chunk

log = logging.getLogger(__name__)


class JournalTopic(NamedTuple):
    """A topic of a journal."""

    name: str
    type: str


@dataclass(frozen=True)
class About:
    """Robot, seed and settings that a recording was made with; every file made from it carries them."""

    robot: str | None = None
    simulated: bool = False
    seed: int | None = None
    configuration: Mapping[str, Any] = field(default_factory=dict)

    def as_json(self) -> str:
        """Return JSON text of what `from_json` reads."""
        return json.dumps(vars(self) | {"configuration": dict(self.configuration)})

    @classmethod
    def from_json(cls, text: bytes, where: str) -> Self:
        """Read what `as_json` wrote; keys that are not known are left out."""
        return parse_json(text, cls, where, finite=False)


class LeftOff(NamedTuple):
    """Position at which an interrupted recording continues."""

    begins: float  # [s] of the recording, or of its motion, that are there
    part: int  # number of the next file
    numbers: Mapping[str, int]  # of the next message, by topic
    last: int  # [ns] arrival of the last message

    def gap(self, now: int) -> str:
        """Tell of a recording that goes on at `now` [ns] what is missing in it."""
        return f"cut off, and went on {(now - self.last) * 1e-9:.1f} s later from {self.begins:.1f} s of it"


def same_origin(stated: Sequence[About | None]) -> About | None:
    """Return the description of a recording from its files; refuse files of different robots."""
    origins = [about for about in stated if about is not None]
    if any((about.robot, about.simulated) != (origins[0].robot, origins[0].simulated) for about in origins):
        names = ", ".join(f"{a.robot} ({'simulated' if a.simulated else 'real'})" for a in origins)
        raise InputError(f"recording: its files are of different robots: {names}")
    return origins[0] if origins else None


def is_journal_name(path: Path) -> bool:
    """Return True if a file is named as a journal's files are."""
    return path.suffix == ".mcap" and len(path.stem) >= 4 and path.stem.isdigit()


def _text(text: str) -> bytes:
    data = text.encode()
    return _U32.pack(len(data)) + data


def _record(kind: int, *parts: bytes) -> bytes:
    data = b"".join(parts)
    return _RECORD.pack(kind, len(data)) + data


def metadata_record(name: str, **values: str) -> bytes:
    """Return a record of texts for whoever reads the file."""
    pairs = b"".join(_text(key) + _text(value) for key, value in values.items())
    return _record(_METADATA, _text(name), _U32.pack(len(pairs)), pairs)


class _Chunk:
    """Messages that wait for the disk."""

    def __init__(self, topics: bytes) -> None:
        self.data = bytearray(topics)
        self.ends: list[int] = []  # in the data, of each message
        self.stamps: list[int] = []
        self.places: dict[int, list[tuple[int, int]]] = {}  # stamp and place of messages, by channel

    def append(self, channel: int, number: int, stamp: int, data: bytes) -> None:
        self.places.setdefault(channel, []).append((stamp, len(self.data)))
        self.data += _MESSAGE_HEAD.pack(_MESSAGE, 22 + len(data), channel, number, stamp, stamp)
        self.data += data
        self.ends.append(len(self.data))
        self.stamps.append(stamp)

    def records(self, at: int) -> tuple[bytes, bytes, bytes]:
        """Return the chunk's record, those of its messages' places, and its entry in a file's index; it begins `at`."""
        first, last, size = min(self.stamps), max(self.stamps), len(self.data)
        head = _TIMES.pack(first, last) + Struct("<QI").pack(size, crc32(self.data)) + _text("")
        chunk = _record(_CHUNK, head, size.to_bytes(8, "little"), bytes(self.data))
        indices, offsets = b"", b""
        for channel, places in self.places.items():
            offsets += Struct("<HQ").pack(channel, at + len(chunk) + len(indices))
            pairs = b"".join(_TIMES.pack(*place) for place in places)
            indices += _record(_MESSAGE_INDEX, channel.to_bytes(2, "little"), _U32.pack(len(pairs)), pairs)
        span, ends = Struct("<QQQQ").pack(first, last, at, len(chunk)), _text("") + _TIMES.pack(size, size)
        index = _U32.pack(len(offsets)), offsets, len(indices).to_bytes(8, "little")
        entry = _record(_CHUNK_INDEX, span, *index, ends)
        return chunk, indices, entry


class JournalWriter:
    """Writes a recording. Appending copies bytes; a thread brings them to the disk every half second.

    If the disk is full or fails, the file ends behind its last whole message, and the next append or close says so.
    """

    def __init__(
        self,
        folder: Path,
        topics: Sequence[JournalTopic],
        about: About | None = None,
        *,
        after: LeftOff | None = None,
        max_bytes: int = MAX_FILE_BYTES,
        flush_interval: float = _FLUSH_INTERVAL_S,
    ) -> None:
        """Begin a recording, or go on with one of the same topics that was cut off."""
        if not 0 < len(topics) < 2**16 or len({t.name for t in topics}) != len(topics):
            raise InputError(f"{folder}: expected topics that differ, got {[t.name for t in topics]}")
        for topic in topics:
            fields(topic.type)  # an unknown type is refused before anything is written
        if after is None and any(folder.glob("*.mcap")):
            raise InputError(f"{folder}: holds a recording already, which is never overwritten")
        self.folder = folder
        self._index = {topic.name: i for i, topic in enumerate(topics)}
        self._about = metadata_record(ABOUT, about=(about if about is not None else About()).as_json())
        self._topics = b"".join(_topic_records(i, topic) for i, topic in enumerate(topics))
        after = LeftOff(0.0, 0, {}, 0) if after is None else after
        self._begins, self._part = after.begins, after.part
        head = len(self._begin())
        if max_bytes < 2 * head:
            raise InputError(f"{folder}: files of {max_bytes} bytes, but each begins with {head}; allow more")
        self._max_bytes = max_bytes
        self._numbers = [after.numbers.get(topic.name, 0) for topic in topics]  # of the next message, by channel
        self._waiting: list[_Chunk] = []
        self._pending = 0  # [B] of the messages that wait
        self._notes = b""
        self._messages = 0
        self._safe_messages = 0  # on the disk, in all files
        self._error: OSError | None = None
        self._closed = False
        self._append_lock = threading.RLock()  # guards what waits
        self._disk_lock = threading.RLock()  # guards the file; taken before the other one
        self._fd = -1
        self._stop = threading.Event()
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise RecordingError(f"{folder}: cannot be made: {error.strerror}") from error
        self._open_file()
        self._raise_error()
        self._thread = threading.Thread(target=self._flush_often, args=(flush_interval,), daemon=True)
        self._thread.start()

    def append(self, topic: str, stamp: int, data: bytes) -> None:
        """Add a message that arrived at `stamp` [ns]."""
        self._raise_error()
        if self._closed:
            raise InputError(f"{self.folder}: is closed")
        channel = self._index.get(topic)
        if channel is None:
            raise InputError(f'topic "{topic}": not in this recording, which has {", ".join(self._index)}')
        if len(data) > _MAX_MESSAGE_BYTES or not 0 <= stamp < 2**63:
            raise InputError(
                f'topic "{topic}": {len(data)} bytes at {stamp} ns, '
                f"expected {_MAX_MESSAGE_BYTES} bytes at most, since 1970"
            )
        with self._append_lock:
            if not self._waiting or len(self._waiting[-1].data) > _CHUNK_BYTES:
                self._waiting.append(_Chunk(self._topics))
            self._waiting[-1].append(channel, self._numbers[channel] % 2**32, stamp, data)
            self._numbers[channel] += 1
            self._messages += 1
            self._pending += len(data) + _MESSAGE_HEAD.size
            waiting = self._pending
        if waiting > min(_MAX_PENDING_BYTES, self._max_bytes // 4):
            self.flush()

    def note(self, text: str) -> None:
        """Add a remark for whoever reads the recording."""
        with self._append_lock:
            self._notes += metadata_record(NOTE, note=text)

    def flush(self) -> None:
        """Write everything to the disk."""
        with self._disk_lock:
            self._write_waiting()
        self._raise_error()

    def close(self) -> None:
        """Finish the recording; a second time does nothing."""
        if self._closed:
            return
        self._stop.set()
        self._thread.join()
        with self._disk_lock:
            self._write_waiting(is_last=True)
            self._closed = True
        self._raise_error()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            self.close()
        except RecordingError:
            if error is None:
                raise  # otherwise it would hide the error that is under way
            log.exception("%s: could not be closed", self.folder)

    def _begin(self) -> bytes:
        """Return the beginning of a file."""
        return MAGIC + _record(_HEADER, _text("ros1"), _text(LIBRARY)) + self._origin() + self._topics

    def _origin(self) -> bytes:
        """Return the description of the recording, and the amount that was there before."""
        return self._about + metadata_record(PASS, begins=repr(self._begins))

    def _open_file(self) -> None:
        """Begin the present part's file; keeps an error for the next append. Needs the disk."""
        path = self.folder / f"{self._part:04d}.mcap"
        self._size = 0  # [B] of the file
        self._chunks: list[bytes] = []  # entries of its index
        self._first, self._last = 2**63, 0  # [ns] arrivals in it
        self._counts = [0] * len(self._numbers)
        try:
            self._fd = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | OWN_FILE, 0o644)
            sync_folder(self.folder)  # or the file's name may not survive a power cut
        except OSError as error:
            self._error = error
            return
        self._write(self._begin())

    def _flush_often(self, interval: float) -> None:
        while not self._stop.wait(interval):
            with self._disk_lock:
                self._write_waiting()
            if self._error is not None:
                return

    def _write_waiting(self, *, is_last: bool = False) -> None:
        """Bring what waits onto the disk; end a file that is last, or full, and go on in another. Needs the disk."""
        with self._append_lock:
            chunks, self._waiting, self._pending = self._waiting, [], 0
            notes, self._notes = self._notes, b""
        self._write_chunks(notes, chunks)
        if self._error is None and (is_last or self._size >= self._max_bytes):
            self._write(self._ending(is_last=is_last))
            if self._error is None:
                os.close(self._fd)
                self._fd = -1
                if not is_last:
                    self._part += 1
                    self._open_file()

    def _write_chunks(self, notes: bytes, chunks: Sequence[_Chunk]) -> None:
        if self._error is not None:
            return
        block = bytearray(notes)
        begins = []  # of the chunks' data in the block
        for chunk in chunks:
            block += self._origin()
            data, indices, entry = chunk.records(self._size + len(block))
            begins.append(len(block) + len(data) - len(chunk.data))
            block += data
            block += indices
            self._chunks.append(entry)
            self._first = min(self._first, min(chunk.stamps))
            self._last = max(self._last, max(chunk.stamps))
            for channel, places in chunk.places.items():
                self._counts[channel] += len(places)
        written = self._write(block) if block else 0
        for begin, chunk in zip(begins, chunks, strict=True):
            there = written - begin - (_PROOF_BYTES if written - begin < len(chunk.data) else 0)
            self._safe_messages += bisect_right(chunk.ends, there)

    def _write(self, block: bytes | bytearray) -> int:
        """Write bytes at the end of the file, and return how many are there; keeps an error for the next append."""
        written = 0
        try:
            while written < len(block):
                written += os.write(self._fd, memoryview(block)[written:])
        except OSError as error:
            self._error = error
        try:
            os.fsync(self._fd)
        except OSError as error:  # nobody knows what of this block is on the disk: it does not count as safe
            self._error, written = self._error or error, 0
        self._size += written
        return written

    def _ending(self, *, is_last: bool) -> bytes:
        """Return the end of a file: the index by which others read it."""
        data = metadata_record(ENDED, last="true" if is_last else "false") + _record(_DATA_END, bytes(4))
        counts = b"".join(Struct("<HQ").pack(i, n) for i, n in enumerate(self._counts) if n)
        topics, span = len(self._counts), _TIMES.pack(min(self._first, self._last), self._last)
        sums = Struct("<QHIIII").pack(sum(self._counts), topics, topics, 0, 0, len(self._chunks))
        statistics = _record(_STATISTICS, sums, span, _U32.pack(len(counts)), counts)
        summary = self._topics + b"".join(self._chunks) + statistics
        footer = _record(_FOOTER, _TIMES.pack(self._size + len(data), 0), bytes(4))
        return data + summary + footer + MAGIC

    def _raise_error(self) -> None:
        """Close and say what is safe, if the disk was full or failed."""
        if self._error is None:
            return
        with self._disk_lock:
            self._closed = True
            self._stop.set()
            if self._fd >= 0:
                os.close(self._fd)
                self._fd = -1
        raise RecordingError(
            f"{self.folder}: recording stopped: {self._error.strerror}. Safe are the first {self._safe_messages} of "
            f"{self._messages} messages, in {self._part + 1} file(s); {self._messages - self._safe_messages} are lost"
        ) from self._error


def _topic_records(number: int, topic: JournalTopic) -> bytes:
    """Return the schema and the channel of a topic."""
    schema = Struct("<H").pack(number + 1) + _text(topic.type) + _text("ros1msg")
    channel = Struct("<HH").pack(number, number + 1) + _text(topic.name) + _text("ros1") + bytes(4)
    return _record(_SCHEMA, schema, _text(full_definition(topic.type))) + _record(_CHANNEL, channel)
