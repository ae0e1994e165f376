"""A served arm's state as frames: joints, jaws, poses, velocity; filled when asked for, once for each change."""

from catenary.arrays import Floats
from catenary.crtk.frames import JointStateFrame, OperatingStateFrames, pose_frame, twist_frame
from catenary.crtk.outlet import quaternion
from catenary.crtk.served_arm import ServedArm

JAWS = 2  # joints, the last ones
_BASE = "base"
Tips = tuple[Floats, Floats]  # rotations (2, 3, 3), positions (2, 3) [m]: as measured, as set


class ArmFrames:
    """What one arm says in every tick. A parked arm's numbers are written once."""

    def __init__(self, arm: ServedArm, *, child: str | None = None, jaws: str = "jaw") -> None:
        """Prepare.

        Args:
            arm: Whose state.
            child: Frame of the tool, where poses are sent as TransformStamped.
            jaws: What the opening of the jaws is called.
        """
        self._arm = arm
        self._joints = JointStateFrame(arm.names), JointStateFrame(arm.names)
        self._jaws = JointStateFrame((jaws,)), JointStateFrame((jaws,))
        self._poses = pose_frame(_BASE, child), pose_frame(_BASE, child)
        self._twist = twist_frame(_BASE)
        self._states = OperatingStateFrames()
        self._joints_of = self._jaws_of = self._poses_of = self._twist_of = -1  # changes that they show

    def operating_state(self) -> bytearray:
        """Give its operating state."""
        return self._states.frame(self._arm.state)

    def joints(self) -> tuple[bytearray, bytearray]:
        """Give its joint states: as measured, as set."""
        arm = self._arm
        measured, setpoint = self._joints
        if self._joints_of != arm.changes:
            self._joints_of = arm.changes
            for frame, state in ((measured, arm.measured), (setpoint, arm.setpoint)):
                frame.fill(state.q, state.qd, state.tau)
        return measured.bytes, setpoint.bytes

    def jaws(self) -> tuple[bytearray, bytearray]:
        """Give the opening of its jaws, jaw1 + jaw2: as measured, as set."""
        arm = self._arm
        measured, setpoint = self._jaws
        if self._jaws_of != arm.changes:
            self._jaws_of = arm.changes
            for frame, state in ((measured, arm.measured), (setpoint, arm.setpoint)):
                q, qd, tau = state.q[-JAWS:], state.qd[-JAWS:], state.tau[-JAWS:]
                frame.fill(q[0] + q[1], qd[0] + qd[1], 0.5 * (tau[0] + tau[1]))
        return measured.bytes, setpoint.bytes

    def poses(self) -> tuple[bytearray, bytearray]:
        """Give where its tool is, in the base: as measured, as set. The arm has kinematics."""
        arm = self._arm
        measured, setpoint = self._poses
        if self._poses_of != arm.changes:
            self._poses_of = arm.changes
            rotations, positions = arm.tool_poses()
            for frame, rotation, position in zip(self._poses, rotations, positions.tolist(), strict=True):
                frame.fill(*position, *quaternion(rotation))
        return measured.bytes, setpoint.bytes

    def twist(self) -> bytearray:
        """Give its tool's velocity in base axes. The arm has kinematics."""
        arm = self._arm
        if self._twist_of != arm.changes and arm.tool is not None:
            self._twist_of = arm.changes
            self._twist.fill(*arm.tool.velocity(arm.measured.q, arm.measured.qd).tolist())
        return self._twist.bytes
