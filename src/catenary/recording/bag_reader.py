"""A recording to read, whatever kind of file it is in: each kind from its first message to its last, by no index.

A journal or a bag may be whole, torn by a crash, or damaged; what is whole is read, what is not is counted.
"""

import contextlib
import re
import shutil
import sqlite3
import tempfile
import weakref
from collections import Counter, deque
from collections.abc import Collection, Iterator, Mapping, Sequence
from itertools import islice
from pathlib import Path, PurePath
from typing import Any, NamedTuple, Self

import numpy as np

from catenary.arrays import Integers
from catenary.bounded_parsers import reading, shortened
from catenary.errors import FileFormatError
from catenary.file_formats import copied_as_text, format_named, format_of
from catenary.recording.bag_records import DAMAGE, Block, Unpacking
from catenary.recording.bag_stream import BagConnection, BagStream, Hole, Source, about_of
from catenary.recording.journal import LIBRARY, MAGIC, LeftOff, is_journal_name
from catenary.recording.layout import ABOUT_TOPIC
from catenary.topics import SECOND

_MESSAGES_AT_ONCE = 2048  # messages that are in memory at once
_ROW_BYTES = 40  # [B] that a row takes beside its message, with its entry in the index of times
_ROWS = "SELECT id, topic_id, timestamp, data FROM messages ORDER BY id"


class SqliteBag(Source):
    """Reads a SQLite file of a ROS 2 bag, in the order in which it was recorded."""

    def __init__(self, path: Path) -> None:
        """Read the file once, to find its topics."""
        super().__init__(path)
        counts = Counter[str]()
        with reading(path, "SQLite", (sqlite3.Error, *DAMAGE)):
            self._database, self._size = _opened(path, self)
            self._database.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, self._size)
            self._database.execute("PRAGMA writable_schema = ON")  # else one that was cut off is not opened at all
            self._database.execute("PRAGMA trusted_schema = OFF")
            for kind, name, text in self._database.execute("SELECT type, name, sql FROM sqlite_master"):
                # nothing is worked out when it is read
                computed = re.search(r"\bVIRTUAL\b|\bGENERATED\b|\bAS\s*\(|\bWHERE\b", str(text or ""), re.IGNORECASE)
                if kind not in ("table", "index") or computed:
                    raise FileFormatError(f"{path}: {kind} {shortened(name)}: expected plain tables and indices")
            texts = dict[str, str]()
            with contextlib.suppress(sqlite3.Error):  # older bags have none, and types of ROS's own are known
                texts |= dict(
                    self._database.execute("SELECT topic_type, encoded_message_definition FROM message_definitions")
                )
            for number, topic, kind in self._database.execute("SELECT id, name, type FROM topics"):
                if not isinstance(topic, str) or not isinstance(kind, str):
                    raise FileFormatError(f"{path}: topic {shortened(topic)}: expected texts for it and its type")
                self._keep(number, BagConnection(topic, kind, "", texts.get(kind, "")))
            for name, stamp, data in self._every_message():
                self.first = stamp if self.first is None else self.first
                if name != ABOUT_TOPIC:
                    counts[name] += 1
                elif self.about is None:
                    self.about = about_of(path, data, self.encoding)
        self.counts = {topic.name: counts[topic.name] for topic in self.topics}
        if self.damage and not counts:
            raise FileFormatError(f"{self.damage[0]}; nothing in it can be saved")

    def blocks(self, topics: Collection[str]) -> Iterator[tuple[str, Integers, Block]]:
        """Yield topic, arrival stamps [ns] (N,) and messages, some of every topic before more of one."""
        messages = self.messages(topics)
        while some := list(islice(messages, _MESSAGES_AT_ONCE)):
            for name in dict.fromkeys(name for name, _, _ in some):
                own = [(stamp, data) for topic, stamp, data in some if topic == name]
                yield name, np.array([stamp for stamp, _ in own]), Block.of([data for _, data in own])

    def _every_message(self) -> Iterator[tuple[str, int, bytes]]:
        """Yield topic, arrival stamp [ns] and bytes as SQLite reads them; of damage, but a page of those before it."""
        unpacking, seen, left, count = Unpacking(self.path), -1, self._size, 0
        (page,) = self._database.execute("PRAGMA page_size").fetchone()
        waiting, held, why = deque[tuple[int, int, bytes]](), 0, ""  # rows within a page of here, and their bytes
        self.last, self.until, self.holes, self.damage, self.ends_early = None, None, [], [], False
        try:
            for count, (place, number, stamp, data) in enumerate(self._database.execute(_ROWS), 1):  # noqa: B007
                if place <= seen or not isinstance(data, bytes) or not isinstance(stamp, int):
                    why = "a message without its bytes, or out of its place"
                    break
                seen, left = place, left - len(data)
                if left < 0:
                    why = "its messages take more bytes than the file has"
                    break
                waiting.append((number, stamp, data))
                held += len(data)
                while held - len(waiting[0][2]) >= page:
                    held -= len(waiting[0][2])
                    yield from self._message(unpacking, *waiting.popleft())
        except sqlite3.Error as error:
            why = str(error)
        if why:
            self.holes, self.ends_early = [(self.last, None)], True
            self._lose(left - _ROW_BYTES * count, self._size - left + _ROW_BYTES * count)
            why = f"cannot be read as SQLite to its end: {why}; what is before that was read"
            self.damage.append(f"{self.path}: {why}{copied_as_text(self.path)}")
            return
        for row in waiting:
            yield from self._message(unpacking, *row)

    def _message(self, unpacking: Unpacking, number: int, stamp: int, data: bytes) -> Iterator[tuple[str, int, bytes]]:
        self.last = stamp
        if number in self._names:
            yield self._names[number], stamp, unpacking.message(data)


