"""Inverse and forward dynamics, their derivatives and matrices: the terms of M(q) qdd + C(q, qd) qd + g(q) = tau."""

import warnings
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from catenary.arrays import Floats, as_array, as_batch
from catenary.dynamics.actuation_loads import ActuationLoads
from catenary.dynamics.recursion import (
    Numbers,
    composite_body_recursion,
    newton_euler_recursion,
    place_joints,
    place_tree,
    to_robot,
    to_robot_matrix,
    to_tree,
)
from catenary.dynamics.robot_kernels import DynamicQuantity
from catenary.dynamics.symbolic import inverse_dynamics_line, mass_matrix_line
from catenary.errors import ImplausibleWarning, InputError
from catenary.kernels.compiled import compiled
from catenary.robots.model import RobotModel, Tree
from catenary.robots.plausibility import gravity_doubts

_ZERO = (0.0, 0.0, 0.0)
_FELT_M_S2 = 30.0  # beyond which no base feels gravity and its own acceleration
_UP_M_S2 = 1.0  # upwards, from which a base hangs, and is not on a wall with a sensor's noise
_BEYOND = {"rad": 10.0, "m": 1.0}  # limits: numbers in degrees and millimetres are, wound-up joints less
_AT_REST = np.zeros(3)  # rates of the base


class BaseMotion(NamedTuple):
    """Motion of the base frame against an inertial frame, in base axes.

    `linear_acceleration` is that of the frame's origin as a point, without gravity: an accelerometer there reads
    linear_acceleration - gravity. The linear velocity matters to `frame_motion` alone. Each is one vector, or one for
    every configuration.

    Examples:
        >>> arm = catenary.load_robot("two_link")
        >>> braking = catenary.BaseMotion(linear_acceleration=[-3.0, 0.0, 0.0])
        >>> q, still = [0.3, 0.5], [0.0, 0.0]
        >>> catenary.inverse_dynamics(arm, q, still, still, [0.0, 0.0, -9.81], braking).round(3)
        array([17.634,  2.247])
    """

    angular_velocity: ArrayLike = _ZERO  # (3,) or (N, 3) [rad/s]
    angular_acceleration: ArrayLike = _ZERO  # (3,) or (N, 3) [rad/s2]
    linear_acceleration: ArrayLike = _ZERO  # (3,) or (N, 3) [m/s2]
    linear_velocity: ArrayLike = _ZERO  # (3,) or (N, 3) [m/s]


def inverse_dynamics(
    model: RobotModel,
    q: ArrayLike,
    qd: ArrayLike,
    qdd: ArrayLike,
    gravity: ArrayLike,
    base: BaseMotion | None = None,
    *,
    loads: ActuationLoads | None = None,
) -> Floats:
    """Return the torques (n,) or (N, n) [Nm|N] of M(q) qdd + C(q, qd) qd + g(q), on a base that may itself move.

    Recursive Newton-Euler (Luh, Walker, Paul 1980). A moving base loads the joints with
    gravity - a_base - alpha x r - omega x (omega x r) in place of gravity, and with the moments that turn
    the links along with it. `forward_dynamics` is the inverse.

    Args:
        model: The robot; needs inertia.
        q: Positions (n,) or (N, n) [rad or m].
        qd, qdd: Velocities and accelerations, as `q`.
        gravity: Free-fall acceleration in base axes, down, (3,) or (N, 3) [m/s2].
        base: Motion of the base, one for all rows or one a row; at rest when None.
        loads: Friction, rotors, springs and known torques to add: `known_loads(model)`; none when None.

    Raises:
        InputError: Another shape, or not finite.
        MissingInertiaError: A link without inertia.

    Examples:
        >>> arm = catenary.load_robot("two_link")
        >>> q, qd, qdd = [0.3, 0.5], [1.0, -1.0], [2.0, 0.0]
        >>> catenary.inverse_dynamics(arm, q, qd, qdd, [0.0, 0.0, -9.81]).round(3)
        array([19.597,  2.434])
    """
    if base is None and loads is None:
        quick = _INVERSE_DYNAMICS.of_one(model, (q, qd, qdd, gravity, _AT_REST, _AT_REST))
        if quick is not None:
            return quick
    model.require_inertia()
    motion, single = motion_rows(model, q, qd=qd, qdd=qdd)
    warn_of_motion(model, motion[0], gravity_rows(gravity, len(motion[0])))
    out = _INVERSE_DYNAMICS.of_rows(model, (*motion, *felt_rows(gravity, base, len(motion[0]))))
    if loads is not None:
        out = out + loads.torque(motion[0], motion[1], motion[2], out)
    return out[0] if single else out


