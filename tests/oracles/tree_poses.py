"""Forward kinematics over a Tree with 4x4 matrices: short enough to check by eye, slow, for tests only."""

import numpy as np
from scipy.linalg import expm

from catenary.robots.model import BASE, RobotModel


def homogeneous(rotation, position):
    T = np.eye(4)
    T[:3, :3] = rotation
    T[:3, 3] = position
    return T


def link_poses(model: RobotModel, q) -> list[np.ndarray]:
    """T_base_link of every tree link at the robot's coordinates q."""
    tree = model.tree
    moved = model.coupling @ np.asarray(q, dtype=float) + model.offset
    poses: list[np.ndarray] = []
    for i, parent in enumerate(tree.parent):
        twist = np.zeros((4, 4))
        x, y, z = tree.axis[i]
        if tree.prismatic[i]:
            twist[:3, 3] = tree.axis[i]
        else:
            twist[:3, :3] = [[0, -z, y], [z, 0, -x], [-y, x, 0]]
        here = homogeneous(tree.rotation[i], tree.origin[i]) @ expm(twist * moved[i])
        poses.append(here if parent < 0 else poses[parent] @ here)
    return poses


def frame_pose(model: RobotModel, frame: str | None, q) -> np.ndarray:
    """T_base_frame at q; the tip without a name."""
    link, pose = model.frame(frame)
    in_link = homogeneous(pose.rotation, pose.position)
    return in_link if link < 0 else link_poses(model, q)[link] @ in_link


def relative_pose(model: RobotModel, a: str, b: str, q) -> np.ndarray:
    """T_a_b at q."""
    return np.linalg.inv(frame_pose(model, a, q)) @ frame_pose(model, b, q)


def potential_energy(model: RobotModel, q, gravity=(0.0, 0.0, -9.81)) -> float:
    """Minus the sum of m g . p over the links [J]."""
    return -sum(
        mass * float(np.dot(gravity, (T @ np.append(com, 1.0))[:3]))
        for mass, com, T in zip(model.tree.mass, model.tree.com, link_poses(model, q), strict=True)
    )


def moments_about_origin(mass, com, inertia):
    """Mass, first moment and inertia about the frame's origin: quantities that simply add."""
    com = np.asarray(com)
    return mass, mass * com, inertia + mass * (com @ com * np.eye(3) - np.outer(com, com))


def all_links(model: RobotModel) -> list[str]:
    return [name for name in model.frames if name != BASE]
