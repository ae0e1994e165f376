"""Bytes on the wire, against rosbags' own types of ROS 2 and against types written by hand for Cyclone's serializer."""

from typing import Any

import numpy as np
import pytest
from rosbags.typesys import Stores, get_typestore

from catenary.crtk.dds import types as names
from catenary.crtk.dds.types import DISTRIBUTIONS, dds_topic, dds_type, distribution, half_hash, message_hash
from catenary.crtk.message import header, message_class
from catenary.crtk.message_bytes import codec
from catenary.errors import InputError
from catenary.recording.messages import MESSAGES, SERVICES, current_name, ros2_name
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
    assert [end.topic for end in robot.program.directory.publishers(dds_topic("/ravenstate"))] == ["rt/ravenstate"]


def test_topics_services_and_types_are_called_as_by_ros_2() -> None:
    # from ROS 2's design, "Topic and Service name mapping to DDS"
    assert names.dds_topic("/left/image_raw") == "rt/left/image_raw"
    assert names.request_topic("/add_two_ints") == "rq/add_two_intsRequest"
    assert names.reply_topic("/add_two_ints") == "rr/add_two_intsReply"
    assert names.dds_type("std_msgs/String") == "std_msgs::msg::dds_::String_"
    assert names.dds_half("std_srvs/Trigger", "Request") == "std_srvs::srv::dds_::Trigger_Request_"


@pytest.mark.parametrize("name", MESSAGES)
def test_names_are_read_back(name: str) -> None:
    assert names.ros_type(names.dds_type(name)) == current_name(name)
    assert names.ros_topic(names.dds_topic("/a/b")) == "/a/b"


def test_what_is_none_of_ros_is_left_as_it_is() -> None:
    assert names.ros_topic("ros_discovery_info") is None
    assert names.ros_topic("rq/add_two_intsRequest") is None
    assert names.ros_type("HelloWorldData::Msg") == "HelloWorldData::Msg"


STORES = {"humble": Stores.ROS2_HUMBLE, "iron": Stores.ROS2_IRON, "jazzy": Stores.ROS2_JAZZY}


@pytest.mark.parametrize("name", STORES)
def test_the_number_of_a_program_has_the_size_that_the_distribution_defines(name: str) -> None:
    ((_, (_, (_, length))),) = get_typestore(STORES[name]).fielddefs["rmw_dds_common/msg/Gid"][1]
    assert distribution(name).gid == length


def test_hashes_are_those_that_ros2_topic_info_prints() -> None:
    # std_msgs/String: ROS 2's documentation; sensor_msgs/JointState: `ros2 topic info --verbose` of robots
    string = "df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"
    joints = "a13ee3a330e346c9d87b5aa18d24e11690752bd33a0350f11c5882bc9179260e"
    assert message_hash("std_msgs/String") == f"RIHS01_{string}"
    assert message_hash("sensor_msgs/JointState") == f"RIHS01_{joints}"


def test_halves_of_services_have_hashes_of_their_own() -> None:
    hashes = {half_hash(service, half) for service in SERVICES for half in ("Request", "Response")}
    assert len(hashes) == 2 * len(SERVICES)


def test_the_distribution_is_the_one_given_else_the_one_sourced_else_the_default(monkeypatch) -> None:
    monkeypatch.delenv("ROS_DISTRO", raising=False)
    assert distribution().name == "jazzy"
    monkeypatch.setenv("ROS_DISTRO", "humble")
    assert distribution().name == "humble"
    assert distribution("iron").name == "iron"
    monkeypatch.setenv("ROS_DISTRO", "noetic")  # ROS 1's
    assert distribution().name == "jazzy"


def test_another_distribution_is_refused_with_the_choices() -> None:
    with pytest.raises(InputError, match=f'"foxy": expected one of {", ".join(DISTRIBUTIONS)}'):
        distribution("foxy")
