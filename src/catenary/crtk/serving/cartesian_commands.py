"""Cartesian commands of both dialects as joint motions, through the inverse kinematics."""

import numpy as np

from catenary.arrays import Floats, as_array
from catenary.crtk.serving.served_arm import ServedArm
from catenary.errors import InputError
from catenary.spatial import Pose, rotation_from_vector, rotation_vector

REFUSED = 0.075  # [m] from the setpoint: the RAVEN-II refuses a servo_cp beyond
CLIPPED = 0.015  # [m] a servo_cp goes at most


def servo_pose(arm: ServedArm, pose: Pose) -> None:
    """Go towards a pose: refused beyond 75 mm from the setpoint, and at most 15 mm of the way."""
    start = arm.tool.pose(arm.setpoint.q)
    way = pose.position - start.position
    distance = float(np.linalg.norm(way))
    if distance > REFUSED:
        raise InputError(
            f"servo_cp: {1e3 * distance:.1f} mm from the setpoint, expected at most {1e3 * REFUSED:.0f}"
        )
    if distance > CLIPPED:
        share = CLIPPED / distance
        turn = share * rotation_vector(start.rotation.T @ pose.rotation)
        pose = Pose(start.rotation @ rotation_from_vector(turn), start.position + share * way)
    arm.go_towards(arm.tool.joints(pose, arm.setpoint.q))


def servo_pose_increment(arm: ServedArm, step: Floats, turn: Floats) -> None:
    """Move the tool by a step (3,) [m] and turn it by a rotation vector (3,) [rad], both in base axes."""
    q = arm.commanded
    arm.increment_along(_joints_beside(arm, q, step, turn) - q)


def servo_twist(arm: ServedArm, twist: Floats) -> None:
    """Move the tool at a velocity and angular velocity (6,) in base axes [m/s, rad/s], for 0.1 s."""
    dt, q = arm.plant.period, arm.setpoint.q
    qd = (_joints_beside(arm, q, dt * twist[:3], dt * twist[3:]) - q) / dt
    with np.errstate(divide="ignore"):
        arm.run_at(qd * min(1.0, float((arm.most / dt / np.abs(qd)).min())))


def _joints_beside(arm: ServedArm, q: Floats, step: Floats, turn: Floats) -> Floats:
    step, turn = as_array("translation", step, (3,)), as_array("rotation", turn, (3,))
    start = arm.tool.pose(q)
    goal = Pose(rotation_from_vector(turn) @ start.rotation, start.position + step)
    return arm.tool.joints(goal, q)
