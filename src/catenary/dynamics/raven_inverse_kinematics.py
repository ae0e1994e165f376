"""Inverse kinematics of the RAVEN-II in closed form: the nearest solution of each of a path of poses.

The first three axes meet in the remote centre (RCM): two angles point the shaft, the third joint slides along
it. The last three turn the tool; joint 6 sits L = 13 mm beyond the wrist, in the plane of shaft and tool.
Steps: uw-biorobotics/raven2 @ d2307c5, r2_kinematics.cpp. One formula serves both arms, with three joints or
six: they differ in the constants of their Denavit-Hartenberg rows, Rx(twist) Tx(a) Rz(zero + q) Tz(d).
"""

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from catenary.arrays import Floats, as_array
from catenary.dynamics.recursion import Vector, column, dot, row, scale, times, transpose_times
from catenary.errors import InputError, UnreachablePoseError, UnsupportedModelError
from catenary.kernels.compiled import compiled, inlined
from catenary.robots.model import RobotModel

# The robot's own software refuses a wrist this near the RCM, where small motions of the tool need large ones
# of the joints: r2_kinematics.cpp, Lw
_REFUSED_RADIUS_M = 0.013  # m
_LIMIT_TOLERANCE = 1e-9  # rad or m: rounding of the closed form, with a wide margin


class RavenArm(NamedTuple):
    """The constants of one arm."""

    twist: Floats  # (n,) alpha of each row [rad]
    zero: Floats  # (n,) theta of each row at coordinate zero [rad]
    shaft: float  # D, from the wrist to the origin of frame 3 along the shaft [m]
    tool: float  # L, from the wrist to the tool's joint [m]; 0 for an arm of three joints
    lower: Floats  # (n,) joint limits [rad or m]
    upper: Floats  # (n,)
    weight: Floats  # (n,) of each coordinate in the distance between configurations [1/rad or 1/m]


@compiled
def raven_candidates(arm: RavenArm, rotations: Floats, positions: Floats, k: int, out: Floats) -> tuple[int, float]:
    """Write to out (8, n) all configurations that reach pose k of the tip in frame 0, whatever the limits.

    Rotations (N, 3, 3) are not read for three joints. Angles are in (-pi, pi], insertion in m. Returns how many there
    are, none within _REFUSED_RADIUS_M, and the wrist's distance from the RCM [m], the smaller of two possible ones.
    """
    tip = row(positions, k)
    along = (0.0, 0.0, 0.0)
    if arm.tool > 0.0:
        # shaft, tool and z6 lie in one plane: seen in frame 6, the RCM lies along the tool, but for its z
        centre = transpose_times(rotations, k, tip)
        length = math.hypot(centre[0], centre[1])
        x, y = 1.0, 0.0  # with z6 through the RCM any direction will do
        if length > 0.0:
            x, y = -centre[0] / length, -centre[1] / length
        along = times(rotations, k, (x, y, 0.0))
    step = scale(arm.tool, along)
    before = (tip[0] - step[0], tip[1] - step[1], tip[2] - step[2])
    behind = (tip[0] + step[0], tip[1] + step[1], tip[2] + step[2])
    nearest = min(math.sqrt(dot(before, before)), math.sqrt(dot(behind, behind)))
    if nearest <= _REFUSED_RADIUS_M:
        return 0, nearest

    count = 0
    for side in range(2 if arm.tool > 0.0 else 1):
        wrist = before if side == 0 else behind
        distance = math.sqrt(dot(wrist, wrist))
        for sign in (-1.0, 1.0):
            reach = sign * distance  # along z3, which points out of the body
            w = _about_x(-arm.twist[0], scale(1.0 / reach, wrist))
            # w is (A, B, c2 c3 - s2 s3 cos theta 2) turned by theta 1 about z
            c2, s2 = math.cos(arm.twist[1]), math.sin(arm.twist[1])
            c3, s3 = math.cos(arm.twist[2]), math.sin(arm.twist[2])
            cos_theta_2 = (c2 * c3 - w[2]) / (s2 * s3)
            if abs(cos_theta_2) > 1.0:
                continue
            for elbow in (-1.0, 1.0):
                theta_2 = elbow * math.acos(cos_theta_2)
                A = math.sin(theta_2) * s3
                B = -c2 * cos_theta_2 * s3 - s2 * c3
                theta_1 = math.atan2(w[1], w[0]) - math.atan2(B, A)
                q = out[count]
                q[0] = _wrapped(theta_1 - arm.zero[0])
                q[1] = _wrapped(theta_2 - arm.zero[1])
                q[2] = arm.shaft + reach
                if arm.tool > 0.0:
                    _write_tool_angles(arm, theta_1, theta_2, tip, rotations, k, q)
                count += 1
    return count, nearest