def coriolis_matrix(model: RobotModel, q: ArrayLike, qd: ArrayLike) -> Floats:
    """Return the Coriolis matrix C, (n, n) or (N, n, n), of Christoffel's symbols; C qd are the velocities' torques.
    M_dot - 2 C is skew, and C(q, a) b = C(q, b) a.

    The velocity terms h(v) = C(q, v) v of the inverse dynamics are a quadratic form, and C(q, a) b the symmetric
    bilinear form that belongs to it: column j is C(q, qd) e_j = (h(qd + s e_j) - h(qd - s e_j)) / (4 s), exactly and
    for any s; s = max |qd| loses no digits.

    Args:
        model: The robot; needs inertia.
        q: Positions (n,) or (N, n) [rad or m].
        qd: Velocities, as `q`.

    Examples:
        >>> catenary.coriolis_matrix(catenary.load_robot("two_link"), [0.3, 0.5], [1.0, -1.0]).round(4)
        array([[0.1199, 0.    ],
               [0.1199, 0.    ]])
    """
    model.require_inertia()
    (rows, velocities), single = motion_rows(model, q, qd=qd)
    largest = np.abs(velocities).max(axis=1, initial=0.0)
    s = np.where(largest > 0.0, largest, 1.0)[:, None, None]
    places = np.repeat(rows, model.n, axis=0)
    still, nothing = np.zeros_like(places), np.zeros((1, 3))
    terms = []
    for sign in (1.0, -1.0):
        moved = (velocities[:, None, :] + sign * s * np.eye(model.n)).reshape(places.shape)
        h = np.empty_like(places)
        arm = model.tree, model.coupling, model.offset
        _inverse_dynamics_rows(*arm, places, moved, still, nothing, nothing, nothing, h)
        terms.append(h.reshape(len(rows), model.n, model.n))
    matrices = np.swapaxes((terms[0] - terms[1]) / (4.0 * s), 1, 2)
    out: Floats = np.ascontiguousarray(matrices)
    return out[0] if single else out


def mass_matrix(model: RobotModel, q: ArrayLike) -> Floats:
    """Return the mass matrix (n, n) or (N, n, n) [kg m2|kg m|kg]: kinetic energy qd^T M qd / 2, motors excluded.

    Composite rigid bodies (Walker, Orin 1982).

    Args:
        model: The robot; needs inertia.
        q: Positions (n,) or (N, n) [rad or m].

    Raises:
        InputError: Another shape, or not finite.
        MissingInertiaError: A link without inertia.

    Examples:
        >>> catenary.mass_matrix(catenary.load_robot("two_link"), [0.3, 0.5]).round(4)
        array([[1.8555, 0.3027],
               [0.3027, 0.0833]])
    """
    quick = _MASS_MATRIX.of_one(model, (q,))
    if quick is not None:
        return quick
    model.require_inertia()
    rows, single = as_batch("q", q, model.n)
    out = _MASS_MATRIX.of_rows(model, (rows,))
    return out[0] if single else out


def warn_of_motion(model: RobotModel, q: Floats, gravity: Floats) -> None:
    """Warn of gravity that points up or is too large, and of joints far beyond their limits.

    Args:
        q: Positions (N, n) [rad or m].
        gravity: Gravity (1 or N, 3) [m/s2].
    """
    odd = (gravity[:, 2] > _UP_M_S2) | (np.abs(gravity).max(axis=1) > _FELT_M_S2)
    doubts = gravity_doubts(gravity[odd.argmax()]) if odd.any() else []
    away = np.maximum(model.lower - q, q - model.upper).max(axis=0, initial=0.0)
    for name, unit, far in zip(model.joint_names, model.joint_units, away.tolist(), strict=True):
        if far > _BEYOND[unit]:
            doubts.append(f"joint {name} is {far:.4g} {unit} beyond its limits; positions are in rad and m")
    for doubt in doubts:
        warnings.warn(f'robot "{model.name}": {doubt}', ImplausibleWarning, stacklevel=4)


