"""Motions that somebody picks on the page, each from wherever the arm is."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from catenary.arrays import Floats
from catenary.plant import Bounded
from catenary.robots.catalog import RAVEN_SIDES
from catenary.robots.model import RobotModel
from catenary.trajectories.reference import InTurn, Trajectory
from catenary.trajectories.sinusoids import random_sinusoids
from catenary.trajectories.smoothed_path import follow_waypoints
from catenary.trajectories.zigzag import zigzag
from catenary.view.shown import WIDEST
from catenary.view.steering import Motion
from catenary.workflows.gravity.motions import make_motion
from catenary.workflows.robot.motion import GENTLE_ACCELERATION, GENTLE_VELOCITY, check_motion, gentle_way

QUICKER = 2.5  # than a gentle go-to, which is for real robots
SECONDS = 60.0  # of a random motion, after which the next one is drawn
SPARSITY = 0.25  # of RAVEN-II's zig-zag
SWEEPS = 5  # of other robots' zig-zag
SWEPT = 0.25  # of a joint's range, to either side of its middle


class FiniteRanges(NamedTuple):
    """Joints and ranges to move them in: their limits, or so far to either side of zero where they have none."""

    joint_names: tuple[str, ...]
    joint_units: tuple[str, ...]
    lower: Floats  # (n,) [rad|m]
    upper: Floats  # (n,)


def finite_ranges(limits: Bounded) -> FiniteRanges:
    """Return ranges of joints, all of them finite."""
    widest = np.array([WIDEST[unit] for unit in limits.joint_units])
    lower = np.where(np.isfinite(limits.lower), limits.lower, -widest)
    upper = np.where(np.isfinite(limits.upper), limits.upper, widest)
    return FiniteRanges(limits.joint_names, limits.joint_units, lower, upper)


def way_to(limits: Bounded, goal: Floats) -> Motion:
    """Return the motion to joint positions (n,) [rad|m]."""
    return lambda q: quick_way(limits, q, goal)


def quick_way(limits: Bounded, start: Floats, goal: Floats) -> Trajectory:
    """Return the way from one place to another, each (n,) [rad|m], all joints arriving together."""
    units = limits.joint_units
    velocity = [QUICKER * GENTLE_VELOCITY[unit] for unit in units]
    acceleration = [QUICKER * GENTLE_ACCELERATION[unit] for unit in units]
    return gentle_way(start, goal, units, max_velocity=velocity, max_acceleration=acceleration)


def random_motions(model: RobotModel, limits: Bounded, rng: np.random.Generator) -> Motion:
    """Return random motions, one after the other: in a RAVEN-II's calibration box, or in the middle of the ranges."""
    ranges = finite_ranges(limits)

    def draw() -> Trajectory:
        if model.name in RAVEN_SIDES:
            return random_sinusoids(rng, SECONDS)
        return make_motion("random", model, ranges, rng, seconds=SECONDS).trajectory

    return _after_the_way(limits, draw)


def zigzags(model: RobotModel, limits: Bounded) -> Motion:
    """Return RAVEN-II's calibration zig-zag along joints 2 and 3, or sweeps of another robot's first joints."""
    if model.name in RAVEN_SIDES:
        motion: Trajectory = zigzag("J2-J3", (SPARSITY,))
    else:
        motion = follow_waypoints(
            _sweeps(finite_ranges(limits)),
            speed=[QUICKER * GENTLE_VELOCITY[unit] for unit in limits.joint_units],
        )
    check_motion(limits, motion)
    return _after_the_way(limits, lambda: motion)


def _sweeps(ranges: FiniteRanges) -> Floats:
    """Return rows (N, n) [rad|m] that sweep the last of the first three joints, and step the one before it."""
    middle, half = 0.5 * (ranges.lower + ranges.upper), SWEPT * (ranges.upper - ranges.lower)
    swept = min(2, len(middle) - 1)
    stepped = max(swept - 1, 0)
    rows = np.tile(middle, (2 * SWEEPS, 1))
    rows[:, stepped] = (middle - half)[stepped] + np.repeat(np.linspace(0.0, 2.0, SWEEPS), 2) * half[stepped]
    side = np.array([-1.0, 1.0, 1.0, -1.0])
    rows[:, swept] = middle[swept] + half[swept] * np.resize(side, len(rows))
    return rows


def _after_the_way(limits: Bounded, draw: Callable[[], Trajectory]) -> Motion:
    def begin(q: Floats) -> Trajectory:
        motion = draw()
        return InTurn([quick_way(limits, q, motion(0.0).q), motion])

    return begin
