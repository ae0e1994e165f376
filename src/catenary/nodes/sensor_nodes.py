"""Sensors as topics, at a rate: gravity in the base frame, checked, with a fallback; the encoders at the joints."""

import math
from collections.abc import Callable
from typing import Any, NamedTuple, Protocol

import numpy as np

from catenary.control.loop_report import GravityTally
from catenary.crtk.message import header, message_class
from catenary.crtk.message_values import Stamps, joint_state_message, operating_state
from catenary.crtk.topic_names import JOINT_STATE, find_topic
from catenary.crtk.transport import Latest, Publisher, Transport
from catenary.devices.encoder_board import EncoderBoard, EncoderReading
from catenary.dynamics.robot_kernels import gravity_kernel, holding_kernel
from catenary.errors import InputError
from catenary.gravity.vendors import in_controller_base, vendor_command
from catenary.raven2.topics import EXT_JPOS, JOINT_ENC
from catenary.robots.model import RobotModel
from catenary.sensing.gravity_vector import GravityReading, ReadingStatus, tilt_angle
from catenary.sensing.imu import SensedGravity
from catenary.sensing.imu_faults import Fault
from catenary.spatial import LEVEL
from catenary.topics import SECOND

TOPIC = "/gravity"
_STATUS_EVERY_S = 1.0  # [s]; and whenever it changes
# [s], [m/s2]: a program of set_gravity for a Universal Robot at most so often, and when gravity has moved by so much
_SCRIPT_EVERY_S, _SCRIPT_CHANGE = 0.5, 0.1
_NOT_MEASURED = [-1.0] + 8 * [0.0]  # a covariance that says so, of sensor_msgs/Imu
_JOINTS_HELD_S = 0.1  # [s] for which joints' positions count
_STRIPPED_HINT = (
    "known to do so: a BNO055's LIA registers, dmpGetLinearAccel of MPU-6050 libraries, Xsens' "
    "filter/free_acceleration, Android's linear acceleration sensor; take imu/data_raw or its like instead"
)


class GravityStatus(NamedTuple):
    """Status of the node."""

    seconds: float  # since it began
    reading: GravityReading
    published: int  # vectors
    subscribers: int
    is_up: bool  # whether the transport's network answers
    link: dict[str, Any]  # counts of the sensor's line or topic
    base: str  # the frame whose axes these are
    remedy: str = ""  # what mends a gyroscope that does not turn as gravity does
    complaint: str = ""  # why nothing is known of an arm

    @property
    def warnings(self) -> tuple[str, ...]:
        """Faults, each with its name and what to do."""
        hints = {Fault.GRAVITY_STRIPPED: f"; {_STRIPPED_HINT}"}
        faults = tuple(f"{fault.names[0]}: {fault.message}{hints.get(fault, '')}" for fault in self.reading.faults)
        remarks = (f"the gyroscope: {self.remedy}" if self.remedy else "", self.complaint)
        return (*faults, *filter(None, remarks))

    def as_data(self) -> dict[str, Any]:
        """Return plain data, in SI and degrees where the name says so."""
        data = self._asdict()
        reading: GravityReading = data.pop("reading")
        return data | {
            "status": reading.status.value,
            "gravity": reading.gravity,
            "magnitude": float(np.linalg.norm(reading.gravity)),
            "tilt_deg": float(np.degrees(tilt_angle(reading.gravity))),
            "age_s": reading.age,
            "faults": list(reading.faults.names),
            "warnings": list(self.warnings),
        }


class LevelBaseArm(NamedTuple):
    """An arm whose firmware compensates for gravity of a level base, and what tells its joints."""

    model: RobotModel
    joints: str  # topic of sensor_msgs/JointState


