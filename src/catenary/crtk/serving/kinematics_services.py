"""CRTK's services of a served arm: forward_kinematics and inverse_kinematics, below its namespace.

Joints are those of `measured_js`, in its order; poses are the tool's in the base. What cannot be answered says so in
`result` and `message`, and moves nothing. [crtk_msgs: QueryForwardKinematics, QueryInverseKinematics]
"""

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from catenary.arrays import Floats, as_array
from catenary.crtk.conversions import pose_message, rotation_of
from catenary.crtk.message import Message, message_class
from catenary.crtk.serving.arm_messages import BASE
from catenary.crtk.serving.served_arm import ServedArm
from catenary.errors import CatenaryError, LimitError
from catenary.spatial import Pose

FORWARD, INVERSE = "crtk_msgs/QueryForwardKinematics", "crtk_msgs/QueryInverseKinematics"


class Service(NamedTuple):
    """A service of a robot."""

    name: str
    type: str
    answer: Callable[[Message], Message]


def kinematics_services(place: str, arm: ServedArm) -> Iterator[Service]:
    """Yield both services of an arm, below its namespace `place`."""
    yield Service(
        f"{place}/forward_kinematics", FORWARD, lambda request: _answer(FORWARD, _pose_at, arm, request)
    )
    yield Service(
        f"{place}/inverse_kinematics", INVERSE, lambda request: _answer(INVERSE, _joints_at, arm, request)
    )


def _answer(
    kind: str, compute: Callable[[ServedArm, Message], dict[str, Message]], arm: ServedArm, request: Message
) -> Message:
    response = message_class(f"{kind}Response")
    try:
        return response(result=True, **compute(arm, request))
    except CatenaryError as error:
        return response(result=False, message=str(error))


def _pose_at(arm: ServedArm, request: Message) -> dict[str, Message]:
    pose = arm.tool.pose(arm.whole(as_array("jp", request.jp, (len(arm.reported),))))
    return {"cp": pose_message(pose, 0, BASE).pose}


def _joints_at(arm: ServedArm, request: Message) -> dict[str, Floats]:
    """Return joints at a pose, the nearest to those of the request; to the setpoint where it has none."""
    n = len(arm.reported)
    near = arm.setpoint.q if not len(request.jp) else arm.whole(as_array("jp", request.jp, (n,)))
    goal = Pose(rotation_of(request.cp.orientation), as_array("position", tuple(request.cp.position), (3,)))
    q = arm.tool.joints(goal, near)
    beyond = np.flatnonzero((q < arm.lower - 1e-9) | (q > arm.upper + 1e-9))
    if len(beyond):
        j = int(beyond[0])
        raise LimitError(
            f'joint "{arm.names[j]}": {q[j]:.6g} {arm.plant.joint_units[j]} outside '
            f"[{arm.lower[j]:.6g}, {arm.upper[j]:.6g}]"
        )
    return {"jp": q[:n]}
