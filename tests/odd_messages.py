"""Messages of any content, by a random generator: what a served robot has to bear."""

from typing import Any

import numpy as np

from catenary.crtk.message import Message, codec, message_class
from catenary.crtk.message_values import pose_message
from catenary.crtk.serving.served_arm import ServedArm
from catenary.crtk.topic_names import COMMAND, CrtkTopic
from catenary.plant import STATE_COMMANDS
from catenary.recording.messages import NUMBERS, TIMES, Field, fields
from catenary.spatial import Pose, rotation_from_vector

NUMBER = (0.0, 1.0, -1.0, 1e-3, 0.5, np.nan, np.inf, -np.inf, 1e300, -1e300, 1.7e308, 1e-300, 5e-324, 1e9)
LENGTHS = (0, 1, 2, 6, 7, 8, 15, 32, 33, 600)
HUGE = (3_000, 100_000)
WORDS = (
    "", "shoulder", "insertion", "jaw1", "home", "resume", " pause ", "\x1b[2J", "\x00", "\r\n", "\u202e", "é" * 60,
    "x" * 127, "x" * 129, "a/b", "nan",
)  # fmt: skip
TIME_STAMPS = (0, 1, 10**9, 1_700_000_000 * 10**9, 1_700_000_100 * 10**9, 4 * 10**18, (2**32 - 1) * 10**9)


def odd_bytes(rng: np.random.Generator, topic: CrtkTopic, arm: ServedArm) -> bytes:
    """Return what may come in by a topic: bytes of no message, of an odd one, or of one that could be obeyed."""
    kind = rng.random()
    if kind < 0.05:
        return rng.bytes(int(rng.integers(0, 300)))
    likely = kind < 0.5
    message = likely_message(rng, topic, arm) if likely else odd_message(rng, topic.type)
    data = codec(topic.type).encode(message, int(rng.integers(0, 2**32)))
    if kind > 0.9 and data:  # damaged on its way
        spoilt = bytearray(data[: int(rng.integers(0, len(data) + 1))] if rng.random() < 0.5 else data)
        for _ in range(int(rng.integers(0, 4))):
            if spoilt:
                spoilt[int(rng.integers(len(spoilt)))] = int(rng.integers(256))
        data = bytes(spoilt) + (rng.bytes(8) if rng.random() < 0.2 else b"")
    return data


def odd_message(rng: np.random.Generator, name: str) -> Message:
    """Return any message of a type."""
    values = [_value(rng, field) for field in fields(name)]
    for k, field in enumerate(fields(name)):
        if field.type == "string" and field.length is None and rng.random() < 1e-3:
            values[k] = "x" * 2_000_000
    return message_class(name)(*values)


def _value(rng: np.random.Generator, field: Field) -> Any:
    if field.type in NUMBERS:
        kind = np.dtype(NUMBERS[field.type])
        if field.type == "bool":
            choices: tuple[Any, ...] = (False, True)
        elif kind.kind == "f":
            choices = NUMBER
        else:
            choices = (0, 1, int(np.iinfo(kind).min), int(np.iinfo(kind).max))
        if field.length is None:
            return choices[int(rng.integers(len(choices)))]
        with np.errstate(over="ignore"):  # into float32
            return rng.choice(np.array(choices).astype(kind), size=_length(rng, field))
    if field.length is not None:
        one = field._replace(length=None)
        return tuple(_value(rng, one) for _ in range(_length(rng, field)))
    if field.type in TIMES:
        return int(TIME_STAMPS[rng.integers(len(TIME_STAMPS))])
    if field.type == "string":
        return WORDS[rng.integers(len(WORDS))]
    return odd_message(rng, field.type)


def _length(rng: np.random.Generator, field: Field) -> int:
    return field.length or int(rng.choice(HUGE if rng.random() < 3e-3 else LENGTHS))


def likely_message(rng: np.random.Generator, topic: CrtkTopic, arm: ServedArm) -> Message:
    """Return a message as clients of an arm send it, with numbers that are often in range."""
    kind, n = message_class(topic.type), len(arm.names)
    size = 10.0 ** rng.uniform(-6.0, 1.0)
    if topic.type == COMMAND:
        return kind(string=str(rng.choice(STATE_COMMANDS)))
    if topic.type == "sensor_msgs/JointState":
        if topic.verb.endswith("jp"):
            values = arm.setpoint.q + size * rng.normal(size=n)
        elif topic.verb.endswith("jf"):
            values = 10.0 * size * rng.normal(size=n)
        else:
            values = size * rng.normal(size=n)
        if rng.random() < 0.1:
            values[rng.integers(n)] = rng.choice(NUMBER)
        count = 1 if topic.verb.startswith(("jaw", "grasp")) else n
        names = arm.names if count == n and rng.random() < 0.5 else ()
        given = {"jv": "velocity", "jf": "effort"}.get(topic.verb[-2:], "position")
        return kind(name=names, **{given: values[:count]})
    if topic.type in ("geometry_msgs/PoseStamped", "geometry_msgs/TransformStamped"):
        goal = Pose(rotation_from_vector(size * rng.normal(size=3)), 0.1 * size * rng.normal(size=3))
        if topic.verb.endswith("cp"):
            here = arm.tool.pose(arm.setpoint.q)
            goal = Pose(goal.rotation @ here.rotation, here.position + goal.position)
        return pose_message(goal, 0, "", child="tool" if topic.type.endswith("TransformStamped") else None)
    if topic.type == "geometry_msgs/TwistStamped":
        vector, twist = message_class("geometry_msgs/Vector3"), message_class("geometry_msgs/Twist")
        return kind(twist=twist(*(vector(*(size * rng.normal(size=3))) for _ in range(2))))
    if topic.type == "geometry_msgs/WrenchStamped":
        vector, wrench = message_class("geometry_msgs/Vector3"), message_class("geometry_msgs/Wrench")
        return kind(wrench=wrench(*(vector(*(10.0 * size * rng.normal(size=3))) for _ in range(2))))
    if topic.type == "raven_2/raven_automove":
        move, turn = message_class("geometry_msgs/Transform"), message_class("geometry_msgs/Quaternion")
        return kind(
            del_pos=np.rint(1e4 * size * rng.normal(size=6)).astype(np.int32),
            tf_incr=(move(rotation=turn(0.0, 0.0, 0.0, 1.0)),) * 2,
        )
    return odd_message(rng, topic.type)
