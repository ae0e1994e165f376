"""A calibration model beside a robot: joint states in, calibrated ones out, at the robot's own rate.

Published below the arm's namespace (/arm1 gold, /arm2 green, never swapped; a PSM's own), `calibrated/`:

- `measured_js`: all joints, those of the model corrected, the others as they came, with the robot's stamp;
- `measured_cp`: where the tool's tip then is, in the dialect's type;
- `is_valid` (std_msgs/Bool): whether all of the model's joints are inside its valid range. Where one is not, its fixed
  offset has been added in place of the model's correction;
- `interval` (sensor_msgs/JointState, position), where the model has intervals: their half-widths, for its joints;
- `gravity_torque` (sensor_msgs/JointState, effort) on request: what holds the positioning joints still.

Nothing is published while the robot is not homed: its joint positions mean nothing then. Nor is anything of a message
that holds NaN or lacks joints: it is counted, and the model restarts. While another input of the model (torques,
gravity) is older than the client allows, `is_valid` is false, and that is counted. After a silence the model
restarts, as its states belong to another motion. Where this program does not keep up, it publishes less,
not later: of messages that have waited too long all go into the model, and the newest is published.
"""

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from catenary.arrays import Floats
from catenary.calibration.corrector import Corrector
from catenary.calibration.model import CalibrationModel
from catenary.control.correction import SlowTorque
from catenary.control.realtime import Durations, Timing
from catenary.crtk.message import header, message_class
from catenary.crtk.message_queues import Received
from catenary.crtk.message_values import pose_message
from catenary.crtk.reader import CrtkReader
from catenary.crtk.serving.tool_pose import ToolPose
from catenary.crtk.topic_names import JOINT_STATE, TRANSFORM, calibrated_namespace, find_topic
from catenary.crtk.transport import Transport
from catenary.dvrk_psm import PSM_JOINTS
from catenary.dynamics.robot_kernels import gravity_kernel
from catenary.errors import CatenaryError, InputError, TransportError
from catenary.open_robot import KINDS, PSM, OverTopics, kind_with_joints, open_robot
from catenary.plant import JointState
from catenary.raven2.topics import JOINTS, ROBOT
from catenary.robots.catalog import load_robot
from catenary.robots.model import RobotModel
from catenary.topics import SECOND

_BOOL = "std_msgs/Bool"
_NONE = np.empty(0)


_WAITING_MESSAGES = 100  # messages that wait: 0.1 s; older ones are worth nothing
_WAIT_S = 0.05  # [s] for the next message
_LATE_AFTER_S = 0.02  # [s] after it came, a message is published only where it is the newest


@dataclass
class WireReport:
    """Report of a model deployed beside a robot."""

    joint_names: tuple[str, ...]
    seconds: float = 0.0
    messages: int = 0  # that came
    published: int = 0
    rate_hz: float | None = None  # of the robot's messages, by their stamps; None before two of them
    latency: Timing | None = None  # [s] from a message's arrival until ours was handed over
    late: int = 0  # messages that were corrected, but not published: newer ones had come meanwhile
    missed: int = 0  # messages that came faster than they were corrected
    silences: int = 0  # times that nothing came for longer than the client's limit
    longest_silence: float = 0.0  # [s]
    not_homed: int = 0  # messages of a robot that was not homed
    unreadable: int = 0  # messages that held NaN or infinity, or other joints
    stale: int = 0  # messages that were corrected while another input was too old: published as not valid
    outside: tuple[float, ...] = ()  # share of published messages outside the valid range, per joint of the model
    leaps: dict[str, int] = field(default_factory=dict)  # by input: positions that play states did not follow

    @property
    def keeps_up(self) -> bool:
        """Whether a message is corrected before the next one comes, in the median."""
        return self.rate_hz is None or self.latency is None or self.latency.median * self.rate_hz <= 1.0

    def as_data(self) -> dict[str, Any]:
        """Return plain data: times in microseconds where so named."""
        content = {**vars(self), "keeps_up": self.keeps_up}
        for name in ("latency", "longest_silence", "outside", "joint_names"):
            del content[name]
        return content | {
            "latency_us": None if self.latency is None else self.latency.in_us(),
            "longest_silence_s": self.longest_silence,
            "outside_valid_range": dict(zip(self.joint_names, self.outside, strict=True)),
        }