def _opened(path: Path, reader: SqliteBag) -> tuple[sqlite3.Connection, int]:
    """Open a database as SQLite does, with the changes that wait beside it, in a copy; return it and all bytes."""
    journals = [path.with_name(path.name + end) for end in ("-wal", "-journal")]
    files = [path, *(file for file in journals if file.is_file())]
    size = sum(file.stat().st_size for file in files)
    if len(files) == 1:
        return sqlite3.connect(f"{path.absolute().as_uri()}?immutable=1&mode=ro", uri=True), size
    folder = Path(tempfile.mkdtemp(prefix="catenary-"))
    weakref.finalize(reader, shutil.rmtree, folder, ignore_errors=True)
    for file in files:
        shutil.copyfile(file, folder / file.name)
    return sqlite3.connect(folder / path.name), size


METADATA = "metadata.yaml"
_PARTS = (".mcap", ".db3")  # files of a ROS 2 bag, by their endings
_TOLD_GAP_S = 0.05  # [s] without messages
_MAX_YAML_BYTES = 2**18  # [B] of metadata.yaml; that of 500 topics has 200 kB
_LISTED = re.compile(r"""(?m)^\s*-\s+(?:&\w+\s+)?["']?([^\s"']+\.(?:mcap|db3)(?:\.zstd)?)["']?\s*$""")
_COUNTED = re.compile(r"(?m)^  message_count:\s*(\d+)\s*$")


class TopicLoss(NamedTuple):
    """Messages of a topic that are there, and about how many are not."""

    topic: str
    kept: int
    lost: int  # as the rate of the others tells
    seconds: float  # without a message, beyond the usual interval


