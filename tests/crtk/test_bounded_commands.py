"""Messages of any content to a served robot: it goes on, within its bounds, and says what it refuses."""

from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from catenary.crtk.message import codec, message_class
from catenary.crtk.message_values import command_message, pose_message, pose_of
from catenary.crtk.serving.command_source import TOPIC_COMMANDS_A_TICK
from catenary.crtk.serving.server import _COMMAND_COST_A_TICK, _STOPPING_VERBS
from catenary.crtk.topic_names import COMMAND
from catenary.spatial import Pose
from odd_messages import likely_message
from served_robot import JointState, ServedRobot, shoulder
from tests.campaign.parts.messages import messages

QUATERNION, TRANSFORM = (message_class(f"geometry_msgs/{name}") for name in ("Quaternion", "Transform"))


def said(robot: ServedRobot, verb: str, message: Any) -> list[str]:
    """What an arm warns of after a command."""
    heard = robot.hear("warning")
    robot.say(verb, message)
    robot.tick(20)
    lines = [one.message.data for one in heard.take()]
    heard.close()
    return lines


def a_pose(robot: ServedRobot) -> Pose:
    """Where the tool is set to be."""
    return pose_of(robot.last("setpoint_cp"))


@pytest.mark.parametrize("distance", [1e3, 1e300])
@pytest.mark.parametrize("verb", ["move_cp", "move_cr"])
def test_a_move_beyond_the_arms_reach_is_refused_at_once_with_distance_and_reach(verb, distance):
    robot = ServedRobot("crtk")
    goal = Pose(np.eye(3), np.array([0.0, distance, 0.0]))
    before = robot.setpoint
    for _ in range(2):  # each time
        (line,) = said(robot, verb, pose_message(goal, 0, ""))
        assert f"/arm1/{verb}: refused" in line
        assert "from the base, expected at most" in line
    assert_array_equal(robot.setpoint, before)


def test_a_pose_beyond_the_joints_range_is_refused_before_anything_moves():
    robot = ServedRobot("crtk")
    arm = robot.server.arms["gold"]
    start = arm.tool.pose(arm.setpoint.q)
    goal = Pose(start.rotation, start.position + np.array([0.0, 0.0, -0.25]))
    before = robot.setpoint
    (line,) = said(robot, "move_cp", pose_message(goal, 0, ""))
    assert "insertion" in line
    assert_array_equal(robot.setpoint, before)
    assert not arm.state.is_busy


def test_a_quaternion_of_a_rounded_length_is_normalised():
    robot = ServedRobot("crtk")
    start = a_pose(robot)
    message = pose_message(start, 0, "")
    longer = QUATERNION(*(1.005 * np.array(message.pose.orientation)))
    assert said(robot, "servo_cp", message._replace(pose=message.pose._replace(orientation=longer))) == []
    np.testing.assert_allclose(a_pose(robot).rotation, start.rotation, atol=1e-9)


def test_automove_refuses_a_quaternion_that_is_none():
    robot = ServedRobot("raven")
    turns = (TRANSFORM(rotation=QUATERNION(0.0, 0.0, 3.0, 4.0)), TRANSFORM())
    robot.say("raven_automove", message_class("raven_2/raven_automove")(tf_incr=turns), arm=None)
    robot.tick(2)
    assert "expected length 1, got 5" in robot.server.reports.kinds["/raven_automove: refused"].text


def test_a_push_beyond_a_soft_limit_is_held_and_said():
    robot = ServedRobot("crtk")
    arm = robot.server.arms["gold"]
    heard = robot.hear("warning")
    for _ in range(25):
        robot.say("servo_jf", JointState(effort=shoulder(-1e300)))
        robot.tick(50)
    assert arm.lower[0] - 0.02 < arm.measured.q[0] < arm.lower[0] + 0.05
    assert 'limited: joint "shoulder": torque -1e+300 requested' in heard.take()[0].message.data
    assert arm.state.state == "ENABLED"


@pytest.mark.parametrize("message", [
    JointState(name=("x",) * 100_000), JointState(position=np.zeros(500_000)), JointState(name=("x" * 3_000_000,)),
], ids=["names", "numbers", "a name"])  # fmt: skip
def test_messages_too_large_for_a_command_are_dropped_undecoded_and_counted(message):
    robot = ServedRobot("crtk")
    source = next(one for one in robot.server._sources if one.topic.name == "/arm1/servo_jp")
    source._subscription._decode = None  # type: ignore[assignment]
    robot.say("servo_jp", message)
    robot.tick(150)
    report = robot.server.reports.kinds["/arm1/servo_jp: too large"]
    assert report.text == "1 commands of more than 2048 bytes dropped"


@pytest.mark.parametrize("dialect", ["raven", "crtk"])
def test_a_flood_on_all_topics_is_taken_in_a_few_messages_a_tick(dialect):
    robot = ServedRobot(dialect)
    rng = np.random.default_rng(1)
    arm, now = robot.server.arms["gold"], robot.clock.now()
    flooded = [one for one in robot.server._sources if one.topic.verb not in _STOPPING_VERBS]
    for source in flooded:
        topic = source.topic
        message = command_message("resume", 0) if topic.type == COMMAND else likely_message(rng, topic, arm)
        data = codec(topic.type).encode(message, 0)
        for _ in range(1100):
            source._subscription.push(data, now)
    costs = {source.topic.name: source.cost for source in flooded}
    taken: list[str] = []
    obey = robot.server._obey
    robot.server._obey = lambda source, *rest: (taken.append(source.topic.name), obey(source, *rest))  # type: ignore[method-assign]
    seen = set()
    for _ in range(130):
        taken.clear()
        robot.tick()
        assert 0 < sum(costs[name] for name in taken) <= _COMMAND_COST_A_TICK
        assert max(map(taken.count, taken)) <= TOPIC_COMMANDS_A_TICK
        seen |= set(taken)
    # none keeps another out
    assert seen >= {source.topic.name for source in flooded if source.topic.arm == "gold"}
    lost = [report for kind, report in robot.server.reports.kinds.items() if kind.endswith("lost")]
    assert [report.text for report in lost] == ["100 commands"] * len(flooded)


def test_what_waits_in_a_flood_does_not_outlive_hold_or_pause():
    for stop in ("hold", "pause"):
        robot = ServedRobot("crtk")
        for k in range(300):
            robot.joints("servo_jp", robot.setpoint + shoulder(-1e-3 * k))
        robot.tick(5)
        if stop == "hold":
            robot.say("hold", message_class("std_msgs/Empty")())
        else:
            robot.command("pause")
            robot.command("resume")
        robot.tick(2)
        before = robot.setpoint
        robot.tick(200)
        assert_array_equal(robot.setpoint, before)
        report = robot.server.reports.kinds["/arm1/servo_jp: refused"]
        assert report.count > 200


@pytest.mark.parametrize("dialect", ["raven", "crtk"])
def test_no_message_of_any_content_ends_a_server_or_moves_an_arm_that_is_not_ready_or_out_of_its_limits(
    dialect, tmp_path
):
    for seed in range(2):
        messages(dialect, seed, tmp_path)
