"""What the RAVEN-II publishes on which topic, and its traps: the one place that turns it into SI and back.

Source: uw-biorobotics/raven2 (local_io.cpp) and the set of topics that its group records. The traps:
every joint and motor position and velocity in raven_state is multiplied by 180/pi, metres of insertion too;
`pos` and `pos_d` are whole micrometres; `tau` is the torque that was asked of the gearbox's output, before limits,
not a measurement; `jac_f` repeats `jac_vel`, in units nobody states. The arms' `measured_js` are swapped: arm1
carries the green arm, arm2 the gold one. `ravenstate_100hz` is published without a leading slash.
"""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from catenary.arrays import Floats, as_array
from catenary.errors import FileFormatError, InputError
from catenary.plant import UNUSED
from catenary.recording.bag_chunks import Block
from catenary.recording.layout import COUNT, Encoding, blank_messages, read_messages
from catenary.units import TO_SI

Arm = Literal["gold", "green"]
# of 8 channels of an arm
AXES = ("shoulder", "elbow", "insertion", UNUSED, "roll", "wrist", "jaw1", "jaw2")
JOINTS = ("shoulder", "elbow", "insertion", "roll", "wrist", "jaw1", "jaw2")  # of measured_js
MEASURED_JS: Mapping[Arm, str] = {"gold": "/arm2/measured_js", "green": "/arm1/measured_js"}
SECOND = 1_000_000_000  # [ns]
_DEGREES = TO_SI["deg"][1]
_INT32 = np.iinfo(np.int32)


@dataclass(frozen=True)
class TopicColumn:
    """One quantity of a topic, a number per label."""

    name: str  # in telemetry and extracted files
    path: str  # in the message
    labels: tuple[str, ...]  # of its numbers; a single empty one where the name says it all
    units: tuple[str, ...]  # SI, one per label; "" where it has none or nobody states it
    to_si: float = 1.0  # SI = published * to_si
    whole: bool = False  # a whole number: counts, levels
    required: bool = False  # of telemetry; what else it lacks is published as zero

    @property
    def width(self) -> int:
        """Count of its numbers."""
        return len(self.labels)

    @property
    def names(self) -> tuple[str, ...]:
        """Name of each number, as the columns of extracted files are called."""
        return tuple(f"{self.name}:{label}" if label else self.name for label in self.labels)


@dataclass(frozen=True)
class Topic:
    """A topic as it is recorded."""

    name: str
    type: str
    rate: float  # [Hz] at which it is recorded
    columns: tuple[TopicColumn, ...]
    stem: str  # of the file it is extracted to
    bag: str  # of the bag that RAVEN's group records it in
    header: str = "header"  # field that holds the stamp
    joint_names: tuple[str, ...] = ()  # sent along in a JointState


@dataclass(frozen=True)
class TopicSamples:
    """N messages of one topic, decoded."""

    stamp: NDArray[np.int64]  # (N,) [ns] from the header
    # (N, width), SI; NaN where a message has none
    columns: Mapping[str, NDArray[np.float64] | NDArray[np.int32]]


def _per_joint(unit: str, metres: str) -> tuple[str, ...]:
    one = tuple("" if axis == UNUSED else metres if axis == "insertion" else unit for axis in AXES)
    return (*one, *one)


def _both(labels: Iterable[str]) -> tuple[str, ...]:
    labels = tuple(labels)
    return tuple(f"{arm}_{label}" for arm in ("gold", "green") for label in labels)


def _state_columns() -> tuple[TopicColumn, ...]:
    single, axes = ("",), _both(AXES)
    tip, matrix = _both("xyz"), _both(f"{row}{column}" for row in "123" for column in "123")
    six = _both(str(i + 1) for i in range(6))

    def whole(name: str, labels: tuple[str, ...], unit: str = "") -> TopicColumn:
        return TopicColumn(name, name, labels, (unit,) * len(labels), whole=True)

    def axis(name: str, unit: str, metres: str, to_si: float) -> TopicColumn:
        return TopicColumn(name, name, axes, _per_joint(unit, metres), to_si, required=name == "jpos")

    return (
        *(whole(name, single) for name in ("runlevel", "sublevel", "last_seq")),
        whole("type", ("gold", "green")),
        TopicColumn("pos", "pos", tip, ("m",) * 6, 1e-6),
        TopicColumn("ori", "ori", matrix, ("",) * 18),
        TopicColumn("ori_d", "ori_d", matrix, ("",) * 18),
        TopicColumn("pos_d", "pos_d", tip, ("m",) * 6, 1e-6),
        TopicColumn("dt", "dt", single, ("s",)),
        whole("encVals", axes, "count"),
        whole("dac_val", axes, "count"),
        TopicColumn("tau", "tau", axes, _per_joint("Nm", "Nm"), required=True),
        axis("mpos", "rad", "rad", _DEGREES),
        axis("jpos", "rad", "m", _DEGREES),
        axis("mvel", "rad/s", "rad/s", _DEGREES),
        axis("jvel", "rad/s", "m/s", _DEGREES),
        axis("mpos_d", "rad", "rad", _DEGREES),
        axis("jpos_d", "rad", "m", _DEGREES),
        TopicColumn("grasp_d", "grasp_d", ("gold", "green"), ("", "")),
        TopicColumn("encoffsets", "encoffsets", axes, ("count",) * 16),
        TopicColumn("jac_vel", "jac_vel", six, ("",) * 12),
        TopicColumn("jac_f", "jac_f", six, ("",) * 12),
    )