class GravityNode:
    """Publishes the reading of a source: `gravity` [m/s2, base axes, downwards], and beside it `gravity/status`.

    Of an arm whose firmware knows a level base it publishes what is left to add beside it, `gravity/delta`: effort of a
    sensor_msgs/JointState [Nm|N] that holds the arm still on the base as it is, less what does on a level one, while
    gravity is live and the joints are known. The turning of the base counts.

    `gravity/imu` is what an inertial unit in the base's origin reads, with the covariance of its specific force, and
    `gravity/magnitude` gravity's length [m/s2]. The status is text: live, degraded, nominal, stale or fallback, then
    the faults' names. Of a source that says `stop`, only the status is published.
    """

    def __init__(
        self,
        transport: Transport,
        source: SensedGravity,
        *,
        topic: str = TOPIC,
        frame_id: str | None = None,
        urscript: str | None = None,
        arm: LevelBaseArm | None = None,
        link: Callable[[], dict[str, Any]] = dict,
    ) -> None:
        """Publish on `topic`, of the frame that the sensor's mounting leads to where no other name is given.

        What is live goes also to `urscript`, as programs of set_gravity, and as torques to add for an `arm`; `link`
        gives counts of the sensor's line or topic.
        """
        self.transport, self.source, self._link = transport, source, link
        self._reading: GravityReading | None = None
        self.frame_id = source.mounting.base if frame_id is None else frame_id
        self.tally, self.published = GravityTally(), 0
        self._vector = transport.publisher(topic, "geometry_msgs/Vector3Stamped")
        self._imu = transport.publisher(f"{topic}/imu", "sensor_msgs/Imu")
        self._magnitude = transport.publisher(f"{topic}/magnitude", "std_msgs/Float64")
        self._status = transport.publisher(f"{topic}/status", "crtk_msgs/StringStamped", latch=True)
        self._script = None if urscript is None else transport.publisher(urscript, "std_msgs/String")
        if urscript is not None:
            in_controller_base("ur", source.mounting.base, LEVEL)  # refuses axes that it cannot bring there
        self._scripted, self._scripted_at = np.zeros(3), -np.inf
        self._arm, self.complaint = arm, ""  # why nothing is known of an arm
        if arm is not None:
            arm.model.require_inertia()
            self._kernels = holding_kernel(arm.model), gravity_kernel(arm.model)
            self._joints = Latest(transport, arm.joints, "sensor_msgs/JointState")
            self._delta = transport.publisher(f"{topic}/delta", "sensor_msgs/JointState")
        self._stamps, self._last_status, self._last_status_at = Stamps(transport.clock), "", -np.inf

    def step(self) -> GravityReading:
        """Read the source now, and publish."""
        time = self.transport.steady() / SECOND
        stamp = self._stamps.next(self.transport.steady())
        reading = self._reading = self.source.read(time)
        self.tally.add(reading)
        if reading.status is not ReadingStatus.STOP:
            head, xyz = header(stamp, self.frame_id), message_class("geometry_msgs/Vector3")
            gravity = xyz(*reading.gravity.tolist())
            self._vector.publish(message_class("geometry_msgs/Vector3Stamped")(head, gravity))
            self._imu.publish(
                message_class("sensor_msgs/Imu")(
                    head,
                    orientation_covariance=_NOT_MEASURED,
                    angular_velocity=xyz(*reading.base_rates[0].tolist()),
                    linear_acceleration=xyz(*(-reading.gravity).tolist()),
                    linear_acceleration_covariance=_NOT_MEASURED if math.isinf(reading.deviation)
                    else reading.covariance.ravel().tolist(),
                )
            )  # fmt: skip
            self._magnitude.publish(message_class("std_msgs/Float64")(float(np.linalg.norm(reading.gravity))))
            self.published += 1
        if self._script is not None and reading.status is ReadingStatus.LIVE:
            self._send_to_robot(self._script, reading, time)
        if self._arm is not None:
            self._publish_delta(self._arm, reading, stamp)
        text = " ".join((reading.status.value, *reading.faults.names))
        if text != self._last_status or time - self._last_status_at >= _STATUS_EVERY_S:
            self._last_status, self._last_status_at = text, time
            self._status.publish(message_class("crtk_msgs/StringStamped")(header(stamp, self.frame_id), text))
        return reading

    def _publish_delta(self, arm: LevelBaseArm, reading: GravityReading, stamp: int) -> None:
        names, message = arm.model.joint_names, self._joints.fresh(_JOINTS_HELD_S)
        if message is None:
            self.complaint = f"no delta: no joints on {arm.joints}"
            return
        positions = dict(zip(message.name, message.position, strict=False))
        missing = [name for name in names if not math.isfinite(positions.get(name, math.nan))]
        self.complaint = f"no delta: {arm.joints} tells nothing of {', '.join(missing)}" if missing else ""
        if missing or reading.status is not ReadingStatus.LIVE:
            return
        q, (holding, gravity) = np.array([positions[name] for name in names]), self._kernels
        beyond = holding(q, reading.gravity, *reading.base_rates) - gravity(q, LEVEL)
        self._delta.publish(joint_state_message(names, stamp, effort=beyond))

    def _send_to_robot(self, script: Publisher, reading: GravityReading, time: float) -> None:
        """Send a Universal Robot's controller gravity that has changed, in a program beside the one that runs."""
        moved = float(np.linalg.norm(reading.gravity - self._scripted))
        if moved < _SCRIPT_CHANGE or time - self._scripted_at < _SCRIPT_EVERY_S:
            return
        self._scripted, self._scripted_at = reading.gravity, time
        command = vendor_command("ur", in_controller_base("ur", self.source.mounting.base, reading.gravity))
        program = f"sec catenary_gravity():\n  {command}\nend\n"
        script.publish(message_class("std_msgs/String")(program))

    def status(self, seconds: float) -> GravityStatus:
        """Return the status, `seconds` after the start."""
        listeners = len(self.transport.connections(self._vector.topic).subscribers)
        reading = self._reading or self.source.read(self.transport.steady() / SECOND)
        counts = self.published, listeners, self.transport.is_up(), self._link()
        return GravityStatus(seconds, reading, *counts, self.frame_id, self.source.remedy, self.complaint)


