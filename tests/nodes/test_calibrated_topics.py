from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from catenary.arrays import Floats
from catenary.calibration.intervals import Intervals
from catenary.calibration.model import CalibrationModel
from catenary.control.realtime import Timing
from catenary.crtk.client import CrtkClient
from catenary.crtk.loopback import Loopback
from catenary.crtk.message import header, message_class
from catenary.crtk.message_values import joint_values, pose_of
from catenary.dynamics.kinematics import forward_kinematics
from catenary.errors import InputError
from catenary.gravity.torque import gravity_torque
from catenary.nodes.calibrated_topics import _LATE_AFTER_S, CalibratedTopics, WireReport
from catenary.plant import MotionLog
from catenary.raven2.topics import JOINTS
from catenary.robots.catalog import load_robot
from catenary.simulation.cable_plant import UNITS
from oracles.crtk_robot import RobotOnLoopback
from oracles.ideal_plant import IdealPlant
from recordings import fitted

START = np.array([0.6, 1.4, 0.38, 0.0, 0.1, 0.2, -0.2])
OFFSET = np.array([0.02, -0.03, 0.001])


def linear_model(error: Callable[[Floats], Floats], **options: Any) -> CalibrationModel:
    """A model of what positions (400, 3) around START err by."""
    q = START[:3] + np.array([0.2, 0.2, 0.02]) * np.random.default_rng(0).uniform(-1.0, 1.0, (400, 3))
    log = MotionLog(
        name="run", joint_names=JOINTS[:3], joint_units=("rad", "rad", "m"), q_nominal=q,
        q_encoder=q + error(q), ok=np.ones(400, dtype=bool), time=np.arange(400) / 1000.0,
    )  # fmt: skip
    return fitted(log, kind="linear", inputs=("q:shoulder", "q:elbow", "q:insertion"), **options)


@pytest.fixture(scope="module")
def model() -> CalibrationModel:
    """Its correction is OFFSET, whatever the position, trusted around START."""
    return linear_model(lambda q: OFFSET)


class Deployed:
    """A model beside a robot, and somebody who listens."""

    def __init__(self, model: CalibrationModel, **options: Any) -> None:
        self.robot = RobotOnLoopback(plant())
        self.client = CrtkClient(self.robot.transport, stale_after=0.1)
        self.topics = CalibratedTopics(self.client, model, **options)
        listener = Loopback("listener", self.robot.network)
        types = {"measured_js": "sensor_msgs/JointState", "measured_cp": "geometry_msgs/TransformStamped",
                 "is_valid": "std_msgs/Bool", "interval": "sensor_msgs/JointState",
                 "gravity_torque": "sensor_msgs/JointState"}  # fmt: skip
        self.heard = {verb: listener.subscribe(f"/arm1/calibrated/{verb}", kind) for verb, kind in types.items()}

    def ticks(self, count: int) -> None:
        for _ in range(count):
            self.client.wait()
            self.topics.step()


def plant(**options: Any) -> IdealPlant:
    return IdealPlant(START.tolist(), joint_names=JOINTS, joint_units=UNITS, **options)


def test_each_message_of_the_robot_is_corrected_once_with_pose_and_gravity_torque(model) -> None:
    deployed = Deployed(model, gravity_torque=True)
    deployed.ticks(50)
    messages = [received.message for received in deployed.heard["measured_js"].take()]
    assert len(messages) == deployed.topics.report().published == 50
    assert (np.diff([m.header.stamp for m in messages]) == 1_000_000).all()  # the robot's own stamps
    q = joint_values(messages[-1], JOINTS)
    corrected = START[:3] + OFFSET
    assert_allclose(q[:3], corrected, atol=1e-6)
    assert_allclose(q[3:], START[3:])
    pose = pose_of(deployed.heard["measured_cp"].take()[-1].message)
    tool = [*corrected, START[3], START[4], 0.5 * (START[6] - START[5])]
    expected = forward_kinematics(load_robot("raven2_full"), tool)
    assert_allclose(pose.position, expected.position, atol=1e-6)
    assert_allclose(pose.rotation, expected.rotation, atol=1e-6)
    torque = joint_values(deployed.heard["gravity_torque"].take()[-1].message, JOINTS[:3], "effort")
    assert_allclose(torque, gravity_torque(load_robot("raven2"), corrected, [0.0, 0.0, -9.81]), atol=1e-5)


