"""Adaptive Kalman filters of a noisy vector signal, with memories of 12 ms to 2.4 s: value, slope, deviations."""

import math
from typing import Any

import numpy as np

from catenary.arrays import Floats
from catenary.kernels.compiled import compiled

_LENGTHS = np.array([0.012, 0.025, 0.05, 0.1, 0.25, 0.8, 2.4])  # [s] time constants of the memories
_BLOCKS = np.maximum(_LENGTHS / 8.0, 0.0039)  # [s] of samples averaged in each memory, which removes vibration
_COUNT = len(_LENGTHS)
# variance of value, slope and curvature at the first sample, relative to its own; times in units of each memory
_PRIOR_COVARIANCE = np.stack([np.ones(_COUNT), 1e2 * _LENGTHS**2, 1e4 * _LENGTHS**4], axis=1)[:, :, None] * np.eye(3)
_NOISE_S, _MIN_SHARE = 0.4, 0.1  # [s] averaging time of the noise, and weight of a block at most
_OUTLIER_RATIO = 9.0  # largest squared innovation of a block that counts, over its variance
# largest squared difference of the values, or slopes, of two memories, over the sum of their variances
_MAX_DISAGREEMENT = 9.0
_WHITE = 0.7  # variance of a value under white noise, relative to that of a memory which forgets exponentially
_VIBRATION_HZ = 8.0  # lowest frequency that is vibration and not motion of a base
_FOLLOWERS, _STEADY = 4, 4  # number of memories short enough to follow it, and index of one that does not
_MAX_EXTRAPOLATION = 1.5  # beyond the newest sample, in time constants
_MIN_EXTRAPOLATION_S = 0.03  # [s]
_STILL = np.zeros(3)

_STATE = np.dtype(
    [
        # of each memory: value, slope and curvature at the newest sample, and the sum of the current block
        ("states", "f8", (_COUNT, 4, 3)),
        ("covariance", "f8", (_COUNT, 3, 3)),  # over the variance of a block
        ("noise", "f8", _COUNT),  # variance of a block, from innovations
        ("blocks", "f8", _COUNT),  # number of blocks
        ("begun", "f8", _COUNT),  # of the current block: begin, samples, sum of their ages
        ("taken", "f8", _COUNT),
        ("ages", "f8", _COUNT),
        ("last", "f8", (3, 3)),  # a sample's difference from the steady memory, its first and second difference
        ("swings", "f8", 3),  # mean squares: difference from the steady memory, its first and third difference
        ("newest", "f8"),
        ("period", "f8"),
        ("quiet", "f8"),
        ("chosen", "i8"),
        ("variance", "f8", (3, 3)),  # of the chosen memory
        ("sample_noise", "f8"),  # standard deviation of an axis
    ]
)  # fmt: skip


class Memories:
    """Filter a vector signal by Kalman filters of value, slope and curvature with memories of 12 ms to 2.4 s.

    Each filter takes means of blocks of an eighth of its memory, which averages vibration out, and estimates their
    noise from its innovations. The memory of least variance that no shorter one contradicts is used (Lepski's rule): a
    long one while the signal is steady, or rotates as the gyroscope says, and a short one while it changes.
    [Goldenshluger, Nemirovski 1997, On spatially adaptive estimation of nonparametric regression]
    """

    def __init__(self, quiet: float) -> None:
        """Set the least standard deviation of a sample's noise [unit of the signal]."""
        self._quiet = quiet**2
        self.clear()
        for k in range(2):  # compile the functions of a tick
            self.add(float(k), np.zeros(3))
            self.at(float(k))
        self.clear()

    def clear(self) -> None:
        """Discard all samples."""
        self.state = np.zeros(1, _STATE)
        self.state["quiet"], self.state["covariance"] = self._quiet, _PRIOR_COVARIANCE
        self.newest, self.first = -math.inf, math.inf
        self.noise = 0.0  # standard deviation of an axis of a sample

    @property
    def span(self) -> float:
        """Time from the first sample to the newest [s]."""
        return max(0.0, self.newest - self.first)

    def add(self, stamp: float, vector: Floats, turning: Floats | None = None) -> None:
        """Add a sample (3,), newer than all others; turning (3,) [rad/s] is the angular velocity of its axes."""
        if self.newest == -math.inf:
            self.first = stamp
            self.state["states"][0, :, 0], self.state["begun"] = vector, stamp
        else:
            self.noise = _add(self.state, stamp - self.newest, stamp, vector, _STILL if turning is None else turning)
        self.newest = stamp

    def at(self, time: float, turning: Floats | None = None) -> Floats:
        """Return value, slope and standard deviations (3, 3) at a time [s], extrapolated from the newest sample.

        All are zero before the first sample. The slope excludes the rotation of the axes, `turning` (3,) [rad/s]; the
        last row has the standard deviations of an axis of value and slope, and 0.
        """
        out = np.empty((3, 3))
        _at(self.state, time - self.newest, _STILL if turning is None else turning, out)
        return out


