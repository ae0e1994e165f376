"""Where the links and frames are, and how they move with the coordinates."""

import numpy as np
from numpy.typing import ArrayLike

from catenary.arrays import Floats, as_array, as_batch
from catenary.dynamics.coordinates import place_tree, to_robot_columns
from catenary.dynamics.recursion import place_links
from catenary.dynamics.vectors import add, cross, row, times
from catenary.kernels.compiled import compiled
from catenary.robots.model import RobotModel, Tree
from catenary.spatial import Pose


def forward_kinematics(model: RobotModel, q: ArrayLike, frame: str | None = None) -> Pose:
    """Return the pose of a frame in the base frame.

    Args:
        model: The robot.
        q: (n,) or (N, n) coordinates [rad or m].
        frame: Name of the frame; the model's tip when None.

    Returns:
        Its rotation (3, 3) and position (3,) [m]; of many configurations (N, 3, 3) and (N, 3).

    Raises:
        InputError: q has another shape or is not finite; no frame of that name.
    """
    return Pose(*frame_poses(model, q, frame))


def frame_poses(model: RobotModel, q: ArrayLike, frame: str | None = None) -> tuple[Floats, Floats]:
    """Return the poses of a frame in the base frame.

    Args:
        model: The robot.
        q: (n,) or (N, n) coordinates [rad or m].
        frame: Name of the frame; the model's tip when None.

    Returns:
        R_base_frame (3, 3) or (N, 3, 3), and the frame's origin in the base (3,) or (N, 3) [m].

    Raises:
        InputError: q has another shape or is not finite; no frame of that name.
    """
    target = model.frame(frame)
    rotations, positions = link_poses(model, q)
    if target.link < 0:
        rotation = np.broadcast_to(np.eye(3), (*rotations.shape[:-3], 3, 3))
        position = np.zeros((*positions.shape[:-2], 3))
    else:
        rotation, position = rotations[..., target.link, :, :], positions[..., target.link, :]
    return rotation @ target.pose.rotation, rotation @ target.pose.position + position


def link_poses(model: RobotModel, q: ArrayLike) -> tuple[Floats, Floats]:
    """Return the poses of all moving links in the base frame.

    Args:
        model: The robot.
        q: (n,) or (N, n) coordinates [rad or m].

    Returns:
        R_base_i (n_tree, 3, 3) or (N, n_tree, 3, 3), and the origins of the links' frames in the base
        (n_tree, 3) or (N, n_tree, 3) [m], in the order of `model.link_names`.

    Raises:
        InputError: q has another shape or is not finite.
    """
    rows, single = as_batch("q", q, model.n)
    n_tree = len(model.link_names)
    rotations = np.empty((len(rows), n_tree, 3, 3))
    positions = np.empty((len(rows), n_tree, 3))
    _link_poses_rows(model.tree, model.coupling, model.offset, rows, rotations, positions)
    return (rotations[0], positions[0]) if single else (rotations, positions)


def relative_pose(model: RobotModel, q: ArrayLike, frame: str, in_frame: str) -> Pose:
    """Return the pose of one frame in another, T_in_frame_frame, at one configuration.

    Raises:
        InputError: q has another shape or is not finite; no frame of that name.
    """
    return forward_kinematics(model, q, in_frame).inverse() @ forward_kinematics(model, q, frame)


