"""Go-to: from one joint position to another within bounded velocity and acceleration."""

import numpy as np
from numpy.typing import ArrayLike

from catenary.arrays import as_array, as_positive
from catenary.trajectories.smoothed_path import PEAK, BrokenLine, SmoothedPath


def go_to(
    q_start: ArrayLike,
    q_goal: ArrayLike,
    *,
    max_velocity: ArrayLike,
    max_acceleration: ArrayLike,
    together: bool = True,
) -> SmoothedPath:
    """Return the shortest smooth motion from rest at one joint position to rest at another.

    The velocity rises and falls as a smoothstep over 3/2 v/a and is constant between; where the way is too
    short to reach max_velocity v it turns to fall at once, at the greatest speed that acceleration a allows.

    Args:
        q_start: (n,) [rad or m].
        q_goal: (n,) [rad or m].
        max_velocity: (n,) bound, positive [rad/s or m/s].
        max_acceleration: (n,) bound, positive [rad/s2 or m/s2].
        together: All joints arrive at the same time, on a straight line in joint space; otherwise each joint
            takes its own shortest time.

    Raises:
        InputError: An argument has another shape, is not finite, or a bound is not positive.
    """
    start = as_array("q_start", q_start, (None,))
    n = len(start)
    goal = as_array("q_goal", q_goal, (n,))
    velocity = as_positive("max_velocity", max_velocity, (n,))
    acceleration = as_positive("max_acceleration", max_acceleration, (n,))
    way = np.abs(goal - start)
    moving = way > 0.0
    if together and moving.any():
        # as one coordinate from 0 to 1, bounded by the joint that needs the most time
        ways, slowest = way[moving], (velocity[moving], acceleration[moving])
        time, blend = _fastest(1.0, *(float((bound / ways).min()) for bound in slowest))
        times, blends = np.full(n, time), np.full(n, blend)
    else:
        times, blends = np.zeros(n), np.ones(n)
        for j in np.flatnonzero(moving):
            times[j], blends[j] = _fastest(way[j], velocity[j], acceleration[j])
    return SmoothedPath(
        [
            BrokenLine([0.0, times[j]], [start[j], goal[j]], blends[j])
            if moving[j]
            else BrokenLine([0.0], [start[j]], 1.0)
            for j in range(n)
        ]
    )


def _fastest(way: float, velocity: float, acceleration: float) -> tuple[float, float]:
    """Return the time of the line and of the blend that cover a way [s]; the motion takes their sum."""
    # at this speed or below, the line takes at least a blend: only then does the motion reach its speed
    speed = min(velocity, np.sqrt(way * acceleration / PEAK))
    return way / speed, min(PEAK * speed / acceleration, way / speed)
