"""Served robots, a RAVEN-II and a PSM, and their clients on one loopback, tick by tick in a time of their own."""

from typing import Any

import numpy as np

from catenary.crtk.loopback import Loopback, LoopbackNetwork
from catenary.crtk.message import codec, message_class
from catenary.crtk.message_queues import Subscription
from catenary.crtk.message_values import command_message
from catenary.crtk.serving.server import Server
from catenary.crtk.topic_names import console_topics, crtk_topics, find_topic
from catenary.nodes.serve import ParkedArm, Serving, make_server
from catenary.plant import Plant
from catenary.raven2.topics import Arm
from catenary.simulation.cable_plant import JOINTS, UNITS
from catenary.simulation.psm_plant import PsmPlant
from oracles.cable_arms import homed_plant
from oracles.ideal_plant import IdealPlant
from oracles.psm_arms import homed_psm
from oracles.ticking_clock import SetClock, TickingClock

JointState = message_class("sensor_msgs/JointState")


def answered(server: Server, name: str, kind: str, **request: Any) -> Any:
    """What a server on a loopback answers when a service of it is called."""
    _, answer = server.transport.services[name]  # type: ignore[attr-defined]
    asked = codec(f"{kind}Request").encode(message_class(f"{kind}Request")(**request))
    return codec(f"{kind}Response").decode(answer(asked))


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
        dialect: str = "raven",
        *,
        state: str = "ENABLED",
        network: LoopbackNetwork | None = None,
        plant: Plant | None = None,
    ) -> None:
        self.dialect: str = dialect
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

    def tick_while_slept(self) -> None:
        """Have the server tick while somebody sleeps by the clock, as a client of this thread does."""
        sleep = self.clock.sleep

        def ticking(seconds: float) -> None:
            for _ in range(max(1, round(seconds * 1000))):
                sleep(0.001)
                self.server.tick()

        self.clock.sleep = ticking

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


PSM_TOPICS = {topic.name: topic for topic in (*crtk_topics("PSM1", "/PSM1"), *console_topics("/PSM1"))}


class ServedDvrk(TickingClock):
    """An arm of a dVRK which ticks while somebody sleeps."""

    def __init__(self, robot: str, name: str, plant: Any) -> None:
        super().__init__(0.001)
        self.network = LoopbackNetwork(clock=self)
        self.plant, self.arm = plant, f"/{name}"
        self.topics = {topic.name: topic for topic in (*crtk_topics(name, self.arm), *console_topics(self.arm))}
        serving, carrier = Serving(robot=robot, dialect="crtk"), Loopback("robot", self.network)
        self.server = make_server(serving, carrier, plants={name: self.plant})
        self.client, self.commander = (Loopback(name, self.network) for name in ("client", "commander"))
        self._publishers: dict[str, Any] = {}

    def tick(self) -> None:
        """Let a millisecond pass."""
        self.server.tick()

    def hear(self, name: str) -> Subscription:
        """Subscribe to a topic."""
        return self.client.subscribe(name, self.topics[name].type, depth=10_000)

    def last(self, name: str) -> Any:
        """The newest message of a topic within a tenth of a second."""
        heard = self.hear(name)
        self.sleep(0.11)
        message = heard.take()[-1].message
        heard.close()
        return message

    def say(self, name: str, message: Any, seconds: float = 0.02) -> None:
        """Publish, latched as dVRK's classes do, and wait."""
        if name not in self._publishers:
            self._publishers[name] = self.commander.publisher(name, self.topics[name].type, latch=True)
        self._publishers[name].publish(message)
        self.sleep(seconds)

    def joints(self, verb: str, q: Any, seconds: float = 0.02, names: tuple[str, ...] = ()) -> None:
        """Say positions of the arm, or of its jaw."""
        self.say(f"{self.arm}/{verb}", JointState(name=names, position=np.asarray(q, dtype=float)), seconds)

    def wait(self, longest: float = 20.0) -> float:
        """Wait as CRTK's client does: until the arm is busy no more; return how long that took [s]."""
        for k in range(round(longest / 0.01)):
            if not self.server.arms[self.arm[1:]].state.is_busy:
                return 0.01 * k
            self.sleep(0.01)
        raise AssertionError("busy for ever")

    @property
    def setpoint(self) -> np.ndarray:
        """Of the arm and its jaw (7,)."""
        q: np.ndarray = self.plant.setpoint_js().q
        return q

    @property
    def refusals(self) -> list[str]:
        """What was refused since this was looked at last."""
        return [line for line in self.server.reports.take() if "refused" in line]


class ServedPsm(ServedDvrk):
    """A PSM, homed and enabled unless it is another plant."""

    def __init__(self, plant: PsmPlant | None = None) -> None:
        super().__init__("dvrk_psm", "PSM1", homed_psm() if plant is None else plant)
