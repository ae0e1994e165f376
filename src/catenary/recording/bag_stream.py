"""ROS 1 bags and MCAP read from their first byte to their last, by no index, which a bag that was cut off lacks."""

import contextlib
from collections import Counter
from collections.abc import Callable, Collection, Container, Iterator
from functools import cached_property
from pathlib import Path
from struct import Struct
from typing import BinaryIO, NamedTuple, TypeVar
from zlib import crc32

import numpy as np

from catenary.arrays import Integers
from catenary.bounded_parsers import cut
from catenary.errors import FileFormatError
from catenary.file_formats import copied_as_text
from catenary.recording.bag_records import (
    CONNECTION,
    DAMAGE,
    DATA,
    END,
    HEADER,
    KIND,
    MAX_TOPICS,
    TIME,
    Block,
    Records,
    Unpacking,
    chunk_records,
    field_of,
    header_fields,
    messages_of_records,
    next_chunk,
    sized,
    text_at,
    whole_fields,
)
from catenary.recording.journal import ABOUT, ENDED, LIBRARY, MAGIC, NOTE, PASS, About, JournalTopic, is_journal_name
from catenary.recording.layout import ABOUT_TOPIC, Encoding, decodable, fields_by_definition
from catenary.recording.messages import current_name

_ROS1_MAGIC = b"#ROSBAG V2.0\n"
# record types of a ROS 1 bag [wiki.ros.org/Bags/Format/2.0]
_MESSAGE, _BAG_HEADER, _CHUNK, _CHUNK_INFO, _CONNECTION = 2, 3, 5, 6, 7
# of MCAP [mcap.dev/spec]
_HEADER, _FOOTER, _SCHEMA, _CHANNEL, _MCAP_MESSAGE, _MCAP_CHUNK, _METADATA, _DATA_END = (1, 2, 3, 4, 5, 6, 12, 15)
_MAX_REMARK_CHARACTERS = 500  # characters
_LAST_KIND = 15  # of MCAP's records
_MAX_PROBLEMS = 1000  # that are reported one by one
_RECORDS_AT_ONCE = 8192  # records that are Python's numbers at a time
_CHUNK_HEAD_BYTES = 60  # [B] before a chunk's records, at most; a shorter one holds none
_IN_CHUNKS = ((_MESSAGE, _CONNECTION), (_SCHEMA, _CHANNEL, _MCAP_MESSAGE))  # kinds of records, of a ROS 1 bag and MCAP
# kinds of records that may stand behind a chunk; in a ROS 1 bag 4 is its index
_BEHIND_CHUNKS, _BEHIND_MCAP_CHUNKS = (4, _CHUNK, _CHUNK_INFO, _CONNECTION), (_SCHEMA, _CHANNEL, *range(6, 16))
_ANY_RECORD = b"\3" + bytes(8)  # stands behind messages for whichever record did
_SPAN = Struct("<QQ")  # [ns] of a chunk
_MAX_CHUNK_NS = 3600 * 10**9  # [ns]; a longer one is damaged
_PADDING_BYTES = 2**20  # [B] behind a torn chunk, so that the head of its last record is read
_RUN_BYTES = 2**16  # [B] of messages outside of chunks that are read at a time
_U16, _U32, _U64 = Struct("<H"), Struct("<I"), Struct("<Q")

Read = TypeVar("Read")
_Chunk = tuple[bytes, Records, bool]  # a chunk, the records of its messages, whether something vouches for them
# [ns] arrivals of the last message before what could not be read and of the first behind it; None at an end
Hole = tuple[int | None, int | None]


class BagConnection(NamedTuple):
    """A topic of a bag as the bag defines it."""

    topic: str
    type: str  # as it is spelt there
    md5: str  # empty in MCAP
    definition: str


