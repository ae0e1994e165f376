"""Topics by their names, and thousands of messages of one at once: from its columns in SI to bytes."""

from collections.abc import Iterable, Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from catenary.arrays import Floats, as_array
from catenary.dvrk_psm import psm_topic_named
from catenary.errors import FileFormatError, InputError
from catenary.raven2.topics import RAVEN_TOPICS, RAVENSTATE
from catenary.recording.layout import blank_messages
from catenary.topics import SECOND, Topic, TopicColumn

_INT32 = np.iinfo(np.int32)
# where a recording's robot, seed and `simulated` travel in a bag, which has no other place for them
ABOUT_TOPIC = "/catenary/recording"
ABOUT_TYPE = "std_msgs/String"


def columns_of_type(name: str) -> Mapping[str, TopicColumn]:
    """Return the columns of a message type whose numbers are not in SI, by their path in it; none of other types."""
    return {column.path: column for column in RAVENSTATE.columns} if name == RAVENSTATE.type else {}


def topic_named(name: str) -> Topic | None:
    """Return the topic of that name, with or without its leading slash, or None; a PSM's by how its name ends."""
    of_raven = next((topic for topic in RAVEN_TOPICS if topic.name.strip("/") == name.strip("/")), None)
    return of_raven or psm_topic_named(name)


def encode(
    topic: Topic, stamp: NDArray[np.int64], columns: Mapping[str, Floats], *, first_seq: int = 0
) -> NDArray[np.void]:
    """Return N messages of a topic, each element the bytes of one, at stamps (N,) [ns] that are not negative.

    Columns are by their names, each (N, width) in SI; those not required may be missing.
    """
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
            whole, rest = np.divmod(np.rint(values[:, 0] * SECOND).astype(np.int64), SECOND)
            messages["dt.sec"], messages["dt.nsec"] = whole, rest
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


def require_topics(where: Path | str, asked: Iterable[str] | None, there: Iterable[str]) -> None:
    """Refuse a topic that is not in a recording."""
    there = list(there)
    missing = [name for name in asked or () if name not in there]
    if missing:
        raise FileFormatError(f"{where}: no topic {', '.join(missing)}; it has {', '.join(there) or 'none'}")