class CalibratedPublishers:
    """An arm's calibrated topics: what is published of a state that has been corrected."""

    def __init__(self, client: CrtkReader, model: CalibrationModel, *, gravity_torque: bool) -> None:
        self._names, self._model_names = client.joint_names, model.joint_names
        kinematics, weight = _robots(client, gravity_torque=gravity_torque)
        self._tool = ToolPose(kinematics, self._names)
        pose = find_topic(client.dialect.name, "measured_cp", client.arm, client.namespace).type
        self._child = "calibrated_tool" if pose == TRANSFORM else None
        types = {"measured_js": JOINT_STATE, "measured_cp": pose, "is_valid": _BOOL}
        if model.intervals is not None:
            types["interval"] = JOINT_STATE
        self._gravity = None if weight is None else gravity_kernel(weight)
        self._positioning = self._names[: 0 if weight is None else weight.n]
        if weight is not None:
            types["gravity_torque"] = JOINT_STATE
        place = calibrated_namespace(client.arm, client.namespace)
        self._publishers = {verb: client.transport.publisher(f"{place}/{verb}", kind) for verb, kind in types.items()}
        # what is compiled on first use is compiled here, not when messages wait
        zeros = np.zeros(len(self._names))
        self._tool.pose(zeros)
        self._torque(zeros, zeros[:3])

    def publish(self, stamp: int, state: JointState, q: Floats, widths: Floats, *, is_valid: bool) -> None:
        """Publish corrected positions q (n,) of a state, stamped as the robot did [ns]; `widths` of the model's joints.

        Their half-widths [rad|m] are published of a model that has intervals.
        """
        publishers, joint_state = self._publishers, message_class(JOINT_STATE)
        qd, tau = (row if np.isfinite(row).all() else _NONE for row in (state.qd, state.tau))  # NaN: it reports none
        publishers["measured_js"].publish(joint_state(header(stamp), self._names, q, qd, tau))
        base = self._tool.model.base
        publishers["measured_cp"].publish(pose_message(self._tool.pose(q), stamp, base, child=self._child))
        publishers["is_valid"].publish(message_class(_BOOL)(is_valid))
        if "interval" in publishers:
            publishers["interval"].publish(joint_state(header(stamp), self._model_names, widths))
        if self._gravity is not None:
            torque = self._torque(q, state.gravity)
            publishers["gravity_torque"].publish(joint_state(header(stamp), self._positioning, effort=torque))

    def close(self) -> None:
        """End its topics."""
        for publisher in self._publishers.values():
            publisher.close()

    def _torque(self, q: Floats, gravity: Floats) -> Floats:
        return _NONE if self._gravity is None else self._gravity(q[: len(self._positioning)], gravity)


