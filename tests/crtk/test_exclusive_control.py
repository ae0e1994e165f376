"""Who commands an arm is one at a time, and the second is told who holds it."""

from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from catenary.crtk.client import CrtkClient
from catenary.crtk.exclusive_control import Commander
from catenary.crtk.loopback import Loopback
from catenary.crtk.message import header, message_class
from catenary.crtk.transport import UNNAMED_NODE, Connections
from catenary.errors import NotReadyError, RobotHeldError, TransportError
from catenary.raven2.topics import JOINTS
from catenary.simulation.cable_plant import UNITS
from catenary.topics import SECOND
from catenary.workflows.robot.motion import at_rest_afterwards, move_to
from oracles.crtk_robot import RobotOnLoopback
from oracles.ideal_plant import IdealPlant
from served_robot import JointState, ServedRobot, homing_plant, shoulder

EXACT = 1e-12
START = [0.5, 1.2, 0.4, 0.0, 0.1, 0.2, -0.2]


def second(robot: ServedRobot, verb: str = "servo_jr") -> Any:
    """Another program's publisher."""
    return Loopback("other", robot.network).publisher(robot.name(verb), "sensor_msgs/JointState")


def moved_by_second(robot: ServedRobot, other: Any) -> np.ndarray:
    """Send one command of another program's; return by how much the setpoint moved."""
    before = robot.setpoint
    other.publish(JointState(position=shoulder(2e-4)))
    robot.tick(3)
    return robot.setpoint - before


@pytest.mark.parametrize("dialect", ["raven", "crtk"])
def test_a_second_program_is_refused_and_told_who_holds_the_arm(dialect: Any) -> None:
    robot = ServedRobot(dialect)
    before, told, other = robot.setpoint, robot.hear("warning"), second(robot)
    for _ in range(50):
        robot.joints("servo_jr", shoulder(1e-4))
        robot.tick()
        other.publish(JointState(position=shoulder(2e-4)))
        robot.tick()
    robot.tick(5)
    assert_allclose(robot.setpoint - before, shoulder(50e-4), atol=EXACT)
    assert "refused: other has to wait: client holds the arm (/arm1/servo_jr)" in told.take()[0].message.data


def test_the_arm_is_free_half_a_second_after_the_last_command() -> None:
    robot = ServedRobot()
    other = second(robot)
    robot.joints("servo_jr", shoulder(1e-4))
    robot.tick(450)
    assert_array_equal(moved_by_second(robot, other), 0.0)
    robot.tick(100)
    assert_allclose(moved_by_second(robot, other), shoulder(2e-4), atol=EXACT)


def test_commands_that_came_in_one_tick_are_told_apart() -> None:
    robot = ServedRobot()
    other = second(robot)
    robot.joints("servo_jr", shoulder(1e-4))
    robot.tick(2)
    before = robot.setpoint
    other.publish(JointState(position=shoulder(2e-4)))
    robot.joints("servo_jr", shoulder(1e-5))  # the tick's last one comes from whom the arm is held by
    robot.tick(3)
    assert_allclose(robot.setpoint - before, shoulder(1e-5), atol=EXACT)


@pytest.mark.parametrize("seen", [False, True], ids=["in the first tick", "later"])
def test_time_in_which_the_server_stood_still_frees_no_arm(seen: bool) -> None:
    robot = ServedRobot()
    other = second(robot)
    robot.tick(200)
    robot.joints("servo_jr", shoulder(1e-4))
    robot.tick(2)
    robot.clock.sleep(2.0)
    robot.tick(100 if seen else 0)
    assert_array_equal(moved_by_second(robot, other), 0.0)
    robot.tick(600)
    assert_allclose(moved_by_second(robot, other), shoulder(2e-4), atol=EXACT)