@inlined
def _write_tool_angles(
    arm: RavenArm, theta_1: float, theta_2: float, tip: Vector, rotations: Floats, k: int, q: Floats
) -> None:
    """Write q[3:] from the tool seen in frame 3: its origin t, its axes x and z."""
    t = _into_frame_3(arm, theta_1, theta_2, tip)
    x = _into_frame_3(arm, theta_1, theta_2, column(rotations, k, 0))
    z = _into_frame_3(arm, theta_1, theta_2, column(rotations, k, 2))
    c5, s5 = -z[2], (t[2] - q[2] + arm.shaft) / arm.tool
    # z shows the roll well where the tool is along the shaft (|J5| < 70 deg), t where it is bent aside
    if abs(s5) > abs(c5):
        theta_4 = math.atan2(z[1] * s5, z[0] * s5)
    else:
        theta_4 = math.atan2(t[1] * c5, t[0] * c5)
    theta_5 = math.atan2(s5, c5)
    x = _about_z(-theta_4, _about_x(-arm.twist[3], x))
    x = _about_z(-theta_5, _about_x(-arm.twist[4], x))
    x = _about_x(-arm.twist[5], x)  # what is left is the turn by theta 6
    q[3] = _wrapped(theta_4 - arm.zero[3])
    q[4] = _wrapped(theta_5 - arm.zero[4])
    q[5] = _wrapped(math.atan2(x[1], x[0]) - arm.zero[5])


@compiled
def nearest_within_limits(arm: RavenArm, rotations: Floats, positions: Floats, q_start: Floats, out: Floats) -> int:
    """Write (N, n) the solutions within the limits nearest to the one before; return N, or the first pose with none."""
    n = len(q_start)
    candidates = np.empty((8, n))
    previous = q_start
    for k in range(len(positions)):
        count, _ = raven_candidates(arm, rotations, positions, k, candidates)
        best, nearest = -1, np.inf
        for c in range(count):
            distance, inside = 0.0, True
            for j in range(n):
                candidates[c, j] = turned_within_limits(arm, j, candidates[c, j], previous[j])
                value = candidates[c, j]
                distance += (arm.weight[j] * (value - previous[j])) ** 2
                inside &= arm.lower[j] - _LIMIT_TOLERANCE <= value <= arm.upper[j] + _LIMIT_TOLERANCE
            if inside and distance < nearest:
                best, nearest = c, distance
        if best < 0:
            return k
        for j in range(n):
            out[k, j] = min(max(candidates[best, j], arm.lower[j]), arm.upper[j])
        previous = out[k]
    return len(positions)


@compiled
def turned_within_limits(arm: RavenArm, j: int, value: float, previous: float) -> float:
    """Shift an angle by a whole turn where that is within limits and nearer: the roll spans 364 deg."""
    if j == 2:  # insertion
        return value
    best, nearest = value, np.inf
    for turn in (0.0, -2.0 * math.pi, 2.0 * math.pi):
        shifted = value + turn
        inside = arm.lower[j] - _LIMIT_TOLERANCE <= shifted <= arm.upper[j] + _LIMIT_TOLERANCE
        if inside and abs(shifted - previous) < nearest:
            best, nearest = shifted, abs(shifted - previous)
    return best


@inlined
def _into_frame_3(arm: RavenArm, theta_1: float, theta_2: float, v: Vector) -> Vector:
    """Take a vector from frame 0 to frame 3."""
    v = _about_z(-theta_1, _about_x(-arm.twist[0], v))
    v = _about_z(-theta_2, _about_x(-arm.twist[1], v))
    return _about_z(-arm.zero[2], _about_x(-arm.twist[2], v))


@inlined
def _about_x(angle: float, v: Vector) -> Vector:
    c, s = math.cos(angle), math.sin(angle)
    return v[0], c * v[1] - s * v[2], s * v[1] + c * v[2]


@inlined
def _about_z(angle: float, v: Vector) -> Vector:
    c, s = math.cos(angle), math.sin(angle)
    return c * v[0] - s * v[1], s * v[0] + c * v[1], v[2]


@inlined
def _wrapped(angle: float) -> float:  # in (-pi, pi]
    return math.pi - (math.pi - angle) % (2.0 * math.pi)


_METRE_IN_RADIANS = 100.0  # the robot's software weighs insertion so when it compares solutions


