"""From the robot's coordinates to its tree, and torques and matrices back.

tree coordinate = coupling @ q + offset. Power is then the same on both sides if tau = coupling.T @ tree
torque, and kinetic energy if M = coupling.T @ tree matrix @ coupling. A constant coupling adds no velocity
terms, so the Coriolis matrix goes the same way. Called from compiled code, one row of a batch at a time.
"""

import math

from catenary.arrays import Floats
from catenary.dynamics.recursion import place_joints
from catenary.kernels.compiled import inlined
from catenary.robots.model import Tree


@inlined
def place_tree(
    tree: Tree, coupling: Floats, offset: Floats, q: Floats, work: Floats, rotation: Floats, position: Floats
) -> None:
    """Place every link in its parent at coordinates q.

    Args:
        tree: The robot's tree.
        coupling: (n_tree, n).
        offset: (n_tree,) [rad or m].
        q: (n,) [rad or m].
        work: (3, n_tree) overwritten.
        rotation: (n_tree, 3, 3) written: R_parent_i.
        position: (n_tree, 3) written: origin of frame i in the parent [m].
    """
    x, sine, cosine = work[0], work[1], work[2]
    to_tree(coupling, q, x)
    for i in range(len(offset)):
        x[i] += offset[i]
        sine[i] = math.sin(x[i])
        cosine[i] = math.cos(x[i])
    place_joints(tree, x, sine, cosine, rotation, position)


@inlined
def to_tree(coupling: Floats, rates: Floats, tree_rates: Floats) -> None:
    """Write coupling @ rates: velocities or accelerations of the tree's joints."""
    for i in range(coupling.shape[0]):
        total = 0.0
        for k in range(coupling.shape[1]):
            total += coupling[i, k] * rates[k]
        tree_rates[i] = total


@inlined
def to_robot(coupling: Floats, tree_torque: Floats, torque: Floats) -> None:
    """Write coupling.T @ tree_torque: torques along the robot's coordinates."""
    for k in range(coupling.shape[1]):
        total = 0.0
        for i in range(coupling.shape[0]):
            total += coupling[i, k] * tree_torque[i]
        torque[k] = total


@inlined
def to_robot_columns(coupling: Floats, tree_columns: Floats, columns: Floats) -> None:
    """Write tree_columns @ coupling: a Jacobian's columns along the robot's coordinates."""
    for r in range(tree_columns.shape[0]):
        for k in range(coupling.shape[1]):
            total = 0.0
            for i in range(coupling.shape[0]):
                total += tree_columns[r, i] * coupling[i, k]
            columns[r, k] = total


@inlined
def to_robot_matrix(coupling: Floats, tree_matrix: Floats, work: Floats, matrix: Floats) -> None:
    """Write coupling.T @ tree_matrix @ coupling; work (n_tree, n) is overwritten."""
    to_robot_columns(coupling, tree_matrix, work)
    for k in range(coupling.shape[1]):
        for l in range(coupling.shape[1]):
            total = 0.0
            for i in range(coupling.shape[0]):
                total += coupling[i, k] * work[i, l]
            matrix[k, l] = total
