"""Symmetric positive definite systems in compiled loops: bounded time, no library call, no exception."""

import math

from catenary.arrays import Floats
from catenary.kernels.compiled import inlined


@inlined
def factorise(A: Floats) -> bool:
    """Overwrite the lower triangle of A (n, n) with L, A = L L^T; false when A is not positive definite.

    Only the lower triangle is read.
    """
    for i in range(A.shape[0]):
        for j in range(i + 1):
            total = A[i, j]
            for k in range(j):
                total -= A[i, k] * A[j, k]
            if i == j:
                if not total > 0.0:  # also when it is NaN
                    return False
                A[i, i] = math.sqrt(total)
            else:
                A[i, j] = total / A[j, j]
    return True


@inlined
def solve_factored(L: Floats, b: Floats) -> None:
    """Overwrite b (n,) with the solution of L L^T x = b; of L (n, n) only the lower triangle is read."""
    for i in range(L.shape[0]):
        total = b[i]
        for k in range(i):
            total -= L[i, k] * b[k]
        b[i] = total / L[i, i]
    for i in range(L.shape[0] - 1, -1, -1):
        total = b[i]
        for k in range(i + 1, L.shape[0]):
            total -= L[k, i] * b[k]
        b[i] = total / L[i, i]
