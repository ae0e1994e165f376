"""Velocity and acceleration of a frame, from the motion of the joints and of the base."""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from catenary.arrays import Floats
from catenary.dynamics.inverse_dynamics import BaseMotion, base_rows, motion_rows, place_rows
from catenary.dynamics.kinematics import Configuration
from catenary.dynamics.recursion import link_motion
from catenary.robots.model import RobotModel


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
    """Return velocities and accelerations of a frame, on a base that may itself move.

    velocity = J qd, acceleration = J qdd + dJ/dt qd, and what the base adds. Pinocchio has this classical acceleration
    in axes LOCAL_WORLD_ALIGNED.

    Args:
        model: The robot; needs no inertia.
        q: Positions (n,) or (N, n) [rad or m].
        qd: Velocities, as `q`.
        qdd: Accelerations, as `q`; zero when None.
        frame: Name of the frame; the tip when None.
        base: Motion of the base; at rest when None.

    Examples:
        >>> arm = catenary.load_robot("two_link")
        >>> motion = catenary.frame_motion(arm, [0.3, 0.5], [1.0, -1.0])
        >>> motion.velocity.round(3)
        array([-0.296,  0.   ,  0.955])
    """
    motion, single = motion_rows(model, q, qd=qd, qdd=qdd)
    count, n, (link, own) = len(motion[0]), len(model.offset), model.frame(frame)
    *turning, velocity = (np.broadcast_to(rows, (count, 3)) for rows in base_rows(base, count))
    rotation, position, xd, xdd = place_rows(model, *(rows[0] if count == 1 else rows for rows in motion))
    moving = np.empty((3, n + 1, *position.shape[1:]))
    moving[:, n] = np.reshape([rows.T for rows in turning], (3, *position.shape[1:]))
    for i in range(n):
        link_motion(model.tree, rotation, position, i, xd, xdd, *moving)
    placed = Configuration(model, motion[0])
    w, dw, a = np.einsum("nij,kjn->kni", placed.rotations[:, link], moving[:, link].reshape(3, 3, count))
    r = placed.rotations[:, link] @ own.position
    v = np.einsum("nij,nj->ni", placed.jacobian(frame)[:, :3], motion[1])
    v += velocity + np.cross(turning[0], placed.pose(frame).position)
    parts = v, w, a + np.cross(dw, r) + np.cross(w, np.cross(w, r)), dw
    return FrameMotion(*(part[0] if single else part for part in parts))
