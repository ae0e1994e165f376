"""Exact derivatives of torques with respect to positions, velocities and accelerations."""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from catenary.arrays import Floats
from catenary.dynamics.inverse_dynamics import gravity_rows, motion_rows, place_rows
from catenary.dynamics.recursion import newton_euler_recursion
from catenary.robots.model import RobotModel

_STEP = 1e-30  # so small that its square, and what it adds to a real part, is rounded off


class TorqueDerivatives(NamedTuple):
    """Derivatives of torques, each (n, n) or (N, n, n): element (i, j) is that of torque i by coordinate j."""

    by_q: Floats  # [Nm or N, per rad or m]
    by_qd: Floats
    by_qdd: Floats  # the mass matrix


def torque_derivatives(
    model: RobotModel, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike, gravity: ArrayLike
) -> TorqueDerivatives:
    """Return the derivatives of `inverse_dynamics` by q, qd and qdd, on a base at rest.

    The Newton-Euler recursion runs on complex numbers, whose imaginary parts obey the rules of differentiation: exact
    to rounding, without differences (Squire, Trapp, "Using complex variables to estimate derivatives of real
    functions", SIAM Review 40(1), 1998). For MPC and linearisation: A = [[0, 1], [-M^-1 by_q, -M^-1 by_qd]].

    Args:
        model: The robot; needs inertia.
        q: Positions (n,) or (N, n) [rad or m].
        qd, qdd: Velocities and accelerations, as `q`.
        gravity: Free-fall acceleration in base axes, down, (3,) or (N, 3) [m/s2].

    Examples:
        >>> arm = catenary.load_robot("two_link")
        >>> slopes = catenary.torque_derivatives(arm, [0.3, 0.5], [0.0, 0.0], [0.0, 0.0], [0.0, 0.0, -9.81])
        >>> np.allclose(slopes.by_qdd, catenary.mass_matrix(arm, [0.3, 0.5]))
        True
    """
    model.require_inertia()
    motion, single = motion_rows(model, q, qd=qd, qdd=qdd)
    count, n, links = len(motion[0]), model.n, len(model.offset)
    steps = 1j * _STEP * np.eye(3 * n).reshape(3 * n, 3, n)  # of each coordinate of q, then of qd, then of qdd
    moved = [(rows[:, None] + steps[:, k]).reshape(-1, n) for k, rows in enumerate(motion)]
    rotation, position, xd, xdd = place_rows(model, *moved)
    omega, alpha, acceleration, force, moment = np.zeros((5, links + 1, 3, len(moved[0])), complex)
    down = np.broadcast_to(gravity_rows(gravity, count), (count, 3))
    acceleration[links] = -np.repeat(down, 3 * n, axis=0).T
    torque = np.empty((links, len(moved[0])), complex)
    bodies = omega, alpha, acceleration, force, moment, torque
    newton_euler_recursion(model.tree, rotation, position, xd, xdd, *bodies)
    parts = (model.coupling.T @ torque).imag.reshape(n, count, 3, n).transpose(2, 1, 0, 3) / _STEP
    return TorqueDerivatives(*(part[0] if single else part for part in parts))
