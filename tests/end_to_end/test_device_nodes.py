"""catenary encoders and gravity-node as programs, heard by another program over ROS 1 and over DDS."""

import json
import threading
from pathlib import Path

import pytest

from meeting import Meeting
from oracles.simulated_encoders import SimulatedEncoders
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
LISTENER = """
import sys
from catenary.crtk.network import make_transport
transport = make_transport(sys.argv[1], "listener")
counts = transport.subscribe("/joint_enc", "sensor_msgs/JointState")
positions = transport.subscribe("/ext_jpos", "sensor_msgs/JointState")
while not (came := counts.take(1.0)):
    pass
message = came[-1].message
print(*message.name, *message.position, len(positions.take()))
"""


def test_gravity_comes_back_from_an_imus_topic(meeting: Meeting):
    network, carrier = meeting
    node = ("gravity-node", "--ros", carrier, "--imu", "/imu/data_raw", "--frame", "table", "--no-gyroscope")
    with Program(network, COMMAND, *node), Program(network, SENSOR, carrier) as sensor:
        frame, *vector = sensor.line().split()
    assert frame == "table"
    assert [float(word) for word in vector] == pytest.approx([-1.7, 0.0, -9.66], abs=0.1)


def test_counts_are_heard_and_no_positions_before_homing(meeting: Meeting, tmp_path: Path):
    network, carrier = meeting
    board, ending = SimulatedEncoders(tmp_path / "board"), threading.Event()

    def speak() -> None:
        while not ending.wait(0.01):
            board.send([6366, 17825, 76000])

    thread = threading.Thread(target=speak, daemon=True)
    thread.start()
    command = ("encoders", "--ros", carrier, "--port", str(board.link), "--json")
    with Program(network, COMMAND, *command) as node, Program(network, LISTENER, carrier) as listener:
        assert listener.line() == "shoulder elbow insertion 6366.0 17825.0 76000.0 0"
        assert json.loads(node.line())["is_up"]
    ending.set()
    thread.join()
    board.close()
