"""Arithmetic of rows of numbers: small compiled functions, such as models in a loop take one after the other.

A tick of the control loop is a batch of one row. Both run these functions, so a deployed model gives the bits that it
was evaluated with: every output is summed in the order of its inputs, however many rows or columns lie beside it.
Only +, -, *, / and comparisons occur, each rounded as IEEE 754 says, so the bits do not depend on the machine either.
"""

import numpy as np

from catenary.arrays import Flags, Floats, Integers
from catenary.kernels.compiled import compiled, inlined


@compiled
def take(X: Floats, columns: Integers, Y: Floats) -> None:
    """Write columns of X (N, F) into Y (N, len(columns))."""
    for row in range(len(X)):
        for k in range(len(columns)):
            Y[row, k] = X[row, columns[k]]


@compiled
def standardise(X: Floats, mean: Floats, scale: Floats, Z: Floats) -> None:
    """Compute Z = (X - mean) / scale.

    Args:
        X, mean, scale, Z: Features (N, F); (F,) each; (N, F), written.
    """
    for row in range(len(X)):
        for k in range(len(mean)):
            Z[row, k] = (X[row, k] - mean[k]) / scale[k]


@compiled
def rescale(Z: Floats, scale: Floats, mean: Floats, Y: Floats) -> None:
    """Write Y = Z * scale + mean."""
    for row in range(len(Z)):
        for k in range(len(mean)):
            Y[row, k] = Z[row, k] * scale[k] + mean[k]


@compiled
def dense(X: Floats, weights: Floats, bias: Floats, Y: Floats) -> None:
    """Compute Y = X @ weights + bias, summed in the order of inputs; eight rows share what they read.

    Args:
        X, weights, bias, Y: Inputs (N, F); (F, m), (m,); (N, m), written.
    """
    fours = len(weights) - len(weights) % 4
    for first in range(0, len(X), 8):
        last = min(first + 8, len(X))
        for row in range(first, last):
            for k in range(len(bias)):
                Y[row, k] = bias[k]
        for i in range(0, fours, 4):
            for row in range(first, last):
                a, b, c, d = X[row, i], X[row, i + 1], X[row, i + 2], X[row, i + 3]
                for k in range(len(bias)):
                    sum_of_two = Y[row, k] + a * weights[i, k] + b * weights[i + 1, k]
                    Y[row, k] = sum_of_two + c * weights[i + 2, k] + d * weights[i + 3, k]
        for i in range(fours, len(weights)):
            for row in range(first, last):
                for k in range(len(bias)):
                    Y[row, k] += X[row, i] * weights[i, k]


@inlined
def exp_minus_1(v: float) -> float:
    """Return exp(v) - 1 for |v| <= 40, to a few units in the last place.

    Taylor's series of v / 64 to the ninth power, then exp(2 t) - 1 = e (2 + e), e = exp(t) - 1, six times; the
    doubling loses no relative accuracy near zero. The C library's function takes one number at a time.
    """
    t = v * 0.015625
    e = 1.0 / 40320.0 + t * (1.0 / 362880.0)
    e = 1.0 / 720.0 + t * (1.0 / 5040.0 + t * e)
    e = 1.0 / 24.0 + t * (1.0 / 120.0 + t * e)
    e = t * (1.0 + t * (0.5 + t * (1.0 / 6.0 + t * e)))
    for _ in range(6):
        e = e * (2.0 + e)
    return e


@inlined
def within(v: float, limit: float) -> float:
    """Return a number clamped to [-limit, limit].

    Args:
        v, limit: Number, and bound, zero or more.
    """
    return -limit if v < -limit else (limit if v > limit else v)


@compiled
def tanh(Z: Floats) -> None:
    """Replace numbers by their hyperbolic tangents, exact to 3e-15 of themselves."""
    for row in range(len(Z)):
        for k in range(Z.shape[1]):
            e = exp_minus_1(2.0 * within(Z[row, k], 20.0))  # 1 in float64 beyond 20
            Z[row, k] = e / (e + 2.0)


@compiled
def logistic(Z: Floats) -> None:
    """Replace numbers v by 1 / (1 + exp(-v)), exact to 1e-15."""
    for row in range(len(Z)):
        for k in range(Z.shape[1]):
            e = exp_minus_1(within(Z[row, k], 40.0))  # 0 or 1 to 1e-17 beyond 40
            Z[row, k] = (e + 1.0) / (e + 2.0)


@compiled
def repeat(value: Floats, Y: Floats) -> None:
    """Write the same numbers into every row.

    Args:
        value, Y: Numbers (m,), and (N, m), written.
    """
    for row in range(len(Y)):
        for k in range(len(value)):
            Y[row, k] = value[k]


@compiled
def add_rows(A: Floats, B: Floats, Y: Floats) -> None:
    """Write Y = A + B, all (N, m)."""
    for row in range(len(Y)):
        for k in range(Y.shape[1]):
            Y[row, k] = A[row, k] + B[row, k]


@compiled
def finite(X: Floats, inside: Flags) -> None:
    """Write whether all numbers of each row of X (N, F) are finite."""
    for row in range(len(X)):
        inside[row] = True
        for k in range(X.shape[1]):
            inside[row] &= np.isfinite(X[row, k])


@compiled
def between(X: Floats, lower: Floats, upper: Floats, inside: Flags) -> None:
    """Clear the flags of rows that leave their limits or hold NaN.

    Args:
        X, lower, upper, inside: Rows (N, F); limits (F,); flags (N,), cleared in place.
    """
    for row in range(len(X)):
        for k in range(len(lower)):
            inside[row] &= (X[row, k] >= lower[k]) & (X[row, k] <= upper[k])
