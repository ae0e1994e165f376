"""What messages say of a tool: poses, quaternions, a velocity, all of a tick's in one compiled call."""

from math import sqrt

import numpy as np
from numpy.typing import NDArray

from catenary.arrays import Floats
from catenary.dynamics.coordinates import place_tree, to_tree
from catenary.dynamics.recursion import place_links
from catenary.dynamics.vectors import Vector, add, cross, row, times
from catenary.kernels.compiled import compiled_quick, inlined
from catenary.robots.model import RobotModel, Tree
from catenary.spatial import Pose

# places among the numbers of a tool
POSES = 0, 7  # x, y, z [m], unit quaternion x, y, z, w, in the base: as measured, as set
TWIST = 14  # as measured: velocity [m/s], angular velocity [rad/s], in base axes
POSITIONS_0 = 20, 23  # [m] in frame 0: as measured, as set
ROTATIONS_0 = 26, 35  # row after row
SIZE = 44


class ToolNumbers:
    """A tool's numbers at a robot's joints; frame 0 is the mechanism's, or the base where it has none."""

    def __init__(self, model: RobotModel, to_model: Floats, frame_0: Pose | None) -> None:
        """Prepare.

        Args:
            model: Its tip is the tool.
            to_model: (model's n, n) from the robot's joints to the model's.
            frame_0: In the base.
        """
        tree, tip = model.tree, model.frame(model.tip)
        other = Pose(np.eye(3), np.zeros(3)) if frame_0 is None else frame_0
        self._tree = tree.parent, tree.prismatic
        self._link = tip.link
        self._coupling = np.ascontiguousarray(model.coupling @ to_model)
        parts = (
            tree.rotation, tree.origin, tree.axis, model.offset,
            tip.pose.rotation, tip.pose.position, other.rotation, other.position,
        )  # fmt: skip
        self._constants = np.concatenate([np.ravel(part) for part in parts])

    def write(self, joints: Floats, out: Floats) -> None:
        """Write a tool's numbers, (SIZE,).

        Args:
            joints: (6, n) positions, velocities and torques as measured, and the same as set.
            out: Where to.
        """
        write_tool(*self._tree, self._link, self._coupling, self._constants, joints, out)


@inlined
def quaternion(first: Vector, second: Vector, third: Vector) -> tuple[float, float, float, float]:
    """Quaternion (x, y, z, w) of a rotation matrix, given by its rows [Shepperd 1978]."""
    a, b, c = first
    d, e, f = second
    g, h, i = third
    largest = max(a + e + i, a, e, i)
    if largest == a + e + i:
        w = 0.5 * sqrt(1.0 + a + e + i)
        s = 0.25 / w
        return ((h - f) * s, (c - g) * s, (d - b) * s, w)
    if largest == a:
        x = 0.5 * sqrt(1.0 + a - e - i)
        s = 0.25 / x
        return (x, (b + d) * s, (c + g) * s, (h - f) * s)
    if largest == e:
        y = 0.5 * sqrt(1.0 - a + e - i)
        s = 0.25 / y
        return ((b + d) * s, y, (f + h) * s, (c - g) * s)
    z = 0.5 * sqrt(1.0 - a - e + i)
    s = 0.25 / z
    return ((c + g) * s, (f + h) * s, z, (d - b) * s)


@compiled_quick
def write_tool(
    parent: NDArray[np.int64],
    prismatic: NDArray[np.bool_],
    link: int,
    coupling: Floats,
    constants: Floats,
    joints: Floats,
    out: Floats,
) -> None:
    """Write a tool's numbers.

    Args:
        parent: Of the model's tree, m joints.
        prismatic: Of the model's tree.
        link: The tool's.
        coupling: (m, n) from the robot's joints to the tree's.
        constants: Rotations, origins and axes of the tree, offsets (m,), pose of the tool in its link, of frame 0 in
            the base: as `ToolNumbers` has them.
        joints: (6, n).
        out: (SIZE,) written.
    """
    m = len(parent)
    places = constants[9 * m : 12 * m].reshape((m, 3))
    turns = constants[: 9 * m].reshape((m, 3, 3))
    axes = constants[12 * m : 15 * m].reshape((m, 3))
    offset = constants[15 * m : 16 * m]
    tool = constants[16 * m :]
    nothing = np.empty(0)
    # kinematics alone: no masses
    tree = Tree(
        parent, prismatic, turns, places, axes, nothing, nothing.reshape((0, 3)), nothing.reshape((0, 3, 3))
    )
    work, rate = np.empty((3, m)), np.empty(m)
    rotation, position = np.empty((m, 3, 3)), np.empty((m, 3))
    base_rotation, base_position = np.empty((m + 1, 3, 3)), np.empty((m + 1, 3))
    turn = np.empty((3, 3))
    for k in range(2):
        place_tree(tree, coupling, offset, joints[3 * k], work, rotation, position)
        place_links(tree, rotation, position, base_rotation, base_position)
        p = add(row(base_position, link), times(base_rotation, link, (tool[9], tool[10], tool[11])))
        for j in range(3):
            v = times(base_rotation, link, (tool[j], tool[3 + j], tool[6 + j]))
            turn[0, j], turn[1, j], turn[2, j] = v
        x, y, z, w = quaternion(row(turn, 0), row(turn, 1), row(turn, 2))
        at = 7 * k
        out[at], out[at + 1], out[at + 2] = p
        out[at + 3], out[at + 4], out[at + 5], out[at + 6] = x, y, z, w
        if k == 0:
            to_tree(coupling, joints[1], rate)
            linear, angular = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
            i = link
            while i >= 0:
                axis = times(base_rotation, i, row(axes, i))
                along = (rate[i] * axis[0], rate[i] * axis[1], rate[i] * axis[2])
                if prismatic[i]:
                    linear = add(linear, along)
                else:
                    o = row(base_position, i)
                    linear = add(linear, cross(along, (p[0] - o[0], p[1] - o[1], p[2] - o[2])))
                    angular = add(angular, along)
                i = parent[i]
            out[14], out[15], out[16] = linear
            out[17], out[18], out[19] = angular
        # in frame 0: its rotation, transposed, times what is in the base
        for r in range(3):
            total = 0.0
            for j in range(3):
                total += tool[12 + 3 * j + r] * (p[j] - tool[21 + j])
            out[20 + 3 * k + r] = total
            for c in range(3):
                total = 0.0
                for j in range(3):
                    total += tool[12 + 3 * j + r] * turn[j, c]
                out[26 + 9 * k + 3 * r + c] = total