class Rescue(NamedTuple):
    """Recovered and lost parts of a damaged recording."""

    topics: tuple[TopicLoss, ...]
    seconds: float  # from the first message to the last
    ends_early: bool  # it was cut off: its end is missing
    gaps: tuple[tuple[float, float], ...] = ()  # [s] from its first message: without any, where it is damaged

    @classmethod
    def of(
        cls, arrivals: Mapping[str, Integers], holes: Sequence[Hole], *, ends_early: bool, until: int | None = None
    ) -> Self:
        """Compare topics, which arrived (M,) [ns]: each lost in holes what comes at its usual rate, the median.

        `until` is when the last message arrived that is lost behind all others, where that is known.
        """
        every = np.unique(np.concatenate([np.zeros(0, dtype=np.int64), *arrivals.values()]))
        first, end = (int(every[0]), max(int(every[-1]), until or 0)) if len(every) else (0, 0)
        places = sorted({int(np.searchsorted(every, at, side="right")) for at, _ in holes if at is not None} - {0})
        gaps = [(int(every[p - 1]), int(every[p]) if p < len(every) else end) for p in places]
        pieces = []
        for topic, arrival in arrivals.items():
            usual = int(np.median(np.diff(arrival))) if len(arrival) > 1 else 0
            lost, without = 0, 0
            spots = {int(np.searchsorted(arrival, at, side="right")) for at, _ in gaps} - {0}
            for spot in spots if usual > 0 else ():
                gap = (int(arrival[spot]) if spot < len(arrival) else end) - int(arrival[spot - 1])
                lost += max(0, round(gap / usual) - (spot < len(arrival)))
                without += max(0, gap - usual)
            pieces.append(TopicLoss(topic, len(arrival), lost, without / SECOND))
        span = int(every[-1]) - first if len(every) else 0
        without_any = tuple(((a - first) / SECOND, (b - first) / SECOND) for a, b in gaps if b > a)
        return cls(tuple(pieces), span / SECOND, ends_early, without_any)

    def as_data(self) -> dict[str, Any]:
        """Return plain data."""
        topics = [one._asdict() | {"seconds": round(one.seconds, 3)} for one in self.topics]
        gaps = [[round(begin, 3), round(end, 3)] for begin, end in self.gaps]
        return {"seconds": round(self.seconds, 3), "ends_early": self.ends_early, "gaps": gaps, "topics": topics}

    def text(self) -> str:
        """Return this in words."""
        kept = ", ".join(f"{one.kept} messages of {one.topic}" for one in self.topics) or "nothing"
        lost = [f"about {one.lost} of {one.topic} ({one.seconds:.2f} s)" for one in self.topics if one.lost]
        return "; ".join(
            [f"kept {self.seconds:.1f} s: {kept}", f"lost: {', '.join(lost) or 'none'}", *self.stretches()]
        )

    def stretches(self) -> list[str]:
        """Return in words which stretches of time have no messages."""
        losses = [
            f"no message for {b - a:.1f} s, from {a:.1f} to {b:.1f} s" for a, b in self.gaps if b - a >= _TOLD_GAP_S
        ]
        return losses + [f"nothing behind {self.seconds:.1f} s: its end is missing or damaged"] * self.ends_early


def is_journal(path: Path) -> bool:
    """Return True if a folder holds a journal's files, or a file is one."""
    if path.is_dir():
        return not (path / "metadata.yaml").is_file() and any(map(is_journal_name, path.glob("*.mcap")))
    if path.suffix != ".mcap" or not path.is_file():
        return False
    with path.open("rb") as file:
        begin = file.read(200)
    return LIBRARY.encode() in begin and begin.startswith(MAGIC)


class FilesInARow(Source):
    """A recording in several files, each read to its end before the next."""

    def __init__(self, path: Path, parts: Sequence[BagStream | SqliteBag]) -> None:
        """Take in what the files say of their topics."""
        super().__init__(path)
        self.parts = parts
        for number, connection in enumerate(entry for part in parts for entry in part.connections.values()):
            self._keep(number, connection)
        self.encoding = parts[0].encoding if parts else "ros1"
        self.about = next((part.about for part in parts if part.about is not None), None)
        self.first = next((part.first for part in parts if part.first is not None), None)

    def _every_message(self) -> Iterator[tuple[str, int, bytes]]:
        for part in self._each():
            yield from part.messages()

    def blocks(self, topics: Collection[str]) -> Iterator[tuple[str, Integers, Block]]:
        """Yield topic, arrival stamps [ns] (N,) and messages, file by file."""
        for part in self._each():
            yield from part.blocks([topic.name for topic in part.topics if topic.name in topics])

    def _each(self) -> Iterator[BagStream | SqliteBag]:
        """Yield the files; one is read to its end before the next is asked for."""
        yield from self.parts


