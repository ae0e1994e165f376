"""Dialect `raven`, trait by trait, on a loopback."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from catenary.crtk.loopback import Loopback, LoopbackNetwork
from catenary.crtk.message import message_class, stamp_of
from catenary.crtk.message_values import pose_message, pose_of
from catenary.crtk.topic_names import BUTTON, BUTTON_TYPE
from catenary.nodes.serve import Serving, make_server
from catenary.spatial import Pose, rotation_from_rpy
from catenary.topics import SECOND
from oracles.cable_arms import homed_plant
from oracles.ticking_clock import BEGIN, SetClock
from served_robot import JointState, ServedRobot, answered, shoulder

STEP = np.deg2rad(0.003)  # what a client sends in a millisecond
UP = np.array([0.0, 0.0, 1.0])
EXACT = 1e-12  # [rad|m] rounding of a hundred sums


@pytest.fixture
def robot() -> ServedRobot:
    """Homed, pedal down."""
    return ServedRobot()


def test_who_comes_late_hears_the_state_that_there_is_first(robot):
    robot.tick(300)  # nobody listens
    robot.command("pause")
    robot.tick(300)
    heard = robot.hear("operating_state")
    first = heard.take()[0]
    assert first.message.state == "PAUSED"
    assert robot.network.clock.now() - stamp_of(first.message) < 0.2 * SECOND


@pytest.mark.parametrize("at_once", [1, 2, 5, 33, 100])
def test_a_hundred_increments_move_a_hundred_times_as_far_however_they_bunch_up(robot, at_once):
    before = robot.setpoint
    for first in range(0, 100, at_once):
        for _ in range(first, min(100, first + at_once)):
            robot.joints("servo_jr", shoulder(STEP))
        robot.tick(at_once)
    robot.tick(100)
    assert_allclose(robot.setpoint - before, shoulder(np.deg2rad(0.3)), atol=EXACT)


def test_increments_that_have_waited_for_a_quarter_of_a_second_are_left_out(robot):
    before, step = robot.setpoint, np.array([0.0, 0.0, 5e-5, 0.0, 0.0, 0.0, 0.0])  # as far as it goes in a tick
    for _ in range(400):
        robot.server.arms["gold"].increment(step)
    robot.tick(400)
    assert_allclose(robot.setpoint - before, 251 * step, atol=EXACT)


@pytest.mark.parametrize(
    ("verb", "values", "moved"),
    [
        ("servo_jr", shoulder(1e-3), shoulder(1e-3)),
        ("servo_jr", [*shoulder(1e-3), *[99.0] * 8], shoulder(1e-3)),
        ("servo_jr", [1e-3], [0, 0, 0, 0, 0, 5e-4, 5e-4]),
        ("grasp_servo_jr", [1e-3], [0, 0, 0, 0, 0, 5e-4, 5e-4]),
        ("servo_jr", [0.1, -0.1, 0.01, 0, 0, 0, 0], [0.0025, -0.0025, 5e-5, 0, 0, 0, 0]),
        ("servo_jv", [1.0, 99.0, 0.02, 0, 0, 0, 0], [1e-3, 2.5e-3, 2e-5, 0, 0, 0, 0]),
    ],
    ids=["seven", "fifteen", "grasp", "grasp topic", "clamped to a millisecond", "velocity for a millisecond"],
)
def test_a_message_moves_at_most_one_clamped_step(robot, verb, values, moved):
    before = robot.setpoint
    robot.joints(verb, values)
    robot.tick(20)
    assert_allclose(robot.setpoint - before, moved, atol=EXACT)


def test_a_servo_jp_moves_one_clamped_step_a_message(robot):
    before = robot.setpoint
    for _ in range(3):
        robot.joints("servo_jp", before + shoulder(0.1))
        robot.tick()
    robot.tick(50)
    assert_allclose(robot.setpoint - before, shoulder(3 * 0.0025), atol=EXACT)


@pytest.mark.parametrize("state", ["PAUSED", "DISABLED"])
def test_nothing_moves_unless_enabled_which_is_reported_and_nothing_is_kept_for_later(state):
    robot = ServedRobot(state=state)
    before = robot.setpoint
    for _ in range(200):
        robot.joints("servo_jr", shoulder(STEP))
    robot.tick(5)
    assert_array_equal(robot.setpoint, before)
    (report,) = robot.server.reports.kinds.values()
    assert report.text == f"not obeyed while the arm is {state}, homed"
    robot.command("resume")
    robot.tick()
    before = robot.setpoint  # where the arm is, when control begins
    robot.tick(50)
    assert_array_equal(robot.setpoint, before)
    assert robot.state() == ("ENABLED" if state == "PAUSED" else "DISABLED")


def test_measured_arms_are_swapped_and_setpoints_are_not(robot):
    parked = robot.server.arms["green"].measured.q
    for _ in range(40):
        robot.joints("servo_jr", shoulder(2.5e-3))
    robot.tick(300)
    moved = parked[0] + 0.1
    for topic, expected in (
        ("/arm1/measured_js", parked[0]),
        ("/arm2/measured_js", moved),
        ("/arm1/setpoint_js", moved),
        ("/arm2/setpoint_js", parked[0]),
    ):
        heard = robot.client.subscribe(topic, "sensor_msgs/JointState")
        robot.tick(110)
        # the arm follows its setpoint to a few mrad
        assert_allclose(heard.take()[-1].message.position[0], expected, atol=0.01)


def test_joint_states_come_at_33_hz_at_most_with_28_names(robot):
    heard = robot.hear("joint_states", None)
    robot.tick(1000)
    received = heard.take()
    assert 30 <= len(received) <= 33
    assert len(set(received[0].message.name)) == len(received[0].message.position) == 28


@pytest.mark.parametrize("place", ["/arm1", "/arm2", "/arm3", "/arm4", ""])
def test_a_state_command_to_any_arm_is_one_to_the_robot(robot, place):
    """The robot's software has one state machine, which all its topics ask [local_io.cpp: crtk_cmd_cb]."""
    heard = {arm: robot.hear("operating_state", arm) for arm in ("gold", "green", None)}
    publisher = robot.client.publisher(f"{place}/state_command", "crtk_msgs/StringStamped")
    publisher.publish(message_class("crtk_msgs/StringStamped")(string="pause"))
    robot.tick(110)
    assert robot.state() == "PAUSED"
    assert {one.take()[-1].message.state for one in heard.values()} == {"PAUSED"}


