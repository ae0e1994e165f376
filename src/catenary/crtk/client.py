"""A robot behind CRTK's topics as a `Plant`, used like a simulated one.

Positions are sent as goals, never as increments: `servo_jr` moves the goal and sends where it is, so that a message
that is lost or comes twice puts no joint elsewhere. A RAVEN-II takes one clamped step (2.5 mrad, 0.05 mm) per
`servo_jp`; as long as its setpoint is not at the goal, `wait` sends the goal again, once a tick. The goal is forgotten
when the robot is not ENABLED any more, or when something else has moved its setpoint.

`wait` sleeps until the next tick on a grid of the client's own; what came from the robot meanwhile is read afterwards.
Neither a robot that publishes slowly nor one that has died can hold a loop up: its silence shows in `measured_js`,
which refuses a state older than `stale_after`.

State commands are never latched: a robot that restarts must not be enabled by what was asked of it before.

One program at a time moves an arm. A client that has not moved it yet listens to what others command, and refuses to
begin while one does, by its name; a served robot refuses the second one too, and what it says ends that one's motion.

A RAVEN-II's silver button is pressed by its topic, which every network carries.
"""

from collections.abc import Callable, Mapping
from contextlib import closing

import numpy as np
from numpy.typing import ArrayLike

from catenary.arrays import Floats, as_array
from catenary.crtk.clock import SECOND
from catenary.crtk.exclusive_control import LISTEN_S, STOPPING_COMMANDS, OtherCommanders, require_one_robot
from catenary.crtk.message import message_class
from catenary.crtk.message_values import Stamps, command_message, joint_state_message
from catenary.crtk.message_values import operating_state as operating_state_of
from catenary.crtk.reader import CrtkReader
from catenary.crtk.topic_names import BUTTON, NAMESPACES, SIGNAL, TEXT, WARNING
from catenary.crtk.transport import Publisher, Transport
from catenary.errors import NotReadyError, TransportError, UnsupportedCommandError
from catenary.plant import STATE_COMMANDS, OperatingState, StateCommand, require_ready

_REACHED_WITHIN = 1e-6  # [rad|m] a robot's setpoint this near is the goal: RAVEN-II computes in floats of 32 bits
_COMMAND_TIMEOUT_S = 2.0  # [s] until a transition must have been confirmed
_HOMING_TIMEOUT_S = 180.0  # [s]; RAVEN-II's external encoders alone are given 60 s
_HOME_SETTLES_S = 0.05  # [s] in which a robot takes up `home`: before, its state is still the one from before
_SENDS = ("servo_jp", "servo_jf", "state_command")  # verbs, those that the dialect has
_CONFIRMED: Mapping[StateCommand, Callable[[OperatingState], bool]] = {
    "enable": lambda now: now.state == "ENABLED",
    "disable": lambda now: now.state == "DISABLED",
    "pause": lambda now: now.state != "ENABLED",  # one that is not enabled is not under way either
    "resume": lambda now: now.state == "ENABLED",
    "home": lambda now: now.is_homed and not now.is_busy,
    "unhome": lambda now: not now.is_homed,
}


