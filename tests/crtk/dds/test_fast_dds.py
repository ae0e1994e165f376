"""Against Fast DDS, on which ROS 2 Humble runs by default: bytes, qualities of service and latched messages both ways."""

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from rosbags.typesys import Stores, get_typestore

from catenary.crtk.dds.types import dds_type
from catenary.crtk.message import message_class
from catenary.crtk.message_values import joint_state_message
from fast_dds import FastPeer
from patience import PATIENCE, until

HUMBLE = get_typestore(Stores.ROS2_HUMBLE)
JOINT_STATE = "sensor_msgs/JointState"
JOINTS = dds_type(JOINT_STATE)
NAMES = ("shoulder", "elbow", "tip")
TEXT = "crtk_msgs/StringStamped"


@pytest.fixture
def fast(dds_domain: int) -> Iterator[FastPeer]:
    with FastPeer(dds_domain) as peer:
        yield peer


def humble_joint_state(sec: int, nanosec: int, frame: str, names: Any, position: Any) -> bytes:
    """A JointState's CDR by rosbags, from Humble's definitions."""
    types = HUMBLE.types
    stamp = types["builtin_interfaces/msg/Time"](sec, nanosec)
    none = np.array([])
    message = types["sensor_msgs/msg/JointState"](
        types["std_msgs/msg/Header"](stamp, frame), list(names), np.array(position), none, none
    )
    return bytes(HUMBLE.serialize_cdr(message, "sensor_msgs/msg/JointState"))


@pytest.mark.parametrize("reliability", ["reliable", "best_effort"])
def test_fast_dds_gets_the_bytes_that_rosbags_makes(robot: Any, fast: FastPeer, reliability: str) -> None:
    publisher = robot.publisher("/joints", JOINT_STATE)
    fast.tell("listen", "rt/joints", JOINTS, reliability, "volatile")
    fast.line("publishers rt/joints 1")
    until(lambda: robot.connections("/joints").subscribers)
    publisher.publish(joint_state_message(NAMES, 1_700_000_000_000_000_005, [0.1, -0.2, 0.3]))
    expected = humble_joint_state(1_700_000_000, 5, "", NAMES, [0.1, -0.2, 0.3])
    got = bytes.fromhex(fast.line("got rt/joints").split()[2])
    # DDS fills messages up to four bytes
    assert got.ljust(-(-len(expected) // 4) * 4, b"\0") == expected.ljust(-(-len(expected) // 4) * 4, b"\0")


@pytest.mark.parametrize("reliability", ["reliable", "best_effort"])
def test_what_fast_dds_writes_is_read(robot: Any, fast: FastPeer, reliability: str) -> None:
    heard = robot.subscribe("/joints", JOINT_STATE)
    raw: list[bytes] = []
    push = heard.push
    heard.push = lambda data, *rest: (raw.append(data), push(data, *rest))
    fast.tell("publish", "rt/joints", JOINTS, reliability, "volatile")
    fast.line("subscribers rt/joints")
    until(lambda: robot.connections("/joints").publishers)
    fast.tell("joints", "rt/joints", "base", 5, 7, ",".join(NAMES), "0.5,-1.5,2.5")
    ((got, _),) = heard.take(PATIENCE)
    assert (got.header.stamp, got.header.frame_id, got.name) == (5_000_000_007, "base", NAMES)
    np.testing.assert_array_equal(got.position, [0.5, -1.5, 2.5])
    expected = humble_joint_state(5, 7, "base", NAMES, [0.5, -1.5, 2.5])
    assert raw[0][4:].rstrip(b"\0") == expected[4:].rstrip(b"\0")


def test_a_late_listener_of_fast_dds_gets_the_last_state(robot: Any, fast: FastPeer) -> None:
    state = robot.publisher("/state", TEXT, latch=True)
    for text in ("old", "last"):
        state.publish(message_class(TEXT)(string=text))
    fast.tell("listen", "rt/state", dds_type(TEXT), "reliable", "latched")
    first = bytes.fromhex(fast.line("got rt/state").split()[2])
    assert b"last" in first
    state.publish(message_class(TEXT)(string="next"))
    assert b"next" in bytes.fromhex(fast.line("got rt/state").split()[2])


def test_the_last_state_of_fast_dds_reaches_a_late_listener_as_an_old_one(robot: Any, fast: FastPeer) -> None:
    fast.tell("publish", "rt/state", dds_type(TEXT), "reliable", "latched")
    for text in ("old", "last"):
        fast.tell("text", "rt/state", "base", text)
    until(lambda: "/state" in robot.topics())
    heard = robot.subscribe("/state", TEXT)
    (one,) = heard.take_arrivals(PATIENCE)
    assert (one.message.string, one.is_first) == ("last", True)
    assert one.sent <= one.time