def test_half_widths_are_published_for_the_joints_of_a_model_that_has_them(model: CalibrationModel) -> None:
    without = Deployed(model)
    without.ticks(2)
    assert not without.heard["interval"].take()
    widths = np.array([0.01, 0.02, 0.001])
    deployed = Deployed(replace(model, intervals=Intervals(0.9, widths, 2.0 * widths)))
    deployed.ticks(2)
    message = deployed.heard["interval"].take()[-1].message
    assert tuple(message.name) == model.joint_names
    assert_allclose(message.position, widths)


def test_positions_outside_the_valid_range_are_flagged(model: CalibrationModel) -> None:
    deployed = Deployed(model)
    deployed.ticks(2)
    assert all(received.message.data for received in deployed.heard["is_valid"].take())
    far = START.copy()
    far[0] += 0.6
    deployed.robot.robot.plant.servo_jp(far)
    deployed.ticks(2)
    assert not deployed.heard["is_valid"].take()[-1].message.data
    assert deployed.topics.report().outside[0] > 0.0


def test_a_position_that_is_no_number_is_left_out_and_counted(model: CalibrationModel) -> None:
    deployed = Deployed(model)
    deployed.ticks(2)
    robot = deployed.robot.robot
    stamp = header(robot.transport.now())
    spoilt = message_class("sensor_msgs/JointState")(stamp, JOINTS, np.full(7, np.nan), np.zeros(7), np.zeros(7))
    for odd in (spoilt, spoilt, spoilt._replace(name=("elbow",) * 7, position=START)):
        robot._out["measured_js"].publish(odd)
    deployed.topics.step()
    deployed.ticks(2)
    report = deployed.topics.report()
    assert (report.messages, report.published, report.unreadable) == (7, 4, 3)
    assert all(np.isfinite(one.message.position).all() for one in deployed.heard["measured_js"].take())


def test_robot_may_restart_and_is_corrected_again_when_homed(model: CalibrationModel) -> None:
    deployed = Deployed(model)
    deployed.ticks(10)
    deployed.robot.unplug()
    deployed.ticks(150)
    assert deployed.topics.is_silent
    deployed.robot.restart(plant(ready=False))
    deployed.ticks(10)
    assert deployed.topics.report().not_homed == 10
    deployed.robot.robot.plant.state_command("enable")
    deployed.robot.robot.plant.state_command("home")
    deployed.ticks(10)
    report = deployed.topics.report()
    assert not deployed.topics.is_silent
    assert (report.published, report.silences) == (20, 1)
    assert_allclose(report.longest_silence, 0.151, atol=1e-3)
    assert_allclose(report.rate_hz, 1000.0)


@pytest.mark.parametrize("late", [0.004, 0.05])
def test_newest_is_published_however_late_and_latency_is_from_its_arrival(model, late) -> None:
    deployed = Deployed(model)
    deployed.client.wait()
    deployed.robot.clock.robots.clear()
    deployed.robot.clock.sleep(late)  # nobody looks
    assert deployed.topics.step() == 1
    latency = deployed.topics.report().latency
    assert latency is not None
    assert_allclose(latency.max, late, rtol=1e-6)


def test_one_that_does_not_keep_up_publishes_less_not_later(model: CalibrationModel) -> None:
    deployed = Deployed(model)
    for _ in range(60):
        deployed.client.wait()  # nobody looks
    deployed.topics.step()
    report = deployed.topics.report()
    assert report.latency is not None
    assert report.latency.max <= _LATE_AFTER_S
    assert (report.published, report.late) == (round(_LATE_AFTER_S / 0.001) + 1, 39)
    stamps = [received.message.header.stamp for received in deployed.heard["measured_js"].take()]
    assert stamps[-1] == max(stamps)
    deployed.ticks(5)
    assert deployed.topics.report().late == 39  # it keeps up again


def test_play_states_follow_positions_that_came_too_late() -> None:
    model = linear_model(lambda q: 0.1 * np.diff(q, axis=0, prepend=q[:1]), play=(0.05,))
    last = []
    for looks in (True, False):
        deployed = Deployed(model)
        for k in range(60):
            deployed.robot.robot.plant.servo_jp(START + 1e-3 * k)
            deployed.client.wait()
            if looks:
                deployed.topics.step()
        deployed.topics.step()
        last.append(deployed.heard["measured_js"].take()[-1].message)
    assert_array_equal(last[0].position, last[1].position)
    assert last[0].header.stamp == last[1].header.stamp


