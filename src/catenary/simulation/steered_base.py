"""A base that somebody tilts and rocks: from any motion smoothly into the next."""

from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from catenary.arrays import Floats, as_array
from catenary.errors import InputError
from catenary.simulation.base_motion import BaseSamples
from catenary.spatial import STANDARD_GRAVITY

CHANGE = 1.5  # [s] from one attitude to the next


class AngleNow(NamedTuple):
    """An angle with its rate and acceleration; numbers or arrays [rad, rad/s, rad/s2]."""

    angle: Floats
    rate: Floats
    change: Floats


@dataclass(frozen=True)
class SteeredAngle:
    """An angle on its way to `goal`, with a rocking added: polynomial(t - start) + amplitude sin(w (t - start)).

    The polynomial is of the fifth degree: it begins with the angle, rate and acceleration that there are, and is at
    rest at the goal CHANGE later.
    """

    goal: float = 0.0  # [rad]
    amplitude: float = 0.0  # [rad]
    frequency: float = 0.0  # [Hz]
    start: float = 0.0  # [s]
    first: tuple[float, float, float] = (
        0.0,
        0.0,
        0.0,
    )  # the polynomial's angle, rate, acceleration at the start

    def at(self, times: ArrayLike) -> AngleNow:
        """Return the angle at times (N,) [s]; before the start it is as at the start."""
        since = np.maximum(np.asarray(times, dtype=float) - self.start, 0.0)
        x = np.minimum(since, CHANGE) / CHANGE
        p, v, a = self.first[0], self.first[1] * CHANGE, self.first[2] * CHANGE**2
        d = self.goal - p
        c3 = 10.0 * d - 6.0 * v - 1.5 * a
        c4 = -15.0 * d + 8.0 * v + 1.5 * a
        c5 = 6.0 * d - 3.0 * v - 0.5 * a
        angle = p + x * (v + x * (0.5 * a + x * (c3 + x * (c4 + x * c5))))
        rate = (v + x * (a + x * (3.0 * c3 + x * (4.0 * c4 + x * 5.0 * c5)))) / CHANGE
        change = (a + x * (6.0 * c3 + x * (12.0 * c4 + x * 20.0 * c5))) / CHANGE**2
        w = 2.0 * np.pi * self.frequency
        swing, swung = self.amplitude * np.sin(w * since), self.amplitude * np.cos(w * since)
        return AngleNow(angle + swing, rate + w * swung, change - w * w * swing)

    def toward(
        self, time: float, goal: float, amplitude: float = 0.0, frequency: float = 0.0
    ) -> "SteeredAngle":
        """Return the angle from a time [s] on, on its way to another goal and rocking; nothing leaps."""
        now = self.at([time])
        w = 2.0 * np.pi * frequency
        # the new rocking begins in its middle, at full rate: the polynomial takes up the difference
        first = float(now.angle[0]), float(now.rate[0]) - amplitude * w, float(now.change[0])
        return SteeredAngle(goal, amplitude, frequency, time, first)


@dataclass(frozen=True)
class SteeredBase:
    """A base turned by roll about x, then by pitch about its own y, about its origin, which stays where it is."""

    roll: SteeredAngle = field(default_factory=SteeredAngle)
    pitch: SteeredAngle = field(default_factory=SteeredAngle)

    def toward(
        self, time: float, roll: float, pitch: float, *, amplitude: float = 0.0, frequency: float = 0.0
    ) -> "SteeredBase":
        """Return the base from a time on, on its way to another attitude.

        Args:
            time: [s] from which on; before it the base stands as it did then.
            roll: [rad].
            pitch: [rad].
            amplitude: Of rocking about x [rad].
            frequency: Of rocking [Hz].
        """
        values = as_array("roll, pitch, amplitude, frequency", [roll, pitch, amplitude, frequency], (4,))
        if (values[2:] < 0.0).any():
            raise InputError(
                f"rocking: expected an amplitude and a frequency of zero or more, got {values[2:].tolist()}"
            )
        return replace(
            self,
            roll=self.roll.toward(time, float(roll), amplitude, frequency),
            pitch=self.pitch.toward(time, float(pitch)),
        )

    def sample(self, times: Floats) -> BaseSamples:
        """Return gravity and turning in base axes; R_world_base = Rx(roll) Ry(pitch)."""
        t = as_array("times", times, (None,))
        (r, r1, r2), (p, p1, p2) = self.roll.at(t), self.pitch.at(t)
        c, s = np.cos(p), np.sin(p)
        down = STANDARD_GRAVITY * np.column_stack([np.cos(r) * s, -np.sin(r), -np.cos(r) * c])
        omega = np.column_stack([r1 * c, p1, r1 * s])
        alpha = np.column_stack([r2 * c - r1 * p1 * s, p2, r2 * s + r1 * p1 * c])
        return BaseSamples(down, np.stack([omega, alpha, np.zeros_like(omega)], axis=1))
