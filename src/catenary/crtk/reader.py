"""CRTK reader: the state of a robot on CRTK topics, without publishing and without commands.

So any number of programs look at one robot, and a recording that is played back (`rosbag play`) is as good as a robot.
A RAVEN-II that publishes no operating state, as in a recording, tells it by the run level of its raven_state; a robot
without setpoints has NaN for them.

What came from the robot is read when it is asked for. Neither a robot that publishes slowly nor one that has died can
hold a loop up: its silence shows in `measured_js`, which refuses a state older than `stale_after`.
"""

from collections.abc import Mapping
from contextlib import ExitStack, closing
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from catenary.arrays import Floats
from catenary.crtk.dialects import dialect_named
from catenary.crtk.gravity_topic import PublishedGravity
from catenary.crtk.message import Message
from catenary.crtk.message_values import joint_state, joint_values
from catenary.crtk.message_values import operating_state as operating_state_of
from catenary.crtk.topic_names import DIAGNOSTICS, DIAGNOSTICS_TYPE, JOINT_STATE, find_topic
from catenary.crtk.transport import Latest, Transport
from catenary.errors import TransportError, UnsupportedCommandError
from catenary.plant import Bounded, Column, JointRanges, JointState, OperatingState, StateCommand
from catenary.raven2.topics import (
    CHANNELS,
    EXT_JPOS,
    JOINTS,
    RAVENSTATE,
    RAVENSTATE_100HZ,
    RUN_LEVELS,
    Arm,
    state_column,
)
from catenary.raven2.transmission import nominal_joint_torques
from catenary.robots.catalog import load_robot
from catenary.spatial import LEVEL
from catenary.topics import SECOND


class RavenTelemetry:
    """Latest raven_state, both arms' channels, and what external encoders say."""

    def __init__(self, transport: Transport, arm: Arm) -> None:
        self.latest = Latest(transport, RAVENSTATE.name, RAVENSTATE.type)
        self._throttled = Latest(transport, RAVENSTATE_100HZ.name, RAVENSTATE_100HZ.type)  # as in recordings
        self.encoders = Latest(transport, EXT_JPOS.name, EXT_JPOS.type)
        self._arm: Arm = arm

    def message(self) -> Message:
        """Return the newest raven_state, None before the first; a recording holds the throttled ones."""
        message = self.latest.message()
        return self._throttled.message() if message is None else message

    @property
    def topic(self) -> str:
        """Topic that raven_state has come on."""
        return (self._throttled if self.latest.message() is None else self.latest).topic

    def age(self) -> float:
        """Return the seconds since the newest raven_state came in."""
        return min(self.latest.age(), self._throttled.age())

    def operating_state(self) -> OperatingState:
        """Return the operating state that the run level stands for; one in FAULT reads DISABLED."""
        message = self.message()
        state = RUN_LEVELS.get(int(message.runlevel), RUN_LEVELS[0])
        # the robot's sublevel says whether all joints are homed [raven2, branch crtk: publish_ravenstate_ros]
        is_homed = state.is_homed or (state.state == "DISABLED" and message.sublevel == 1)
        return state._replace(is_homed=is_homed)

    def arm_values(self, name: str) -> Floats:
        """Return the arm's seven numbers in a field of 16 channels."""
        return state_column(self.message(), name).take(CHANNELS[self._arm])

    def close(self) -> None:
        """Receive no more."""
        for latest in (self.latest, self._throttled, self.encoders):
            latest.close()


def raven_joints(arm: Arm = "gold") -> JointRanges:
    """Return the seven joints of a RAVEN-II's arm; the tool's angle lies between the jaws, which have its limits."""
    model = load_robot("raven2_full" if arm == "gold" else "raven2_full_right")
    places = [model.joint_names.index("tool" if name.startswith("jaw") else name) for name in JOINTS]
    units = tuple(model.joint_units[place] for place in places)
    return JointRanges(JOINTS, units, model.lower[places], model.upper[places])


_STALE_AFTER_S = 0.2  # [s] without measured_js after which a robot counts as lost
_LOOKS = 10  # for what waits to be received, when nothing seems to come
_CONNECT_TIMEOUT_S = 5.0  # [s] that CRTK's own client allows
_TRACKER_VERB = "tracker/measured_js"  # below a namespace: where a tracker sees the joints, ours
_READS = ("measured_js", "setpoint_js", "operating_state")