def test_robot_without_the_models_joints_is_refused() -> None:
    rng = np.random.default_rng(1)
    q = rng.uniform(-1.0, 1.0, (100, 1))
    other = fitted(MotionLog("run", ("hinge",), ("rad",), q, np.ones(100, dtype=bool), q + 0.1), kind="offset")
    with pytest.raises(InputError, match='no joint "hinge"'):
        Deployed(other)


def model_of_torques() -> CalibrationModel:
    """Its correction is OFFSET, and 0.01 rad/Nm of the elbow's torque on that joint."""
    q = START[:3] + np.array([0.2, 0.2, 0.02]) * np.random.default_rng(0).uniform(-1.0, 1.0, (400, 3))
    tau = np.random.default_rng(1).uniform(-1.0, 1.0, (400, 3))
    log = MotionLog(
        name="run", joint_names=JOINTS[:3], joint_units=("rad", "rad", "m"), q_nominal=q,
        q_encoder=q + OFFSET + 0.01 * tau[:, 1:2] * [0.0, 1.0, 0.0],
        ok=np.ones(400, dtype=bool), time=np.arange(400) / 1000.0, tau=tau,
    )  # fmt: skip
    return fitted(log, kind="linear", inputs=("q:shoulder", "q:elbow", "q:insertion", "tau:elbow"))


def test_torques_are_slow_for_control_alone() -> None:
    model, risen = model_of_torques(), []
    for for_control in (False, True):
        deployed = Deployed(model, for_control=for_control)
        deployed.ticks(5)
        deployed.robot.robot.plant.telemetry = lambda: {"tau": np.full(7, 0.01)}  # type: ignore[method-assign]
        deployed.heard["measured_js"].take()
        deployed.ticks(202)
        elbow = np.array([joint_values(one.message, JOINTS)[1] for one in deployed.heard["measured_js"].take()])
        rise = elbow - START[1] - OFFSET[1]
        first = np.flatnonzero(rise > 1e-7)[0]
        risen.append(rise[[first, first + 199]])
    assert risen[0][0] == pytest.approx(risen[0][1])
    assert_allclose(risen[1] / risen[0], [1.0 - np.exp(-0.005), 1.0 - np.exp(-1.0)], rtol=1e-3)  # a time constant


def test_torques_that_come_no_more_are_flagged_until_they_are_back() -> None:
    deployed = Deployed(model_of_torques())
    deployed.ticks(10)
    robot = deployed.robot.robot
    assert not deployed.topics.stale
    state = robot._out.pop("ravenstate")
    deployed.ticks(200)
    assert deployed.topics.stale[0].startswith("/ravenstate: 0.")
    deployed.heard["is_valid"].take()
    deployed.ticks(5)
    assert not any(one.message.data for one in deployed.heard["is_valid"].take())
    robot._out["ravenstate"] = state
    deployed.ticks(5)
    assert not deployed.topics.stale
    assert 90 < deployed.topics.report().stale < 110


def report(rate_hz: float | None, median: float | None) -> WireReport:
    latency = None if median is None else Timing(median, 2 * median, 3 * median, 4 * median)
    return WireReport(
        seconds=10.0, messages=100, published=100, rate_hz=rate_hz, latency=latency, late=0, missed=0, silences=0,
        longest_silence=0.0, not_homed=0, unreadable=0, stale=0, outside=(0.0,), joint_names=("a",), leaps={},
    )  # fmt: skip


@pytest.mark.parametrize(
    ("rate_hz", "median", "keeps_up"),
    [
        (1000.0, 0.9e-3, True),
        (1000.0, 3.4e-3, False),
        (30.0, 3.4e-3, True),
        (30.0, 0.04, False),
        (None, 0.04, True),
        (1000.0, None, True),
    ],
)
def test_what_is_corrected_after_the_next_message_has_come_does_not_keep_up(rate_hz, median, keeps_up) -> None:
    found = report(rate_hz, median)
    assert found.keeps_up is keeps_up
    assert found.as_data()["keeps_up"] is keeps_up