def jacobian(
    model: RobotModel, q: ArrayLike, frame: str | None = None, point: ArrayLike | None = None
) -> Floats:
    """Return the Jacobian of a point fixed in a frame, in base axes.

    (velocity of the point; angular velocity of the frame) = J qd. A revolute joint with axis z through o
    gives the column (z x (p - o); z), a prismatic one (z; 0); joints that do not carry the frame give zeros.

    Args:
        model: The robot.
        q: (n,) or (N, n) coordinates [rad or m].
        frame: Name of the frame; the model's tip when None.
        point: (3,) in that frame [m]; its origin when None.

    Returns:
        (6, n) or (N, 6, n): rows linear then angular.

    Raises:
        InputError: q or point has another shape or is not finite; no frame of that name.
    """
    rows, single = as_batch("q", q, model.n)
    target = model.frame(frame)
    in_frame = np.zeros(3) if point is None else as_array("point", point, (3,))
    offset = target.pose.rotation @ in_frame + target.pose.position
    out = np.zeros((len(rows), 6, model.n))
    rotations, positions = np.empty((len(rows), 3, 3)), np.empty((len(rows), 3))
    _jacobian_rows(
        model.tree, model.coupling, model.offset, rows, target.link, offset, out, rotations, positions
    )
    return out[0] if single else out


def tip_motion(model: RobotModel, q: ArrayLike) -> tuple[Floats, Floats, Floats]:
    """Return the pose of the tip in the base frame and its Jacobian, by one pass over the tree.

    Args:
        model: The robot.
        q: (n,) coordinates [rad or m].

    Returns:
        R_base_tip (3, 3), the tip's origin in the base (3,) [m], and `jacobian` (6, n).

    Raises:
        InputError: q has another shape or is not finite.
    """
    row = as_array("q", q, (model.n,))
    target = model.frame()
    jacobians, rotations, positions = np.zeros((1, 6, model.n)), np.empty((1, 3, 3)), np.empty((1, 3))
    _jacobian_rows(
        model.tree,
        model.coupling,
        model.offset,
        row[None],
        target.link,
        target.pose.position,
        jacobians,
        rotations,
        positions,
    )
    return rotations[0] @ target.pose.rotation, positions[0], jacobians[0]


@compiled
def _link_poses_rows(
    tree: Tree, coupling: Floats, offset: Floats, q: Floats, rotations: Floats, positions: Floats
) -> None:
    n = len(tree.parent)
    work = np.empty((3, n))
    rotation, position = np.empty((n, 3, 3)), np.empty((n, 3))
    base_rotation, base_position = np.empty((n + 1, 3, 3)), np.empty((n + 1, 3))
    for k in range(len(q)):
        place_tree(tree, coupling, offset, q[k], work, rotation, position)
        place_links(tree, rotation, position, base_rotation, base_position)
        rotations[k] = base_rotation[:n]
        positions[k] = base_position[:n]


@compiled
def _jacobian_rows(
    tree: Tree,
    coupling: Floats,
    offset: Floats,
    q: Floats,
    link: int,
    point: Floats,
    out: Floats,
    rotations: Floats,
    positions: Floats,
) -> None:
    """Write Jacobians of a link's point, the link's rotations and the point's positions, row by row."""
    n = len(tree.parent)
    work = np.empty((3, n))
    rotation, position = np.empty((n, 3, 3)), np.empty((n, 3))
    base_rotation, base_position = np.empty((n + 1, 3, 3)), np.empty((n + 1, 3))
    columns = np.zeros((6, n))  # stay zero for joints that do not carry the link
    for k in range(len(q)):
        place_tree(tree, coupling, offset, q[k], work, rotation, position)
        place_links(tree, rotation, position, base_rotation, base_position)
        p = add(row(base_position, link), times(base_rotation, link, (point[0], point[1], point[2])))
        i = link
        while i >= 0:
            z = times(base_rotation, i, row(tree.axis, i))
            o = row(base_position, i)
            linear, angular = z, (0.0, 0.0, 0.0)
            if not tree.prismatic[i]:
                linear, angular = cross(z, (p[0] - o[0], p[1] - o[1], p[2] - o[2])), z
            for r in range(3):
                columns[r, i] = linear[r]
                columns[3 + r, i] = angular[r]
            i = tree.parent[i]
        to_robot_columns(coupling, columns, out[k])
        rotations[k] = base_rotation[link]
        positions[k] = p[0], p[1], p[2]
