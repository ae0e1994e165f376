"""The compact regressor of one robot as a straight line of operations, for kernels and for C."""

from collections.abc import Sequence

import numpy as np

from catenary.dynamics.lines import empty, placed
from catenary.dynamics.vectors import Vector, cross, dot, put, row, transpose_times
from catenary.gravity.regressor import CARRIED_MASS, RegressorColumn
from catenary.kernels.tracing import Line, Term
from catenary.robots.model import RobotModel


def compact_line(
    model: RobotModel, columns: Sequence[RegressorColumn], targets: Sequence[int], width: int
) -> Line:
    """Trace the regressor (n, width), row by row; inputs q (n,) and gravity (3,).

    As `regressor_columns` has it, but in the links' frames. A first moment e asks z . (gravity x e) = e . (z x gravity)
    of a joint that carries it: so z x gravity, two numbers and no sum in the joint's own frame, is turned on
    from link to link, and its parts are the entries. In the base frame every entry would be a scalar product.

    Args:
        model: The robot; it needs no inertia.
        columns: Which first moments and masses.
        targets: Which column of the regressor each is added to.
        width: Columns of the regressor.
    """
    p = placed(model)
    n, m = len(model.tree.parent), len(p.tree.parent)
    g = p.trace.inputs("gravity", 3)
    link_gravity = empty(m + 1, 3)
    put(link_gravity, m, (g[0], g[1], g[2]))
    for i in range(m):
        put(link_gravity, i, transpose_times(p.rotation, i, row(link_gravity, p.tree.parent[i])))
    Z = np.full((model.n, width), 0.0, dtype=object)

    def add_in_row(joint: int, column: int, effort: Term) -> None:
        for r in np.flatnonzero(model.coupling[joint]):
            Z[r, column] = Z[r, column] + effort * float(model.coupling[joint, r])

    for k in range(n):
        own = 2 * k + 1
        axis = row(p.tree.axis, own)
        if p.tree.prismatic[own]:
            effort = -dot(axis, row(link_gravity, own))
            if (k, CARRIED_MASS) in columns:
                add_in_row(k, targets[columns.index(RegressorColumn(k, CARRIED_MASS))], effort)
            continue
        turning: dict[int, Vector] = {own: cross(axis, row(link_gravity, own))}  # by link, in its frame
        for i in range(own + 1, m):
            if int(p.tree.parent[i]) in turning:
                turning[i] = transpose_times(p.rotation, i, turning[int(p.tree.parent[i])])
        for (link, along), target in zip(columns, targets, strict=True):
            here = turning.get(2 * link + 1)
            if here is None:
                continue
            if along == CARRIED_MASS:
                effort = p.x[2 * link + 1] * dot(row(p.tree.axis, 2 * link + 1), here)
            else:
                effort = dot(row(p.turn[link], along), here)
            add_in_row(k, target, effort)
    return p.trace.line(list(Z.ravel()))
