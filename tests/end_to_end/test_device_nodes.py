"""catenary gravity-node and tool-node as programs, heard by another program over ROS 1 and over DDS."""

from pathlib import Path

import numpy as np
import pytest

from catenary.sensing.wrist_tool import WristTool, save_tool
from meeting import Meeting
from ros import COMMAND, Program

pytestmark = pytest.mark.slow

# an Imu at 100 Hz; says the gravity that comes back, when it is live
SENSOR = """
import numpy as np
from catenary.crtk.message import header, message_class
import sys
from catenary.crtk.network import make_transport
transport, rng = make_transport(sys.argv[1], "sensor"), np.random.default_rng(0)
xyz, imu = message_class("geometry_msgs/Vector3"), message_class("sensor_msgs/Imu")
publisher = transport.publisher("/imu/data_raw", "sensor_msgs/Imu")
vectors = transport.subscribe("/gravity", "geometry_msgs/Vector3Stamped")
states = transport.subscribe("/gravity/status", "crtk_msgs/StringStamped")
rate, status = transport.rate(100.0), ""
while True:
    force, turn = xyz(*(np.array([1.7, 0.0, 9.66]) + 0.01 * rng.normal(size=3))), xyz(*(0.001 * rng.normal(size=3)))
    publisher.publish(imu(header(transport.now(), "imu"), angular_velocity=turn, linear_acceleration=force))
    rate.sleep()
    for one in states.take():
        status = one.message.string
    came = vectors.take()
    if status == "live" and came and abs(came[-1].message.vector.x + 1.7) < 0.05:
        print(came[-1].message.header.frame_id, *came[-1].message.vector)
        break
"""


def test_gravity_comes_back_from_an_imus_topic(meeting: Meeting):
    network, carrier = meeting
    node = ("gravity-node", "--ros", carrier, "--imu", "/imu/data_raw", "--frame", "table", "--no-gyroscope")
    with Program(network, COMMAND, *node), Program(network, SENSOR, carrier) as sensor:
        frame, *vector = sensor.line().split()
    assert frame == "table"
    assert [float(word) for word in vector] == pytest.approx([-1.7, 0.0, -9.66], abs=0.1)


# an arm at rest at 100 Hz, whose sensor is pushed by 5 N along x; says the wrench that comes back
WRIST = """
import sys
from catenary.crtk.message import header, message_class
from catenary.crtk.message_values import joint_state_message
from catenary.crtk.network import make_transport
from catenary.robots.catalog import load_robot
transport, names = make_transport(sys.argv[1], "wrist"), load_robot("two_link").joint_names
xyz, wrench = message_class("geometry_msgs/Vector3"), message_class("geometry_msgs/Wrench")
stamped = message_class("geometry_msgs/WrenchStamped")
sensor = transport.publisher("/ft", "geometry_msgs/WrenchStamped")
joints = transport.publisher("/joint_states", "sensor_msgs/JointState")
wrenches = transport.subscribe("/tool/wrench", "geometry_msgs/WrenchStamped")
rate = transport.rate(100.0)
while True:
    now = transport.now()
    joints.publish(joint_state_message(names, now, [0.0, 0.0], [0.0, 0.0]))
    sensor.publish(stamped(header(now, "ft"), wrench(xyz(5.0, 0.0, -9.81), xyz(0.0, 0.0, 0.0))))
    rate.sleep()
    if came := wrenches.take():
        print(came[-1].message.header.frame_id, *came[-1].message.wrench.force)
        break
"""


def test_a_wrench_comes_back_without_the_tool(meeting: Meeting, tmp_path: Path):
    zeros = np.zeros(3)
    one_kilogram = WristTool(
        1.0, zeros, zeros, zeros, 0.0, zeros, zeros, zeros, 0.0, 0.0, robot="two_link", frame="base"
    )
    save_tool(tmp_path / "tool.toml", one_kilogram)
    network, carrier = meeting
    node = ("tool-node", "--ros", carrier, "--wrench", "/ft", "--tool", str(tmp_path / "tool.toml"))
    with Program(network, COMMAND, *node), Program(network, WRIST, carrier) as wrist:
        frame, *force = wrist.line().split()
    assert frame == "ft"
    assert [float(word) for word in force] == pytest.approx([5.0, 0.0, 0.0], abs=1e-6)
