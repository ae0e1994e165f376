"""Checks, before anything is fitted, that a recording can be of this robot, in rad, m and s."""

import numpy as np

from catenary.arrays import Floats
from catenary.errors import InputError
from catenary.plant import MotionLog
from catenary.robots.model import RobotModel

LARGEST = {"rad": 6.0 * np.pi, "m": 5.0}  # beyond these a coordinate without limits is no rad and no m
MARGIN = 0.25  # of its range by which a coordinate may leave its limits
FAITHFUL = 0.5  # least correlation of a velocity with the derivative of its position
MOVING = {"rad": 0.02, "m": 0.005}  # RMS [rad/s, m/s] below which a velocity may be noise alone
SLOPES = (0.6, 1.6)  # of a velocity on that derivative; filtered velocities of real arms reach 0.8


def checked_log(log: MotionLog, model: RobotModel) -> MotionLog:
    """Return a recording with its joints in the robot's order, refused where its torques or positions cannot be it.

    Raises:
        InputError: Other joints or units, no torques, or positions that seem to be in other units; the message names
            the recording, the joint and what it looks like.
    """
    where = f'recording "{log.name}"'
    log = log.in_order_of(model, of=f'robot "{model.name}" has')
    if log.tau is None:
        raise InputError(f"{where}: has no torques (`tau`), which dynamics are identified from")
    for i, (name, unit) in enumerate(zip(model.joint_names, model.joint_units, strict=True)):
        q = log.q_nominal[:, i]
        low, high = model.lower[i], model.upper[i]
        if np.isfinite(high - low):
            slack = MARGIN * (high - low)
            low, high = low - slack, high + slack
        else:
            low, high = -LARGEST[unit], LARGEST[unit]
        if float(np.min(q)) < low or float(np.max(q)) > high:
            wrong = "degrees" if unit == "rad" else "mm"
            raise InputError(
                f"{where}: joint {name} goes from {np.min(q):.4g} to {np.max(q):.4g}, expected {unit} between "
                f"{low:.4g} and {high:.4g}: is it in {wrong}, or another joint's?"
            )
    return log


def check_rates(where: str, model: RobotModel, derivative: Floats, qd: Floats) -> None:
    """Refuse velocities that are not those of the positions.

    Args:
        where: Opens the message.
        model: The robot.
        derivative: (N, n) derivative of the positions.
        qd: (N, n) recorded velocities, filtered in the same way.

    Raises:
        InputError: Another joint's velocity, or one in another unit or at another sampling rate.
    """
    own = derivative - derivative.mean(axis=0)
    given = qd - qd.mean(axis=0)
    size, given_size = np.linalg.norm(own, axis=0), np.linalg.norm(given, axis=0)
    least = np.array([MOVING[unit] for unit in model.joint_units]) * np.sqrt(len(qd))
    moving = (size > least) & (given_size > 0.0)
    with np.errstate(invalid="ignore", divide="ignore"):
        correlation = own.T @ given / size[:, None] / given_size
    for i in np.flatnonzero(moving):
        name = model.joint_names[i]
        if correlation[i, i] < FAITHFUL:
            others = np.where(moving, correlation[:, i], -1.0)
            best = int(np.argmax(others))
            follows = f"; it follows joint {model.joint_names[best]}: swapped axes?"
            hint = follows if others[best] > 0.9 else ""
            raise InputError(
                f"{where}: the velocity of joint {name} is not the derivative of its position "
                f"(correlation {correlation[i, i]:.2f}){hint}"
            )
        slope = float(own[:, i] @ given[:, i] / size[i] ** 2)
        if not SLOPES[0] < slope < SLOPES[1]:
            degrees = abs(slope / np.rad2deg(1.0) - 1.0) < 0.3
            hint = "degrees per second?" if degrees else "another unit, or another sampling rate than stated?"
            raise InputError(
                f"{where}: the velocity of joint {name} is {slope:.3g} times the derivative of its position: {hint}"
            )
