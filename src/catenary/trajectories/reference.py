"""Interface of joint trajectories, and compositions: in sequence, resumed, of a subset of joints, at rest."""

from abc import ABC, abstractmethod
from bisect import bisect_right
from collections.abc import Sequence
from itertools import accumulate
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike

from catenary.arrays import Floats, as_array
from catenary.errors import InputError


class Reference(NamedTuple):
    """Desired joint state at one instant.

    Attributes:
        q: (n,) positions [rad|m].
        qd: (n,) velocities [rad/s|m/s].
        qdd: (n,) accelerations [rad/s2|m/s2].

    Examples:
        >>> catenary.Reference(np.array([0.1]), np.zeros(1), np.zeros(1)).q
        array([0.1])
    """

    q: Floats
    qd: Floats
    qdd: Floats


class Trajectory(Protocol):
    """Motion from rest to rest: before it the joints are at its start, after it at its end.

    Position and velocity are continuous; `qd` is the derivative of `q`, and `qdd` that of `qd`.
    """

    @property
    def duration(self) -> float: ...  # noqa: D102  [s]

    def __call__(self, t: float) -> Reference:
        """Return the reference at `t` [s] after the start."""

    def sample(self, times: ArrayLike) -> tuple[Floats, Floats, Floats]:
        """Return references at many times (N,) [s]: q, qd, qdd, each (N, n)."""


class SampledTrajectory(ABC):
    """Base class of trajectories that are evaluated at arrays of times."""

    duration: float  # [s] until all joints are at rest again

    def __call__(self, t: float) -> Reference:
        """Return the reference at `t` [s] after the start."""
        q, qd, qdd = self.sample(as_array("t", t, ()).reshape(1))
        return Reference(q[0], qd[0], qdd[0])

    @abstractmethod
    def sample(self, times: ArrayLike) -> tuple[Floats, Floats, Floats]:
        """Return references at many times (N,) [s]: q, qd, qdd, each (N, n)."""


_LEAD_S = 1.0  # [s] from rest to a motion's own speed


class GoneOn(SampledTrajectory):
    """A motion resumed at an instant: from rest, along the half second before it, accelerating to the motion's speed.

    So cables and gears reach that instant in the same state as in the whole motion.
    """

    def __init__(self, motion: Trajectory, begin: float) -> None:
        """Resume a motion at `begin` [s], 0 to its duration."""
        if not 0.0 <= begin <= motion.duration:
            raise InputError(f"begin: expected 0 to {motion.duration:g} s, got {begin:g}")
        self._motion, self.begin = motion, begin
        self.lead = min(_LEAD_S, 2.0 * begin)  # [s] until it is at `begin`
        self.duration = self.lead + motion.duration - begin

    def sample(self, times: ArrayLike) -> tuple[Floats, Floats, Floats]:
        """Return references at many times (N,) [s]."""
        t = as_array("times", times, (None,))
        u = np.clip(t / self.lead, 0.0, 1.0) if self.lead else np.ones(len(t))
        # relative speed: 3 u^2 - 2 u^3
        place = self.begin - 0.5 * self.lead + self.lead * (u**3 - 0.5 * u**4) + np.maximum(t - self.lead, 0.0)
        pace = (3.0 * u**2 - 2.0 * u**3)[:, np.newaxis]
        rise = (6.0 * u * (1.0 - u) / self.lead if self.lead else np.zeros(len(t)))[:, np.newaxis]
        q, qd, qdd = self._motion.sample(place)
        return q, qd * pace, qdd * pace**2 + qd * rise


_NEAR = 1e-9  # [rad|m] rounding, between the end of one motion and the start of the next


class Rest(SampledTrajectory):
    """Rest at a joint position (n,) [rad|m] for a duration [s], 0 or more."""

    def __init__(self, q: ArrayLike, duration: float) -> None:
        self._q = as_array("q", q, (None,)).copy()
        self.duration = float(as_array("duration", duration, ()))
        if self.duration < 0.0:
            raise InputError(f"duration: expected zero or more seconds, got {duration}")

    def sample(self, times: ArrayLike) -> tuple[Floats, Floats, Floats]:
        """Return references at many times (N,) [s], all the same: q, qd, qdd, each (N, n)."""
        rows = len(as_array("times", times, (None,)))
        q = np.tile(self._q, (rows, 1))
        return q, np.zeros_like(q), np.zeros_like(q)


class InTurn:
    """Trajectories in sequence, each starting where the last one ended."""

    def __init__(self, parts: Sequence[Trajectory]) -> None:
        """Join trajectories; refuse those that do not connect."""
        if not parts:
            raise InputError("parts: expected at least one trajectory")
        for k in range(1, len(parts)):
            end, start = parts[k - 1](parts[k - 1].duration).q, parts[k](0.0).q
            if len(end) != len(start) or not (np.abs(end - start) <= _NEAR).all():
                raise InputError(
                    f"parts: number {k + 1} begins at {start.tolist()}, the one before it ends at {end.tolist()}"
                )
        self._parts = list(parts)
        ends = list(accumulate(part.duration for part in parts))
        self.starts = (0.0, *ends[:-1])  # [s] of the parts
        self.duration = ends[-1]  # [s] of all parts

    def __call__(self, t: float) -> Reference:
        """Return the reference at `t` [s]."""
        at = float(as_array("time", t, ()))
        k = max(0, bisect_right(self.starts, at) - 1)
        return self._parts[k](self._local(k, at))

    def sample(self, times: ArrayLike) -> tuple[Floats, Floats, Floats]:
        """Return references at many times (N,) [s]: q, qd, qdd, each (N, n)."""
        at = as_array("times", times, (None,))
        which = np.maximum(np.searchsorted(self.starts, at, side="right") - 1, 0)
        n = len(self._parts[0](0.0).q)
        out = np.empty((3, len(at), n))
        for k in np.unique(which):
            rows = which == k
            local = [self._local(k, t) for t in at[rows]]
            for whole, part in zip(out, self._parts[k].sample(local), strict=True):
                whole[rows] = part
        return out[0], out[1], out[2]

    def _local(self, k: int, t: float) -> float:
        """Return the time since the start of part k; at the end of all, exactly its duration, free of rounding."""
        return self._parts[k].duration if t >= self.duration else t - self.starts[k]


class Embedded(SampledTrajectory):
    """Trajectory of some of a robot's joints, the others at rest.

    Args:
        trajectory: Of m joints.
        joints: Indices of these m joints among the robot's n, all different.
        q_hold: (n,) positions of the joints at rest [rad|m].
    """

    def __init__(self, trajectory: Trajectory, joints: Sequence[int], q_hold: ArrayLike) -> None:
        self._trajectory, self._joints, self.duration = trajectory, list(joints), trajectory.duration
        self._hold = as_array("q_hold", q_hold, (None,)).copy()
        moving, n = len(trajectory(0.0).q), len(self._hold)
        if not len(self._joints) == len({*self._joints} & {*range(n)}) == moving:
            raise InputError(f"joints: expected {moving} different ones of the robot's {n}, got {self._joints}")

    def sample(self, times: ArrayLike) -> tuple[Floats, Floats, Floats]:
        """Return references of all joints at many times (N,) [s]: q, qd, qdd, each (N, n)."""
        parts = self._trajectory.sample(times)
        full = np.zeros((3, len(parts[0]), len(self._hold)))
        full[0] = self._hold
        full[:, :, self._joints] = parts
        return full[0], full[1], full[2]
