"""Bytes on the wire, against rosbags' own types of ROS 2 and against types written by hand for Cyclone's serializer."""

from typing import Any

import numpy as np
import pytest
from rosbags.typesys import Stores, get_typestore

from catenary.crtk.dds import program as names
from catenary.crtk.dds.program import _DISTRIBUTIONS, distribution, message_hash
from catenary.crtk.message import CDR, codec
from catenary.errors import InputError
from catenary.recording.messages import MESSAGES, current_name
from oracles.random_messages import assert_same, random_message
from patience import PATIENCE, until

JOINTS = ("shoulder", "elbow", "insertion")


def test_messages_of_every_type_pass_as_they_are(robot: Any) -> None:
    """DDS itself reads them by its own types; their bytes are compared with rosbags' in test_message_bytes."""
    rng = np.random.default_rng(5)
    heard = {name: robot.subscribe(f"/t{k}", name) for k, name in enumerate(MESSAGES)}
    publishers = {name: robot.publisher(one.topic, name) for name, one in heard.items()}
    until(lambda: all(robot.connections(one.topic).subscribers for one in heard.values()))
    for name, publisher in publishers.items():
        message = codec(name, CDR).decode(codec(name, CDR).encode(random_message(name, rng)))  # without seq
        publisher.publish(message)
        assert_same(heard[name].take(PATIENCE)[0].message, message)


def test_every_type_has_ros_2s_name_which_is_read_back_and_no_key() -> None:
    for name in MESSAGES:
        kind = names.message_type(name)
        kind.__idl__.populate()
        assert kind.__idl__.idl_transformed_typename == names.dds_type(name)
        assert kind.__idl__.keyless
        assert names.ros_type(names.dds_type(name)) == current_name(name)


def test_topics_and_types_are_called_as_by_ros_2() -> None:
    # from ROS 2's design, "Topic and Service name mapping to DDS"
    assert names.dds_topic("/left/image_raw") == "rt/left/image_raw"
    assert names.dds_type("std_msgs/String") == "std_msgs::msg::dds_::String_"


def test_what_is_none_of_ros_is_left_as_it_is() -> None:
    assert names.ros_topic(names.dds_topic("/a/b")) == "/a/b"
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


def test_the_distribution_is_the_one_given_else_the_one_sourced_else_the_default(monkeypatch) -> None:
    monkeypatch.delenv("ROS_DISTRO", raising=False)
    assert distribution() == _DISTRIBUTIONS["jazzy"]
    monkeypatch.setenv("ROS_DISTRO", "humble")
    assert distribution() == _DISTRIBUTIONS["humble"]
    monkeypatch.setenv("ROS_DISTRO", "noetic")  # ROS 1's
    assert distribution() == _DISTRIBUTIONS["jazzy"]


def test_another_distribution_is_refused_with_the_choices() -> None:
    with pytest.raises(InputError, match=f'"foxy": expected one of {", ".join(_DISTRIBUTIONS)}'):
        distribution("foxy")
