"""A served robot and its client on one loopback, stepped tick by tick in a time of its own."""

from typing import Any

import numpy as np

from catenary.crtk.inbox import Subscription
from catenary.crtk.loopback import Loopback, LoopbackNetwork
from catenary.crtk.message import message_class
from catenary.crtk.message_values import command_message
from catenary.crtk.serving.server import Server
from catenary.crtk.topic_names import DialectName, find_topic
from catenary.nodes.serve import ParkedArm, Serving, make_server
from catenary.plant import Plant
from catenary.raven2.topics import Arm
from catenary.simulation.cable_plant import JOINTS, UNITS
from oracles.cable_arms import homed_plant
from oracles.ideal_plant import IdealPlant
from oracles.ticking_clock import SetClock

JointState = message_class("sensor_msgs/JointState")


def shoulder(amount: float) -> np.ndarray:
    """Numbers of seven joints, zero but for the first."""
    return np.array([amount, *np.zeros(6)])


def homing_plant() -> IdealPlant:
    """An arm as it is switched on, which takes a quarter of a second to home."""
    supports = frozenset({"measured_js", "setpoint_js", "servo_jp", "servo_jr", "state_command"})
    return IdealPlant(
        homed_plant("left").setpoint_js().q.tolist(), joint_names=JOINTS, joint_units=UNITS, ready=False,
        homing_ticks=250, supports=supports,
    )  # fmt: skip


class ServedRobot:
    """A homed gold arm and a parked green one; `state` is where the gold one is left before the server starts."""

    def __init__(
        self,
        dialect: DialectName = "raven",
        *,
        state: str = "ENABLED",
        network: LoopbackNetwork | None = None,
        plant: Plant | None = None,
    ) -> None:
        self.dialect: DialectName = dialect
        self.clock: Any = SetClock() if network is None else network.clock
        self.network = network or LoopbackNetwork(clock=self.clock)
        self.plant: Any = plant or homed_plant("left")
        if plant is None and state != "ENABLED":
            self.plant.state_command({"PAUSED": "pause", "DISABLED": "disable"}[state])
        parked = ParkedArm(JOINTS, UNITS, homed_plant("left").firmware.home_value)
        self.client = Loopback("client", self.network) if network is None else network.transports["client"]
        plants, carrier = {"gold": self.plant, "green": parked}, Loopback("robot", self.network)
        self.server: Server = make_server(Serving(dialect=dialect), carrier, plants=plants)
        self._publishers: dict[str, Any] = {}

    @property
    def setpoint(self) -> np.ndarray:
        """Of the gold arm (7,)."""
        q: np.ndarray = self.plant.setpoint_js().q
        return q

    def tick(self, count: int = 1) -> None:
        """Let milliseconds pass."""
        for _ in range(count):
            self.clock.sleep(0.001)
            self.server.tick()

    def later(self, milliseconds: int) -> None:
        """Let time pass in ticks of 5 ms, where nothing moves: who is connected is looked at ten times a second."""
        for _ in range(milliseconds // 5):
            self.clock.sleep(0.005)
            self.server.tick()

    def name(self, verb: str, arm: Arm | None = "gold") -> str:
        """Of a topic."""
        return find_topic(self.dialect, verb, arm).name

    def hear(self, verb: str, arm: Arm | None = "gold") -> Subscription:
        """Subscribe to a topic of the robot."""
        topic = find_topic(self.dialect, verb, arm)
        return self.client.subscribe(topic.name, topic.type, depth=100_000)

    def last(self, verb: str, arm: Arm | None = "gold") -> Any:
        """A message that the robot publishes within the next tenth of a second."""
        heard = self.hear(verb, arm)
        self.tick(110)
        message = heard.take()[-1].message
        heard.close()
        return message

    def say(self, verb: str, message: Any, arm: Arm | None = "gold") -> None:
        """Publish a command."""
        topic = find_topic(self.dialect, verb, arm)
        if topic.name not in self._publishers:
            self._publishers[topic.name] = self.client.publisher(topic.name, topic.type)
        self._publishers[topic.name].publish(message)

    def joints(self, verb: str, position: Any, *, names: tuple[str, ...] = (), arm: Arm = "gold") -> None:
        """Publish a JointState without stamp, as the RAVEN-II's own clients do."""
        self.say(verb, JointState(name=names, position=np.asarray(position, dtype=float)), arm)

    def command(self, text: str, arm: Arm | None = "gold", *, stamp: int = 0) -> None:
        """Publish a state command."""
        self.say("state_command", command_message(text, stamp), arm)

    def state(self, arm: Arm = "gold") -> str:
        """Of an arm, as it says itself."""
        return str(self.server.arms[arm].state.state)