def raven_path(
    model: RobotModel, rotations: ArrayLike, positions: ArrayLike, q_start: ArrayLike | None = None
) -> Floats:
    """Return joint configurations (N, n) [rad|m] along poses, each within limits and nearest to the one before.

    Distance is in rad, a metre of insertion counting as 100 rad, as in the robot's software; unlike it, a
    distant solution is not refused.

    Args:
        model: A RAVEN-II arm.
        rotations: R_base_tip (N, 3, 3); of a three-joint arm only positions count.
        positions: Positions of the tip in the base frame (N, 3) [m].
        q_start: Configuration before the first pose (n,) [rad or m]; the middle of the limits when None.

    Raises:
        UnreachablePoseError: A pose without a solution within the limits.
    """
    arm, frame_0 = _arm(model), model.frame("frame0").pose
    R = as_array("rotations", rotations, (None, 3, 3))
    p = as_array("positions", positions, (len(R), 3))
    deviation = np.abs(R @ R.transpose(0, 2, 1) - np.eye(3)).max(axis=(1, 2), initial=0.0)
    if len(wrong := np.flatnonzero((deviation > 1e-6) | (np.linalg.det(R) < 0.0))):
        raise InputError(f"rotations[{wrong[0]}]: expected a rotation matrix")
    middle = 0.5 * (model.lower + model.upper)
    start = middle if q_start is None else as_array("q_start", q_start, (model.n,))
    out = np.empty((len(R), model.n))
    poses = (
        np.ascontiguousarray(frame_0.rotation.T @ R),
        np.ascontiguousarray((p - frame_0.position) @ frame_0.rotation),
    )
    solved = nearest_within_limits(arm, *poses, np.array(start), out)
    if solved < len(R):
        where = f"pose {solved} of {len(R)}: " if len(R) > 1 else ""
        solutions = np.empty((8, model.n))
        count, distance = raven_candidates(arm, *poses, solved, solutions)
        previous = start if solved == 0 else out[solved - 1]
        raise UnreachablePoseError(where + _refusal(model, arm, solutions[:count], distance, previous))
    return out


@lru_cache(maxsize=16)  # models never change, and are asked for in each tick
def _arm(model: RobotModel) -> RavenArm:
    is_known = model.closed_form == "raven2" and model.n in (3, 6)
    if not is_known or not np.array_equal(model.coupling, np.eye(model.n)) or model.offset.any():
        raise UnsupportedModelError(
            f'robot "{model.name}": no closed form; expected a RAVEN-II arm with three or six joints'
        )
    rotation = np.array(model.tree.rotation)
    rotation[0] = model.frame("frame0").pose.rotation.T @ rotation[0]
    full = model.n == 6
    return RavenArm(
        twist=np.arctan2(-rotation[:, 1, 2], rotation[:, 2, 2]),
        zero=np.arctan2(-rotation[:, 0, 1], rotation[:, 0, 0]),
        shaft=-float(model.tree.origin[3, 2] if full else model.frame().pose.position[2]),
        tool=float(model.tree.origin[5, 0]) if full else 0.0,
        lower=model.lower,
        upper=model.upper,
        weight=np.where(np.array(model.joint_units) == "m", _METRE_IN_RADIANS, 1.0),
    )


def _refusal(model: RobotModel, arm: RavenArm, solutions: Floats, distance: float, previous: Floats) -> str:
    if distance <= _REFUSED_RADIUS_M:
        return (
            f'robot "{model.name}": the wrist would lie {1e3 * distance:.2f} mm from the remote centre; '
            f"expected more than {1e3 * _REFUSED_RADIUS_M:.0f} mm, where the robot's software refuses too"
        )
    if len(solutions) == 0:
        return f'robot "{model.name}": out of reach: the shaft would lie too near the shoulder\'s axis'
    for q in solutions:
        for j in range(model.n):
            q[j] = turned_within_limits(arm, j, q[j], previous[j])
    excess = arm.weight * np.maximum(np.maximum(model.lower - solutions, solutions - model.upper), 0.0)
    best = int(np.argmin(excess.max(axis=1)))
    refusals = [
        f'joint "{name}": {solutions[best, j]:.6g} {model.joint_units[j]} '
        f"outside [{model.lower[j]:.6g}, {model.upper[j]:.6g}]"
        for j, name in enumerate(model.joint_names)
        if excess[best, j] > arm.weight[j] * _LIMIT_TOLERANCE
    ]
    return f'robot "{model.name}": the joint limits refuse the pose; nearest to them: {"; ".join(refusals)}'
