"""A recording while it grows: an append-only file that survives a crash, a kill and a full disk.

A recording is a folder of `0000.journal`, `0001.journal`, ...: each at most about `max_bytes` long and readable by
itself. A file is magic, then records of 32 bytes of head (`HEAD`) and data: first the header (JSON), then messages,
last a footer (JSON), which only a file that was closed has; a note (JSON) is for people. The header comes again each
second, so that a damaged one costs no message. Every record has a checksum and a number that counts through all files,
so that whatever is missing is noticed and counted.
"""

import json
import logging
import os
import threading
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from struct import Struct
from types import TracebackType
from typing import Any, Literal, NamedTuple, Self
from zlib import crc32

from catenary.documents import shortened
from catenary.errors import FileFormatError, InputError, RecordingError
from catenary.recording.messages import fields, full_definition, md5_sum

FORMAT = "catenary.journal.1"
MAGIC = b"catenary journal 1\n"
# marker, checksum of all that follows, bytes of data, topic, 0, number, stamp [ns]
HEAD = Struct("<4sIIHHQq")
MARKER = b"\xc7REC"
HEADER, FOOTER, NOTE = 0xFFFF, 0xFFFE, 0xFFFD  # in place of a topic's index
FLUSH_INTERVAL = 0.5  # [s] a crash loses at most this and what the disk takes to write it
HEADER_INTERVAL = 1.0  # [s] between headers of a file, while messages come
MAX_HEADER = 2**20  # [B] of JSON; a recording of all topics has some 10 kB
MAX_BYTES = 64 * 2**20  # of a file; reading one maps it into memory
MAX_PENDING = 8 * 2**20  # [B] that wait for the disk; beyond it whoever appends waits too
MAX_RECORD = 64 * 2**20  # [B]; a longer one is taken for damage
_REST = Struct("<IHHQq")  # of the head, from behind the checksum

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
        """Return JSON text of what `from_mapping` reads."""
        return json.dumps(vars(self) | {"configuration": dict(self.configuration)})

    @classmethod
    def from_mapping(cls, values: Mapping[str, Any], where: str) -> Self:
        """Read what `as_json` wrote; keys that are not known are left out."""
        robot, seed = values.get("robot"), values.get("seed")
        simulated, configuration = values.get("simulated", False), values.get("configuration") or {}
        for key, value, is_right, expected in (
            ("robot", robot, robot is None or isinstance(robot, str), "a name or null"),
            ("simulated", simulated, isinstance(simulated, bool), "true or false"),
            ("seed", seed, seed is None or type(seed) is int, "a whole number or null"),
            ("configuration", configuration, isinstance(configuration, dict), "a table"),
        ):
            if not is_right:
                raise FileFormatError(f"{where}: {key}: expected {expected}, got {shortened(value)}")
        return cls(robot, simulated, seed, configuration)


def same_origin(stated: Sequence[About | None]) -> About | None:
    """Return what the files of one recording say of it; refuse files of different robots."""
    said = [about for about in stated if about is not None]
    if any((about.robot, about.simulated) != (said[0].robot, said[0].simulated) for about in said):
        found = ", ".join(f"{a.robot} ({'simulated' if a.simulated else 'real'})" for a in said)
        raise InputError(f"recording: its files are of different robots: {found}")
    return said[0] if said else None


def record_bytes(topic: int, number: int, stamp: int, data: bytes) -> bytes:
    """Return the bytes of one record."""
    rest = _REST.pack(len(data), topic, 0, number, stamp)
    return b"".join((MARKER, crc32(data, crc32(rest)).to_bytes(4, "little"), rest, data))


