"""The mass matrix M(q) of M qdd + C qd + g = tau."""

import numpy as np
from numpy.typing import ArrayLike

from catenary.arrays import Floats, as_batch
from catenary.dynamics.coordinates import place_tree, to_robot_matrix
from catenary.dynamics.kernels import MANY, known_kernel, one_by_kernel
from catenary.dynamics.lines import mass_matrix_line
from catenary.dynamics.recursion import composite_body_recursion
from catenary.kernels.compiled import compiled
from catenary.robots.model import RobotModel, Tree


def mass_matrix(model: RobotModel, q: ArrayLike, *, threads: int = 1) -> Floats:
    """Return the mass matrix: the kinetic energy is qd^T M qd / 2.

    Composite rigid bodies (Walker, Orin 1982). Motors' inertia is not in it.

    Args:
        model: The robot.
        q: (n,) or (N, n) coordinates [rad or m].
        threads: How many to share the rows among; as in `gravity_torque`.

    Returns:
        Symmetric (n, n) or (N, n, n) [kg m2, kg m or kg], by the units of its row and column.

    Raises:
        MissingInertiaError: Links without inertia.
        InputError: q has another shape or is not finite.
    """
    quick = one_by_kernel(model, "mass-matrix", mass_matrix_line, 2, (q,))
    if quick is not None:
        return quick
    model.require_inertia()
    rows, single = as_batch("q", q, model.n)
    if len(rows) >= MANY or threads > 1:
        kernel = known_kernel(model, "mass-matrix", mass_matrix_line, (model.n, model.n))
        out = kernel.rows(rows, threads=threads)
    else:
        out = np.empty((len(rows), model.n, model.n))
        _mass_matrix_rows(model.tree, model.coupling, model.offset, rows, out)
    return out[0] if single else out


@compiled
def _mass_matrix_rows(tree: Tree, coupling: Floats, offset: Floats, q: Floats, out: Floats) -> None:
    n = len(tree.parent)
    work = np.empty((3, n))
    rotation, position = np.empty((n, 3, 3)), np.empty((n, 3))
    mass, moment, inertia = np.empty(n + 1), np.empty((n + 1, 3)), np.empty((n + 1, 3, 3))
    tree_matrix, half = np.empty((n, n)), np.empty((n, coupling.shape[1]))
    for k in range(len(q)):
        place_tree(tree, coupling, offset, q[k], work, rotation, position)
        composite_body_recursion(tree, rotation, position, mass, moment, inertia, tree_matrix)
        to_robot_matrix(coupling, tree_matrix, half, out[k])
