"""Inverse kinematics of the RAVEN-II: every solution, the nearest one, and a whole path of poses."""

from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from catenary.arrays import Floats, as_array
from catenary.dynamics.raven_closed_form import (
    LIMIT_TOLERANCE,
    REFUSED_RADIUS,
    RavenArm,
    nearest_within_limits,
    raven_candidates,
    turned_within_limits,
)
from catenary.errors import InputError, UnreachablePoseError, UnsupportedModelError
from catenary.robots.model import RobotModel
from catenary.spatial import Pose, as_rotation

_METRE_IN_RADIANS = 100.0  # the robot's software weighs insertion so when it compares solutions


def raven_solutions(model: RobotModel, pose: Pose) -> Floats:
    """Return all configurations that reach a pose, whatever the joint limits.

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
    rotations, positions = _in_frame_0(
        model,
        as_rotation("pose rotation", pose.rotation)[np.newaxis],
        as_array("pose position", pose.position, (3,))[np.newaxis],
    )
    solutions = np.empty((8, model.n))
    count, distance = raven_candidates(arm, rotations, positions, 0, solutions)
    if distance <= REFUSED_RADIUS:
        raise UnreachablePoseError(
            f'robot "{model.name}": the wrist would lie {1e3 * distance:.2f} mm from the remote centre; '
            f"expected more than {1e3 * REFUSED_RADIUS:.0f} mm, where the robot's software refuses too"
        )
    return solutions[:count]


def raven_path(
    model: RobotModel, rotations: ArrayLike, positions: ArrayLike, q_start: ArrayLike | None = None
) -> Floats:
    """Return configurations within the joint limits along a path of poses, each the nearest to the one before.

    Distance is in rad, a metre of insertion counting as 100 rad, as in the robot's software; unlike it, a
    solution far away is not refused.

    Args:
        model: A RAVEN-II arm: three joints (the positions count) or six.
        rotations: (N, 3, 3) R_base_tip.
        positions: (N, 3) of the tip in the base [m].
        q_start: (n,) configuration before the first pose [rad or m]; the middle of the limits when None.

    Returns:
        (N, n) [rad or m].

    Raises:
        UnsupportedModelError: Not a RAVEN-II arm.
        UnreachablePoseError: The remote centre, the shaft's cone or the joint limits refuse a pose; the
            message says which.
        InputError: An argument has another shape or is not finite.
    """
    arm = _arm(model)
    R = as_array("rotations", rotations, (None, 3, 3))
    p = as_array("positions", positions, (len(R), 3))
    deviation = np.abs(R @ R.transpose(0, 2, 1) - np.eye(3)).max(axis=(1, 2), initial=0.0)
    not_rotations = np.flatnonzero((deviation > 1e-6) | (np.linalg.det(R) < 0.0))
    if len(not_rotations):
        raise InputError(f"rotations[{not_rotations[0]}]: expected a rotation matrix")
    middle = 0.5 * (model.lower + model.upper)
    start = middle if q_start is None else as_array("q_start", q_start, (model.n,))
    out = np.empty((len(R), model.n))
    solved = nearest_within_limits(arm, *_in_frame_0(model, R, p), np.array(start), out)
    if solved < len(R):
        where = f"pose {solved} of {len(R)}: " if len(R) > 1 else ""
        near = start if solved == 0 else out[solved - 1]
        raise UnreachablePoseError(where + _refusal(model, arm, Pose(R[solved], p[solved]), near))
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


def _in_frame_0(model: RobotModel, rotations: Floats, positions: Floats) -> tuple[Floats, Floats]:
    """Take poses from the base to the mechanism's frame 0."""
    frame_0 = model.frame("frame0").pose
    return (
        np.ascontiguousarray(frame_0.rotation.T @ rotations),
        np.ascontiguousarray((positions - frame_0.position) @ frame_0.rotation),
    )


def _refusal(model: RobotModel, arm: RavenArm, pose: Pose, near: Floats) -> str:
    """Return the message that says what refuses a pose; the remote centre is checked first."""
    try:
        solutions = raven_solutions(model, pose)
    except UnreachablePoseError as error:
        return str(error)
    if len(solutions) == 0:
        return _cone_message(model, arm)
    for q in solutions:
        for j in range(model.n):
            q[j] = turned_within_limits(arm, j, q[j], near[j])
    excess = arm.weight * np.maximum(np.maximum(model.lower - solutions, solutions - model.upper), 0.0)
    best = int(np.argmin(excess.max(axis=1)))
    refusals = [
        f'joint "{name}": {solutions[best, j]:.6g} {model.joint_units[j]} '
        f"outside [{model.lower[j]:.6g}, {model.upper[j]:.6g}]"
        for j, name in enumerate(model.joint_names)
        if excess[best, j] > arm.weight[j] * LIMIT_TOLERANCE
    ]
    return f'robot "{model.name}": the joint limits refuse the pose; nearest to them: {"; ".join(refusals)}'


def _cone_message(model: RobotModel, arm: RavenArm) -> str:
    """Return the message for a shaft nearer to the shoulder's axis than the mechanism lets it lie."""
    twists = np.rad2deg(arm.twist)
    total = abs(twists[1] + twists[2])
    least, most = abs(twists[1] - twists[2]), min(total, 360.0 - total)
    low = min(least, 180.0 - most)
    return (
        f'robot "{model.name}": out of reach: the shaft would lie too near the shoulder\'s axis; '
        f"expected at {low:.0f} deg from it or more"
    )
