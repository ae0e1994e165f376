"""Torques of one configuration in a loop: no checks, and no memory taken in the tick.

The recursions' work arrays lie in one long array, cut into views inside compiled code: handing an array to compiled
code costs 0.2 us, and there would be a dozen.
"""

from typing import NamedTuple

import numpy as np

from catenary.arrays import Floats
from catenary.dynamics.coordinates import place_tree, to_robot, to_tree
from catenary.dynamics.recursion import newton_euler_recursion
from catenary.kernels.compiled import compiled, inlined
from catenary.robots.model import RobotModel, Tree


class Workspace(NamedTuple):
    """Views of the long array, for a tree of n joints."""

    trigonometry: Floats  # (3, n)
    rotation: Floats  # (n, 3, 3)
    position: Floats  # (n, 3)
    xd: Floats  # (n,)
    xdd: Floats  # (n,)
    omega: Floats  # (n + 1, 3)
    alpha: Floats  # (n + 1, 3)
    acceleration: Floats  # (n + 1, 3)
    force: Floats  # (n + 1, 3)
    moment: Floats  # (n + 1, 3)
    mass: Floats  # (n + 1,)
    torque: Floats  # (n,)


def new_workspace(model: RobotModel) -> Floats:
    """The long array of a robot; not for two threads at once."""
    n = len(model.tree.parent)
    return np.empty(18 * n + 16 * (n + 1))


@inlined
def workspace_of(flat: Floats, n: int) -> Workspace:
    """Cut the long array of a tree of n joints into its views."""
    b = n + 1  # links and the base
    s = 18 * n
    return Workspace(
        flat[0 : 3 * n].reshape((3, n)),
        flat[3 * n : 12 * n].reshape((n, 3, 3)),
        flat[12 * n : 15 * n].reshape((n, 3)),
        flat[15 * n : 16 * n],
        flat[16 * n : 17 * n],
        flat[s : s + 3 * b].reshape((b, 3)),
        flat[s + 3 * b : s + 6 * b].reshape((b, 3)),
        flat[s + 6 * b : s + 9 * b].reshape((b, 3)),
        flat[s + 9 * b : s + 12 * b].reshape((b, 3)),
        flat[s + 12 * b : s + 15 * b].reshape((b, 3)),
        flat[s + 15 * b : s + 16 * b],
        flat[17 * n : 18 * n],
    )


@compiled
def newton_euler_torque(
    tree: Tree,
    coupling: Floats,
    offset: Floats,
    q: Floats,
    qd: Floats,
    qdd: Floats,
    gravity: Floats,
    base_rates: Floats,
    flat: Floats,
    out: Floats,
) -> None:
    """Write M(q) qdd + C(q, qd) qd + g(q) on a base that may turn: inverse_dynamics of one row.

    Args:
        tree: The robot's tree.
        coupling: (n_tree, n).
        offset: (n_tree,).
        q: (n,) coordinates [rad|m].
        qd: (n,).
        qdd: (n,).
        gravity: (3,) free-fall acceleration less the acceleration of the base's origin, in base axes [m/s2].
        base_rates: (2, 3) angular velocity and acceleration of the base, in its axes [rad/s, rad/s2].
        flat: From `new_workspace`; overwritten.
        out: (n,) written [Nm|N].
    """
    n = len(tree.parent)
    w = workspace_of(flat, n)
    place_tree(tree, coupling, offset, q, w.trigonometry, w.rotation, w.position)
    to_tree(coupling, qd, w.xd)
    to_tree(coupling, qdd, w.xdd)
    for r in range(3):
        w.omega[n, r] = base_rates[0, r]
        w.alpha[n, r] = base_rates[1, r]
        w.acceleration[n, r] = -gravity[r]
    newton_euler_recursion(
        tree,
        w.rotation,
        w.position,
        w.xd,
        w.xdd,
        w.omega,
        w.alpha,
        w.acceleration,
        w.force,
        w.moment,
        w.torque,
    )
    to_robot(coupling, w.torque, out)
