"""A robot behind CRTK's topics, both dialects, around any plant; and time that makes it tick while somebody sleeps."""

from collections.abc import Callable
from typing import Any

import numpy as np

from catenary.crtk.loopback import Loopback, LoopbackNetwork
from catenary.crtk.message import header, message_class
from catenary.crtk.message_values import Stamps, joint_state_message, joint_values, operating_state_message
from catenary.crtk.reader import CrtkReader
from catenary.crtk.topic_names import BUTTON, BUTTON_TYPE, find_topic
from catenary.crtk.transport import Transport
from catenary.errors import CatenaryError
from catenary.open_robot import OverTopics
from catenary.plant import Plant
from catenary.raven2.topics import CHANNELS, EXT_JPOS, JOINT_ENC, Arm
from catenary.workflows.robot.operated_robot import OperatedRobot, operated_robot
from oracles.ticking_clock import TickingClock

_DEGREES = 180.0 / np.pi  # the robot multiplies every position and velocity by it, metres too
# factor, type
_IN_RAVENSTATE = {
    **dict.fromkeys(("mpos", "mvel", "jpos", "jvel", "jpos_d", "mpos_d"), (_DEGREES, np.float32)),
    **dict.fromkeys(("tau", "encoffsets"), (1.0, np.float32)),
    **dict.fromkeys(("encVals", "dac_val"), (1.0, np.int32)),
}


class CrtkRobot:
    """Takes commands, lets its plant tick, and publishes; `tick` does all of it once."""

    def __init__(
        self,
        transport: Transport,
        plant: Plant,
        *,
        dialect: str = "raven",
        arm: Arm = "gold",
        encoders: bool = True,
        second: bool = False,
        every: int = 1,
    ) -> None:
        def topic(verb: str) -> Any:
            return find_topic(dialect, verb, arm)

        self.plant, self.transport, self.arm, self.dialect = plant, transport, arm, dialect
        self.ticks = 0
        self.commands = 0  # servo messages that came
        self.silent = False
        self.refused: list[str] = []
        self._every = every
        self._stamps = Stamps(transport.clock)
        verbs = ("measured_js", "setpoint_js", "operating_state")
        self._out = {verb: transport.publisher(topic(verb).name, topic(verb).type) for verb in verbs}
        if dialect == "raven" and not second:  # the other arm's program sends what is the whole robot's
            state = find_topic(dialect, "ravenstate")
            self._out["ravenstate"] = transport.publisher(state.name, state.type)
            if encoders and "ext_jpos" in {c.name for c in plant.columns}:
                for one in (EXT_JPOS, JOINT_ENC):
                    self._out[one.columns[0].name] = transport.publisher(one.name, one.type)
            transport.service(BUTTON, BUTTON_TYPE, self._press)
        taken = ["servo_jp", "servo_jr", "state_command"]
        if "servo_jf" in plant.supports and dialect == "crtk":
            taken.append("servo_jf")
        self._in = {verb: transport.subscribe(topic(verb).name, topic(verb).type) for verb in taken}

    def tick(self) -> None:
        """Take what came, move on by the plant's period, publish."""
        self.transport.poll()
        for received in self._in["state_command"].take():
            self._obey(self.plant.state_command, received.message.string)
        for verb in ("servo_jp", "servo_jr", "servo_jf"):
            for received in self._in[verb].take() if verb in self._in else ():
                field = "effort" if verb == "servo_jf" else "position"
                values = joint_values(received.message, self.plant.joint_names, field)
                self.commands += 1
                self._obey(getattr(self.plant, verb), values)
        self._obey(self.plant.wait)
        self.ticks += 1
        if not self.silent and self.ticks % self._every == 0:
            self.publish()

    def publish(self) -> None:
        """Publish the plant's state."""
        stamp, names = self._stamps.next(self.transport.steady()), self.plant.joint_names
        measured, setpoint = self.plant.measured_js(), self.plant.setpoint_js()
        self._out["measured_js"].publish(joint_state_message(names, stamp, measured.q, measured.qd, measured.tau))
        self._out["setpoint_js"].publish(joint_state_message(names, stamp, setpoint.q))
        self._out["operating_state"].publish(operating_state_message(self.plant.operating_state(), stamp))
        if "ravenstate" not in self._out:
            return
        telemetry = self.plant.telemetry()
        columns = {name: np.zeros(16, kind) for name, (_, kind) in _IN_RAVENSTATE.items()}
        for name, (factor, _) in _IN_RAVENSTATE.items():
            columns[name][list(CHANNELS[self.arm])] = factor * telemetry.get(name, np.zeros(7))
        state = message_class("raven_2/raven_state")(header(stamp), 3, dt=1_000_000, **columns)
        self._out["ravenstate"].publish(state)
        for one in (EXT_JPOS, JOINT_ENC):
            name = one.columns[0].name
            if name in self._out and np.isfinite(telemetry[name]).all():
                self._out[name].publish(joint_state_message(one.joint_names, stamp, telemetry[name]))

    def _press(self, _: Any) -> Any:
        """Wake the robot as its start button does: enabled, then homing."""
        if self.plant.operating_state().state != "ENABLED":
            self.plant.state_command("enable")
        self.plant.state_command("home")
        return message_class(f"{BUTTON_TYPE}Response")(success=True)

    def _obey(self, do: Callable[..., Any], *arguments: Any) -> None:
        try:
            do(*arguments)
        except CatenaryError as error:
            self.refused.append(str(error))


class RobotClock(TickingClock):
    """Time that passes only in sleeps, and then makes its robots tick every millisecond."""

    def __init__(self, period: float = 0.001) -> None:
        super().__init__(period)
        self.robots: list[CrtkRobot] = []

    def tick(self) -> None:
        for robot in self.robots:
            robot.tick()


class RobotOnLoopback:
    """A robot and a transport to reach it by, in one thread, in no time."""

    def __init__(self, plant: Plant, **options: Any) -> None:
        self.clock = RobotClock(plant.period)
        self.network = LoopbackNetwork(clock=self.clock)
        self.transport = Loopback("client", self.network)
        self.options = options
        self.robot = CrtkRobot(Loopback("robot", self.network), plant, **options)
        self.clock.robots.append(self.robot)

    def unplug(self) -> None:
        """Take the robot off the network, as when its program ends."""
        self.clock.robots.remove(self.robot)
        self.robot.transport.close()

    def restart(self, plant: Plant) -> None:
        """Put another one in its place."""
        self.robot = CrtkRobot(Loopback("robot", self.network), plant, **self.options)
        self.clock.robots.append(self.robot)


def robot_over(transport: Transport, robot: str = "raven2", **options: Any) -> tuple[OperatedRobot, CrtkReader]:
    """A robot behind a transport, and the client that is its plant."""
    opened = operated_robot(robot, OverTopics(transport, **options))
    assert isinstance(opened.plant, CrtkReader)
    return opened, opened.plant
