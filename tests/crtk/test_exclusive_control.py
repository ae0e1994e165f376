"""Who commands an arm is one at a time, and the second is told who holds it."""

from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from catenary.crtk.client import CrtkClient
from catenary.crtk.clock import SECOND
from catenary.crtk.loopback import Loopback
from catenary.crtk.message import header, message_class
from catenary.crtk.reader import CrtkReader
from catenary.errors import NotReadyError, RobotHeldError
from catenary.raven2.topics import JOINTS
from catenary.simulation.cable_plant import UNITS
from catenary.workflows.robot.motion import at_rest_afterwards, move_to
from oracles.crtk_robot import RobotOnLoopback
from oracles.ideal_plant import IdealPlant
from served_robot import JointState, ServedRobot, shoulder

EXACT = 1e-12
START = [0.5, 1.2, 0.4, 0.0, 0.1, 0.2, -0.2]


def second(robot: ServedRobot, verb: str = "servo_jr") -> Any:
    """Another program's publisher."""
    return Loopback("other", robot.network).publisher(robot.name(verb), "sensor_msgs/JointState")


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
    before = robot.setpoint
    other.publish(JointState(position=shoulder(2e-4)))
    robot.tick(3)
    assert_array_equal(robot.setpoint, before)
    robot.tick(100)
    other.publish(JointState(position=shoulder(2e-4)))
    robot.tick(3)
    assert_allclose(robot.setpoint - before, shoulder(2e-4), atol=EXACT)


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
    served.clock.sleep(0.0)

    original = served.clock.sleep

    def sleep(seconds: float) -> None:
        for _ in range(max(1, round(seconds * 1000))):
            original(0.001)
            served.server.tick()

    served.clock.sleep = sleep  # type: ignore[method-assign]
    mine = CrtkClient(Loopback("mine", served.network), dialect="crtk")
    rival = Loopback("rival", served.network).publisher(served.name("servo_jp"), "sensor_msgs/JointState")
    mine.require_free()
    rival.publish(JointState(position=served.setpoint))  # both listened at the same time; the rival was first
    sleep(0.002)

    def rival_goes_on(*_: Any) -> None:
        rival.publish(JointState(position=served.setpoint))

    with pytest.raises(RobotHeldError, match="rival holds the arm"), at_rest_afterwards(mine):
        move_to(mine, served.setpoint + shoulder(0.2), observe=rival_goes_on)
    assert served.state() == "ENABLED"


def test_one_that_only_reads_advertises_nothing_and_needs_no_listener() -> None:
    robot = robot_at_start()
    reader = CrtkReader(Loopback("reader", robot.network))
    assert not [t for t in robot.network.topics.values() if "reader" in t.publishers]
    assert_allclose(reader.measured_js().q, START)
    with pytest.raises(Exception, match="this robot is only read"):
        reader.servo_jp(START)


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


@pytest.mark.parametrize("dialect", ["raven", "crtk"])
def test_an_arm_that_is_left_in_the_middle_of_a_motion_is_paused(dialect: str) -> None:
    robot, program = moved(dialect)
    program.close()
    robot.tick(2900)
    assert robot.state() == "ENABLED"
    robot.tick(250)
    assert robot.state() == "PAUSED"
    assert "program moved it and is gone" in robot.server.reports.kinds["gold: paused"].text
    robot.command("resume")  # whoever comes next
    robot.tick(500)
    assert robot.state() == "ENABLED"


def test_increments_end_with_the_program_that_sent_them() -> None:
    robot, program = moved()
    program.close()
    robot.tick(250)
    held = robot.setpoint
    robot.tick(1000)
    assert_array_equal(robot.setpoint, held)


def test_a_program_that_stays_and_says_nothing_leaves_its_arm_enabled() -> None:
    robot, _ = moved()
    robot.tick(4000)
    assert robot.state() == "ENABLED"


def test_a_program_that_ends_behind_its_motion_leaves_its_arm_enabled() -> None:
    robot, program = moved()
    robot.tick(700)
    program.close()
    robot.tick(4000)
    assert robot.state() == "ENABLED"


def test_another_program_takes_over() -> None:
    robot, program = moved()
    program.close()
    robot.tick(1000)
    robot.joints("servo_jr", shoulder(1e-4))
    robot.tick(4000)
    assert robot.state() == "ENABLED"


def test_a_connection_that_is_made_again_in_time_changes_nothing() -> None:
    robot, program = moved()
    publisher = robot.network.topics[robot.name("servo_jr")].publishers["program"]
    publisher.is_connected = False
    robot.tick(2000)
    publisher.is_connected = True
    robot.tick(4000)
    assert robot.state() == "ENABLED"
    assert program.is_up()


@pytest.mark.parametrize(
    ("rested_ms", "state"), [(50, "PAUSED"), (10_200, "PAUSED"), (5_000, "ENABLED"), (13_000, "ENABLED")]
)
def test_a_killed_program_that_is_missed_after_its_lease_leaves_its_arm_paused(
    monkeypatch: pytest.MonkeyPatch, rested_ms: int, state: str
) -> None:
    """Over DDS nobody hears of a kill before the lease of ten seconds has run out; an end is told at once."""
    monkeypatch.setattr(Loopback, "lapses", (0, 10 * SECOND, 20 * SECOND))
    robot, program = moved()
    robot.tick(rested_ms)
    program.close()
    robot.tick(3300)
    assert robot.state() == state


