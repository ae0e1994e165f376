import numpy as np
import pytest
from numpy.testing import assert_array_equal

from catenary.crtk.clock import SECOND
from catenary.crtk.frames import (
    LENGTH,
    SEQ,
    SEQ_AT,
    STAMP,
    Frame,
    NumberFields,
    OperatingStateFrames,
    frame_of,
    joint_state_frame,
    pose_frame,
    stamp_bytes,
    twist_frame,
)
from catenary.crtk.message import header, message_class
from catenary.crtk.sheet import Sheet
from catenary.crtk.wire import codec
from catenary.errors import InputError
from catenary.plant import OperatingState

SEED = 7
NOW = 1_700_000_000_123_456_789  # [ns]


def decoded(type_name, frame):
    """What a peer reads: the length first, then so many bytes."""
    (length,) = LENGTH.unpack_from(frame)
    assert length == len(frame) - LENGTH.size
    return codec(type_name).decode(bytes(frame[LENGTH.size :]))


def written(frame, numbers):
    """A frame with its numbers."""
    sheet = Sheet([frame], len(numbers))
    sheet.numbers[:] = numbers
    sheet.write(NOW)
    return sheet.frame(0)


def test_a_joint_state_is_read_as_it_was_written():
    names = ("shoulder", "elbow", "insertion")
    numbers = np.random.default_rng(SEED).normal(size=12)
    message = decoded("sensor_msgs/JointState", written(joint_state_frame(names, 2, 3, "base"), numbers))
    assert message.name == names
    assert message.header.frame_id == "base"
    assert message.header.stamp == NOW
    for k, read in enumerate((message.position, message.velocity, message.effort)):
        assert_array_equal(read, numbers[2 + 3 * k : 5 + 3 * k])


@pytest.mark.parametrize("parts", ["", "q", "t", "qv", "qt", "vt"])
def test_a_joint_state_may_have_some_of_its_numbers_only(parts):
    numbers = np.random.default_rng(SEED).normal(size=9)
    frame = joint_state_frame(("shoulder", "elbow"), 1, 3, parts=parts)
    message = decoded("sensor_msgs/JointState", written(frame, numbers))
    for k, (part, read) in enumerate(zip("qvt", message[2:], strict=True)):
        begin = 1 + 3 * k
        assert_array_equal(read, numbers[begin : begin + 2] if part in parts else [])


def test_a_stamp_and_a_seq_are_read_as_they_were_written():
    frame = bytearray(joint_state_frame(("a",), 0, 1).content)
    frame[STAMP] = stamp_bytes(NOW)
    SEQ.pack_into(frame, SEQ_AT, 42)
    message = decoded("sensor_msgs/JointState", frame)
    assert (message.header.stamp, message.header.seq) == (NOW, 42)


@pytest.mark.parametrize("child", [None, "tool"])
def test_a_pose_is_read_as_it_was_written(child):
    numbers = np.random.default_rng(SEED).normal(size=7)
    frame = written(pose_frame(0, "base", child), numbers)
    if child is None:
        message = decoded("geometry_msgs/PoseStamped", frame)
        read = (*message.pose.position, *message.pose.orientation)
    else:
        message = decoded("geometry_msgs/TransformStamped", frame)
        assert message.child_frame_id == "tool"
        read = (*message.transform.translation, *message.transform.rotation)
    assert_array_equal(read, numbers)


def test_a_twist_is_read_as_it_was_written():
    numbers = np.random.default_rng(SEED).normal(size=6)
    twist = decoded("geometry_msgs/TwistStamped", written(twist_frame(0, "base"), numbers)).twist
    assert_array_equal([*twist.linear, *twist.angular], numbers)


def test_every_operating_state_has_a_frame_of_its_own():
    frames = OperatingStateFrames()
    for state in (OperatingState("ENABLED", True, False), OperatingState("FAULT", False, True)):
        assert decoded("crtk_msgs/OperatingState", frames.frame(state))[1:] == state


def test_numbers_of_fields_are_written_and_nothing_else():
    name = "raven_2/raven_state"
    message = message_class(name)(header(0, "frame"), last_seq=3, dt=SECOND // 1000)
    fields = NumberFields(name, message)
    parts = (
        fields.numbers("tau", 0, 3, first=8, factor=2.0),
        fields.numbers("encVals", 3, 2, factor=10.0),
        fields.numbers("grasp_d", 5),
    )
    numbers = np.array([0.5, -1.0, 2.0, 1.29, -1.29, 7.0])
    read = decoded(name, written(Frame(bytes(frame_of(name, message)), parts), numbers))
    expected = message_class(name)(
        header(NOW, "frame"),
        last_seq=3,
        dt=SECOND // 1000,
        tau=np.array([0.0] * 8 + [1.0, -2.0, 4.0] + [0.0] * 5),
        encVals=np.array([12, -12] + [0] * 14),  # truncated towards zero
        grasp_d=np.array([7.0, 0.0]),
    )
    assert codec(name).encode(read, 0) == codec(name).encode(expected, 0)


@pytest.mark.parametrize(("name", "first"), [("dt", 0), ("no_such", 0), ("tau", 14), ("runlevel", 1)])
def test_fields_that_do_not_hold_so_many_numbers_are_refused(name, first):
    kind = "raven_2/raven_state"
    with pytest.raises(InputError, match=f"a field {name} of at least"):
        NumberFields(kind, message_class(kind)()).numbers(name, 0, 3 if first == 14 else 1, first=first)
