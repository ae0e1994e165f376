"""What a served arm says, verb by verb: joints, jaws, tool and state as messages, and CRTK's kinematics services.

Services: joints are those of `measured_js`, in its order; poses are the tool's in the base. What cannot be answered
says so in `result` and `message`, and moves nothing. [crtk_msgs: QueryForwardKinematics, QueryInverseKinematics]
"""

from collections.abc import Callable, Iterator
from functools import cache
from typing import Any, NamedTuple

from catenary.arrays import Floats, as_array
from catenary.crtk.message import Message, header, message_class
from catenary.crtk.message_values import pose_message, rotation_of
from catenary.crtk.serving.served_arm import BASE, ServedArm
from catenary.crtk.serving.tool_pose import FrameOfForces, exerted, jacobian
from catenary.errors import CatenaryError
from catenary.plant import JointState
from catenary.spatial import Pose

TOOL = "tool"  # frame of what is said in the tool's own axes
_JointState = message_class("sensor_msgs/JointState")
_Vector3 = message_class("geometry_msgs/Vector3")
_Twist = message_class("geometry_msgs/Twist")
_TwistStamped = message_class("geometry_msgs/TwistStamped")
_Wrench = message_class("geometry_msgs/Wrench")
_WrenchStamped = message_class("geometry_msgs/WrenchStamped")
_Dimension = message_class("std_msgs/MultiArrayDimension")
_Layout = message_class("std_msgs/MultiArrayLayout")
_MultiArray = message_class("std_msgs/Float64MultiArray")


def joints_and_tool(child: str | None = None) -> dict[str, Callable[[ServedArm, int], Message]]:
    """Return what both dialects publish of an arm in every tick, verb by verb: messages of it at a stamp [ns].

    Poses are TransformStamped where `child`, the tool's frame, is given; velocities [m/s, rad/s] in base axes.
    """

    def pose(arm: ServedArm, pose: Pose, stamp: int) -> Message:
        return pose_message(arm.placed(pose), stamp, arm.base_name, child=child)

    return {
        "measured_js": lambda arm, stamp: _joint_state(arm, arm.measured, stamp),
        "setpoint_js": lambda arm, stamp: _joint_state(arm, arm.setpoint, stamp),
        "measured_cp": lambda arm, stamp: pose(arm, arm.measured_tool.pose, stamp),
        "setpoint_cp": lambda arm, stamp: pose(arm, arm.setpoint_tool.pose, stamp),
        "measured_cv": lambda arm, stamp: _twist(arm, arm.measured_tool.twist, stamp),
        "setpoint_cv": lambda arm, stamp: _twist(arm, arm.setpoint_tool.twist, stamp),
    }


def measured_cf(arm: ServedArm, stamp: int, frame: FrameOfForces = FrameOfForces.TOOL_IN_BASE_AXES) -> Message:
    """Return the force [N] and moment [Nm] that the tool exerts, by the torques beyond the arm's own weight."""
    if frame is FrameOfForces.BODY and arm.forces_in_base_axes:
        frame = FrameOfForces.TOOL_IN_BASE_AXES
    x, y, z, a, b, c = exerted(arm.measured_tool, frame).tolist()
    where = TOOL if frame is FrameOfForces.BODY else BASE
    return _WrenchStamped(header(stamp, where), _Wrench(_Vector3(x, y, z), _Vector3(a, b, c)))


def jacobian_matrix(arm: ServedArm, stamp: int, frame: FrameOfForces = FrameOfForces.TOOL_IN_BASE_AXES) -> Message:
    """Return the Jacobian (6, n) by rows: velocity over angular velocity, of the joints as `measured_js` has them."""
    matrix = jacobian(arm.measured_tool, frame)
    rows, columns = matrix.shape
    return _MultiArray(_layout(rows, columns), matrix.ravel())


@cache
def _layout(rows: int, columns: int) -> Message:
    return _Layout((_Dimension("rows", rows, rows * columns), _Dimension("columns", columns, columns)), 0)


def grasp_measured_js(arm: ServedArm, stamp: int) -> Message:
    """Return what a RAVEN-II says of a grasp: opening and both jaws, one velocity, one effort, its own names."""
    names = tuple(f"{arm.arm}_{name}" for name in ("grasp", "jaw1", "jaw2"))
    opening = jaw(arm, arm.measured, stamp, "grasp")
    positions = [opening.position[0], *arm.measured.q[-arm.tool.jaws :]]
    return _JointState(header(stamp), names, positions, opening.velocity, opening.effort)


def local_pose(pose: Pose, stamp: int) -> Message:
    """Return a pose in the arm's own base."""
    return pose_message(pose, stamp, BASE)


def _twist(arm: ServedArm, twist: Floats, stamp: int) -> Message:
    if arm.base is not None:
        twist = (twist.reshape(2, 3) @ arm.base.rotation.T).ravel()
    x, y, z, a, b, c = twist.tolist()
    return _TwistStamped(header(stamp, arm.base_name), _Twist(_Vector3(x, y, z), _Vector3(a, b, c)))


def _joint_state(arm: ServedArm, state: JointState, stamp: int) -> Message:
    n = len(arm.reported)
    return _JointState(header(stamp), arm.reported, state.q[:n], state.qd[:n], state.tau[:n])


def jaw(arm: ServedArm, state: JointState, stamp: int, name: str = "jaw") -> Message:
    """Return the opening of the jaws in a state, jaw1 + jaw2, with the mean of both efforts."""
    jaws = arm.tool.jaws
    position, velocity, effort = (row[-jaws:].sum() for row in (state.q, state.qd, state.tau))
    return _JointState(header(stamp), (name,), [position], [velocity], [effort / jaws])


FORWARD, INVERSE = "crtk_msgs/QueryForwardKinematics", "crtk_msgs/QueryInverseKinematics"


class Service(NamedTuple):
    """A service of a robot."""

    name: str
    type: str
    answer: Callable[[Message], Message]


def kinematics_services(place: str, arm: ServedArm) -> Iterator[Service]:
    """Yield the services of an arm, below its namespace `place`; `local/` in its own base, of one that has such."""

    def answered(kind: str, compute: Callable[[Message], dict[str, Any]]) -> tuple[str, Callable[[Message], Message]]:
        response = message_class(f"{kind}Response")

        def answer(request: Message) -> Message:
            try:
                return response(result=True, **compute(request))
            except CatenaryError as error:
                return response(result=False, message=str(error))

        return kind, answer

    def tool(request: Message) -> Pose:
        return arm.tool.pose(arm.whole(as_array("jp", request.jp, (len(arm.reported),))))

    forward = answered(FORWARD, lambda request: {"cp": local_pose(arm.placed(tool(request)), 0).pose})
    yield Service(f"{place}/forward_kinematics", *forward)
    if arm.tool.jaw_is_apart:
        local = answered(FORWARD, lambda request: {"cp": local_pose(tool(request), 0).pose})
        yield Service(f"{place}/local/forward_kinematics", *local)
    yield Service(f"{place}/inverse_kinematics", *answered(INVERSE, lambda request: {"jp": _joints_at(arm, request)}))


def _joints_at(arm: ServedArm, request: Message) -> Floats:
    """Return joints at a pose, the nearest to those of the request; to the setpoint where it has none."""
    n = len(arm.reported)
    near = arm.setpoint.q if not len(request.jp) else arm.whole(as_array("jp", request.jp, (n,)))
    goal = Pose(rotation_of(request.cp.orientation), as_array("position", tuple(request.cp.position), (3,)))
    q = arm.tool.joints(arm.unplaced(goal), near)
    arm.require_inside(q)
    return q[:n]
