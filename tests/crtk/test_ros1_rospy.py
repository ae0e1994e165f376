"""Ros1Transport and the codec against rospy and genpy as they come."""

from io import BytesIO

import numpy as np
import pytest

from catenary.crtk.message import message_class
from catenary.crtk.message_bytes import codec
from catenary.recording.messages import MESSAGES, full_definition, md5_sum
from oracles.random_messages import random_message
from ros import OPEN, Master, Program, require_ros1

pytestmark = pytest.mark.slow

ROSPY = """
from catenary.crtk.ros1.transport import make_rospy_importable
make_rospy_importable()
import rospy, sys
from sensor_msgs.msg import JointState, Imu
from geometry_msgs.msg import TransformStamped
from std_srvs.srv import Trigger, TriggerResponse
rospy.init_node(sys.argv[1])
"""


def test_rospys_own_classes_read_what_is_sent(ros_master: Master) -> None:
    code = f"""{ROSPY}
def tell(m):
    print(m.header.stamp.to_nsec(), m.header.frame_id, *m.name, *m.position, len(m.velocity), *m.effort)
rospy.Subscriber("/js", JointState, tell)
print("listening")
rospy.spin()
"""
    sender = f"""{OPEN}
publisher = transport.publisher("/js", "sensor_msgs/JointState", latch=True)
publisher.publish(message_class("sensor_msgs/JointState")(
    header(1_700_000_000_123_456_789, "base"), ("a", "b"), (0.25, -1.5), (), [3, 4]))
sys.stdin.readline()
"""
    with Program(ros_master, code, "rospy") as listener:
        assert listener.line() == "listening"
        with Program(ros_master, sender, "robot"):
            assert listener.line() == "1700000000123456789 base a b 0.25 -1.5 0 3.0 4.0"


def test_what_rospys_own_classes_send_is_read(ros_master: Master) -> None:
    code = f"""{ROSPY}
publisher = rospy.Publisher("/tf", TransformStamped, queue_size=10, latch=True)
message = TransformStamped()
message.header.stamp = rospy.Time(1_700_000_000, 123_456_789)
message.child_frame_id = "tool"
message.transform.translation.x = 0.5
message.transform.rotation.w = 1.0
publisher.publish(message)
rospy.Service("/button", Trigger, lambda request: TriggerResponse(True, "pressed"))
print("sent")
rospy.spin()
"""
    reader = f"""{OPEN}
subscription = transport.subscribe("/tf", "geometry_msgs/TransformStamped")
((m, _),) = subscription.take(PATIENCE)
print(m.header.stamp, m.child_frame_id, m.transform.translation.x, m.transform.rotation.w)
print(*transport.call("/button", "std_srvs/Trigger", timeout=PATIENCE))
"""
    with Program(ros_master, code, "rospy") as talker:
        assert talker.line() == "sent"
        with Program(ros_master, reader, "client") as client:
            assert client.line() == "1700000000123456789 tool 0.5 1.0"
            assert client.line() == "True pressed"


def test_rospy_calls_a_service(ros_master: Master) -> None:
    server = f"""{OPEN}
response = message_class("std_srvs/TriggerResponse")
transport.service("/button", "std_srvs/Trigger", lambda request: response(success=True, message="ours"))
print("serving")
while True:
    transport.poll(0.1)
"""
    code = ROSPY + 'print(rospy.ServiceProxy("/button", Trigger)().message)\n'
    with Program(ros_master, server, "robot") as robot:
        assert robot.line() == "serving"
        with Program(ros_master, code, "rospy") as client:
            assert client.line() == "ours"


@pytest.mark.parametrize("name", MESSAGES)
def test_genpy_reads_and_writes_the_same_bytes(name: str) -> None:
    require_ros1()
    import genpy.dynamic

    theirs = genpy.dynamic.generate_dynamic(name, full_definition(name))[name]
    assert theirs._md5sum == md5_sum(name)
    data = codec(name).encode(random_message(name, np.random.default_rng(5)), 6)
    buffer = BytesIO()
    theirs().deserialize(data).serialize(buffer)
    assert buffer.getvalue() == data
    assert isinstance(codec(name).decode(buffer.getvalue()), message_class(name))


def test_a_subscriber_that_does_not_ask_for_it_gets_each_message_at_once(ros_master: Master) -> None:
    """rospy's subscribers say "no" by default, and TCP then holds messages back for each other (Nagle)."""
    listener = f"""{ROSPY}
rospy.Subscriber("/js", JointState, lambda m: None)
print("listening")
rospy.spin()
"""
    robot = f"""{OPEN}
import socket
publisher = transport.publisher("/js", "sensor_msgs/JointState")
print("up")
while not publisher.subscribers():
    time.sleep(0.05)
(peer,) = publisher._peers
print(peer.connection.socket.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY))
"""
    with Program(ros_master, robot, "robot") as sender, Program(ros_master, listener, "rospy") as hears:
        assert sender.line() == "up"
        assert hears.line() == "listening"
        assert sender.line() != "0"
