"""A connection to a latching client breaks and is made again: what it had said is no command any more."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from catenary.crtk.clock import SECOND, ManualClock
from catenary.crtk.conversions import command_message
from catenary.crtk.loopback import Loopback, LoopbackNetwork, LoopbackPublisher
from catenary.crtk.message import header, message_class
from oracles.cable_arms import homed_plant
from served_robot import BEGIN, JointState, ServedRobot

COMMAND = "crtk_msgs/StringStamped"


def cut(network: LoopbackNetwork, name: str) -> None:
    """Break all connections over which a transport sends: what it publishes reaches nobody."""
    for publisher in publishers(network, name):
        publisher.is_connected = False


def mend(network: LoopbackNetwork, name: str) -> None:
    """Make them again; latched messages come again."""
    for publisher in publishers(network, name):
        publisher.connect()


def publishers(network: LoopbackNetwork, name: str) -> list[LoopbackPublisher]:
    return [topic.publishers[name] for topic in network.topics.values() if name in topic.publishers]


class LatchingClient:
    """A program with latched publishers, as UW's and CRTK's have, whose connections break."""

    def __init__(self, robot: ServedRobot, name: str = "latching") -> None:
        self.robot = robot
        self.transport = Loopback(name, robot.network)
        self.state = self.transport.publisher(robot.name("state_command"), COMMAND, latch=True)
        self.jr = self.transport.publisher(robot.name("servo_jr"), "sensor_msgs/JointState", latch=True)

    def command(self, text: str, stamp: int = 0) -> None:
        self.state.publish(command_message(text, stamp))
        self.robot.tick(2)

    def move(self, amount: float) -> None:
        self.jr.publish(JointState(position=np.array([amount, *np.zeros(6)])))
        self.robot.tick(2)

    def lose_connection(self) -> None:
        cut(self.robot.network, self.transport.name)
        self.robot.tick(300)

    def come_back(self) -> None:
        mend(self.robot.network, self.transport.name)
        self.robot.tick(300)


@pytest.fixture(params=["raven", "crtk"])
def robot(request):
    return ServedRobot(request.param, state="PAUSED")


def reported(robot: ServedRobot, kind: str) -> int:
    return sum(report.count for name, report in robot.server.reports.kinds.items() if name.endswith(kind))


def test_a_resume_that_was_obeyed_is_not_obeyed_again(robot):
    client = LatchingClient(robot)
    client.command("resume")
    assert robot.state() == "ENABLED"
    robot.plant.state_command("pause")
    client.lose_connection()
    client.come_back()
    assert robot.state() == "PAUSED"


def test_an_increment_is_not_made_twice(robot):
    client = LatchingClient(robot)
    client.command("resume")
    client.move(1e-3)
    once = robot.setpoint
    client.lose_connection()
    client.come_back()
    assert_array_equal(robot.setpoint, once)


def test_a_command_said_while_nobody_was_connected_is_not_obeyed(robot):
    client = LatchingClient(robot)
    client.command("resume")
    client.command("pause")
    client.lose_connection()
    client.command("resume")
    client.come_back()
    assert robot.state() == "PAUSED"
    assert reported(robot, "after a break") == 1


def test_a_freshly_stamped_command_is_obeyed_after_a_break(robot):
    client = LatchingClient(robot)
    client.command("resume")
    client.command("pause")
    client.lose_connection()
    client.command("resume", stamp=robot.clock.now())
    client.come_back()
    assert robot.state() == "ENABLED"


@pytest.mark.parametrize("command", ["pause", "disable"])
def test_what_stops_is_obeyed_after_a_break(robot, command):
    client = LatchingClient(robot)
    client.command("resume")
    client.lose_connection()
    client.command(command)
    assert robot.state() == "ENABLED"
    client.come_back()
    assert robot.state() == {"pause": "PAUSED", "disable": "DISABLED"}[command]


def test_after_a_break_the_next_command_is_obeyed(robot):
    client = LatchingClient(robot)
    client.command("resume")
    client.command("pause")
    client.lose_connection()
    client.come_back()
    client.command("resume")
    client.move(1e-3)
    assert robot.state() == "ENABLED"
    assert_allclose(robot.setpoint[0] - robot.plant.measured_js().q[0], 1e-3, atol=1e-3)


def test_what_a_program_says_first_is_obeyed_though_latched(robot):
    client = LatchingClient(robot)
    client.lose_connection()
    client.command("resume")
    client.come_back()
    assert robot.state() == "ENABLED"


def test_a_program_started_again_under_its_name_is_another(robot):
    client = LatchingClient(robot)
    client.command("resume")
    client.transport.close()
    robot.plant.state_command("pause")
    LatchingClient(robot).command("resume")
    assert robot.state() == "ENABLED"


def test_an_old_client_that_comes_back_late_does_not_enable_a_restarted_robot():
    network = LoopbackNetwork(clock=ManualClock(BEGIN))
    old = Loopback("client", network)
    publisher = old.publisher("/arm1/state_command", COMMAND, latch=True)
    publisher.publish(command_message("resume", 0))
    cut(network, "client")
    plant = homed_plant("left")
    plant.state_command("pause")
    robot = ServedRobot("raven", network=network, plant=plant)
    robot.tick(15_000)
    mend(network, "client")
    robot.tick(500)
    assert robot.state() == "PAUSED"
    assert reported(robot, "from before") == 1


@pytest.mark.parametrize("dialect", ["raven", "crtk"])
def test_a_new_client_is_obeyed_at_once_though_one_that_crashed_is_listed_still(dialect):
    network = LoopbackNetwork(clock=ManualClock(BEGIN))
    crashed = Loopback("client", network)
    for verb, kind in (("state_command", COMMAND), ("servo_jr", "sensor_msgs/JointState")):
        crashed.publisher(f"/arm1/{verb}", kind, latch=True)
    cut(network, "client")
    plant = homed_plant("left")
    plant.state_command("pause")
    robot = ServedRobot(dialect, network=network, plant=plant)
    robot.tick(10)
    client = LatchingClient(robot)
    client.command("resume")
    assert robot.state() == "ENABLED"
    start = robot.setpoint
    client.move(1e-3)
    assert_allclose((robot.setpoint - start)[0], 1e-3, atol=1e-12)


def test_an_old_client_waits_though_a_new_one_is_obeyed():
    network = LoopbackNetwork(clock=ManualClock(BEGIN))
    old = Loopback("client", network)
    publisher = old.publisher("/arm1/servo_jr", "sensor_msgs/JointState", latch=True)
    robot = ServedRobot("raven", network=network)
    robot.tick(10)
    start = robot.setpoint
    for amount in (1e-3, 2e-3):
        publisher.publish(JointState(position=np.array([amount, *np.zeros(6)])))
        robot.tick(2)
    assert_array_equal(robot.setpoint, start)
    LatchingClient(robot).move(1e-3)
    assert_allclose((robot.setpoint - start)[0], 1e-3, atol=1e-12)


def test_a_subscription_does_not_give_a_message_again_after_a_break():
    network = LoopbackNetwork()
    sender, receiver = Loopback("sender", network), Loopback("receiver", network)
    for topic, kind, message in (
        ("/with", COMMAND, command_message("home", SECOND)),
        ("/without", "std_msgs/Empty", message_class("std_msgs/Empty")()),
    ):
        publisher = sender.publisher(topic, kind, latch=True)
        heard = receiver.subscribe(topic, kind)
        publisher.publish(message)
        cut(network, "sender")
        mend(network, "sender")
        assert len(heard.take()) == 1
        assert heard.repeated == 1


def test_a_subscription_gives_what_was_said_during_a_break():
    network = LoopbackNetwork()
    sender, receiver = Loopback("sender", network), Loopback("receiver", network)
    publisher = sender.publisher("/state", COMMAND, latch=True)
    heard = receiver.subscribe("/state", COMMAND)
    for text in ("before", "during"):
        publisher.publish(message_class(COMMAND)(header(0), text))
        cut(network, "sender")
    mend(network, "sender")
    arrivals = heard.take_arrivals()
    assert [(one.message.string, one.is_first, one.is_renewed) for one in arrivals] == [
        ("before", True, False),
        ("during", True, True),
    ]
