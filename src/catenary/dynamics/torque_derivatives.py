"""How torques change with positions, velocities and accelerations: exact derivatives."""

from typing import NamedTuple

from numpy.typing import ArrayLike

from catenary.arrays import Floats
from catenary.dynamics.inverse_dynamics import gravity_rows, mass_matrix, motion_rows
from catenary.dynamics.lines import inverse_dynamics_line
from catenary.dynamics.robot_kernels import known_kernel
from catenary.kernels.derivatives import derivative_line
from catenary.kernels.tracing import Line
from catenary.robots.model import RobotModel


class TorqueDerivatives(NamedTuple):
    """Derivatives of torques, each (n, n) or (N, n, n): element (i, j) is that of torque i by coordinate j."""

    by_q: Floats  # [Nm or N, per rad or m]
    by_qd: Floats
    by_qdd: Floats  # the mass matrix


def torque_derivatives(
    model: RobotModel, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike, gravity: ArrayLike
) -> TorqueDerivatives:
    """Return the derivatives of `inverse_dynamics` by q, qd and qdd, on a base at rest.

    The robot's line of operations is differentiated as it stands, so they are exact to rounding. For MPC and
    linearisation: A = [[0, 1], [-M^-1 by_q, -M^-1 by_qd]]. The first call for a robot compiles, for seconds.

    Args:
        model: The robot; needs inertia.
        q: Positions (n,) or (N, n) [rad or m].
        qd: Velocities, as `q`.
        qdd: Accelerations, as `q`.
        gravity: Free-fall acceleration in base axes, down, (3,) or (N, 3) [m/s2].

    Example:
        >>> arm = catenary.load_robot("two_link")
        >>> slopes = catenary.torque_derivatives(arm, [0.3, 0.5], [0.0, 0.0], [0.0, 0.0], [0.0, 0.0, -9.81])
        >>> np.allclose(slopes.by_qdd, catenary.mass_matrix(arm, [0.3, 0.5]))
        True
    """
    model.require_inertia()
    n, (motion, single) = model.n, motion_rows(model, q, qd=qd, qdd=qdd)
    kernel = known_kernel(model, "torque-derivatives", _by_q_and_qd, (n, 2 * n))
    both = kernel.rows(*motion, gravity_rows(gravity, len(motion[0])))
    parts = both[:, :, :n], both[:, :, n:], mass_matrix(model, motion[0])
    return TorqueDerivatives(*(part[0] if single else part for part in parts))


def _by_q_and_qd(model: RobotModel) -> Line:
    return derivative_line(inverse_dynamics_line(model, moving_base=False), ("q", "qd"))
