"""The torques of a motion as a matrix times the links' parameters: tau = Y(q, qd, qdd, gravity) phi.

phi holds ten numbers a link, (m, m c, I) with the inertia about the origin of the link's frame, in which the
equations of motion are linear (Atkeson, An, Hollerbach, "Estimation of inertial parameters of manipulator loads and
links", Int. J. Robotics Research 5(3), 1986).
"""

import numpy as np
from numpy.typing import ArrayLike

from catenary.arrays import Floats, as_array
from catenary.dynamics.inverse_dynamics import BaseMotion, felt_rows, motion_rows
from catenary.dynamics.recursion import (
    Numbers,
    Vector,
    add,
    cross,
    dot,
    link_motion,
    place_tree,
    put,
    row,
    scale,
    times,
    to_tree,
)
from catenary.errors import InputError
from catenary.kernels.compiled import compiled, inlined
from catenary.robots.link_inertia import symmetric
from catenary.robots.model import RobotModel, Tree

PER_LINK = 10
PARAMETER_NAMES = ("m", "mcx", "mcy", "mcz", "Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz")
PARAMETER_UNITS = ("kg", "kg m", "kg m", "kg m", *(["kg m2"] * 6))


def torque_regressor(
    model: RobotModel, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike, gravity: ArrayLike, base: BaseMotion | None = None
) -> Floats:
    """Return the regressor Y of tau = Y phi, linear in the links' inertial parameters.

    Args:
        model: The robot; needs no inertia.
        q: Positions (n,) or (N, n) [rad or m].
        qd, qdd: Velocities and accelerations, as `q`.
        gravity: Free-fall acceleration in base axes, (3,) or (N, 3) [m/s2].
        base: Motion of the base; at rest when None.

    Returns:
        (n, 10 n_tree) or (N, n, 10 n_tree): columns by link in the order of `model.link_names`, within a link in that
        of `PARAMETER_NAMES`.

    Examples:
        >>> arm = catenary.load_robot("two_link")
        >>> catenary.torque_regressor(arm, [0.3, 0.5], [1.0, 0.0], [0.0, 2.0], [0.0, 0.0, -9.81]).shape
        (2, 20)
    """
    (rows, velocities, accelerations), single = motion_rows(model, q, qd=qd, qdd=qdd)
    base_rows = felt_rows(gravity, base, len(rows))
    out = np.zeros((len(rows), model.n, PER_LINK * len(model.link_names)))
    arm = model.tree, model.coupling, model.offset
    _regressor_rows(*arm, rows, velocities, accelerations, *base_rows, out)
    return out[0] if single else out


def link_parameters(tree: Tree) -> Floats:
    """Return phi, (10 n_tree,): mass [kg], first moment [kg m], inertia about the frame's origin [kg m2] per link."""
    phi = np.empty((len(tree.parent), PER_LINK))
    for i, (mass, com) in enumerate(zip(tree.mass, tree.com, strict=True)):
        about_origin = tree.inertia[i] + mass * (com @ com * np.eye(3) - np.outer(com, com))
        phi[i, 0] = mass
        phi[i, 1:4] = mass * com
        phi[i, 4:] = about_origin[np.triu_indices(3)]
    return phi.reshape(-1)


def tree_with_parameters(tree: Tree, phi: ArrayLike) -> Tree:
    """Return a tree with given inertial parameters, the inverse of `link_parameters`; impossible bodies are refused.

    Args:
        phi: Parameters of all links (10 n_tree,), as `PARAMETER_NAMES`.
    """
    values = as_array("phi", phi, (PER_LINK * len(tree.parent),)).reshape(-1, PER_LINK)
    com, inertia = np.zeros((len(values), 3)), np.zeros((len(values), 3, 3))
    for i, (mass, moment, six) in enumerate(zip(values[:, 0], values[:, 1:4], values[:, 4:], strict=True)):
        if mass <= 0.0:
            if mass < 0.0 or moment.any() or six.any():
                raise InputError(f"phi: link {i}: mass {mass:g} kg with other parameters: no body has these")
            continue
        com[i] = moment / mass
        inertia[i] = symmetric(six) - mass * (com[i] @ com[i] * np.eye(3) - np.outer(com[i], com[i]))
    return tree._replace(mass=values[:, 0].copy(), com=com, inertia=inertia)