class JournalReader(FilesInARow):
    """Reads a recording, its folder or one of its files; what is missing or damaged is known behind its `messages`."""

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
            none = f"{path}: no whole topic in its {len(files)} file(s): nothing can be read"
            raise FileFormatError("; ".join([none, *self._unread[:1]]))
        self.remarks = list[str]()  # of the recorder, of no loss
        self.lost = 0  # messages that are known to be missing

    def left_off(self) -> LeftOff | None:
        """Return from where it goes on, behind its last message; it lasted as long as its messages tell."""
        for _ in self.messages():
            pass
        if self.last is None:
            return None
        newest = self.last_run()
        first = next((part.first for part in newest if part.first is not None), self.last)
        before = newest[0].begins or 0.0
        files = sorted(filter(is_journal_name, self.path.glob("*.mcap")))
        return LeftOff(before + (self.last - first) * 1e-9, int(files[-1].stem) + 1, self._following, self.last)

    def last_run(self) -> Sequence[BagStream]:
        """Return the files since it went on the last time, all where it never was cut off."""
        begins = max(part.begins or 0.0 for part in self.parts)
        return [part for part in self.parts if (part.begins or 0.0) == begins]

    @property
    def problems(self) -> list[str]:
        """What was found missing or damaged so far, in words, and the recorder's own notes."""
        return [*self.damage, *self.remarks]

    def _each(self) -> Iterator[BagStream]:
        """Yield the files; behind the last one it is known what is missing."""
        self.damage, self.remarks, self.lost, self.holes = list(self._unread), [], 0, []
        self.ends_early, self.last = True, None
        self._following: dict[str, int] = {}  # number of the next message, by topic
        for part in self.parts:
            part.follow(self._following, self.last)
            yield part
            self.ends_early, self.last, self.until = not part.is_last, part.last, part.until
            self.lost += part.lost
            self.holes += part.holes
            self.damage += part.damage
            self.remarks += part.remarks
        if self.ends_early:
            self.damage = [problem for problem in self.damage if "lacks its index" not in problem]
            self.damage.append(
                f"{self.path}: was not closed: the recording ended with a crash, or files at its end are missing"
            )


class BagFolder(FilesInARow):
    """A ROS 2 bag (folder): its files in the order of time, what is whole of each."""

    def __init__(self, path: Path) -> None:
        """Open its files."""
        stated = _metadata(path)
        listed = listed_files(stated)
        there = sorted(file.name for file in path.iterdir() if file.suffix in _PARTS)
        missing = [name for name in listed if not (path / name).is_file()]
        is_listed = bool(listed) and not missing
        chosen = [name for name in there if name in listed] if is_listed else there
        damage = [f"{path / name}: is listed in {METADATA} and missing" for name in missing]
        packed = sorted(path.glob("*.zstd"))
        damage += [f"{file}: is packed, and was not read; `zstd -d {file.name}` unpacks it" for file in packed]
        none = f"{path}/{METADATA}: lists no file; its files were read one by one: {', '.join(chosen)}"
        warnings = [none] * ((path / METADATA).is_file() and not listed)
        strange = f"lies in the folder, and {METADATA} does not list it: it was not read"
        warnings += [f"{path / name}: {strange}" for name in there if name not in chosen]
        parts = list[BagStream | SqliteBag]()
        for name in chosen:
            try:
                parts.append(format_named(path / name).reads(path / name)(path / name))
            except FileFormatError as error:
                damage.append(str(error))
        if not parts:
            inside = ", ".join(sorted(file.name for file in path.iterdir())[:5]) or "nothing"
            none = f"{path}: has no file of a bag; it holds {inside}, expected {', '.join(_PARTS)}"
            raise FileFormatError("; ".join(damage) or none)
        super().__init__(path, sorted(parts, key=_start))
        self.damage, self.warnings = [*damage, *(text for part in self.parts for text in part.damage)], warnings
        self.counts = Counter[str]()
        for part in self.parts:
            self.counts.update(part.counts)
        held = sum(self.counts.values()) + sum(part.about is not None for part in self.parts)
        counted = _COUNTED.search(stated)
        if counted and held < int(counted[1]) and not self.damage:
            self.warnings.append(f"{path}: {METADATA} counts {counted[1]} messages, its files hold {held}")
        self.ends_early = self.parts[-1].ends_early or listed[-1:] == missing[-1:] != []

    @property
    def problems(self) -> list[str]:
        """What was said of the folder, and what is missing."""
        return [f"warning: {problem}" for problem in dict.fromkeys([*self.warnings, *self.damage])]

    def _each(self) -> Iterator[BagStream | SqliteBag]:
        """Yield the files; where one is missing or damaged, nothing is known of the stretch between it and the next."""
        self.holes = []
        for part in self.parts:
            yield part
            self.until = part.until
            self.holes += [*part.holes, *([(part.last, None)] if self.damage else [])]


