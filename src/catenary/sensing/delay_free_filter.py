"""A vector and its derivative now, from noisy samples of a moment ago, without the delay of a filter."""

from collections import deque

import numpy as np
from numpy.typing import ArrayLike

from catenary.arrays import Floats
from catenary.errors import InputError

# where the response of the filter to a sine falls to half power: cut-off times window, of continuous sampling
CUTOFF_BY_WINDOW = 2.527
_SAMPLES_PER_S = 1280  # samples per second of the window, 128 at least
_MIN_STEPS = 5  # steps between samples that a window spans: that of a slow sensor is as long as it must be
_MAX_WINDOW_S = 0.4  # [s] to which a window is stretched for it


class DelayFreeFilter:
    """Parabola through the samples of the last `window` seconds, by least squares, read at any time near its end.

    A low-pass whose value at the end is right to the second order: of a sine of frequency f = x / window

        x     gain of value   phase      gain of derivative   phase
        0.05  1.00003         0.015 deg  1.010                -0.07 deg
        0.1   1.0005          0.11 deg   1.038                -0.5 deg
        0.2   1.008           0.8 deg    1.139                -3.6 deg

    while a first-order low-pass of the same cut-off would lag by 1, 2 and 4 degrees. Noise of standard deviation s
    on N samples comes out as about 3 s / sqrt(N) in the value and 14 s / (window sqrt(N)) in the derivative at the
    end. Half power at 2.5 / window, after a hump of 1.8 at 1 / window. Both are closed forms of the endpoint of a
    least-squares parabola (weights 9 - 36 u + 30 u^2 over the window, u = 0 at its end).
    """

    def __init__(self, cutoff_hz: float) -> None:
        """Take the frequency of half power [Hz], which is lower where samples are too far apart for it."""
        if not 0.0 < cutoff_hz < np.inf:
            raise InputError(f"cutoff_hz: expected a positive frequency, got {cutoff_hz}")
        self._shortest = self.window = CUTOFF_BY_WINDOW / cutoff_hz
        self._room = max(128, round(_SAMPLES_PER_S * self.window))
        self._last, self._steps = -np.inf, deque[float](maxlen=9)
        self._stamps, self._vectors = np.empty(self._room), np.zeros((self._room, 3))
        self._coefficients = np.empty((3, 3))  # of 1, t, t2, each of a vector; t from the newest
        self.clear()

    def clear(self) -> None:
        """Forget all samples."""
        self._stamps[:], self._next = -np.inf, 0
        self._coefficients[:] = 0.0
        self.newest = -np.inf  # [s]
        self.span = 0.0  # [s] from the oldest sample in use to the newest

    def add(self, stamp: float, vector: ArrayLike) -> None:
        """Take a sample (3,) newer than those before."""
        if stamp - self._last < _MAX_WINDOW_S:
            self._steps.append(stamp - self._last)
            step = sorted(self._steps)[len(self._steps) // 2]
            self.window = max(self._shortest, min(_MIN_STEPS * step, _MAX_WINDOW_S))
        self._last = stamp
        self._stamps[self._next], self._vectors[self._next] = stamp, vector
        self._next = (self._next + 1) % self._room
        recent = self._stamps >= stamp - (1.0 + 1e-9) * self.window
        ages = (self._stamps[recent] - stamp) / self.window  # -1 to 0
        self.newest, self.span = stamp, float(-ages.min() * self.window)
        # a parabola through a short piece would be noise: first a mean, then a line
        steps = ((5, 0.6), (3, 0.3))
        degree = sum(len(ages) >= count and self.span >= share * self.window for count, share in steps)
        powers = ages[:, None] ** np.arange(degree + 1)
        fitted = np.linalg.solve(powers.T @ powers, powers.T @ self._vectors[recent])
        self._coefficients[:] = 0.0
        self._coefficients[: len(fitted)] = fitted / self.window ** np.arange(len(fitted))[:, None]

    def at(self, time: float) -> Floats:
        """Return value and derivative (2, 3) at a time [s]; zero without samples."""
        t = time - self.newest if self.newest > -np.inf else 0.0
        c0, c1, c2 = self._coefficients
        return np.array([c0 + t * (c1 + t * c2), c1 + 2.0 * t * c2])
