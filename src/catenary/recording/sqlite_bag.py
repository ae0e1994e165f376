"""A file of a ROS 2 bag in SQLite, read row by row; of a damaged one what lies before and behind the damage."""

import contextlib
import re
import sqlite3
from collections import Counter, deque
from collections.abc import Collection, Iterator
from itertools import islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from catenary.documents import reading, shortened
from catenary.errors import FileFormatError
from catenary.recording.bag_records import DAMAGE, Block, Unpacking
from catenary.recording.bag_stream import BagConnection, BagFile, about_of
from catenary.recording.layout import ABOUT_TOPIC

AT_ONCE = 2048  # messages that are in memory at once
_ROWS = "SELECT id, topic_id, timestamp, data FROM messages WHERE id > ? ORDER BY id"


class SqliteBag(BagFile):
    """Reads a SQLite file of a ROS 2 bag, in the order in which it was recorded."""

    def __init__(self, path: Path) -> None:
        """Read the file once, to find its topics."""
        super().__init__(path)
        counts = Counter[str]()
        with reading(path, "SQLite", (sqlite3.Error, *DAMAGE)):
            self._size = path.stat().st_size
            self._database = sqlite3.connect(f"{path.absolute().as_uri()}?immutable=1&mode=ro", uri=True)
            self._database.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, self._size)
            self._database.execute("PRAGMA writable_schema = ON")  # else one that was cut off is not opened at all
            _require_plain_tables(path, self._database)
            self._find_topics()
            for name, stamp, data in self._every_message():
                self.first = stamp if self.first is None else self.first
                if name != ABOUT_TOPIC:
                    counts[name] += 1
                elif self.about is None:
                    self.about = about_of(path, data, self.encoding)
        self.counts = {topic.name: counts[topic.name] for topic in self.topics}
        if self.damage and not counts:
            raise FileFormatError(f"{self.damage[0]}; nothing in it can be saved")

    def blocks(self, topics: Collection[str]) -> Iterator[tuple[str, NDArray[np.int64], Block]]:
        """Yield topic, arrival stamps [ns] (N,) and messages, some of every topic before more of one."""
        messages = self.messages(topics)
        while some := list(islice(messages, AT_ONCE)):
            for name in dict.fromkeys(name for name, _, _ in some):
                own = [(stamp, data) for topic, stamp, data in some if topic == name]
                yield name, np.array([stamp for stamp, _ in own]), Block.of([data for _, data in own])

    def _find_topics(self) -> None:
        texts, read = dict[str, str](), self._database.execute
        with contextlib.suppress(sqlite3.Error):  # older bags have none, and types of ROS's own are known
            texts |= dict(read("SELECT topic_type, encoded_message_definition FROM message_definitions"))
        for number, name, kind in read("SELECT id, name, type FROM topics"):
            if not isinstance(name, str) or not isinstance(kind, str):
                raise FileFormatError(f"{self.path}: topic {shortened(name)}: expected texts for it and its type")
            self._keep(number, BagConnection(name, kind, "", texts.get(kind, "")))

    def _every_message(self) -> Iterator[tuple[str, int, bytes]]:
        """Yield topic, arrival stamp [ns] and bytes of each message before the damage, and of those behind it.

        Those within a page of the damage are left out: they may be of a page that is there in part.
        """
        read, unpacking = self._database.execute, Unpacking(self.path)
        (page,) = read("PRAGMA page_size").fetchone()
        left, seen, skipped = self._size, -1, 0
        waiting, held = deque[tuple[int, int, bytes]](), 0  # rows within a page of here, and their bytes
        self.last, self.holes, self.damage, self.ends_early = None, [], [], False

        def message(row: tuple[int, int, bytes]) -> Iterator[tuple[str, int, bytes]]:
            self.last = row[1]
            if row[0] in self._names:
                yield self._names[row[0]], row[1], unpacking.message(row[2])

        for _ in range(2):
            try:
                for place, number, stamp, data in read(_ROWS, (seen,)):
                    seen, is_whole = place, isinstance(data, bytes) and isinstance(stamp, int)
                    size = len(data) if is_whole else 0
                    left, skipped = left - size, max(0, skipped - size - 1)
                    if left < 0:
                        self.damage.append(f"{self.path}: its messages take more bytes than the file has")
                        return
                    if not is_whole:
                        skipped, held = page, 0
                        waiting.clear()
                        self._hole("a message without its bytes")
                    elif not skipped:
                        waiting.append((number, stamp, data))
                        held += size
                        while held - len(waiting[0][2]) >= page:
                            held -= len(waiting[0][2])
                            yield from message(waiting.popleft())
                for row in waiting:
                    yield from message(row)
                return
            except sqlite3.Error as error:
                if self.last is None and not waiting and seen < 0:
                    raise
                self._hole(error)
            waiting.clear()
            behind, skipped, held = seen, page, 0
            with contextlib.suppress(sqlite3.Error):
                for (place,) in read("SELECT id FROM messages WHERE id > ? ORDER BY id DESC", (seen,)):
                    behind = place
            self.ends_early = behind == seen
            seen = behind - 1

    def _hole(self, why: object) -> None:
        self.holes.append((self.last, None))
        self.damage.append(f"{self.path}: cannot be read as SQLite: {why}; it was read around the damage")


def _require_plain_tables(path: Path, database: sqlite3.Connection) -> None:
    """Refuse a file in which anything is worked out when it is read."""
    database.execute("PRAGMA trusted_schema = OFF")
    for kind, name, text in database.execute("SELECT type, name, sql FROM sqlite_master"):
        computed = re.search(r"\bVIRTUAL\b|\bGENERATED\b|\bAS\s*\(|\bWHERE\b", str(text or ""), re.IGNORECASE)
        if kind not in ("table", "index") or computed:
            raise FileFormatError(f"{path}: {kind} {shortened(name)}: expected plain tables and indices")