class CrtkClient(CrtkReader):
    """One arm of a robot that speaks CRTK, read and commanded; a state older than `stale_after` is TransportError."""

    _obeys = True

    def _begin(self) -> None:
        """Prepare to command; nothing is sent."""
        self._stamps = Stamps(self.transport.clock)
        self._goal: Floats | None = None  # (n,) sent last
        self._arrived = False  # whether the robot's setpoint has been at the goal
        self._sent = False  # whether a command went out in this tick
        self._publishers: dict[str, Publisher] = {}
        kept = self._open.enter_context
        for topic in self.dialect.topics(self.arm, self.namespace):
            if topic.verb in _SENDS:
                self._publishers[topic.verb] = kept(closing(self.transport.publisher(topic.name, topic.type)))
        self._others = kept(closing(OtherCommanders(self.transport, self.dialect, self.arm, self.namespace)))

    def require_free(self) -> None:
        """Listen a third of a second: refuse an arm that another program moves, or two robots of one name."""
        self._others.listen()
        self._require_one_robot()

    def _connect(self, timeout: float) -> None:
        super()._connect(timeout)
        self._since = self.transport.steady()
        torques = self._publishers.get("servo_jf")
        obeys = torques is not None and self.transport.connections(torques.topic).subscribers
        self.supports = frozenset({"servo_jp", "servo_jr", "state_command", *(("servo_jf",) if obeys else ())})

    # what it obeys

    def servo_jp(self, q: ArrayLike) -> None:
        """Send a goal (n,) [rad|m] within the limits, or no further out than the setpoint is; `wait` sends it again."""
        self._require("servo_jp")
        self._send_goal(as_array("servo_jp", q, (len(self.joint_names),)))

    def servo_jr(self, dq: ArrayLike) -> None:
        """Move the goal by dq (n,) [rad|m] and send it; several in a tick add up."""
        self._require("servo_jr")
        step = as_array("servo_jr", dq, (len(self.joint_names),))
        self._forget_what_is_not_ours()
        self._send_goal((self._setpoint() if self._goal is None else self._goal) + step)

    def servo_jf(self, tau: ArrayLike) -> None:
        """Send joint torques (n,) [Nm|N]; a robot that takes none raises UnsupportedCommandError."""
        self._require("servo_jf")
        effort = as_array("servo_jf", tau, (len(self.joint_names),))
        self._goal = None
        self._publish("servo_jf", effort=effort)

    def state_command(self, command: StateCommand, *, timeout: float | None = None) -> None:
        """Ask for a transition and wait `timeout` [s] (2 s when None, for home 180 s) until the robot confirms it.

        Raises:
            NotReadyError: The robot did not do it in time; the message says what state it is in.
        """
        if command not in STATE_COMMANDS:
            raise UnsupportedCommandError(f'state command "{command}": expected one of {", ".join(STATE_COMMANDS)}')
        self._goal = None
        if command not in STOPPING_COMMANDS:
            self._require_one_robot()
        begin = self.transport.steady()
        patience = timeout or (_HOMING_TIMEOUT_S if command == "home" else _COMMAND_TIMEOUT_S)
        if self.age > self.stale_after:  # it is silent already
            patience = min(patience, self.stale_after)
        settle = _HOME_SETTLES_S if command == "home" else 0.0
        self._publishers["state_command"].publish(command_message(command, self._stamps.next(begin)))
        latest = self._latest["operating_state"]
        while True:
            self.transport.sleep(self.period)
            elapsed = (self.transport.steady() - begin) / SECOND
            now = operating_state_of(latest.message())
            # a robot may publish its state only when it changes: then what held before holds
            is_news = latest.arrived is not None and latest.arrived > begin
            if elapsed >= settle and (is_news or elapsed > 10.0 * _HOME_SETTLES_S) and _CONFIRMED[command](now):
                return
            if elapsed > patience:
                self._fresh()
                raise NotReadyError(
                    f"{command}: not confirmed within {patience:g} s; the robot is {now.state}, "
                    f"{'homed' if now.is_homed else 'not homed'}{', busy' if now.is_busy else ''}"
                )

    def wait(self) -> None:
        """End a tick: send a goal again that the robot has not reached, then sleep until the next tick."""
        if not self._sent:
            self._forget_what_is_not_ours()
            if self._goal is not None and not self._arrived:
                self._publish("servo_jp", position=self._goal)
        self._sent = False
        self._rate.sleep()

    def _require(self, verb: str) -> None:
        require_ready(self, verb)
        self._others.require_none()

    def _require_one_robot(self) -> None:
        """Refuse to go on where two robots are heard, a third of a second after the connection at the earliest."""
        connected = (self.transport.steady() - self._since) / SECOND
        self.transport.sleep(max(0.0, LISTEN_S - connected))
        require_one_robot(self.transport, self._latest["measured_js"])

    def _send_goal(self, goal: Floats) -> None:
        setpoint = self._setpoint()
        self._goal = np.clip(goal, np.minimum(self._lower, setpoint), np.maximum(self._upper, setpoint))
        self._arrived = False
        self._publish("servo_jp", position=self._goal)

    def _publish(self, verb: str, *, position: ArrayLike = (), effort: ArrayLike = ()) -> None:
        require_one_robot(self.transport, self._latest["measured_js"])
        stamp = self._stamps.next(self.transport.steady())
        message = joint_state_message(self.joint_names, stamp, position, effort=effort)
        self._publishers[verb].publish(message)
        self._others.we_command()
        self._sent = True

    def _forget_what_is_not_ours(self) -> None:
        """Forget a goal that a pedal, a restart or somebody else has overtaken."""
        if self._goal is None:
            return
        if self.age > self.stale_after or self.operating_state().state != "ENABLED":
            self._goal = None
            return
        away = float(np.abs(self._setpoint() - self._goal).max())
        if away <= _REACHED_WITHIN:
            self._arrived = True
        elif self._arrived:
            self._goal = None

    def _setpoint(self) -> Floats:
        return self._position(self._latest["setpoint_js"].message())

    def _missing(self) -> list[str]:
        """Return the topics that lack messages or a listener, as text."""
        faults = super()._missing()
        for verb in ("servo_jp", "state_command"):
            topic = self._publishers[verb].topic
            listeners = {name.rpartition("/")[2] for name in self.transport.connections(topic).subscribers}
            if not listeners - {self.transport.name}:  # this client listens to who else commands
                faults.append(f"{topic}: nobody listens")
        return faults


STARTS_TEXT = ": starts"  # what the robot says of an arm that the button starts
_BUTTON_PREFIX = "button: "  # before it, where it says so on a topic


def press_button(transport: Transport, timeout: float = 5.0) -> tuple[bool, str]:
    """Press a RAVEN-II's silver button.

    Args:
        transport: Connection.
        timeout: Time to wait for the robot's answer [s].

    Returns:
        Whether an arm starts, and the robot's message.

    Raises:
        TransportError: Nobody listens to the button.
    """
    publisher = transport.publisher(BUTTON, SIGNAL)
    heard = transport.subscribe(f"{NAMESPACES['gold']}/{WARNING}", TEXT)
    try:
        for _ in range(100):  # a second
            there = transport.connections(publisher.topic).subscribers, transport.connections(heard.topic).publishers
            if all(there):
                break
            transport.sleep(0.01)
        else:
            raise TransportError(f"{BUTTON}: nobody listens to it")
        publisher.publish(message_class(SIGNAL)())
        for _ in range(round(timeout / 0.01)):
            for message, _ in heard.take():
                if message.data.startswith(_BUTTON_PREFIX):
                    return message.data.endswith(STARTS_TEXT) or f"{STARTS_TEXT};" in message.data, message.data[
                        len(_BUTTON_PREFIX) :
                    ]
            transport.sleep(0.01)
    finally:
        heard.close()
        publisher.close()
    raise TransportError(f"{BUTTON}: no answer within {timeout:g} s")