def _joint_columns(name: str, joints: tuple[str, ...], unit: str = "") -> tuple[TopicColumn, ...]:
    """Columns of a JointState; velocity and effort may be missing from messages."""

    def column(suffix: str, path: str, rate: str, force: tuple[str, str]) -> TopicColumn:
        of = force if path == "effort" else (f"{unit}{rate}",) * 2 if unit else (f"rad{rate}", f"m{rate}")
        units = tuple(of[joint.endswith("insertion")] for joint in joints)
        return TopicColumn(name + suffix, path, joints, units, required=path == "position")

    return (
        column("", "position", "", ("", "")),
        column("_velocity", "velocity", "/s", ("", "")),
        column("_effort", "effort", "", ("Nm", "N")),
    )


RAVENSTATE = Topic(
    "/ravenstate", "raven_2/raven_state", 30.0, _state_columns(), "ravenstate", "record_ravenstate", "hdr"
)
RAVENSTATE_100HZ = replace(RAVENSTATE, name="ravenstate_100hz", rate=100.0, stem="ravenstate_100hz")
GOLD_MEASURED_JS = Topic(
    MEASURED_JS["gold"], "sensor_msgs/JointState", 100.0, _joint_columns("measured_js", JOINTS),
    "measured_js_gold", "record_CRTKmeasurejs", joint_names=JOINTS,
)  # fmt: skip
GREEN_MEASURED_JS = replace(GOLD_MEASURED_JS, name=MEASURED_JS["green"], stem="measured_js_green")
EXT_JPOS = Topic(
    "/ext_jpos", "sensor_msgs/JointState", 100.0, _joint_columns("ext_jpos", JOINTS[:3]),
    "ext_jpos", "record_ext_jenc", joint_names=JOINTS[:3],
)  # fmt: skip
JOINT_ENC = Topic(  # its type is not published; a JointState of counts is taken
    "/joint_enc", "sensor_msgs/JointState", 100.0, _joint_columns("joint_enc", JOINTS[:3], "count"),
    "joint_enc", "record_joint_enc", joint_names=JOINTS[:3],
)  # fmt: skip
PSM_JOINTS = (
    "outer_yaw",
    "outer_pitch",
    "outer_insertion",
    "outer_roll",
    "outer_wrist_pitch",
    "outer_wrist_yaw",
)  # of a da Vinci PSM's measured_js
# topics of a PSM below its namespace: name of the columns, rate [Hz]; the last is a tracker's, which no dVRK has
PSM_TOPICS: Mapping[str, tuple[str, float]] = {
    "measured_js": ("measured_js", 30.0),
    "setpoint_js": ("setpoint_js", 30.0),
    "tracker/measured_js": ("ext_jpos", 100.0),
}
_PSM_TOPIC = re.compile(rf"/?(?P<place>(?:\w+/)*PSM\w*)/(?P<verb>{'|'.join(PSM_TOPICS)})")
TOPICS = (RAVENSTATE, RAVENSTATE_100HZ, GOLD_MEASURED_JS, GREEN_MEASURED_JS, EXT_JPOS, JOINT_ENC)
# where a recording's robot, seed and `simulated` travel in a bag, which has no other place for them
ABOUT_TOPIC = "/catenary/recording"
ABOUT_TYPE = "std_msgs/String"


def columns_of_type(name: str) -> Mapping[str, TopicColumn]:
    """Return the columns of a message type whose numbers are not in SI, by their path in it; none of other types."""
    return {column.path: column for column in RAVENSTATE.columns} if name == RAVENSTATE.type else {}


def topic_named(name: str) -> Topic | None:
    """Return the topic of that name, with or without its leading slash, or None; a PSM's by how its name ends."""
    of_raven = next((topic for topic in TOPICS if topic.name.strip("/") == name.strip("/")), None)
    found = _PSM_TOPIC.fullmatch(name)
    if of_raven is not None or found is None:
        return of_raven
    return psm_topic(f"/{found['place']}", found["verb"])


