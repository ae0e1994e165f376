"""Who commands an arm is one at a time, and the second is told who holds it."""

from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from catenary.crtk.client import CrtkClient
from catenary.crtk.loopback import Loopback
from catenary.crtk.message import message_class
from catenary.crtk.reader import CrtkReader
from catenary.errors import NotReadyError, RobotHeldError
from catenary.recording.topics import JOINTS
from catenary.simulation.cable_plant import UNITS
from catenary.workflows.robot.motion import move_to
from catenary.workflows.robot.rest import at_rest_afterwards
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
    with pytest.raises(
        RobotHeldError, match=r"first holds the arm: it commanded /arm1/servo_jp 0\.\d\d s ago"
    ):
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