def _start(source: Source) -> int:
    return 2**63 if source.first is None else source.first


def _metadata(path: Path) -> str:
    try:
        with (path / METADATA).open("rb") as file:
            return file.read(_MAX_YAML_BYTES).decode(errors="replace")
    except OSError:
        return ""


def listed_files(metadata: str) -> list[str]:
    """Return the names of the files that a ROS 2 bag's metadata list, as far as they can be read."""
    return [PurePath(name).name for name in _LISTED.findall(metadata)]


def bags_in(path: Path) -> list[Path]:
    """Return the bag, or those in a folder that is none itself."""
    if not path.is_dir() or (path / METADATA).is_file() or is_journal(path):
        return [path]
    inside = [p for p in path.iterdir() if format_named(p).holds == "messages" or (p / METADATA).is_file()]
    return sorted(inside) or [path]


def open_recording(path: Path) -> Source:
    """Open a journal (folder or file), a .bag, .mcap, .db3 or a ROS 2 bag (folder); `damage` says what is not whole."""
    if not path.exists():
        raise FileFormatError(f"{path}: no such recording")
    if is_journal(path):
        return JournalReader(path)
    if path.is_dir():
        return BagFolder(path)
    form = format_of(path)
    if form.holds != "messages":
        raise FileFormatError(f"{path}: expected a journal, a .bag, an .mcap, a .db3 or a folder with {METADATA}")
    source: Source = form.reads(path)(path)
    others = [name for name in listed_files(_metadata(path.parent)) if name != path.name]
    if others:
        source.warnings.append(f"warning: {path}: is one file of a bag; not read were {', '.join(others)}")
    return source


def open_recordings(paths: Sequence[Path]) -> tuple[Source, ...]:
    """Open several files of one recording, such as one bag per topic; a folder of bags stands for all of them."""
    return tuple(sorted((open_recording(bag) for path in paths for bag in bags_in(path)), key=_start))


def rescue_of(sources: Sequence[Source]) -> Rescue:
    """Read when all messages of a recording's files arrived, and what is missing; the files' `damage` is then known."""
    arrivals = {topic.name: [np.zeros(0, dtype=np.int64)] for source in sources for topic in source.topics}
    for source in sources:
        for topic, arrived, _ in source.blocks([topic.name for topic in source.topics]):
            arrivals[topic].append(arrived)
    holes = [hole for source in sources for hole in source.holes]
    each = {topic: np.concatenate(there) for topic, there in arrivals.items()}
    until = max((source.until for source in sources if source.until is not None), default=None)
    return Rescue.of(each, holes, ends_early=any(source.ends_early for source in sources), until=until)