@compiled
def motion(
    force: Any, rates: Any, force_age: float, rate_age: float, turning: bool, place: Floats, at: Floats, out: Floats
) -> None:
    """Write gravity at the base's origin, angular velocity and angular acceleration (3, 3) to `out`.

    `force` and `rates` are filter states with the ages of their newest samples [s]; rates are used if `turning`; place
    (3,) is the sensor's position [m]; at (2, 3, 3) receives `Memories.at` of the rates and of gravity at the sensor.
    """
    out[:] = 0.0
    if turning:
        _at(rates, rate_age, _STILL, at[0])
        out[1:] = at[0, :2]
    _at(force, force_age, out[1], at[1])
    out[0] = at[1, 0] + lever(place, out[1], out[2])


@compiled
def _add(memory: Any, dt: float, stamp: float, vector: Floats, turning: Floats) -> float:
    """Add a sample (3,), dt [s] after the last; return the standard deviation of a sample's axis."""
    m = memory[0]
    m.period += dt if m.period == 0.0 else 0.1 * (min(dt, 2.0 * m.period) - m.period)
    back = np.empty((3, 3))
    turn_matrix(dt * turning, back)
    for k in range(_COUNT):
        _advance(m.states[k], m.covariance[k], min(dt / _LENGTHS[k], 5.0), back)
    _watch_swings(m, dt, vector)
    for k in range(_COUNT):
        m.states[k, 3] += vector
        m.ages[k] += dt * m.taken[k]
        m.taken[k] += 1.0
        if stamp - m.begun[k] >= _BLOCKS[k] - 0.5 * dt:
            m.blocks[k] += 1.0
            share = max(1.0 / m.blocks[k], min(_BLOCKS[k] / _NOISE_S, _MIN_SHARE))
            max_square = _OUTLIER_RATIO * m.noise[k] if m.blocks[k] > 5.0 else np.inf
            square = _correct(m.states[k], m.covariance[k], m.taken[k], m.ages[k] / m.taken[k] / _LENGTHS[k])
            m.noise[k] += share * (min(square, max_square) - m.noise[k])
            m.states[k, 3] = 0.0
            m.taken[k], m.ages[k], m.begun[k] = 0.0, 0.0, stamp
    known = _noises(m)
    m.chosen = _choose(m, known)
    m.variance[:] = _WHITE * known[m.chosen] * m.covariance[m.chosen]
    return math.sqrt(known[0])


@compiled
def _advance(state: Floats, covariance: Floats, share: float, back: Floats) -> None:
    """Predict a parabola over a share of its memory, and rotate it."""
    for i in range(3):
        state[0, i] += share * (state[1, i] + 0.5 * share * state[2, i])
        state[1, i] += share * state[2, i]
    for r in range(4):
        x, y, z = state[r]
        for i in range(3):
            state[r, i] = back[i, 0] * x + back[i, 1] * y + back[i, 2] * z
    for i in range(3):  # step covariance, then that step^T
        covariance[0, i] += share * (covariance[1, i] + 0.5 * share * covariance[2, i])
        covariance[1, i] += share * covariance[2, i]
    for i in range(3):
        covariance[i, 0] += share * (covariance[i, 1] + 0.5 * share * covariance[i, 2])
        covariance[i, 1] += share * covariance[i, 2]
    covariance *= math.exp(share)


@compiled
def _correct(state: Floats, covariance: Floats, taken: float, age: float) -> float:
    """Update a memory by a block; return the squared innovation over its variance relative to a block's noise."""
    row = np.array([1.0, -age, 0.5 * age * age])
    gain, total, square = np.zeros(3), 1.0, 0.0
    for i in range(3):
        for j in range(3):
            gain[i] += covariance[i, j] * row[j]
        total += row[i] * gain[i]
    kept = np.eye(3)
    for i in range(3):
        gain[i] /= total
        for j in range(3):
            kept[i, j] -= gain[i] * row[j]
    for axis in range(3):
        off = state[3, axis] / taken
        for i in range(3):
            off -= row[i] * state[i, axis]
        square += off * off
        for i in range(3):
            state[i, axis] += gain[i] * off
    before = covariance.copy()
    for i in range(3):  # Joseph form: stays positive definite
        for j in range(3):
            covariance[i, j] = gain[i] * gain[j]
            for k in range(3):
                for n in range(3):
                    covariance[i, j] += kept[i, k] * before[k, n] * kept[j, n]
    return square / (3.0 * total)


