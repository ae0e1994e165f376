"""The operator's commands over a real master and over DDS, beside `catenary serve` in another process.

One robot is served for all tests of this file, in real time. Commands run in this process, which is one ROS node, except
where a second program is what is tested. Commands that are ended: test_signals_ros1.
"""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary import CrtkClient, forward_kinematics, gravity_torque, load_robot
from catenary.crtk import network
from catenary.crtk.message_values import joint_values, pose_of
from catenary.recording.bag_reader import open_recording
from catenary.recording.layout import topic_named
from command_line import Outcome, catenary
from meeting import Meeting
from patience import until
from ros import NODE, PATIENT_COMMAND, Program

pytestmark = pytest.mark.slow

# what catenary gravity-node publishes on a base that is tilted, without the sensor
GRAVITY = (1.7, 0.0, -9.66)
GRAVITY_NODE = f"""
from catenary.crtk.message import header, message_class
import sys
from catenary.crtk.network import make_transport
transport = make_transport(sys.argv[1], "gravity")
vector, stamped = message_class("geometry_msgs/Vector3"), message_class("geometry_msgs/Vector3Stamped")
text = message_class("crtk_msgs/StringStamped")
vectors = transport.publisher("/gravity", "geometry_msgs/Vector3Stamped")
states = transport.publisher("/gravity/status", "crtk_msgs/StringStamped", latch=True)
states.publish(text(header(transport.now(), "base"), "live"))
rate = transport.rate(50.0)
print("up")
while True:
    vectors.publish(stamped(header(transport.now(), "base"), vector(*{GRAVITY})))
    rate.sleep()
"""


MET: list[Meeting] = []  # the one of the tests that run


@pytest.fixture(scope="module")
def served(meeting: Meeting) -> Iterator[Program]:
    """A homed robot: over ROS 1 by the command, which crtk/dds/test_real_ros2.py does over DDS."""
    MET[:] = [meeting]
    options = ("--rate", "200", *(["--homed"] if meeting.ros == "2" else []))
    with Program(meeting.network, PATIENT_COMMAND, "serve", "--ros", meeting.ros, *options) as server:
        server.line()  # it is up
        if meeting.ros == "1":
            assert catenary("home", "--ros", "1", "--yes", "--json").code == 0
        yield server


@pytest.fixture
def ready(served: Program) -> None:
    """The robot homed and ENABLED."""
    with client() as robot:
        if robot.operating_state().state != "ENABLED":
            robot.state_command("resume")


@contextmanager
def client() -> Iterator[CrtkClient]:
    """Look at the robot between two commands."""
    with network.make_transport(MET[0].ros, NODE) as transport, CrtkClient(transport) as one:
        yield one


def wait_until(so: Any) -> None:
    until(so, every=0.02)


def setpoint() -> np.ndarray:
    with client() as robot:
        q: np.ndarray = robot.setpoint_js().q
        return q


def test_goto_arrives(ready: None) -> None:
    goal = setpoint()[:3] + np.array([0.03, -0.03, 0.002])
    outcome = catenary("goto", "--q", ",".join(map(str, goal)), "--ros", MET[0].ros, "--simulated", "--json")
    assert outcome.code == 0, outcome
    assert_allclose(setpoint()[:3], goal, atol=1e-5)  # floats of 32 bits on the wire
    assert_allclose([joint["q"] for joint in outcome.json["joints"]][:3], goal, atol=0.01)


def test_what_others_do_is_recorded(ready: None, tmp_path: Path) -> None:
    project = tmp_path / "project"
    outcome = catenary(
        "record", project, "--ros", MET[0].ros, "--no-motion", "--hours", "0.0007", "--name", "hand", "--simulated",
        "--json",
    )  # fmt: skip
    assert outcome.code == 0, outcome
    recording = open_recording(project / "recordings" / "hand")
    arrivals: dict[str, list[int]] = {}
    for name, arrived, _ in recording.messages():
        arrivals.setdefault(name, []).append(arrived)
    told = {topic["name"]: topic for topic in outcome.json["topics"]}
    for name in ("/ravenstate", "/ext_jpos"):
        assert told[name]["lost"] == 0
        assert len(arrivals[name]) == told[name]["kept"] > 1
        # of what comes between the ticks of the topic's rate, one is kept; the machine may let none come
        topic = topic_named(name)
        assert topic is not None
        furthest = 1e-9 * np.diff(arrivals[name]).max()
        assert furthest < 1.0 / topic.rate + told[name]["longest_gap"] + 1e-6
    assert recording.about.simulated


def test_a_deployed_model_is_heard_and_shown_beside_gravity(meeting, ready, model) -> None:
    options = ("--gravity-torque", "--gravity", "/gravity", "--rate", "200", "--json")
    with (
        Program(meeting.network, GRAVITY_NODE, meeting.ros) as node,
        Program(meeting.network, PATIENT_COMMAND, "deploy", str(model), "--ros", MET[0].ros, *options) as deployed,
    ):
        assert node.line() == "up"
        with network.make_transport(meeting.ros, NODE) as transport:
            types = {
                "measured_js": "sensor_msgs/JointState",
                "measured_cp": "geometry_msgs/TransformStamped",
                "gravity_torque": "sensor_msgs/JointState",
            }
            heard = {
                verb: transport.subscribe(f"/arm1/calibrated/{verb}", kind, depth=1) for verb, kind in types.items()
            }
            wait_until(lambda: all(topic.take() for topic in heard.values()))
            time.sleep(0.5)
            last = {verb: topic.take(60.0)[-1].message for verb, topic in heard.items()}
        watched = catenary(
            "monitor", "--ros", MET[0].ros, "--simulated", "--gravity", "/gravity", "--seconds", "2", "--rate", "5", "--json",
        )  # fmt: skip
        deployed.interrupt()
        out, errors = deployed.finish()
    report = Outcome(0, out, errors).json
    assert deployed.process.returncode == (0 if report["keeps_up"] else 1), errors  # on this machine

    names = ("shoulder", "elbow", "insertion", "roll", "wrist", "jaw1", "jaw2")
    q = np.array(joint_values(last["measured_js"], names))
    tool = [*q[:5], 0.5 * (q[6] - q[5])]
    pose = pose_of(last["measured_cp"])
    # the arm stands; the two messages may be those of two ticks
    assert_allclose(pose.position, forward_kinematics(load_robot("raven2_full"), tool).position, atol=1e-4)
    assert_allclose(
        joint_values(last["gravity_torque"], names[:3], "effort"),
        gravity_torque(load_robot("raven2"), q[:3], GRAVITY),
        atol=1e-3,
    )

    sample = Outcome(0, watched.out.splitlines()[-1], "").json
    assert sample["state"]["state"] == "ENABLED"
    assert_allclose(np.subtract(sample["q_calibrated"], sample["q"])[:3], 0.01, atol=1e-3)
    assert sample["inside_valid_range"] == [True] * 7
    assert_allclose(sample["gravity"], GRAVITY)
    assert sample["gravity_age_s"] < 5.0

    # how many, how fast and how late depends on who else uses the machine of the tests
    assert report["published"] > 0
    # Ctrl-C may come in the middle of one
    assert report["messages"] - report["published"] - report["late"] in (0, 1)
    assert report["not_homed"] == 0
    assert report["rate_hz"] < 210.0
    assert report["latency_us"]["median"] > 0.0
    assert report["outside_valid_range"] == {"shoulder": 0.0, "elbow": 0.0, "insertion": 0.0}