def test_a_motion_command_to_an_arm_that_the_robot_has_not_moves_none(robot):
    before = robot.setpoint
    robot.client.publisher("/arm3/servo_jv", "sensor_msgs/JointState").publish(JointState(velocity=np.ones(7)))
    robot.tick(5)
    assert_array_equal(robot.setpoint, before)


def test_fault_of_one_arm_stops_the_other():
    plants = {"gold": homed_plant("left"), "green": homed_plant("right")}
    network = LoopbackNetwork(clock=SetClock(BEGIN))
    server = make_server(Serving(), Loopback("robot", network), plants=plants)
    heard = Loopback("client", network).subscribe("/arm2/operating_state", "crtk_msgs/operating_state")
    plants["gold"]._set_state("FAULT", "a motor's command was too large")
    for _ in range(3):
        server.tick()
    assert plants["green"].operating_state().state == "DISABLED"
    assert heard.take()[-1].message.state == "FAULT"


@pytest.mark.parametrize("dialect", ["raven", "crtk"])
def test_a_named_joint_is_moved_alone_and_not_the_jaws(dialect):
    robot = ServedRobot(dialect)
    before = robot.setpoint
    robot.joints("servo_jr", [1e-3], names=("elbow",))
    robot.joints("servo_jr", [2e-5], names=("gold_ins",))
    robot.tick(5)
    assert_allclose(robot.setpoint - before, [0, 1e-3, 2e-5, 0, 0, 0, 0], atol=EXACT)


@pytest.mark.parametrize("field", ["velocity", "position"])
def test_a_grasp_velocity_opens_the_jaws_for_a_millisecond(robot, field):
    before = robot.setpoint
    robot.say("grasp_servo_jv", JointState(**{field: [1.0]}))
    robot.tick(5)
    assert_allclose(robot.setpoint - before, [0, 0, 0, 0, 0, 5e-4, 5e-4], atol=EXACT)


def test_the_silver_button_does_nothing_to_a_running_robot(robot):
    assert not answered(robot.server, BUTTON, BUTTON_TYPE).success


