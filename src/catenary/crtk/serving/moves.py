"""Moves of a served arm: from rest to rest, in joints or along a line, and Cartesian steps of both dialects."""

from collections.abc import Callable, Iterator
from functools import partial

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from catenary.arrays import Floats, as_array
from catenary.crtk.serving.served_arm import ServedArm
from catenary.errors import InputError
from catenary.spatial import Pose, rotation_from_vector, rotation_vector
from catenary.trajectories.reference import SampledTrajectory, Trajectory
from catenary.trajectories.smoothed_path import go_to

# a third of what a setpoint may do, and there in half a second
_SPEED = {"rad": 0.8, "m": 0.016}  # [rad/s], [m/s]
_ACCELERATION = {"rad": 1.6, "m": 0.032}  # [rad/s2], [m/s2]
_SPACING_M = 0.002  # [m] of poses along a line
_SPACING_RAD = 0.02  # [rad] likewise
_PIECES = 256  # half a metre; farther ones are longer, so that a message sizes no array
_LEAST_SLOPE = 1e-3  # [rad|m] least slope of a way, so that one without any ends too


def joint_move(arm: ServedArm, q: Floats) -> Callable[[], Trajectory]:
    """Move all joints from the setpoint to q (n,), arriving together; what is returned makes the trajectory."""
    arm.require_inside(q)
    velocity, acceleration = _bounds(arm)
    return partial(go_to, arm.setpoint.q, q, max_velocity=velocity, max_acceleration=acceleration)


def straight_move(arm: ServedArm, goal: Pose) -> Iterator[Trajectory | None]:
    """Move the tool along a straight line to a pose, turning it evenly; a goal out of reach is refused at once.

    The rest is worked out a piece each time that the iterator is asked, which gives None until it gives the trajectory.
    """
    arm.tool.require_reach(goal)
    return _planned(arm, arm.setpoint.q, goal)


def _planned(arm: ServedArm, q: Floats, goal: Pose) -> Iterator[Trajectory | None]:
    tool = arm.tool
    if tool.model.closed_form is not None:
        # others are searched along the way, and might not get there in one go
        tool.joints(goal, q)
        yield None
    start = tool.pose(q)
    way, turn = goal.position - start.position, rotation_vector(start.rotation.T @ goal.rotation)
    pieces = max(np.linalg.norm(way) / _SPACING_M, np.linalg.norm(turn) / _SPACING_RAD)
    count = min(max(4, int(np.ceil(pieces))), _PIECES)
    shares = np.arange(1, count + 1)[:, np.newaxis] / count
    rotations = start.rotation @ Rotation.from_rotvec(shares * turn).as_matrix()
    positions = start.position + shares * way
    yield None
    found = [q[np.newaxis]]
    for k in range(0, count, tool.poses_a_tick):
        piece = slice(k, k + tool.poses_a_tick)
        found.append(tool.path(rotations[piece], positions[piece], found[-1][-1]))
        yield None
    yield from _along(np.vstack(found), *_bounds(arm))


def _bounds(arm: ServedArm) -> tuple[Floats, Floats]:
    units = arm.plant.joint_units
    speed = arm.settings.speed_ratio * np.array([_SPEED[unit] for unit in units])
    return speed, arm.settings.acceleration_ratio * np.array([_ACCELERATION[unit] for unit in units])


def _along(rows: Floats, velocity: Floats, acceleration: Floats) -> Iterator[Trajectory | None]:
    shares = np.linspace(0.0, 1.0, len(rows))
    path = CubicSpline(shares, rows)
    yield None
    dense = np.linspace(0.0, 1.0, 4 * len(rows))
    steepest, bent = (np.abs(path(dense, order)).max(axis=0) + _LEAST_SLOPE for order in (1, 2))
    # half of the acceleration for the bends of the way, half for getting faster along it
    fastest = min(float((velocity / steepest).min()), float(np.sqrt(0.5 * acceleration / bent).min()))
    soonest = float((0.5 * acceleration / steepest).min())
    yield None
    yield _AlongRows(path, go_to([0.0], [1.0], max_velocity=[fastest], max_acceleration=[soonest]))


class _AlongRows(SampledTrajectory):
    """Runs along a path over [0, 1] from rest to rest."""

    def __init__(self, path: CubicSpline, share: Trajectory) -> None:
        self._path, self._share, self.duration = path, share, share.duration

    def sample(self, times: ArrayLike) -> tuple[Floats, Floats, Floats]:
        """Return references at many times, each (N, n)."""
        s, speed, quickening = self._share.sample(times)
        place = np.clip(s[:, 0], 0.0, 1.0)
        slope, bend = self._path(place, 1), self._path(place, 2)
        return self._path(place), slope * speed, bend * speed**2 + slope * quickening


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