STATE_TOPIC = find_topic("raven", "operating_state", "gold").name
RATE = 200.0  # [Hz] of looks at the board, which sends on its own


class EncoderStatus(NamedTuple):
    """Status of the node."""

    seconds: float  # since it began
    reading: EncoderReading
    robot: str  # its operating state, as last heard; empty when nothing was
    published: dict[str, int]  # messages by topic
    subscribers: int  # programs that listen to either
    is_up: bool  # whether the transport's network answers

    def as_data(self) -> dict[str, Any]:
        """Return plain data: counts, rad and m."""
        data = self._asdict() | self.reading._asdict()
        del data["reading"]
        return data | {"line": data.pop("tally")}


class EncoderNode:
    """Publishes each good row as `joint_enc`, and as `ext_jpos` [rad, rad, m] while it is registered.

    Unknown positions are not published, rather than as zeros. The robot's operating state goes to the board, which
    registers while the robot homes.
    """

    def __init__(self, board: EncoderBoard, transport: Transport, *, state_topic: str = STATE_TOPIC) -> None:
        self.board, self.transport = board, transport
        self.robot = ""
        self._joint_enc = transport.publisher(JOINT_ENC.name, JOINT_STATE)
        self._ext_jpos = transport.publisher(EXT_JPOS.name, JOINT_STATE)
        self._states = transport.subscribe(state_topic, "crtk_msgs/OperatingState")
        self._stamps = Stamps(transport.clock)
        self.published = {JOINT_ENC.name: 0, EXT_JPOS.name: 0}

    def step(self) -> int:
        """Publish the rows that have arrived since the last call; return how many."""
        for message, _ in self._states.take():
            try:
                state = operating_state(message)
            except InputError:
                continue  # a state of another kind of robot says nothing of homing
            self.robot = state.state + " homed" * state.is_homed + " busy" * state.is_busy
            self.board.set_robot_state(is_busy=state.is_busy, is_homed=state.is_homed)
        samples = self.board.take()
        # from the board's clock to the transport's
        shift = self.transport.steady() - round(self.board.now() * SECOND)
        names = JOINT_ENC.joint_names
        for sample in samples:
            stamp = self._stamps.next(round(sample.time * SECOND) + shift)
            self._joint_enc.publish(joint_state_message(names, stamp, sample.counts))
            self.published[JOINT_ENC.name] += 1
            if sample.is_valid:
                self._ext_jpos.publish(joint_state_message(names, stamp, sample.q_encoder))
                self.published[EXT_JPOS.name] += 1
        return len(samples)

    def status(self, seconds: float) -> EncoderStatus:
        """Return the status, `seconds` after the start."""
        connections = self.transport.connections
        listeners = {name for topic in self.published for name in connections(topic).subscribers}
        reading, is_up = self.board.reading(), self.transport.is_up()
        return EncoderStatus(seconds, reading, self.robot, dict(self.published), len(listeners), is_up)


class SteppedNode(Protocol):
    """A node that is stepped at a rate."""

    transport: Transport

    def step(self) -> Any:
        """Publish what there is now."""

    def status(self, seconds: float) -> Any:
        """Return the status, `seconds` after the start."""


def publish(
    node: SteppedNode,
    *,
    rate_hz: float,
    duration: float | None = None,
    show: Callable[[Any], None] = lambda status: None,
) -> Any:
    """Step a node at a rate until the duration is over, its transport closed, or Ctrl-C; return the last status.

    Args:
        rate_hz: Rate [Hz].
        duration: Time [s]; until Ctrl-C when None.
        show: Called with a status every second.
    """
    if duration is not None and not duration > 0.0:
        raise InputError(f"duration: expected more than 0 s, got {duration}")
    transport = node.transport
    rate = transport.rate(rate_hz)
    begin = shown = now = transport.steady()
    try:
        node.step()
        while duration is None or now - begin < duration * SECOND:
            rate.sleep()
            node.step()
            now = transport.steady()
            if now - shown >= SECOND:
                shown = now
                show(node.status((now - begin) / SECOND))
    except KeyboardInterrupt:
        pass  # somebody ended it
    return node.status((now - begin) / SECOND)
