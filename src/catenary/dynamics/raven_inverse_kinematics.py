"""Inverse kinematics of the RAVEN-II in closed form, for both arms, with three joints or six.

The first three axes meet in the remote centre (RCM): two angles point the shaft, the third joint slides along
it. The last three turn the tool; joint 6 sits L = 13 mm beyond the wrist, and lies in the plane of shaft and
tool. Steps and check values: uw-biorobotics/raven2 @ d2307c5, r2_kinematics.cpp. One formula serves both
arms, which differ in the constants of their Denavit-Hartenberg rows, Rx(twist) Tx(a) Rz(zero + q) Tz(d).
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from catenary.arrays import Floats, as_array
from catenary.errors import UnreachablePoseError, UnsupportedModelError
from catenary.robots.model import RobotModel
from catenary.spatial import Pose, as_rotation, rotation_about_x, rotation_about_z

# The robot's own software refuses a wrist this near the RCM, where small motions of the tool need large ones
# of the joints: r2_kinematics.cpp, Lw
REFUSED_RADIUS = 0.013  # m
LIMIT_TOLERANCE = 1e-9  # rad or m: rounding of the closed form, with a wide margin
_METRE_IN_RADIANS = 100.0  # the robot's software weighs insertion so when it compares solutions


class _Arm(NamedTuple):
    """The constants of one arm's rows."""

    frame_0: Pose  # of the mechanism's frame 0 in the base
    twist: Floats  # (n,) alpha [rad]
    zero: Floats  # (n,) theta at coordinate zero [rad]
    shaft: float  # D, from the wrist to the origin of frame 3 along the shaft [m]
    tool: float | None  # L, from the wrist to the tool's joint [m]; None for three joints


def raven_solutions(model: RobotModel, pose: Pose) -> Floats:
    """All configurations that reach a pose, whatever the joint limits.

    Args:
        model: A RAVEN-II arm: three joints (the position of the pose counts) or six.
        pose: Pose of the model's tip in the base frame [m].

    Returns:
        (k, n) coordinates [rad or m], k up to 4 for three joints and 8 for six; angles in (-pi, pi].

    Raises:
        UnsupportedModelError: Not a RAVEN-II arm.
        UnreachablePoseError: The wrist would lie within 13 mm of the remote centre.
        InputError: The pose is not one.
    """
    arm = _arm(model)
    target = arm.frame_0.inverse() @ Pose(
        as_rotation("pose rotation", pose.rotation), as_array("pose position", pose.position, (3,))
    )
    solutions: list[Floats] = []
    for wrist in _wrist_points(arm, target):
        distance = float(np.linalg.norm(wrist))
        if distance <= REFUSED_RADIUS:
            raise UnreachablePoseError(
                f'robot "{model.name}": the wrist would lie {1e3 * distance:.2f} mm from the remote centre; '
                f"expected more than {1e3 * REFUSED_RADIUS:.0f} mm, where the robot's software refuses too"
            )
        for reach in (-distance, distance):  # wrist before or beyond the RCM, seen along z3
            for theta_1, theta_2 in _shoulder_angles(arm, wrist / reach):
                theta = np.array([theta_1, theta_2, arm.zero[2]])
                if arm.tool is not None:
                    theta = np.append(theta, _tool_angles(arm, arm.tool, theta, reach, target))
                q = _wrapped(theta - arm.zero)
                q[2] = arm.shaft + reach
                solutions.append(q - model.offset)
    return np.array(solutions).reshape(-1, model.n)