@inlined
def regressor_recursion(
    tree: Tree,
    rotation: Numbers,
    position: Numbers,
    xd: Numbers,
    xdd: Numbers,
    omega: Numbers,
    alpha: Numbers,
    acceleration: Numbers,
    wrench: Numbers,
    matrix: Numbers,
) -> None:
    """Write what each parameter of each link asks of the joints that carry it.

    Forward, the motion of every frame as in the Newton-Euler recursion. A link's force and moment about its own
    origin are linear in its ten parameters: f = m a + [dw x] mc + w x (w x mc), n = mc x a + I dw + w x (I w), with
    a the origin's acceleration less gravity. Each of the ten is carried down the path to the base, and leaves its
    part along every joint it passes.

    Arrays as in recursion.py; `wrench` (2, 10, 3) is overwritten, and of `matrix` (n, 10 n) the entries of joints on
    the path of each link are written, others left as they are. The tree's masses are not read.
    """
    n = len(tree.parent)
    for i in range(n):
        w, dw, o = link_motion(tree, rotation, position, i, xd, xdd, omega, alpha, acceleration)
        _link_wrenches(w, dw, o, wrench[0], wrench[1])
        for p in range(10):
            f = row(wrench[0], p)
            m = row(wrench[1], p)
            j = i
            while j >= 0:
                z = row(tree.axis, j)
                matrix[j, 10 * i + p] = dot(z, f) if tree.prismatic[j] else dot(z, m)
                f = times(rotation, j, f)
                m = add(times(rotation, j, m), cross(row(position, j), f))
                j = tree.parent[j]


@inlined
def _link_wrenches(w: Vector, dw: Vector, o: Vector, force: Numbers, moment: Numbers) -> None:
    """Write the force and the moment about the origin per unit of each parameter, (10, 3) both."""
    put(force, 0, o)
    put(moment, 0, (0.0, 0.0, 0.0))
    unit = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    for k in range(3):
        e = unit[k]
        put(force, 1 + k, add(cross(dw, e), cross(w, cross(w, e))))
        put(moment, 1 + k, cross(e, o))
    p = 4
    for k in range(3):
        for l in range(k, 3):
            # I v for the symmetric unit tensor that has ones at (k, l) and (l, k)
            turned = _symmetric_times(unit[k], unit[l], k == l, dw)
            spun = _symmetric_times(unit[k], unit[l], k == l, w)
            put(force, p, (0.0, 0.0, 0.0))
            put(moment, p, add(turned, cross(w, spun)))
            p += 1


@inlined
def _symmetric_times(a: Vector, b: Vector, same: bool, v: Vector) -> Vector:
    """Return (a b^T + b a^T) v, or a a^T v where both are the same."""
    one = scale(dot(b, v), a)
    return one if same else add(one, scale(dot(a, v), b))


@compiled
def _regressor_rows(
    tree: Tree,
    coupling: Floats,
    offset: Floats,
    q: Floats,
    qd: Floats,
    qdd: Floats,
    gravity: Floats,
    base_omega: Floats,
    base_alpha: Floats,
    out: Floats,
) -> None:
    n = len(tree.parent)
    work = np.empty((3, n))
    rotation, position = np.empty((n, 3, 3)), np.empty((n, 3))
    xd, xdd = np.empty(n), np.empty(n)
    omega, alpha, acceleration = np.zeros((n + 1, 3)), np.zeros((n + 1, 3)), np.empty((n + 1, 3))
    wrench = np.empty((2, 10, 3))
    matrix = np.zeros((n, 10 * n))  # where a joint does not carry a link it stays zero
    for k in range(len(q)):
        place_tree(tree, coupling, offset, q[k], work, rotation, position)
        to_tree(coupling, qd[k], xd)
        to_tree(coupling, qdd[k], xdd)
        omega[n] = base_omega[k if len(base_omega) > 1 else 0]
        alpha[n] = base_alpha[k if len(base_alpha) > 1 else 0]
        for r in range(3):
            acceleration[n, r] = 0.0 - gravity[k if len(gravity) > 1 else 0, r]
        regressor_recursion(tree, rotation, position, xd, xdd, omega, alpha, acceleration, wrench, matrix)
        for i in range(n):
            for c in range(coupling.shape[1]):
                factor = coupling[i, c]
                if factor != 0.0:
                    for p in range(10 * n):
                        out[k, c, p] += factor * matrix[i, p]
