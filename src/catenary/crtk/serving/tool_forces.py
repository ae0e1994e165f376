"""Forces at a served arm's tool, out of its joint torques and into them: F with tau = J^T F, frames as CRTK has them.

`measured_cf`, `servo_cf` and `jacobian` are about the tool's point, in base axes. Below `body/` they are about the same
point in the tool's own axes (in base axes after `body/set_cf_orientation_absolute`, as the dVRK has it for haptic
devices); below `spatial/` about the base's origin, in base axes. Forces are those that the robot exerts on what it
touches: an arm that rests against something and is told a servo_cf measures it as its measured_cf.
[collaborative-robotics.github.io, robot motion: spatial and body; cisst-saw: set_cf_orientation_absolute]

What is measured are torques of the motors' commands less those that hold the arm's own weight. What friction of drives
and the arm's acceleration take of them is in it: at rest an arm "exerts" what its friction holds.
"""

from collections.abc import Callable
from enum import Enum
from functools import cached_property

import numpy as np

from catenary.arrays import Floats
from catenary.crtk.serving.tool_pose import ToolPose
from catenary.spatial import Pose

NOT_FELT = 1e-4  # share of the Jacobian's largest gain below which joints do not feel a force: it reads zero


class ToolState:
    """Pose, Jacobian, velocity and force of a tool; several messages of a tick tell of the same ones."""

    def __init__(self, tool: ToolPose, q: Floats, qd: Floats, beyond_weight: Callable[[], Floats]) -> None:
        """Note joints (n,) [rad|m], their velocities, and what gives the torques (n,) beyond the arm's own weight."""
        self.kinematics, self._q, self._qd, self._beyond_weight = tool, q, qd, beyond_weight

    @cached_property
    def _motion(self) -> tuple[Pose, Floats]:
        return self.kinematics.motion(self._q)

    @property
    def pose(self) -> Pose:
        """Pose of the tool in the base."""
        return self._motion[0]

    @cached_property
    def jacobian(self) -> Floats:
        """Jacobian (6, n) of the robot's joints, in base axes."""
        return self.kinematics.of_robot(self._motion[1])

    @cached_property
    def twist(self) -> Floats:
        """Velocity [m/s] over angular velocity [rad/s] in base axes, (6,)."""
        return self.jacobian @ self._qd

    @cached_property
    def wrench(self) -> Floats:
        """Force [N] over moment [Nm] at the tool's point that the joints exert beyond the arm's weight, (6,)."""
        return wrench_of(self._motion[1], self.kinematics.model_torques(self._beyond_weight()))


def wrench_of(jacobian: Floats, tau: Floats) -> Floats:
    """Return the wrench F (6,) of least size with J^T F = tau, for J (6, n) and tau (n,)."""
    return np.array(np.linalg.lstsq(jacobian.T, tau, rcond=NOT_FELT)[0], dtype=float)


class FrameOfForces(Enum):
    """Point and axes that a wrench or a twist is given in."""

    TOOL_IN_BASE_AXES = ""
    BODY = "body/"
    SPATIAL = "spatial/"


def jacobian(tool: ToolState, frame: FrameOfForces = FrameOfForces.TOOL_IN_BASE_AXES) -> Floats:
    """Return the Jacobian (6, n) at the measured joints: velocity over angular velocity, per joint speed."""
    if frame is FrameOfForces.TOOL_IN_BASE_AXES:
        return tool.jacobian
    return _twist_map(tool.pose, frame) @ tool.jacobian


def exerted(tool: ToolState, frame: FrameOfForces = FrameOfForces.TOOL_IN_BASE_AXES) -> Floats:
    """Return force [N] over moment [Nm] (6,) that the tool exerts beyond the arm's weight; zero where not felt."""
    if frame is FrameOfForces.TOOL_IN_BASE_AXES:
        return tool.wrench
    # of the same power
    return np.asarray(np.linalg.solve(_twist_map(tool.pose, frame).T, tool.wrench), dtype=np.float64)


def torques_for(tool: ToolState, wrench: Floats, frame: FrameOfForces) -> Floats:
    """Return joint torques (n,) [Nm|N] that exert a wrench (6,): J^T F; NaN for jaws, which hold their opening."""
    in_base = _twist_map(tool.pose, frame).T @ wrench
    tau: Floats = tool.jacobian.T @ in_base
    if tool.kinematics.has_jaws:
        tau[-tool.kinematics.jaws :] = np.nan
    return tau


def _twist_map(pose: Pose, frame: FrameOfForces) -> Floats:
    """Return what takes a twist of the tool in base axes into a frame, (6, 6)."""
    found = np.eye(6)
    if frame is FrameOfForces.BODY:
        found[:3, :3] = found[3:, 3:] = pose.rotation.T
    elif frame is FrameOfForces.SPATIAL:
        x, y, z = pose.position
        found[:3, 3:] = [[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]]  # v at the origin = v + p x omega
    return found
