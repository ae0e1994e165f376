"""ROS 1 bags and MCAP, written without ROS.

Bags get the index by which they are read when they are closed; until then they bear another name (`.part`), so that
a bag that is there is whole. A bag has no place for the robot's name, the seed and whether it was simulated: they
travel as one message on `/catenary/recording`, in a bag of its own: the programs of RAVEN's group take every message
in a bag for one of that topic.
"""

import contextlib
import logging
from collections.abc import Mapping
from pathlib import Path
from typing import Literal

from rosbags.interfaces import Connection
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2

from catenary.errors import FileFormatError, InputError
from catenary.recording.bag_reader import Source
from catenary.recording.layout import Encoding, blank_messages
from catenary.recording.messages import MESSAGES, current_name, ros2_name, typestore
from catenary.recording.topic_samples import ABOUT_TOPIC, ABOUT_TYPE, topic_named

log = logging.getLogger(__name__)
BagKind = Literal["ros1", "mcap"]
ROS2_VERSION: Literal[8] = 8  # of metadata.yaml, as ROS 2 Jazzy reads it


def write_group_bags(source: Source, folder: Path, kind: BagKind = "ros1") -> tuple[Path, ...]:
    """Write a recording as RAVEN's group does, one bag per topic, for programs that read all of a bag.

    A bag is a `.bag` file, or a ROS 2 bag with MCAP in it, which is a folder. What is damaged in the source is left
    out; its `problems` say what, and are logged.

    They are record_ravenstate, record_CRTKmeasurejs and record_ext_jenc, with nothing in them but /ravenstate,
    measured_js and /ext_jpos [raven2_CRTK_Python_controller, r2_enc_CRTK_recorder.launch]; beside these
    record_joint_enc, record_other for other topics, and record_about, which says of which robot they are.
    """
    unknown = [topic for topic in source.topics if current_name(topic.type) not in MESSAGES]
    if unknown:
        said = [f"topic {t.name}: its type {t.type} is not known to catenary, so it cannot be written" for t in unknown]
        raise InputError("; ".join(said))
    topics: dict[str, dict[str, str]] = {}  # of each bag, and their types
    for topic in source.topics:
        known = topic_named(topic.name)
        of_bag = topics.setdefault("record_other" if known is None else known.bag, {})
        of_bag[topic.name] = current_name(topic.type)
    if source.about is not None:
        topics["record_about"] = {ABOUT_TOPIC: ABOUT_TYPE}
    suffix = ".bag" if kind == "ros1" else ""
    bags = list[_Bag]()
    try:
        for name, types in topics.items():
            bags.append(_Bag(folder / f"{name}{suffix}", kind, types))
        of_topic = {topic: bag for bag in bags for topic in bag.types}
        for place, (topic_name, stamp, data) in enumerate(source.messages()):
            if place == 0 and source.about is not None:
                text = blank_messages(ABOUT_TYPE, 1, {"data": source.about.as_json()}, {}).tobytes()
                of_topic[ABOUT_TOPIC].write(ABOUT_TOPIC, stamp, text, "ros1")
            of_topic[topic_name].write(topic_name, stamp, data, source.encoding)
        for problem in source.problems:
            log.warning("%s", problem)
        return tuple(bag.close() for bag in bags)
    except BaseException as error:
        for bag in bags:
            with contextlib.suppress(OSError):  # the disk may be full
                bag.abort()
        if isinstance(error, OSError):
            raise FileFormatError(f"{folder}: bags cannot be written: {error.strerror or error}") from error
        raise


class _Bag:
    """Writes a bag."""

    def __init__(self, path: Path, kind: BagKind, types: Mapping[str, str]) -> None:
        self.types = types  # of messages, by topic
        self._path, self._part = path, path.with_name(f"{path.name}.part")
        self._encoding: Encoding = "ros1" if kind == "ros1" else "cdr"
        for there in (self._path, self._part):
            if there.exists():
                raise InputError(f"{there}: exists already, and is never overwritten")
        self._path.parent.mkdir(parents=True, exist_ok=True)
        self._writer: Writer1 | Writer2
        if kind == "ros1":
            self._writer, store = Writer1(self._part), typestore(1)
        else:
            self._writer = Writer2(self._part, version=ROS2_VERSION, storage_plugin=StoragePlugin.MCAP)
            store = typestore(2)
        self._writer.open()
        self._connections: dict[str, Connection] = {
            topic: self._writer.add_connection(topic, ros2_name(name), typestore=store)
            for topic, name in self.types.items()
        }

    def write(self, topic: str, stamp: int, data: bytes, given: Encoding) -> None:
        converted: bytes | memoryview = data
        if given != self._encoding:
            store = typestore(2)  # its converters know that ROS 2's header lacks seq
            convert = store.cdr_to_ros1 if self._encoding == "ros1" else store.ros1_to_cdr
            try:
                converted = convert(data, ros2_name(self.types[topic]))
            except Exception as error:  # what rosbags raises over bytes that are no such message is of any kind
                raise FileFormatError(
                    f"{self._path}: topic {topic}: {len(data)} bytes are no {self.types[topic]}: {error!r}"
                ) from error
        self._writer.write(self._connections[topic], stamp, converted)

    def close(self) -> Path:
        self._writer.close()
        return self._part.rename(self._path)

    def abort(self) -> None:
        """Leave what is whole; what is not keeps its other name."""
        self._writer.abort()
