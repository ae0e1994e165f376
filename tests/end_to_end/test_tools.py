"""The operator's commands over a real master and over DDS, beside `catenary serve` in another process.

One robot is served for all tests of this file, in real time. Commands run in this process, which is one ROS node, except
where a key, Ctrl-C or a second program is what is tested.
"""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary import CrtkClient, MotionLog, forward_kinematics, gravity_torque, load_robot
from catenary.calibration.model_file import save_model
from catenary.crtk import network
from catenary.crtk.message_values import joint_values, pose_of
from catenary.crtk.topic_names import find_topic
from catenary.recording.bag_reader import open_recording
from catenary.recording.layout import topic_named
from command_line import Outcome, catenary
from meeting import Meeting
from patience import until
from recordings import fitted
from ros import NODE, PATIENT_COMMAND, Program
from typist import Typist

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
OFFSET = np.array([0.02, -0.03, 0.001])  # [rad, rad, m] that the deployed model adds
HOME = np.array([np.pi / 6, np.pi / 2, 0.4])


# what does not depend on the transport: over one of them. A served robot is homed over DDS in crtk/dds/test_real_ros2.py
ONCE = pytest.mark.parametrize("meeting", ["1"], indirect=True, ids=["ros1"])


class Before(NamedTuple):
    """What happened to the robot before it was homed."""

    goto: Outcome
    interrupted: tuple[int, str]  # exit code and errors of a homing that Ctrl-C ended
    state_then: tuple[str, bool, bool]
    home: Outcome


MET: list[Meeting] = []  # the one of the tests that run


@pytest.fixture(scope="module")
def served(meeting: Meeting) -> Iterator[Program]:
    """A robot that was just switched on; over DDS, one that is homed."""
    MET[:] = [meeting]
    options = ("--rate", "200", *(["--homed"] if meeting.ros == "2" else []))
    with Program(meeting.network, PATIENT_COMMAND, "serve", "--ros", meeting.ros, *options) as server:
        server.line()  # it is up
        yield server


@pytest.fixture(scope="module")
def before(meeting: Meeting, served: Program) -> Before:
    """The robot refused, interrupted while it homed, and homed."""
    goto = catenary("goto", "--q-deg", "35", "--ros", MET[0].ros, "--simulated")
    with Program(meeting.network, PATIENT_COMMAND, "home", "--ros", MET[0].ros, "--yes") as homing, client() as robot:
        wait_until(lambda: robot.operating_state().is_busy)
        homing.interrupt()
        _, errors = homing.finish()
        wait_until(lambda: not robot.operating_state().is_busy)  # what was said last may not have come here yet
        state = tuple(robot.operating_state())
    return Before(
        goto, (homing.process.returncode, errors), state, catenary("home", "--ros", MET[0].ros, "--yes", "--json")
    )


@pytest.fixture
def ready(request: pytest.FixtureRequest, served: Program) -> None:
    """The robot homed and ENABLED."""
    if MET[0].ros == "1":
        assert request.getfixturevalue("before").home.code == 0
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


def at_rest(robot: CrtkClient) -> np.ndarray:
    """Setpoint that a hundred messages agree on: whatever the robot was told before is done by then."""
    topic = find_topic("raven", "setpoint_js", "gold")
    heard, rows = robot.transport.subscribe(topic.name, topic.type), [np.full(7, np.inf)]

    def rests() -> bool:
        rows.extend(joint_values(one.message, robot.joint_names) for one in heard.take())
        return len(rows) > 100 and bool((np.array(rows[-100:]) == rows[-1]).all())

    wait_until(rests)
    heard.close()
    return np.array(rows[-1])


def write_model(folder: Path) -> Path:
    """A model that adds OFFSET, trusted around the home position."""
    q = HOME + np.array([0.3, 0.3, 0.05]) * np.random.default_rng(0).uniform(-1.0, 1.0, (400, 3))
    names = ("shoulder", "elbow", "insertion")
    log = MotionLog(
        "run", names, ("rad", "rad", "m"), q, np.ones(400, dtype=bool), q + OFFSET, time=np.arange(400) / 30.0
    )
    inputs = tuple(f"q:{name}" for name in names)
    save_model(fitted(log, kind="linear", inputs=inputs), {}, folder / "arm.npz")
    return folder / "arm.npz"


