"""Dialect `crtk`, verb by verb, on a loopback."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from catenary.crtk.message import message_class
from catenary.crtk.message_values import pose_message, pose_of
from catenary.crtk.serving.served_arm import joint_move, pose_move
from catenary.spatial import Pose, rotation_from_rpy
from oracles.cable_arms import ROBOTS, homed_plant
from served_robot import JointState, ServedRobot, shoulder

EXACT = 1e-12
Empty = message_class("std_msgs/Empty")


@pytest.fixture
def robot() -> ServedRobot:
    """Homed and enabled."""
    return ServedRobot("crtk")


def pose(robot: ServedRobot) -> Pose:
    """Setpoint of the tool."""
    return pose_of(robot.last("setpoint_cp"))


def test_a_state_is_latched_and_not_repeated_while_nothing_happens(robot):
    robot.tick(50)
    heard = robot.hear("operating_state")
    robot.tick(500)
    assert [one.message.state for one in heard.take()] == ["ENABLED"]


@pytest.mark.parametrize(
    ("step", "count", "reached"), [(0.001, 100, 0.1), (0.19, 1, 0.19)], ids=["streamed", "a single one"]
)
def test_servo_jp_is_followed(robot, step, count, reached):
    start = robot.setpoint
    for k in range(count):
        robot.joints("servo_jp", start + shoulder(step * (k + 1)))
        robot.tick()
    robot.tick(400)
    assert_allclose(robot.setpoint - start, shoulder(reached), atol=EXACT)


def test_a_client_that_stood_still_for_seconds_makes_no_joint_leap(robot, caplog):
    before = robot.setpoint
    for k in range(200):  # its reference went on at 0.3 rad/s meanwhile
        robot.joints("servo_jp", before + shoulder(0.9 + 0.0003 * k))
        robot.tick()
    robot.tick(300)
    assert_array_equal(robot.setpoint, before)
    assert robot.last("operating_state").state == "ENABLED"
    assert "shoulder is +0.9 rad from its setpoint, expected at most 0.2; move_jp goes farther" in caplog.text
    slide = np.zeros(7)
    slide[2] = 0.021
    robot.joints("servo_jp", before + slide)
    robot.tick(100)
    assert_array_equal(robot.setpoint, before)


def test_a_velocity_lapses_a_tenth_of_a_second_after_its_last_command(robot):
    before = robot.setpoint
    robot.say("servo_jv", JointState(velocity=shoulder(0.5)))
    robot.tick(500)
    assert_allclose(robot.setpoint - before, shoulder(0.05), atol=1e-3)  # a tick or two


def test_torques_lapse_into_holding(robot):
    robot.say("servo_jf", JointState(effort=np.zeros(7)))
    robot.tick(150)
    before = robot.setpoint
    robot.tick(300)
    assert_array_equal(robot.setpoint, before)


def test_gravity_compensation_holds_an_arm_that_zero_torque_lets_fall():
    fallen = []
    for compensated in (False, True):
        robot = ServedRobot("crtk", plant=homed_plant("left", robot=ROBOTS[0]))  # without friction
        robot.say("use_gravity_compensation", message_class("std_msgs/Bool")(data=compensated))
        start = robot.plant.state.q.copy()
        for _ in range(30):
            robot.say("servo_jf", JointState(effort=np.zeros(7)))
            robot.tick(20)
        fallen.append(abs(robot.plant.state.q - start)[2])
    # what is left: cables that the position control had stretched, and the tool, whose weight nobody knows
    assert fallen[1] < 0.5 * fallen[0]


def test_free_lets_go_until_hold(robot):
    robot.say("free", Empty())
    robot.tick(300)
    assert robot.plant.measured_js().tau[:3] == pytest.approx(0.0)
    robot.say("hold", Empty())
    robot.tick(2)
    before = robot.setpoint
    robot.tick(200)
    assert_array_equal(robot.setpoint, before)


def test_a_move_is_busy_until_it_arrives(robot):
    goal = robot.setpoint + np.array([0.3, -0.2, 0.02, 0.1, 0.0, 0.0, 0.0])
    robot.joints("move_jp", goal)
    robot.tick()
    assert robot.server.arms["gold"].state.is_busy
    ticks = 0
    while robot.server.arms["gold"].state.is_busy:
        robot.tick()
        ticks += 1
    assert 500 < ticks < 5000
    assert_allclose(robot.setpoint, goal, atol=EXACT)


@pytest.mark.parametrize("commands", [["hold"], ["pause", "resume"]])
def test_a_move_ends_for_good_by_hold_and_by_pausing(robot, commands):
    robot.joints("move_jp", robot.setpoint + shoulder(0.4))
    robot.tick(200)
    for command in commands:
        if command == "hold":
            robot.say("hold", Empty())
        else:
            robot.command(command)
        robot.tick(2)
    before = robot.setpoint
    robot.tick(300)
    assert_array_equal(robot.setpoint, before)
    assert not robot.server.arms["gold"].state.is_busy


def test_move_cp_arrives_with_all_joints_together_as_a_dvrk_does(robot):
    start = pose(robot)
    goal = Pose(rotation_from_rpy((0.1, 0.0, 0.0)) @ start.rotation, start.position + np.array([0.01, -0.01, -0.02]))
    robot.say("move_cp", pose_message(goal, 0, ""))
    robot.tick()
    before, at = robot.setpoint, []
    while robot.server.arms["gold"].state.is_busy:
        robot.tick(50)
        at.append(robot.setpoint)
    end = pose(robot)
    assert_allclose(end.position, goal.position, atol=1e-7)
    assert_allclose(end.rotation, goal.rotation, atol=1e-6)
    shares = (np.array(at) - before)[:, :3] / (robot.setpoint - before)[:3]
    assert_allclose(shares, shares[:, :1] * np.ones(3), atol=1e-3)  # of a first tick


def test_moves_keep_their_bounds_and_differentiate(robot):
    arm = robot.server.arms["gold"]
    start = arm.tool.pose(arm.setpoint.q)
    goal = Pose(rotation_from_rpy((0.2, 0.1, 0.0)) @ start.rotation, start.position + np.array([0.02, 0.0, -0.02]))
    for move in (joint_move(arm, arm.setpoint.q + shoulder(0.3))(), pose_move(arm, goal)()):
        h = 1e-5
        times = np.linspace(0.1, move.duration - 0.1, 50)
        _, qd, qdd = move.sample(times)
        before, after = move.sample(times - h), move.sample(times + h)
        assert_allclose(qd, (after[0] - before[0]) / (2 * h), atol=1e-6)  # central differences
        assert_allclose(qdd, (after[1] - before[1]) / (2 * h), atol=1e-3)
        assert (np.abs(qd) <= np.array([0.8, 0.8, 0.016, 0.8, 0.8, 0.8, 0.8]) * 1.001).all()
        assert_allclose(move(0.0).q, arm.setpoint.q, atol=1e-9)


def test_servo_cp_follows_a_client_that_streams(robot):
    start = pose(robot)
    for k in range(200):
        goal = start.position + np.array([0.0, 0.0, -5e-6 * (k + 1)])
        robot.say("servo_cp", pose_message(Pose(start.rotation, goal), 0, ""))
        robot.tick()
    robot.tick(5)
    assert_allclose(pose(robot).position, start.position + np.array([0.0, 0.0, -1e-3]), atol=1e-7)


def test_servo_cv_moves_the_tool_at_its_velocity(robot):
    twist, vector = message_class("geometry_msgs/Twist"), message_class("geometry_msgs/Vector3")
    start = pose(robot).position
    command = message_class("geometry_msgs/TwistStamped")(twist=twist(linear=vector(0.0, 0.0, -0.01)))
    for _ in range(100):
        robot.say("servo_cv", command)
        robot.tick()
    robot.say("hold", Empty())
    robot.tick(2)
    assert_allclose(pose(robot).position - start, [0.0, 0.0, -1e-3], atol=2e-5)  # two ticks


def test_jaws_open_by_their_own_verbs(robot):
    opening = robot.setpoint[5:].sum()
    robot.joints("jaw/servo_jp", [opening - 0.01])
    robot.tick(20)
    assert_allclose(robot.last("jaw/setpoint_js").position, [opening - 0.01], atol=1e-9)
    robot.joints("jaw/move_jp", [opening])
    robot.tick(800)
    assert_allclose(robot.last("jaw/setpoint_js").position, [opening], atol=1e-9)


def test_a_parked_arm_publishes_and_refuses(robot):
    assert_allclose(robot.last("measured_js", "green").position, robot.server.arms["green"].measured.q)
    robot.joints("servo_jr", shoulder(1e-3), arm="green")
    robot.tick(2)
    assert robot.server.reports.kinds["/arm2/servo_jr: refused"].count == 1


@pytest.mark.parametrize("verb", ["move_jp", "move_jr", "move_cp"])
def test_a_move_to_where_the_arm_is_is_busy_too(robot, verb):
    # CRTK's Python client waits for a busy state, then for one that is not, both newer than its command
    heard = robot.hear("operating_state")
    robot.tick(20)
    heard.take()
    if verb == "move_cp":
        robot.say(verb, pose_message(robot.server.arms["gold"].tool.pose(robot.setpoint), 0, "base"))
    else:
        robot.joints(verb, robot.setpoint if verb == "move_jp" else np.zeros(7))
    robot.tick(900)
    busy = [one.message.is_busy for one in heard.take()]
    assert busy[0]
    assert not busy[-1]
