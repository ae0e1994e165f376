"""Sums of least squares for variants of a gyroscope over sliding spans of time, updated sample by sample.

A row is a step of 20 ms: in axes that turn by omega, the change of u = z + alpha x p + omega x (omega x p) beyond
-omega x u, z mean gravity at the sensor and p its place; after a high-pass, which removes motion slower than turning.
Unknown of each variant are the error of p and the bias of the gyroscope.
"""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from catenary.arrays import Floats
from catenary.kernels.compiled import compiled

HIGH_PASS_S = 0.5  # [s] time constant of the high-pass
_ROW_S = 0.0195  # [s] least duration of a row: 20 ms, and one interval of slower sensors
_MAX_DELAY_S = 0.2  # [s] of a variant, early or late
_GAP_S = 0.25  # [s] without samples, after which the sums restart
_ANGLE_S, _ANGLES, _ENDS = 0.0039, 256, 64  # [s] between stored angles, lengths of the two rings
_MIN_ROWS = 10  # for a comparison
_BLOCKS = 9  # of each span; the oldest is replaced
_UNKNOWNS, _PRODUCTS = 6, 28  # position and bias; products of the residual and their columns
_LEVER_M = 0.5  # [m] prior standard deviation of the position of the centre of rotation
_BIAS, _BIAS_AT_REST = 0.05, 0.005  # [rad/s] prior standard deviation of the bias, and after a rest
_NOISE = 0.03  # [m/s2] of the residual, beyond the sensor's noise
_MISTUNING_SHARE = 0.04  # of the effect of turning: scale and alignment errors of a cheap, correct sensor
_ROWS_PER_S = 12.0  # independent rows in a second
_SLOWNESS = 8.0  # rows over which an acceleration of the base lasts


class VariantFit(NamedTuple):
    """Variants fitted over a span."""

    residuals: Floats  # (K,) penalised squares [m2/s4]
    allowed: Floats  # (K,) squares that noise and mistuning explain
    weights: Floats  # (K,) half the number of independent rows
    differences: Floats  # (K,) squared difference of a variant's rates from those read, relative
    bias: Floats  # (3,) [rad/s] of the gyroscope as read
    is_upright: bool  # the base turns mostly about the vertical
    angle: float  # [rad] of that turn


