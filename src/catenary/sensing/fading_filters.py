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
_LINE_S, _FREQUENCY_S = 0.1, 0.3  # [s] averaging times of a vibration's amplitude and of its frequency
# shares of the power beside the steady memory that remain without the vibration: it is not removed, and wholly
_MAX_REMAINDER, _SMALL_REMAINDER = 0.5, 0.2
_STEADY = 4  # index of a memory that does not follow it
_POLES = 3.0  # of a memory, which follows fast vibration by _POLES / (angular frequency x time constant)
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
        # vibration of one frequency: its value and quadrature, the last two differences from the steady memory but for
        # the slow one, mean products of these that give frequency, and mean squares without and with the vibration
        ("line", "f8", (2, 3)),
        ("slow", "f8", 3),  # difference from the steady memory beside the vibration
        ("recent", "f8", (2, 3)),
        ("products", "f8", 2),
        ("powers", "f8", 2),
        ("removed", "f8"),  # share of the vibration that is subtracted
        ("left", "f8"),  # share of the power that remains, at least
        ("bias", "f8", (2, _COUNT)),  # mean square error of value and slope, beyond noise
        ("newest", "f8"),
        ("period", "f8"),
        ("quiet", "f8"),
        ("chosen", "i8"),
        ("variance", "f8", (3, 3)),  # of the chosen memory
        ("slope_noise", "f8"),  # its standard deviation without bias
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
            self.ahead(float(k))
        self.clear()

    def clear(self) -> None:
        """Discard all samples."""
        self.state = np.zeros(1, _STATE)
        self.state["quiet"], self.state["covariance"], self.state["left"] = self._quiet, _PRIOR_COVARIANCE, 1.0
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

    @property
    def shaking(self) -> float:
        """Standard deviation of an axis of a sample from the steady memory, vibration included."""
        return math.sqrt(float(self.state["powers"][0, 1]) / 3.0)

    def ahead(self, time: float, turning: Floats | None = None) -> Floats:
        """Return the value at the time [s] of the next sample, and its vibration of one frequency, (2, 3)."""
        out = np.empty((2, 3))
        _ahead(self.state, time - self.newest, _STILL if turning is None else turning, out)
        return out

    def at(self, time: float, turning: Floats | None = None) -> Floats:
        """Return value, slope and standard deviations (3, 3) at a time [s], extrapolated from the newest sample.

        All are zero before the first sample. The slope excludes the rotation of the axes, `turning` (3,) [rad/s]; the
        last row has the standard deviations of an axis of value and slope, and that of the slope by noise alone.
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
    calm = _without_line(m, dt, vector)
    _watch_swings(m, dt, calm)
    for k in range(_COUNT):
        m.states[k, 3] += calm
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
    _choose(m, known, min(1.0, dt / _NOISE_S))
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
def _line_ahead(m: Any, dt: float, line: Floats) -> float:
    """Write value and quadrature (2, 3) of the vibration after dt [s]; return its angle in a sample, 0 if slow."""
    cosine = 0.5 * m.products[0] / max(m.products[1], 1e-300)
    angle = math.acos(max(-1.0, min(1.0, cosine)))
    angle = angle if angle > 2.0 * math.pi * _VIBRATION_HZ * m.period else 0.0
    turned = angle * max(1.0, round(dt / max(m.period, 1e-9)))  # whole samples: it may be aliased
    c, s = math.cos(turned), math.sin(turned)
    for i in range(3):
        line[0, i] = c * m.line[0, i] - s * m.line[1, i]
        line[1, i] = s * m.line[0, i] + c * m.line[1, i]
    return angle


@compiled
def _ahead(memory: Any, age: float, turning: Floats, out: Floats) -> None:
    """Write the value at an age [s] of the newest sample and the vibration of the next one (2, 3)."""
    at = np.empty((3, 3))
    _at(memory, age, turning, at)
    _line_ahead(memory[0], age, out)
    for i in range(3):
        out[1, i] = memory[0].removed * out[0, i]
        out[0, i] = at[0, i]


@compiled
def _without_line(m: Any, dt: float, vector: Floats) -> Floats:
    """Return a sample (3,) without the vibration of one frequency, also an aliased one, as the last samples predict it.

    Samples of a line obey x[k] + x[k-2] = 2 cos(angle) x[k-1], which gives its angle by least squares. As more of it is
    subtracted, earlier blocks of the memories are that much noisier than new ones.
    """
    line, calm = np.empty((2, 3)), vector.copy()
    angle = _line_ahead(m, dt, line)
    slow, fast, powers, products = min(1.0, dt / _FREQUENCY_S), min(0.3, dt / _LINE_S), np.zeros(2), np.zeros(2)
    for i in range(3):
        off = vector[i] - m.states[_STEADY, 0, i] - m.slow[i]
        error = off - line[0, i]
        calm[i] -= m.removed * line[0, i]
        m.slow[i] += fast * error
        powers[0] += error * error
        powers[1] += off * off
        products[0] += (off + m.recent[1, i]) * m.recent[0, i]
        products[1] += m.recent[0, i] ** 2
        line[0, i] += 2.0 * fast * error
        m.recent[1, i], m.recent[0, i] = m.recent[0, i], off
    m.line[:] = line if angle > 0.0 else 0.0 * line
    m.products += slow * (products - m.products)
    m.powers += fast * (powers - m.powers)
    remainder = (m.powers[0] + 3.0 * m.quiet) / (m.powers[1] + 3.0 * m.quiet)
    share = max(0.0, min(1.0, (_MAX_REMAINDER - remainder) / (_MAX_REMAINDER - _SMALL_REMAINDER)))
    m.removed, before = share, m.left
    left = remainder + (1.0 - share) ** 2 * max(0.0, 1.0 - remainder)
    m.left = min(before, left) if share > 0.0 else 1.0
    if m.left != before:
        m.noise *= m.left / before
        m.swings *= m.left / before
        m.covariance *= max(1.0, before / m.left)
    return calm


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
    return known


@compiled
def _vibration(m: Any) -> tuple[float, float]:
    """Return the variance of an axis by vibration, 0 for none, and its angular frequency [rad/s]."""
    difference, steps, thirds = m.swings
    white = thirds / 20.0  # third differences exclude vibration of a few hertz
    shaken = difference - white
    frequency = math.sqrt(max(steps - 2.0 * white, 0.0) / max(shaken, 1e-300)) / max(m.period, 1e-9)
    if difference > 1.5 * white and frequency > 2.0 * math.pi * _VIBRATION_HZ:
        return shaken / 3.0, frequency
    return 0.0, 1.0


@compiled
def _choose(m: Any, known: Floats, share: float) -> None:
    """Choose the memory of least mean square error that no shorter one contradicts in value or slope.

    Its variances include the vibration that it follows, and its bias: what it differs from a shorter one beyond noise.
    """
    spreads, errors, chosen, least = np.empty((2, _COUNT)), np.empty((2, _COUNT)), 0, np.inf
    shaken, frequency = _vibration(m)
    for k in range(_COUNT):
        follows = min(1.0, (_POLES / (frequency * _LENGTHS[k])) ** 2)
        spreads[0, k] = _WHITE * known[k] * m.covariance[k, 0, 0] + shaken * follows
        spreads[1, k] = _WHITE * known[k] * m.covariance[k, 1, 1] / _LENGTHS[k] ** 2
        spreads[1, k] += shaken * min(frequency**2, follows / _LENGTHS[k] ** 2)
        agrees = True
        for j in range(k):
            for d in range(2):
                apart = 0.0
                for i in range(3):
                    apart += (m.states[k, d, i] / _LENGTHS[k] ** d - m.states[j, d, i] / _LENGTHS[j] ** d) ** 2
                largest = _MAX_DISAGREEMENT * (spreads[d, k] + spreads[d, j])
                agrees = agrees and apart <= largest
                if j == k - 1:
                    m.bias[d, k] += share * (min(apart, largest) / 3.0 - spreads[d, j] - m.bias[d, k])
        after = min(k + 1, _COUNT - 1)
        for d in range(2):  # a bias grows with the time constant to the power of 3 - d
            growth = (_LENGTHS[after] / _LENGTHS[k]) ** (3 - d) - 1.0 if after > k else np.inf
            errors[d, k] = spreads[d, k] + max(0.0, m.bias[d, k], m.bias[d, after] / growth**2)
        if agrees and errors[0, k] < least:
            chosen, least = k, errors[0, k]
    m.chosen = chosen
    m.variance[:] = _WHITE * known[chosen] * m.covariance[chosen]
    m.variance[0, 0] = errors[0, chosen]
    m.variance[1, 1] = errors[1, chosen] * _LENGTHS[chosen] ** 2
    m.slope_noise = math.sqrt(spreads[1, chosen])


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
    out[2, 0], out[2, 1], out[2, 2] = math.sqrt(max(value, 0.0)), math.sqrt(max(slope, 0.0)) / length, m.slope_noise


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
