"""Forces at a served arm's tool, out of its joint torques and into them: F with tau = J^T F, frames as CRTK has them.

`measured_cf`, `servo_cf` and `jacobian` are about the tool's point, in base axes. Below `body/` they are about the same
point in the tool's own axes (in base axes after `body/set_cf_orientation_absolute`, as the dVRK has it for haptic
devices); below `spatial/` about the base's origin, in base axes. Forces are those that the robot exerts on what it
touches: an arm that rests against something and is told a servo_cf measures it as its measured_cf.
[collaborative-robotics.github.io, robot motion: spatial and body; cisst-saw: set_cf_orientation_absolute]

What is measured are torques of the motors' commands less those that hold the arm's own weight. What friction of drives
and the arm's acceleration take of them is in it: at rest an arm "exerts" what its friction holds.
"""

from enum import Enum

import numpy as np

from catenary.arrays import Floats
from catenary.crtk.serving.served_arm import ServedArm
from catenary.spatial import Pose


class FrameOfForces(Enum):
    """Point and axes that a wrench or a twist is given in."""

    TOOL_IN_BASE_AXES = ""
    BODY = "body/"
    SPATIAL = "spatial/"


def jacobian(arm: ServedArm, frame: FrameOfForces = FrameOfForces.TOOL_IN_BASE_AXES) -> Floats:
    """Return the Jacobian (6, n) at the measured joints: velocity over angular velocity, per joint speed."""
    tool = arm.measured_tool
    if frame is FrameOfForces.TOOL_IN_BASE_AXES:
        return tool.jacobian
    found: Floats = _twist_map(tool.pose, frame) @ tool.jacobian
    return found


def exerted(arm: ServedArm, frame: FrameOfForces = FrameOfForces.TOOL_IN_BASE_AXES) -> Floats:
    """Return force [N] over moment [Nm] (6,) that the tool exerts by the joint torques beyond the arm's weight.

    Directions in which no joint feels a force are zero, as at a singular pose.
    """
    tool = arm.measured_tool
    force, moment = tool.wrench[:3], tool.wrench[3:]
    if frame is FrameOfForces.BODY:
        turn = tool.pose.rotation.T
        return np.concatenate([turn @ force, turn @ moment])
    if frame is FrameOfForces.SPATIAL:
        x, y, z = tool.pose.position.tolist()
        a, b, c = force.tolist()
        return np.concatenate(
            [force, moment + np.array([y * c - z * b, z * a - x * c, x * b - y * a])]
        )  # p x f
    return tool.wrench


def torques_for(arm: ServedArm, wrench: Floats, frame: FrameOfForces) -> Floats:
    """Return joint torques (n,) [Nm|N] that exert a wrench (6,): J^T F; NaN for jaws, which hold their opening.

    An arm whose jaws turn the tool keeps them where they are; they bear what the wrench asks of them.
    """
    in_base = _twist_map(arm.measured_tool.pose, frame).T @ wrench
    tau: Floats = arm.measured_tool.jacobian.T @ in_base
    if arm.tool.has_jaws:
        tau[-arm.tool.jaws :] = np.nan
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