class GyroEvidence:
    """Accumulate the normal equations of variants of a gyroscope over the last spans of time."""

    def __init__(
        self, place: Floats, spans: Sequence[float], matrices: Floats, delays: Floats, is_late: NDArray[np.bool_]
    ) -> None:
        """Set up empty sums.

        Args:
            place: (3,) position of the sensor from the base's origin, in the sensor's axes [m].
            spans: Lengths [s]; inf for all data.
            matrices: (K, 3, 3) of the variants, true rate = matrix @ rate; the first as read, the second zero.
            delays: (K,) [s] of the rates behind their stamps, at most 0.2 s either way.
            is_late: (K,) variants whose rows wait for rates to come, all of them for the same time.
        """
        count = len(matrices)
        self._variants = np.ascontiguousarray(matrices), np.array(delays), np.array(is_late)
        self._place, self._spans = np.array(place, dtype=float), np.array(spans, dtype=float)
        self._fitted = np.zeros((count, 4))
        self._scatter = np.full(len(self._spans), np.inf)  # [m2/s4] of a row that the best variant leaves
        self.state = np.zeros(
            1,
            np.dtype(
                [
                    ("last", "f8", (2, 7)),  # of gravity and rates: stamp, sample, integral
                    ("taken", "i8", 2),
                    ("period", "f8"),  # [s] mean interval of rates
                    ("angles", "f8", (_ANGLES, 4)),  # ring of times and integrals of rates
                    ("ends", "f8", (_ENDS, 4)),  # ring of rows' ends: times and integrals of gravity
                    ("stored", "i8", 2),
                    ("rows", "i8", 2),  # processed, at once and late
                    ("joined", "i8", 2),  # the last row's columns are known
                    # of the last row: u, effects of a place along each axis and of the given one
                    ("columns", "f8", (count, 5, 3)),
                    ("turns", "f8", (count, 3)),
                    ("high", "f8", (count, 9, 3)),  # high-passed: residual, unknowns, effects of turning and place
                    # by span and block: products; rows and time, at once and late; turns about and across the vertical
                    ("sums", "f8", (len(self._spans), _BLOCKS, count, _PRODUCTS + 3)),
                    ("weights", "f8", (len(self._spans), _BLOCKS, 2, 2)),
                    ("upright", "f8", (len(self._spans), _BLOCKS, 5)),
                    ("begun", "f8", (len(self._spans), _BLOCKS)),  # [s]
                    ("block", "i8", len(self._spans)),  # current one
                    ("total", "f8", (count, _PRODUCTS + 3)),
                ]
            ),
        )
        for k in range(40):  # compile the functions of a tick
            self.add_rate(0.02 * k, np.zeros(3))
            self.add_gravity(0.02 * k, np.zeros(3))
        self.fit(0)
        self.restart()

    def restart(self) -> None:
        """Discard all data."""
        self.state[:] = np.zeros((), self.state.dtype)

    def interrupt(self) -> None:
        """Keep the sums, but not the last samples: other data follow."""
        for name in ("taken", "stored", "rows", "joined"):
            self.state[name] = 0

    def restart_high_pass(self) -> None:
        """Begin the high-pass again, in which large residuals of the past last."""
        self.state["joined"] = 0

    def forget_before(self, span: int) -> None:
        """Forget all that is older than a span, given by its index."""
        state = self.state[0]
        old = state["begun"] < state["last"][0, 0] - self._spans[span]
        for name in ("sums", "weights", "upright"):
            state[name][old] = 0.0

    def add_rate(self, stamp: float, rate: Floats) -> None:
        """Add a rate (3,) [rad/s] in the sensor's axes."""
        _add_sample(self.state, 1, stamp, rate)

    def add_gravity(self, stamp: float, gravity: Floats) -> bool:
        """Add gravity (3,) [m/s2] in the sensor's axes; return true if rows were completed."""
        if not _add_sample(self.state, 0, stamp, gravity):
            return False
        return bool(_add_rows(self.state, self._place, self._spans, *self._variants))

    def fit(
        self, span: int, *, drift: float = 0.0, noise: tuple[float, float] = (0.0, 0.0), rested: bool = False
    ) -> VariantFit | None:
        """Fit place and bias of each variant over a span, given by its index; None of too few rows.

        Args:
            drift, noise, rested: As of `gyro_hypotheses.compare`.
        """
        state = self.state[0]
        if state["weights"][span, :, 0, 0].sum() < 3.0 * _MIN_ROWS:
            return None
        # accelerations of the base are no larger than what no variant explains
        variance = _NOISE**2 + min(drift**2, _SLOWNESS * self._scatter[span]) + (0.5 * noise[0]) ** 2
        # the noise of angular acceleration, over the distance from the origin
        swing = noise[1] * math.sqrt(state["period"] / 2.0) / _ROW_S**1.5
        variance += swing**2 * float(self._place @ self._place)
        bias, out = np.empty(3), self._fitted
        _fit(self.state, span, variance, _BIAS_AT_REST if rested else _BIAS, self._variants[2], bias, out)
        self._scatter[span] = out[:, 0].min() / state["weights"][span, :, 0, 0].max()
        across, along, *turn = state["upright"][span].sum(axis=0).tolist()
        return VariantFit(out[:, 0], out[:, 1], out[:, 2], out[:, 3], bias, across < 0.3 * along, math.hypot(*turn))


@compiled
def _add_sample(state: Any, kind: int, stamp: float, vector: Floats) -> bool:
    """Integrate a sample (3,) of gravity (0) or a rate (1); return true if its integral is stored."""
    s = state[0]
    dt, last = stamp - s.last[kind, 0], s.last[kind]
    if s.taken[kind] > 0 and not 0.0 < dt < _GAP_S:  # all of it restarts
        s.taken[:] = 0
        s.stored[:] = 0
        s.rows[:] = 0
        s.joined[:] = 0
        s.sums[:] = 0.0
        s.weights[:] = 0.0
        s.upright[:] = 0.0
        s.begun[:] = 0.0
    if s.taken[kind] == 0:
        last[4:] = 0.0
    else:
        for i in range(3):
            last[4 + i] += 0.5 * dt * (vector[i] + last[1 + i])
        if kind == 1:
            s.period += (dt - s.period) / min(s.taken[1], 50)
    s.taken[kind] += 1
    last[0] = stamp
    last[1:4] = vector
    if kind == 1:
        return _store(s.angles, s.stored, kind, _ANGLE_S, last)
    return _store(s.ends, s.stored, kind, _ROW_S, last)


@compiled
def _store(ring: Floats, stored: Any, kind: int, spacing: float, last: Floats) -> bool:
    """Store a stamp and the integral up to it, if the last ones are old enough."""
    if stored[kind] > 0 and last[0] - ring[(stored[kind] - 1) % len(ring), 0] < spacing:
        return False
    place = stored[kind] % len(ring)
    ring[place, 0] = last[0]
    ring[place, 1:] = last[4:]
    stored[kind] += 1
    return True


