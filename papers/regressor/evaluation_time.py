"""How long the full and the compact gravity regressor take to evaluate, side by side in one process.

Both are traced as straight lines of operations and compiled by the same compiler, so that the one differs from the
other by its operations and its entries alone, and not by who wrote it in what: the full one as the paper has it, every
joint's block along the axes of the base and of every frame, zeros of Z included. Robots whose joints all turn, the
paper's. Times are of the machine that it ran on; their ratio hardly depends on it.
"""

import time
from collections.abc import Callable

import numpy as np

from catenary import RobotModel, compact_regressor, gravity_regressor, load_robot
from catenary.arrays import Floats
from catenary.dynamics.lines import empty, placed
from catenary.dynamics.vectors import Vector, cross, dot, put, row, times, transpose_times
from catenary.kernels.kernel import Kernel
from catenary.kernels.tracing import Line
from papers.experiment import Result, run

CALLS = 200  # timed together: a call takes about as long as reading the clock


def full_line(model: RobotModel) -> Line:
    """Trace the paper's full Z (n, 3 n (n + 1)), row by row, of an arm whose joints all turn; inputs q and gravity.

    A first moment e, along an axis of any frame, asks z . (gravity x e) = e . (z x gravity) of a joint with axis z: so
    z x gravity is turned from the joint's frame to the base, and from there to every frame.
    """
    p = placed(model)
    parents = [int(parent) for parent in p.tree.parent]
    n, m = len(model.tree.parent), len(parents)
    width = 3 * (n + 1)
    g = p.trace.inputs("gravity", 3)
    link_gravity = empty(m + 1, 3)
    put(link_gravity, m, (g[0], g[1], g[2]))
    for i, parent in enumerate(parents):
        put(link_gravity, i, transpose_times(p.rotation, i, row(link_gravity, parent)))
    Z = np.full((model.n, n * width), 0.0, dtype=object)
    for k in range(n):
        link = 2 * k + 1  # a joint is two of these links: one stands turned, the other turns
        pull = cross(row(p.tree.axis, link), row(link_gravity, link))
        while link >= 0:
            pull = times(p.rotation, link, pull)
            link = parents[link]
        seen: list[Vector] = []
        for i, parent in enumerate(parents):
            seen.append(transpose_times(p.rotation, i, pull if parent < 0 else seen[parent]))
        block = list(pull)
        for j in range(n):
            block += [dot(row(p.turn[j], along), seen[2 * j + 1]) for along in range(3)]
        for r in np.flatnonzero(model.coupling[k]):
            for c, effort in enumerate(block):
                Z[r, width * k + c] = effort * float(model.coupling[k, r])
    return p.trace.line(list(Z.ravel()))


def full_kernel(model: RobotModel) -> Kernel:
    """Return the compiled full Z of an arm whose joints all turn."""
    n = len(model.tree.parent)
    return Kernel(f"{model.name.replace('_', '-')}-full-regressor", full_line(model), (model.n, 3 * n * (n + 1)))


def medians(calls: list[Callable[[], object]], repeats: int) -> Floats:
    """Return the median time of each call [s], measured in turns."""
    taken = np.empty((repeats, len(calls)))
    for k in range(repeats):
        for c, call in enumerate(calls):
            begin = time.perf_counter()
            for _ in range(CALLS):
                call()
            taken[k, c] = (time.perf_counter() - begin) / CALLS
    found: Floats = np.median(taken, axis=0)
    return found


@run(revision=1)
def evaluation(robot: str, repeats: int) -> Result:
    """Time both forms of a robot's regressor; return microseconds of each, and full over compact."""
    model = load_robot(robot)
    compact = compact_regressor(model)
    full = full_kernel(compact.model)
    rng = np.random.default_rng(0)
    q, gravity = rng.normal(size=model.n), rng.normal(size=3)
    outs = np.empty(full.shape), np.empty((model.n, len(compact.labels)))
    taken = medians([full.bind(q, gravity, outs[0]), compact.kernel().bind(q, gravity, outs[1])], repeats)
    difference = np.abs(outs[0] - gravity_regressor(model, q, gravity)).max()
    return {
        "full_us": float(1e6 * taken[0]),
        "compact_us": float(1e6 * taken[1]),
        "ratio": float(taken[0] / taken[1]),
        "difference": float(difference),
    }
