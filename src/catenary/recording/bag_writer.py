"""ROS 1 bags and MCAP, written without ROS.

A bag has no place for the robot's name, the seed and whether it was simulated: they travel as one message on
`/catenary/recording`, in a bag of its own: programs of RAVEN's group take every message in a bag for one of its topic.
"""

import logging
from collections.abc import Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import Any, Literal

from rosbags.interfaces import Connection
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2

from catenary.errors import FileFormatError, InputError
from catenary.recording.bag_stream import Source
from catenary.recording.layout import ABOUT_TOPIC, ABOUT_TYPE, Encoding, blank_messages, topic_named
from catenary.recording.messages import MESSAGES, check_type, current_name, ros2_name, typestore

log = logging.getLogger(__name__)
BagKind = Literal["ros1", "mcap"]
ROS2_VERSION: Literal[8] = 8  # of metadata.yaml, as ROS 2 Jazzy reads it


def write_group_bags(source: Source, folder: Path, kind: BagKind = "ros1") -> tuple[Path, ...]:
    """Write a recording as RAVEN's group does, a bag per topic: a `.bag` file, or the folder of a ROS 2 bag in MCAP.

    They are record_ravenstate, record_CRTKmeasurejs and record_ext_jenc, with nothing in them but /ravenstate,
    measured_js and /ext_jpos [raven2_CRTK_Python_controller, r2_enc_CRTK_recorder.launch]; beside these
    record_joint_enc, record_other, and record_about. Damaged messages are left out, and logged.

    Args:
        source, folder: The recording, and the folder to write into.
        kind: "ros1" or "ros2".

    Returns:
        Paths of the bags.
    """
    unknown = [topic for topic in source.topics if current_name(topic.type) not in MESSAGES]
    if unknown:
        notes = [
            f"topic {t.name}: its type {t.type} is not known to catenary, so it cannot be written" for t in unknown
        ]
        raise InputError("; ".join(notes))
    for name, spelt, _, definition in source.connections.values():  # what is written is defined as ours
        check_type(source.path, name, spelt, definition, ros=1 if source.encoding == "ros1" else 2)
    topics: dict[str, dict[str, str]] = {}  # of each bag, and their types
    for topic in source.topics:
        known = topic_named(topic.name)
        of_bag = topics.setdefault("record_other" if known is None else known.bag, {})
        of_bag[topic.name] = current_name(topic.type)
    if source.about is not None:
        topics["record_about"] = {ABOUT_TOPIC: ABOUT_TYPE}
    paths = {name: folder / f"{name}{'.bag' if kind == 'ros1' else ''}" for name in topics}
    for path in (path for path in paths.values() if path.exists()):
        raise InputError(f"{path}: exists already, and is never overwritten")
    to: dict[str, tuple[Writer1 | Writer2, Connection]] = {}  # by topic
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with ExitStack() as open_bags:
            bag: Writer1 | Writer2
            mcap = StoragePlugin.MCAP
            for name, path in paths.items():
                bag = Writer1(path) if kind == "ros1" else Writer2(path, version=ROS2_VERSION, storage_plugin=mcap)
                open_bags.enter_context(bag)
                for topic_name, of_type in topics[name].items():
                    store = typestore(1 if kind == "ros1" else 2)
                    to[topic_name] = bag, bag.add_connection(topic_name, ros2_name(of_type), typestore=store)
            copy_messages(source, to, kind, folder)
    except OSError as error:
        raise FileFormatError(f"{folder}: bags cannot be written: {error.strerror or error}") from error
    for problem in source.problems:
        log.warning("%s", problem)
    return tuple(paths.values())


def copy_messages(source: Source, to: Mapping[str, tuple[Any, Any]], kind: BagKind, place: Path) -> None:
    """Write messages of a recording into a bag; the recording's description comes first.

    Args:
        source: The recording.
        to: Bag and connection of each topic.
        kind: "ros1" or "ros2".
        place: Path of the bag, for messages.
    """
    types = {topic.name: current_name(topic.type) for topic in source.topics}
    store = typestore(2)  # its converters know that ROS 2's header lacks seq

    def write(topic: str, name: str, stamp: int, data: bytes | memoryview, encoding: Encoding) -> None:
        if encoding != ("ros1" if kind == "ros1" else "cdr"):
            theirs = ros2_name(name)
            try:
                data = (store.cdr_to_ros1 if kind == "ros1" else store.ros1_to_cdr)(data, theirs)
            except Exception as error:  # what rosbags raises over bytes that are no such message is of any kind
                raise FileFormatError(f"{place}: topic {topic}: {len(data)} bytes are no {name}: {error!r}") from error
        bag, connection = to[topic]
        bag.write(connection, stamp, data)

    for number, (topic, stamp, data) in enumerate(source.messages()):
        if number == 0 and source.about is not None and ABOUT_TOPIC in to:
            text = blank_messages(ABOUT_TYPE, 1, {"data": source.about.as_json()}, {}).tobytes()
            write(ABOUT_TOPIC, ABOUT_TYPE, stamp, text, "ros1")
        write(topic, types[topic], stamp, data, source.encoding)
