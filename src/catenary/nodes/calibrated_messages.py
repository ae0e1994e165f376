"""What a deployed model says beside a robot: its joints and tool corrected, at the rate of a servo loop.

The messages are frames whose numbers one compiled call writes: made one by one in Python they would take longer than
the millisecond in which the next ones are due.
"""

from math import isfinite

import numpy as np

from catenary.arrays import Floats
from catenary.crtk.frames import joint_state_frame, pose_frame
from catenary.crtk.message import message_class
from catenary.crtk.names import JOINT_STATE, TRANSFORM
from catenary.crtk.sheet import Sheet
from catenary.crtk.tool_numbers import POSES, SIZE
from catenary.crtk.tool_pose import ToolPose
from catenary.crtk.transport import Transport
from catenary.gravity.torque import gravity_kernel
from catenary.plant import JointState
from catenary.robots.model import RobotModel

_ROWS = 6  # of joints' numbers, as ToolNumbers takes them; those of setpoints stay zero
_PARTS = ("q", "qv", "qt", "qvt")  # of a JointState: a RAVEN-II may report no velocities
_BOOL = "std_msgs/Bool"


class CalibratedMessages:
    """Publishes a corrected arm below a place of topics."""

    def __init__(
        self,
        transport: Transport,
        place: str,
        names: tuple[str, ...],
        robot: RobotModel,
        *,
        pose_type: str,
        positioning: RobotModel | None = None,
    ) -> None:
        """Begin to publish.

        Args:
            transport: Carries the messages.
            place: Namespace of the topics.
            names: Joints of the arm.
            robot: Its kinematics; both jaws may be one joint of it.
            pose_type: PoseStamped or TransformStamped.
            positioning: Arm of the first joints whose gravity torques are published; None publishes none.

        Raises:
            InputError: Arm and kinematics do not belong together.
            TransportError: Somebody publishes these topics with other types.
        """
        n, m = len(names), 0 if positioning is None else positioning.n
        tool, torques = _ROWS * n, _ROWS * n + SIZE
        child = "calibrated_tool" if pose_type == TRANSFORM else None
        frames = [joint_state_frame(names, 0, n, parts=parts) for parts in _PARTS]
        frames += [
            pose_frame(tool + POSES[0], "base", child),
            joint_state_frame(names[:m], torques, 0, parts="t"),
        ]
        self._sheet = Sheet(frames, torques + m)
        numbers = self._sheet.numbers
        self._joints = numbers[:tool].reshape(_ROWS, n)
        self._q, self._qd, self._tau = self._joints[:3]
        self._of_tool, self._torques = numbers[tool:torques], numbers[torques:]
        self._tool = ToolPose(robot, names).numbers
        *joint_states, self._pose, self._effort = (self._sheet.frame(k) for k in range(len(frames)))
        self._joint_states = dict(zip(_PARTS, joint_states, strict=True))
        self._gravity = None if positioning is None else gravity_kernel(positioning)
        self._flags = {flag: message_class(_BOOL)(flag) for flag in (True, False)}
        types = {"measured_js": JOINT_STATE, "measured_cp": pose_type, "is_valid": _BOOL}
        if positioning is not None:
            types["gravity_torque"] = JOINT_STATE
        self._publishers = {
            verb: transport.publisher(f"{place}/{verb}", kind) for verb, kind in types.items()
        }
        # what is compiled on first use is compiled here, not when messages wait
        rest = np.zeros(n)
        self._write(0, rest, JointState(0.0, rest, rest, rest, rest, np.zeros(3), np.inf))

    def publish(self, stamp: int, q: Floats, state: JointState, *, is_valid: bool) -> None:
        """Publish a state.

        Args:
            stamp: [ns] the robot's.
            q: (n,) corrected positions [rad|m].
            state: What the robot reported: velocities and torques, NaN where it reports none, and gravity.
            is_valid: Whether the model knows such positions.
        """
        self._write(stamp, q, state)
        parts = "q" + "v" * _all_finite(self._qd) + "t" * _all_finite(self._tau)
        publishers = self._publishers
        publishers["measured_js"].publish_frame(self._joint_states[parts])
        publishers["measured_cp"].publish_frame(self._pose)
        publishers["is_valid"].publish(self._flags[is_valid])
        if self._gravity is not None:
            publishers["gravity_torque"].publish_frame(self._effort)

    def close(self) -> None:
        """Publish no more."""
        for publisher in self._publishers.values():
            publisher.close()

    def _write(self, stamp: int, q: Floats, state: JointState) -> None:
        self._q[:], self._qd[:], self._tau[:] = q, state.qd, state.tau
        self._tool.write(self._joints, self._of_tool)
        if self._gravity is not None:
            self._gravity(self._q[: len(self._torques)], state.gravity, self._torques)
        self._sheet.write(stamp)


def _all_finite(values: Floats) -> bool:
    return isfinite(sum(values.tolist()))  # of seven numbers, a fifth of NumPy's time