def test_a_move_is_not_taken_over_but_anybody_may_stop_it() -> None:
    robot = ServedRobot("crtk")
    carrier = Loopback("other", robot.network)
    moves, holds = (
        carrier.publisher(robot.name(verb), kind)
        for verb, kind in (("move_jr", "sensor_msgs/JointState"), ("hold", "std_msgs/Empty"))
    )
    robot.joints("move_jr", shoulder(0.5))
    robot.tick(700)  # longer than the half second: its move is under way
    moves.publish(JointState(position=shoulder(-0.5)))
    robot.tick(5)
    assert robot.plant.setpoint_js().q[0] > robot.plant.measured_js().q[0] - 0.1
    assert robot.server.arms["gold"].state.is_busy
    holds.publish(message_class("std_msgs/Empty")())
    robot.tick(5)
    assert not robot.server.arms["gold"].state.is_busy


def client_of(robot: RobotOnLoopback, name: str) -> CrtkClient:
    return CrtkClient(Loopback(name, robot.network))


def robot_at_start() -> RobotOnLoopback:
    """A robot that obeys whoever commands, as a RAVEN-II does."""
    return RobotOnLoopback(IdealPlant(START, joint_names=JOINTS, joint_units=UNITS))


def test_a_client_refuses_to_begin_while_another_program_moves_the_arm() -> None:
    robot = robot_at_start()
    first, other = client_of(robot, "first"), client_of(robot, "second")
    first.servo_jr(np.full(7, 1e-3))
    first.wait()
    with pytest.raises(RobotHeldError, match=r"first holds the arm: it commanded /arm1/servo_jp 0\.\d\d s ago"):
        other.require_free()
    with pytest.raises(NotReadyError, match="first holds the arm"):
        other.servo_jp(START)
    commands = robot.robot.commands
    for _ in range(10):
        other.wait()
    assert robot.robot.commands == commands
    first.wait()
    robot.transport.sleep(0.6)
    other.require_free()
    other.servo_jp(START)


def test_the_one_that_is_refused_in_mid_motion_ends_without_pausing_the_other() -> None:
    served = ServedRobot("crtk", state="ENABLED")
    served.tick_while_slept()
    mine = CrtkClient(Loopback("mine", served.network), dialect="crtk")
    rival = Loopback("rival", served.network).publisher(served.name("servo_jp"), "sensor_msgs/JointState")
    mine.require_free()
    rival.publish(JointState(position=served.setpoint))  # both listened at the same time; the rival was first
    served.clock.sleep(0.002)

    def rival_goes_on(*_: Any) -> None:
        rival.publish(JointState(position=served.setpoint))

    with pytest.raises(RobotHeldError, match="rival holds the arm"), at_rest_afterwards(mine):
        move_to(mine, served.setpoint + shoulder(0.2), observe=rival_goes_on)
    assert served.state() == "ENABLED"


TOPICS = {"raven": ("servo_jr", shoulder(1e-4)), "crtk": ("move_jr", shoulder(0.5))}


def moved(dialect: str = "raven", *, ticks: int = 20) -> tuple[ServedRobot, Loopback]:
    """A robot, and a program that is moving it."""
    robot = ServedRobot(dialect)
    program = Loopback("program", robot.network)
    verb, values = TOPICS[dialect]
    publisher = program.publisher(robot.name(verb), "sensor_msgs/JointState")
    robot.tick(150)
    if dialect == "crtk":
        publisher.publish(JointState(position=values))
        robot.tick(ticks)
        return robot, program
    for _ in range(ticks):
        publisher.publish(JointState(position=values))
        robot.tick()
    return robot, program


def publisher_of(robot: ServedRobot) -> Any:
    return robot.network.publishers(robot.name("servo_jr"))["program"]


def old_commands(robot: ServedRobot, count: int = 200) -> None:
    """Commands that were stamped when the server stood still, and are read late."""
    for _ in range(count):
        publisher_of(robot).publish(JointState(header(robot.clock.now() - 3 * SECOND), (), shoulder(1e-4)))
        robot.tick(5)


