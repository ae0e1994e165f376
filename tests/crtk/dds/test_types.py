"""Bytes on the wire, against rosbags' own types of ROS 2 and against types written by hand for Cyclone's serializer."""

from typing import Any

import numpy as np
import pytest
from rosbags.typesys import Stores, get_typestore

from catenary.crtk.dds.names import dds_topic, dds_type
from catenary.crtk.message import header, message_class
from catenary.crtk.message_bytes import codec
from catenary.recording.messages import MESSAGES, ros2_name
from oracles.random_messages import assert_same, random_message
from patience import PATIENCE, until

JAZZY = get_typestore(Stores.ROS2_JAZZY)
IN_ROS_2 = [name for name in MESSAGES if ros2_name(name) in JAZZY.fielddefs and name != "std_msgs/Header"]
JOINTS = ("shoulder", "elbow", "insertion")


@pytest.mark.parametrize("name", IN_ROS_2)
def test_messages_pass_as_the_bytes_of_ros_2s_own_types(robot: Any, name: str) -> None:
    rng = np.random.default_rng(5)
    raw = robot.subscribe(f"/t{IN_ROS_2.index(name)}", name)
    publisher = robot.publisher(raw.topic, name)
    until(lambda: robot.connections(raw.topic).subscribers)
    sent: list[bytes] = []
    write = publisher._writer.write
    publisher._writer.write = lambda one: (sent.append(one.data), write(one))
    message = codec(name).decode(codec(name).encode(random_message(name, rng), 0))  # no seq
    publisher.publish(message)
    del publisher._writer.write  # which refers to the writer, and would keep it
    known = JAZZY.deserialize_cdr(sent[0], ros2_name(name))
    assert bytes(JAZZY.serialize_cdr(known, ros2_name(name))) == sent[0]
    assert_same(raw.take(PATIENCE)[0].message, message)


def test_a_joint_state_is_read_by_another_programs_types(robot: Any, peer: Any) -> None:
    from oracles.cyclone_peer import JointState

    reader = peer.reader("rt/joints", JointState)
    publisher = robot.publisher("/joints", "sensor_msgs/JointState")
    until(lambda: robot.connections("/joints").subscribers)
    stamp = 1_700_000_000_123_456_789
    publisher.publish(
        message_class("sensor_msgs/JointState")(
            header(stamp, "base"), JOINTS, np.array([0.1, -0.2, 0.3]), (), np.ones(3)
        )
    )
    got = reader.take_one(timeout=round(PATIENCE * 1e9))
    assert (got.header.stamp.sec, got.header.stamp.nanosec) == divmod(stamp, 10**9)
    assert (got.header.frame_id, tuple(got.name)) == ("base", JOINTS)
    assert (got.position, got.velocity, got.effort) == ([0.1, -0.2, 0.3], [], [1.0, 1.0, 1.0])


def test_a_joint_state_of_another_programs_types_is_read(robot: Any, peer: Any) -> None:
    from oracles.cyclone_peer import Header, JointState, Time

    heard = robot.subscribe("/joints", "sensor_msgs/JointState")
    writer = peer.writer("rt/joints", JointState)
    until(lambda: robot.connections("/joints").publishers)
    writer.write(JointState(Header(Time(5, 7), "tip"), list(JOINTS), [1.0, 2.0, 3.0], [], [0.5]))
    ((got, _),) = heard.take(PATIENCE)
    assert (got.header.stamp, got.header.frame_id, got.name) == (5_000_000_007, "tip", JOINTS)
    np.testing.assert_array_equal(got.position, [1.0, 2.0, 3.0])
    np.testing.assert_array_equal(got.effort, [0.5])


@pytest.mark.parametrize("name", MESSAGES)
def test_every_type_has_ros_2s_name_and_no_key(dds_domain: int, name: str) -> None:
    from catenary.crtk.dds.types import message_type

    kind = message_type(name)
    kind.__idl__.populate()
    assert kind.__idl__.idl_transformed_typename == dds_type(name)
    assert kind.__idl__.keyless


def test_the_ravens_own_messages_pass_too(robot: Any) -> None:
    heard = robot.subscribe("/ravenstate", "raven_2/raven_state")
    publisher = robot.publisher("/ravenstate", "raven_2/raven_state")
    until(lambda: robot.connections("/ravenstate").subscribers)
    kind = "raven_2/raven_state"
    message = codec(kind).decode(codec(kind).encode(random_message(kind, np.random.default_rng(1)), 0))
    publisher.publish(message)
    assert_same(heard.take(PATIENCE)[0].message, message)
    assert [end.topic for end in robot.program.directory.publishers(dds_topic("/ravenstate"))] == [
        "rt/ravenstate"
    ]
