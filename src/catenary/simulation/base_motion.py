"""What an arm's base does: stand level or tilted, rock, sway, heave, and go smoothly from any motion into the next."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from catenary.arrays import Floats, as_array, as_not_negative
from catenary.spatial import LEVEL, STANDARD_GRAVITY, cross, rotation_about_x, rotation_about_y, unit_vector


class BaseSamples(NamedTuple):
    """A base at N instants, in its own axes."""

    gravity: Floats  # (N, 3) free-fall acceleration [m/s2]
    motion: Floats  # (N, 3, 3) angular velocity, angular acceleration, linear acceleration of the origin


class MovingBase(Protocol):
    """Anything an arm can stand on."""

    def sample(self, times: Floats) -> BaseSamples:
        """Return the motion at times (N,) [s]."""


@dataclass(frozen=True)
class FixedBase:
    """A base that stands still, turned by `roll` about x, then by `pitch` about its own y [rad]."""

    roll: float = 0.0
    pitch: float = 0.0

    def sample(self, times: Floats) -> BaseSamples:
        """Return one row for all times: nothing changes."""
        gravity = tilt(self.roll, self.pitch).T @ LEVEL
        return BaseSamples(gravity[None, :], np.zeros((1, 3, 3)))


@dataclass(frozen=True)
class RockingBase:
    """A base that rocks about an axis of its own through a point, after the tilt of a FixedBase.

    angle(t) = mean + amplitude sin(2 pi frequency t); `lever` is the base's origin seen from a point of the axis.
    """

    mean: float  # [rad]
    amplitude: float  # [rad]
    frequency: float  # [Hz]
    axis: tuple[float, float, float] = (1.0, 0.0, 0.0)
    lever: tuple[float, float, float] = (0.0, 0.0, 0.0)  # [m] in base axes
    start: FixedBase = field(default_factory=FixedBase)

    def sample(self, times: Floats) -> BaseSamples:
        """Return gravity in base axes, and the accelerations of rocking."""
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
    """A sine about or along an axis: amplitude sin(2 pi frequency t + phase), in rad or in m/s2."""

    amplitude: float
    frequency: float  # [Hz]
    axis: tuple[float, float, float]
    phase: float = 0.0  # [rad]

    def along(self) -> Floats:
        """Return the amplitude along the axis (3,)."""
        return self.amplitude * unit_vector("axis", self.axis)

    def angle(self, times: Floats) -> Floats:
        """Return the argument of the sine at times (N,), (N, 1) [rad]."""
        return (2.0 * np.pi * self.frequency * times + self.phase)[:, None]


@dataclass(frozen=True)
class SwayingBase:
    """A base that rocks about several axes and heaves: a ship's deck, a vehicle; begins in the attitude of a FixedBase.

    Each rocking turns by its own angle about its axis, one within another, the first outermost:
    R_world_base = R_start R_1 R_2 ... R_k. Accelerations are in world axes, z up: heave along z, surge and sway
    along x and y; they are those of the base's origin.
    """

    rocking: tuple[Wave, ...] = ()
    accelerations: tuple[Wave, ...] = ()
    start: FixedBase = field(default_factory=FixedBase)

    def sample(self, times: Floats) -> BaseSamples:
        """Return gravity, turning and the acceleration of the origin, all in base axes."""
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
            # of outer rotations seen from axes that turn
            alpha = alpha + cross(omega.T, rate.T).T - w * w * np.sin(wave.angle(t)) * along
            omega = omega + rate
        return BaseSamples(gravity, np.stack([omega, alpha, linear], axis=1))


def tilt(roll: float, pitch: float) -> Floats:
    """Return R_world_base of a base turned by roll about x, then by pitch about its own y [rad]."""
    return rotation_about_x(roll) @ rotation_about_y(pitch)


class BaseTimeline:
    """A base's motion tick by tick, sampled in blocks: the same numbers whether asked for one tick or thousands."""

    BLOCK = 1024  # ticks

    def __init__(self, base: MovingBase, period: float) -> None:
        """Sample `base` every `period` [s], beginning at time zero."""
        self.base, self.period = base, period
        self._number = -1
        self._block = BaseSamples(np.empty((0, 3)), np.empty((0, 3, 3)))

    def rows(self, first: int, count: int) -> tuple[BaseSamples, int]:
        """Return the motion from tick `first` on, one row if the base stands still, and for how many ticks it holds."""
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
    """Return an ideal IMU's reading at the base's origin: specific force (N, 3) [m/s2], rate (N, 3) [rad/s]."""
    return samples.motion[:, 2] - samples.gravity, samples.motion[:, 0]


_CHANGE_TIME_S = 1.5  # [s] from one attitude to the next


@dataclass(frozen=True)
class SteeredAngle:
    """An angle on its way to `goal`, with a rocking added: polynomial(t - start) + amplitude sin(w (t - start)).

    The polynomial is of the fifth degree: it begins with the angle, rate and acceleration that there are, and is at
    rest at the goal _CHANGE_TIME_S later.
    """

    goal: float = 0.0  # [rad]
    amplitude: float = 0.0  # [rad]
    frequency: float = 0.0  # [Hz]
    start: float = 0.0  # [s]
    # the polynomial's angle, rate, acceleration at the start
    first: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def at(self, times: ArrayLike) -> tuple[Floats, Floats, Floats]:
        """Return angle, rate and acceleration (N,) at times (N,) [s]; before the start they are as at the start."""
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
        """Return the angle from a time [s] on, on its way to another goal and rocking; nothing leaps."""
        (angle,), (rate,), (change,) = self.at([time])
        w = 2.0 * np.pi * frequency
        # the new rocking begins in its middle, at full rate: the polynomial takes up the difference
        first = float(angle), float(rate) - amplitude * w, float(change)
        return SteeredAngle(goal, amplitude, frequency, time, first)


@dataclass(frozen=True)
class SteeredBase:
    """A base turned by roll about x, then by pitch about its own y, about its origin, which stays where it is."""

    roll: SteeredAngle = field(default_factory=SteeredAngle)
    pitch: SteeredAngle = field(default_factory=SteeredAngle)

    def toward(
        self, time: float, roll: float, pitch: float, *, amplitude: float = 0.0, frequency: float = 0.0
    ) -> SteeredBase:
        """Return the base from a time on, on its way to another attitude.

        Before the time [s] it stands as it did then. Angles are in rad; amplitude and frequency [Hz] are of rocking
        about x.
        """
        roll, pitch = as_array("roll, pitch", [roll, pitch], (2,)).tolist()
        as_not_negative("amplitude and frequency of rocking", [amplitude, frequency], (2,))
        return SteeredBase(self.roll.toward(time, roll, amplitude, frequency), self.pitch.toward(time, pitch))

    def sample(self, times: Floats) -> BaseSamples:
        """Return gravity and turning in base axes; R_world_base = Rx(roll) Ry(pitch)."""
        t = as_array("times", times, (None,))
        (r, r1, r2), (p, p1, p2) = self.roll.at(t), self.pitch.at(t)
        c, s = np.cos(p), np.sin(p)
        down = STANDARD_GRAVITY * np.column_stack([np.cos(r) * s, -np.sin(r), -np.cos(r) * c])
        omega = np.column_stack([r1 * c, p1, r1 * s])
        alpha = np.column_stack([r2 * c - r1 * p1 * s, p2, r2 * s + r1 * p1 * c])
        return BaseSamples(down, np.stack([omega, alpha, np.zeros_like(omega)], axis=1))
