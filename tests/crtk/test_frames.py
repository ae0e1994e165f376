import numpy as np
import pytest
from numpy.testing import assert_array_equal

from catenary.crtk.frames import (
    LENGTH,
    SEQ,
    SEQ_AT,
    STAMP,
    JointStateFrame,
    OperatingStateFrames,
    frame_of,
    number_view,
    pose_frame,
    stamp_bytes,
    twist_frame,
)
from catenary.crtk.message import header, message_class
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


def test_a_filled_joint_state_is_read_as_it_was_written():
    names = ("shoulder", "elbow", "insertion")
    frame = JointStateFrame(names, "base")
    q, qd, tau = np.random.default_rng(SEED).normal(size=(3, 3))
    frame.fill(q, qd, tau)
    message = decoded("sensor_msgs/JointState", frame.bytes)
    assert message.name == names
    assert message.header.frame_id == "base"
    for read, written in ((message.position, q), (message.velocity, qd), (message.effort, tau)):
        assert_array_equal(read, written)


def test_a_stamp_and_a_seq_are_read_as_they_were_written():
    frame = JointStateFrame(("a",)).bytes
    frame[STAMP] = stamp_bytes(NOW)
    SEQ.pack_into(frame, SEQ_AT, 42)
    message = decoded("sensor_msgs/JointState", frame)
    assert (message.header.stamp, message.header.seq) == (NOW, 42)


@pytest.mark.parametrize("child", [None, "tool"])
def test_a_filled_pose_is_read_as_it_was_written(child):
    frame = pose_frame("base", child)
    numbers = np.random.default_rng(SEED).normal(size=7)
    frame.fill(*numbers)
    if child is None:
        message = decoded("geometry_msgs/PoseStamped", frame.bytes)
        read = (*message.pose.position, *message.pose.orientation)
    else:
        message = decoded("geometry_msgs/TransformStamped", frame.bytes)
        assert message.child_frame_id == "tool"
        read = (*message.transform.translation, *message.transform.rotation)
    assert_array_equal(read, numbers)


def test_a_filled_twist_is_read_as_it_was_written():
    frame, numbers = twist_frame("base"), np.random.default_rng(SEED).normal(size=6)
    frame.fill(*numbers)
    twist = decoded("geometry_msgs/TwistStamped", frame.bytes).twist
    assert_array_equal([*twist.linear, *twist.angular], numbers)


def test_every_operating_state_has_a_frame_of_its_own():
    frames = OperatingStateFrames()
    for state in (OperatingState("ENABLED", True, False), OperatingState("FAULT", False, True)):
        assert decoded("crtk_msgs/OperatingState", frames.frame(state))[1:] == state


def test_a_view_of_fields_writes_them_and_nothing_else():
    name = "raven_2/raven_state"
    message = message_class(name)(header(NOW, "frame"), last_seq=3, dt=1_000_000)
    frame = frame_of(name, message)
    view = number_view(frame, name, message, ("tau", "mpos"))
    view[:] = np.arange(32.0).reshape(2, 16)
    number_view(frame, name, message, ("grasp_d",))[0] = 7.0, 8.0
    read = decoded(name, frame)
    assert_array_equal(read.tau, np.arange(16))
    assert_array_equal(read.mpos, np.arange(16, 32))
    assert_array_equal(read.grasp_d, [7, 8])
    assert (read.last_seq, read.dt, read.hdr.stamp) == (3, 1_000_000, NOW)
    assert not read.jpos.any()


@pytest.mark.parametrize("names", [("tau", "jpos"), ("mpos_d", "jpos_d", "grasp_d")])
def test_fields_that_do_not_follow_each_other_are_refused(names):
    message = message_class("raven_2/raven_state")()
    frame = frame_of("raven_2/raven_state", message)
    with pytest.raises(InputError, match="follow each other"):
        number_view(frame, "raven_2/raven_state", message, names)