class NeverMoved:
    """What a `Plant` that takes no commands does with them: refuse each; it has no telemetry either."""

    why_not = ""
    supports: frozenset[str] = frozenset()
    columns: tuple[Column, ...] = ()

    def telemetry(self) -> Mapping[str, Floats]:
        """Return nothing."""
        return {}

    def servo_jp(self, q: ArrayLike) -> None:
        """Refuse."""
        raise self._refused("servo_jp")

    def servo_jr(self, dq: ArrayLike) -> None:
        """Refuse."""
        raise self._refused("servo_jr")

    def servo_jf(self, tau: ArrayLike) -> None:
        """Refuse."""
        raise self._refused("servo_jf")

    def state_command(self, command: StateCommand) -> None:
        """Refuse."""
        raise self._refused(command)

    def _refused(self, verb: str) -> UnsupportedCommandError:
        return UnsupportedCommandError(f"{verb}: {self.why_not}")


class CrtkReader(NeverMoved):
    """One arm of a robot that speaks CRTK, over any transport; arrays are in the order of `joint_names`."""

    why_not = "this robot is only read"
    _obeys = False  # so that setpoints have to come

    def __init__(
        self,
        transport: Transport,
        *,
        dialect: str = "raven",
        arm: Arm = "gold",
        namespace: str | None = None,
        joints: Bounded | None = None,
        period: float = 0.001,
        gravity: str | None = None,
        stale_after: float = _STALE_AFTER_S,
        connect_timeout: float = _CONNECT_TIMEOUT_S,
        simulated: bool = False,
    ) -> None:
        """Connect to a robot; nothing is sent, and the transport stays open when the client is closed.

        One that speaks `crtk` is identified by its `namespace`, such as /PSM1, and `joints`, such as a model: a RAVEN-
        II's when None. A tick is `period` [s]; a state older than `stale_after` [s] is refused. Gravity comes from a
        topic of `catenary gravity-node`, nominal when None; `simulated` says what topics do not.
        """
        names_and_limits = raven_joints(arm) if joints is None else joints
        self.joint_names, self.joint_units = names_and_limits.joint_names, names_and_limits.joint_units
        self._lower, self._upper = names_and_limits.lower, names_and_limits.upper
        self.transport, self.arm, self.namespace = transport, arm, namespace
        self.dialect = dialect_named(dialect)
        self.period, self.stale_after, self.simulated = period, stale_after, simulated
        self._origin: int | None = None  # [ns] stamp of the first state
        self._is_silent = False
        self._open = ExitStack()  # closes what it has begun
        self._latest: dict[str, Latest] = {}
        self._state: RavenTelemetry | None = None
        # what is in front of the arm's commands, /arm1 or /PSM1: by it /diagnostics names the arm
        self.command_place = find_topic(dialect, "setpoint_js", arm, namespace).name.rpartition("/")[0]
        self._gravity: PublishedGravity | None = None
        self._tracker: Latest | None = None
        kept = self._open.enter_context
        try:
            for verb in _READS:
                topic = find_topic(dialect, verb, arm, namespace)
                self._latest[verb] = kept(closing(Latest(transport, topic.name, topic.type)))
            if self.dialect.has_run_levels:
                self._state = kept(closing(RavenTelemetry(transport, arm)))
            elif namespace is not None:
                self._tracker = kept(
                    closing(Latest(transport, f"/{namespace.strip('/')}/{_TRACKER_VERB}", JOINT_STATE))
                )
            self._diagnostics = kept(closing(Latest(transport, DIAGNOSTICS, DIAGNOSTICS_TYPE)))
            self._gravity = None if gravity is None else kept(closing(PublishedGravity(transport, gravity)))
            self._begin()
            self._connect(connect_timeout)
            self._position(self._latest["measured_js"].message())  # refuses other joints here and now
        except BaseException:
            self.close()
            raise
        self.measured_topic = self._latest["measured_js"].topic
        self._rate = transport.rate(1.0 / period)

    def _begin(self) -> None:
        """Prepare what is to be connected besides."""

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
        """Return the latest state: time since the first message by the robot, torques at the joints (raven_state)."""
        return self.state_of(self._fresh())

    def state_of(self, message: Message) -> JointState:
        """Return the joint state of a message of measured_js, with the latest torques and gravity."""
        down, age = (LEVEL.copy(), np.inf) if self._gravity is None else self._gravity.now()
        state = joint_state(message, self.joint_names, gravity=down, gravity_age=age)
        tau, q_motor = state.tau, state.q_motor
        if self._state is not None:
            tau, q_motor = nominal_joint_torques(self._state.arm_values("tau")), self._state.arm_values("mpos")
        if self._origin is None:
            self._origin = message.header.stamp
        time = (message.header.stamp - self._origin) / SECOND
        return state._replace(time=time, q=np.array(state.q), qd=np.array(state.qd), tau=np.array(tau), q_motor=q_motor)

    def setpoint_js(self) -> JointState:
        """Return the latest setpoint, at rest where no velocity is reported; NaN if none came, as of a recording."""
        state = self.measured_js()
        message = self._latest["setpoint_js"].message()
        if message is None:
            unknown = np.full(len(self.joint_names), np.nan)
            return state._replace(q=unknown, qd=unknown.copy())
        qd = np.zeros(len(self.joint_names))
        if len(message.velocity):
            qd[:] = joint_values(message, self.joint_names, "velocity")
        return state._replace(q=np.array(self._position(message)), qd=qd)

    def operating_state(self) -> OperatingState:
        """Return the operating state; where none has come, that which a RAVEN-II's run level stands for."""
        self._fresh()
        message = self._latest["operating_state"].message()
        if message is None and self._state is not None:
            return self._state.operating_state()
        return operating_state_of(message)

    @property
    def fault_reason(self) -> str:
        """Reason for the arm's FAULT from /diagnostics; empty if none is published."""
        message = self._diagnostics.message()
        for status in () if message is None else message.status:
            if status.hardware_id == self.command_place and status.message.startswith("FAULT: "):
                return str(status.message.removeprefix("FAULT: "))
        return ""

    def stale_inputs(self) -> tuple[str, ...]:
        """Return topics beside measured_js from which nothing has come for `stale_after`, with their ages."""
        heard = [] if self._state is None else [(self._state.topic, self._state.age())]
        if self._gravity is not None:
            heard.append((self._gravity.latest.topic, self._gravity.latest.age()))
        return tuple(f"{topic}: {age:.2f} s old" for topic, age in heard if age > self.stale_after)

    def external_encoders(self) -> Floats:
        """Return external encoders of a RAVEN-II's joints (3,) [rad, rad, m], else a tracker's of all; NaN without."""
        if self._state is not None:
            message = self._state.encoders.fresh(self.stale_after)
            return np.full(3, np.nan) if message is None else np.array(message.position[:3], dtype=float)
        if self._tracker is None or (message := self._tracker.fresh(self.stale_after)) is None:
            return np.full(3 if self._tracker is None else len(self.joint_names), np.nan)
        return np.array(joint_values(message, self.joint_names))

    @property
    def age(self) -> float:
        """Seconds since the latest state came in."""
        return self._latest["measured_js"].age()

    def wait(self) -> None:
        """Sleep until the next tick, on a grid of the client's own."""
        self._rate.sleep()

    @property
    def late(self) -> int:
        """Ticks that began a whole period late or more."""
        return self._rate.late

    def close(self) -> None:
        """End its topics; the transport stays open."""
        self._open.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()

    def _position(self, message: Message) -> Floats:
        return joint_values(message, self.joint_names)

    def _fresh(self) -> Message:
        """Return the latest measured_js, or refuse it as too old; when a silence begins, what waits is let in first."""
        latest = self._latest["measured_js"]
        age, left = latest.age(), _LOOKS if not self._is_silent else 0
        while age > self.stale_after and left:
            self.transport.sleep(0.25 * self.stale_after / _LOOKS)
            age, left = latest.age(), left - 1
        self._is_silent = age > self.stale_after
        if self._is_silent:
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
                where = self.namespace or f"{self.arm} arm"
                raise TransportError(
                    f"the robot ({self.dialect.name}, {where}) is not there after {timeout:g} s: " + "; ".join(missing)
                )
            self.transport.sleep(0.01)

    def _missing(self) -> list[str]:
        verbs = _READS if self._obeys else ("measured_js",) if self._state else ("measured_js", "operating_state")
        needed = [self._latest[verb] for verb in verbs]
        faults = [self._silence(latest) for latest in needed if latest.message() is None]
        measured = self._latest["measured_js"].message()
        if measured is not None and not np.isfinite(measured.position).all():
            faults.append(f"{self._latest['measured_js'].topic}: holds NaN or infinity")
        if self._state is not None and self._state.message() is None:
            faults.append(self._silence(self._state.latest))
        return faults

    def _silence(self, latest: Latest) -> str:
        senders = ", ".join(self.transport.connections(latest.topic).publishers)
        return f"{latest.topic}: {senders + ' sends nothing' if senders else 'nobody publishes it'}"
