"""Layout of numbers in a serialised message as a NumPy structured type, to read thousands at once.

And topics by their names: thousands of messages of one from its columns in SI.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache, lru_cache
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from rosbags.interfaces.typing import Typesdict
from rosbags.typesys import Stores, get_typestore

from catenary.arrays import Flags, Floats, Integers, as_array
from catenary.bounded_parsers import cut
from catenary.dvrk_psm import psm_topic_named
from catenary.errors import FileFormatError, InputError
from catenary.raven2.topics import RAVEN_TOPICS
from catenary.recording.bag_records import Block
from catenary.recording.messages import NUMBERS, TIMES, Field, current_name, fields, fields_of, ros2_name, types_of
from catenary.topics import SECOND, Topic

Encoding = Literal["ros1", "cdr"]
_CDR_HEADER_BYTES = 4  # bytes before the message; alignment counts from behind them
COUNT = "#"  # before the name of a string or a sequence: the field that holds its length
_MAX_DEPTH = 32  # messages within each other
_MAX_ELEMENTS = 100_000  # of one sequence, and parts of one message; more is taken for damage
_SAME = {"octet": "uint8"}  # ROS 2's words for ROS 1's
FieldsOf = Callable[[str], tuple[Field, ...]]  # name of a message type -> its fields
_INT32 = np.iinfo(np.int32)
# where a recording's robot, seed and `simulated` travel in a bag, which has no other place for them
ABOUT_TOPIC = "/catenary/recording"
ABOUT_TYPE = "std_msgs/String"


@dataclass
class _Walk:
    """Places and types of a message's numbers, collected from its first byte to its last."""

    encoding: Encoding
    size_of: Callable[[str, int], int]  # path and offset of a length field -> number of elements
    offset: int = 0
    fields_of: FieldsOf = fields
    parts: int = 0
    depth: int = 0
    places: list[tuple[str, Any, int]] = field(default_factory=list)  # name, format and offset of each

    def message(self, name: str, prefix: str = "") -> None:
        self.parts += 1
        if self.parts > _MAX_ELEMENTS:
            raise FileFormatError(f"message: more than {_MAX_ELEMENTS} messages within one")
        if self.depth > _MAX_DEPTH:
            raise FileFormatError(f"{cut(name)} holds itself, or is more than {_MAX_DEPTH} messages deep")
        for item in self.fields_of(name):
            if self.encoding == "cdr" and current_name(name) == "std_msgs/Header" and item.name == "seq":
                continue  # ROS 2 has none
            path = prefix + item.name
            if item.length is None:
                self._one(item.type, path)
            elif item.type in NUMBERS:
                number, count = np.dtype(NUMBERS[item.type]), item.length or self._length(path)
                # CDR aligns elements, so an empty sequence moves nothing
                self._place(path, (number, (count,)), number.itemsize if count else 1)
            else:
                for i in range(item.length or self._length(path)):
                    self._one(item.type, f"{path}.{i}")

    def _one(self, kind: str, path: str) -> None:
        if kind in TIMES:
            # ROS 1's time counts without a sign, its duration with; ROS 2's with, and without in nanoseconds
            signed = kind == "duration" or self.encoding == "cdr"
            self._place(f"{path}.sec", "<i4" if signed else "<u4", 4)
            self._place(f"{path}.nsec", "<i4" if kind == "duration" and self.encoding == "ros1" else "<u4", 4)
        elif kind == "string":
            self._place(path, f"V{self._length(path)}", 1)
        elif kind in NUMBERS:
            self._place(path, NUMBERS[kind], np.dtype(NUMBERS[kind]).itemsize)
        else:
            self.depth += 1
            self.message(kind, f"{path}.")
            self.depth -= 1

    def _length(self, path: str) -> int:
        self._place(COUNT + path, "<u4", 4)
        size = self.size_of(path, self.places[-1][2])
        if not 0 <= size <= _MAX_ELEMENTS:
            raise FileFormatError(f'message: "{path}" claims {size} elements, expected {_MAX_ELEMENTS} at most')
        return size

    def _place(self, path: str, kind: Any, alignment: int) -> None:
        if self.encoding == "cdr":
            self.offset += -(self.offset - _CDR_HEADER_BYTES) % alignment
        self.places.append((path, kind, self.offset))
        self.offset += np.dtype(kind).itemsize

    def dtype(self) -> np.dtype[np.void]:
        parts = {key: [place[k] for place in self.places] for k, key in enumerate(("names", "formats", "offsets"))}
        return np.dtype({**parts, "itemsize": self.offset})  # type: ignore[call-overload]


