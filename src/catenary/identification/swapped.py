"""Detection of two axes of a recording that stand in each other's columns."""

from dataclasses import replace
from itertools import combinations
from typing import Any

import numpy as np

from catenary.arrays import Floats
from catenary.identification.identification import Identification
from catenary.identification.least_squares import solve, triangles
from catenary.identification.samples import Samples

ROWS = 600  # that are looked at
# untouched recordings of five real arms keep 0.95 or more
CLEARLY = 0.4  # of the product of all axes' mean squares: at most this is left when two are swapped back
LEAST = 1e-3  # relative residual that counts as none


def swapped_axes(
    result: Identification, samples: Samples, *, refit: bool = False
) -> tuple[tuple[int, int] | None, float]:
    """Return the pair of axes whose swapping back removes most of all axes' residual, or None, and the share left.

    Positions with velocities and torques are swapped, or torques alone.

    Args:
        result: What was identified.
        samples: The recording.
        refit: It is one that was fitted: parameters are fitted anew for every pair.
    """
    some = np.unique(np.linspace(0, len(samples) - 1, min(len(samples), ROWS)).astype(np.int64))
    chosen = np.zeros(len(samples), dtype=bool)
    chosen[some] = True
    rows = samples.rows(chosen, samples.name)
    before = _misfit(result, rows, refit)
    best, pair = CLEARLY, None
    for i, j in combinations(range(rows.q.shape[1]), 2):
        for keys in (("q", "qd", "qdd", "tau"), ("tau",)):
            order = np.arange(rows.q.shape[1])
            order[[i, j]] = j, i
            swapped: dict[str, Any] = {key: getattr(rows, key)[:, order] for key in keys}
            after = _misfit(result, replace(rows, **swapped), refit)
            left = float(np.prod(after / before))
            if left < best:
                best, pair = left, (i, j)
    return pair, best


def _misfit(result: Identification, rows: Samples, refit: bool) -> Floats:
    """Return each axis's mean square residual (n,) over that of its torque, four at most: more is no worse."""
    gravity = np.array(result.options.gravity)
    reduced = triangles(result.base, gravity, [rows])
    beta = solve(reduced.stacked(result.weights)) if refit else result.beta
    relative = reduced.residual_rms(beta) / np.maximum(np.sqrt(np.mean(rows.tau**2, axis=0)), 1e-9)
    misfit: Floats = np.clip(relative, LEAST, 2.0) ** 2
    return misfit
