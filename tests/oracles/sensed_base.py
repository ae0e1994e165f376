"""A base with an accelerometer, and a gyroscope, that a test writes samples for, and its readings."""

import math

import numpy as np

from catenary.sensing.gravity_vector import Kind, Mailbox, ReadingStatus, tilted_gravity
from catenary.sensing.imu import SensedGravity

IDENTITY = np.eye(3)


class Base:
    """An accelerometer, and a gyroscope, that a test writes samples for; read every millisecond."""

    def __init__(self, *, angular=False, **options):
        self.mailbox = Mailbox()
        options.setdefault("stuck_samples", 0)
        self.source = SensedGravity(self.mailbox, angular=angular, **options)
        self.angular = angular
        self.time = 0.0

    def run(self, seconds, gravity=None, rate=None, *, kind=Kind.FREE_FALL, hz=100.0, step=1):
        """Let time go by, with samples of gravity(t); give the readings, one every `step` [ms]."""
        readings = []
        every = round(1000.0 / hz)
        for _ in range(round(seconds * 1000 / step)):
            tick = round(self.time * 1000)
            if gravity is not None and tick % every == 0:
                value = gravity(self.time) if callable(gravity) else gravity
                self.mailbox.put(self.time, value, kind)
                if self.angular and rate is not None:
                    self.mailbox.put(self.time, rate(self.time) if callable(rate) else rate, Kind.ANGULAR_RATE)
            readings.append(self.source.read(self.time))
            self.time = (tick + step) / 1000.0
        return readings


def fed(base, rng, times, gravity, rates, noise=0.03, distorted=IDENTITY):
    """Readings at times (T,) of samples of gravity and rates, (T, 3) or (3,), with the noise of an MPU-6050.

    The gyroscope writes `distorted` (3, 3) times what it should.
    """
    said = (rates + 9e-4 * rng.normal(size=(len(times), 3))) @ distorted.T
    sensed = gravity + noise * rng.normal(size=(len(times), 3))
    readings = []
    for now, omega, g in zip(times.tolist(), said, sensed, strict=True):
        base.mailbox.put(now, omega, Kind.ANGULAR_RATE)
        base.mailbox.put(now, g, Kind.FREE_FALL)
        readings.append(base.source.read(now))
    return readings


def is_live(readings):
    return np.array([r.status is ReadingStatus.LIVE for r in readings])


def rocking(amplitude, frequency, middle=0.0, pitch=0.0):
    """Gravity(t), and rates(t), of a base that rolls by an amplitude [rad] at a frequency [Hz] about a middle [rad]."""
    w = 2.0 * math.pi * frequency
    return (
        lambda t: tilted_gravity(middle + amplitude * math.sin(w * t), pitch),
        lambda t: [amplitude * w * math.cos(w * t), 0.0, 0.0],
    )
