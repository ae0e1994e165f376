"""Moves of a served arm: from rest to rest, to joints or to a pose, and Cartesian steps of both dialects."""

from collections.abc import Callable
from functools import partial

import numpy as np

from catenary.arrays import Floats, as_array
from catenary.crtk.serving.served_arm import ServedArm
from catenary.errors import InputError
from catenary.spatial import Pose, rotation_from_vector, rotation_vector
from catenary.trajectories.reference import Trajectory
from catenary.trajectories.smoothed_path import go_to

# a third of what a setpoint may do, and there in half a second
_SPEED = {"rad": 0.8, "m": 0.016}  # [rad/s], [m/s]
_ACCELERATION = {"rad": 1.6, "m": 0.032}  # [rad/s2], [m/s2]
_GOAL_STEPS = 60  # steps of the search for joints far from the setpoint: some milliseconds, once


def joint_move(arm: ServedArm, q: Floats) -> Callable[[], Trajectory]:
    """Move all joints from the setpoint to q (n,), arriving together; what is returned makes the trajectory."""
    arm.require_inside(q)
    velocity, acceleration = _bounds(arm)
    return partial(go_to, arm.setpoint.q, q, max_velocity=velocity, max_acceleration=acceleration)


def pose_move(arm: ServedArm, goal: Pose) -> Callable[[], Trajectory]:
    """Move all joints from the setpoint to those of a pose, as `joint_move`: a dVRK's tool, too, goes no straight line.

    [jhu-dvrk/sawIntuitiveResearchKit: mtsIntuitiveResearchKitArm::control_move_cp]
    """
    return joint_move(arm, arm.tool.joints(goal, arm.setpoint.q, steps=_GOAL_STEPS))


def _bounds(arm: ServedArm) -> tuple[Floats, Floats]:
    units = arm.plant.joint_units
    speed = arm.settings.speed_ratio * np.array([_SPEED[unit] for unit in units])
    return speed, arm.settings.acceleration_ratio * np.array([_ACCELERATION[unit] for unit in units])


_REFUSED_FROM_M = 0.075  # [m] from the setpoint: the RAVEN-II refuses a servo_cp beyond
_CLIPPED_TO_M = 0.015  # [m] a servo_cp goes at most


def servo_pose(arm: ServedArm, pose: Pose) -> None:
    """Go towards a pose: refused beyond 75 mm from the setpoint, and at most 15 mm of the way."""
    start = arm.tool.pose(arm.setpoint.q)
    way = pose.position - start.position
    distance = float(np.linalg.norm(way))
    if distance > _REFUSED_FROM_M:
        raise InputError(
            f"servo_cp: {1e3 * distance:.1f} mm from the setpoint, expected at most {1e3 * _REFUSED_FROM_M:.0f}"
        )
    if distance > _CLIPPED_TO_M:
        share = _CLIPPED_TO_M / distance
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
