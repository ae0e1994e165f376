"""Motions of a robot's base: fixed, tilted, rocking, swaying, heaving, steered; gravity, rates, ideal IMU readings."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from catenary.arrays import Floats, as_array, as_not_negative
from catenary.spatial import LEVEL, STANDARD_GRAVITY, cross, rotation_about_x, rotation_about_y, unit_vector


class BaseSamples(NamedTuple):
    """State of a base at N instants, in its own axes."""

    gravity: Floats  # (N, 3) gravitational acceleration [m/s2]
    motion: Floats  # (N, 3, 3) angular velocity [rad/s] and acceleration [rad/s2], acceleration of the origin [m/s2]


class MovingBase(Protocol):
    """A base that a robot can be mounted on."""

    def sample(self, times: Floats) -> BaseSamples:
        """Return the motion at times (N,) [s]."""


@dataclass(frozen=True)
class FixedBase:
    """A fixed base, level or tilted.

    Attributes:
        roll, pitch: Angle about x [rad], first, and about the rolled y axis [rad].

    Examples:
        >>> catenary.FixedBase(roll=0.1).sample(np.zeros(1)).gravity.round(3)
        array([[ 0.   , -0.979, -9.761]])
    """

    roll: float = 0.0
    pitch: float = 0.0

    def sample(self, times: Floats) -> BaseSamples:
        """Return one row for all times (N,) [s]."""
        gravity = tilt(self.roll, self.pitch).T @ LEVEL
        return BaseSamples(gravity[None, :], np.zeros((1, 3, 3)))


@dataclass(frozen=True)
class RockingBase:
    """A tilted base that rocks about an axis fixed in it.

    angle(t) = mean + amplitude sin(2 pi frequency t); `lever` is the base's origin relative to a point of the axis.
    """

    mean: float  # [rad]
    amplitude: float  # [rad]
    frequency: float  # [Hz]
    axis: tuple[float, float, float] = (1.0, 0.0, 0.0)
    lever: tuple[float, float, float] = (0.0, 0.0, 0.0)  # [m] in base axes
    start: FixedBase = field(default_factory=FixedBase)

    def sample(self, times: Floats) -> BaseSamples:
        """Return gravity and the motion of rocking at times (N,) [s], in base axes."""
        t = as_array("times", times, (None,))
        axis = unit_vector("axis", self.axis)
        w = 2.0 * np.pi * self.frequency
        angle = self.mean + self.amplitude * np.sin(w * t)
        rate = self.amplitude * w * np.cos(w * t)
        change = -self.amplitude * w * w * np.sin(w * t)
        level = tilt(self.start.roll, self.start.pitch).T @ LEVEL
        gravity = Rotation.from_rotvec(-angle[:, None] * axis).apply(level)
        omega, alpha = rate[:, None] * axis, change[:, None] * axis
        r = np.asarray(self.lever)
        linear = (cross(alpha.T, r) + cross(omega.T, cross(omega.T, r))).T
        return BaseSamples(gravity, np.stack([omega, alpha, linear], axis=1))


@dataclass(frozen=True)
class Wave:
    """A sine about or along an axis: amplitude sin(2 pi frequency t + phase)."""

    amplitude: float  # [rad] of rocking, [m/s2] of an acceleration
    frequency: float  # [Hz]
    axis: tuple[float, float, float]
    phase: float = 0.0  # [rad]

    def along(self) -> Floats:
        """Return the amplitude as a vector (3,)."""
        return self.amplitude * unit_vector("axis", self.axis)

    def angle(self, times: Floats) -> Floats:
        """Return the argument of the sine at times (N,), (N, 1) [rad]."""
        return (2.0 * np.pi * self.frequency * times + self.phase)[:, None]


@dataclass(frozen=True)
class SwayingBase:
    """A base that rocks about several axes and accelerates: a ship's deck, a vehicle.

    R_world_base = R_start R_1 R_2 ... R_k, each R_i a rocking about its axis.

    Attributes:
        rocking: Angles [rad], the outermost first.
        accelerations: Of the base's origin in world axes [m/s2]: heave along z (up), surge and sway along x and y.
        start: Initial attitude.
    """

    rocking: tuple[Wave, ...] = ()
    accelerations: tuple[Wave, ...] = ()
    start: FixedBase = field(default_factory=FixedBase)

    def sample(self, times: Floats) -> BaseSamples:
        """Return gravity and the motion at times (N,) [s], in base axes."""
        t = as_array("times", times, (None,))
        fixed = tilt(self.start.roll, self.start.pitch).T
        gravity = np.tile(fixed @ LEVEL, (len(t), 1))
        linear = np.tile(np.zeros(3), (len(t), 1))
        for wave in self.accelerations:
            linear = linear + np.sin(wave.angle(t)) * (fixed @ wave.along())
        omega, alpha = np.zeros((2, len(t), 3))
        for wave in self.rocking:
            along, w = wave.along(), 2.0 * np.pi * wave.frequency
            turn = Rotation.from_rotvec(-np.sin(wave.angle(t)) * along)
            rate = w * np.cos(wave.angle(t)) * along
            gravity, linear, omega, alpha = (turn.apply(v) for v in (gravity, linear, omega, alpha))
            # outer rotations, in rotating axes
            alpha = alpha + cross(omega.T, rate.T).T - w * w * np.sin(wave.angle(t)) * along
            omega = omega + rate
        return BaseSamples(gravity, np.stack([omega, alpha, linear], axis=1))


def tilt(roll: float, pitch: float) -> Floats:
    """Return R_world_base (3, 3) of a base turned by roll about x, then by pitch about its own y [rad]."""
    return rotation_about_x(roll) @ rotation_about_y(pitch)


class BaseTimeline:
    """A base's motion tick by tick, sampled in blocks, so that its values do not depend on the size of a request."""

    BLOCK = 1024  # ticks

    def __init__(self, base: MovingBase, period: float) -> None:
        """Sample a base every `period` [s] from time zero."""
        self.base, self.period = base, period
        self._number = -1
        self._block = BaseSamples(np.empty((0, 3)), np.empty((0, 3, 3)))

    def rows(self, first: int, count: int) -> tuple[BaseSamples, int]:
        """Return the motion from tick `first`, one row for a fixed base, and the number of ticks that it covers."""
        number, start = divmod(first, self.BLOCK)
        if number != self._number:
            ticks = np.arange(number * self.BLOCK, (number + 1) * self.BLOCK, dtype=float)
            rows = self.base.sample(ticks * self.period)
            self._block = BaseSamples._make(np.ascontiguousarray(part, dtype=float) for part in rows)
            self._number = number
        gravity, motion = self._block
        if len(gravity) == 1:
            return self._block, count
        stop = min(start + count, self.BLOCK)
        return BaseSamples(gravity[start:stop], motion[start:stop]), stop - start