def nearest_raven_solution(model: RobotModel, pose: Pose, q_start: Floats | None) -> Floats:
    """Give the solution within the joint limits, the nearest to `q_start` if there are several.

    Distance is in rad, a metre of insertion counting as 100 rad, as in the robot's software; unlike it, a
    solution far from `q_start` is not refused. Without `q_start`, nearest to the middle of the limits.

    Raises:
        UnreachablePoseError: The remote centre, the shaft's cone or the joint limits refuse the pose.
        InputError: The pose is not one.
    """
    solutions = raven_solutions(model, pose)
    if len(solutions) == 0:
        raise UnreachablePoseError(_cone_message(model, pose))
    near = 0.5 * (model.lower + model.upper) if q_start is None else q_start
    turned = np.array([_turned(model, q, near) for q in solutions])
    weight = np.where(np.array(model.joint_units) == "m", _METRE_IN_RADIANS, 1.0)
    excess = weight * np.maximum(np.maximum(model.lower - turned, turned - model.upper), 0.0)
    allowed = (excess <= weight * LIMIT_TOLERANCE).all(axis=1)
    if not allowed.any():
        best = int(np.argmin(excess.max(axis=1)))
        raise UnreachablePoseError(_limit_message(model, turned[best], excess[best] > 0.0))
    turned = turned[allowed]
    nearest = turned[int(np.argmin((((turned - near) * weight) ** 2).sum(axis=1)))]
    q: Floats = np.clip(nearest, model.lower, model.upper)
    return q


def _arm(model: RobotModel) -> _Arm:
    if model.closed_form != "raven2" or model.n not in (3, 6) or not _joints_move_alone(model):
        raise UnsupportedModelError(
            f'robot "{model.name}": no closed form; expected a RAVEN-II arm with three or six joints'
        )
    frame_0 = model.frame("frame0").pose
    rotation = np.array(model.tree.rotation)
    rotation[0] = frame_0.rotation.T @ rotation[0]
    twist = np.arctan2(-rotation[:, 1, 2], rotation[:, 2, 2])
    zero = np.arctan2(-rotation[:, 0, 1], rotation[:, 0, 0])
    if model.n == 3:
        return _Arm(frame_0, twist, zero, -float(model.frame().pose.position[2]), None)
    return _Arm(frame_0, twist, zero, -float(model.tree.origin[3, 2]), float(model.tree.origin[5, 0]))


def _joints_move_alone(model: RobotModel) -> bool:
    return np.array_equal(model.coupling, np.eye(model.n))


def _wrist_points(arm: _Arm, target: Pose) -> list[Floats]:
    """Give where the wrist may be, in frame 0: at the target, or L before and behind the tool's joint.

    Shaft, tool and z6 lie in one plane, so the RCM seen in frame 6 lies, but for its z, along the tool.
    """
    if arm.tool is None:
        return [target.position]
    centre = (-target.rotation.T @ target.position) * [1.0, 1.0, 0.0]
    length = np.linalg.norm(centre)
    # z6 through the RCM: the tool may turn about it; any direction is a solution, we take x
    along = target.rotation @ (centre / length if length > 0.0 else np.array([1.0, 0.0, 0.0]))
    return [target.position - arm.tool * along, target.position + arm.tool * along]


def _shoulder_angles(arm: _Arm, v: Floats) -> Iterator[tuple[float, float]]:
    """Give theta 1 and 2 that point z3 along the unit vector v (3,) of frame 0: two, one, or none.

    w = Rx(twist 1)^T v is (A, B, c2 c3 - s2 s3 cos theta 2) turned by theta 1 about z: its z gives theta 2,
    the rest theta 1.
    """
    w = rotation_about_x(arm.twist[0]).T @ v
    c2, s2 = np.cos(arm.twist[1]), np.sin(arm.twist[1])
    c3, s3 = np.cos(arm.twist[2]), np.sin(arm.twist[2])
    cos_theta_2 = (c2 * c3 - w[2]) / (s2 * s3)
    if abs(cos_theta_2) > 1.0:
        return
    for sign in (-1.0, 1.0):
        theta_2 = sign * np.arccos(cos_theta_2)
        A = np.sin(theta_2) * s3
        B = -c2 * cos_theta_2 * s3 - s2 * c3
        yield float(np.arctan2(w[1], w[0]) - np.arctan2(B, A)), float(theta_2)


