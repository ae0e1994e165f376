"""Messages of any content to a served robot: it goes on, within its bounds, and says what it refuses."""

from time import process_time
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from numpy.testing import assert_array_equal

from catenary.crtk.codec import most_bytes
from catenary.crtk.conversions import pose_message, pose_of
from catenary.crtk.message import Message, message_class
from catenary.crtk.names import Dialect, topics
from catenary.recording.messages import NUMBERS, TIMES, Field, fields
from catenary.spatial import Pose
from served_robot import JointState, ServedRobot, shoulder

ODD = [0.0, 1.0, -1.0, 1e-3, 0.5, np.nan, np.inf, -np.inf, 1e300, -1e300, 1e-300, 5e-324, 1e9]
LENGTHS = [0, 1, 2, 6, 7, 8, 15, 32, 100_000]
WORDS = ["", "shoulder", "insertion", "jaw1", "home", "resume", "pause", "\x1b[2J", "é" * 60, "x" * 2_000_000]
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
    robot.server.arms["gold"].tool.path = None  # type: ignore[method-assign]  # no way is worked out
    before = robot.setpoint
    lines = said(robot, verb, pose_message(goal, 0, ""))
    assert len(lines) == 1
    assert f"/arm1/{verb}: refused" in lines[0]
    assert "from the base, expected at most" in lines[0]
    assert_array_equal(robot.setpoint, before)


def test_each_move_that_is_refused_is_said_to_its_sender():
    robot = ServedRobot("crtk")
    for _ in range(3):
        (line,) = said(robot, "move_jp", JointState(position=robot.setpoint + shoulder(3.0)))
        assert 'joint "shoulder"' in line


def test_a_straight_way_that_the_mechanism_cannot_follow_is_refused_before_anything_moves():
    robot = ServedRobot("crtk")
    arm = robot.server.arms["gold"]
    start = arm.tool.pose(arm.setpoint.q)
    goal = Pose(
        start.rotation, start.position + np.array([0.0, 0.0, -0.25])
    )  # 125 pieces, out of the insertion's range
    before = robot.setpoint
    (line,) = said(robot, "move_cp", pose_message(goal, 0, ""))
    assert "insertion" in line
    assert_array_equal(robot.setpoint, before)
    assert not arm.state.is_busy


@pytest.mark.parametrize(
    "quaternion",
    [(0.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 2.0), (np.nan, 0.0, 0.0, 1.0), (1e300, 0.0, 0.0, 0.0)],
)
def test_quaternions_that_are_none_are_refused(quaternion):
    robot = ServedRobot("crtk")
    message = pose_message(a_pose(robot), 0, "")
    message = message._replace(pose=message.pose._replace(orientation=QUATERNION(*quaternion)))
    (line,) = said(robot, "servo_cp", message)
    assert "quaternion" in line


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
    assert 'limited: joint "shoulder": torque -1e+300 asked for' in heard.take()[0].message.data
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
    assert report.text == f"1 commands of more than {source._subscription.largest} bytes dropped"


def test_largest_message_of_a_type_is_that_of_its_definition():
    # header: seq, time, text; then texts and three times numbers, each behind their count
    assert most_bytes("sensor_msgs/JointState", 4, 10) == 4 + 8 + 14 + 4 + 4 * 14 + 3 * (4 + 4 * 8)
    assert most_bytes("geometry_msgs/PoseStamped", 4, 10) == 4 + 8 + 14 + 7 * 8


@st.composite
def messages(draw: st.DrawFn, name: str) -> Message:
    """Any message of a type."""
    return message_class(name)(*(draw(_values(field)) for field in fields(name)))


def _values(field: Field) -> st.SearchStrategy[Any]:
    if field.type in NUMBERS:
        kind = np.dtype(NUMBERS[field.type])
        if field.type == "bool":
            single: st.SearchStrategy[Any] = st.booleans()
        elif kind.kind == "f":
            single = st.sampled_from(ODD)
        else:
            single = st.sampled_from([0, 1, np.iinfo(kind).min, np.iinfo(kind).max]).map(int)
        if field.length is None:
            return single
        lengths = st.just(field.length) if field.length else st.sampled_from(LENGTHS)
        cycle = st.lists(single, min_size=1, max_size=7)
        return st.builds(lambda n, some: np.resize(np.array(some, dtype=kind), n), lengths, cycle)
    if field.length is not None:
        one = _values(field._replace(length=None))
        lengths = st.just(field.length) if field.length else st.sampled_from([0, 1, 7, 32, 3_000])
        return st.builds(_repeated, lengths, st.lists(one, min_size=1, max_size=7).map(tuple))
    if field.type in TIMES:
        return st.sampled_from([0, 1, 1_700_000_000 * 10**9, 4 * 10**18])
    return st.sampled_from(WORDS) if field.type == "string" else messages(field.type)


def _repeated(count: int, some: tuple[Any, ...]) -> tuple[Any, ...]:
    """Repeat values in turn; long texts are cut where there are many, which took 20 GB to encode."""
    short = [one[:1000] if isinstance(one, str) and count > 7 else one for one in some]
    return tuple((short * count)[:count])


@pytest.fixture(scope="module", params=["raven", "crtk"])
def long_lived(request) -> ServedRobot:
    """One robot that hears all messages of the test below."""
    robot = ServedRobot(request.param)
    robot.server.arms["gold"].tool.prepare()
    here = robot.server.arms["gold"].tool.pose(robot.setpoint)
    for verb in ("servo_cp", "servo_cr", "servo_jp", "servo_jr", "servo_jf", "move_cp")[
        : 6 if robot.dialect == "crtk" else 4
    ]:
        if "c" in verb[-2:]:
            robot.say(verb, pose_message(here, 0, "", child=None if robot.dialect == "crtk" else "tool"))
        else:
            robot.say(verb, JointState(position=robot.setpoint, effort=np.zeros(7)))
        robot.tick(20)  # what is compiled is compiled now
    return robot


@settings(max_examples=30, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_no_message_of_any_content_ends_a_server_or_moves_a_setpoint_out_of_its_limits(long_lived, data):
    robot = long_lived
    dialect: Dialect = robot.dialect
    topic = data.draw(
        st.sampled_from([one for one in topics(dialect) if one.direction == "in"]), label="topic"
    )
    served = {one.topic.name for one in robot.server._sources}
    message = data.draw(messages(topic.type), label="message")
    arm = robot.server.arms["gold"]
    for command in ("enable", "resume"):  # it may have been disabled
        robot.command(command)
    if not robot.plant.operating_state().is_homed:
        robot.plant._is_homed = True
        robot.plant._set_state("ENABLED")
    counted, start = _noticed(robot), process_time()
    robot.say(topic.verb, message, topic.arm)
    robot.tick(5)
    assert process_time() - start < 2.0  # five ticks: some 5 ms, and what the sender needs for megabytes
    q = robot.setpoint
    slack = (
        0.0 if arm._torque is None and arm._until < arm.tick - 200 else 0.1
    )  # it follows an arm that is pushed
    assert np.isfinite(q).all()
    assert np.isfinite(arm.measured.q).all()
    assert ((arm.lower - slack - 1e-9 <= q) & (q <= arm.upper + slack + 1e-9)).all()
    if topic.name in served and _noticed(robot) == counted:
        robot.tick(100)  # what was dropped is reported ten times a second
        assert _noticed(robot) > counted


def _noticed(robot: ServedRobot) -> int:
    return robot.server.commands + sum(report.count for report in robot.server.reports.kinds.values())
