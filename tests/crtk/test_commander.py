"""An arm whose commander goes in the middle of a motion holds at once, and is paused three seconds later."""

import pytest
from numpy.testing import assert_array_equal

from catenary.crtk.clock import SECOND
from catenary.crtk.loopback import Loopback
from served_robot import JointState, ServedRobot, shoulder

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
