"""A robot behind CRTK's topics as a `Plant`, used like a simulated one.

Positions are sent as goals, never as increments: `servo_jr` moves the goal and sends where it is, so that a message
that is lost or comes twice puts no joint elsewhere. A RAVEN-II takes one clamped step (2.5 mrad, 0.05 mm) per
`servo_jp`; as long as its setpoint is not at the goal, `wait` sends the goal again, once a tick. The goal is forgotten
when the robot is not ENABLED any more, or when something else has moved its setpoint.

`wait` sleeps until the next tick on a grid of the client's own; what came from the robot meanwhile is read afterwards.
Neither a robot that publishes slowly nor one that has died can hold a loop up: its silence shows in `measured_js`,
which refuses a state older than `stale_after`.

State commands are never latched: a robot that restarts must not be enabled by what was asked of it before.
"""

from collections.abc import Callable, Mapping
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from catenary.arrays import Floats, as_array
from catenary.crtk.clock import SECOND
from catenary.crtk.conversions import Stamps, command_message, joint_state, joint_state_message, joint_values
from catenary.crtk.conversions import operating_state as operating_state_of
from catenary.crtk.joints import RobotJoints, checked_joints, raven_joints
from catenary.crtk.latest import ImuTopic, Latest, MeasuredGravity
from catenary.crtk.message import Message
from catenary.crtk.names import Dialect, find_topic
from catenary.crtk.raven_telemetry import RavenTelemetry, joint_torques
from catenary.crtk.transport import Publisher, Transport
from catenary.errors import InputError, NotReadyError, TransportError, UnsupportedCommandError
from catenary.plant import STATE_COMMANDS, Column, JointState, OperatingState, StateCommand, require_ready
from catenary.recording.topics import Arm
from catenary.spatial import LEVEL

STALE_AFTER = 0.2  # [s] without measured_js after which a robot counts as lost
CONNECT_TIMEOUT = 5.0  # [s] that CRTK's own client allows
REACHED = 1e-6  # [rad|m] a robot's setpoint this near is the goal: RAVEN-II computes in floats of 32 bits
COMMAND_TIMEOUT = 2.0  # [s] until a transition must have been confirmed
HOMING_TIMEOUT = 180.0  # [s]; RAVEN-II's external encoders alone are given 60 s
SETTLE = 0.05  # [s] in which a robot takes up `home`: before, its state is still the one from before
_CONFIRMED: Mapping[StateCommand, Callable[[OperatingState], bool]] = {
    "enable": lambda now: now.state == "ENABLED",
    "disable": lambda now: now.state == "DISABLED",
    "pause": lambda now: now.state != "ENABLED",  # one that is not enabled is not under way either
    "resume": lambda now: now.state == "ENABLED",
    "home": lambda now: now.is_homed and not now.is_busy,
    "unhome": lambda now: not now.is_homed,
}
_READS = ("measured_js", "setpoint_js", "operating_state")


