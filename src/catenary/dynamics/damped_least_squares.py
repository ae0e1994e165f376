"""Inverse kinematics of any arm by damped least squares, from one start, within the joint limits."""

from typing import NamedTuple

import numpy as np

from catenary.arrays import Floats
from catenary.dynamics.kinematics import forward_kinematics, jacobian
from catenary.robots.model import RobotModel
from catenary.spatial import Pose, rotation_vector

_LEAST_DAMPING = 1e-12
_MOST_DAMPING = 1e8


class Approach(NamedTuple):
    """Where the search ended, and how far from the target."""

    q: Floats  # (n,) [rad or m]
    position_error: float  # [m]
    orientation_error: float  # [rad], 0 when only the position counts


def damped_least_squares(
    model: RobotModel,
    target: Pose,
    q_start: Floats,
    frame: str | None,
    *,
    with_orientation: bool,
    position_tolerance: float,
    orientation_tolerance: float,
    max_iterations: int,
) -> Approach:
    """Approach a pose from a start until within tolerance, or until no step brings it nearer.

    Levenberg-Marquardt: step = (J^T J + damping 1)^-1 J^T e, e the position error [m] over the rotation that
    is left [rad]; the damping shrinks after a step that helped and grows until one does. A coordinate that a
    step would press against its limit is left out of it. [D. Marquardt, J. SIAM 11 (1963); for inverse
    kinematics T. Sugihara, IEEE Trans. Robotics 27 (2011)]

    Args:
        model: The robot.
        target: Pose of the frame in the base [m].
        q_start: (n,) [rad or m], within the limits.
        frame: Name of the frame; the model's tip when None.
        with_orientation: Match the orientation too, not the position alone.
        position_tolerance: [m].
        orientation_tolerance: [rad].
        max_iterations: Steps tried at most.
    """
    rows = 6 if with_orientation else 3

    def error(q: Floats) -> Floats:
        pose = forward_kinematics(model, q, frame)
        left = target.position - pose.position
        if not with_orientation:
            return left
        return np.concatenate([left, rotation_vector(target.rotation @ pose.rotation.T)])

    def reached(e: Floats) -> bool:
        return bool(
            np.linalg.norm(e[:3]) <= position_tolerance and np.linalg.norm(e[3:]) <= orientation_tolerance
        )

    q, e = q_start, error(q_start)
    damping = 1e-3
    for _ in range(max_iterations):
        if reached(e) or damping > _MOST_DAMPING:
            break
        J = jacobian(model, q, frame)[:rows]
        pull = J.T @ e
        free = ~((pull < 0.0) & (q <= model.lower) | (pull > 0.0) & (q >= model.upper))
        step = np.zeros(model.n)
        J_free = J[:, free]
        step[free] = np.linalg.solve(J_free.T @ J_free + damping * np.eye(J_free.shape[1]), pull[free])
        trial = np.clip(q + step, model.lower, model.upper)
        e_trial = error(trial)
        if e_trial @ e_trial < e @ e:
            q, e = trial, e_trial
            damping = max(damping / 10.0, _LEAST_DAMPING)
        else:
            damping *= 5.0
    return Approach(q, float(np.linalg.norm(e[:3])), float(np.linalg.norm(e[3:])))
