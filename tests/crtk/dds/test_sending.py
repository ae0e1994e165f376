"""Depth and quality of what a program publishes: best effort reaches who asks for it, and who asks for more is told."""

from catenary.crtk.dds.program import Quality
from catenary.crtk.dds.transport import DdsTransport
from catenary.crtk.message_values import joint_state_message
from catenary.crtk.transport import Sending
from patience import until

JOINTS = "sensor_msgs/JointState"


def test_a_best_effort_publisher_is_heard_by_our_own_and_said_to_be_one(dds_domain: int) -> None:
    with DdsTransport("robot", settle=0.05) as robot, DdsTransport("lab", settle=0.05) as lab:
        robot.sending = Sending(depth=3, is_reliable=False)
        publisher, latched = robot.publisher("/a", JOINTS), robot.publisher("/b", JOINTS, latch=True)
        assert (publisher.quality, latched.quality) == (Quality(is_reliable=False), Quality(is_latched=True))
        heard = lab.subscribe("/a", JOINTS)

        def comes() -> bool:
            publisher.publish(joint_state_message(("x",), robot.now(), [1.0]))
            return len(heard) > 0

        until(comes, every=0.02)
