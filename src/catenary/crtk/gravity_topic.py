"""Gravity out of topics: what a gravity node publishes, and an accelerometer's Imu, AccelStamped or Vector3Stamped.

`PublishedGravity` is a node's newest vector, for a client; `GravityTopic` puts all samples of a sensor into a mailbox,
for an estimator.
"""

from collections.abc import Callable
from dataclasses import dataclass
from operator import attrgetter
from typing import Any

import numpy as np

from catenary.arrays import Floats
from catenary.crtk.message import Message, message_class
from catenary.crtk.topic_names import COMMAND
from catenary.crtk.transport import Latest, Transport
from catenary.errors import InputError
from catenary.sensing.gravity_vector import Kind, Mailbox
from catenary.spatial import LEVEL
from catenary.topics import SECOND

_PLAUSIBLE_GRAVITY = 1.0, 30.0  # [m/s2] of gravity that a node has judged already, on bases that accelerate

_IMU, _ACCEL, _VECTOR = "sensor_msgs/Imu", "geometry_msgs/AccelStamped", "geometry_msgs/Vector3Stamped"
GRAVITY_TYPES = (_IMU, _ACCEL, _VECTOR)
# the vector of an accelerometer's message, by type
_MEASURED: dict[Any, Callable[[Message], Message]] = {
    message_class(_IMU): attrgetter("linear_acceleration"),
    message_class(_ACCEL): attrgetter("accel.linear"),
    message_class(_VECTOR): attrgetter("vector"),
}


class PublishedGravity:
    """Gravity in base axes as `catenary gravity-node` publishes it; it ages while its status is not "live"."""

    def __init__(self, transport: Transport, topic: str) -> None:
        self.latest = Latest(transport, topic, _VECTOR)
        self._status = Latest(transport, f"{topic}/status", COMMAND)
        self._transport = transport
        self._seen: int | None = None  # arrival of the newest message that was looked at
        self._measured: int | None = None  # arrival of the newest that was measured
        self._gravity = LEVEL.copy()

    def now(self) -> tuple[Floats, float]:
        """Return gravity (3,) [m/s2] and its age [s]; nominal and infinitely old before the first reading."""
        message = self.latest.message()
        if self.latest.arrived != self._seen:
            self._seen = self.latest.arrived
            gravity = np.array(message.vector)
            if _PLAUSIBLE_GRAVITY[0] < np.linalg.norm(gravity) < _PLAUSIBLE_GRAVITY[1]:  # NaN is not
                self._gravity = gravity
                status = self._status.message()
                if status is None or status.string.split()[:1] == ["live"]:
                    self._measured = self._seen
        if self._measured is None:
            return self._gravity.copy(), np.inf
        return self._gravity.copy(), max(0, self._transport.steady() - self._measured) / SECOND

    def close(self) -> None:
        """Receive no more."""
        self.latest.close()
        self._status.close()


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
    """Puts a sensor's samples, by their stamps on the `steady` clock, into a mailbox at each `feed`; judges none."""

    def __init__(
        self, transport: Transport, topic: str, type_name: str, mailbox: Mailbox, *, points_down: bool = False
    ) -> None:
        """Subscribe to a topic of GRAVITY_TYPES: specific force, up at rest; gravity itself where `points_down`."""
        if type_name not in GRAVITY_TYPES:
            raise InputError(f'topic {topic}: type "{type_name}": expected one of {", ".join(GRAVITY_TYPES)}')
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
        stamp = (header.stamp - self._transport.clock.set_by() if header.stamp else arrived) / SECOND
        if isinstance(message, message_class(_IMU)):
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
            self.mailbox.put(stamp, tuple(_MEASURED[type(message)](message)), self._kind)