def psm_topic(namespace: str, verb: str, rate: float | None = None) -> Topic:
    """Return a topic of a PSM, one of PSM_TOPICS, as it is recorded."""
    column, usual = PSM_TOPICS[verb]
    name = f"/{namespace.strip('/')}/{verb}"
    if _PSM_TOPIC.fullmatch(name) is None:
        raise InputError(f'namespace "{namespace}": expected one whose last word begins with PSM, as /PSM1')
    stem = f"psm_{'tracker' if column == 'ext_jpos' else column}"
    columns = _joint_columns(column, PSM_JOINTS)
    return Topic(name, "sensor_msgs/JointState", rate or usual, columns, stem, f"record_{stem}", joint_names=PSM_JOINTS)


def psm_topics(namespace: str, *, state_rate: float = 30.0) -> tuple[Topic, ...]:
    """Return the topics of a calibration recording of a PSM; errors as `psm_topic`."""
    return tuple(psm_topic(namespace, verb, None if verb.startswith("tracker") else state_rate) for verb in PSM_TOPICS)


def raven_topics(arm: Arm = "gold", *, state_rate: float = 30.0) -> tuple[Topic, ...]:
    """Return the topics of a calibration recording of one arm."""
    if not state_rate > 0.0:
        raise InputError(f"rate of /ravenstate: expected a positive number of Hz, got {state_rate}")
    is_fast = state_rate == RAVENSTATE_100HZ.rate
    state = RAVENSTATE_100HZ if is_fast else replace(RAVENSTATE, rate=state_rate)
    return (state, measured_topic(arm), EXT_JPOS, JOINT_ENC)


def measured_topic(arm: Arm) -> Topic:
    """Return the topic of an arm's measured_js."""
    return GOLD_MEASURED_JS if arm == "gold" else GREEN_MEASURED_JS


def encode(
    topic: Topic, stamp: NDArray[np.int64], columns: Mapping[str, Floats], *, first_seq: int = 0
) -> NDArray[np.void]:
    """Return N messages of a topic, each element the bytes of one.

    Args:
        topic: What to make.
        stamp: (N,) [ns], not negative.
        columns: By the name of the topic's columns, each (N, width) in SI; those not required may be missing.
        first_seq: `seq` of the first header.
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


def decode(topic: Topic, messages: Sequence[bytes] | Block, encoding: Encoding = "ros1") -> TopicSamples:
    """Decode messages of a topic into SI."""
    rows = len(messages)
    stamp = np.zeros(rows, dtype=np.int64)
    out: dict[str, NDArray[np.float64] | NDArray[np.int32]] = {
        c.name: np.zeros((rows, c.width), dtype=np.int32) if c.whole else np.full((rows, c.width), np.nan)
        for c in topic.columns
    }
    for places, records in read_messages(topic.type, messages, encoding):
        where: Any = slice(None) if len(places) == rows else places
        _same_joints(topic, records)
        seconds = records[f"{topic.header}.stamp.sec"].astype(np.int64)
        stamp[where] = seconds * SECOND + records[f"{topic.header}.stamp.nsec"]
        for column in topic.columns:
            if column.path == "dt":
                out["dt"][where, 0] = records["dt.sec"] + records["dt.nsec"] / SECOND
                continue
            values = records[column.path].reshape(len(records), -1)
            if values.shape[1] == 0 and not column.required:
                continue
            if values.shape[1] != column.width:
                raise FileFormatError(
                    f"topic {topic.name}: {column.path} has {values.shape[1]} numbers, expected {column.width}: "
                    + ", ".join(column.labels)
                )
            if column.whole:
                out[column.name][where] = values
            else:
                with np.errstate(invalid="ignore"):  # of NaN that signals; it stays NaN
                    out[column.name][where] = np.multiply(values, column.to_si, dtype=np.float64)
    return TopicSamples(stamp, out)


def require_topics(where: Path | str, asked: Iterable[str] | None, there: Iterable[str]) -> None:
    """Refuse a topic that is not in a recording."""
    there = list(there)
    missing = [name for name in asked or () if name not in there]
    if missing:
        raise FileFormatError(f"{where}: no topic {', '.join(missing)}; it has {', '.join(there) or 'none'}")


def _same_joints(topic: Topic, records: NDArray[np.void]) -> None:
    """Refuse a JointState whose joints are ours in another order; other spellings are taken as they come."""
    count = records[COUNT + "name"][0] if topic.joint_names else 0
    names = [bytes(records[f"name.{i}"][0]).rstrip(b"\0").decode(errors="replace") for i in range(count)]
    if sorted(names) == sorted(topic.joint_names) and tuple(names) != topic.joint_names:
        raise FileFormatError(
            f"topic {topic.name}: joints come as {', '.join(names)}, expected {', '.join(topic.joint_names)}"
        )