class CalibratedTopics:
    """Corrects each message of an arm's measured_js and publishes the result."""

    def __init__(
        self,
        client: CrtkReader,
        model: CalibrationModel,
        *,
        rate_hz: float = 1000.0,
        gravity_torque: bool = False,
        for_control: bool = False,
    ) -> None:
        """Begin to receive and to publish, beside a RAVEN-II's arm or a dVRK PSM that publishes at a rate [Hz].

        For control that takes the corrected positions, torques reach the model through `SlowTorque`.
        """
        self._for_control = for_control
        self._client = client
        self._corrector = Corrector(model, rate_hz=rate_hz)
        self._corrector.prepare(client.joint_names, client.joint_units, rate_hz)
        self._places = [client.joint_names.index(name) for name in model.joint_names]
        self._publishers = CalibratedPublishers(client, model, gravity_torque=gravity_torque)
        n = len(client.joint_names)
        self._out, self._inside, self._interval = np.empty(n), np.empty(n, dtype=bool), np.empty(n)
        # what is compiled on first use is compiled here, not when messages wait
        zeros = np.zeros(n)
        self._corrector.correct_state(
            JointState(0.0, zeros, zeros, zeros, zeros, np.zeros(3), np.inf), self._out, self._inside, self._interval
        )
        self._reset()
        self._latency = Durations()
        self._messages = client.transport.subscribe(client.measured_topic, JOINT_STATE, depth=_WAITING_MESSAGES)
        self._begin = self._last = client.transport.steady()
        self.is_silent = False  # nothing has come from the robot for longer than the client allows
        self._counts = WireReport(model.joint_names)
        self.stale: tuple[str, ...] = ()  # inputs that are too old, in words
        # torques and the like come on other topics than positions; published torques go by gravity
        self._has_other_inputs = gravity_torque or any(not signal.startswith("q:") for signal in model.features.signals)
        self._outside = np.zeros(len(self._places))
        self._stamps: tuple[int, int, int] | None = None  # first, last [ns] and number of an unbroken run

    def step(self, timeout: float = 0.0) -> int:
        """Correct and publish what has come; wait for the first up to `timeout` [s]; return how many were published."""
        before = self._counts.published
        came = self._messages.take(timeout)
        for received in came:
            if self._note_silence(received.time):  # another motion begins, perhaps another robot's
                self._reset()
                self._stamps = None
            self.is_silent = False
            self._last = received.time
            self._counts.messages += 1
            self._correct(received, is_newest=received is came[-1])
        self._note_silence(self._client.transport.steady())
        return self._counts.published - before

    def run(self, seconds: float) -> WireReport:
        """Go on for some time [s], or until Ctrl-C when that is infinite; robots may come and go."""
        end = self._client.transport.steady() + seconds * SECOND
        while self._client.transport.steady() < end:
            self.step(_WAIT_S)
        return self.report()

    def report(self) -> WireReport:
        """Return the report so far."""
        rate = None
        if self._stamps is not None and self._stamps[1] > self._stamps[0]:
            rate = self._stamps[2] * SECOND / (self._stamps[1] - self._stamps[0])
        return replace(
            self._counts,
            seconds=(self._client.transport.steady() - self._begin) / SECOND,
            rate_hz=rate,
            latency=self._latency.timing(),
            missed=self._messages.overflowed,
            outside=tuple((self._outside / max(1, self._counts.published)).tolist()),
            leaps=self._corrector.leaps,
        )

    def close(self) -> None:
        """End its topics; the client stays."""
        self._messages.close()
        self._publishers.close()

    def _reset(self) -> None:
        self._corrector.reset()
        self._slow = SlowTorque(1.0 / self._corrector.rate_hz)

    def _note_silence(self, now: int) -> bool:
        """Return True if there has been a silence until `now` [ns]; each is counted once, when it is noticed."""
        silence = (now - self._last) / SECOND
        self._counts.longest_silence = max(self._counts.longest_silence, silence)
        if silence <= self._client.stale_after:
            return False
        if not self.is_silent:
            self._counts.silences += 1
            self.is_silent = True
        return True

    def _correct(self, received: Received, *, is_newest: bool) -> None:
        stamp, now = received.message.header.stamp, self._client.transport.steady
        if not self._is_homed():
            self._counts.not_homed += 1
            self._reset()
            return
        try:
            state = self._client.state_of(received.message)
        except CatenaryError:
            self._counts.unreadable += 1
            self._reset()
            return
        self.stale = self._client.stale_inputs() if self._has_other_inputs else ()
        self._counts.stale += bool(self.stale)
        first, _, count = self._stamps if self._stamps is not None else (stamp, stamp, -1)
        self._stamps = (first, stamp, count + 1)
        known = state._replace(tau=self._slow.of(state.tau)) if self._for_control else state
        self._corrector.correct_state(known, self._out, self._inside, self._interval)
        if not is_newest and now() - received.time > _LATE_AFTER_S * SECOND:
            self._counts.late += 1
            return
        inside = self._inside[self._places]
        self._outside += ~inside
        is_valid = bool(inside.all()) and not self.stale
        self._publishers.publish(stamp, state, self._out, self._interval[self._places], is_valid=is_valid)
        self._counts.published += 1
        self._latency.add(max(0, now() - received.time) / SECOND)

    def _is_homed(self) -> bool:
        try:
            return self._client.operating_state().is_homed
        except (TransportError, InputError):  # the messages that wait are the last ones, or a state that is none
            return False


def _robots(client: CrtkReader, *, gravity_torque: bool) -> tuple[RobotModel, RobotModel | None]:
    kind = kind_with_joints(client.joint_names, client.arm)
    if kind is None or client.joint_names != kind.joints:
        raise InputError(
            f"deploy: the kinematics are a RAVEN-II's, with joints {', '.join(JOINTS)}, or a dVRK PSM's, with "
            f"{', '.join(PSM_JOINTS)}; the robot's joints are {', '.join(client.joint_names)}"
        )
    if kind is PSM and gravity_torque:
        raise InputError("deploy: --gravity-torque: no masses are published of a PSM")
    return load_robot(kind.whole), load_robot(kind.robot) if gravity_torque else None


def reader_of(
    joints: tuple[str, ...],
    transport: Transport,
    arm: str,
    *,
    dialect: str | None = None,
    namespace: str | None = None,
    gravity: str | None = None,
) -> CrtkReader:
    """Return the robot, a PSM or else a RAVEN-II, that a model of given joints is deployed beside.

    Args:
        dialect: CRTK dialect; the robot's own when None.
        namespace: Namespace of a PSM; /PSM1 when None.
        gravity: Topic of measured gravity, if any.
    """
    kind = kind_with_joints(joints, arm) or KINDS[ROBOT[arm]]
    if kind is not PSM and namespace is not None:
        raise InputError("--namespace: the model is none of a PSM; a RAVEN-II's arms are chosen by --arm")
    return open_robot(kind.robot, OverTopics(transport, dialect, namespace, gravity=gravity, only_read=True))
