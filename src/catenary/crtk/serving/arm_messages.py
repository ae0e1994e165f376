"""What a served arm says, verb by verb: its joints, jaws, tool and operating state as messages."""

from catenary.crtk.conversions import operating_state_message, pose_message
from catenary.crtk.message import Message, header, message_class
from catenary.crtk.serving.served_arm import ServedArm
from catenary.plant import JointState

BASE = "base"  # frame of all poses
_JointState = message_class("sensor_msgs/JointState")
_Vector3 = message_class("geometry_msgs/Vector3")
_Twist = message_class("geometry_msgs/Twist")
_TwistStamped = message_class("geometry_msgs/TwistStamped")


def measured_js(arm: ServedArm, stamp: int) -> Message:
    """Return the joint state as measured, at `stamp` [ns]."""
    return _joint_state(arm, arm.measured, stamp)


def setpoint_js(arm: ServedArm, stamp: int) -> Message:
    """Return the joint setpoint, at `stamp` [ns]."""
    return _joint_state(arm, arm.setpoint, stamp)


def jaw_measured_js(arm: ServedArm, stamp: int, name: str = "jaw") -> Message:
    """Return the opening of the jaws as measured, jaw1 + jaw2, with the mean of both efforts."""
    return _jaw(arm, arm.measured, stamp, name)


def jaw_setpoint_js(arm: ServedArm, stamp: int, name: str = "jaw") -> Message:
    """Return the setpoint of the opening of the jaws, jaw1 + jaw2, with the mean of both efforts."""
    return _jaw(arm, arm.setpoint, stamp, name)


def measured_cp(arm: ServedArm, stamp: int, child: str | None = None) -> Message:
    """Return the tool's pose as measured: a PoseStamped, or a TransformStamped where the tool's frame is given."""
    return pose_message(arm.measured_pose, stamp, BASE, child=child)


def setpoint_cp(arm: ServedArm, stamp: int, child: str | None = None) -> Message:
    """Return the setpoint of the tool's pose, as `measured_cp`."""
    return pose_message(arm.setpoint_pose, stamp, BASE, child=child)


def measured_cv(arm: ServedArm, stamp: int) -> Message:
    """Return the tool's velocity as measured, linear [m/s] and angular [rad/s], in base axes."""
    x, y, z, a, b, c = arm.measured_twist.tolist()
    return _TwistStamped(header(stamp, BASE), _Twist(_Vector3(x, y, z), _Vector3(a, b, c)))


def operating_state(arm: ServedArm, stamp: int) -> Message:
    """Return the operating state, at `stamp` [ns]."""
    return operating_state_message(arm.state, stamp)


def _joint_state(arm: ServedArm, state: JointState, stamp: int) -> Message:
    n = len(arm.reported)
    return _JointState(header(stamp), arm.reported, state.q[:n], state.qd[:n], state.tau[:n])


def _jaw(arm: ServedArm, state: JointState, stamp: int, name: str) -> Message:
    jaws = arm.tool.jaws
    position, velocity, effort = (row[-jaws:].sum() for row in (state.q, state.qd, state.tau))
    return _JointState(header(stamp), (name,), [position], [velocity], [effort / jaws])
