"""An arm whose commander goes in the middle of a motion holds at once, and is paused three seconds later."""

import pytest
from numpy.testing import assert_array_equal

from catenary.crtk.clock import SECOND
from catenary.crtk.loopback import Loopback
from catenary.crtk.message import header
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


def stalled(robot: ServedRobot, seconds: float) -> None:
    """Time passes, and the server does nothing: it is stopped, or its computer suspended."""
    robot.clock.sleep(seconds)


@pytest.mark.parametrize("seconds", [0.4, 3.0, 12.0, 3600.0])
@pytest.mark.parametrize("dialect", ["raven", "crtk"])
def test_an_arm_whose_program_went_while_the_server_stood_still_is_paused(
    dialect: str, seconds: float
) -> None:
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
        robot.network.topics[robot.name("servo_jr")].publishers["program"].publish(
            JointState(position=shoulder(1e-6))
        )
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
