"""The torques of a motion, and the velocity terms of M qdd + C qd + g = tau as a matrix."""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from catenary.arrays import Floats, as_array, as_batch
from catenary.dynamics.coordinates import place_tree, to_robot, to_tree
from catenary.dynamics.kernels import one_by_kernel
from catenary.dynamics.lines import inverse_dynamics_line
from catenary.dynamics.recursion import newton_euler_recursion
from catenary.errors import InputError
from catenary.kernels.compiled import compiled
from catenary.robots.model import RobotModel, Tree

_ZERO = (0.0, 0.0, 0.0)
_AT_REST = np.zeros(3)  # rates of the base


class BaseMotion(NamedTuple):
    """How the base frame moves, against a frame that does not, expressed in base axes.

    The linear velocity does not matter. `linear_acceleration` is that of the frame's origin as a point,
    without gravity: an accelerometer there reads linear_acceleration - gravity. Each is one vector, or one for every
    configuration.
    """

    angular_velocity: ArrayLike = _ZERO  # (3,) or (N, 3) [rad/s]
    angular_acceleration: ArrayLike = _ZERO  # (3,) or (N, 3) [rad/s2]
    linear_acceleration: ArrayLike = _ZERO  # (3,) or (N, 3) [m/s2]


def inverse_dynamics(
    model: RobotModel,
    q: ArrayLike,
    qd: ArrayLike,
    qdd: ArrayLike,
    gravity: ArrayLike,
    base: BaseMotion | None = None,
) -> Floats:
    """Return the torques of a motion: M(q) qdd + C(q, qd) qd + g(q), on a base that may itself move.

    Recursive Newton-Euler (Luh, Walker, Paul 1980). A moving base loads the joints with
    gravity - a_base - alpha x r - omega x (omega x r) in place of gravity, and with the moments that turn
    the links along with it.

    Args:
        model: The robot.
        q: (n,) or (N, n) coordinates [rad or m].
        qd: The same shape, velocities.
        qdd: The same shape, accelerations.
        gravity: (3,) or (N, 3) free-fall acceleration in base axes, down: (0, 0, -9.81) upright [m/s2].
        base: Motion of the base, the same for every row or one for each; at rest when None.

    Returns:
        (n,) or (N, n) [Nm or N].

    Raises:
        MissingInertiaError: Links without inertia.
        InputError: An argument has another shape or is not finite.
    """
    if base is None:
        inputs = q, qd, qdd, gravity, _AT_REST, _AT_REST
        quick = one_by_kernel(model, "inverse-dynamics", inverse_dynamics_line, 1, inputs)
        if quick is not None:
            return quick
    model.require_inertia()
    (rows, velocities, accelerations), single = motion_rows(model, q, qd=qd, qdd=qdd)
    gravities = gravity_rows(gravity, len(rows))
    base_motion = np.zeros((1, 3, 3)) if base is None else base_rows(base, len(rows))
    out = np.empty((len(rows), model.n))
    arm = model.tree, model.coupling, model.offset
    _inverse_dynamics_rows(*arm, rows, velocities, accelerations, gravities, base_motion, out)
    return out[0] if single else out


