"""What is particular to ROS 2, against a stand-in for rclpy; what holds for every transport is in contracts."""

import sys
from collections.abc import Iterator

import numpy as np
import pytest
from rosbags.typesys import Stores, get_typestore

from catenary.crtk.codec import codec
from catenary.crtk.message import header, message_class
from catenary.crtk.names import topics
from catenary.crtk.ros2.transport import Ros2Transport, ros2_class
from catenary.errors import MissingPackageError
from catenary.recording.messages import MESSAGES, ros2_name
from oracles import fake_rclpy
from oracles.random_messages import assert_same, random_message
from patience import PATIENCE

HUMBLE = get_typestore(Stores.ROS2_HUMBLE)
IN_HUMBLE = [n for n in MESSAGES if ros2_name(n) in HUMBLE.fielddefs and n != "std_msgs/Header"]


@pytest.fixture
def rclpy() -> Iterator[None]:
    with fake_rclpy.installed():
        yield


@pytest.mark.parametrize("name", IN_HUMBLE)
def test_messages_pass_as_the_bytes_of_ros2s_own_types(rclpy: None, name: str) -> None:
    rng = np.random.default_rng(5)
    with Ros2Transport("robot") as robot:
        heard = robot.subscribe("/t", name)
        publisher = robot.publisher("/t", name)
        sent: list[bytes] = []
        deliver, publisher._handle.publish = publisher._handle.publish, sent.append
        message = codec(name).decode(codec(name).encode(random_message(name, rng), 0))  # no seq
        publisher.publish(message)
        known = HUMBLE.deserialize_cdr(sent[0], ros2_name(name))
        assert bytes(HUMBLE.serialize_cdr(known, ros2_name(name))) == sent[0]
        deliver(sent[0])
        assert_same(heard.take(PATIENCE)[0].message, message)


def test_stamps_become_seconds_and_nanoseconds(rclpy: None) -> None:
    with Ros2Transport("robot") as robot:
        sent: list[bytes] = []
        publisher = robot.publisher("/t", "std_msgs/Header")
        publisher._handle.publish = sent.append
        publisher.publish(header(1_500_000_000, "a"))
        known = HUMBLE.deserialize_cdr(sent[0], "std_msgs/msg/Header")
        assert (known.stamp.sec, known.stamp.nanosec, known.frame_id) == (1, 500_000_000, "a")


def test_without_rclpy_the_error_says_where_it_comes_from(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "rclpy", None)
    with pytest.raises(MissingPackageError, match=r"source /opt/ros/DISTRO/setup\.bash"):
        Ros2Transport("robot")


def test_ros2_lacks_the_ravens_own_messages_and_none_of_the_present_dialect(rclpy: None) -> None:
    with pytest.raises(MissingPackageError, match="the crtk dialect does without them"):
        ros2_class("raven_2/raven_state")
    for topic in topics("crtk"):
        assert ros2_class(topic.type).ros2_name == topic.type.replace("/", "/msg/")


def test_a_latched_message_reaches_a_late_program(rclpy: None) -> None:
    with Ros2Transport("robot") as robot, Ros2Transport("client") as client:
        state = robot.publisher("/operating_state", "crtk_msgs/operating_state", latch=True)
        state.publish(message_class("crtk_msgs/OperatingState")(state="ENABLED"))
        heard = client.subscribe("/operating_state", "crtk_msgs/OperatingState")
        assert heard.take(PATIENCE)[0].message.state == "ENABLED"
        assert robot.connections("/operating_state") == ((), ("/client",))
        assert client.connections("/operating_state") == (("/robot",), ())


def test_a_node_whose_context_ends_leaves_spin(rclpy: None) -> None:
    robot = Ros2Transport("robot")
    fake_rclpy.shutdown(context=robot._context)
    robot.spin()
    assert not robot.is_up()
