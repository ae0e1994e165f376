"""Messages of a deployed model beside a robot: its joints and tool corrected, at the rate of a servo loop."""

import numpy as np

from catenary.arrays import Floats
from catenary.crtk.message import header, message_class
from catenary.crtk.message_values import pose_message
from catenary.crtk.serving.tool_pose import ToolPose
from catenary.crtk.topic_names import JOINT_STATE, TRANSFORM
from catenary.crtk.transport import Transport
from catenary.gravity.torque import gravity_kernel
from catenary.plant import JointState
from catenary.robots.model import RobotModel

_BOOL = "std_msgs/Bool"
_NONE = np.empty(0)


class CalibratedMessages:
    """Publishes a corrected arm below a namespace of topics."""

    def __init__(
        self,
        transport: Transport,
        place: str,
        names: tuple[str, ...],
        robot: RobotModel,
        *,
        pose_type: str,
        positioning: RobotModel | None = None,
        with_intervals: tuple[str, ...] = (),
    ) -> None:
        """Begin to publish.

        Args:
            transport: Carries the messages.
            place: Namespace of the topics.
            names: Joints of the arm.
            robot: Its kinematics; both jaws may be one joint of it.
            pose_type: PoseStamped or TransformStamped.
            positioning: Arm of the first joints whose gravity torques are published; None publishes none.
            with_intervals: Joints whose intervals are published; none publishes none.
        """
        self._names = names
        self._child = "calibrated_tool" if pose_type == TRANSFORM else None
        self._tool = ToolPose(robot, names)
        self._positioning = names[: 0 if positioning is None else positioning.n]
        self._gravity = None if positioning is None else gravity_kernel(positioning)
        types = {"measured_js": JOINT_STATE, "measured_cp": pose_type, "is_valid": _BOOL}
        self._with_intervals = with_intervals
        self._places = [names.index(name) for name in with_intervals]
        if with_intervals:
            types["interval"] = JOINT_STATE
        if positioning is not None:
            types["gravity_torque"] = JOINT_STATE
        self._publishers = {
            verb: transport.publisher(f"{place}/{verb}", kind) for verb, kind in types.items()
        }
        # what is compiled on first use is compiled here, not when messages wait
        rest = np.zeros(len(names))
        self._tool.pose(rest)
        self._torque(rest, rest[:3])

    def publish(self, stamp: int, q: Floats, interval: Floats, state: JointState, *, is_valid: bool) -> None:
        """Publish a state.

        Args:
            stamp: [ns] the robot's.
            q: (n,) corrected positions [rad|m].
            interval: (n,) half-widths of intervals about them [rad|m].
            state: What the robot reported: velocities and torques, NaN where it reports none, and gravity.
            is_valid: Whether the model knows such positions.
        """
        publishers, joint_state = self._publishers, message_class(JOINT_STATE)
        qd, tau = (row if np.isfinite(row).all() else _NONE for row in (state.qd, state.tau))
        publishers["measured_js"].publish(joint_state(header(stamp), self._names, q, qd, tau))
        base = self._tool.model.base
        publishers["measured_cp"].publish(pose_message(self._tool.pose(q), stamp, base, child=self._child))
        publishers["is_valid"].publish(message_class(_BOOL)(is_valid))
        if self._with_intervals:
            widths = interval[self._places]
            publishers["interval"].publish(joint_state(header(stamp), self._with_intervals, widths))
        if self._gravity is not None:
            torque = self._torque(q, state.gravity)
            publishers["gravity_torque"].publish(joint_state(header(stamp), self._positioning, effort=torque))

    def _torque(self, q: Floats, gravity: Floats) -> Floats:
        return _NONE if self._gravity is None else self._gravity(q[: len(self._positioning)], gravity)

    def close(self) -> None:
        """Publish no more."""
        for publisher in self._publishers.values():
            publisher.close()