def layout_of(name: str, data: bytes, encoding: Encoding, fields_of: FieldsOf = fields) -> np.dtype[np.void]:
    """Return the structured type that reads this message and all others with strings and sequences of the same lengths.

    Fields are paths such as `header.stamp.sec` or `position`, `#position` its length. `data` is in ROS 1's encoding, or
    in CDR, little-endian, with its four bytes; `fields_of` says what types hold.
    """

    def size_of(path: str, offset: int) -> int:
        if offset + 4 > len(data):
            raise FileFormatError(f'{name}: the message of {len(data)} bytes ends before "{path}"')
        return int.from_bytes(data[offset : offset + 4], "little")

    if encoding == "cdr" and data[:2] != b"\x00\x01":
        raise FileFormatError(f"{name}: expected little-endian CDR, whose first bytes are 0, 1; got {list(data[:2])}")
    walk = _Walk(encoding, size_of, _CDR_HEADER_BYTES if encoding == "cdr" else 0, fields_of)
    walk.message(name)
    padding = len(data) - walk.offset
    if not 0 <= padding <= (3 if encoding == "cdr" else 0):
        raise FileFormatError(f"{name}: expected {walk.offset} bytes, got {len(data)}")
    walk.offset = len(data)
    return walk.dtype()


def read_messages(
    name: str, messages: Sequence[bytes] | Block, encoding: Encoding, fields_of: FieldsOf = fields
) -> Iterator[tuple[Integers, NDArray[np.void]]]:
    """Yield messages as structured arrays, one for each shape that occurs, with the positions they came from."""
    block = messages if isinstance(messages, Block) else Block.of(messages)
    left = np.arange(len(block))
    while len(left):
        layout = layout_of(name, block[left[0]], encoding, fields_of)
        same_length = left[block.lengths[left] == layout.itemsize]
        whole = len(same_length) == len(block)
        data = block.data.data if whole else b"".join([block[i] for i in same_length])
        records = _records(data, layout, len(same_length))
        same = np.ones(len(records), dtype=bool)
        for count in (n for n in layout.names or () if n.startswith(COUNT)):
            same &= records[count] == records[count][0]
        yield same_length[same], records if same.all() else records[same]
        left = left[~np.isin(left, same_length[same])]


def decodable(name: str, block: Block, encoding: Encoding, fields_of: FieldsOf) -> Flags:
    """Return flags of complete messages of a topic's type, (N,)."""

    def is_whole(messages: Block) -> bool:
        try:
            return all(len(rows) for rows, _ in read_messages(name, messages, encoding, fields_of))
        except FileFormatError:
            return False

    if is_whole(block):
        return np.ones(len(block), dtype=bool)
    return np.array([is_whole(Block.of([block[i]])) for i in range(len(block))], dtype=bool)


def fields_by_definition(where: str, kind: str, definition: str, encoding: Encoding) -> FieldsOf:
    """Return the function that gives the fields of a topic's message type and of those within it."""
    where = f"{where}: type {cut(kind)}"
    types = _of_ros(encoding)
    if definition.strip():
        types = types | types_of(where, kind, definition)

    @cache
    def fields_in(name: str) -> tuple[Field, ...]:
        if "/" not in name:
            raise FileFormatError(f"{where}: has a {cut(name)}, which is not read")
        if ros2_name(name) not in types:
            raise FileFormatError(f"{where}: {cut(name)}, which is in it, is not defined")
        own = fields_of(types[ros2_name(name)][1])
        return tuple(field._replace(type=_SAME.get(field.type, current_name(field.type))) for field in own)

    return fields_in


@cache
def _of_ros(encoding: Encoding) -> Typesdict:
    return dict(get_typestore(Stores.ROS1_NOETIC if encoding == "ros1" else Stores.ROS2_HUMBLE).fielddefs)


