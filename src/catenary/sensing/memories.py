"""A vector now, its slope and how sure both are, from noisy samples: parabolas over short and long memories at once."""

import math

import numpy as np
from numpy.typing import NDArray

from catenary.arrays import Floats
from catenary.spatial import cross

_LENGTHS = np.array([0.012, 0.025, 0.05, 0.1, 0.25, 0.8, 2.4])  # [s] time constants of the memories
_BLOCKS = np.maximum(_LENGTHS / 8.0, 0.0039)  # [s] of samples that each takes together, which averages vibration out
_COUNT = len(_LENGTHS)
# variance of value, slope and curvature by the first sample, times its own; times are in lengths of each memory
_BEFORE = np.stack([np.ones(_COUNT), 1e2 * _LENGTHS**2, 1e4 * _LENGTHS**4], axis=1)[:, :, None] * np.eye(3)
_SECONDS = np.stack([np.ones(_COUNT), _LENGTHS], axis=1)
_SHORTER = np.tril(np.ones((_COUNT, _COUNT), dtype=bool), -1)[:, :, None]
_NOISE_S, _MIN_SHARE = 0.4, 0.1  # [s] over which noise is estimated, and over ten blocks at least
_OUTLIER = 9.0  # times its variance that a block counts for the noise at most
# times the variances of two memories together that the squared distance of their values, and of their slopes, is
_CONTRADICTS = 9.0
_WHITE = 0.7  # variance of a value under white noise, of what a memory that forgets by itself says
_VIBRATES_HZ = 8.0  # from which on what a short memory follows is vibration, and no motion of a base
_FOLLOWERS, _STEADY = 4, 4  # memories short enough to follow it, and one beside which it shows
_REACH = 1.5  # time constants for which a parabola is followed beyond the newest sample
_SHORTEST_REACH = 0.03  # [s]


