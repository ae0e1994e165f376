"""An MTM of a dVRK beside CRTK: a gripper, an orientation that is locked, an impedance; here an operator's hand too.

[jhu-dvrk/sawIntuitiveResearchKit 9e535e6, mtsIntuitiveResearchKitMTM.cpp; jhu-saw/sawControllers,
osaCartesianImpedanceController.cpp] The hand is ours: nobody holds a simulated MTM.
"""

import numpy as np

from catenary.arrays import Floats, as_array
from catenary.crtk.message import Message
from catenary.crtk.message_values import rotation_of
from catenary.crtk.serving.tool_pose import FrameOfForces, ToolState, torques_for
from catenary.spatial import Pose, rotation_vector

_WRIST_JOINTS = 4  # joints, the last ones, that turn to hold an orientation
# of the spring that holds a locked orientation, ours: the dVRK holds it by the joints' own position control
_LOCK_STIFFNESS, _LOCK_DAMPING = 1.0, 0.1  # [Nm/rad], [Nms/rad]
_GRIPPER_RANGE = 0.0, np.deg2rad(60.0)  # [rad]
_CLOSED_RAD = 0.0  # [rad] at and below which a gripper is closed: gripper_events_zero
_HAND_S = 0.1  # [s] that a push of the hand lasts


class MasterArm:
    """Operator's side of an MTM: what holds its wrist, and what the operator's hand does to it."""

    def __init__(self) -> None:
        """Begin unlocked, with the gripper half open and nobody's hand on it."""
        self.locked: Floats | None = None  # (3, 3) of the tool in the arm's own base
        self.gripper = 0.5 * _GRIPPER_RANGE[1]  # [rad]
        self.pinches = 0  # times that the gripper was closed
        self._hand, self._until = np.zeros(6), -np.inf  # in base axes at the tool's point [N, Nm]; time [s]

    @property
    def is_closed(self) -> bool:
        """Whether the gripper is closed."""
        return self.gripper <= _CLOSED_RAD

    def set_gripper(self, angle: float) -> None:
        """Let the operator's fingers open the gripper to an angle [rad]."""
        was_closed = self.is_closed
        self.gripper = float(np.clip(as_array("gripper", [angle], (1,))[0], *_GRIPPER_RANGE))
        self.pinches += self.is_closed and not was_closed

    def push(self, wrench: Floats, time: float) -> None:
        """Let the operator's hand push the tool, force over moment (6,) in base axes, for 0.1 s from a time [s]."""
        self._hand, self._until = wrench, time + _HAND_S

    def hand(self, tool: ToolState, time: float) -> Floats:
        """Return joint torques (n,) that the operator's hand exerts at a time [s]."""
        wrench = self._hand if time < self._until else np.zeros(6)
        return torques_for(tool, wrench, FrameOfForces.TOOL_IN_BASE_AXES)

    def lock(self, tool: ToolState) -> Floats:
        """Return joint torques (n,) of the wrist that hold a locked orientation; zero where none is locked."""
        tau = np.zeros(tool.jacobian.shape[1])
        if self.locked is not None:
            way = rotation_vector(self.locked @ tool.pose.rotation.T)
            moment = _LOCK_STIFFNESS * way - _LOCK_DAMPING * tool.twist[3:]
            tau[-_WRIST_JOINTS:] = (tool.jacobian[3:].T @ moment)[-_WRIST_JOINTS:]
        return tau


def impedance(goal: Message, pose: Pose, twist: Floats) -> Floats:
    """Return the wrench (6,) that a crtk_msgs/CartesianImpedance asks for at a pose and a twist (6,), in their axes.

    Along each axis of the goal's frame: P times the way beyond the deadband, plus D times the velocity, plus the bias,
    with gains for either side of the goal.
    """
    by_force, by_torque = rotation_of(goal.force_orientation), rotation_of(goal.torque_orientation)
    way = by_force.T @ (pose.position - as_array("force_position", tuple(goal.force_position), (3,)))
    force = _one_sided(way, by_force.T @ twist[:3], goal.position_positive, goal.position_negative)
    turn = rotation_vector(by_torque.T @ pose.rotation)
    moment = _one_sided(turn, by_torque.T @ twist[3:], goal.orientation_positive, goal.orientation_negative)
    return np.concatenate([by_force @ force, by_torque @ moment])


def _one_sided(way: Floats, rate: Floats, positive: Message, negative: Message) -> Floats:
    p, d, bias, deadband = (
        np.where(way > 0.0, tuple(getattr(positive, name)), tuple(getattr(negative, name)))
        for name in ("p", "d", "bias", "deadband")
    )
    beyond = np.sign(way) * np.maximum(np.abs(way) - np.abs(deadband), 0.0)
    return np.asarray(p * beyond + d * rate + bias)
