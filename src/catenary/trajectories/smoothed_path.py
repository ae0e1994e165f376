"""Smooth joint paths: piecewise linear motions with blended corners, point-to-point motions.

Each joint has its own piecewise linear path: corners at times t_k, constant speed between them. The motion is that path
averaged over a window of `blend` seconds,

    q(t) = integral of line(t + blend (1/2 - x)) w(x) over x in 0..1,    w(x) = 6 x (1 - x),

so at a corner the velocity changes over `blend` seconds as the smoothstep 3 x² - 2 x³ does: position, velocity
and acceleration are continuous. Since w is not negative and its integral is 1, the motion stays in the range of the
line: joint limits that hold for the corners hold for it, velocity limits too.
An isolated corner where the velocity jumps by dv is passed at a distance of 3/32 |dv| blend, and the acceleration
there reaches 3/2 |dv| / blend.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catenary.arrays import Floats, as_array, as_positive
from catenary.errors import InputError
from catenary.kernels.compiled import compiled
from catenary.trajectories.reference import SampledTrajectory

_PEAK_WEIGHT = 1.5  # largest value of w: acceleration / (velocity change / blend)


class BrokenLine(NamedTuple):
    """Piecewise linear path of one joint."""

    times: ArrayLike  # (K,) [s] increasing, from the start of the motion
    points: ArrayLike  # (K,) [rad|m]; a single point for a joint at rest
    blend: float  # [s] duration of the velocity change at a corner, positive


class _Lines(NamedTuple):
    """Lines of all joints, concatenated; joint j has the corners from first[j] to first[j + 1]."""

    first: NDArray[np.int64]  # (n + 1,)
    times: Floats  # [s]
    points: Floats  # [rad|m]
    slopes: Floats  # [rad/s|m/s] after each corner; 0 after a joint's last one
    blends: Floats  # (n,) [s]


class SmoothedPath(SampledTrajectory):
    """Trajectory along one piecewise linear path per joint, with blended corners."""

    def __init__(self, lines: Sequence[BrokenLine]) -> None:
        if not lines:
            raise InputError("lines: expected one for each joint, got none")
        times, points, slopes, blends = [], [], [], []
        for j, line in enumerate(lines):
            line_times = as_array(f"lines[{j}] times", line.times, (None,))
            line_points = as_array(f"lines[{j}] points", line.points, (len(line_times),))
            blend = float(as_positive(f"lines[{j}] blend", line.blend))
            steps = np.diff(line_times)
            if len(line_times) == 0 or not (steps > 0.0).all():
                raise InputError(f"lines[{j}] times: expected at least one, each later than the one before")
            times.append(line_times)
            points.append(line_points)
            slopes.append(np.append(np.diff(line_points) / steps, 0.0))
            blends.append(blend)
        first = np.concatenate([[0], np.cumsum([len(line) for line in times])])
        self._lines = _Lines(
            first, np.concatenate(times), np.concatenate(points), np.concatenate(slopes), np.array(blends)
        )
        moving = [line[-1] + blend for line, blend in zip(times, blends, strict=True) if len(line) > 1]
        self.duration = float(max(moving, default=0.0))

    @classmethod
    def through(cls, times: ArrayLike, points: ArrayLike, blend: float) -> SmoothedPath:
        """Return the path through common corners of all joints: times (K,) [s], points (K, n) [rad|m], blend [s]."""
        t = as_array("times", times, (None,))
        rows = as_array("points", points, (len(t), None))
        return cls([BrokenLine(t, column, blend) for column in rows.T])

    @property
    def corner_distance(self) -> Floats:
        """Largest distance of each joint from its corners, (n,) [rad|m], if these are at least a blend apart."""
        first, times, points, _, blends = self._lines
        largest = np.zeros(len(blends))
        for j, blend in enumerate(blends):
            own = slice(first[j], first[j + 1])
            q, _, _ = self.sample(times[own] + 0.5 * blend)
            largest[j] = np.abs(q[:, j] - points[own]).max()
        return largest

    def sample(self, times: ArrayLike) -> tuple[Floats, Floats, Floats]:
        """Return references at many times (N,) [s]: q, qd, qdd, each (N, n)."""
        t = as_array("times", times, (None,))
        q, qd, qdd = np.empty((3, len(t), len(self._lines.blends)))
        _evaluate_lines(self._lines, t, q, qd, qdd)
        return q, qd, qdd


@compiled
def _evaluate_lines(lines: _Lines, times: Floats, q: Floats, qd: Floats, qdd: Floats) -> None:
    for j in range(len(lines.blends)):
        first, last = lines.first[j], lines.first[j + 1] - 1
        blend = lines.blends[j]
        begin, end = lines.times[first], lines.times[last] + blend
        for i in range(len(times)):
            if first == last or not begin < times[i] < end:
                rests = last if times[i] >= end else first
                q[i, j], qd[i, j], qdd[i, j] = lines.points[rests], 0.0, 0.0
                continue
            opens = times[i] - blend  # the window reaches from here to times[i], in the line's own time
            here = times[i] - 0.5 * blend
            # the last corner before the window; first - 1 when all lie in it or after it
            k = first + np.searchsorted(lines.times[first : last + 1], opens, side="right") - 1
            if k < first:
                position, velocity = lines.points[first], 0.0
            else:
                velocity = lines.slopes[k]
                position = lines.points[k] + velocity * (here - lines.times[k])
            acceleration, slope = 0.0, velocity
            m = k + 1
            while m <= last and lines.times[m] < times[i]:
                dv = lines.slopes[m] - slope
                slope = lines.slopes[m]
                x = (times[i] - lines.times[m]) / blend
                position += dv * blend * x**3 * (1.0 - 0.5 * x)
                velocity += dv * x**2 * (3.0 - 2.0 * x)
                acceleration += dv / blend * 6.0 * x * (1.0 - x)
                m += 1
            q[i, j], qd[i, j], qdd[i, j] = position, velocity, acceleration


def go_to(
    q_start: ArrayLike, q_goal: ArrayLike, *, max_velocity: ArrayLike, max_acceleration: ArrayLike
) -> SmoothedPath:
    """Return the fastest smooth motion along a straight line in joint space, from rest to rest at `q_goal`.

    All joints arrive at the same time. The velocity rises and falls as a smoothstep over 3/2 v/a and is constant
    between; over short distances it does not reach the largest velocity v, and its peak follows from acceleration a.

    Args:
        q_start, q_goal: (n,) [rad|m].
        max_velocity, max_acceleration: (n,), positive [rad/s|m/s], [rad/s2|m/s2].

    Examples:
        >>> motion = catenary.go_to([0.0, 0.0], [0.5, 0.2], max_velocity=[1.0, 1.0], max_acceleration=[2.0, 2.0])
        >>> motion(motion.duration).q
        array([0.5, 0.2])
    """
    start = as_array("q_start", q_start, (None,))
    n = len(start)
    goal = as_array("q_goal", q_goal, (n,))
    velocity = as_positive("max_velocity", max_velocity, (n,))
    acceleration = as_positive("max_acceleration", max_acceleration, (n,))
    way = np.abs(goal - start)
    moving = way > 0.0
    if not moving.any():
        return SmoothedPath([BrokenLine([0.0], [q], 1.0) for q in start])
    # as one coordinate from 0 to 1, bounded by the joint that needs the most time
    v, a = (float((bound[moving] / way[moving]).min()) for bound in (velocity, acceleration))
    # at this speed or below, the line takes at least a blend: only then does the motion reach its speed
    speed = min(v, np.sqrt(a / _PEAK_WEIGHT))
    time, blend = 1.0 / speed, min(_PEAK_WEIGHT * speed / a, 1.0 / speed)
    return SmoothedPath(
        [
            BrokenLine([0.0, time], [start[j], goal[j]], blend) if moving[j] else BrokenLine([0.0], [start[j]], 1.0)
            for j in range(n)
        ]
    )
