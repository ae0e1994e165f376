"""Weighted least squares over all axes, from one triangle per axis."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from catenary.arrays import Floats
from catenary.errors import InputError
from catenary.identification.base_parameters import BaseParameters
from catenary.identification.samples import Samples
from catenary.robots.actuation import Weighting

_SINGULAR_RATIO = 1e-5  # smallest singular value, columns scaled to one, of a motion that shows its parameters

_LEAST_NOISE = 0.001  # of an axis' torque


@dataclass(frozen=True)
class Triangles:
    """What least squares needs of any number of rows: per axis R of the QR of [Y_b | tau]."""

    R: Floats  # (n, b + 1, b + 1)
    rows: int
    independent: float  # rows that count, less what filters tie together

    def stacked(self, weights: Floats) -> Floats:
        """Return R (b + 1, b + 1) of all axes together, each times its weight."""
        b = self.R.shape[1]
        return _triangle((self.R * weights[:, None, None]).reshape(-1, b))

    def near_zero(self, sizes: Mapping[int, tuple[int, float]], beta: Floats) -> "Triangles":
        """Return them with parameters that have a standard deviation about zero beforehand, as rows of an axis.

        `sizes` are axis and deviation by a parameter's place; beta (b,) a fit, whose residual is the axes' noise.
        """
        noise = self.noise(beta)
        rows = np.zeros((len(self.R), len(sizes), self.R.shape[2]))
        for row, (k, (axis, size)) in enumerate(sizes.items()):
            rows[axis, row, k] = noise[axis] * np.sqrt(self.rows / self.independent) / size
        return replace(self, R=np.stack([_triangle(axis) for axis in np.concatenate([self.R, rows], axis=1)]))

    def noise(self, beta: Floats) -> Floats:
        """Return the standard deviation (n,) of the axes' torques by what a fit leaves."""
        size = np.linalg.norm(self.R[:, :, -1], axis=1) / np.sqrt(self.rows)
        return np.asarray(np.maximum(self.residual_rms(beta), _LEAST_NOISE * size))

    def variance(self, weights: Floats, beta: Floats) -> float:
        """Return the variance of weighted rows, as large as if filters tied none together."""
        return float(np.mean((weights * self.noise(beta)) ** 2)) * self.rows / self.independent

    def residual_rms(self, beta: Floats) -> Floats:
        """Return the RMS (n,) of tau - Y_b beta."""
        return np.linalg.norm(self.R @ np.append(-beta, 1.0), axis=1) / np.sqrt(self.rows)


def triangles(base: BaseParameters, samples: Sequence[Samples]) -> Triangles:
    """Reduce recordings to their triangles, a chunk at a time."""
    n, b = samples[0].q.shape[1], base.count
    R = np.zeros((n, 0, b + 1))
    for part in samples:
        for chunk, Y in base.chunks(part):
            rows = np.concatenate([Y, part.tau[chunk, :, None]], axis=2).transpose(1, 0, 2)
            stacked = np.concatenate([R, rows], axis=1)
            if stacked.shape[1] < b + 1:  # fewer rows than columns: QR would give a trapezium
                stacked = np.concatenate([stacked, np.zeros((n, b + 1 - stacked.shape[1], b + 1))], axis=1)
            R = np.stack([_triangle(axis) for axis in stacked])
    count = sum(len(part) for part in samples)
    return Triangles(R, count, sum(part.independent * len(part) for part in samples))


def axis_weights(weighting: Weighting, samples: Sequence[Samples], reduced: Triangles) -> Floats:
    """Return the weight of each axis (n,) [1/Nm or 1/N]: one over the range of its torque, its spread, or its residual.

    The residual's RMS is found by fitting twice more. An axis without any torque weighs as the weakest other.
    """
    tau = np.concatenate([part.tau for part in samples])
    n = tau.shape[1]
    if weighting == "none":
        return np.ones(n)
    weights = one_over(np.ptp(tau, axis=0) if weighting == "range" else tau.std(axis=0))
    if weighting == "residual":
        for _ in range(2):
            weights = one_over(reduced.residual_rms(solve(reduced.stacked(weights))))
    return weights


def one_over(size: Floats) -> Floats:
    """Return the weights of axes by the size of their torque."""
    floor = 1e-9 * float(size.max())
    if not floor > 0.0:
        raise InputError("the recordings' torques do not vary on any axis: there is nothing to identify from")
    largest = 1.0 / size[size > floor].min()
    return np.where(size > floor, 1.0 / np.maximum(size, floor), largest)


def scaled_solution(X: Floats, y: Floats, visible: float) -> Floats:
    """Solve least squares with columns scaled to one; directions of smaller singular values stay zero."""
    scale = np.linalg.norm(X, axis=0)
    scale[scale <= 1e-9 * max(float(scale.max()), 1e-300)] = np.inf
    return np.linalg.lstsq(X / scale, y, rcond=visible)[0] / scale


def solve(R: Floats) -> Floats:
    """Solve least squares from the triangle of [Y | tau]; dependent columns share."""
    b = R.shape[1] - 1
    return scaled_solution(R[:b, :b], R[:b, b], 1e-13)


def condition_of_triangle(R: Floats) -> tuple[int, float, Floats]:
    """Return rank, condition and weakest direction (b,) of a triangle whose columns are scaled to length one."""
    b = R.shape[1] - 1
    scale = np.linalg.norm(R[:b, :b], axis=0)
    values, Vt = np.linalg.svd(R[:b, :b] / np.where(scale > 0.0, scale, 1.0))[1:]
    condition = float(values[0] / values[-1]) if values[-1] > 0.0 else np.inf
    return int((values > _SINGULAR_RATIO * values[0]).sum()), condition, Vt[-1]


def covariance(reduced: Triangles, weights: Floats, beta: Floats) -> Floats:
    """Return the covariance (b, b) of beta, each axis with noise of its own.

    H^-1 (sum_a w_a^4 s_a^2 Y_a' Y_a) H^-1 with H = sum_a w_a^2 Y_a' Y_a. Zero-phase filtering ties neighbouring rows
    together, so the rows that count are fewer: 2 cut-off / rate of them.
    """
    b = len(beta)
    R = reduced.stacked(weights)[:b, :b]
    scale = np.linalg.norm(R, axis=0)
    scale[scale == 0.0] = 1.0
    inverse = np.linalg.pinv(R / scale, rcond=1e-12) / scale[:, None]
    noise = reduced.noise(beta)
    columns = (reduced.R[:, :, :b] * (weights**2 * noise)[:, None, None]).reshape(-1, b) @ inverse @ inverse.T
    freedom = max(reduced.rows * len(weights) - b, 1) / (reduced.rows * len(weights))
    return columns.T @ columns * (reduced.rows / reduced.independent) / freedom


def _triangle(matrix: Floats) -> Floats:
    return np.asarray(np.linalg.qr(matrix, mode="r"))
