"""CRTK client: a robot on CRTK topics as a `Plant`, used like a simulated one; the RAVEN-II's start button.

Positions are sent as goals, never as increments: `servo_jr` moves the goal and sends it, so that a lost or duplicated
message causes no offset. A RAVEN-II takes one clamped step (2.5 mrad, 0.05 mm) per `servo_jp`; until its setpoint is at
the goal, `wait` sends the goal again, once per tick. The goal is dropped when the robot is no longer ENABLED, or when
something else has moved its setpoint.

`wait` sleeps until the client's own next tick; messages that arrived meanwhile are read afterwards. A robot that
publishes slowly or has died cannot block a loop: `measured_js` refuses a state older than `stale_after`.

State commands are never latched: an earlier command must not enable a robot that restarts.

Only one program at a time moves an arm. Before its first command, a client listens for commands of other programs and
refuses to start while there are any, naming the program. A served robot also refuses the second program.
"""

from collections.abc import Callable, Mapping
from contextlib import closing

import numpy as np
from numpy.typing import ArrayLike

from catenary.arrays import Floats, as_array
from catenary.crtk.exclusive_control import LISTEN_S, STOPPING_COMMANDS, OtherCommanders, require_one_robot
from catenary.crtk.message import message_class
from catenary.crtk.message_values import Stamps, command_message, joint_state_message
from catenary.crtk.message_values import operating_state as operating_state_of
from catenary.crtk.reader import CrtkReader
from catenary.crtk.topic_names import BUTTON, NAMESPACES, SIGNAL, TEXT, WARNING
from catenary.crtk.transport import Publisher, Transport
from catenary.errors import NotReadyError, TransportError, UnsupportedCommandError
from catenary.plant import STATE_COMMANDS, OperatingState, StateCommand, require_ready
from catenary.topics import SECOND

_REACHED_WITHIN = 1e-6  # [rad|m] distance of the setpoint to a reached goal: RAVEN-II computes in 32-bit floats
_COMMAND_TIMEOUT_S = 2.0  # [s] until a transition must be confirmed
_HOMING_TIMEOUT_S = 180.0  # [s]; RAVEN-II's external encoders alone may take 60 s
_HOME_SETTLES_S = 0.05  # [s] until a robot's state reflects the command `home`
_SENDS = ("servo_jp", "servo_jf", "state_command")  # verbs sent, if the dialect has them
_CONFIRMED: Mapping[StateCommand, Callable[[OperatingState], bool]] = {
    "enable": lambda now: now.state == "ENABLED",
    "disable": lambda now: now.state == "DISABLED",
    "pause": lambda now: now.state != "ENABLED",  # a robot that is not enabled does not move either
    "resume": lambda now: now.state == "ENABLED",
    "home": lambda now: now.is_homed and not now.is_busy,
    "unhome": lambda now: not now.is_homed,
}


