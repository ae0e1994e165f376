"""The newest message of a topic, for programs that look at a robot once a tick."""

from typing import NamedTuple

import numpy as np

from catenary.arrays import Floats
from catenary.crtk.clock import SECOND
from catenary.crtk.conversions import specific_force
from catenary.crtk.message import Message
from catenary.crtk.transport import Transport
from catenary.gravity.vector import LEVEL

PLAUSIBLE = 9.0, 10.6  # [m/s2] what an accelerometer at rest reads, with room for its errors and slow motion


class Latest:
    """Keeps the newest message of a topic; older ones that came since are dropped unread."""

    def __init__(self, transport: Transport, topic: str, type_name: str) -> None:
        """Begin to receive.

        Raises:
            TransportError: The topic carries another type.
        """
        self.topic = topic
        self.type_name = type_name
        self._transport = transport
        self._subscription = transport.subscribe(topic, type_name, depth=1)
        self._message: Message = None
        self.arrived: int | None = None  # [ns] by the transport's clock; None before the first message

    def message(self) -> Message:
        """Newest message, or None before the first."""
        for received in self._subscription.take():
            self._message, self.arrived = received
        return self._message

    def age(self) -> float:
        """Seconds since the newest message came in; infinite before the first.

        By arrival, not by stamp: the robot's clock need not be ours.
        """
        self.message()
        if self.arrived is None:
            return np.inf
        return max(0, self._transport.now() - self.arrived) / SECOND

    def close(self) -> None:
        """Receive no more."""
        self._subscription.close()


class ImuTopic(NamedTuple):
    """An accelerometer on the robot's base."""

    topic: str = "/imu/data_raw"
    type_name: str = "sensor_msgs/Imu"  # or geometry_msgs/AccelStamped, geometry_msgs/Vector3Stamped
    R_base_imu: Floats = np.eye(3)


class MeasuredGravity:
    """Gravity in the base frame from an accelerometer's topic; what is no gravity is left out and counted."""

    def __init__(self, transport: Transport, imu: ImuTopic) -> None:
        """Begin to receive."""
        self.latest = Latest(transport, imu.topic, imu.type_name)
        self.implausible = 0
        self._R_base_imu = np.array(imu.R_base_imu, dtype=float)
        self._transport = transport
        self._seen: int | None = None  # arrival of the newest message that was looked at
        self._measured: int | None = None  # arrival of the newest plausible one
        self._gravity = LEVEL.copy()

    def now(self) -> tuple[Floats, float]:
        """Gravity (3,) [m/s2] and its age [s]; nominal and infinitely old before the first reading."""
        message = self.latest.message()
        if self.latest.arrived != self._seen:
            self._seen = self.latest.arrived
            gravity = -(self._R_base_imu @ specific_force(message))
            if PLAUSIBLE[0] < np.linalg.norm(gravity) < PLAUSIBLE[1]:
                self._gravity, self._measured = gravity, self._seen
            else:
                self.implausible += 1
        if self._measured is None:
            return self._gravity.copy(), np.inf
        return self._gravity.copy(), max(0, self._transport.now() - self._measured) / SECOND