class CrtkClient:
    """One arm of a robot that speaks CRTK, over any transport; arrays are in the order of `joint_names`."""

    def __init__(
        self,
        transport: Transport,
        *,
        dialect: Dialect = "raven",
        arm: Arm = "gold",
        namespace: str | None = None,
        joints: RobotJoints | None = None,
        period: float = 0.001,
        imu: ImuTopic | None = None,
        stale_after: float = STALE_AFTER,
        connect_timeout: float = CONNECT_TIMEOUT,
        simulated: bool = False,
    ) -> None:
        """Connect to a robot; nothing is sent.

        Args:
            transport: Carries the messages; stays open when the client is closed.
            dialect: `raven`, the public RAVEN-II software's, or `crtk`, the present convention.
            arm: Which one; the swap of the arms' topics is seen to.
            namespace: In front of the verbs, such as /PSM1, of a robot that speaks `crtk`; a RAVEN-II's when None.
            joints: Names as in its messages, units and limits; a RAVEN-II's when None.
            period: Of a tick [s].
            imu: Topic that gravity is read from; nominal gravity when None.
            stale_after: Age [s] at which a state is refused.
            connect_timeout: [s].
            simulated: The robot behind the topics is a simulation, which they do not say.

        Raises:
            TransportError: Topics are missing, or nothing comes, within `connect_timeout`; the message names them. Or
                they carry another type, or this transport has a client of this arm already.
            InputError: An argument is out of range, or the robot's joints have other names.
        """
        if not 0.0 < period < np.inf or not 0.0 < stale_after < np.inf or not connect_timeout >= 0.0:
            raise InputError(
                f"client: expected positive times, got period {period}, stale_after {stale_after}, "
                f"connect_timeout {connect_timeout}"
            )
        found = checked_joints(raven_joints(arm) if joints is None else joints)
        self.joint_names, self.joint_units = found.names, found.units
        self._lower, self._upper = found.lower, found.upper
        self.transport, self.dialect, self.arm = transport, dialect, arm
        self.period, self.stale_after, self.simulated = period, stale_after, simulated
        self._stamps = Stamps()
        self._goal: Floats | None = None  # (n,) sent last
        self._arrived = False  # whether the robot's setpoint has been at the goal
        self._sent = False  # whether a command went out in this tick
        self._origin: int | None = None  # [ns] stamp of the first state
        self._latest: dict[str, Latest] = {}
        self._publishers: dict[str, Publisher] = {}
        self._state: RavenTelemetry | None = None
        self._gravity: MeasuredGravity | None = None
        # of telemetry: raven_state's fields, and encoders that were published when this began
        self.columns: tuple[Column, ...] = ()
        try:
            for verb in _READS:
                topic = find_topic(dialect, verb, arm, namespace)
                self._latest[verb] = Latest(transport, topic.name, topic.type)
            if dialect == "raven":
                self._state = RavenTelemetry(transport, arm, stale_after)
                self.columns = self._state.columns
            self._gravity = None if imu is None else MeasuredGravity(transport, imu)
            for verb in ("servo_jp", "state_command", *(("servo_jf",) if dialect == "crtk" else ())):
                topic = find_topic(dialect, verb, arm, namespace)
                self._publishers[verb] = transport.publisher(topic.name, topic.type)
            self._connect(connect_timeout)
            self._position(self._latest["measured_js"].message())  # refuses other joints here and now
        except BaseException:
            self.close()
            raise
        self.measured_topic = self._latest["measured_js"].topic
        torques = self._publishers.get("servo_jf")
        obeys = torques is not None and transport.connections(torques.topic).subscribers
        self.supports = frozenset(
            {"servo_jp", "servo_jr", "state_command", *(("servo_jf",) if obeys else ())}
        )
        self._rate = transport.rate(1.0 / period)

    # what it says

    @property
    def lower(self) -> Floats:
        """Lower joint limits (n,) [rad|m]."""
        return self._lower.copy()

    @property
    def upper(self) -> Floats:
        """Upper joint limits (n,) [rad|m]."""
        return self._upper.copy()

    def measured_js(self) -> JointState:
        """Return the latest joint state; its time is the robot's, since the client's first message.

        Torques are those at the joints, from raven_state where there is one, as a motion log has them.

        Raises:
            TransportError: It is older than `stale_after`.
        """
        return self.state_of(self._fresh())

    def state_of(self, message: Message) -> JointState:
        """Return the joint state of a message of measured_js, with the latest torques and gravity."""
        gravity, age = (LEVEL.copy(), np.inf) if self._gravity is None else self._gravity.now()
        state = joint_state(message, self.joint_names, gravity=gravity, gravity_age=age)
        tau, q_motor = state.tau, state.q_motor
        if self._state is not None:
            tau, q_motor = joint_torques(self._state.arm_values("tau")), self._state.arm_values("mpos")
        if self._origin is None:
            self._origin = message.header.stamp
        time = (message.header.stamp - self._origin) / SECOND
        return state._replace(
            time=time, q=np.array(state.q), qd=np.array(state.qd), tau=np.array(tau), q_motor=q_motor
        )

    def setpoint_js(self) -> JointState:
        """Return the latest joint setpoint that the robot reports; at rest where it reports no velocity.

        Raises:
            TransportError: The robot's state is older than `stale_after`.
        """
        state = self.measured_js()
        message = self._latest["setpoint_js"].message()
        qd = np.zeros(len(self.joint_names))
        if len(message.velocity):
            qd[:] = joint_values(message, self.joint_names, "velocity")
        return state._replace(q=np.array(self._position(message)), qd=qd)

    def operating_state(self) -> OperatingState:
        """Return the operating state.

        Raises:
            TransportError: Nothing has come from the robot for `stale_after`.
        """
        self._fresh()
        return operating_state_of(self._latest["operating_state"].message())

    def telemetry(self) -> Mapping[str, Floats]:
        """Return the latest sample of every declared column; NaN for an encoder that fell silent."""
        return {} if self._state is None else self._state.sample()

    def external_encoders(self) -> Floats:
        """Return the external encoders' reading of the joints (3,) [rad, rad, m]; NaN where there is none."""
        return np.full(3, np.nan) if self._state is None else self._state.encoder("ext_jpos")

    @property
    def age(self) -> float:
        """Seconds since the latest state came in."""
        return self._latest["measured_js"].age()

    # what it obeys

    def servo_jp(self, q: ArrayLike) -> None:
        """Send a goal (n,) [rad|m]; `wait` sends it again until the robot's setpoint is there.

        Within the limits, or where the setpoint is already beyond one, no further out.

        Raises:
            NotReadyError: The robot is not ENABLED, not homed, or busy.
            TransportError: Its state is older than `stale_after`.
            InputError: `q` has another shape, or is not finite.
        """
        require_ready(self, "servo_jp")
        self._send_goal(as_array("servo_jp", q, (len(self.joint_names),)))

    def servo_jr(self, dq: ArrayLike) -> None:
        """Move the goal by dq (n,) [rad|m] and send it; several in a tick add up.

        Raises:
            NotReadyError, TransportError, InputError: As `servo_jp`.
        """
        require_ready(self, "servo_jr")
        step = as_array("servo_jr", dq, (len(self.joint_names),))
        self._forget_what_is_not_ours()
        self._send_goal((self._setpoint() if self._goal is None else self._goal) + step)

    def servo_jf(self, tau: ArrayLike) -> None:
        """Send joint torques (n,) [Nm|N].

        Raises:
            UnsupportedCommandError: The robot takes none.
            NotReadyError, TransportError, InputError: As `servo_jp`.
        """
        require_ready(self, "servo_jf")
        effort = as_array("servo_jf", tau, (len(self.joint_names),))
        self._goal = None
        self._publish("servo_jf", effort=effort)

    def state_command(self, command: StateCommand, *, timeout: float | None = None) -> None:
        """Ask for a transition and wait until the robot confirms it.

        Args:
            command: enable, disable, pause, resume, home, unhome.
            timeout: [s]; 2 s when None, for home 180 s.

        Raises:
            UnsupportedCommandError: No such command.
            NotReadyError: The robot did not do it in time; the message says what state it is in.
            TransportError: The robot fell silent.
        """
        if command not in STATE_COMMANDS:
            raise UnsupportedCommandError(
                f'state command "{command}": expected one of {", ".join(STATE_COMMANDS)}'
            )
        self._goal = None
        begin = self.transport.steady()
        patience = timeout or (HOMING_TIMEOUT if command == "home" else COMMAND_TIMEOUT)
        settle = SETTLE if command == "home" else 0.0
        self._publishers["state_command"].publish(
            command_message(command, self._stamps.next(self.transport.now()))
        )
        latest = self._latest["operating_state"]
        while True:
            self.transport.sleep(self.period)
            elapsed = (self.transport.steady() - begin) / SECOND
            now = operating_state_of(latest.message())
            # a robot may publish its state only when it changes: then what held before holds
            is_news = latest.arrived is not None and latest.arrived > begin
            if elapsed >= settle and (is_news or elapsed > 10.0 * SETTLE) and _CONFIRMED[command](now):
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

    @property
    def late(self) -> int:
        """Ticks that began a whole period late or more."""
        return self._rate.late

    def close(self) -> None:
        """End its topics; the transport stays open."""
        for part in (*self._latest.values(), *self._publishers.values(), self._state, self._gravity):
            if part is not None:
                part.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()

    def _send_goal(self, goal: Floats) -> None:
        setpoint = self._setpoint()
        self._goal = np.clip(goal, np.minimum(self._lower, setpoint), np.maximum(self._upper, setpoint))
        self._arrived = False
        self._publish("servo_jp", position=self._goal)

    def _publish(self, verb: str, *, position: ArrayLike = (), effort: ArrayLike = ()) -> None:
        stamp = self._stamps.next(self.transport.now())
        message = joint_state_message(self.joint_names, stamp, position, effort=effort)
        self._publishers[verb].publish(message)
        self._sent = True

    def _forget_what_is_not_ours(self) -> None:
        """Forget a goal that a pedal, a restart or somebody else has overtaken."""
        if self._goal is None:
            return
        if self.age > self.stale_after or self.operating_state().state != "ENABLED":
            self._goal = None
            return
        away = float(np.abs(self._setpoint() - self._goal).max())
        if away <= REACHED:
            self._arrived = True
        elif self._arrived:
            self._goal = None

    def _setpoint(self) -> Floats:
        return self._position(self._latest["setpoint_js"].message())

    def _position(self, message: Message) -> Floats:
        return joint_values(message, self.joint_names)

    def _fresh(self) -> Message:
        """Return the latest measured_js, or refuse it as too old."""
        latest = self._latest["measured_js"]
        age = latest.age()
        if age > self.stale_after:
            raise TransportError(
                f"{latest.topic}: nothing has come from the robot for {age:.2f} s, expected at most "
                f"{self.stale_after:g} s"
            )
        return latest.message()

    def _connect(self, timeout: float) -> None:
        begin = self.transport.steady()
        while True:
            missing = self._missing()
            if not missing:
                return
            if (self.transport.steady() - begin) / SECOND >= timeout:
                raise TransportError(
                    f"the robot ({self.dialect}, {self.arm} arm) is not there after {timeout:g} s: "
                    + "; ".join(missing)
                )
            self.transport.sleep(0.01)

    def _missing(self) -> list[str]:
        """Say which topics lack messages or a listener."""
        faults, connections = [], self.transport.connections
        for latest in (*self._latest.values(), *(() if self._state is None else (self._state.latest,))):
            if latest.message() is None:
                senders = ", ".join(connections(latest.topic).publishers)
                faults.append(
                    f"{latest.topic}: {senders + ' sends nothing' if senders else 'nobody publishes it'}"
                )
        for verb in ("servo_jp", "state_command"):
            topic = self._publishers[verb].topic
            if not connections(topic).subscribers:
                faults.append(f"{topic}: nobody listens")
        return faults
