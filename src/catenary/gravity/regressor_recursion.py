"""Columns of the gravity regressor: what a first moment or a mass on one link asks of every joint.

Plain arithmetic over the tree, in the manner of dynamics/recursion.py: it runs on floats, compiled, and on
symbols. All of it is in the base frame. A first moment v there, carried by a revolute joint with axis z, asks
-gravity . (z x v) = z . (gravity x v) of it; a mass m asks -gravity . z m of a prismatic one.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from catenary.arrays import Floats
from catenary.dynamics.vectors import (
    Numbers,
    Vector,
    column,
    cross,
    dot,
    put,
    put_column,
    row,
    scale,
    times,
)
from catenary.kernels.compiled import inlined
from catenary.robots.model import Tree

Indices = NDArray[np.int64]
CARRIED_MASS = 3  # in place of an axis 0, 1, 2


class Columns(NamedTuple):
    """What the columns of a regressor stand for; several may be added into one."""

    link: Indices  # (m,) index into the tree
    along: Indices  # (m,) axis of the link's frame along which a first moment lies, or CARRIED_MASS
    target: Indices  # (m,) column of Z that it is added to


class Spread(NamedTuple):
    """The coupling's rows without their zeros: tree joint i has entries start[i] to start[i + 1]."""

    start: Indices  # (n_tree + 1,)
    coordinate: Indices  # of each entry
    weight: Floats  # its factor


@inlined
def turn_links(tree: Tree, rotation: Numbers, base_rotation: Numbers, axis: Numbers) -> None:
    """Turn every link and joint axis into the base frame.

    Args:
        tree: The robot's tree.
        rotation: (n, 3, 3) R_parent_i.
        base_rotation: (n, 3, 3) written: R_base_i.
        axis: (n, 3) written: joint axes in the base frame.
    """
    for i in range(len(tree.parent)):
        parent = tree.parent[i]
        for k in range(3):
            if parent >= 0:
                put_column(base_rotation, i, k, times(base_rotation, parent, column(rotation, i, k)))
            else:
                put_column(base_rotation, i, k, column(rotation, i, k))
        put(axis, i, times(base_rotation, i, row(tree.axis, i)))


@inlined
def compact_recursion(
    tree: Tree,
    x: Numbers,
    base_rotation: Numbers,
    axis: Numbers,
    gravity: Vector,
    columns: Columns,
    spread: Spread,
    regressor: Numbers,
) -> None:
    """Write the chosen columns of the regressor along the robot's coordinates.

    A column of a first moment has an entry in the row of every revolute joint that carries its link. That of a
    prismatic joint's carried mass has one in the joint's own row, and, because the joint moves the mass by x
    along its axis, x times those of a first moment along the axis in the rows of the revolute joints before it.

    Args:
        tree: The robot's tree.
        x: (n_tree,) displacement of prismatic joints [m]; not read for revolute ones.
        base_rotation: (n_tree, 3, 3) R_base_i.
        axis: (n_tree, 3) joint axes in the base frame.
        gravity: Free-fall acceleration in the base frame [m/s2].
        columns: Which columns.
        spread: How the tree's joints move with the robot's coordinates.
        regressor: (n, p) written [m/s2 for moments, m2/s2 for masses in rows of revolute joints].
    """
    for r in range(regressor.shape[0]):
        for c in range(regressor.shape[1]):
            regressor[r, c] = 0.0
    for e in range(len(columns.link)):
        j = columns.link[e]
        target = columns.target[e]
        if columns.along[e] == CARRIED_MASS:
            own = -dot(gravity, row(axis, j))
            for s in range(spread.start[j], spread.start[j + 1]):
                r = spread.coordinate[s]
                regressor[r, target] = regressor[r, target] + spread.weight[s] * own
            pull = scale(x[j], cross(gravity, row(axis, j)))
        else:
            pull = cross(gravity, column(base_rotation, j, columns.along[e]))
        _load_carriers(tree, axis, spread, j, pull, target, regressor)


@inlined
def _load_carriers(
    tree: Tree, axis: Numbers, spread: Spread, link: int, pull: Vector, target: int, regressor: Numbers
) -> None:
    """Add z . pull to a column, in the row of every revolute joint that carries a link."""
    k = link
    while k >= 0:
        if not tree.prismatic[k]:
            torque = dot(row(axis, k), pull)
            for s in range(spread.start[k], spread.start[k + 1]):
                r = spread.coordinate[s]
                regressor[r, target] = regressor[r, target] + spread.weight[s] * torque
        k = tree.parent[k]


@inlined
def full_recursion(
    tree: Tree,
    x: Numbers,
    base_rotation: Numbers,
    axis: Numbers,
    gravity: Vector,
    spread: Spread,
    regressor: Numbers,
) -> None:
    """Write the paper's regressor: in block column k, row k, -gravity^T [z_k]x [1 R_1 ... R_n].

    After the n blocks of 3 (n + 1) columns comes one per prismatic joint, the mass it carries. Blocks of prismatic
    joints stay zero.

    Args:
        tree: The robot's tree.
        x: (n_tree,) displacement of prismatic joints [m]; not read for revolute ones.
        base_rotation: (n_tree, 3, 3) R_base_i.
        axis: (n_tree, 3) joint axes in the base frame.
        gravity: Free-fall acceleration in the base frame [m/s2].
        spread: How the tree's joints move with the robot's coordinates.
        regressor: (n, 3 n_tree (n_tree + 1) + prismatic joints) written.
    """
    n = len(tree.parent)
    for r in range(regressor.shape[0]):
        for c in range(regressor.shape[1]):
            regressor[r, c] = 0.0
    last = 3 * n * (n + 1)
    for k in range(n):
        block = 3 * (n + 1) * k
        if not tree.prismatic[k]:
            pushed = cross(row(axis, k), gravity)  # gravity . (z x v) = -v . (z x gravity)
            for a in range(3):
                for s in range(spread.start[k], spread.start[k + 1]):
                    regressor[spread.coordinate[s], block + a] = spread.weight[s] * pushed[a]
            for j in range(n):
                for a in range(3):
                    effort = dot(pushed, column(base_rotation, j, a))
                    for s in range(spread.start[k], spread.start[k + 1]):
                        regressor[spread.coordinate[s], block + 3 * (j + 1) + a] = spread.weight[s] * effort
            continue
        own = -dot(gravity, row(axis, k))
        for s in range(spread.start[k], spread.start[k + 1]):
            r = spread.coordinate[s]
            regressor[r, last] = regressor[r, last] + spread.weight[s] * own
        _load_carriers(tree, axis, spread, k, scale(x[k], cross(gravity, row(axis, k))), last, regressor)
        last += 1


def spread_of(coupling: Floats) -> Spread:
    """Give the coupling (n_tree, n) without its zeros."""
    rows, coordinate = np.nonzero(coupling)
    start = np.searchsorted(rows, np.arange(len(coupling) + 1))
    return Spread(start.astype(np.int64), coordinate.astype(np.int64), np.array(coupling[rows, coordinate]))
