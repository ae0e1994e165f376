"""A connection to a latching client breaks and is made again: what it had said is no command any more."""

import pytest
from numpy.testing import assert_allclose, assert_array_equal

from catenary.crtk.loopback import Loopback, LoopbackNetwork, LoopbackPublisher
from catenary.crtk.message import message_class
from catenary.crtk.message_values import command_message
from catenary.simulation.cable_plant import CablePlant
from catenary.topics import SECOND
from oracles.cable_arms import homed_plant
from oracles.ticking_clock import BEGIN, SetClock
from served_robot import JointState, ServedRobot, shoulder

COMMAND = "crtk_msgs/StringStamped"


def cut(network: LoopbackNetwork, name: str) -> None:
    """Break all connections over which a transport sends: what it publishes reaches nobody."""
    for publisher in publishers(network, name):
        publisher.is_connected = False


def mend(network: LoopbackNetwork, name: str) -> None:
    """Make them again; latched messages come again."""
    for one in publishers(network, name):
        one.origin, one.is_connected = one.origin._replace(connection=object()), True
        for heard in network.heard(one.topic).values():
            if one.latched is not None:
                heard.give(one.latched, network.clock.now(), one.origin)


def publishers(network: LoopbackNetwork, name: str) -> list[LoopbackPublisher]:
    return list(network.transports[name].publishes.values())


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
        self.jr.publish(JointState(position=shoulder(amount)))
        self.robot.tick(2)


@pytest.fixture(params=["raven", "crtk"])
def robot(request):
    return ServedRobot(request.param, state="PAUSED")


def reported(robot: ServedRobot, kind: str) -> int:
    return sum(report.count for name, report in robot.server.reports.kinds.items() if name.endswith(kind))


# what happens, in its order: what the client says ("now": with a fresh stamp), and what befalls it and the robot
@pytest.mark.parametrize(
    ("story", "state", "complaints"),
    [
        ("resume, robot pauses, break, mend", "PAUSED", 0),
        ("resume, pause, break, resume, mend", "PAUSED", 1),
        ("resume, pause, break, resume now, mend", "ENABLED", 0),
        ("resume, break, pause, mend", "PAUSED", 0),
        ("resume, break, disable, mend", "DISABLED", 0),
        ("resume, pause, break, mend, resume", "ENABLED", 0),
        ("break, resume, mend", "ENABLED", 0),
        ("resume, restart, robot pauses, resume", "ENABLED", 0),
    ],
    ids=[
        "what was obeyed is not obeyed again",
        "what was said while nobody was connected is not obeyed",
        "a fresh stamp is obeyed",
        "pause is obeyed",
        "disable is obeyed",
        "the next command is obeyed",
        "what a program says first is obeyed though latched",
        "a program started again under its name is another",
    ],
)
def test_after_a_break(robot, story, state, complaints):
    client, connected = LatchingClient(robot), True
    for event in story.split(", "):
        before = robot.state()
        if event == "robot pauses":
            robot.plant.state_command("pause")
            robot.tick()
        elif event == "restart":
            client.transport.close()
            client = LatchingClient(robot)
        elif event in ("break", "mend"):
            connected = event == "mend"
            (mend if connected else cut)(robot.network, client.transport.name)
            robot.later(300)
        else:
            word, _, now = event.partition(" ")
            client.command(word, stamp=robot.clock.now() if now else 0)
        assert connected or robot.state() == before
    assert robot.state() == state
    assert reported(robot, "after a break") == complaints


def test_an_increment_is_not_made_twice(robot):
    client = LatchingClient(robot)
    client.command("resume")
    client.move(1e-3)
    once = robot.setpoint
    for change in (cut, mend):
        change(robot.network, client.transport.name)
        robot.later(300)
    assert_array_equal(robot.setpoint, once)
    client.move(1e-3)
    assert_allclose((robot.setpoint - once)[0], 1e-3, atol=1e-12)


def before_the_robot(*verbs: str) -> tuple[LoopbackNetwork, list[LoopbackPublisher]]:
    """A network with a client that was there before the robot, and its latched publishers."""
    network = LoopbackNetwork(clock=SetClock(BEGIN))
    old = Loopback("client", network)
    kinds = {"state_command": COMMAND, "servo_jr": "sensor_msgs/JointState"}
    return network, [old.publisher(f"/arm1/{verb}", kinds[verb], latch=True) for verb in verbs]


def paused_plant() -> CablePlant:
    plant = homed_plant("left")
    plant.state_command("pause")
    return plant


def test_an_old_client_that_comes_back_late_does_not_enable_a_restarted_robot():
    network, (publisher,) = before_the_robot("state_command")
    publisher.publish(command_message("resume", 0))
    cut(network, "client")
    robot = ServedRobot("raven", network=network, plant=paused_plant())
    robot.later(15_000)
    mend(network, "client")
    robot.later(500)
    assert robot.state() == "PAUSED"
    assert reported(robot, "from before") == 1


@pytest.mark.parametrize("dialect", ["raven", "crtk"])
def test_a_new_client_is_obeyed_at_once_though_one_that_crashed_is_listed_still(dialect):
    network, _ = before_the_robot("state_command", "servo_jr")
    cut(network, "client")
    robot = ServedRobot(dialect, network=network, plant=paused_plant())
    robot.tick(10)
    client = LatchingClient(robot)
    client.command("resume")
    assert robot.state() == "ENABLED"
    start = robot.setpoint
    client.move(1e-3)
    assert_allclose((robot.setpoint - start)[0], 1e-3, atol=1e-12)


def test_an_old_client_waits_though_a_new_one_is_obeyed():
    network, (publisher,) = before_the_robot("servo_jr")
    robot = ServedRobot("raven", network=network)
    robot.tick(10)
    start = robot.setpoint
    for amount in (1e-3, 2e-3):
        publisher.publish(JointState(position=shoulder(amount)))
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
