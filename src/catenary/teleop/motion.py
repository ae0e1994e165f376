"""Keys and time to joint motion: each key moves one joint or axis for as long as it repeats, and no longer."""

from typing import NamedTuple

import numpy as np

from catenary.arrays import Floats
from catenary.dynamics.kinematics import jacobian
from catenary.robots.model import RobotModel

FORWARD, BACKWARD = "qwertyuio", "asdfghjkl"  # a joint each; nine at most
AXES = {
    "up": (0, 1.0),
    "down": (0, -1.0),
    "left": (1, 1.0),
    "right": (1, -1.0),
    "page up": (2, 1.0),
    "page down": (2, -1.0),
}
DEAD_MAN = (
    0.15  # [s] after the last key in which motion begins to stop; terminals repeat 20 to 30 times a second
)
RAMP = (
    0.1  # [s] from rest to full speed, and back: a released key has stopped everything after DEAD_MAN + RAMP
)
SPEEDS = (0.05, 0.1, 0.25, 0.5, 1.0, 2.0)  # times the gentle speeds
FIRST_SPEED = 2
JOINT_SPEED = {"rad": 0.2, "m": 0.01}  # [rad/s], [m/s]
TIP_SPEED = 0.01  # [m/s]
DAMPING = 0.002  # of the inverse Jacobian [m]: near singular poses the tip slows down, joints do not race
_ROUNDING = 1e-9


class Step(NamedTuple):
    """What a tick does."""

    q: Floats | None  # (n,) [rad|m] where to go; None: nothing moves
    blocked: tuple[str, ...]  # joints at a limit that what was asked for would pass


class TeleopMotion:
    """Velocities of joints, and of the tip in base axes, by the keys that are held."""

    def __init__(
        self,
        joint_names: tuple[str, ...],
        joint_units: tuple[str, ...],
        lower: Floats,
        upper: Floats,
        model: RobotModel | None,
    ) -> None:
        """Take a robot's joints, and the model of those among them, the first ones, that place its tip."""
        self.joint_names, self.joint_units = joint_names, joint_units
        self._lower, self._upper = np.array(lower), np.array(upper)
        self._model = model
        self._speed = FIRST_SPEED
        self._full = np.array([JOINT_SPEED[unit] for unit in joint_units])
        self._pressed: dict[str, float] = {}  # when a key came last [s]
        self._share: dict[str, float] = {}  # of full speed that a key has, 0 to 1
        self._q: Floats | None = None  # where the motion has led, until it ends

    @property
    def speed(self) -> float:
        """Times the gentle speeds."""
        return SPEEDS[self._speed]

    @property
    def is_moving(self) -> bool:
        """Whether anything is under way."""
        return self._q is not None

    def press(self, key: str, now: float) -> bool:
        """Take a key at a time [s]; whether it is one of motion."""
        if key in "+=" or key in "-_":
            self._speed = min(self._speed + 1, len(SPEEDS) - 1) if key in "+=" else max(self._speed - 1, 0)
            return True
        if not self._moves(key):
            return False
        self._pressed[key] = now
        self._share.setdefault(key, 0.0)
        return True

    def stop(self) -> None:
        """End all motion at once."""
        self._pressed.clear()
        self._share.clear()
        self._q = None

    def step(self, q: Floats, now: float, period: float) -> Step:
        """Move on by one tick.

        Args:
            q: (n,) the robot's setpoint, from which a motion sets off [rad|m].
            now: Time [s], of the same clock as that of `press`.
            period: Of the tick [s].
        """
        self._ramp(now, period)
        if not self._share:
            self._q = None
            return Step(None, ())
        start = np.array(q) if self._q is None else self._q
        tip = self._tip_step(start, period)
        own = np.zeros(len(start))
        for key, share in self._share.items():
            j, sign = self._joint(key)
            if j is not None:
                own[j] += sign * share * self.speed * self._full[j] * period
        # a joint that is beyond a limit, as after homing against a stop, may come back
        low, high = np.minimum(self._lower, start), np.maximum(self._upper, start)
        blocked = self._beyond(start + own + tip, low, high)
        if blocked and tip.any():
            beyond = self._beyond(start + tip, low, high)
            if beyond:
                tip = np.zeros(len(start))  # all of it: the tip stays on its line
        self._q = np.clip(start + own + tip, low, high)
        return Step(self._q.copy(), blocked)

    def _ramp(self, now: float, period: float) -> None:
        for key in list(self._share):
            is_held = now - self._pressed[key] <= DEAD_MAN
            self._share[key] = float(
                np.clip(self._share[key] + (period if is_held else -period) / RAMP, 0.0, 1.0)
            )
            if not is_held and self._share[key] <= 0.0:
                del self._share[key], self._pressed[key]

    def _tip_step(self, q: Floats, period: float) -> Floats:
        """Joint steps (n,) that move the tip as its keys ask; a tool that can turn keeps its orientation."""
        step = np.zeros(len(q))
        velocity = np.zeros(6)
        for key, share in self._share.items():
            if key in AXES:
                axis, sign = AXES[key]
                velocity[axis] += sign * share * self.speed * TIP_SPEED
        if self._model is None or not velocity.any():
            return step
        k = self._model.n
        rows = 6 if k >= 6 else 3
        scale = np.where(np.array(self.joint_units[:k]) == "m", 0.1, 1.0)  # 0.1 m weighs as much as 1 rad
        weighted = jacobian(self._model, q[:k])[:rows] * scale
        square = weighted @ weighted.T + DAMPING**2 * np.eye(rows)
        qd = scale * (weighted.T @ np.linalg.solve(square, velocity[:rows]))
        fastest = float((np.abs(qd) / (2.0 * self.speed * self._full[:k])).max())
        step[:k] = qd * period / max(1.0, fastest)
        return step

    def _beyond(self, q: Floats, low: Floats, high: Floats) -> tuple[str, ...]:
        bad = (q < low - _ROUNDING) | (q > high + _ROUNDING)
        return tuple(self.joint_names[j] for j in np.flatnonzero(bad))

    def _moves(self, key: str) -> bool:
        return self._joint(key)[0] is not None or (key in AXES and self._model is not None)

    def _joint(self, key: str) -> tuple[int | None, float]:
        for keys, sign in ((FORWARD, 1.0), (BACKWARD, -1.0)):
            if len(key) == 1 and key in keys and keys.index(key) < len(self.joint_names):
                return keys.index(key), sign
        return None, 0.0
