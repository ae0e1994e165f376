"""The newest message of a topic, for programs that look at a robot once a tick."""

from typing import NamedTuple

import numpy as np

from catenary.arrays import Floats
from catenary.crtk.clock import SECOND
from catenary.crtk.conversions import specific_force
from catenary.crtk.message import Message
from catenary.crtk.transport import Transport
from catenary.errors import InputError
from catenary.sensing.checks import SensorRules
from catenary.sensing.mounting import Mounting
from catenary.sensing.vector import Kind
from catenary.spatial import LEVEL

PUBLISHED = 1.0, 30.0  # [m/s2] of gravity that a node has judged already, on bases that accelerate


class Latest:
    """Keeps the newest message of a topic; older ones that came since are dropped unread."""

    def __init__(self, transport: Transport, topic: str, type_name: str) -> None:
        """Begin to receive."""
        self.topic = topic
        self._transport = transport
        self._subscription = transport.subscribe(topic, type_name, depth=1)
        self._message: Message = None
        self.arrived: int | None = None  # [ns] by the transport's `steady`; None before the first message

    def message(self) -> Message:
        """Return the newest message, or None before the first."""
        for received in self._subscription.take():
            self._message, self.arrived = received
        return self._message

    def age(self) -> float:
        """Return the seconds since the newest message came in; infinite before the first.

        By arrival, not by stamp: the robot's clock need not be ours.
        """
        self.message()
        if self.arrived is None:
            return np.inf
        return max(0, self._transport.steady() - self.arrived) / SECOND

    def close(self) -> None:
        """Receive no more."""
        self._subscription.close()


class ImuTopic(NamedTuple):
    """Where gravity comes from: an accelerometer on the robot's base, or a program that publishes gravity itself."""

    topic: str = "/imu/data_raw"
    type_name: str = "sensor_msgs/Imu"  # or geometry_msgs/AccelStamped, geometry_msgs/Vector3Stamped
    mounting: Mounting = Mounting()
    kind: Kind = Kind.SPECIFIC_FORCE  # FREE_FALL: vectors are gravity itself, which points down
    rules: SensorRules = SensorRules()  # what of an accelerometer's readings is believed, by their length

    @property
    def plausible(self) -> tuple[float, float]:
        """Least and largest length of a vector that may be gravity, and slow accelerations of the base [m/s2]."""
        if self.kind is Kind.FREE_FALL:
            return PUBLISHED
        slow = self.rules.slow_acceleration
        return self.rules.rest_lower - slow, self.rules.rest_upper + slow


def published_gravity(topic: str) -> ImuTopic:
    """Return the topic on which `catenary gravity-node` publishes gravity in base axes, its status beside it."""
    return ImuTopic(topic, "geometry_msgs/Vector3Stamped", kind=Kind.FREE_FALL)


class MeasuredGravity:
    """Gravity in the base frame from a topic; what cannot be gravity is left out.

    A reading is as old as its message. What a gravity node publishes while it does not measure (its status is not
    "live") is taken for gravity, but is as old as the last that was measured.
    """

    def __init__(self, transport: Transport, imu: ImuTopic) -> None:
        """Begin to receive."""
        self.latest = Latest(transport, imu.topic, imu.type_name)
        self._mounting, self._kind, self._plausible = imu.mounting, imu.kind, imu.plausible
        self._transport = transport
        self._status = (
            Latest(transport, f"{imu.topic}/status", "crtk_msgs/StringStamped")
            if imu.kind is Kind.FREE_FALL
            else None
        )
        self._seen: int | None = None  # arrival of the newest message that was looked at
        self._measured: int | None = None  # arrival of the newest plausible one
        self._gravity = LEVEL.copy()

    def now(self) -> tuple[Floats, float]:
        """Return gravity (3,) [m/s2] and its age [s]; nominal and infinitely old before the first reading."""
        message = self.latest.message()
        if self.latest.arrived != self._seen:
            self._seen = self.latest.arrived
            self._take(message)
        if self._measured is None:
            return self._gravity.copy(), np.inf
        return self._gravity.copy(), max(0, self._transport.steady() - self._measured) / SECOND

    def close(self) -> None:
        """Receive no more."""
        self.latest.close()
        if self._status is not None:
            self._status.close()

    def _take(self, message: Message) -> None:
        try:
            gravity = self._mounting.gravity(specific_force(message), self._kind)
        except InputError:  # NaN, or an Imu that measures no acceleration
            return
        if not self._plausible[0] < np.linalg.norm(gravity) < self._plausible[1]:
            return
        self._gravity = gravity
        status = None if self._status is None else self._status.message()
        if status is None or status.string.split()[:1] == ["live"]:
            self._measured = self._seen