@compiled
def _watch_swings(m: Any, dt: float, vector: Floats) -> None:
    """Update mean squares of the samples' differences from the steady memory, and of their differences in time."""
    squares = np.zeros(3)
    for i in range(3):
        off = vector[i] - m.states[_STEADY, 0, i]
        step = off - m.last[0, i]
        second = step - m.last[1, i]
        third = second - m.last[2, i]
        m.last[0, i], m.last[1, i], m.last[2, i] = off, step, second
        squares[0] += off * off
        squares[1] += step * step
        squares[2] += third * third
    for i in range(3):
        m.swings[i] += min(1.0, dt / _NOISE_S) * (squares[i] - m.swings[i])


@compiled
def _noises(m: Any) -> Floats:
    """Return the variance of a block of each memory, at most that of white noise for longer blocks."""
    known = np.empty(_COUNT)
    known[0] = last = max(m.noise[0], m.quiet)
    for k in range(1, _COUNT):
        white = last * max(_BLOCKS[k - 1], m.period) / max(_BLOCKS[k], m.period)
        known[k] = last = white if m.blocks[k] < 8.0 else max(min(m.noise[k], white), 1e-3 * white)
    difference, steps, thirds = m.swings
    white = thirds / 20.0  # third differences exclude vibration of a few hertz
    slow = (2.0 * math.pi * _VIBRATION_HZ * m.period) ** 2
    if difference > 1.5 * white and steps - 2.0 * white > slow * (difference - white):
        for k in range(_FOLLOWERS):
            known[k] = max(known[k], difference)
    return known


@compiled
def _choose(m: Any, known: Floats) -> int:
    """Return the memory of least variance that no shorter one contradicts in value or slope."""
    spreads, chosen, least = np.empty((2, _COUNT)), 0, np.inf
    for k in range(_COUNT):
        spreads[0, k] = _WHITE * known[k] * m.covariance[k, 0, 0]
        spreads[1, k] = _WHITE * known[k] * m.covariance[k, 1, 1] / _LENGTHS[k] ** 2
        agrees = True
        for j in range(k):
            for d in range(2):
                apart = 0.0
                for i in range(3):
                    apart += (m.states[k, d, i] / _LENGTHS[k] ** d - m.states[j, d, i] / _LENGTHS[j] ** d) ** 2
                agrees = agrees and apart <= _MAX_DISAGREEMENT * (spreads[d, k] + spreads[d, j])
        if agrees and spreads[0, k] < least:
            chosen, least = k, spreads[0, k]
    return chosen


@compiled
def _at(memory: Any, age: float, turning: Floats, out: Floats) -> None:
    """Write value, slope and their standard deviations (3, 3) at an age [s] of the newest sample."""
    out[:] = 0.0
    if age == np.inf:  # before the first sample
        return
    m = memory[0]
    length, v = _LENGTHS[m.chosen], m.variance
    t = min(age, max(_MAX_EXTRAPOLATION * length, _MIN_EXTRAPOLATION_S)) / length
    state, back = m.states[m.chosen], np.empty((3, 3))
    turn_matrix(age * turning, back)
    for i in range(3):
        for j in range(3):
            out[0, i] += back[i, j] * (state[0, j] + t * (state[1, j] + 0.5 * t * state[2, j]))
            out[1, i] += back[i, j] * (state[1, j] + t * state[2, j]) / length
    value = v[0, 0] + t * (2.0 * v[0, 1] + t * (v[0, 2] + v[1, 1] + t * (v[1, 2] + 0.25 * t * v[2, 2])))
    slope = v[1, 1] + t * (2.0 * v[1, 2] + t * v[2, 2])
    out[2, 0], out[2, 1] = math.sqrt(max(value, 0.0)), math.sqrt(max(slope, 0.0)) / length


@compiled
def turn_matrix(angle: Floats, out: Floats) -> None:
    """Compute the matrix (3, 3) that transforms a vector to axes turned by a rotation vector (3,) [rad]."""
    x, y, z = angle[0], angle[1], angle[2]
    size = math.sqrt(x * x + y * y + z * z)
    s, c = (math.sin(size) / size, (1.0 - math.cos(size)) / size**2) if size > 1e-9 else (1.0, 0.5)
    out[0], out[1], out[2] = (
        (1.0 - c * (y * y + z * z), c * x * y + s * z, c * x * z - s * y),
        (c * x * y - s * z, 1.0 - c * (x * x + z * z), c * y * z + s * x),
        (c * x * z + s * y, c * y * z - s * x, 1.0 - c * (x * x + y * y)),
    )


@compiled
def lever(place: Floats, omega: Floats, alpha: Floats) -> Floats:
    """Return alpha x p + omega x (omega x p) (3,) [m/s2] at a position [m] for omega [rad/s], alpha [rad/s2]."""
    (x, y, z), (u, v, w), (a, b, c) = place, omega, alpha
    along, square = u * x + v * y + w * z, u * u + v * v + w * w
    return np.array(
        [
            b * z - c * y + u * along - x * square,
            c * x - a * z + v * along - y * square,
            a * y - b * x + w * along - z * square,
        ]
    )
