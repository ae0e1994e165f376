"""Fourier motions: one period that begins and ends at rest, known at every instant with its bounds."""

from dataclasses import dataclass

import numpy as np

from catenary.arrays import Floats

GRID = 40  # instants for each harmonic at which extremes are looked for


@dataclass(frozen=True)
class FourierSeries:
    """q_i = centre + sum_k a_k / (k w) sin k w t - b_k / (k w) cos k w t, with w = 2 pi / period.

    (Swevers et al., "Optimal robot excitation and identification", IEEE Trans. Robotics and Automation 13(5), 1997.)
    """

    a: Floats  # (harmonics, n) of the velocity's cosines [rad/s or m/s]
    b: Floats  # (harmonics, n) of its sines
    centre: Floats  # (n,) [rad or m]
    period: float  # [s]

    @property
    def frequencies(self) -> Floats:
        """(harmonics,) [rad/s]."""
        return np.asarray(2.0 * np.pi / self.period * np.arange(1, len(self.a) + 1), dtype=float)

    @property
    def duration(self) -> float:
        """One period [s]."""
        return self.period

    @property
    def acceleration_bound(self) -> Floats:
        """(n,) what no acceleration exceeds [rad/s2 or m/s2]: the sum of the harmonics' amplitudes."""
        return np.asarray(self.frequencies @ np.hypot(self.a, self.b))

    def sample(self, times: Floats) -> tuple[Floats, Floats, Floats]:
        """Return positions, velocities, accelerations, (N, n) each, at times (N,) [s]."""
        w = self.frequencies
        sine, cosine = np.sin(np.outer(times, w)), np.cos(np.outer(times, w))
        return (
            self.centre + sine @ (self.a / w[:, None]) - cosine @ (self.b / w[:, None]),
            cosine @ self.a + sine @ self.b,
            -sine @ (self.a * w[:, None]) + cosine @ (self.b * w[:, None]),
        )

    def grid(self) -> Floats:
        """Return instants that lie close enough for extremes to be found between them."""
        return np.linspace(0.0, self.period, GRID * len(self.a), endpoint=False)

    def extremes(self) -> tuple[Floats, Floats, Floats]:
        """Return what positions and speeds do not exceed at any instant: lowest, highest, fastest, (n,) each.

        Between two instants h apart an extreme exceeds the nearer one's by at most h^2 / 8 of the bound of the second
        derivative.
        """
        times = self.grid()
        h = times[1]
        q, qd, _ = self.sample(times)
        slack = h**2 / 8.0 * self.acceleration_bound
        faster = h**2 / 8.0 * (self.frequencies**2 @ np.hypot(self.a, self.b))  # the jerk's bound
        return q.min(axis=0) - slack, q.max(axis=0) + slack, np.abs(qd).max(axis=0) + faster

    def scaled(self, factor: Floats | float) -> "FourierSeries":
        """Return the motion with its amplitudes times a factor, () or (n,), about the same centre."""
        return FourierSeries(self.a * factor, self.b * factor, self.centre, self.period)


def series_at_rest(coefficients: Floats, period: float) -> FourierSeries:
    """Return the series of free coefficients (2, harmonics, n) about zero, changed least so that it starts at rest.

    The velocity sum a cos + b sin and the acceleration sum -a w sin + b w cos are zero at the start.
    """
    w = 2.0 * np.pi / period * np.arange(1, coefficients.shape[1] + 1)
    a = coefficients[0] - coefficients[0].mean(axis=0)
    b = coefficients[1] - w[:, None] * (w @ coefficients[1]) / (w @ w)
    return FourierSeries(a, b, np.zeros(coefficients.shape[2]), period)
