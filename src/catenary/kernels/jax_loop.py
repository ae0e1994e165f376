"""A long line of operations for JAX: one loop over rows of operations, which XLA compiles in half a second."""

from collections.abc import Callable
from typing import Any

import numpy as np

from catenary.kernels.tracing import Line

WIDTH = 64  # operations of a row


def looped(line: Line) -> Callable[[dict[str, Any], list[int]], Any]:
    """Return what computes the wanted steps by a loop over rows of operations that need earlier rows only.

    Every operation of a row is one of x v[a] + y v[b] + z, v[a] v[b], and sin(x v[a] + z).
    """
    import jax.numpy as jnp
    from jax import lax

    rows = _rows(line)
    inputs = len(line.inputs)
    place = {number: step.a for number, step in enumerate(line.steps) if step.kind == "in"}
    place |= {number: inputs + r * WIDTH + c for r, row in enumerate(rows) for c, number in enumerate(row)}
    size = (len(rows), WIDTH)
    a, b = np.zeros(size, dtype=int), np.zeros(size, dtype=int)
    x, y, z = np.zeros(size), np.zeros(size), np.zeros(size)
    product, angle = np.zeros(size, dtype=bool), np.zeros(size, dtype=bool)
    for at in np.ndindex(size):
        if at[1] >= len(rows[at[0]]):
            continue
        kind, first, second = line.steps[rows[at[0]][at[1]]]
        a[at], x[at] = place[first], second if kind == "*k" else 1.0
        product[at], angle[at] = kind == "*", kind in ("sin", "cos")
        if kind in ("+", "-", "*"):
            b[at], y[at] = place[int(second)], -1.0 if kind == "-" else 1.0
        z[at] = second if kind == "+k" else 0.5 * np.pi if kind == "cos" else 0.0
    turns = angle.any(axis=1)

    def step(v: Any, row: Any) -> Any:
        at, a, b, x, y, z, product, angle, turns = row
        new = jnp.where(product, v[a] * v[b], x * v[a] + y * v[b] + z)
        new = lax.cond(turns, lambda: jnp.where(angle, jnp.sin(new), new), lambda: new)
        return lax.dynamic_update_slice(v, new, (at,)), None

    def compute(arrays: dict[str, Any], steps: list[int]) -> Any:
        v = jnp.concatenate([*arrays.values(), jnp.zeros(len(rows) * WIDTH)])
        starts = inputs + WIDTH * np.arange(len(rows))
        v, _ = lax.scan(step, v, (starts, a, b, x, y, z, product, angle, turns))
        return v[np.array([place[number] for number in steps])]

    return compute


def _rows(line: Line) -> list[list[int]]:
    """Return the steps beyond inputs, grouped by how many operations lie before them."""
    depth: list[int] = []
    for kind, a, b in line.steps:
        before = () if kind == "in" else (depth[a], depth[int(b)]) if kind in ("+", "-", "*") else (depth[a],)
        depth.append(1 + max(before, default=-1))
    levels: list[list[int]] = [[] for _ in range(max(depth, default=0) + 1)]
    for number, level in enumerate(depth):
        levels[level].append(number)
    return [level[i : i + WIDTH] for level in levels[1:] for i in range(0, len(level), WIDTH)]