class Memories:
    """A vector signal, by Kalman filters of value, slope and curvature that forget over 12 ms to 2.4 s.

    Each takes means of blocks of an eighth of its memory, so that vibration averages out before it, and learns from its
    innovations how noisy they are. The surest memory counts that no shorter one contradicts (Lepski's rule): a long one
    while little happens, or while the base turns as its gyroscope says, and a short one where the signal moves.
    [Goldenshluger, Nemirovski 1997, On spatially adaptive estimation of nonparametric regression]
    """

    def __init__(self, quiet: float) -> None:
        """Take the least noise of a sample that may be [unit of the signal]."""
        self._quiet = quiet**2
        self.clear()

    def clear(self) -> None:
        """Forget all samples."""
        # of each memory: value, slope and curvature at the newest sample, and the sum of a block that has begun
        self._states = np.zeros((_COUNT, 4, 3))
        self._covariance = np.zeros((_COUNT, 3, 3))  # over the variance of a block
        self._noise = np.zeros(_COUNT)  # variance of a block of each, as its innovations have it
        self._blocks = np.zeros(_COUNT)  # how many there were
        self._begun, self._taken, self._ages = np.zeros((3, _COUNT))  # of a block: begin, samples, sum of their ages
        self._last = np.zeros((3, 3))  # a sample beside a steady memory, its step, and that step's step
        self._swings = np.zeros(3)  # squares of late: beside a steady memory, of a step, and of a third difference
        self.newest, self.first, self._period = -math.inf, math.inf, 0.0
        self._chosen, self._variance = 0, np.zeros((3, 3))
        self.noise = 0.0  # standard deviation of an axis of a sample

    @property
    def span(self) -> float:
        """Time from the first sample to the newest [s]."""
        return max(0.0, self.newest - self.first)

    def add(self, stamp: float, vector: Floats, turning: Floats | None = None) -> None:
        """Take a sample (3,), newer than those before; the signal turns meanwhile by -turning (3,) [rad/s]."""
        if self.newest == -math.inf:
            self.first = self.newest = stamp
            self._states[:, 0] = vector
            self._covariance[:] = _BEFORE
            self._begun[:] = stamp
            return
        dt, self.newest = stamp - self.newest, stamp
        self._period = dt if self._period == 0.0 else self._period + 0.1 * (min(dt, 2.0 * self._period) - self._period)
        self._advance(dt, turning)
        off = vector - self._states[_STEADY, 0]
        step = off - self._last[0]
        second = step - self._last[1]
        beside = np.array([off, step, second - self._last[2]])
        self._last = np.array([off, step, second])
        self._swings += min(1.0, dt / _NOISE_S) * (np.sum(beside * beside, axis=1) - self._swings)
        self._states[:, 3] += vector
        self._ages += dt * self._taken
        self._taken += 1.0
        for k in np.flatnonzero(stamp - self._begun >= _BLOCKS - 0.5 * dt).tolist():
            self._correct(k)
        self._choose()

    def _advance(self, dt: float, turning: Floats | None) -> None:
        share = np.minimum(dt / _LENGTHS, 5.0)
        step = np.tile(np.eye(3), (_COUNT, 1, 1))
        step[:, 0, 1] = step[:, 1, 2] = share
        step[:, 0, 2] = 0.5 * share * share
        self._states[:, :3] = step @ self._states[:, :3]
        if turning is not None:
            self._states = self._states @ turned_back(dt * turning).T
        self._covariance = step @ self._covariance @ step.transpose(0, 2, 1) * np.exp(share)[:, None, None]

    def _correct(self, k: int) -> None:
        """Take the block of a memory."""
        taken = self._taken[k]
        age = self._ages[k] / taken / _LENGTHS[k]
        row = np.array([1.0, -age, 0.5 * age * age])
        state, covariance = self._states[k, :3], self._covariance[k]
        off = self._states[k, 3] / taken - row @ state
        total = float(row @ covariance @ row) + 1.0
        gain = covariance @ row / total
        state += np.outer(gain, off)
        kept = np.eye(3) - np.outer(gain, row)
        covariance[:] = kept @ covariance @ kept.T + np.outer(gain, gain)  # Joseph's form: it stays positive
        self._blocks[k] += 1.0
        square = float(off @ off) / (3.0 * total)
        if self._blocks[k] > 5.0:
            square = min(square, _OUTLIER * self._noise[k])
        share = max(1.0 / self._blocks[k], min(_BLOCKS[k] / _NOISE_S, _MIN_SHARE))
        self._noise[k] += share * (square - self._noise[k])
        self._states[k, 3], self._taken[k], self._ages[k], self._begun[k] = 0.0, 0.0, 0.0, self.newest

    def _choose(self) -> None:
        """Find the surest memory that no shorter one contradicts."""
        lasts = np.maximum(_BLOCKS, self._period)
        noise, least = self._noise, self._quiet
        known = np.empty(_COUNT)
        known[0] = last = max(float(noise[0]), least)
        for k in range(1, _COUNT):  # means of longer blocks are no noisier than white noise would have them
            white = last * lasts[k - 1] / lasts[k]
            known[k] = last = white if self._blocks[k] < 8.0 else max(min(float(noise[k]), white), 1e-3 * white)
        beside, steps, thirds = self._swings.tolist()
        white = thirds / 20.0  # what no vibration of a few hertz makes
        slow = (2.0 * math.pi * _VIBRATES_HZ * self._period) ** 2
        if beside > 1.5 * white and steps - 2.0 * white > slow * (beside - white):
            known[:_FOLLOWERS] = np.maximum(known[:_FOLLOWERS], beside)
        # of values and slopes, with time in seconds
        of = self._states[:, :2] / _SECONDS[:, :, None]
        spreads = _WHITE * known[:, None] * np.diagonal(self._covariance, 0, 1, 2)[:, :2] / _SECONDS**2
        apart, limit = of[:, None] - of[None], _CONTRADICTS * (spreads[:, None] + spreads[None])
        contradicted = (np.einsum("ijkl,ijkl->ijk", apart, apart) > limit) & _SHORTER
        variances = spreads[:, 0]
        self._chosen = int(np.argmin(np.where(contradicted.any(axis=(1, 2)), np.inf, variances)))
        self._variance = _WHITE * known[self._chosen] * self._covariance[self._chosen]
        self.noise = math.sqrt(known[0])

    def at(self, time: float, turning: Floats | None = None) -> Floats:
        """Return value and slope (2, 3) at a time [s], followed for a while beyond the newest sample; zero before any.

        The slope is that beyond the turning (3,) [rad/s].
        """
        if self.newest == -math.inf:
            return np.zeros((2, 3))
        t, length = self._ahead(time), _LENGTHS[self._chosen]
        value, slope, curvature, _ = self._states[self._chosen]
        out = np.array([value + t * (slope + 0.5 * t * curvature), (slope + t * curvature) / length])
        return out if turning is None else out @ turned_back((time - self.newest) * turning).T

    def deviations(self, time: float) -> tuple[float, float]:
        """Return the standard deviations of an axis of value and slope at a time [s]."""
        t, v = self._ahead(time), self._variance
        value = v[0, 0] + t * (2.0 * v[0, 1] + t * (v[0, 2] + v[1, 1] + t * (v[1, 2] + 0.25 * t * v[2, 2])))
        slope = v[1, 1] + t * (2.0 * v[1, 2] + t * v[2, 2])
        return math.sqrt(max(value, 0.0)), math.sqrt(max(slope, 0.0)) / float(_LENGTHS[self._chosen])

    def _ahead(self, time: float) -> float:
        """Return how far ahead of the newest sample a time is followed to, in lengths of the memory."""
        length = float(_LENGTHS[self._chosen])
        return min(time - self.newest, max(_REACH * length, _SHORTEST_REACH)) / length


def turned_back(angle: Floats) -> NDArray[np.float64]:
    """Return the matrix (3, 3) that takes a vector to axes that have turned by an angle (3,) [rad]."""
    x, y, z = angle.tolist()
    size = math.sqrt(x * x + y * y + z * z)
    s, c = (math.sin(size) / size, (1.0 - math.cos(size)) / size**2) if size > 1e-9 else (1.0, 0.5)
    k = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(np.eye(3) - s * k + c * (k @ k))


def lever(position: Floats, omega: Floats, alpha: Floats) -> Floats:
    """Return the acceleration (3,) of a place [m] from an origin by a turn [rad/s, rad/s2]."""
    return cross(alpha, position) + cross(omega, cross(omega, position))