@compiled
def _write_angle(ring: Floats, stored: int, time: float, out: Floats) -> None:
    """Write the integral of rates (3,) at a time [s] among the stored ones, by linear interpolation."""
    low, high = max(0, stored - len(ring)), stored - 1
    while high - low > 1:
        middle = (low + high) // 2
        if ring[middle % len(ring), 0] <= time:
            low = middle
        else:
            high = middle
    before, after = ring[low % len(ring)], ring[high % len(ring)]
    share = (time - before[0]) / (after[0] - before[0])
    for i in range(3):
        out[i] = before[1 + i] + share * (after[1 + i] - before[1 + i])


@compiled
def _add_rows(state: Any, place: Floats, spans: Floats, matrices: Floats, delays: Floats, is_late: Any) -> bool:
    """Process the rows whose rates are known; return true if there was one at once."""
    s, added = state[0], False
    for late in range(2):
        wait = late * _MAX_DELAY_S
        while s.rows[late] + 3 < s.stored[0] and s.stored[1] > 1:
            # a row from the end before k to the one at k; those beside them are needed for angular acceleration
            k = s.rows[late] + 2
            if s.angles[(s.stored[1] - 1) % _ANGLES, 0] < s.ends[(k + 1) % _ENDS, 0] + wait:
                break
            s.rows[late] += 1
            if s.ends[(k - 2) % _ENDS, 0] - wait >= s.angles[max(0, s.stored[1] - _ANGLES) % _ANGLES, 0]:
                _add_row(s, k, late, place, spans, matrices, delays, is_late)
                added = added or late == 0
    return added


@compiled
def _add_row(
    s: Any, k: int, late: int, place: Floats, spans: Floats, matrices: Floats, delays: Floats, is_late: Any
) -> None:
    """Add the row that ends at the k-th stored end to the sums of the variants that are late, or of the others."""
    times, rates, angles, read = np.empty(4), np.empty((3, 3)), np.empty((4, 3)), np.empty(3)
    for j in range(4):
        times[j] = s.ends[(k - 2 + j) % _ENDS, 0]
    step, between = times[2] - times[1], 0.5 * (times[2] - times[0])
    gravity = (s.ends[k % _ENDS, 1:] - s.ends[(k - 1) % _ENDS, 1:]) / step
    columns, change, w, a = np.empty((5, 3)), np.empty((9, 3)), np.empty(3), np.empty(3)
    is_first, begun = s.joined[late] == 0, False
    if late == 0:
        for m in range(len(spans)):
            if times[2] - s.begun[m, s.block[m]] >= spans[m] / (_BLOCKS - 1):
                block = s.block[m] = (s.block[m] + 1) % _BLOCKS
                s.begun[m, block] = times[2]
                s.sums[m, block] = 0.0
                s.weights[m, block] = 0.0
                s.upright[m, block] = 0.0
    for v in range(len(matrices)):
        if is_late[v] != (late == 1):
            continue
        if late == 1 or not begun:
            for j in range(4):
                _write_angle(s.angles, s.stored[1], times[j] + delays[v], angles[j])
            for j in range(3):
                rates[j] = (angles[j + 1] - angles[j]) / (times[j + 1] - times[j])
        if not begun:
            read[:] = rates[1]
            begun = True
        for i in range(3):
            w[i], a[i] = 0.0, 0.0
            for j in range(3):
                w[i] += matrices[v, i, j] * rates[1, j]
                a[i] += matrices[v, i, j] * (rates[2, j] - rates[0, j]) / (step + between)
        _write_columns(w, a, place, gravity, columns)
        if is_first:
            s.high[v] = 0.0
        else:
            _write_changes(s.columns[v], columns, 0.5 * (s.turns[v] + step * w), between, change)
            kept = math.exp(-between / HIGH_PASS_S)
            for c in range(9):
                for i in range(3):
                    s.high[v, c, i] = kept * s.high[v, c, i] + change[c, i]
            for m in range(len(spans)):
                _add_products(s.sums[m, s.block[m], v], s.high[v], w, read)
        s.columns[v] = columns
        s.turns[v] = step * w
    s.joined[late] = 1
    for m in range(len(spans)):
        s.weights[m, s.block[m], late, 0] += 3.0
        s.weights[m, s.block[m], late, 1] += between
        if late == 0:
            _add_upright(s.upright[m, s.block[m]], gravity, read, step)


@compiled
def _write_columns(w: Floats, a: Floats, place: Floats, gravity: Floats, out: Floats) -> None:
    """Write u, the accelerations alpha x p + omega x (omega x p) of a unit place along each axis, and of `place`."""
    square = w[0] * w[0] + w[1] * w[1] + w[2] * w[2]
    for j in range(3):
        for i in range(3):
            out[1 + j, i] = w[i] * w[j]
        out[1 + j, j] -= square
        following, other = (j + 1) % 3, (j + 2) % 3
        out[1 + j, following] += a[other]
        out[1 + j, other] -= a[following]
    for i in range(3):
        out[4, i] = place[0] * out[1, i] + place[1] * out[2, i] + place[2] * out[3, i]
        out[0, i] = gravity[i] + out[4, i]


