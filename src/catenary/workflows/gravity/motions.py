"""Motions for the tests of gravity compensation, by name, for any arm."""

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from catenary.arrays import Floats, as_array
from catenary.errors import InputError
from catenary.plant import Bounded
from catenary.robots.model import RobotModel
from catenary.trajectories.cartesian import AMPLITUDE, CartesianSinusoids
from catenary.trajectories.reference import InTurn, Rest, Trajectory
from catenary.workflows.robot.motion import gentle_way, random_within, range_of

MOTIONS = ("cartesian", "random", "poses")
# where the published sinusoids of 3.1 inch find room to every side [rad, rad, m]
RAVEN_START = (0.8, 1.6, 0.3)
# away from the stops, with some way to fall to either side, and where gravity at the angles that are tried is not by
# chance what joint 1 carries on a level base [rad, rad, m]
HOLD_START = (1.0, 1.6, 0.4)
POSES = 6
REST = 1.5  # [s] at a pose
WATCHED = 0.7  # [s] of it, at its end: the arm has come to rest


class Motion(NamedTuple):
    """A motion, and the times in it at which an arm's errors count."""

    trajectory: Trajectory
    windows: Sequence[tuple[float, float]] | None  # [s] from, to; all of it when None


def make_motion(
    name: str,
    model: RobotModel,
    limits: Bounded,
    rng: np.random.Generator,
    *,
    q_start: ArrayLike | None = None,
    amplitude: float = AMPLITUDE,
    axes: Sequence[str] = ("x", "y", "z"),
    seconds: float = 20.0,
) -> Motion:
    """Return a motion of all joints by name.

    Args:
        name: "cartesian", the paper's sinusoids of the tip along `axes` of the base by an amplitude [m]; "random", each
            joint by itself over half of its range for some seconds; "poses", at rest at POSES positions along the first
            joint's range.
        limits: Its plant or itself: the joint limits to keep.
        q_start: (n,) where cartesian begins, and where the other joints of poses stand [rad|m]; RAVEN_START, or the
            middle of the range, when None.
    """
    if name not in MOTIONS:
        raise InputError(f'motion "{name}": expected one of {", ".join(MOTIONS)}')
    if name == "random":
        return Motion(random_within(limits, seconds, rng), None)
    start = start_pose(model, limits) if q_start is None else as_array("q_start", q_start, (model.n,))
    if name == "cartesian":
        return Motion(CartesianSinusoids(model, start, amplitude=amplitude, axes=axes), None)
    lower, upper = range_of(limits)
    edge = 0.05 * (upper[0] - lower[0])
    return poses_along(limits, 0, np.linspace(lower[0] + edge, upper[0] - edge, POSES), start)


def poses_along(limits: Bounded, joint: int, positions: ArrayLike, q: ArrayLike) -> Motion:
    """Return a motion that rests at K positions of a joint, one after the other, the other joints at q (n,) [rad|m].

    The last WATCHED seconds of each rest count.
    """
    n = len(limits.joint_names)
    rows = np.tile(as_array("q", q, (n,)), (len(as_array("positions", positions, (None,))), 1))
    rows[:, joint] = positions
    parts: list[Trajectory] = [Rest(rows[0], REST)]
    windows = [(REST - WATCHED, REST)]
    end = REST
    for before, row in pairwise(rows):
        way = gentle_way(before, row, limits.joint_units)
        parts += [way, Rest(row, REST)]
        end += way.duration + REST
        windows.append((end - WATCHED, end))
    return Motion(InTurn(parts), windows)


def start_pose(model: RobotModel, limits: Bounded, raven: tuple[float, ...] = RAVEN_START) -> Floats:
    """Return where an arm starts, (n,) [rad|m]: a RAVEN-II at `raven`, others in the middle of their ranges."""
    if model.closed_form == "raven2" and model.n == len(raven):
        return np.array(raven)
    lower, upper = range_of(limits, "; give --q")
    return 0.5 * (lower + upper)