class Source:
    """A recording, or a file of one, in the order of arrival: what it says of itself, and what was found damaged."""

    encoding: Encoding = "cdr"

    def __init__(self, path: Path) -> None:
        self.path = path
        self.warnings: list[str] = []  # of whoever opened it
        self.damage, self.holes, self.ends_early = list[str](), list[Hole](), False
        self.connections: dict[str, BagConnection] = {}  # by topic, once the file was read
        self._names: dict[int, str] = {}  # of topics
        self.about: About | None = None
        self.first: int | None = None  # [ns] arrival of the first message
        self.last: int | None = None  # of the last one that was read
        self.until: int | None = None  # about when the last one arrived that is lost behind it, where that is known

    @property
    def topics(self) -> tuple[JournalTopic, ...]:
        """Its topics, but for what it is of."""
        types = {name: current_name(each.type) for name, each in self.connections.items() if name != ABOUT_TOPIC}
        return tuple(JournalTopic(*item) for item in types.items())

    @property
    def problems(self) -> list[str]:
        """What there is to say of it; complete once its messages were read."""
        return [*self.warnings, *self.damage]

    def messages(self, topics: Collection[str] | None = None) -> Iterator[tuple[str, int, bytes]]:
        """Yield topic, arrival stamp [ns] and bytes of every whole message of these topics, or of all."""
        there = [topic.name for topic in self.topics]
        missing = [name for name in topics or () if name not in there]
        if missing:
            raise FileFormatError(f"{self.path}: no topic {', '.join(missing)}; it has {', '.join(there) or 'none'}")
        for message in self._every_message():
            if message[0] != ABOUT_TOPIC and (topics is None or message[0] in topics):
                yield message

    def blocks(self, topics: Collection[str]) -> Iterator[tuple[str, Integers, Block]]:
        """Yield topic, arrival stamps [ns] (N,) and messages, some of every topic before more of one."""
        raise NotImplementedError

    @cached_property
    def counts(self) -> dict[str, int]:
        """Number of messages by topic."""
        counts = {topic.name: 0 for topic in self.topics}
        for name, arrivals, _ in self.blocks(counts):
            counts[name] += len(arrivals)
        return counts

    def _every_message(self) -> Iterator[tuple[str, int, bytes]]:
        raise NotImplementedError

    def _lose(self, size: int, read: int) -> None:
        """Tell until when messages are lost that took `size` bytes: they came at the rate of those `read` before."""
        if self.first is not None and self.last is not None and size > 0 < read:
            self.until = max(self.until or 0, self.last + (self.last - self.first) * size // read)

    def _keep(self, number: int, connection: BagConnection) -> None:
        """Keep a topic and its type."""
        name, kind = connection.topic, current_name(connection.type)
        known = current_name(self.connections.setdefault(name, connection).type)
        if len(self.connections) > MAX_TOPICS:
            raise FileFormatError(f"{self.path}: more than {MAX_TOPICS} topics")
        if known != kind:
            raise FileFormatError(f"{self.path}: topic {cut(name)}: is of type {cut(known)} and of {cut(kind)}")
        self._names[number] = name


class BagStream(Source):
    """Reads a ROS 1 bag or an MCAP file as it was recorded, and on behind damage, which `damage` tells."""

    def __init__(self, path: Path) -> None:
        """Read the file once, to find its topics."""
        super().__init__(path)
        self._unread: set[int] = set()  # channels in another encoding than ROS's
        try:
            with path.open("rb") as file:
                begin = file.read(len(_ROS1_MAGIC))
        except OSError as problem:
            raise FileFormatError(f"{path}: cannot be read: {problem.strerror}") from problem
        self.is_journal = False  # messages are numbered
        self.remarks: list[str] = []  # of the recorder
        self._shared: dict[str, int] | None = None  # number of the next message by topic, of all files of a journal
        self._before: int | None = None  # [ns] arrival of the last message of the file before
        self.is_ros1 = begin == _ROS1_MAGIC
        as_text = "" if self.is_ros1 or begin.startswith(MAGIC) else copied_as_text(path)
        if as_text or not (self.is_ros1 or begin.startswith(MAGIC) or is_journal_name(path)):
            none = f"{path}: cannot be read: begins neither as a ROS 1 bag nor as MCAP{as_text}"
            raise FileFormatError(f"{none}; nothing in it can be saved")
        self.encoding = "ros1" if self.is_ros1 else "cdr"
        self.begins: float | None = None  # [s] of the recording that were there before it went on
        counts = Counter[str]()
        for chunk, name, records in self._guarded(self._by_topic):
            if name == ABOUT_TOPIC:
                first = self._plain(chunk[records[0, DATA] : records[0, END]])
                self.about = about_of(path, first, self.encoding)
            else:
                counts[name] += len(records)
            if self.is_journal:  # whose topics all stand before its first message; it is not read twice
                break
        self.counts = counts

    def _every_message(self) -> Iterator[tuple[str, int, bytes]]:
        return self._guarded(self._messages)

    def blocks(self, topics: Collection[str]) -> Iterator[tuple[str, Integers, Block]]:
        """Yield topic, arrival stamps [ns] (N,) and messages in their order, of every chunk, no object for each."""
        for chunk, name, records in self._guarded(self._by_topic):
            if name in topics:
                block = messages_of_records(chunk, records)
                if self.encoding == "cdr" and block[0][:1] > b"\0":  # a message in CDR begins with 0
                    block = Block.of([self._plain(block[i]) for i in range(len(block))])
                yield name, records[:, TIME], block

    def follow(self, following: dict[str, int], last: int | None) -> None:
        """Go on behind another file of a journal: with numbers of the next messages by topic, and the last arrival."""
        self._shared, self._before = following, last

    def _guarded(self, read: Callable[[BinaryIO, int], Iterator[Read]]) -> Iterator[Read]:
        """Read up to what is damaged beyond help, which becomes a problem."""
        self.damage.clear()
        self.holes.clear()
        self.remarks.clear()
        self._following = {} if self._shared is None else self._shared
        self.ends_early, self.last = False, self._before
        self.lost, self.is_last = 0, False  # numbered messages are missing; it is the last file of its recording
        self.until, self._latest, self._held, self._seen = None, dict[int, int](), 0, set[int]()
        with self.path.open("rb") as file:
            size = file.seek(0, 2)
            self._unpacking = Unpacking(self.path)
            file.seek(max(0, size - len(MAGIC)))
            self._is_closed = file.read() == MAGIC  # MCAP's own mark is its end
            file.seek(len(_ROS1_MAGIC) if self.is_ros1 else len(MAGIC))
            try:
                yield from read(file, size)
            except DAMAGE as problem:
                if isinstance(problem, FileFormatError):
                    raise
                self._damaged(f"before byte {file.tell()}: {cut(str(problem) or repr(problem))}")
                self.ends_early = True

    def _cut_off(self, left: int) -> None:
        self.ends_early = True
        self.damage.append(f"{self.path}: is cut off within its last {left} bytes")
        self._hole()

    def _damaged(self, where: object) -> None:
        """Keep what is damaged, and that messages are missing there."""
        if len(self.damage) < _MAX_PROBLEMS:
            self.damage.append(f"{self.path}: damaged {where}")
        self._hole()

    def _hole(self) -> None:
        if not self.holes or self.holes[-1][0] != self.last:
            self.holes.append((self.last, None))

    def _is_followed(self, file: BinaryIO, size: int, kinds: Container[int]) -> bool:
        """Return True if a whole record of these kinds begins here, or MCAP's magic; the position is kept."""
        place, head, kind, length = file.tell(), file.read(9), 0, size
        if self.is_ros1:
            file.seek(place)
            kind = (whole_fields(sized(file, size) or b"").get(b"op") or b"\0")[0]
            head = file.read(4)
            length = _U32.unpack(head)[0] if len(head) == 4 else size
        elif len(head) == 9:
            kind, length = head[0], _U64.unpack_from(head, 1)[0]
        room = size - file.tell()
        file.seek(place)
        return (kind in kinds and length <= room) or head.startswith(MAGIC)

    def _proven(self, chunk: bytes, span: tuple[int, int] = (0, 2**63 - 1)) -> Records:
        """Return the proven records of a chunk for which neither a checksum nor what follows it vouches.

        A tail of zeros or old bytes may begin within a message, whose own head then is sound. So a record is proven by
        the head of the next one: of a known kind and whole length, in `span` [ns], later than all of its topic before.
        """
        records = chunk_records(chunk + bytes(_PADDING_BYTES), is_ros1=self.is_ros1)
        kinds = _IN_CHUNKS[not self.is_ros1]
        times, message = records[:, TIME], _MESSAGE if self.is_ros1 else _MCAP_MESSAGE
        good = np.isin(records[:, KIND], kinds)
        good &= (records[:, KIND] != message) | ((times >= span[0]) & (times <= span[1]))
        end = int(np.argmin(good)) if not good.all() else len(good)
        for channel in np.unique(records[:end, CONNECTION]).tolist():
            own = np.flatnonzero((records[:end, CONNECTION] == channel) & (records[:end, KIND] == message))
            before = np.maximum.accumulate(np.append(self._latest.get(channel, -1), times[own]))[:-1]
            end = min([end, *own[times[own] <= before].tolist()])
        return records[: max(0, end - 1)]

    def _decoding(self, chunk: bytes, messages: Records) -> Records:
        """Return those messages, of known topics, that decode as their types say."""
        good = np.ones(len(messages), dtype=bool)
        for number in np.unique(messages[:, CONNECTION]).tolist():
            rows, connection = np.flatnonzero(messages[:, CONNECTION] == number), self.connections[self._names[number]]
            with contextlib.suppress(FileFormatError):  # of a type that nobody knows
                fields_of = fields_by_definition(str(self.path), connection.type, connection.definition, self.encoding)
                block = Block.of([self._plain(chunk[row[DATA] : row[END]]) for row in messages[rows].tolist()])
                good[rows] = decodable(current_name(connection.type), block, self.encoding, fields_of)
        return messages[good]

    def _unpacked(self, file: BinaryIO, size: int) -> Iterator[tuple[bytes, bool]]:
        """Yield the chunks of a ROS 1 bag, and whether a record follows each as it must."""
        missing = None  # records that the bag's header promises behind the chunks
        while file.tell() < size:
            start = file.tell()
            head = sized(file, size)
            values, data = whole_fields(head or b""), None if head is None else sized(file, size)
            if data == b"" and values.get(b"compression") == b"none":  # being written: its length comes with its end
                data = None
            if data is None or not values.get(b"op"):
                # a damaged length may reach beyond the chunks behind it
                following = next_chunk(file, start + 1, size, is_ros1=True)
                end = size if following is None else following
                if values.get(b"compression") == b"none":
                    file.seek(start)
                    sized(file, size)
                    yield file.read(end - file.tell())[4:], False
                else:
                    self._lose(end - start, self._held)
                if following is None and data is None:
                    self._cut_off(size - start)
                else:
                    self._damaged(f"from byte {start} {'on' if following is None else f'to {following}'}")
                if following is None:
                    return
                file.seek(following)
                continue
            kind = values[b"op"][0]
            if kind in (_CHUNK_INFO, _CONNECTION) and missing is not None:
                missing -= 1
            chunk = None
            with self._damage_told(f"from byte {start} to {file.tell()}"):
                if kind == _BAG_HEADER and _U64.unpack(field_of(values, b"index_pos", 8))[0]:
                    counts = (field_of(values, key, 4) for key in (b"conn_count", b"chunk_count"))
                    missing = sum(_U32.unpack(count)[0] for count in counts)
                elif kind == _CONNECTION and self._is_followed(file, size, _BEHIND_CHUNKS):
                    # it says again what stands before its messages
                    self._connection(_U32.unpack(field_of(values, b"conn", 4))[0], values, data)
                elif kind == _CHUNK:
                    packing = field_of(values, b"compression").decode(errors="replace")
                    stated = 0 if packing == "none" else _U32.unpack(field_of(values, b"size", 4))[0]
                    chunk = self._unpacking.chunk(data, packing, stated)
            if chunk is not None:
                yield chunk, self._is_followed(file, size, _BEHIND_CHUNKS)
            elif kind == _CHUNK:
                self._lose(len(data), self._held)
        if missing != 0:
            self.ends_early = True
            self.damage.append(f"{self.path}: lacks its index, or part of it: it was cut off or not closed")

    def _bag_chunks(self, file: BinaryIO, size: int) -> Iterator[_Chunk]:
        """Yield every chunk with the records of its messages; of one that is damaged, or the last, those proven."""
        for chunk, is_followed in self._unpacked(file, size):
            whole = chunk_records(chunk, is_ros1=True)
            is_sound = is_followed and len(chunk) == (int(whole[-1, END]) if len(whole) else 0)
            is_sound = is_sound and bool(np.isin(whole[:, KIND], _IN_CHUNKS[0]).all())
            whole = whole if is_sound else self._proven(chunk)
            for row in whole[whole[:, KIND] == _CONNECTION].tolist():
                with self._damage_told(f"before byte {file.tell()}"):
                    head = header_fields(chunk[row[HEADER] : row[DATA] - 4])
                    self._connection(row[CONNECTION], head, chunk[row[DATA] : row[END]])
            yield chunk, whole[whole[:, KIND] == _MESSAGE], is_sound
            if not is_sound:
                left = len(chunk) - (int(whole[-1, END]) if len(whole) else 0)
                self._lose(left, self._held)
                self._damaged(f"before byte {file.tell()}: the last {left} bytes of a chunk")

    def _chunks(self, file: BinaryIO, size: int) -> Iterator[tuple[bytes, Records]]:
        """Yield every chunk with the records of the messages of known topics in it."""
        for chunk, messages, is_sound in (self._bag_chunks if self.is_ros1 else self._mcap_chunks)(file, size):
            known = np.isin(messages[:, CONNECTION], list(self._names))
            strange = ~known & ~np.isin(messages[:, CONNECTION], list(self._unread))
            if strange.any():
                self._damaged(f"before byte {file.tell()}: {strange.sum()} messages of no known topic")
            messages = messages if known.all() else messages[known]
            if not is_sound:
                messages = self._decoding(chunk, messages)
            summed = crc32(chunk)
            if summed in self._seen or (self.holes and self.holes[-1][1] is None):  # the disk's old bytes may lie here
                latest = [self._latest.get(channel, -1) for channel in messages[:, CONNECTION].tolist()]
                again = messages[:, TIME] <= np.array(latest, dtype=np.int64)
                if again.any():
                    self._damaged(f"before byte {file.tell()}: {again.sum()} messages out of order, or again")
                    messages = messages[~again]
            self._seen.add(summed)
            self._held += int(messages[-1, END]) if len(messages) else 0
            for channel in np.unique(messages[:, CONNECTION]).tolist():
                own = messages[messages[:, CONNECTION] == channel, TIME]
                self._latest[channel] = int(own.max(initial=self._latest.get(channel, -1)))
            if self.is_journal:
                self._numbered(chunk, messages)
            if len(messages):
                first = int(messages[0, TIME])
                if self.holes and self.holes[-1][1] is None:
                    self.holes[-1] = self.holes[-1][0], first
                self.last, self.first = int(messages[-1, TIME]), first if self.first is None else self.first
            yield chunk, messages

    def _messages(self, file: BinaryIO, size: int) -> Iterator[tuple[str, int, bytes]]:
        for chunk, records in self._chunks(file, size):
            for begin in range(0, len(records), _RECORDS_AT_ONCE):
                for row in records[begin : begin + _RECORDS_AT_ONCE].tolist():
                    yield self._names[row[CONNECTION]], row[TIME], self._plain(chunk[row[DATA] : row[END]])

    def _plain(self, message: bytes) -> bytes:
        return self._unpacking.message(message) if self.encoding == "cdr" else message

    def _by_topic(self, file: BinaryIO, size: int) -> Iterator[tuple[bytes, str, Records]]:
        """Yield every chunk with each topic that it has messages of, and their records."""
        for chunk, records in self._chunks(file, size):
            numbers = records[:, CONNECTION]
            topics = {number: self._names[number] for number in dict.fromkeys(numbers.tolist())}
            for name in dict.fromkeys(topics.values()):
                own = [number for number, topic in topics.items() if topic == name]
                yield chunk, name, records if len(own) == len(topics) else records[np.isin(numbers, own)]

    def _connection(self, number: int, head: dict[bytes, bytes], data: bytes) -> None:
        """Check and keep the type of a connection's topic."""
        topic, about = field_of(head, b"topic"), header_fields(data)
        kind, md5 = (field_of(about, key).decode() for key in (b"type", b"md5sum"))
        text = field_of(about, b"message_definition").decode(errors="replace")
        self._keep(number, BagConnection(topic.decode(), kind, md5, text))

    def _mcap_chunks(self, file: BinaryIO, size: int) -> Iterator[_Chunk]:
        """Yield every chunk of MCAP with the records of its messages; of one that is damaged or torn those proven."""
        schemas: dict[int, tuple[str, str]] = {}
        is_over = is_closed = False  # what follows the data says again which topics there are
        run = b""  # messages outside of chunks; the last one waits for what follows
        while len(head := file.read(9)) == 9:
            start, length = file.tell() - 9, _U64.unpack_from(head, 1)[0]
            here = f"in the record that begins at byte {start}"
            data = file.read(min(length, size))
            is_whole, kind = len(data) == length, head[0]
            following = None
            if not is_over and not (is_whole and 0 < kind <= _LAST_KIND):
                following = next_chunk(file, start + 1, size, is_ros1=False)
            if following is not None:
                data, is_whole = data[: max(0, following - start - 9)], False
            is_over |= kind == _DATA_END
            is_closed |= kind == _FOOTER and is_whole
            is_single = kind == _MCAP_MESSAGE and is_whole and not is_over
            if run and (not is_single or len(run) > _RUN_BYTES):
                is_record = is_whole and 0 < kind <= _LAST_KIND
                yield from self._run(run, head + data if is_single else _ANY_RECORD if is_record else b"")
                run = b""
            if kind == _MCAP_CHUNK and (is_whole or len(data) > _CHUNK_HEAD_BYTES):
                span, is_sound = _SPAN.unpack_from(data.ljust(_SPAN.size, b"\0")), False
                with self._damage_told(here):
                    is_followed = is_whole and self._is_followed(file, size, _BEHIND_MCAP_CHUNKS)
                    inside, is_sound = self._mcap_contents(data, is_whole=is_whole, is_followed=is_followed)
                    records = chunk_records(inside, is_ros1=False) if is_sound else self._proven(inside, span)
                    for row in records[np.isin(records[:, KIND], (_SCHEMA, _CHANNEL))].tolist():
                        with self._damage_told(here):
                            self._mcap_record(row[KIND], inside[row[HEADER] : row[END]], schemas)
                    yield inside, records[records[:, KIND] == _MCAP_MESSAGE], is_sound
                    if is_whole and len(inside) != (records[-1, END] if len(records) else 0):
                        raise ValueError("its records do not fill it")
                if not is_sound and self.last is not None and self.last <= span[1] < self.last + _MAX_CHUNK_NS:
                    self.until = span[1]
            elif is_single:
                run += head + data
            elif is_whole and (not is_over or kind in (_SCHEMA, _CHANNEL)):
                with self._damage_told(here):
                    if file.tell() == size or self._is_followed(file, size, range(1, 16)):
                        self._mcap_record(kind, data, schemas)
            if following is not None:
                self._damaged(f"from byte {start} to {following}")
                file.seek(following)
            elif not is_whole and not is_over:
                self._cut_off(9 + len(data))
        if run:
            yield from self._run(run, b"")
        self.ends_early |= not is_over
        if not is_closed:
            self.damage.append(f"{self.path}: lacks its index, or part of it: it was cut off or not closed")

    def _run(self, run: bytes, following: bytes) -> Iterator[_Chunk]:
        """Yield messages outside of chunks; in a file that was cut off, those that are proven by what follows them."""
        every = chunk_records(run, is_ros1=False)
        records = every if self._is_closed else self._proven(run + following)
        yield run, records, len(records) == len(every)
        if len(records) < len(every):
            self._damaged(f"in its messages outside of chunks, of which {len(every) - len(records)} are not sound")

    def _mcap_contents(self, data: bytes, *, is_whole: bool, is_followed: bool) -> tuple[bytes, bool]:
        """Return a chunk's records, and whether its checksum vouches for them, or what follows it where it has none."""
        compression, position = text_at(data, 28)
        inside, checksum, stated = data[position + 8 :], _U32.unpack_from(data, 24)[0], _U64.unpack_from(data, 16)[0]
        taken = _U64.unpack_from(data, position)[0]
        if is_whole and (taken != len(inside) or (not compression and stated != taken)):
            raise ValueError(f"a chunk of {len(inside)} bytes states {taken}, unpacked {stated}")
        if compression:
            inside = self._unpacking.chunk(inside, compression, stated) if is_whole else b""
        inside = inside[:stated]
        if not checksum or len(inside) < stated:
            return inside, is_followed
        is_sound = crc32(inside) == checksum
        if is_followed and not is_sound:
            raise ValueError("its checksum is another: none of it is read")
        return inside, is_sound

    def _numbered(self, chunk: bytes, messages: Records) -> None:
        """Notice a journal's numbers that are missing, or come again, and when they arrived."""
        for channel in dict.fromkeys(messages[:, CONNECTION].tolist()):
            own, name = messages[messages[:, CONNECTION] == channel], self._names[channel]
            places = own[:, HEADER, None] + np.arange(2, 6)
            numbers = np.frombuffer(chunk, dtype=np.uint8)[places].view("<u4")[:, 0].astype(np.int64)
            expected = self._following.get(name)
            self._following[name] = int(numbers[-1]) + 1
            before = np.append(0 if expected is None else expected, numbers[:-1] + 1)
            for i in np.flatnonzero(numbers != before).tolist():
                self._missed(name, int(numbers[i]), int(numbers[i] - before[i]), int(own[i, TIME]), i or expected)

    @contextlib.contextmanager
    def _damage_told(self, where: str) -> Iterator[None]:
        """Take what damaged bytes raise as damage there."""
        try:
            yield
        except FileFormatError:
            raise
        except DAMAGE as problem:
            self._damaged(f"{where}: {cut(str(problem) or repr(problem))}")

    def _mcap_record(self, kind: int, data: bytes, schemas: dict[int, tuple[str, str]]) -> None:
        """Take in what a record tells of topics and of the recording."""
        number = _U16.unpack_from(data)[0] if kind in (_SCHEMA, _CHANNEL) else 0
        if kind == _SCHEMA:
            name, position = text_at(data, 2)
            _, position = text_at(data, position)
            schemas[number] = name, text_at(data, position)[0]
        elif kind == _CHANNEL:
            name, position = text_at(data, 4)
            encoding, _ = text_at(data, position)
            if encoding not in ("cdr", "ros1"):
                self._unread.add(number)
                note = (
                    f"{self.path}: {name} is in {cut(encoding)}, which is left out; cdr and ros1 are read, and a CSV "
                    "that PlotJuggler exports"
                )
                if note not in self.warnings and len(self.warnings) < _MAX_PROBLEMS:
                    self.warnings.append(note)
                return
            schema, text = schemas[_U16.unpack_from(data, 2)[0]]
            connection = BagConnection(name, schema, "", text)
            if self._names.get(number) == name and self.connections.get(name) == connection:
                return  # again, as before each chunk of a journal
            if encoding == "ros1":
                self.encoding = "ros1"
            self._keep(number, connection)
        elif kind == _HEADER:
            self.is_journal = text_at(data, text_at(data, 0)[1])[0] == LIBRARY
        elif kind == _METADATA and text_at(data, 0)[0] in (ABOUT, NOTE, ENDED, PASS):  # of a journal
            name, position = text_at(data, 0)
            key, position = text_at(data, position + 4)
            value = text_at(data, position)[0]
            if (name, key) == (ABOUT, "about") and self.about is None:
                self.about = About.from_json(value.encode(), f"{self.path}: what it is of")
            elif name == NOTE and len(self.remarks) < _MAX_PROBLEMS:
                self.remarks.append(f"{self.path}: {value[:_MAX_REMARK_CHARACTERS]}")
            elif name == ENDED:
                self.is_last = value == "true"
            elif name == PASS:
                self.begins = float(value)

    def _missed(self, name: str, number: int, missing: int, arrival: int, before: int | None) -> None:
        """Tell of numbers that are missing before one, or come again; `before` is None of a topic's first message."""
        if before is None:
            note = f"{missing} messages of {name} before it are in files that are not there"
        elif missing > 0:
            self.lost += missing
            if not self.holes or self.holes[-1][1] is not None:
                self.holes.append((self.last, arrival))
            note = f"{missing} message(s) of {name} are missing before {number}"
        else:
            note = f"message {number} of {name} comes out of order, or again"
        self.damage.append(f"{self.path}: {note}")


def about_of(path: Path, data: bytes, encoding: Encoding) -> About:
    """Read the message on `/catenary/recording`."""
    text = data[4:] if encoding == "ros1" else data[8:].rstrip(b"\0")
    return About.from_json(text, f"{path}: {ABOUT_TOPIC}")