# what happens after a program has moved the arm: "goes", "stall SECONDS" (the server is stopped, or its computer
# suspended), "old commands", or ticks; then the state in which the arm is left
STORIES = {
    "left in mid-motion": ("goes, 3150", "PAUSED"),
    "left for less than three seconds": ("goes, 2900", "ENABLED"),
    "a program that stays and says nothing": ("4000", "ENABLED"),
    "ended behind its motion": ("700, goes, 4000", "ENABLED"),
    "gone while the server stood still": ("stall 0.4, goes, 3200", "PAUSED"),
    "gone while it stood still for long": ("stall 3600, goes, 3200", "PAUSED"),
    "not yet missed after that": ("stall 12, goes, 2900", "ENABLED"),
    "at rest before the server stood still": ("5000, stall 3, goes, 4000", "ENABLED"),
    "refused commands are signs of life": ("old commands, goes, 3300", "PAUSED"),
    "the clock set back": ("set -3600, goes, 3300", "PAUSED"),
    "the clock set on": ("set 1, goes, 3300", "PAUSED"),
}
# over DDS nobody hears of a kill before the lease of ten seconds has run out; an end is told at once
STORIES_OVER_DDS = {
    "missed at once": ("50, goes, 3300", "PAUSED"),
    "missed after its lease": ("10200, goes, 3300", "PAUSED"),
    "ended behind its motion": ("5000, goes, 3300", "ENABLED"),
    "at rest for longer than the lease": ("13000, goes, 3300", "ENABLED"),
    "killed while the server stood still": ("stall 3, 7100, goes, 3300", "PAUSED"),
    "the lease ran out while it stood still": ("stall 11, 100, goes, 3300", "PAUSED"),
    "and long before": ("stall 25, 100, goes, 3300", "PAUSED"),
    "a command that waited while it stood still is no younger": ("stall 3, an old command, 7000, goes, 3300", "PAUSED"),
}


def told(story: str, dialect: str = "raven") -> ServedRobot:
    """A robot after a story."""
    robot, program = moved(dialect)
    for event in story.split(", "):
        word, _, number = event.partition(" ")
        if word == "goes":
            program.close()
        elif word == "stall":
            robot.clock.sleep(float(number))
        elif word == "set":
            robot.clock.ahead = int(number) * SECOND
        elif word == "old":
            old_commands(robot)
        elif word == "an":
            old_commands(robot, 1)
        else:
            robot.later(int(word))
    return robot


@pytest.mark.parametrize("network", [STORIES, STORIES_OVER_DDS], ids=["at once", "over DDS"])
def test_an_arm_is_paused_whose_program_goes_in_the_middle_of_a_motion(monkeypatch, network) -> None:
    if network is STORIES_OVER_DDS:
        monkeypatch.setattr(Loopback, "lapses", (0, 10 * SECOND, 20 * SECOND))
    assert {name: told(story).state() for name, (story, _) in network.items()} == {
        name: state for name, (_, state) in network.items()
    }


def test_an_arm_that_was_paused_is_told_of_and_obeys_whoever_comes_next() -> None:
    robot = told("goes, 3150", "crtk")  # with a move of its own under way
    assert robot.state() == "PAUSED"
    assert "program was moving it and has disconnected" in robot.server.reports.kinds["gold: paused"].text
    robot.command("resume")
    robot.later(500)
    assert robot.state() == "ENABLED"


def test_increments_end_with_the_program_that_sent_them() -> None:
    robot = told("goes, 250")
    held = robot.setpoint
    robot.later(1000)
    assert_array_equal(robot.setpoint, held)


def test_another_program_takes_over() -> None:
    robot = told("goes, 1000")
    robot.joints("servo_jr", shoulder(1e-4))
    robot.later(4000)
    assert robot.state() == "ENABLED"


def test_a_connection_that_is_made_again_in_time_changes_nothing() -> None:
    robot, program = moved()
    publisher_of(robot).is_connected = False
    robot.later(2000)
    publisher_of(robot).is_connected = True
    robot.later(4000)
    assert robot.state() == "ENABLED"
    assert program.is_up()


def test_commands_that_are_refused_keep_no_other_program_out() -> None:
    robot = told("old commands")
    begin = robot.setpoint
    robot.joints("servo_jr", shoulder(1e-3))
    robot.tick(10)
    assert robot.setpoint[0] == pytest.approx(begin[0] + 1e-3)