class CrtkClient(CrtkReader):
    """One arm of a CRTK robot, read and commanded; a state older than `stale_after` raises TransportError."""

    _obeys = True

    def _begin(self) -> None:
        """Prepare to command; nothing is sent."""
        self._stamps = Stamps(self.transport.clock)
        self._goal: Floats | None = None  # (n,) last goal sent
        self._arrived = False  # the robot's setpoint has been at the goal
        self._sent = False  # a command was sent in this tick
        self._publishers: dict[str, Publisher] = {}
        kept = self._open.enter_context
        for topic in self.dialect.topics(self.arm, self.namespace):
            if topic.verb in _SENDS:
                self._publishers[topic.verb] = kept(closing(self.transport.publisher(topic.name, topic.type)))
        self._others = kept(closing(OtherCommanders(self.transport, self.dialect, self.arm, self.namespace)))

    def require_free(self) -> None:
        """Listen for a third of a second; refuse an arm that another program moves, or two robots of one name."""
        self._others.listen()
        self._require_one_robot()

    def _connect(self, timeout: float) -> None:
        super()._connect(timeout)
        self._since = self.transport.steady()
        torques = self._publishers.get("servo_jf")
        obeys = torques is not None and self.transport.connections(torques.topic).subscribers
        self.supports = frozenset({"servo_jp", "servo_jr", "state_command", *(("servo_jf",) if obeys else ())})

    # commands

    def servo_jp(self, q: ArrayLike) -> None:
        """Send a goal (n,) [rad|m], clipped to the limits or, beyond these, to the setpoint; `wait` sends it again."""
        self._require("servo_jp")
        self._send_goal(as_array("servo_jp", q, (len(self.joint_names),)))

    def servo_jr(self, dq: ArrayLike) -> None:
        """Move the goal by dq (n,) [rad|m] and send it; increments in one tick add up."""
        self._require("servo_jr")
        step = as_array("servo_jr", dq, (len(self.joint_names),))
        self._forget_what_is_not_ours()
        self._send_goal((self._setpoint() if self._goal is None else self._goal) + step)

    def servo_jf(self, tau: ArrayLike) -> None:
        """Send joint torques (n,) [Nm|N]."""
        self._require("servo_jf")
        effort = as_array("servo_jf", tau, (len(self.joint_names),))
        self._goal = None
        self._publish("servo_jf", effort=effort)

    def state_command(self, command: StateCommand, *, timeout: float | None = None) -> None:
        """Request a transition and wait up to `timeout` [s] for its confirmation (if None, 180 s for home, else 2 s).

        Raises:
            NotReadyError: The robot did not confirm in time; the message states its state.
        """
        if command not in STATE_COMMANDS:
            raise UnsupportedCommandError(f'state command "{command}": expected one of {", ".join(STATE_COMMANDS)}')
        self._goal = None
        if command not in STOPPING_COMMANDS:
            self._require_one_robot()
        begin = self.transport.steady()
        patience = timeout or (_HOMING_TIMEOUT_S if command == "home" else _COMMAND_TIMEOUT_S)
        if self.age > self.stale_after:  # the robot is already silent
            patience = min(patience, self.stale_after)
        settle = _HOME_SETTLES_S if command == "home" else 0.0
        self._publishers["state_command"].publish(command_message(command, self._stamps.next(begin)))
        latest = self._latest["operating_state"]
        while True:
            self.transport.sleep(self.period)
            elapsed = (self.transport.steady() - begin) / SECOND
            now = operating_state_of(latest.message())
            # a robot may publish its state only on changes: without news the last state holds
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
        """End a tick: resend a goal that the robot has not reached, then sleep until the next tick."""
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
        """Refuse two robots of one name, at the earliest a third of a second after the connection."""
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
        """Drop a goal after a pedal, a restart or another program has changed the robot's state or setpoint."""
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
        faults = super()._missing()
        for verb in ("servo_jp", "state_command"):
            topic = self._publishers[verb].topic
            listeners = {name.rpartition("/")[2] for name in self.transport.connections(topic).subscribers}
            if not listeners - {self.transport.name}:  # the client itself listens, for commands of others
                faults.append(f"{topic}: nobody listens")
        return faults


STARTS_TEXT = ": starts"  # in the robot's message on an arm that the button starts
_BUTTON_PREFIX = "button: "  # start of that message on a topic


def press_button(transport: Transport) -> tuple[bool, str]:
    """Press a RAVEN-II's silver button; return whether an arm starts, and the robot's message.

    Raises:
        TransportError: No subscriber of the button, or no answer.
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
        for _ in range(500):
            for message, _ in heard.take():
                answer = message.data.removeprefix(_BUTTON_PREFIX)
                if answer != message.data:
                    return f"{STARTS_TEXT};" in f"{message.data};", answer
            transport.sleep(0.01)
    finally:
        heard.close()
        publisher.close()
    raise TransportError(f"{BUTTON}: no answer within 5 s")
