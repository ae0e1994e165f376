"""Fallback of gravity when samples stop: mean direction of gravity, and rate-limited transfer between sources."""

import math

import numpy as np

from catenary.arrays import Floats
from catenary.kernels.compiled import compiled
from catenary.spatial import LEVEL, STANDARD_GRAVITY, cross


class SlowAttitude:
    """Low-pass filter of gravity's direction over seconds: the mean attitude of a base that rocks or vibrates."""

    def __init__(self, time_constant: float) -> None:
        """Set the time constant [s] of a first-order low-pass."""
        self._time_constant = time_constant
        self._mean = LEVEL.copy()
        self._newest = -np.inf

    def add(self, stamp: float, gravity: Floats) -> None:
        """Add an accepted sample (3,) [m/s2]."""
        dt = stamp - self._newest
        share = 1.0 if not np.isfinite(dt) else 1.0 - np.exp(-dt / self._time_constant)
        self._mean += share * (gravity - self._mean)
        self._newest = stamp

    def turn(self, angle: Floats) -> None:
        """Rotate the mean with a base that has turned by a small angle (3,) [rad] about its own axes."""
        self._mean = self._mean - cross(angle, self._mean)

    def gravity(self) -> Floats:
        """Return gravity (3,) of standard length along the mean direction; that of a level base before any sample."""
        length = np.linalg.norm(self._mean)
        return self._mean * (STANDARD_GRAVITY / length) if length > 1.0 else LEVEL.copy()


class SmoothTransfer:
    """Follow targets with limited rates: bumpless transfer between sources.

    The output is the target plus an offset. The offset absorbs a change of source, and in each tick whatever exceeds
    `follow` dt; it decays at the rate `recover`. So an output changes by at most (follow + recover) dt in a tick, and
    by the target's own motion and `recover` dt when sources change.
    """

    def __init__(self, follow: Floats, recover: Floats) -> None:
        """Set the largest rates at which k targets are followed, and those at which offsets decay, (k,) [unit/s]."""
        self._rates = np.array([follow, recover])
        self._offset = np.zeros((len(follow), 3))
        self._target: Floats | None = None
        self.behind = 0.0  # distance of the first output from its target

    def follow(self, targets: Floats, dt: float, *, changed: bool) -> Floats:
        """Return outputs (k, 3) for targets (k, 3), dt [s] after the last; `changed`: targets have another source."""
        if self._target is None:
            self._target, self._offset = targets.copy(), np.zeros_like(targets)
        out = np.empty_like(targets)
        self.behind = _follow(self._rates, targets, dt, changed, self._target, self._offset, out)
        return out

    def restart(self) -> None:
        """Start the next transfer at its targets, without an offset."""
        self._target = None


@compiled
def _follow(
    rates: Floats, targets: Floats, dt: float, changed: bool, before: Floats, offset: Floats, out: Floats
) -> float:
    """Write outputs (k, 3), previous targets and offsets; return the length of the first offset."""
    for k in range(len(targets)):
        moved = targets[k] - before[k]
        offset[k] -= moved * _share_beyond(0.0 if changed else rates[0, k] * dt, moved)
        offset[k] *= _share_beyond(rates[1, k] * dt, offset[k])
        out[k] = targets[k] + offset[k]
        before[k] = targets[k]
    return math.hypot(math.hypot(offset[0, 0], offset[0, 1]), offset[0, 2])


@compiled
def _share_beyond(allowed: float, vector: Floats) -> float:
    """Return the share of a vector (3,) beyond an allowed length."""
    length = math.sqrt(vector[0] ** 2 + vector[1] ** 2 + vector[2] ** 2)
    return max(0.0, 1.0 - allowed / max(length, 1e-300))