def gravity_rows(vectors: ArrayLike, count: int, name: str = "gravity") -> Floats:
    """Return gravity, or another vector, as one row (1, 3) for all configurations or one for each (N, 3).

    Args:
        vectors, count: (3,) or (N, 3); number of configurations N.
        name: The quantity, which opens every message.
    """
    rows, single = as_batch(name, vectors, 3)
    if not single and len(rows) != count:
        raise InputError(f"{name}: expected shape (3,) or ({count}, 3), as q has it, got {rows.shape}")
    return rows


def felt_rows(gravity: ArrayLike, base: BaseMotion | None, count: int) -> tuple[Floats, Floats, Floats]:
    """Return gravity less a base's acceleration [m/s2], and its angular velocity and acceleration, (1, 3) or (N, 3)."""
    omega, alpha, linear, _ = base_rows(base, count)
    return gravity_rows(gravity, count) - linear, omega, alpha


def base_rows(base: BaseMotion | None, count: int) -> list[Floats]:
    """Return the fields of a base's motion, zero at rest, in their order, (1, 3) or (N, 3) for `count` rows."""
    return [
        gravity_rows(vectors, count, f"base {name.replace('_', ' ')}")
        for name, vectors in zip(BaseMotion._fields, base or BaseMotion(), strict=True)
    ]


def motion_rows(model: RobotModel, q: ArrayLike, **rates: ArrayLike | None) -> tuple[list[Floats], bool]:
    """Return a motion's positions and rates as batches (N, n), and whether `q` was a single row.

    Args:
        q: Positions (n,) or (N, n) [rad or m].
        **rates: Velocities and accelerations by name, as `q`; zero where None.
    """
    rows, single = as_batch("q", q, model.n)
    shape = (model.n,) if single else rows.shape
    arrays = (np.zeros(shape) if rate is None else as_array(name, rate, shape) for name, rate in rates.items())
    return [rows, *(rate.reshape(rows.shape) for rate in arrays)], single


def place_rows(model: RobotModel, *motion: Numbers) -> tuple[Numbers, Numbers, Numbers, Numbers]:
    """Return rotation, position, xd and xdd of q, qd and qdd, as the recursions take them.

    Of (n,) they are numbers, of (N, n) arrays of all rows, the last axis: recursions run on these, and on complex ones.
    """
    x, xd, xdd = (model.coupling @ rows.T for rows in motion)
    x = (x.T + model.offset).T
    rotation, position = (np.empty((len(x), *shape, *x.shape[1:]), x.dtype) for shape in ((3, 3), (3,)))
    place_joints(model.tree, x, np.sin(x), np.cos(x), rotation, position)
    return rotation, position, xd, xdd


