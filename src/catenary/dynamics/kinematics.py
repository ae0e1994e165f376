"""Forward kinematics: poses of links and frames, and Jacobians."""

import numpy as np
from numpy.typing import ArrayLike

from catenary.arrays import Floats, as_array, as_batch
from catenary.dynamics.recursion import add, cross, place_links, place_tree, row, times, to_robot_columns
from catenary.kernels.compiled import compiled
from catenary.robots.model import RobotModel, Tree
from catenary.robots.plausibility import check_within
from catenary.spatial import Pose

_MAX_Q = 1e9  # [rad|m] where a float64 steps by 1e-7; beyond, sine and cosine say ever less of an arm


class Configuration:
    """A robot at q, (n,) or (N, n): its links are placed once, for poses and Jacobians of any of its frames."""

    def __init__(self, model: RobotModel, q: ArrayLike) -> None:
        rows, self._single = as_batch("q", q, model.n)
        if np.vdot(rows, rows) > _MAX_Q**2:
            check_within("q", rows, _MAX_Q, "rad or m")
        self.model, nodes = model, len(model.link_names) + 1
        # R_base_i (N, n_tree + 1, 3, 3) and origins (N, n_tree + 1, 3) [m] of the links in the base, which is the last
        self.rotations, self.positions = np.empty((len(rows), nodes, 3, 3)), np.empty((len(rows), nodes, 3))
        _place_rows(model.tree, model.coupling, model.offset, rows, self.rotations, self.positions)

    def pose(self, frame: str | None = None) -> Pose:
        """Return the pose of a frame in the base frame; the tip's when no frame is named."""
        link, own = self.model.frame(frame)
        rotation, position = self.rotations[:, link], self.positions[:, link]
        if self._single:
            rotation, position = rotation[0], position[0]
        return Pose(rotation @ own.rotation, rotation @ own.position + position)

    def jacobian(self, frame: str | None = None, point: ArrayLike | None = None) -> Floats:
        """Return the Jacobian, (6, n) or (N, 6, n), of a point (3,) [m] fixed in a frame, its origin when None."""
        link, own = self.model.frame(frame)
        in_frame = np.zeros(3) if point is None else as_array("point", point, (3,))
        out = np.zeros((len(self.rotations), 6, self.model.n))
        at = own.rotation @ in_frame + own.position
        _jacobian_rows(self.model.tree, self.model.coupling, self.rotations, self.positions, link, at, out)
        return out[0] if self._single else out


def forward_kinematics(model: RobotModel, q: ArrayLike, frame: str | None = None) -> Pose:
    """Return the pose of a frame in the base frame.

    Args:
        model: The robot.
        q, frame: Positions (n,) or (N, n) [rad or m], and name of the frame; the tip if None.

    Returns:
        Rotation R_base_frame (3, 3) or (N, 3, 3) and position (3,) or (N, 3) [m].

    Raises:
        InputError: Another shape, not finite, or no such frame.

    Examples:
        >>> catenary.forward_kinematics(catenary.load_robot("puma560"), np.zeros(6)).position.round(4)
        array([ 0.4521, -0.15  ,  0.4318])
    """
    return Configuration(model, q).pose(frame)


def link_poses(model: RobotModel, q: ArrayLike) -> tuple[Floats, Floats]:
    """Return the poses of all moving links in the base frame.

    Args:
        q: Positions (n,) or (N, n) [rad or m].

    Returns:
        Rotations R_base_i (n_tree, 3, 3) and origins (n_tree, 3) [m], or (N, ...) of each, in the order of
        `link_names`.
    """
    placed, single = Configuration(model, q), np.ndim(q) == 1
    rotations, positions = placed.rotations[:, :-1].copy(), placed.positions[:, :-1].copy()
    return (rotations[0], positions[0]) if single else (rotations, positions)


def relative_pose(model: RobotModel, q: ArrayLike, frame: str, in_frame: str) -> Pose:
    """Return the pose of one frame in another, T_in_frame_frame.

    Args:
        q: One configuration (n,) [rad or m].
        frame, in_frame: Frame whose pose is returned, and the frame in which it is expressed.
    """
    placed = Configuration(model, q)
    return placed.pose(in_frame).inverse() @ placed.pose(frame)


def jacobian(model: RobotModel, q: ArrayLike, frame: str | None = None, point: ArrayLike | None = None) -> Floats:
    """Return the Jacobian, (6, n) or (N, 6, n), of a point fixed in a frame, in base axes.

    (velocity of the point; angular velocity of the frame) = J qd. A revolute joint with axis z through o gives the
    column (z x (p - o); z), a prismatic one (z; 0); joints that do not carry the frame give zeros.

    Args:
        model: The robot.
        q, frame: Positions (n,) or (N, n) [rad or m], and name of the frame; the tip if None.
        point: Point in the frame's axes (3,) [m]; its origin when None.

    Examples:
        >>> catenary.jacobian(catenary.load_robot("two_link"), [0.3, 0.5]).round(3)
        array([[-0.654, -0.359],
               [ 0.   ,  0.   ],
               [ 1.304,  0.348],
               [ 0.   ,  0.   ],
               [-1.   , -1.   ],
               [ 0.   ,  0.   ]])
    """
    return Configuration(model, q).jacobian(frame, point)


@compiled
def _place_rows(tree: Tree, coupling: Floats, offset: Floats, q: Floats, rotations: Floats, positions: Floats) -> None:
    n = len(tree.parent)
    work = np.empty((3, n))
    rotation, position = np.empty((n, 3, 3)), np.empty((n, 3))
    for k in range(len(q)):
        place_tree(tree, coupling, offset, q[k], work, rotation, position)
        place_links(tree, rotation, position, rotations[k], positions[k])


@compiled
def _jacobian_rows(
    tree: Tree, coupling: Floats, rotations: Floats, positions: Floats, link: int, point: Floats, out: Floats
) -> None:
    """Write Jacobians of a link's point, row by row, where the links are placed."""
    columns = np.zeros((6, len(tree.parent)))  # stay zero for joints that do not carry the link
    for k in range(len(rotations)):
        R, origin = rotations[k], positions[k]
        p = add(row(origin, link), times(R, link, (point[0], point[1], point[2])))
        i = link
        while i >= 0:
            z = times(R, i, row(tree.axis, i))
            o = row(origin, i)
            linear, angular = z, (0.0, 0.0, 0.0)
            if not tree.prismatic[i]:
                linear, angular = cross(z, (p[0] - o[0], p[1] - o[1], p[2] - o[2])), z
            for r in range(3):
                columns[r, i] = linear[r]
                columns[3 + r, i] = angular[r]
            i = tree.parent[i]
        to_robot_columns(coupling, columns, out[k])
