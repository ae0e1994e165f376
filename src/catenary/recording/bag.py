"""ROS 1 bags and MCAP, written without ROS.

Bags get the index by which they are read when they are closed; until then they bear another name (`.part`), so that
a bag that is there is whole. A bag has no place for the robot's name, the seed and whether it was simulated: they
travel as one message on `/catenary/recording`. Beside bags of one topic each, it has a bag of its own: the programs of
RAVEN's group take every message in a bag for one of that topic.
"""

import logging
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Literal

from rosbags.interfaces import Connection
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2

from catenary.errors import InputError
from catenary.recording.journal import About
from catenary.recording.layout import Encoding, blank_messages
from catenary.recording.messages import MESSAGES, current_name, ros2_name, typestore
from catenary.recording.source import Source
from catenary.recording.topics import ABOUT_TOPIC, ABOUT_TYPE, topic_named

log = logging.getLogger(__name__)
BagKind = Literal["ros1", "mcap"]
MAX_MESSAGES = 500_000  # of a bag: readers hold about 170 bytes of index per message in memory
ROS2_VERSION: Literal[8] = 8  # of metadata.yaml, as ROS 2 Jazzy reads it


def write_bag(
    source: Source, path: Path, kind: BagKind = "ros1", *, topics: Collection[str] | None = None
) -> tuple[Path, ...]:
    """Write a recording as one bag: a `.bag` file, or a ROS 2 bag with MCAP in it, which is a folder.

    Beyond half a million messages further bags follow, named `<name>_1` and so on. What is damaged in the source is
    left out; its `problems` say what, and are logged.

    Returns:
        What was written, in order.

    Raises:
        InputError: Something is there already, or a topic's type is not one that catenary knows.
        FileFormatError: The source is damaged, or lacks a topic.
    """
    return _write(source, kind, {t.name: path for t in source.topics if topics is None or t.name in topics})


def write_group_bags(source: Source, folder: Path, kind: BagKind = "ros1") -> tuple[Path, ...]:
    """Write a recording as RAVEN's group does, one bag per topic, for programs that read all of a bag.

    They are record_ravenstate, record_CRTKmeasurejs and record_ext_jenc, with nothing in them but /ravenstate,
    measured_js and /ext_jpos [raven2_CRTK_Python_controller, r2_enc_CRTK_recorder.launch]; beside these
    record_joint_enc, record_other for other topics, and record_about, which says of which robot they are.

    Returns:
        What was written.

    Raises:
        InputError: Something is there already, or a topic's type is not one that catenary knows.
        FileFormatError: The source is damaged.
    """
    suffix = ".bag" if kind == "ros1" else ""
    targets = {}
    for topic in source.topics:
        known = topic_named(topic.name)
        name = "record_other" if known is None else known.bag
        targets[topic.name] = folder / f"{name}{suffix}"
    return _write(source, kind, targets, about=folder / f"record_about{suffix}")


def _write(
    source: Source, kind: BagKind, targets: Mapping[str, Path], about: Path | None = None
) -> tuple[Path, ...]:
    """Write topics into their targets, and what the recording is of into each, or into a bag `about` alone."""
    unknown = [t for t in source.topics if t.name in targets and current_name(t.type) not in MESSAGES]
    if unknown:
        raise InputError(
            "; ".join(
                f"topic {t.name}: its type {t.type} is not known to catenary, so it cannot be written"
                for t in unknown
            )
        )
    types = {topic.name: current_name(topic.type) for topic in source.topics}
    bags: dict[Path, _Bag] = {}
    stated = source.about if about is None else None
    for topic, path in targets.items():
        bags.setdefault(path, _Bag(path, kind, source, stated)).types[topic] = types[topic]
    apart = None
    if about is not None and source.about is not None:
        apart = bags[about] = _Bag(about, kind, source, source.about)
    try:
        for bag in bags.values():
            bag.open()
        for topic, stamp, data in source.messages(tuple(targets)):
            if apart is not None:
                apart.state(stamp)
                apart = None
            bags[targets[topic]].write(topic, stamp, data)
        for problem in source.problems:
            log.warning("%s", problem)
        return tuple(path for bag in bags.values() for path in bag.close())
    except BaseException:
        for bag in bags.values():
            bag.abort()
        raise


class _Bag:
    """Writes a bag, and further ones when it grows too long."""

    def __init__(self, path: Path, kind: BagKind, source: Source, about: About | None) -> None:
        self.types: dict[str, str] = {} if about is None else {ABOUT_TOPIC: ABOUT_TYPE}
        self._first, self._kind, self._about = path, kind, about
        self._given = source.encoding
        self._encoding: Encoding = "ros1" if kind == "ros1" else "cdr"
        self._done: list[Path] = []
        self._writer: Writer1 | Writer2 | None = None
        self._messages = 0

    def open(self) -> None:
        number = len(self._done)
        first = self._first
        self._path = first if number == 0 else first.with_name(f"{first.stem}_{number}{first.suffix}")
        self._part = self._path.with_name(f"{self._path.name}.part")
        for path in (self._path, self._part):
            if path.exists():
                raise InputError(f"{path}: exists already, and is never overwritten")
        self._path.parent.mkdir(parents=True, exist_ok=True)
        self._messages = 0
        if self._kind == "ros1":
            self._writer, store = Writer1(self._part), typestore(1)
        else:
            self._writer = Writer2(self._part, version=ROS2_VERSION, storage_plugin=StoragePlugin.MCAP)
            store = typestore(2)
        self._writer.open()
        self._connections: dict[str, Connection] = {
            topic: self._writer.add_connection(topic, ros2_name(name), typestore=store)
            for topic, name in self.types.items()
        }

    def write(self, topic: str, stamp: int, data: bytes) -> None:
        if self._messages >= MAX_MESSAGES:
            self._finish()
            self.open()
        if self._messages == 0:
            self.state(stamp)
        self._put(topic, stamp, data, self._given)
        self._messages += 1

    def state(self, stamp: int) -> None:
        """Write what the recording is of, where that belongs into this bag."""
        if self._about is not None:
            message = blank_messages(ABOUT_TYPE, 1, {"data": self._about.as_json()}, {}).tobytes()
            self._put(ABOUT_TOPIC, stamp, message, "ros1")

    def close(self) -> list[Path]:
        self._finish()
        return self._done

    def abort(self) -> None:
        """Leave what is whole; what is not keeps its other name."""
        if self._writer is not None:
            self._writer.abort()

    def _put(self, topic: str, stamp: int, data: bytes | memoryview, encoding: Encoding) -> None:
        if self._writer is None:
            raise InputError(f"{self._path}: is closed")
        if encoding != self._encoding:
            store = typestore(2)  # its converters know that ROS 2's header lacks seq
            convert = store.cdr_to_ros1 if self._encoding == "ros1" else store.ros1_to_cdr
            data = convert(data, ros2_name(self.types[topic]))
        self._writer.write(self._connections[topic], stamp, data)

    def _finish(self) -> None:
        if self._writer is None:
            return
        self._writer.close()
        self._writer = None
        self._part.rename(self._path)
        self._done.append(self._path)