@compiled
def _inverse_dynamics_rows(
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
    xd, xdd, torque = np.empty(n), np.empty(n), np.empty(n)
    omega, alpha, acceleration = np.empty((n + 1, 3)), np.empty((n + 1, 3)), np.empty((n + 1, 3))
    force, moment = np.empty((n + 1, 3)), np.empty((n + 1, 3))
    for k in range(len(q)):
        omega[n] = base_omega[k if len(base_omega) > 1 else 0]
        alpha[n] = base_alpha[k if len(base_alpha) > 1 else 0]
        place_tree(tree, coupling, offset, q[k], work, rotation, position)
        to_tree(coupling, qd[k], xd)
        to_tree(coupling, qdd[k], xdd)
        for r in range(3):
            acceleration[n, r] = 0.0 - gravity[k if len(gravity) > 1 else 0, r]
        newton_euler_recursion(tree, rotation, position, xd, xdd, omega, alpha, acceleration, force, moment, torque)
        to_robot(coupling, torque, out[k])


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


_INVERSE_DYNAMICS = DynamicQuantity("inverse-dynamics", inverse_dynamics_line, _inverse_dynamics_rows, 1)
_MASS_MATRIX = DynamicQuantity("mass-matrix", mass_matrix_line, _mass_matrix_rows, 2)


_MASSLESS_CONDITION = 1e13  # condition of a mass matrix from which some motion moves no mass
_LOAD_ROUNDS = 200  # in which friction that grows with the load must settle
_SETTLED_SHARE = 1e-12  # of the torque


def forward_dynamics(
    model: RobotModel,
    q: ArrayLike,
    qd: ArrayLike,
    tau: ArrayLike,
    gravity: ArrayLike,
    base: BaseMotion | None = None,
    *,
    loads: ActuationLoads | None = None,
) -> Floats:
    """Return the accelerations (n,) or (N, n) [rad/s2|m/s2] by torques: M(q) qdd = tau - C(q, qd) qd - g(q).

    With `loads`, friction, rotors, springs and known torques take part as in `inverse_dynamics`: friction as in
    sliding, and none at rest where it has the sign of the speed, so that no joint sticks. Friction that grows with the
    load depends on the accelerations, and is found by iteration.

    Args:
        model: The robot; needs inertia.
        q: Positions (n,) or (N, n) [rad or m].
        qd: Velocities, as `q`.
        tau: Torques, as `q` [Nm or N].
        gravity: Free-fall acceleration in base axes, down, (3,) or (N, 3) [m/s2].
        base, loads: Motion of the base, and `known_loads(model)`; None for a base at rest and for no loads.

    Raises:
        MissingInertiaError: Links without inertia.
        InputError: A motion that moves no mass; friction that takes more than the load that it grows with.

    Examples:
        >>> arm = catenary.load_robot("two_link")
        >>> q, qd, level = [0.3, 0.5], [1.0, -1.0], [0.0, 0.0, -9.81]
        >>> tau = catenary.inverse_dynamics(arm, q, qd, [2.0, 0.0], level)
        >>> catenary.forward_dynamics(arm, q, qd, tau, level).round(6)
        array([2., 0.])
    """
    (rows, rates, torques), single = motion_rows(model, q, qd=qd, tau=tau)
    still = np.zeros_like(rows)
    M: Floats = mass_matrix(model, rows)
    moving: Floats = torques
    if loads is not None:
        M = M + loads.rotors
        for _ in range(_LOAD_ROUNDS if loads.depends_on_load else 1):
            # of links and rotors, which friction may grow with
            before, moving = moving, np.asarray(torques - loads.torque(rows, rates, still, moving))
            if np.abs(moving - before).max(initial=0.0) <= _SETTLED_SHARE * max(1.0, np.abs(torques).max(initial=0.0)):
                break
        else:
            if loads.depends_on_load:
                raise InputError(f'robot "{model.name}": friction takes more than the load that it grows with')
    free = moving - inverse_dynamics(model, rows, rates, still, gravity, base)
    if not (np.linalg.cond(M) < _MASSLESS_CONDITION).all():
        raise InputError(
            f'robot "{model.name}": its joints can move so that no mass moves: accelerations have no bound'
        )
    out = np.asarray(np.linalg.solve(M, free[:, :, None])[:, :, 0], dtype=np.float64)
    return out[0] if single else out


_COMPLEX_STEP = 1e-30  # so small that its square, and what it adds to a real part, is rounded off


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
    steps = 1j * _COMPLEX_STEP * np.eye(3 * n).reshape(3 * n, 3, n)  # of each coordinate of q, then of qd, then of qdd
    moved = [(rows[:, None] + steps[:, k]).reshape(-1, n) for k, rows in enumerate(motion)]
    rotation, position, xd, xdd = place_rows(model, *moved)
    omega, alpha, acceleration, force, moment = np.zeros((5, links + 1, 3, len(moved[0])), complex)
    down = np.broadcast_to(gravity_rows(gravity, count), (count, 3))
    acceleration[links] = -np.repeat(down, 3 * n, axis=0).T
    torque = np.empty((links, len(moved[0])), complex)
    bodies = omega, alpha, acceleration, force, moment, torque
    newton_euler_recursion(model.tree, rotation, position, xd, xdd, *bodies)
    parts = (model.coupling.T @ torque).imag.reshape(n, count, 3, n).transpose(2, 1, 0, 3) / _COMPLEX_STEP
    return TorqueDerivatives(*(part[0] if single else part for part in parts))
