"""Where a served arm's tool is, which joints bring it elsewhere, and its forces: F with tau = J^T F, frames as CRTK's.

`measured_cf`, `servo_cf` and `jacobian` are about the tool's point, in base axes. Below `body/` they are about the same
point in the tool's own axes (in base axes after `body/set_cf_orientation_absolute`, as the dVRK has it for haptic
devices); below `spatial/` about the base's origin, in base axes. Forces are those that the robot exerts on what it
touches: an arm that rests against something and gets a servo_cf measures it as its measured_cf.
[collaborative-robotics.github.io, robot motion: spatial and body; cisst-saw: set_cf_orientation_absolute]

What is measured are torques of the motors' commands less those that hold the arm's own weight. What friction of drives
and the arm's acceleration take of them is in it: at rest an arm "exerts" what its friction holds.
"""

from collections.abc import Callable
from enum import Enum
from functools import cached_property
from math import atan2, hypot

import numpy as np

from catenary.arrays import Floats
from catenary.dynamics.inverse_kinematics import inverse_kinematics, search_range
from catenary.dynamics.kinematics import Configuration, forward_kinematics
from catenary.errors import InputError, UnreachablePoseError
from catenary.robots.model import RobotModel
from catenary.spatial import Pose, identity_pose

_ECM_JOINTS = 4  # joints of a dVRK's ECM: three bring its tip to a place, the last one turns it about its axis
_SEARCH_STEPS = 15  # steps of a search from the pose before, or 75 mm beside: a tick has no time for more


class ToolPose:
    """Kinematics between a robot's joints and its model's tip.

    Where the robot's last two joints are jaws the model has one in their place, which turns the tool: J6 = (jaw2 -
    jaw1) / 2. Their opening is no matter of the pose, nor is a last joint that is the opening itself, as a PSM's `jaw`.
    """

    def __init__(self, model: RobotModel, joint_names: tuple[str, ...]) -> None:
        n = len(joint_names)
        self.model = model
        # a da Vinci PSM's last joint is the opening itself, and its joint states leave it out
        self.jaw_is_apart = n == model.n + 1 and joint_names[-1] == "jaw"
        self.has_jaws = self.jaw_is_apart or (n == model.n + 1 and joint_names[-2:] == ("jaw1", "jaw2"))
        self.jaws = 0 if not self.has_jaws else 1 if self.jaw_is_apart else 2  # joints, the last ones
        if not self.has_jaws and n != model.n:
            raise InputError(
                f'robot "{model.name}": has {model.n} joints, expected {n} as the robot, or one for both its jaws'
            )
        # between the model's joints and the robot's; a jaw's opening is in neither
        self.to_model, self.from_model = np.eye(model.n, n), np.eye(n, model.n)
        if self.jaws == 2:
            self.to_model[-1, -2:], self.from_model[-2:, -1] = (-0.5, 0.5), (-1.0, 1.0)
        self.reach = _reach(model)  # [m] from the base, which the tool never passes
        frame_0 = model.frames.get("frame0")
        self._frame_0 = identity_pose() if frame_0 is None else frame_0.pose
        self._base_in_frame_0 = self._frame_0.inverse()

    def pose(self, q: Floats) -> Pose:
        """Return the tool's pose in the base frame, at joints (n,)."""
        return forward_kinematics(self.model, self.to_model @ q)

    def joints(self, pose: Pose, near: Floats, *, steps: int = _SEARCH_STEPS) -> Floats:
        """Return joints (n,) that bring the tool to a pose, the nearest to some, with their opening of the jaws."""
        self.require_reach(pose)
        start = np.clip(self.to_model @ near, self.model.lower, self.model.upper)
        q = inverse_kinematics(self.model, pose, start, max_iterations=steps)
        if self.model.n == _ECM_JOINTS:
            turn = forward_kinematics(self.model, q).rotation.T @ pose.rotation
            q[-1] += atan2(turn[1, 0] - turn[0, 1], turn[0, 0] + turn[1, 1])
            q = np.clip(q, self.model.lower, self.model.upper)
        return self.from_model @ q + near - self.from_model @ (self.to_model @ near)

    def require_reach(self, pose: Pose) -> None:
        """Refuse a pose farther away than the arm is long, before anything is worked out."""
        distance = hypot(*pose.position.tolist())
        if distance > self.reach:
            raise UnreachablePoseError(
                f"{distance:.4g} m from the base, expected at most {self.reach:.4g} m, the arm's reach"
            )

    def prepare(self) -> None:
        """Compile what `joints` runs, in the middle of the joints' range, wherever the robot may be."""
        near = self.middle(np.zeros(self.to_model.shape[1]))
        self.joints(self.pose(near), near)

    def middle(self, q: Floats) -> Floats:
        """Return the middle of the joints' range (n,), with the opening of the jaws at joints (n,)."""
        lower, upper = search_range(self.model)
        return self.from_model @ (0.5 * (lower + upper)) + q - self.from_model @ (self.to_model @ q)

    def in_frame_0(self, pose: Pose) -> Pose:
        """Return a pose of the base in the mechanism's frame 0; the same where it has none."""
        return self._base_in_frame_0 @ pose

    def from_frame_0(self, vectors: Floats) -> Floats:
        """Return directions (3,) or rotations' columns of frame 0 in base axes."""
        return self._frame_0.rotation @ vectors