@compiled
def _write_changes(before: Floats, after: Floats, by: Floats, between: float, out: Floats) -> None:
    """Write the changes from row to row beyond turning, (9, 3): residual, unknowns, effects of turning and of place."""
    for c in range(4):
        for i in range(3):
            j, k = (i + 1) % 3, (i + 2) % 3
            turned = 0.5 * (by[j] * (before[c, k] + after[c, k]) - by[k] * (before[c, j] + after[c, j]))
            out[c, i] = after[c, i] - before[c, i] + turned
            if c == 0:
                out[7, i] = turned
                out[8, i] = after[4, i] - before[4, i]
                # of a bias along axis i: -between e_i x u
                out[4 + i, i] = 0.0
                out[4 + i, j] = 0.5 * between * (before[0, k] + after[0, k])
                out[4 + i, k] = -0.5 * between * (before[0, j] + after[0, j])


@compiled
def _add_products(sums: Floats, high: Floats, w: Floats, read: Floats) -> None:
    """Add the products of a row's columns, then the squares of effects, of differences from those read, of these."""
    place = 0
    for c in range(_UNKNOWNS + 1):
        for d in range(c, _UNKNOWNS + 1):
            sums[place] += high[c, 0] * high[d, 0] + high[c, 1] * high[d, 1] + high[c, 2] * high[d, 2]
            place += 1
    for i in range(3):
        sums[place] += high[7, i] ** 2 + high[8, i] ** 2
        sums[place + 1] += (w[i] - read[i]) ** 2
        sums[place + 2] += read[i] ** 2


@compiled
def _add_upright(sums: Floats, gravity: Floats, rate: Floats, step: float) -> None:
    """Add a row's rate across and along the vertical, and its turn (3,)."""
    x, y, z = gravity[0], gravity[1], gravity[2]
    u, v, w = rate[0], rate[1], rate[2]
    size, turn = math.sqrt(u * u + v * v + w * w), math.sqrt(x * x + y * y + z * z)
    across = math.sqrt((y * w - z * v) ** 2 + (z * u - x * w) ** 2 + (x * v - y * u) ** 2)
    sums[0] += across
    sums[1] += size * turn
    for i in range(3):
        sums[2 + i] += step * rate[i]


@compiled
def _fit(state: Any, span: int, variance: float, bias: float, is_late: Any, as_read: Floats, out: Floats) -> None:
    """Write residual, allowed residual, weight and relative squared difference of each variant (K, 4)."""
    s = state[0]
    A, x, weights = np.empty((_UNKNOWNS, _UNKNOWNS)), np.empty(_UNKNOWNS), np.zeros((2, 2))
    s.total[:] = 0.0
    for block in range(_BLOCKS):
        s.total[:] += s.sums[span, block]
        weights += s.weights[span, block]
    for v in range(len(out)):
        sums, (rows, time) = s.total[v], weights[int(is_late[v])]
        independent = max(_ROWS_PER_S * time, 1e-9)
        place = _UNKNOWNS + 1
        for i in range(_UNKNOWNS):
            x[i] = sums[1 + i]
            for j in range(i, _UNKNOWNS):
                A[i, j] = A[j, i] = sums[place]
                place += 1
            A[i, i] += variance * rows / independent / (_LEVER_M if i < 3 else bias) ** 2
        levers = _solve(A, x)
        residual = sums[0]
        for i in range(_UNKNOWNS):
            residual -= sums[1 + i] * x[i]
        out[v, 0] = max(residual, 0.0)
        out[v, 1] = max(rows, 1.0) * variance + _MISTUNING_SHARE**2 * (sums[_PRODUCTS] + levers)
        out[v, 2] = 0.5 * independent
        out[v, 3] = sums[_PRODUCTS + 1] / (sums[_PRODUCTS + 2] + 1e-6 * rows)
        if v == 0:
            as_read[:] = -x[3:]


@compiled
def _solve(A: Floats, x: Floats) -> float:
    """Solve A x = x in place by Cholesky, A positive definite (6, 6); return the square of A's part of the place."""
    n, place = len(x), np.empty((3, 3))
    place[:] = A[:3, :3]
    for j in range(n):
        for i in range(j, n):
            total = A[i, j]
            for k in range(j):
                total -= A[i, k] * A[j, k]
            A[i, j] = math.sqrt(max(total, 1e-30)) if i == j else total / A[j, j]
    for i in range(n):
        for k in range(i):
            x[i] -= A[i, k] * x[k]
        x[i] /= A[i, i]
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            x[i] -= A[k, i] * x[k]
        x[i] /= A[i, i]
    square = 0.0
    for i in range(3):
        for j in range(3):
            square += x[i] * place[i, j] * x[j]
    return square
