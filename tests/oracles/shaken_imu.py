"""An inertial unit on a base that moves and shakes, by numbers alone: shares nothing with the package's simulator.

A base is turned by angles about fixed axes, one after another; its origin accelerates. What a sensor at a place reads
follows from the definition of angular velocity, by differences on a grid ten times finer than its samples.
"""

import math
from dataclasses import dataclass, field

import numpy as np
from scipy.spatial.transform import Rotation

X, Y, Z = np.eye(3)
G = np.array([0.0, 0.0, -9.81])
FINE = 10  # points between samples
TRUE_BIAS, TRUE_RATE_BIAS = np.array([0.05, -0.05, 0.05]), np.array([0.01, -0.01, 0.01])


def still(t):
    """Return no motion, (T,)."""
    return 0.0 * t


def begun(t, after, lasts=1.0):
    """Return 0 before a time [s], 1 `lasts` after it, smoothly between (T,)."""
    s = np.clip((t - after) / lasts, 0.0, 1.0)
    return s**3 * (10.0 - 15.0 * s + 6.0 * s * s)


def spin(deg_s, after=2.0):
    """Return angle(t) [rad] of a turn that begins within a second and goes on."""

    def angle(t):
        return math.radians(deg_s) * np.cumsum(begun(t, after)) * (t[1] - t[0])

    return angle


def rock(deg, hz, after=2.0):
    """Return angle(t) [rad] of rocking that begins within a second."""
    return lambda t: math.radians(deg) * begun(t, after) * np.sin(2.0 * math.pi * hz * (t - after))


@dataclass(frozen=True)
class Shaken:
    """A base, a sensor on it, and what the sensor gets wrong."""

    turns: tuple = ()  # (axis, angle(t)) in order
    pushes: tuple = ()  # (axis, acceleration(t)) of the origin in base axes [m/s2]
    place: tuple = (0.0, 0.0, 0.0)  # of the sensor [m]
    axis_at: tuple = (0.0, 0.0, 0.0)  # of a point that stays where it is, from the origin [m]
    shake: float = 0.0  # amplitude of vibration on each axis [m/s2]
    shake_hz: float = 37.0
    hz: float = 200.0
    noise: tuple = (0.03, 0.003)
    rate_as: np.ndarray = field(default_factory=lambda: np.eye(3))  # what the gyroscope makes of its rates
    rate_bias: np.ndarray = field(default_factory=lambda: TRUE_RATE_BIAS)
    bias_leap: tuple = (math.inf, 0.0)  # [s], [rad/s]: from a time on the bias of each axis is larger by so much
    late: float = 0.0  # [s] of the rates
    scale: float = 1.0
    creep: tuple = ()  # (axis, angle(t)) of the accelerometer alone
    end: float = math.inf

    def samples(self, seconds, seed=0):
        """Return times (N,), true g - a at the origin, readings (specific force) and rates, (N, 3)."""
        rng, step = np.random.default_rng(seed), 1.0 / (FINE * self.hz)
        fine = np.arange(-FINE, round(seconds * self.hz) * FINE + FINE) * step
        attitude = Rotation.identity(len(fine))
        for axis, angle in self.turns:
            attitude = attitude * Rotation.from_rotvec(np.outer(angle(fine), axis))
        omega = (attitude[:-1].inv() * attitude[1:]).as_rotvec() / step
        omega = np.vstack([omega, omega[-1]])
        alpha = np.gradient(omega, step, axis=0)
        lever = lambda p: np.cross(alpha, p) + np.cross(omega, np.cross(omega, p))  # noqa: E731
        gravity = attitude.inv().apply(G) + lever(np.array(self.axis_at))
        for axis, push in self.pushes:
            gravity = gravity - np.outer(push(fine), axis)
        sensed = gravity - lever(np.array(self.place))
        for axis, angle in self.creep:
            sensed = Rotation.from_rotvec(np.outer(angle(fine), axis)).apply(sensed)
        at = slice(FINE, -FINE, FINE)
        t = fine[at]
        phases = rng.uniform(0.0, 2.0 * np.pi, 3)
        shaking = self.shake * np.sin(2.0 * np.pi * self.shake_hz * t[:, None] + phases)
        force = self.scale * (-sensed[at] + shaking) + TRUE_BIAS + self.noise[0] * rng.normal(size=(len(t), 3))
        said = np.column_stack([np.interp(t - self.late, fine, omega[:, k]) for k in range(3)])
        rates = said @ self.rate_as.T + self.rate_bias + self.noise[1] * rng.normal(size=(len(t), 3))
        rates += np.where(t > self.bias_leap[0], self.bias_leap[1], 0.0)[:, None]
        return t, gravity[at], np.clip(force, -self.end, self.end), rates


def raw(t, force, rates):
    """Return gravity by the last reading (N, 3)."""
    return -force


def low_pass(t, force, rates, hz=5.0):
    """Return gravity by a second-order Butterworth low-pass (N, 3), settled at the first reading."""
    from scipy.signal import butter, lfilter, lfilter_zi

    b, a = butter(2, hz, fs=1.0 / (t[1] - t[0]))
    start = np.outer(lfilter_zi(b, a), -force[0])
    return lfilter(b, a, -force, axis=0, zi=start)[0]


def complementary(t, force, rates, gain=0.02):
    """Return gravity of standard length by the complementary filter of roll and pitch (N, 3), settled at the first reading.

    That of the `ahrs` package, version 0.4: W = (1 - gain) (W + dt rates) + gain W_a, W_a the angles by the accelerometer.
    [Mahony, Hamel, Pflimlin 2008, Nonlinear complementary filters on the special orthogonal group]
    """
    dt = t[1] - t[0]
    read = np.column_stack([np.arctan2(force[:, 1], force[:, 2]), np.arctan2(-force[:, 0], np.hypot(*force[:, 1:].T))])
    angles = read.copy()
    for k in range(1, len(t)):
        angles[k] = (angles[k - 1] + rates[k, :2] * dt) * (1.0 - gain) + read[k] * gain
    roll, pitch = angles.T
    return 9.81 * np.column_stack([np.sin(pitch), -np.cos(pitch) * np.sin(roll), -np.cos(pitch) * np.cos(roll)])


BASELINES = {"raw": raw, "5 Hz": low_pass, "complementary": complementary}