@ONCE
def test_a_robot_that_is_not_homed_is_not_moved(before: Before) -> None:
    assert before.goto.code == 2
    assert "DISABLED" in before.goto.err
    assert before.goto.out == ""


@ONCE
def test_ctrl_c_ends_a_homing_and_disables_the_robot(before: Before) -> None:
    code, errors = before.interrupted
    assert code == 130
    assert "it was disabled" in errors
    assert before.state_then == ("DISABLED", False, False)


@ONCE
def test_a_paused_robot_is_not_moved(ready: None) -> None:
    with client() as robot:
        robot.state_command("pause")
    outcome = catenary("random", "--seconds", "2", "--ros", MET[0].ros, "--simulated")
    assert outcome.code == 2
    assert "PAUSED" in outcome.err


def test_goto_arrives(ready: None) -> None:
    goal = setpoint()[:3] + np.array([0.03, -0.03, 0.002])
    outcome = catenary("goto", "--q", ",".join(map(str, goal)), "--ros", MET[0].ros, "--simulated", "--json")
    assert outcome.code == 0, outcome
    assert_allclose(setpoint()[:3], goal, atol=1e-5)  # floats of 32 bits on the wire
    assert_allclose([joint["q"] for joint in outcome.json["joints"]][:3], goal, atol=0.01)


@ONCE
def test_ctrl_c_holds_the_robot_where_it_is(meeting: Meeting, ready: None) -> None:
    begin = setpoint()
    goal = np.rad2deg(begin[0]) + (20.0 if begin[0] < HOME[0] else -20.0)
    # it takes 17 s: it is stopped long before, also by a machine that is busy
    arguments = ("goto", "--q-deg", f"{goal:.3f}", "--speed", "0.1", "--ros", MET[0].ros, "--simulated")
    with Program(meeting.network, PATIENT_COMMAND, *arguments) as going, client() as robot:
        wait_until(lambda: abs(robot.setpoint_js().q[0] - begin[0]) > 0.02)
        going.interrupt()
        out, _ = going.finish()
        held = at_rest(robot)
        assert_allclose(at_rest(robot), held)
        assert robot.operating_state().state == "PAUSED"
    assert going.process.returncode == 130
    assert "stopped by Ctrl-C" in out
    assert abs(held[0] - begin[0]) < np.deg2rad(19.0)


@ONCE
def test_keys_move_the_robot_and_quitting_pauses_it(meeting: Meeting, ready: None) -> None:
    begin = setpoint()
    forward = b"q" if begin[0] < HOME[0] else b"a"
    program, environment = ("-c", PATIENT_COMMAND), meeting.network.environment
    with Typist("--ros", MET[0].ros, "--simulated", program=program, environment=environment) as typist:
        typist.wait_for(b"catenary teleop")
        pressed = time.monotonic()
        with client() as robot:
            typist.hold(forward, lambda: abs(robot.setpoint_js().q[0] - begin[0]) > 0.04)
        typist.type(b"Q")
        end = typist.end()
        took = time.monotonic() - pressed
    assert end["ended_by"] == "quit"
    assert end["state"]["state"] == "PAUSED"
    way = (setpoint()[0] - begin[0]) * (1.0 if forward == b"q" else -1.0)
    # it holds where its last message of the setpoint said; at 0.05 rad/s, its first speed, it gets no further
    assert 0.005 < way < 0.05 * took


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


def test_a_deployed_model_is_heard_and_shown_beside_gravity(meeting, ready, tmp_path) -> None:
    model = write_model(tmp_path)
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
    assert_allclose(np.subtract(sample["q_calibrated"], sample["q"])[:3], OFFSET, atol=1e-3)
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


@ONCE
def test_monitor_prints_a_line_a_second_and_sends_nothing(ready: None) -> None:
    begin = setpoint()
    outcome = catenary("monitor", "--ros", MET[0].ros, "--simulated", "--seconds", "1.2")
    assert outcome.code == 0, outcome
    assert "ENABLED, homed" in outcome.out
    assert_allclose(setpoint(), begin)
