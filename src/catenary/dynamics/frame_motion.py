"""How a frame moves, from the motion of the joints and of the base."""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from catenary.arrays import Floats
from catenary.dynamics.inverse_dynamics import BaseMotion, base_rows, motion_rows
from catenary.dynamics.kinematics import Configuration
from catenary.dynamics.recursion import link_motion, place_tree, to_tree
from catenary.kernels.compiled import compiled
from catenary.robots.model import RobotModel, Tree


class FrameMotion(NamedTuple):
    """Motion of a frame and of its origin as a point, against an inertial frame, in base axes; each (3,) or (N, 3)."""

    velocity: Floats  # [m/s]
    angular_velocity: Floats  # [rad/s]
    acceleration: Floats  # [m/s2], that of the point, without gravity
    angular_acceleration: Floats  # [rad/s2]


def frame_motion(
    model: RobotModel,
    q: ArrayLike,
    qd: ArrayLike,
    qdd: ArrayLike | None = None,
    frame: str | None = None,
    *,
    base: BaseMotion | None = None,
) -> FrameMotion:
    """Return velocities and accelerations of a frame, the tip when None, on a base that may itself move.

    velocity = J qd, acceleration = J qdd + dJ/dt qd, and what the base adds. A frame of Pinocchio has this classical
    acceleration in axes LOCAL_WORLD_ALIGNED. Needs no inertia.

    For q, qd and qdd, each (n,) or (N, n) [rad or m, and per s, s2]; qdd is zero and the base at rest when None.
    """
    (places, rates, changes), single = motion_rows(model, q, qd=qd, qdd=qdd)
    omega, alpha, acceleration, velocity = base_rows(BaseMotion() if base is None else base, len(places))
    link, own = model.frame(frame)
    of_link = np.empty((len(places), 3, 3))
    arm = model.tree, model.coupling, model.offset
    _motion_rows(*arm, places, rates, changes, omega, alpha, acceleration, link, of_link)
    placed = Configuration(model, places)
    turn, at = placed.rotations[:, link], placed.pose(frame).position
    w, dw, a = (np.einsum("nij,nj->ni", turn, of_link[:, k]) for k in range(3))
    r = turn @ own.position
    v = np.einsum("nij,nj->ni", placed.jacobian(frame)[:, :3], rates) + velocity + np.cross(omega, at)
    parts = v, w, a + np.cross(dw, r) + np.cross(w, np.cross(w, r)), dw
    return FrameMotion(*(part[0] if single else part for part in parts))


@compiled
def _motion_rows(
    tree: Tree,
    coupling: Floats,
    offset: Floats,
    q: Floats,
    qd: Floats,
    qdd: Floats,
    base_omega: Floats,
    base_alpha: Floats,
    base_acceleration: Floats,
    link: int,
    out: Floats,
) -> None:
    """Write a link's angular velocity and acceleration and its origin's acceleration, in its own axes, row by row."""
    n = len(tree.parent)
    work = np.empty((3, n))
    rotation, position = np.empty((n, 3, 3)), np.empty((n, 3))
    xd, xdd = np.empty(n), np.empty(n)
    omega, alpha, acceleration = np.empty((n + 1, 3)), np.empty((n + 1, 3)), np.empty((n + 1, 3))
    for k in range(len(q)):
        omega[n] = base_omega[k if len(base_omega) > 1 else 0]
        alpha[n] = base_alpha[k if len(base_alpha) > 1 else 0]
        acceleration[n] = base_acceleration[k if len(base_acceleration) > 1 else 0]
        place_tree(tree, coupling, offset, q[k], work, rotation, position)
        to_tree(coupling, qd[k], xd)
        to_tree(coupling, qdd[k], xdd)
        for i in range(n):
            link_motion(tree, rotation, position, i, xd, xdd, omega, alpha, acceleration)
        out[k, 0], out[k, 1], out[k, 2] = omega[link], alpha[link], acceleration[link]
