"""Where a served arm's tool is and what it does at one moment; each quantity is computed once, when first asked for."""

from collections.abc import Callable
from functools import cached_property

import numpy as np

from catenary.arrays import Floats
from catenary.crtk.serving.tool_pose import ToolPose
from catenary.spatial import Pose

NOT_FELT = 1e-4  # share of the Jacobian's largest gain below which joints do not feel a force: it reads zero


class ToolState:
    """Pose, Jacobian, velocity and force of a tool; several messages of a tick tell of the same ones."""

    def __init__(self, tool: ToolPose, q: Floats, qd: Floats, beyond_weight: Callable[[], Floats]) -> None:
        """Note where the joints are; nothing is computed yet.

        Args:
            tool: Kinematics.
            q: (n,) joints [rad|m].
            qd: (n,) their velocities.
            beyond_weight: Gives the joint torques (n,) that do not bear the arm's own weight.
        """
        self._tool, self._q, self._qd, self._beyond_weight = tool, q, qd, beyond_weight

    @cached_property
    def _motion(self) -> tuple[Pose, Floats]:
        return self._tool.motion(self._q)

    @property
    def pose(self) -> Pose:
        """Pose of the tool in the base."""
        return self._motion[0]

    @cached_property
    def jacobian(self) -> Floats:
        """Jacobian (6, n) of the robot's joints, in base axes."""
        return self._tool.of_robot(self._motion[1])

    @cached_property
    def twist(self) -> Floats:
        """Velocity [m/s] over angular velocity [rad/s] in base axes, (6,)."""
        twist: Floats = self.jacobian @ self._qd
        return twist

    @cached_property
    def wrench(self) -> Floats:
        """Force [N] over moment [Nm] at the tool's point that the joints exert beyond the arm's weight, (6,)."""
        return wrench_of(self._motion[1], self._tool.model_torques(self._beyond_weight()))


def wrench_of(jacobian: Floats, tau: Floats) -> Floats:
    """Return the wrench F (6,) of least size with J^T F = tau, for J (6, n) and tau (n,)."""
    return np.array(np.linalg.lstsq(jacobian.T, tau, rcond=NOT_FELT)[0], dtype=float)
