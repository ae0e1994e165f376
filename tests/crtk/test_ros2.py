"""What is particular to ROS 2, against a stand-in for rclpy; what holds for every transport is in contracts."""

import sys
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from catenary.crtk.message import header, message_class
from catenary.crtk.names import topics
from catenary.crtk.ros2.messages import from_ros2, ros2_class, to_ros2
from catenary.crtk.ros2.transport import Ros2Transport
from catenary.errors import InputError, MissingPackageError
from catenary.recording.messages import MESSAGES
from oracles import fake_rclpy
from oracles.random_messages import assert_same, random_message
from patience import PATIENCE

IN_ROS2 = [name for name in MESSAGES if not name.startswith("raven_2/")]


@pytest.fixture
def rclpy() -> Iterator[None]:
    with fake_rclpy.installed():
        yield


def without_seq(message: Any) -> Any:
    if isinstance(message, message_class("std_msgs/Header")):
        return message._replace(seq=0)
    if isinstance(message, tuple) and hasattr(message, "_fields"):
        return type(message)(*(without_seq(value) for value in message))
    return message


@pytest.mark.parametrize("name", IN_ROS2)
@pytest.mark.parametrize("seed", range(3))
def test_messages_survive_the_way_there_and_back(rclpy: None, name: str, seed: int) -> None:
    message = without_seq(random_message(name, np.random.default_rng(seed)))
    assert_same(from_ros2(name, to_ros2(name, message)), message)


def test_stamps_become_seconds_and_nanoseconds(rclpy: None) -> None:
    given = to_ros2(
        "crtk_msgs/StringStamped", message_class("crtk_msgs/StringStamped")(header(1_500_000_000, "a"))
    )
    assert (given.header.stamp.sec, given.header.stamp.nanosec, given.header.frame_id) == (
        1,
        500_000_000,
        "a",
    )


@pytest.mark.parametrize(
    ("name", "values", "complaint"),
    [
        ("sensor_msgs/JointState", {"position": ["a"]}, "position: expected float64"),
        ("sensor_msgs/JointState", {"name": "shoulder"}, "name: expected string"),
        ("sensor_msgs/JointState", {"name": [3]}, "name: expected string"),
        ("sensor_msgs/JointState", {"header": header(-(2**63))}, "stamp"),
        ("sensor_msgs/Imu", {"angular_velocity_covariance": np.zeros(8)}, "covariance: expected float64"),
        ("sensor_msgs/Joy", {"buttons": [0.5]}, "buttons: expected int32"),
        ("sensor_msgs/Joy", {"buttons": [2**31]}, "buttons: expected int32"),
        ("geometry_msgs/Vector3", {"x": "1"}, "x: expected float64"),
    ],
)
def test_a_value_that_does_not_fit_is_refused_by_the_fields_name(
    rclpy: None, name: str, values: dict[str, Any], complaint: str
) -> None:
    with pytest.raises(InputError, match=complaint):
        to_ros2(name, message_class(name)(**values))


def test_whole_numbers_are_taken_for_floats(rclpy: None) -> None:
    assert (
        to_ros2("geometry_msgs/Vector3", message_class("geometry_msgs/Vector3")(1, np.float32(2), 3)).z == 3.0
    )


def test_without_rclpy_the_error_says_where_it_comes_from(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "rclpy", None)
    with pytest.raises(MissingPackageError, match=r"source /opt/ros/DISTRO/setup\.bash"):
        Ros2Transport("robot")


def test_the_ravens_own_messages_are_refused_with_the_way_out(rclpy: None) -> None:
    with (
        Ros2Transport("robot") as transport,
        pytest.raises(MissingPackageError, match="the crtk dialect does without them"),
    ):
        transport.publisher("/ravenstate", "raven_2/raven_state")


def test_the_present_dialect_needs_no_message_that_ros2_lacks(rclpy: None) -> None:
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
