"""Gravity out of topics: an accelerometer's Imu, AccelStamped and Vector3Stamped, or what a gravity node publishes.

`MeasuredGravity` is the newest reading, for a client; `GravityTopic` puts all samples into a mailbox, for an estimator.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from catenary.arrays import Floats
from catenary.crtk.clock import SECOND
from catenary.crtk.message import Message, message_class
from catenary.crtk.message_values import MEASURED, seconds, specific_force
from catenary.crtk.transport import Latest, Transport
from catenary.errors import InputError
from catenary.sensing.checks import SensorRules
from catenary.sensing.mounting import Mounting
from catenary.sensing.vector import Kind, Mailbox
from catenary.spatial import LEVEL

PUBLISHED = 1.0, 30.0  # [m/s2] of gravity that a node has judged already, on bases that accelerate


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
        self.latest = Latest(transport, imu.topic, imu.type_name)
        self._mounting, self._kind, self._plausible = imu.mounting, imu.kind, imu.plausible
        self._transport = transport
        self._status = (
            Latest(transport, f"{imu.topic}/status", "crtk_msgs/StringStamped") if imu.kind is Kind.FREE_FALL else None
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


IMU, ACCEL, VECTOR = "sensor_msgs/Imu", "geometry_msgs/AccelStamped", "geometry_msgs/Vector3Stamped"
TYPES = (IMU, ACCEL, VECTOR)


@dataclass
class TopicTally:
    """Counts of what came over the topic."""

    messages: int = 0
    unstamped: int = 0  # whose stamp was never set: taken for the time at which they came
    without_acceleration: int = 0  # Imus that say (covariance -1) that they measure none
    without_rates: int = 0  # the same of angular rates
    overflowed: int = 0  # came faster than they were taken
    damaged: int = 0


class GravityTopic:
    """Subscribes to a sensor, and puts its samples into a mailbox whenever `feed` is called.

    Nothing is judged here: the estimator names NaN, other units and stamps that go back. Stamps are those of
    the headers, in seconds on the transport's `steady` clock, which goes on where the clock of the day is set.
    """

    def __init__(
        self, transport: Transport, topic: str, type_name: str, mailbox: Mailbox, *, points_down: bool = False
    ) -> None:
        """Subscribe.

        Args:
            type_name: One of TYPES.
            points_down: The vectors are free-fall acceleration, gravity itself; else specific force, which points up
                at rest, as accelerometers and sensor_msgs/Imu have it.
        """
        if type_name not in TYPES:
            raise InputError(f'topic {topic}: type "{type_name}": expected one of {", ".join(TYPES)}')
        self.topic, self.type_name, self.mailbox = topic, type_name, mailbox
        self.frame_id = ""  # of the last message
        self.tally = TopicTally()
        self._kind = Kind.FREE_FALL if points_down else Kind.SPECIFIC_FORCE
        self._transport = transport
        self._subscription = transport.subscribe(topic, type_name)

    def feed(self, time: float) -> None:  # samples bring their own
        """Put what has come into the mailbox; SensedGravity calls it on each read."""
        for message, arrived in self._subscription.take():
            self._put(message, arrived)
        self.tally.overflowed = self._subscription.overflowed
        self.tally.damaged = self._subscription.damaged

    def _put(self, message: Message, arrived: int) -> None:
        tally, header = self.tally, message.header
        tally.messages += 1
        self.frame_id = header.frame_id
        if header.stamp == 0:
            tally.unstamped += 1
        stamp = seconds(header.stamp - self._transport.clock.set_by() if header.stamp else arrived)
        if isinstance(message, message_class(IMU)):
            # rates first: when gravity is looked at, how the base turned meanwhile is known
            if message.angular_velocity_covariance[0] == -1.0:
                tally.without_rates += 1
            else:
                self.mailbox.put(stamp, tuple(message.angular_velocity), Kind.ANGULAR_RATE)
            if message.linear_acceleration_covariance[0] == -1.0:
                tally.without_acceleration += 1
            else:
                self.mailbox.put(stamp, tuple(message.linear_acceleration), self._kind)
        else:
            self.mailbox.put(stamp, tuple(MEASURED[type(message)](message)), self._kind)


def now_of(transport: Transport) -> float:
    """Return the time [s] on the clock of the samples."""
    return transport.steady() / SECOND