def imu_reading(samples: BaseSamples) -> tuple[Floats, Floats]:
    """Return the readings of an ideal IMU at the base's origin: specific force (N, 3) [m/s2], rate (N, 3) [rad/s]."""
    return samples.motion[:, 2] - samples.gravity, samples.motion[:, 0]


_CHANGE_TIME_S = 1.5  # [s] from one attitude to the next


@dataclass(frozen=True)
class SteeredAngle:
    """An angle that moves to `goal` and rocks: polynomial(t - start) + amplitude sin(w (t - start)).

    The polynomial of degree 5 starts with the present angle, rate and acceleration, and reaches the goal at rest after
    _CHANGE_TIME_S.
    """

    goal: float = 0.0  # [rad]
    amplitude: float = 0.0  # [rad]
    frequency: float = 0.0  # [Hz]
    start: float = 0.0  # [s]
    # the polynomial's angle, rate, acceleration at the start
    first: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def at(self, times: ArrayLike) -> tuple[Floats, Floats, Floats]:
        """Return angle [rad], rate and acceleration (N,) at times (N,) [s]; before the start, those at the start."""
        since = np.maximum(np.asarray(times, dtype=float) - self.start, 0.0)
        x = np.minimum(since, _CHANGE_TIME_S) / _CHANGE_TIME_S
        p, v, a = self.first[0], self.first[1] * _CHANGE_TIME_S, self.first[2] * _CHANGE_TIME_S**2
        d = self.goal - p
        c3 = 10.0 * d - 6.0 * v - 1.5 * a
        c4 = -15.0 * d + 8.0 * v + 1.5 * a
        c5 = 6.0 * d - 3.0 * v - 0.5 * a
        angle = p + x * (v + x * (0.5 * a + x * (c3 + x * (c4 + x * c5))))
        rate = (v + x * (a + x * (3.0 * c3 + x * (4.0 * c4 + x * 5.0 * c5)))) / _CHANGE_TIME_S
        change = (a + x * (6.0 * c3 + x * (12.0 * c4 + x * 20.0 * c5))) / _CHANGE_TIME_S**2
        w = 2.0 * np.pi * self.frequency
        swing, swung = self.amplitude * np.sin(w * since), self.amplitude * np.cos(w * since)
        return angle + swing, rate + w * swung, change - w * w * swing

    def toward(self, time: float, goal: float, amplitude: float = 0.0, frequency: float = 0.0) -> SteeredAngle:
        """Return a continuation from a time [s] to another goal [rad] and rocking, without a jump."""
        (angle,), (rate,), (change,) = self.at([time])
        w = 2.0 * np.pi * frequency
        # rocking starts at its mean, at full rate: the polynomial compensates for the jump in rate
        first = float(angle), float(rate) - amplitude * w, float(change)
        return SteeredAngle(goal, amplitude, frequency, time, first)


@dataclass(frozen=True)
class SteeredBase:
    """A base that is steered about its fixed origin: by roll about x, then by pitch about its own y."""

    roll: SteeredAngle = field(default_factory=SteeredAngle)
    pitch: SteeredAngle = field(default_factory=SteeredAngle)

    def toward(
        self, time: float, roll: float, pitch: float, *, amplitude: float = 0.0, frequency: float = 0.0
    ) -> SteeredBase:
        """Return the base that moves to another attitude from a time on; before it, it is fixed.

        Args:
            time: Start of the motion [s].
            roll, pitch: Goals about x and about the base's y [rad].
            amplitude, frequency: Of rocking about x [rad], [Hz], 0 or more.
        """
        roll, pitch = as_array("roll, pitch", [roll, pitch], (2,)).tolist()
        as_not_negative("amplitude and frequency of rocking", [amplitude, frequency], (2,))
        return SteeredBase(self.roll.toward(time, roll, amplitude, frequency), self.pitch.toward(time, pitch))

    def sample(self, times: Floats) -> BaseSamples:
        """Return gravity and rotation at times (N,) [s], in base axes; R_world_base = Rx(roll) Ry(pitch)."""
        t = as_array("times", times, (None,))
        (r, r1, r2), (p, p1, p2) = self.roll.at(t), self.pitch.at(t)
        c, s = np.cos(p), np.sin(p)
        down = STANDARD_GRAVITY * np.column_stack([np.cos(r) * s, -np.sin(r), -np.cos(r) * c])
        omega = np.column_stack([r1 * c, p1, r1 * s])
        alpha = np.column_stack([r2 * c - r1 * p1 * s, p2, r2 * s + r1 * p1 * c])
        return BaseSamples(down, np.stack([omega, alpha, np.zeros_like(omega)], axis=1))