def test_a_program_that_crashes_leaves_its_arm_paused_also_when_it_was_silent_before(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Stopped (SIGSTOP) in the middle of a motion, then killed: ROS 1's master goes on listing it."""
    monkeypatch.setattr(Loopback, "lost", lambda self, topic: frozenset({"program"}))
    assert told("5000, goes, 3300").state() == "PAUSED"


@pytest.mark.parametrize("lapse", [0.0, 10.0])
def test_commands_that_wait_count_from_when_they_came(monkeypatch: pytest.MonkeyPatch, lapse: float) -> None:
    """On a busy machine a program is killed a second before its last command is looked at."""
    monkeypatch.setattr(Loopback, "lapses", (0, 10 * SECOND, 20 * SECOND))
    robot, program = moved()
    for _ in range(1000):
        publisher_of(robot).publish(JointState(position=shoulder(1e-6)))
    ticks = round(lapse * 200)
    for k in range(ticks + 700):
        if k == ticks:
            program.close()
        robot.clock.sleep(0.005)
        robot.server.tick()
    assert robot.state() == "PAUSED"


class LateNames(Loopback):
    """A network that has learnt by now what the node of a program is called, as DDS does."""

    def connections(self, topic: str) -> Connections:
        return Connections(("/lab",), ())

    def publishing(self) -> dict[str, frozenset[str]]:
        return {"/move_jp": frozenset({"/lab 01f"})}


def test_a_program_whose_nodes_name_comes_late_is_the_same_one_and_has_not_gone() -> None:
    commander = Commander(LateNames("robot"))
    commander.commands("/move_jp", f"{UNNAMED_NODE}01f 01f", 0)
    for now in range(0, 5 * SECOND, SECOND // 10):
        assert commander.left(now, is_moving=True) is None
    commander.require_free("/lab 01f", SECOND, is_moving=True)
    with pytest.raises(RobotHeldError):
        commander.require_free("/other 02e", SECOND, is_moving=True)


@pytest.mark.parametrize("dialect", ["raven", "crtk"])
@pytest.mark.parametrize("arm", ["gold", "green"])
def test_a_robot_beside_another_of_its_name_stands_paused_until_that_one_is_gone(dialect: Any, arm: Any) -> None:
    robot, _ = moved(dialect)
    told = robot.hear("warning")
    rival = Loopback("rival", robot.network)
    topic = robot.name("measured_js", arm)
    rival.publisher(topic, "sensor_msgs/JointState")
    robot.tick(110)
    assert robot.state() == "PAUSED"
    held = robot.setpoint
    for command in ("resume", "enable", "home"):
        robot.command(command)
        robot.joints("servo_jr", shoulder(1e-3))
        robot.tick(5)
    assert all("two robots of one name" in said for said in robot.server.press_button())
    assert robot.state() == "PAUSED"
    assert_array_equal(robot.setpoint, held)
    said = [one.message.data for one in told.take()]
    assert f"robot: paused: {topic} is published by rival: two robots of one name would both obey; end one" in said
    robot.command("disable")  # which anybody may at any time
    robot.tick(5)
    assert robot.state() == "DISABLED"
    rival.close()
    robot.tick(110)
    robot.command("enable") if dialect == "crtk" else robot.server.press_button()
    robot.command("resume")
    robot.tick(5)
    assert robot.state() == "ENABLED"


def test_a_robot_that_is_homing_is_stopped_beside_another_of_its_name() -> None:
    robot = ServedRobot(plant=homing_plant())
    robot.server.press_button()
    robot.tick(20)
    assert robot.server.arms["gold"].state.is_busy
    Loopback("rival", robot.network).publisher(robot.name("measured_js"), "sensor_msgs/JointState")
    robot.tick(500)
    assert robot.state() == "PAUSED"


def test_a_motion_ends_and_the_robots_are_paused_where_a_second_one_is_heard() -> None:
    robot = robot_at_start()
    mine = client_of(robot, "mine")
    mine.require_free()
    rival = Loopback("rival", robot.network).publisher("/arm2/measured_js", "sensor_msgs/JointState")

    def second_is_heard(*_: Any) -> None:
        if robot.robot.commands > 50:
            rival.publish(JointState(name=JOINTS, position=START))

    with pytest.raises(TransportError, match="two robots of one name"), at_rest_afterwards(mine):
        move_to(mine, np.add(START, shoulder(0.2)), observe=second_is_heard)
    assert robot.robot.plant.operating_state().state == "PAUSED"
    assert robot.robot.commands < 60