@pytest.mark.parametrize(("verb", "dt"), [("servo_cr", 1.0), ("servo_cv", 1e-3)])
def test_cartesian_increments_move_the_tool_along_base_axes(robot, verb, dt):
    start = pose_of(robot.last("setpoint_cp"))
    step, turn = np.array([2e-5, -1e-5, 1.5e-5]), rotation_from_rpy((3e-4, 0.0, 0.0))
    if verb == "servo_cv":
        step, turn = step / dt, rotation_from_rpy((0.3, 0.0, 0.0))
    for _ in range(100):
        robot.say(verb, pose_message(Pose(turn, step), 0, "", child=""))
        robot.tick()
    robot.tick(10)
    end = pose_of(robot.last("setpoint_cp"))
    assert_allclose(end.position - start.position, [2e-3, -1e-3, 1.5e-3], atol=1e-8)
    assert_allclose(end.rotation, rotation_from_rpy((0.03, 0.0, 0.0)) @ start.rotation, atol=1e-6)


@pytest.mark.parametrize(("distance", "moved"), [(0.005, 0.005), (0.030, 0.015), (0.080, 0.0)])
def test_a_servo_cp_is_clipped_to_15_mm_and_refused_beyond_75(robot, distance, moved):
    start = pose_of(robot.last("setpoint_cp"))
    goal = Pose(start.rotation, start.position - distance * UP)
    robot.say("servo_cp", pose_message(goal, 0, "", child=""))
    robot.tick(100)
    before_watchdog = pose_of(robot.last("setpoint_cp")).position - start.position
    # a single one is followed for 0.1 s, at most 5 mm of insertion
    assert np.linalg.norm(before_watchdog) <= moved + 1e-6
    for _ in range(4):
        robot.say("servo_cp", pose_message(Pose(start.rotation, start.position - moved * UP), 0, "", child=""))
        robot.tick(100)
    assert_allclose(pose_of(robot.last("setpoint_cp")).position - start.position, [0.0, 0.0, -moved], atol=1e-6)
    assert ("/arm1/servo_cp: refused" in robot.server.reports.kinds) == (distance > 0.075)


def test_automove_moves_the_tool_in_micrometres_of_frame_0(robot):
    robot.tick(200)
    state = robot.hear("ravenstate", None)
    robot.tick(110)
    before = state.take()[-1].message.pos_d[:3]
    message = message_class("raven_2/raven_automove")(del_pos=np.array([20, -10, 15, 0, 0, 0], dtype=np.int32))
    for _ in range(100):
        robot.say("raven_automove", message, None)
        robot.tick()
    robot.tick(5)
    # both are truncated to whole um
    assert_allclose(state.take()[-1].message.pos_d[:3] - before, [2000, -1000, 1500], atol=1)


def test_setpoints_stop_at_the_joint_limits(robot):
    for _ in range(round(robot.setpoint[0] / 0.0025) + 50):
        robot.joints("servo_jr", shoulder(-0.0025))
        robot.tick()
    assert_allclose(robot.setpoint[0], robot.plant.lower[0], atol=EXACT)


def test_the_robots_own_gravity_compensation_is_switched_while_it_runs(robot):
    vector = message_class("geometry_msgs/Vector3")
    assert not robot.plant.control.gravity_torque.any()
    robot.say("grav_dir", vector(0.0, 0.0, 980.0), arm=None)
    robot.tick(5)
    assert robot.plant.grav_dir == (0, 0, 980)
    weighed = robot.plant.control.gravity_torque.copy()
    made_so = homed_plant("left", grav_dir=(0, 0, 980))
    made_so.wait()
    assert_allclose(weighed, made_so.control.gravity_torque, rtol=2e-2)  # a few ticks apart
    robot.say("grav_dir", vector(), arm=None)
    robot.tick(5)
    assert robot.plant.grav_dir is None
    assert not robot.plant.control.gravity_torque.any()
    robot.say("grav_dir", vector(0.0, 0.0, 490.0), arm=None)
    robot.tick(5)
    assert_allclose(robot.plant.control.gravity_torque, 0.5 * weighed, rtol=2e-2)


@pytest.mark.parametrize("values", [(0.0, 0.0, np.nan), (0.5, 0.0, 980.0), (0.0, 0.0, 9e9)])
def test_a_gravity_that_is_none_is_refused(robot, values):
    robot.say("grav_dir", message_class("geometry_msgs/Vector3")(*values), arm=None)
    robot.tick(3)
    assert robot.plant.grav_dir is None
    assert "/grav_dir: refused" in robot.server.reports.kinds
