"""What takes the place of gravity that is no longer measured, and how to get there without a jolt."""

from typing import Literal, get_args

import numpy as np

from catenary.arrays import Floats
from catenary.errors import InputError
from catenary.kernels.compiled import compiled
from catenary.spatial import LEVEL, STANDARD_GRAVITY

# hold: the last vector; fade: gravity along the mean direction of the last seconds; static: of a level base;
# stop: the last vector, and the robot is stopped
Fallback = Literal["hold", "fade", "static", "stop"]
FALLBACKS: tuple[str, ...] = get_args(Fallback)


def as_fallback(value: str) -> Fallback:
    """Give a fallback by its name.

    Raises:
        InputError: There is none of that name.
    """
    if value not in FALLBACKS:
        raise InputError(f'fallback "{value}": expected one of {", ".join(FALLBACKS)}')
    return value  # type: ignore[return-value]  # just checked


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

    def gravity(self) -> Floats:
        """Gravity (3,) of standard length along the mean direction; that of a level base before any sample."""
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
        self._rates = np.stack([follow, recover], axis=1)
        k = len(follow)
        self._target, self._offset = np.zeros((k, 3)), np.zeros((k, 3))
        self._begun = False

    def follow(self, targets: Floats, dt: float, out: Floats, *, changed: bool) -> None:
        """Write outputs (k, 3), dt [s] after the last; `changed` when targets come from elsewhere than before."""
        if not self._begun:
            self._target[:] = targets
            self._offset[:] = 0.0
            self._begun = True
        _follow(self._rates, self._target, self._offset, targets, dt, changed, out)

    def restart(self) -> None:
        """Take the next targets as they are."""
        self._begun = False

    @property
    def settled(self) -> bool:
        """The output is on its target."""
        return not self._offset.any()


@compiled
def _follow(
    rates: Floats, last: Floats, offset: Floats, targets: Floats, dt: float, changed: bool, out: Floats
) -> None:
    for k in range(len(targets)):
        step = 0.0
        for axis in range(3):
            step += (targets[k, axis] - last[k, axis]) ** 2
        step = np.sqrt(step)
        allowed = 0.0 if changed else rates[k, 0] * dt
        share = 1.0 - allowed / step if step > allowed else 0.0
        length = 0.0
        for axis in range(3):
            offset[k, axis] -= share * (targets[k, axis] - last[k, axis])
            last[k, axis] = targets[k, axis]
            length += offset[k, axis] ** 2
        length = np.sqrt(length)
        fade = rates[k, 1] * dt
        keep = 1.0 - fade / length if length > fade else 0.0
        for axis in range(3):
            offset[k, axis] *= keep
            out[k, axis] = targets[k, axis] + offset[k, axis]