class JournalWriter:
    """Writes a recording. Appending copies bytes; a thread brings them to the disk every half second.

    Raises RecordingError at the next append, or when closed, if the disk is full or fails: the file then ends
    with its last whole record and the error says which message that was.
    """

    def __init__(
        self,
        folder: Path,
        topics: Sequence[JournalTopic],
        about: About | None = None,
        *,
        max_bytes: int = MAX_BYTES,
        flush_interval: float = FLUSH_INTERVAL,
    ) -> None:
        """Begin a recording."""
        if not 0 < len(topics) < NOTE or len({t.name for t in topics}) != len(topics):
            raise InputError(f"{folder}: expected topics that differ, got {[t.name for t in topics]}")
        for topic in topics:
            fields(topic.type)  # an unknown type is refused before anything is written
        if any(folder.glob("*.journal")):
            raise InputError(f"{folder}: holds a recording already, which is never overwritten")
        self.folder = folder
        self._topics = tuple(topics)
        self._index = {topic.name: i for i, topic in enumerate(topics)}
        self._about = about if about is not None else About()
        self._max_bytes = max_bytes
        self._number = 0  # of the next record
        self._part = 0
        self._pending = bytearray()
        self._messages = 0
        self._safe_bytes = 0  # of the present file, on the disk
        self._safe_messages = 0  # on the disk, in all files
        self._last_stamp = 0
        self._error: OSError | None = None
        self._closed = False
        self._append_lock = threading.RLock()  # guards what waits
        self._disk_lock = threading.RLock()  # guards the file; taken before the other one
        self._fd = -1
        self._stop = threading.Event()
        self._header = json.dumps(
            {
                "format": FORMAT,
                "topics": [
                    t._asdict() | {"md5": md5_sum(t.type), "definition": full_definition(t.type)}
                    for t in topics
                ],
                **json.loads(self._about.as_json()),
            }
        ).encode()
        if len(self._header) > MAX_HEADER:
            raise InputError(
                f"{folder}: topics and configuration take {len(self._header)} bytes of header, expected {MAX_HEADER} "
                "at most"
            )
        self._header_at = 0.0  # [s] when the last header was set aside, by the monotonic clock
        self._pending += self._begin()
        if max_bytes < 2 * len(self._pending):
            raise InputError(
                f"{folder}: files of {max_bytes} bytes, but each begins with {len(self._pending)}; allow more"
            )
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise RecordingError(f"{folder}: cannot be made: {error.strerror}") from error
        self._open_file()
        self.flush()
        self._thread = threading.Thread(target=self._flush_often, args=(flush_interval,), daemon=True)
        self._thread.start()

    def append(self, topic: str, stamp: int, data: bytes) -> None:
        """Add a message that arrived at `stamp` [ns]."""
        self._raise_error()
        if self._closed:
            raise InputError(f"{self.folder}: is closed")
        index = self._index.get(topic)
        if index is None:
            raise InputError(f'topic "{topic}": not in this recording, which has {", ".join(self._index)}')
        if len(data) > MAX_RECORD:
            raise InputError(f'topic "{topic}": {len(data)} bytes, expected {MAX_RECORD} at most')
        with self._append_lock:
            record = record_bytes(index, self._number, stamp, data)
            self._number += 1
            self._messages += 1
            self._last_stamp = stamp
            self._pending += record
            waiting = len(self._pending)
        if waiting > min(MAX_PENDING, self._max_bytes // 4):
            self.flush()

    def note(self, text: str) -> None:
        """Add a remark for whoever reads the recording; older versions pass over it."""
        with self._append_lock:
            self._pending += self._record(NOTE, json.dumps({"note": text}).encode())

    def flush(self) -> None:
        """Write everything to the disk."""
        with self._disk_lock:
            self._write_pending()
        self._raise_error()

    def close(self) -> None:
        """Finish the recording; a second time does nothing."""
        if self._closed:
            return
        self._stop.set()
        self._thread.join()
        with self._disk_lock:
            self._write_pending(end="last")
            self._closed = True
        self._raise_error()

    @property
    def messages(self) -> int:
        """Number of messages appended so far."""
        return self._messages

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
        """Return how a file begins."""
        return MAGIC + self._header_record()

    def _header_record(self) -> bytes:
        self._header_at = time.monotonic()
        return self._record(HEADER, self._header)

    def _record(self, kind: int, content: bytes) -> bytes:
        """Return the next record: a file's header or footer, which count as messages do."""
        self._number += 1
        return record_bytes(kind, self._number - 1, self._last_stamp, content)

    def _open_file(self) -> None:
        """Make the present part's file; keeps an error for the next append. Needs the disk."""
        path = self.folder / f"{self._part:04d}.journal"
        self._safe_bytes = 0
        try:
            self._fd = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o644)
            folder = os.open(self.folder, os.O_RDONLY)
            try:
                os.fsync(folder)  # or the file's name may not survive a power cut
            finally:
                os.close(folder)
        except OSError as error:
            self._error = error

    def _flush_often(self, interval: float) -> None:
        while not self._stop.wait(interval):
            with self._disk_lock:
                self._write_pending()
            if self._error is not None:
                return

    def _write_pending(self, *, end: Literal["last", "if full"] = "if full") -> None:
        """Bring what waits onto the disk, and go on in another file if this one is full. Needs the disk.

        Whoever appends meanwhile waits only while bytes are set aside, not for the disk. An error is kept for the
        next append.
        """
        with self._append_lock:
            full = end == "if full" and self._safe_bytes + len(self._pending) >= self._max_bytes
            if end == "last" or full:
                self._pending += self._record(FOOTER, json.dumps({"last": not full}).encode())
            elif self._pending and time.monotonic() - self._header_at >= HEADER_INTERVAL:
                self._pending += self._header_record()
            block, self._pending = self._pending, bytearray(self._begin() if full else b"")
            messages = self._messages
        if self._error is not None or not block:
            return
        written = 0
        try:
            while written < len(block):
                written += os.write(self._fd, memoryview(block)[written:])
        except OSError as error:
            self._cut(bytes(block[:written]))
            self._error = error
            return
        try:
            os.fsync(self._fd)
        except OSError as error:
            self._error = error  # nobody knows what of this block is on the disk: it does not count as safe
            return
        self._safe_bytes += len(block)
        self._safe_messages = messages
        if full or end == "last":
            os.close(self._fd)
            self._fd = -1
        if full:
            self._part += 1
            self._open_file()
            self._write_pending()

    def _cut(self, written: bytes) -> None:
        """Cut the file behind its last whole record, so that no torn one follows it."""
        position = len(MAGIC) if self._safe_bytes == 0 else 0
        while position + HEAD.size <= len(written):
            _, _, length, topic, *_ = HEAD.unpack_from(written, position)
            if position + HEAD.size + length > len(written):
                break
            position += HEAD.size + length
            self._safe_messages += topic < NOTE
        try:
            os.ftruncate(self._fd, self._safe_bytes + min(position, len(written)))
            os.fsync(self._fd)
        except OSError:
            log.exception("%s: could not be cut behind its last whole record", self.folder)

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
