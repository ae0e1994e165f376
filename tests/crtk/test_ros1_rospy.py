"""Ros1Transport and the codec against rospy and genpy as they come."""

from io import BytesIO
from typing import Any

import numpy as np
import pytest

from catenary.crtk.message import codec, message_class
from catenary.crtk.ros1.transport import Ros1Transport
from catenary.recording.messages import MESSAGES, full_definition, md5_sum
from oracles.random_messages import random_message
from patience import until
from ros import NODE, OPEN, Master, Program, require_ros1

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


def test_rospys_own_classes_and_services_and_ours_understand_each_other(ros_master: Master) -> None:
    theirs = f"""{ROSPY}
def tell(m):
    print(m.header.stamp.to_nsec(), m.header.frame_id, *m.name, *m.position, len(m.velocity), *m.effort)
    print(rospy.ServiceProxy("/our_button", Trigger)().message)
rospy.Subscriber("/js", JointState, tell)
publisher = rospy.Publisher("/tf", TransformStamped, queue_size=10, latch=True)
message = TransformStamped()
message.header.stamp = rospy.Time(1_700_000_000, 123_456_789)
message.child_frame_id = "tool"
message.transform.translation.x = 0.5
message.transform.rotation.w = 1.0
publisher.publish(message)
print("up")
rospy.spin()
"""
    ours = f"""{OPEN}
response = message_class("std_srvs/TriggerResponse")
transport.service("/our_button", "std_srvs/Trigger", lambda request: response(success=True, message="ours"))
subscription = transport.subscribe("/tf", "geometry_msgs/TransformStamped")
((m, _),) = subscription.take(PATIENCE)
print(m.header.stamp, m.child_frame_id, m.transform.translation.x, m.transform.rotation.w)
publisher = transport.publisher("/js", "sensor_msgs/JointState", latch=True)
publisher.publish(message_class("sensor_msgs/JointState")(
    header(1_700_000_000_123_456_789, "base"), ("a", "b"), (0.25, -1.5), (), [3, 4]))
while True:
    transport.poll(0.1)
"""
    with Program(ros_master, theirs, "rospy") as peer:
        assert peer.line() == "up"
        with Program(ros_master, ours, "robot") as robot:
            assert robot.line() == "1700000000123456789 tool 0.5 1.0"
            assert peer.line() == "1700000000123456789 base a b 0.25 -1.5 0 3.0 4.0"
            assert peer.line() == "ours"


LATCHING = f"""{ROSPY}
import socket
publisher = rospy.Publisher("/said", JointState, latch=True, queue_size=1)
print("up")
for line in sys.stdin:
    word, *said = line.split()
    if word == "break":  # as a cable that is pulled, or a router that forgets; then what was said meanwhile
        for connection in publisher.impl.connections:
            connection._connection.socket.shutdown(socket.SHUT_RDWR)
    for name in said:
        publisher.publish(JointState(name=[name]))
    print("done")
"""


def test_when_a_tcp_connection_is_renewed_what_was_latched_is_not_given_twice(ros_master: Master) -> None:
    """What a server makes of a message that is first, renewed or repeated: test_renewed_connections."""
    with Ros1Transport(NODE) as transport, Program(ros_master, LATCHING, "latching") as client:
        heard = transport.subscribe("/said", "sensor_msgs/JointState")

        def say(line: str) -> None:
            client.say(line)
            assert client.line() == "done"

        def came() -> tuple[Any, ...]:
            until(lambda: len(heard))
            (one,) = heard.take_arrivals()
            return one.message.name, one.is_first, one.is_renewed

        assert client.line() == "up"
        say("say a")
        assert came() == (("a",), True, False)
        say("break")
        until(lambda: heard.repeated == 1)
        assert not heard.take()
        say("break b")
        assert came() == (("b",), True, True)
        say("say c")
        assert came() == (("c",), False, False)


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
