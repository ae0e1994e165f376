"""Gravity torques, potential energy, and centre of mass of an arm."""

import numpy as np
from numpy.typing import ArrayLike

from catenary.arrays import Floats, as_array, as_batch
from catenary.dynamics.inverse_dynamics import gravity_rows, warn_of_motion
from catenary.dynamics.kinematics import link_poses
from catenary.dynamics.recursion import gravity_recursion, place_tree, to_robot
from catenary.dynamics.robot_kernels import DynamicQuantity
from catenary.dynamics.symbolic import gravity_line
from catenary.dynamics.torque_regressor import torque_regressor
from catenary.errors import InputError
from catenary.kernels.compiled import compiled
from catenary.robots.model import RobotModel, Tree
from catenary.spatial import LEVEL


def gravity_torque(model: RobotModel, q: ArrayLike, gravity: ArrayLike) -> Floats:
    """Return the torques that hold the arm still: g of M(q) qdd + C(q, qd) qd + g(q) = tau.

    In frame i let z be the axis of joint i, i_g gravity, and i_r_k the centre of mass of each link k that the joint
    carries, of mass m_k. A revolute joint holds -z . sum_k i_r_k x (i_g m_k), a prismatic one
    -z . sum_k i_g m_k. [Lewis, Hannaford 2014, "Dynamically evaluated gravity compensation for the RAVEN
    surgical robot", eq. 1-3; the paper states the prismatic sign in its text, and writes k >= i for a chain]

    For 50 000 rows or more, and from the 101st single call, the robot's own kernel is used (`gravity_kernel`), compiled
    in half a second; results differ in rounding only. For one q with many gravities, repeat q.

    Args:
        model: The robot; needs inertia.
        q: Positions (n,) or (N, n) [rad or m].
        gravity: Free-fall acceleration in base axes, down, (3,) or (N, 3) [m/s2]: (0, 0, -9.81) upright.

    Returns:
        Torques that the actuators must supply, (n,) or (N, n) [Nm or N]; never negate them.

    Raises:
        InputError: Wrong shape, or not finite.
        MissingInertiaError: A link has no inertia.

    Examples:
        >>> arm = catenary.load_robot("raven2")
        >>> catenary.gravity_torque(arm, [0.5, 1.6, 0.4], [0.0, 0.0, -9.81]).round(3)
        array([-0.068, -0.456,  2.133])
    """
    quick = _GRAVITY.of_one(model, (q, gravity))
    if quick is not None:
        return quick
    model.require_masses()
    rows, single = as_batch("q", q, model.n)
    down = gravity_rows(gravity, len(rows))
    warn_of_motion(model, rows, down)
    out = _GRAVITY.of_rows(model, (rows, down))
    return out[0] if single else out


def gravity_delta(model: RobotModel, q: ArrayLike, gravity: ArrayLike) -> Floats:
    """Return the torques (n,) or (N, n) to add to firmware for a level base: g(q, gravity) - g(q, level) [Nm|N].

    g is linear in gravity, so this is g(q, gravity - level), exactly zero on a level base.

    Args:
        model: The robot that the firmware assumes, including its payloads; needs masses.
        q: Positions (n,) or (N, n) [rad or m].
        gravity: Measured gravity in base axes, (3,) or (N, 3) [m/s2].
    """
    model.require_masses()
    rows, single = as_batch("q", q, model.n)
    out = _GRAVITY.of_rows(model, (rows, gravity_rows(gravity, len(rows)) - LEVEL))
    return out[0] if single else out


def potential_energy(model: RobotModel, q: ArrayLike, gravity: ArrayLike) -> Floats:
    """Return the links' potential energy () or (N,) [J]: U = -sum_k m_k gravity . r_k, 0 at the base's origin.

    Args:
        model: The robot; needs inertia.
        q: Positions (n,) or (N, n) [rad or m].
        gravity: Free-fall acceleration in base axes, down, (3,) or (N, 3) [m/s2].

    Examples:
        >>> arm = catenary.load_robot("two_link")
        >>> level = [0.0, 0.0, -9.81]
        >>> q, step = np.array([0.3, 0.5]), 1e-6 * np.eye(2)
        >>> slope = [np.subtract(*catenary.potential_energy(arm, [q + h, q - h], level)) / 2e-6 for h in step]
        >>> np.allclose(slope, catenary.gravity_torque(arm, q, level))
        True
    """
    model.require_masses()
    rows, single = as_batch("q", q, model.n)
    energies: Floats = -np.sum(_first_moments(model, rows) * gravity_rows(gravity, len(rows)), axis=1)
    return energies.reshape(()) if single else energies


