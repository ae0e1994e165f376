"""The centre of mass of the whole robot, and how it moves with the coordinates.

Gravity acts on a robot as on one mass at its centre of mass: g(q) = -M J_com^T gravity, with M the total mass, which
on a level base is M g_c J_com^T e_z [gravity-regressor paper, section II].
"""

import numpy as np
from numpy.typing import ArrayLike

from catenary.arrays import Floats, as_batch
from catenary.dynamics.recursion import first_moments, place_links, place_tree, to_robot_columns
from catenary.dynamics.vectors import cross, row, times
from catenary.errors import InputError
from catenary.kernels.compiled import compiled
from catenary.robots.model import RobotModel, Tree


def center_of_mass(model: RobotModel, q: ArrayLike) -> Floats:
    """Return the centre of mass of all moving links, p_com = sum m_i p_i / M.

    [gravity-regressor paper, section II] Links fixed to the base do not count.

    Args:
        model: The robot.
        q: (n,) or (N, n) coordinates [rad or m].

    Returns:
        (3,) or (N, 3) in the base frame [m].

    Raises:
        MissingInertiaError: Links without inertia.
        InputError: q has another shape or is not finite; a robot without mass.
    """
    rows, single = _checked(model, q)
    out = np.empty((len(rows), 3))
    _center_of_mass_rows(model.tree, model.coupling, model.offset, rows, out)
    return out[0] if single else out


def center_of_mass_jacobian(model: RobotModel, q: ArrayLike) -> Floats:
    """Return the Jacobian of the centre of mass, J_com qd = its velocity in base axes.

    J_com = sum m_i J_i / M [gravity-regressor paper, section II]: for a revolute joint z x h / M, with h the first
    moment of all that it carries about its origin, for a prismatic one z m / M, with m the mass it carries.

    Args:
        model: The robot.
        q: (n,) or (N, n) coordinates [rad or m].

    Returns:
        (3, n) or (N, 3, n) [m/rad or 1].

    Raises:
        MissingInertiaError: Links without inertia.
        InputError: q has another shape or is not finite; a robot without mass.
    """
    rows, single = _checked(model, q)
    out = np.empty((len(rows), 3, model.n))
    _jacobian_rows(model.tree, model.coupling, model.offset, rows, out)
    return out[0] if single else out


def _checked(model: RobotModel, q: ArrayLike) -> tuple[Floats, bool]:
    model.require_masses()
    rows, single = as_batch("q", q, model.n)
    if not model.tree.mass.sum() > 0.0:
        raise InputError(f'robot "{model.name}": no moving link has a mass, so there is no centre of mass')
    return rows, single


@compiled
def _center_of_mass_rows(tree: Tree, coupling: Floats, offset: Floats, q: Floats, out: Floats) -> None:
    n = len(tree.parent)
    work = np.empty((3, n))
    rotation, position = np.empty((n, 3, 3)), np.empty((n, 3))
    mass, moment = np.empty(n + 1), np.empty((n + 1, 3))
    for k in range(len(q)):
        place_tree(tree, coupling, offset, q[k], work, rotation, position)
        first_moments(tree, rotation, position, mass, moment)
        for r in range(3):
            out[k, r] = moment[n, r] / mass[n]


@compiled
def _jacobian_rows(tree: Tree, coupling: Floats, offset: Floats, q: Floats, out: Floats) -> None:
    n = len(tree.parent)
    work = np.empty((3, n))
    rotation, position = np.empty((n, 3, 3)), np.empty((n, 3))
    base_rotation, base_position = np.empty((n + 1, 3, 3)), np.empty((n + 1, 3))
    mass, moment = np.empty(n + 1), np.empty((n + 1, 3))
    columns = np.empty((3, n))
    for k in range(len(q)):
        place_tree(tree, coupling, offset, q[k], work, rotation, position)
        place_links(tree, rotation, position, base_rotation, base_position)
        first_moments(tree, rotation, position, mass, moment)
        for i in range(n):
            axis = row(tree.axis, i)
            moved = cross(axis, row(moment, i))
            if tree.prismatic[i]:
                moved = (mass[i] * axis[0], mass[i] * axis[1], mass[i] * axis[2])
            in_base = times(base_rotation, i, moved)
            for r in range(3):
                columns[r, i] = in_base[r] / mass[n]
        to_robot_columns(coupling, columns, out[k])
