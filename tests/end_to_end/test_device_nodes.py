"""catenary gravity-node as a program, heard by another program over ROS 1 and over DDS."""

import pytest

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
