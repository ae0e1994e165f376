"""The mean direction of gravity, for when it is not measured any more, and transfers without a jolt."""

import math

import numpy as np

from catenary.arrays import Floats
from catenary.kernels.compiled import compiled
from catenary.spatial import LEVEL, STANDARD_GRAVITY, cross


class SlowAttitude:
    """Direction of gravity, averaged over seconds: where a base that rocks or shakes stands in the mean."""

    def __init__(self, time_constant: float) -> None:
        """Take the time constant of the average [s], a first-order low-pass."""
        self._time_constant = time_constant
        self._mean = LEVEL.copy()
        self._newest = -np.inf

    def add(self, stamp: float, gravity: Floats) -> None:
        """Take a believed sample (3,) [m/s2]."""
        dt = stamp - self._newest
        share = 1.0 if not np.isfinite(dt) else 1.0 - np.exp(-dt / self._time_constant)
        self._mean += share * (gravity - self._mean)
        self._newest = stamp

    def turn(self, angle: Floats) -> None:
        """Turn along with a base that has turned by an angle (3,) [rad], small, about its own axes."""
        self._mean = self._mean - cross(angle, self._mean)

    def gravity(self) -> Floats:
        """Return gravity (3,) of standard length along the mean direction; that of a level base before any sample."""
        length = np.linalg.norm(self._mean)
        return self._mean * (STANDARD_GRAVITY / length) if length > 1.0 else LEVEL.copy()


class SmoothTransfer:
    """Follows targets as they move, but never as they leap.

    The output is the target plus an offset. When the source of the target changes, the offset takes the leap up;
    in any tick it takes up what exceeds `follow` times dt; and it dies away at the rate `recover`. So an output
    changes by at most (follow + recover) dt in a tick whatever happens, and by the target's own motion and
    `recover` dt where sources change.
    """

    def __init__(self, follow: Floats, recover: Floats) -> None:
        """Take the rates of each of the targets (k,), per second."""
        self._rates = np.array([follow, recover])
        self._offset = np.zeros((len(follow), 3))
        self._target: Floats | None = None
        self.behind = 0.0  # how far the first output still is from its target

    def follow(self, targets: Floats, dt: float, *, changed: bool) -> Floats:
        """Return outputs (k, 3), dt [s] after the last; `changed` when targets come from elsewhere than before."""
        if self._target is None:
            self._target, self._offset = targets.copy(), np.zeros_like(targets)
        out = np.empty_like(targets)
        self.behind = _follow(self._rates, targets, dt, changed, self._target, self._offset, out)
        return out

    def restart(self) -> None:
        """Take the next targets as they are."""
        self._target = None


@compiled
def _follow(
    rates: Floats, targets: Floats, dt: float, changed: bool, before: Floats, offset: Floats, out: Floats
) -> float:
    """Write outputs (k, 3), and what targets and offsets are; return the first one's offset."""
    for k in range(len(targets)):
        moved = targets[k] - before[k]
        offset[k] -= moved * _share_beyond(0.0 if changed else rates[0, k] * dt, moved)
        offset[k] *= _share_beyond(rates[1, k] * dt, offset[k])
        out[k] = targets[k] + offset[k]
        before[k] = targets[k]
    return math.hypot(math.hypot(offset[0, 0], offset[0, 1]), offset[0, 2])


@compiled
def _share_beyond(allowed: float, vector: Floats) -> float:
    """Return the share of a vector (3,) that exceeds an allowed length."""
    length = math.sqrt(vector[0] ** 2 + vector[1] ** 2 + vector[2] ** 2)
    return max(0.0, 1.0 - allowed / max(length, 1e-300))