def center_of_mass(model: RobotModel, q: ArrayLike) -> Floats:
    """Return the centre of mass (3,) or (N, 3) of all moving links in the base frame [m], p_com = sum m_i p_i / M.

    [gravity-regressor paper, section II] Links fixed to the base are excluded.

    Args:
        model: The robot; needs masses.
        q: Positions (n,) or (N, n) [rad or m].

    Examples:
        >>> arm = catenary.load_robot("panda")
        >>> catenary.center_of_mass(arm, np.zeros(arm.n)).round(3)
        array([0.023, 0.007, 0.614])
    """
    mass = _total_mass(model)
    rows, single = as_batch("q", q, model.n)
    center: Floats = _first_moments(model, rows) / mass
    return center[0] if single else center


def center_of_mass_jacobian(model: RobotModel, q: ArrayLike) -> Floats:
    """Return the Jacobian of the centre of mass, (3, n) or (N, 3, n) [m/rad|1]: J_com qd is its velocity in base axes.

    Gravity acts on a robot as on one mass at its centre of mass, g(q) = -M J_com^T gravity [gravity-regressor paper,
    section II]: row r of J_com is the joint torque under unit gravity along axis r, divided by -M.

    Args:
        model: The robot; needs masses.
        q: Positions (n,) or (N, n) [rad or m].

    Examples:
        >>> arm = catenary.load_robot("two_link")
        >>> q, level = [0.3, 0.5], np.array([0.0, 0.0, -9.81])
        >>> torque = -arm.tree.mass.sum() * level @ catenary.center_of_mass_jacobian(arm, q)
        >>> np.allclose(torque, catenary.gravity_torque(arm, q, level))
        True
    """
    mass = _total_mass(model)
    rows, single = as_batch("q", q, model.n)
    jacobian: Floats = (0.0 - np.stack([gravity_torque(model, rows, axis) for axis in np.eye(3)], axis=1)) / mass
    return jacobian[0] if single else jacobian


def _total_mass(model: RobotModel) -> float:
    model.require_masses()
    mass = float(model.tree.mass.sum())
    if not mass > 0.0:
        raise InputError(f'robot "{model.name}": no moving link has a mass, so there is no centre of mass')
    return mass


def _first_moments(model: RobotModel, rows: Floats) -> Floats:  # (N, 3) [kg m] about the base's origin
    rotation, position = link_poses(model, rows)
    centers = position + np.einsum("Nkab,kb->Nka", rotation, model.tree.com)
    return np.einsum("k,Nka->Na", model.tree.mass, centers)


@compiled
def _gravity_torque_rows(tree: Tree, coupling: Floats, offset: Floats, q: Floats, gravity: Floats, out: Floats) -> None:
    n = len(tree.parent)
    work = np.empty((3, n))
    rotation, position = np.empty((n, 3, 3)), np.empty((n, 3))
    mass, moment, link_gravity = np.empty(n + 1), np.empty((n + 1, 3)), np.empty((n + 1, 3))
    torque = np.empty(n)
    for k in range(len(q)):
        place_tree(tree, coupling, offset, q[k], work, rotation, position)
        row = gravity[k if len(gravity) > 1 else 0]
        g = (row[0], row[1], row[2])
        gravity_recursion(tree, rotation, position, g, mass, moment, link_gravity, torque)
        to_robot(coupling, torque, out[k])


_FELT = 1e-4  # [Nm or N per kg m or kg] rounding error, as of a first axis with rpy 3.1416, 7e-6 rad off upright


def unseen_torque(model: RobotModel, q: ArrayLike, gravity: ArrayLike) -> Floats:
    """Bound the error of an identified robot's gravity torques from parameters that its recordings did not determine.

    Recordings on one base determine only masses that load the joints there: on a level floor not the first moments
    about a vertical axis. The bound is zero if all are determined, and under the gravity of the identification.

    Args:
        q: Configuration (n,) [rad or m].
        gravity: Free-fall acceleration in base axes (3,) [m/s2].

    Returns:
        Largest absolute error (n,) [Nm or N]; infinite if unbounded.
    """
    rows = as_array("q", q, (model.n,))[None]
    zeros, down = np.zeros_like(rows), as_array("gravity", gravity, (3,))
    out = np.zeros(model.n)
    if not model.unseen:
        return out
    Y = torque_regressor(model, rows, zeros, zeros, down)[0].reshape(model.n, len(model.link_names), -1)
    for unseen in model.unseen:
        effect = np.abs(np.einsum("nlp,lp->n", Y[:, :, :4], unseen.change))
        out[effect > _FELT] += effect[effect > _FELT] * max(-unseen.low, unseen.high)  # infinite if unbounded
    return out


_GRAVITY = DynamicQuantity("gravity", gravity_line, _gravity_torque_rows, 1)
