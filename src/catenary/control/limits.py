"""Torque limits: saturation, slew rate, and a taper towards joint limits."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catenary.arrays import Floats, as_array, as_not_negative
from catenary.errors import InputError
from catenary.kernels.compiled import compiled


class TorqueLimits:
    """Bounds on every torque that is sent, applied per joint in this order.

    1. A torque that is NaN or infinite becomes zero, and so does that of a joint whose position is NaN or infinite.
    2. Within `taper` of a joint limit, torque towards the limit fades linearly to zero; torque away is unchanged.
    3. Saturation: -torque to torque.
    4. Slew: at most `slew` dt from the torque sent before. It comes last, so that a NaN or a limit causes no jump.

    `limited` and `not_finite` count ticks since `reset`.

    Examples:
        >>> limits = catenary.TorqueLimits(torque=[10.0, 5.0], slew=[100.0, 50.0])
    """

    def __init__(
        self,
        torque: ArrayLike,
        *,
        slew: ArrayLike | None = None,
        lower: ArrayLike | None = None,
        upper: ArrayLike | None = None,
        taper: ArrayLike | None = None,
    ) -> None:
        """Set the limits, (n,) each.

        Args:
            torque: Largest torque [Nm|N]; infinity for no limit.
            slew: Largest rate of change [Nm/s|N/s]; None for no limit.
            lower, upper: Joint limits in reported positions [rad|m].
            taper: Distance from a joint limit over which torque fades [rad|m]; zero or None for no fading.
        """
        self.torque = as_not_negative("torque", torque, (None,), finite=False)
        shape = self.torque.shape
        if taper is not None and (lower is None or upper is None):
            raise InputError("taper: expected the joint limits, lower and upper, too")

        def or_default(values: ArrayLike | None, missing: float) -> ArrayLike:
            return np.full(shape, missing) if values is None else values

        self.slew = as_not_negative("slew", or_default(slew, np.inf), shape, finite=False)
        self.taper = as_not_negative("taper", or_default(taper, 0.0), shape)
        self.lower = as_array("lower", or_default(lower, -np.inf), shape, finite=False)
        self.upper = as_array("upper", or_default(upper, np.inf), shape, finite=False)
        if not (self.lower <= self.upper).all():
            raise InputError(f"lower {self.lower.tolist()}: expected at most upper {self.upper.tolist()}")
        self._last = np.zeros(shape)
        self._counts = np.zeros(2, dtype=np.int64)

    @property
    def limited(self) -> int:
        """Number of ticks in which a torque was reduced or its rate limited."""
        return int(self._counts[0])

    @property
    def not_finite(self) -> int:
        """Number of ticks in which a torque or position was NaN or infinite."""
        return int(self._counts[1])

    def reset(self, tau: Floats) -> None:
        """Reset the counts, and start from the torque (n,) [Nm|N] that is being applied; NaN counts as zero."""
        applied = as_array("tau", tau, self.torque.shape, finite=False)
        self.apply(applied, applied, 0.0)  # compiles, which a tick has no time for
        self._last[:] = np.clip(np.nan_to_num(applied, nan=0.0), -self.torque, self.torque)
        self._counts[:] = 0

    def apply(self, tau: Floats, q: Floats, dt: float) -> Floats:
        """Return tau (n,) [Nm|N], limited, at positions q (n,) [rad|m], dt [s] after the last call; NaN is allowed."""
        sent, shape = np.empty(len(self._last)), self.torque.shape
        # numba would compile once more for every other type
        command, at = as_array("torque", tau, shape, finite=False), as_array("q", q, shape, finite=False)
        bounds = self.torque, self.slew, self.lower, self.upper, self.taper
        _limit(*bounds, self._last, self._counts, command, at, float(dt), sent)
        return sent


@compiled
def _limit(
    largest: Floats,
    slew: Floats,
    lower: Floats,
    upper: Floats,
    taper: Floats,
    last: Floats,
    counts: NDArray[np.int64],
    tau: Floats,
    q: Floats,
    dt: float,
    sent: Floats,
) -> None:
    limited, not_finite = False, False
    for j in range(len(sent)):
        command = tau[j]
        if not (np.isfinite(command) and np.isfinite(q[j])):
            command = 0.0
            not_finite = True
        value = command
        if taper[j] > 0.0 and value != 0.0:  # a torque that is not zero has a finite position
            room = (upper[j] - q[j] if value > 0.0 else q[j] - lower[j]) / taper[j]
            value *= min(max(room, 0.0), 1.0)
        value = min(max(value, -largest[j]), largest[j])
        step = slew[j] * dt
        value = min(max(value, last[j] - step), last[j] + step)
        limited |= value != command
        last[j] = value
        sent[j] = value
    counts[0] += limited
    counts[1] += not_finite