def _reach(model: RobotModel) -> float:
    """Return a bound of the tip's distance from the base [m]: all links in one line, all slides drawn out."""
    farthest = np.maximum(np.abs(model.lower), np.abs(model.upper))
    moved = np.abs(model.coupling) @ np.where(np.isinf(farthest), 0.0, farthest) + np.abs(model.offset)
    endless = (np.abs(model.coupling) @ np.isinf(farthest)) > 0.0
    slides = np.where(model.tree.prismatic, np.where(endless, np.inf, moved), 0.0)
    links = np.linalg.norm(model.tree.origin, axis=1).sum() + np.linalg.norm(model.frame().pose.position)
    return float(links + slides.sum())


_UNFELT_GAIN = 1e-4  # share of the Jacobian's largest gain below which joints do not feel a force: it reads zero


class ToolState:
    """Pose, Jacobian, velocity and force of a tool; several messages of a tick tell of the same ones."""

    def __init__(self, tool: ToolPose, q: Floats, qd: Floats, beyond_weight: Callable[[], Floats]) -> None:
        """Note joints (n,) [rad|m], their velocities, and what gives the torques (n,) beyond the arm's own weight."""
        self.kinematics, self._q, self._qd, self._beyond_weight = tool, q, qd, beyond_weight

    @cached_property
    def _of_model(self) -> tuple[Pose, Floats]:
        """The tool's pose in the base, and the Jacobian (6, m) of the model's joints."""
        placed = Configuration(self.kinematics.model, self.kinematics.to_model @ self._q)
        return placed.pose(), placed.jacobian()

    @property
    def pose(self) -> Pose:
        """Pose of the tool in the base."""
        return self._of_model[0]

    @cached_property
    def jacobian(self) -> Floats:
        """Jacobian (6, n) of the robot's joints, in base axes."""
        return self._of_model[1] @ self.kinematics.to_model

    @cached_property
    def twist(self) -> Floats:
        """Velocity [m/s] over angular velocity [rad/s] in base axes, (6,)."""
        return self.jacobian @ self._qd

    @cached_property
    def wrench(self) -> Floats:
        """Force [N] over moment [Nm] at the tool's point that the joints exert beyond the arm's weight, (6,)."""
        # torques of the model's joints (m,) that do the work of the robot's, the jaws' opening aside
        return wrench_of(self._of_model[1], self._beyond_weight() @ self.kinematics.from_model)


def wrench_of(jacobian: Floats, tau: Floats) -> Floats:
    """Return the wrench F (6,) of least size with J^T F = tau, for J (6, n) and tau (n,)."""
    return np.array(np.linalg.lstsq(jacobian.T, tau, rcond=_UNFELT_GAIN)[0], dtype=float)


class FrameOfForces(Enum):
    """Point and axes that a wrench or a twist is given in."""

    TOOL_IN_BASE_AXES = ""
    BODY = "body/"
    SPATIAL = "spatial/"


def force_jacobian(tool: ToolState, frame: FrameOfForces) -> Floats:
    """Return the Jacobian (6, n) at the measured joints in a frame: velocity over angular velocity, per joint speed."""
    if frame is FrameOfForces.TOOL_IN_BASE_AXES:
        return tool.jacobian
    return _twist_map(tool.pose, frame) @ tool.jacobian


def exerted(tool: ToolState, frame: FrameOfForces) -> Floats:
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
    """Return the matrix from a twist of the tool in base axes to one in a frame, (6, 6)."""
    matrix = np.eye(6)
    if frame is FrameOfForces.BODY:
        matrix[:3, :3] = matrix[3:, 3:] = pose.rotation.T
    elif frame is FrameOfForces.SPATIAL:
        x, y, z = pose.position
        matrix[:3, 3:] = [[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]]  # v at the origin = v + p x omega
    return matrix