@lru_cache(maxsize=256)  # its texts are names of joints, which come from files
def _blank(name: str, texts: tuple[tuple[str, str], ...], counts: tuple[tuple[str, int], ...]) -> bytes:
    sizes = {**{path: len(text.encode()) for path, text in texts}, **dict(counts)}
    walk = _Walk("ros1", lambda path, _: sizes.get(path, 0))
    walk.message(name)
    record = np.zeros(1, dtype=walk.dtype())
    for path, *_ in walk.places:
        if path.startswith(COUNT):
            record[path] = sizes.get(path[1:], 0)
    for path, text in texts:
        record[path] = np.void(text.encode())
    return record.tobytes()


def blank_messages(name: str, number: int, texts: Mapping[str, str], counts: Mapping[str, int]) -> NDArray[np.void]:
    """Return ROS 1 messages of zeros; strings and lengths of sequences by path, such as `name.0`, others are empty."""
    blank = _blank(name, tuple(texts.items()), tuple(counts.items()))
    return _records(bytearray(blank * number), layout_of(name, blank, "ros1"), number)


def _records(block: bytes | bytearray | memoryview, layout: np.dtype[np.void], number: int) -> NDArray[np.void]:
    # NumPy cannot count messages without a byte, such as std_msgs/Empty
    return np.frombuffer(block, dtype=layout) if layout.itemsize else np.zeros(number, dtype=layout)


def topic_named(name: str) -> Topic | None:
    """Return the topic of that name, with or without its leading slash, or None; a PSM's by how its name ends."""
    of_raven = next((topic for topic in RAVEN_TOPICS if topic.name.strip("/") == name.strip("/")), None)
    return of_raven or psm_topic_named(name)


def encode(topic: Topic, stamp: Integers, columns: Mapping[str, Floats], *, first_seq: int = 0) -> NDArray[np.void]:
    """Return N messages of a topic, each element one's bytes, at stamps (N,) [ns], from columns (N, width) in SI."""
    missing = [c.name for c in topic.columns if c.required and c.name not in columns]
    if missing:
        raise InputError(f"topic {topic.name}: telemetry lacks {', '.join(missing)}")
    texts = {f"name.{i}": name for i, name in enumerate(topic.joint_names)}
    counts = {c.path: c.width for c in topic.columns if texts and c.name in columns} | {"name": len(texts)}
    messages = blank_messages(topic.type, len(stamp), texts, counts)
    if len(stamp) and (stamp.min() < 0 or stamp.max() // SECOND > np.iinfo(np.uint32).max):
        raise InputError(f"topic {topic.name}: stamp {stamp.min()}..{stamp.max()} ns does not fit into ROS's time")
    messages[f"{topic.header}.seq"] = (first_seq + np.arange(len(stamp))) % 2**32
    messages[f"{topic.header}.stamp.sec"], messages[f"{topic.header}.stamp.nsec"] = np.divmod(stamp, SECOND)
    for column in topic.columns:
        if column.name not in columns:
            continue
        name = f'topic {topic.name}, "{column.name}"'
        values = np.asarray(columns[column.name], dtype=np.float64)
        values = values.reshape(len(stamp), -1) if values.size else values.reshape(len(stamp), column.width)
        values = as_array(name, values, (len(stamp), column.width), finite=column.whole) / column.to_si
        if column.path == "dt":
            whole, nanoseconds = np.divmod(np.rint(values[:, 0] * SECOND).astype(np.int64), SECOND)
            messages["dt.sec"], messages["dt.nsec"] = whole, nanoseconds
            continue
        field = messages[column.path]
        if field.dtype.kind in "iu":
            values = np.rint(values)
            if not ((values >= _INT32.min) & (values <= _INT32.max)).all():  # NaN too
                raise InputError(f"{name}: {values.min()}..{values.max()} does not fit into 32 bits")
        elif field.dtype.itemsize == 4 and len(values) and np.abs(values).max() > np.finfo(np.float32).max:
            raise InputError(f"{name}: {np.abs(values).max()} does not fit into a float32")
        field[...] = values.reshape(field.shape)
    return messages
