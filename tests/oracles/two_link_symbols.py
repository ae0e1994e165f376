"""The tutorial's two-link arm in symbols: Jacobians by differentiation, M and g by their sums."""

from functools import cache

import sympy as sp

q0, q1 = sp.symbols("q0 q1", real=True)
L0, L1, m0, m1, gravity = sp.symbols("L0 L1 m0 m1 gravity", positive=True)
Q = sp.Matrix([q0, q1])
NUMBERS = {L0: 1.0, L1: 0.5, m0: 1.0, m1: 1.0, gravity: 9.81}  # of the tutorial; rods of 1 kg


def along(angle: sp.Expr) -> sp.Matrix:
    """Unit vector at an angle from x upwards."""
    return sp.Matrix([sp.cos(angle), 0, sp.sin(angle)])


def turned(angle: sp.Expr) -> sp.Matrix:
    """R_base_link of a link whose x axis is `along` the angle."""
    c, s = sp.cos(angle), sp.sin(angle)
    return sp.Matrix([[c, 0, -s], [0, 1, 0], [s, 0, c]])


def spin(R: sp.Matrix, q: sp.Symbol) -> sp.Matrix:
    """Angular velocity in base axes per rate of q: the skew part of dR/dq R^T."""
    W = sp.simplify(R.diff(q) * R.T)
    return sp.Matrix([W[2, 1], W[0, 2], W[1, 0]])


ANGLES = (q0, q0 + q1)
COMS = (L0 / 2 * along(q0), L0 * along(q0) + L1 / 2 * along(q0 + q1))


@cache
def jacobians() -> tuple[sp.Matrix, ...]:
    """Of both links' centres, (6, 2) each: velocity and angular velocity per rates of the joints."""
    return tuple(
        sp.Matrix.vstack(x.jacobian(Q), sp.Matrix.hstack(spin(turned(a), q0), spin(turned(a), q1)))
        for x, a in zip(COMS, ANGLES, strict=True)
    )


def mass_matrix() -> sp.Matrix:
    """M(q) = sum J^T diag(m, m, m, R I R^T) J of uniform rods."""
    total = sp.zeros(2)
    for J, a, m, L in zip(jacobians(), ANGLES, (m0, m1), (L0, L1), strict=True):
        inertia = turned(a) * sp.diag(0, m * L**2 / 12, m * L**2 / 12) * turned(a).T
        total += J.T * sp.diag(m * sp.eye(3), inertia) * J
    return total


def gravity_torque() -> sp.Matrix:
    """g(q) = -sum J^T F of the links' weights."""
    weight = [sp.Matrix([0, 0, -gravity * m, 0, 0, 0]) for m in (m0, m1)]
    return -sum((J.T * w for J, w in zip(jacobians(), weight, strict=True)), sp.zeros(2, 1))