def stalled(robot: ServedRobot, seconds: float) -> None:
    """Time passes, and the server does nothing: it is stopped, or its computer suspended."""
    robot.clock.sleep(seconds)


@pytest.mark.parametrize("seconds", [0.4, 3.0, 12.0, 3600.0])
@pytest.mark.parametrize("dialect", ["raven", "crtk"])
def test_an_arm_whose_program_went_while_the_server_stood_still_is_paused(dialect: str, seconds: float) -> None:
    robot, program = moved(dialect)
    stalled(robot, seconds)
    program.close()
    robot.tick(2900)
    assert robot.state() == "ENABLED"
    robot.tick(300)
    assert robot.state() == "PAUSED"


@pytest.mark.parametrize(("killed_after", "seconds"), [(0.1, 3.0), (0.1, 11.0), (0.1, 25.0)])
def test_over_dds_an_arm_whose_program_was_killed_while_the_server_stood_still_is_paused(
    monkeypatch: pytest.MonkeyPatch, killed_after: float, seconds: float
) -> None:
    """The lease of ten seconds runs on meanwhile, and is looked at when the server goes on."""
    monkeypatch.setattr(Loopback, "lapses", (0, 10 * SECOND, 20 * SECOND))
    robot, program = moved()
    stalled(robot, seconds)
    robot.tick(max(100, round(1000 * (10.0 + killed_after - seconds))))
    program.close()
    robot.tick(3300)
    assert robot.state() == "PAUSED"


@pytest.mark.parametrize("by", [-3600, -1, 1, 3600])
def test_an_arm_whose_program_goes_is_paused_also_where_the_clock_is_set(by: int) -> None:
    robot, program = moved()
    robot.clock.ahead = by * SECOND
    program.close()
    robot.tick(3300)
    assert robot.state() == "PAUSED"


def test_a_program_that_lets_its_arm_rest_before_the_server_stands_still_leaves_it_enabled() -> None:
    robot, program = moved()
    robot.tick(5000)
    stalled(robot, 3.0)
    program.close()
    robot.tick(4000)
    assert robot.state() == "ENABLED"


def test_commands_that_are_refused_are_signs_of_life() -> None:
    robot, program = moved()
    publisher = robot.network.topics[robot.name("servo_jr")].publishers["program"]
    for _ in range(200):  # stamped when the server stood still, and read late
        publisher.publish(JointState(header(robot.clock.now() - 3 * SECOND), (), shoulder(1e-4)))
        robot.tick(5)
    program.close()
    robot.tick(3300)
    assert robot.state() == "PAUSED"


def test_commands_that_are_refused_keep_no_other_program_out() -> None:
    robot, program = moved()
    publisher = robot.network.topics[robot.name("servo_jr")].publishers["program"]
    begin = robot.setpoint
    for _ in range(200):
        publisher.publish(JointState(header(robot.clock.now() - 3 * SECOND), (), shoulder(1e-4)))
        robot.tick(5)
    robot.joints("servo_jr", shoulder(1e-3))
    robot.tick(10)
    assert robot.setpoint[0] == pytest.approx(begin[0] + 1e-3)
    assert program.is_up()


def test_a_program_that_crashes_leaves_its_arm_paused_also_when_it_was_silent_before(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Stopped (SIGSTOP) in the middle of a motion, then killed: ROS 1's master goes on listing it."""
    monkeypatch.setattr(Loopback, "lost", lambda self, topic: frozenset({"program"}))
    robot, program = moved()
    robot.tick(5000)
    assert robot.state() == "ENABLED"
    program.close()
    robot.tick(3300)
    assert robot.state() == "PAUSED"


@pytest.mark.parametrize("lapse", [0.0, 10.0])
def test_commands_that_wait_count_from_when_they_came(monkeypatch: pytest.MonkeyPatch, lapse: float) -> None:
    """On a busy machine a program is killed a second before its last command is looked at."""
    monkeypatch.setattr(Loopback, "lapses", (0, 10 * SECOND, 20 * SECOND))
    robot, program = moved()
    for _ in range(1000):
        robot.network.topics[robot.name("servo_jr")].publishers["program"].publish(JointState(position=shoulder(1e-6)))
    ticks = round(lapse * 200)
    for k in range(ticks + 700):
        if k == ticks:
            program.close()
        robot.clock.sleep(0.005)
        robot.server.tick()
    assert robot.state() == "PAUSED"


def test_a_command_that_came_before_the_server_stood_still_and_was_looked_at_after_it_is_no_younger(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Over DDS the lease runs from when DDS had it, and the program is missed sooner than by the server's count."""
    monkeypatch.setattr(Loopback, "lapses", (0, 10 * SECOND, 20 * SECOND))
    robot, program = moved()
    stalled(robot, 3.0)
    robot.network.topics[robot.name("servo_jr")].publishers["program"].publish(
        JointState(header(robot.clock.now() - 3 * SECOND), (), shoulder(1e-4))
    )
    robot.tick(7_000)
    program.close()
    robot.tick(3_300)
    assert robot.state() == "PAUSED"