def _tool_angles(arm: _Arm, tool: float, theta: Floats, reach: float, target: Pose) -> Floats:
    """Give theta 4, 5, 6 from where the tool is in frame 3, T36 with rotation r and origin t."""
    R_0_3 = np.eye(3)
    for twist, angle in zip(arm.twist[:3], theta, strict=True):
        R_0_3 = R_0_3 @ rotation_about_x(twist) @ rotation_about_z(angle)
    r = R_0_3.T @ target.rotation
    t = R_0_3.T @ target.position - [0.0, 0.0, arm.shaft + reach]
    c5, s5 = -r[2, 2], (t[2] + arm.shaft) / tool
    # t holds the roll well where the tool is bent aside, r where it is along the shaft (|J5| < 70 deg)
    x, y = (r[0, 2] * s5, r[1, 2] * s5) if abs(s5) > abs(c5) else (t[0] * c5, t[1] * c5)
    theta_4, theta_5 = np.arctan2(y, x), np.arctan2(s5, c5)
    R_3_5 = (
        rotation_about_x(arm.twist[3])
        @ rotation_about_z(theta_4)
        @ rotation_about_x(arm.twist[4])
        @ rotation_about_z(theta_5)
    )
    R_6 = (R_3_5 @ rotation_about_x(arm.twist[5])).T @ r  # what is left is Rz(theta 6)
    return np.array([theta_4, theta_5, np.arctan2(R_6[1, 0], R_6[0, 0])])


def _wrapped(angle: Floats) -> Floats:
    """Give angles in (-pi, pi]."""
    wrapped: Floats = np.pi - np.mod(np.pi - angle, 2.0 * np.pi)
    return wrapped


def _turned(model: RobotModel, q: Floats, near: Floats) -> Floats:
    """Shift angles by a whole turn where that is within the limits and nearer: the roll spans 364 deg."""
    out = q.copy()
    for k, unit in enumerate(model.joint_units):
        if unit != "rad":
            continue
        turns = q[k] + 2.0 * np.pi * np.array([0.0, -1.0, 1.0])
        inside = turns[
            (turns >= model.lower[k] - LIMIT_TOLERANCE) & (turns <= model.upper[k] + LIMIT_TOLERANCE)
        ]
        if len(inside):
            out[k] = inside[int(np.argmin(np.abs(inside - near[k])))]
    return out


def _limit_message(model: RobotModel, q: Floats, outside: NDArray[np.bool_]) -> str:
    refusals = [
        f'joint "{name}": {value:.6g} {unit} outside [{lower:.6g}, {upper:.6g}]'
        for name, value, unit, lower, upper, refused in zip(
            model.joint_names, q, model.joint_units, model.lower, model.upper, outside, strict=True
        )
        if refused
    ]
    return f'robot "{model.name}": the joint limits refuse the pose; nearest to them: {"; ".join(refusals)}'


def _cone_message(model: RobotModel, pose: Pose) -> str:
    arm = _arm(model)
    target = arm.frame_0.inverse() @ pose
    axis = rotation_about_x(arm.twist[0])[:, 2]
    angles = [
        float(np.rad2deg(np.arccos(np.clip(wrist @ axis / np.linalg.norm(wrist), -1.0, 1.0))))
        for wrist in _wrist_points(arm, target)
    ]
    nearest = min(abs(float(np.rad2deg(arm.twist[1] - arm.twist[2]))), 180.0)
    sum_of_twists = float(np.rad2deg(arm.twist[1] + arm.twist[2]))
    farthest = min(sum_of_twists, 360.0 - sum_of_twists)
    # the shaft is a line: an angle and its supplement are the same
    low = min(nearest, 180.0 - farthest)
    return (
        f'robot "{model.name}": out of reach: the shaft would lie '
        f"{' or '.join(f'{a:.1f}' for a in angles)} deg from the shoulder's axis; "
        f"expected between {low:.0f} and {180.0 - low:.0f} deg"
    )
