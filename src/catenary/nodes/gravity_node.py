"""Gravity in the base frame as a topic: from a sensor's topic or serial line, checked, with a fallback."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from catenary.control.loop_report import GravityTally
from catenary.crtk.gravity_topic import now_of
from catenary.crtk.message import header, message_class
from catenary.crtk.message_values import Stamps
from catenary.crtk.transport import Publisher, Transport
from catenary.errors import InputError
from catenary.gravity.vendors import vendor_command
from catenary.sensing.checks import Fault
from catenary.sensing.imu import SensedGravity
from catenary.sensing.vector import GravityReading, ReadingStatus, tilt_angle

TOPIC, FRAME = "/gravity", "base"
STATUS_EVERY = 1.0  # [s]; and whenever it changes
# [s], [m/s2]: a program of set_gravity for a Universal Robot at most so often, and when gravity has moved by so much
SCRIPT_EVERY, SCRIPT_FROM = 0.5, 0.1
STRIPPED_HINT = (
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
    remedy: str = ""  # what mends a gyroscope that does not turn as gravity does

    @property
    def warnings(self) -> tuple[str, ...]:
        """Faults, each with its name and what to do."""
        found = tuple(f"{fault.names[0]}: {warning(fault)}" for fault in self.reading.faults)
        return (*found, f"the gyroscope: {self.remedy}") if self.remedy else found

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


def warning(fault: Fault) -> str:
    """Return what a fault means; for removed gravity also which drivers are known to do it."""
    return f"{fault.message}; {STRIPPED_HINT}" if fault is Fault.GRAVITY_STRIPPED else fault.message


class GravityNode:
    """Publishes the reading of a source: `gravity` [m/s2, base axes, downwards], and beside it `gravity/status`.

    The status is text: live, nominal, stale or fallback, then the faults' names. Of a source that says
    `stop`, no vector is published.
    """

    def __init__(
        self,
        transport: Transport,
        source: SensedGravity,
        *,
        topic: str = TOPIC,
        frame_id: str = FRAME,
        urscript: str | None = None,
    ) -> None:
        """Publish on `topic`; what is live also as programs of set_gravity on `urscript`, where that is given."""
        self.transport, self.source, self.frame_id = transport, source, frame_id
        self.tally, self.published = GravityTally(), 0
        self._vector = transport.publisher(topic, "geometry_msgs/Vector3Stamped")
        self._status = transport.publisher(f"{topic}/status", "crtk_msgs/StringStamped", latch=True)
        self._script = None if urscript is None else transport.publisher(urscript, "std_msgs/String")
        self._scripted, self._scripted_at = np.zeros(3), -np.inf
        self._stamps, self._said, self._said_at = Stamps(transport.clock), "", -np.inf

    def step(self) -> GravityReading:
        """Read the source now, and publish."""
        time = now_of(self.transport)
        stamp = self._stamps.next(self.transport.steady())
        reading = self.source.read(time)
        self.tally.add(reading)
        if reading.status is not ReadingStatus.STOP:
            x, y, z = reading.gravity.tolist()
            vector = message_class("geometry_msgs/Vector3")(x, y, z)
            head = header(stamp, self.frame_id)
            self._vector.publish(message_class("geometry_msgs/Vector3Stamped")(head, vector))
            self.published += 1
        if self._script is not None and reading.status is ReadingStatus.LIVE:
            self._tell_robot(self._script, reading, time)
        text = " ".join((reading.status.value, *reading.faults.names))
        if text != self._said or time - self._said_at >= STATUS_EVERY:
            self._said, self._said_at = text, time
            self._status.publish(message_class("crtk_msgs/StringStamped")(header(stamp, self.frame_id), text))
        return reading

    def _tell_robot(self, script: Publisher, reading: GravityReading, time: float) -> None:
        """Send a Universal Robot's controller gravity that has changed, in a program beside the one that runs."""
        moved = float(np.linalg.norm(reading.gravity - self._scripted))
        if moved < SCRIPT_FROM or time - self._scripted_at < SCRIPT_EVERY:
            return
        self._scripted, self._scripted_at = reading.gravity, time
        program = f"sec catenary_gravity():\n  {vendor_command('ur', reading.gravity)}\nend\n"
        script.publish(message_class("std_msgs/String")(program))

    def subscribers(self) -> int:
        """Return the number of programs that listen."""
        return len(self.transport.connections(self._vector.topic).subscribers)


def publish_gravity(
    node: GravityNode,
    *,
    rate_hz: float = 100.0,
    duration: float | None = None,
    link: Callable[[], dict[str, Any]] = dict,
    show: Callable[[GravityStatus], None] = lambda status: None,
) -> GravityStatus:
    """Publish at a rate until the duration [s] is over, the transport closed, or Ctrl-C; return the last status.

    `show` gets a status every second.
    """
    if duration is not None and not duration > 0.0:
        raise InputError(f"duration: expected more than 0 s, got {duration}")
    transport = node.transport
    rate = transport.rate(rate_hz)
    begin = shown = now_of(transport)
    reading = node.step()

    def status(now: float) -> GravityStatus:
        said = node.source.remedy
        return GravityStatus(now - begin, reading, node.published, node.subscribers(), transport.is_up(), link(), said)

    now = begin
    try:
        while duration is None or now - begin < duration:
            rate.sleep()
            reading, now = node.step(), now_of(transport)
            if now - shown >= 1.0:
                shown = now
                show(status(now))
    except KeyboardInterrupt:
        pass  # somebody ended it
    return status(now)
