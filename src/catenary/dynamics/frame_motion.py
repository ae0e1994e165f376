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

    Example:
        >>> arm = catenary.load_robot("two_link")
        >>> motion = catenary.frame_motion(arm, [0.3, 0.5], [1.0, -1.0])
        >>> motion.velocity.round(3)
        array([-0.296,  0.   ,  0.955])
    """
    motion, single = motion_rows(model, q, qd=qd, qdd=qdd)
    count, (link, own) = len(motion[0]), model.frame(frame)
    *turning, velocity = (np.broadcast_to(rows, (count, 3)) for rows in base_rows(base, count))
    of_link = np.empty((count, 3, 3))
    arm = model.tree, model.coupling, model.offset
    _motion_rows(*arm, np.stack(motion, axis=1), np.stack(turning, axis=1), link, of_link)
    placed = Configuration(model, motion[0])
    w, dw, a = np.einsum("nij,nkj->kni", placed.rotations[:, link], of_link)
    r = placed.rotations[:, link] @ own.position
    v = np.einsum("nij,nj->ni", placed.jacobian(frame)[:, :3], motion[1])
    v += velocity + np.cross(turning[0], placed.pose(frame).position)
    parts = v, w, a + np.cross(dw, r) + np.cross(w, np.cross(w, r)), dw
    return FrameMotion(*(part[0] if single else part for part in parts))


@compiled
def _motion_rows(
    tree: Tree, coupling: Floats, offset: Floats, motion: Floats, base: Floats, link: int, out: Floats
) -> None:
    """Write omega, alpha and the origin's acceleration of a link in its axes, (N, 3, 3), by q, qd, qdd (N, 3, n)."""
    n = len(tree.parent)
    work, x = np.empty((3, n)), np.empty((2, n))
    rotation, position, moving = np.empty((n, 3, 3)), np.empty((n, 3)), np.empty((3, n + 1, 3))
    for k in range(len(motion)):
        moving[:, n] = base[k]
        place_tree(tree, coupling, offset, motion[k, 0], work, rotation, position)
        to_tree(coupling, motion[k, 1], x[0])
        to_tree(coupling, motion[k, 2], x[1])
        for i in range(n):
            link_motion(tree, rotation, position, i, x[0], x[1], moving[0], moving[1], moving[2])
        out[k] = moving[:, link]