def coriolis_matrix(model: RobotModel, q: ArrayLike, qd: ArrayLike) -> Floats:
    """Return the Coriolis matrix of Christoffel's symbols: M_dot - 2 C is skew and C(q, a) b = C(q, b) a.

    The velocity terms h(v) = C(q, v) v of the inverse dynamics are a quadratic form, and C(q, a) b the symmetric
    bilinear form that belongs to it: column j is C(q, qd) e_j = (h(qd + s e_j) - h(qd - s e_j)) / (4 s), exactly and
    for any s; s = max |qd| loses no digits.

    Args:
        model: The robot.
        q: (n,) or (N, n) coordinates [rad or m].
        qd: The same shape, velocities.

    Returns:
        (n, n) or (N, n, n); C qd are the torques of the velocities.

    Raises:
        MissingInertiaError: Links without inertia.
        InputError: An argument has another shape or is not finite.
    """
    model.require_inertia()
    (rows, velocities), single = motion_rows(model, q, qd=qd)
    largest = np.abs(velocities).max(axis=1, initial=0.0)
    s = np.where(largest > 0.0, largest, 1.0)[:, None, None]
    places = np.repeat(rows, model.n, axis=0)
    still, no_gravity, base_at_rest = np.zeros_like(places), np.zeros((1, 3)), np.zeros((1, 3, 3))
    terms = []
    for sign in (1.0, -1.0):
        moved = (velocities[:, None, :] + sign * s * np.eye(model.n)).reshape(places.shape)
        h = np.empty_like(places)
        arm = model.tree, model.coupling, model.offset
        _inverse_dynamics_rows(*arm, places, moved, still, no_gravity, base_at_rest, h)
        terms.append(h.reshape(len(rows), model.n, model.n))
    matrices = np.swapaxes((terms[0] - terms[1]) / (4.0 * s), 1, 2)
    out: Floats = np.ascontiguousarray(matrices)
    return out[0] if single else out


def gravity_rows(gravity: ArrayLike, count: int) -> Floats:
    """Return gravity (3,) or (N, 3) as one row for all, or as one row for each of `count` configurations.

    Raises:
        InputError: Another shape or number of rows, NaN or infinity.
    """
    return _vector_rows("gravity", gravity, count)


def _vector_rows(name: str, vectors: ArrayLike, count: int) -> Floats:
    rows, single = as_batch(name, vectors, 3)
    if not single and len(rows) != count:
        raise InputError(f"{name}: expected shape (3,) or ({count}, 3), as q has it, got {rows.shape}")
    return rows


def base_rows(base: BaseMotion, count: int) -> Floats:
    """Return a base's motion as one (3, 3) for all configurations, or one for each: (1 or N, 3, 3).

    Raises:
        InputError: Another shape or number of rows, NaN or infinity.
    """
    motions = [
        _vector_rows(f"base {name.replace('_', ' ')}", base[r], count)
        for r, name in enumerate(BaseMotion._fields)
    ]
    rows: Floats = np.stack(np.broadcast_arrays(*motions), axis=1)
    return rows


def motion_rows(model: RobotModel, q: ArrayLike, **rates: ArrayLike | None) -> tuple[list[Floats], bool]:
    """Return q and its rates, which come in the shape of q, as (N, n) each, and whether q was a single row.

    A rate that is None is zero.

    Raises:
        InputError: Another shape, NaN or infinity; the message opens with the name of the argument.
    """
    rows, single = as_batch("q", q, model.n)
    shape = (model.n,) if single else rows.shape
    given = (np.zeros(shape) if rate is None else as_array(name, rate, shape) for name, rate in rates.items())
    return [rows, *(rate.reshape(rows.shape) for rate in given)], single


@compiled
def _inverse_dynamics_rows(
    tree: Tree,
    coupling: Floats,
    offset: Floats,
    q: Floats,
    qd: Floats,
    qdd: Floats,
    gravity: Floats,
    base_motion: Floats,
    out: Floats,
) -> None:
    n = len(tree.parent)
    work = np.empty((3, n))
    rotation, position = np.empty((n, 3, 3)), np.empty((n, 3))
    xd, xdd, torque = np.empty(n), np.empty(n), np.empty(n)
    omega, alpha, acceleration = np.empty((n + 1, 3)), np.empty((n + 1, 3)), np.empty((n + 1, 3))
    force, moment = np.empty((n + 1, 3)), np.empty((n + 1, 3))
    for k in range(len(q)):
        base = base_motion[k if len(base_motion) > 1 else 0]
        omega[n] = base[0]
        alpha[n] = base[1]
        place_tree(tree, coupling, offset, q[k], work, rotation, position)
        to_tree(coupling, qd[k], xd)
        to_tree(coupling, qdd[k], xdd)
        for r in range(3):
            acceleration[n, r] = base[2, r] - gravity[k if len(gravity) > 1 else 0, r]
        newton_euler_recursion(
            tree, rotation, position, xd, xdd, omega, alpha, acceleration, force, moment, torque
        )
        to_robot(coupling, torque, out[k])
