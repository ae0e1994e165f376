"""Velocities of a robot's joints and of its tip, by the keys that are held."""

import numpy as np

from catenary.arrays import Floats
from catenary.dynamics.kinematics import jacobian
from catenary.plant import Bounded
from catenary.robots.model import RobotModel

FORWARD_KEYS, BACKWARD_KEYS = "qwertyuio", "asdfghjkl"  # a joint each; nine at most
_TIP_AXES = {
    "up": (0, 1.0),
    "down": (0, -1.0),
    "left": (1, 1.0),
    "right": (1, -1.0),
    "page up": (2, 1.0),
    "page down": (2, -1.0),
}  # of the base frame, and the direction along them
SPEED_KEYS = {"+": 1, "=": 1, "-": -1, "_": -1}  # with and without Shift
_SPEED_FACTORS = (0.05, 0.1, 0.25, 0.5, 1.0, 2.0)  # times joint and tip speeds
_FIRST_FACTOR = 2
_JOINT_SPEED = {"rad": 0.2, "m": 0.01}  # [rad/s], [m/s]
_TIP_SPEED_M_S = 0.01  # [m/s]
_DAMPING_M = 0.002  # of the inverse Jacobian [m]: near singular poses the tip slows down, joints do not race
_ROUNDING = 1e-9
KEY_TIMEOUT_S = 0.15  # [s] after the last repeat of a key, from which its motion ramps down
RAMP_S = 0.1  # [s] from rest to full speed, and back


class TeleopMotion:
    """Where held keys lead: each ramps up to its joint's or axis's speed, and down once it repeats no more."""

    def __init__(self, joints: Bounded, model: RobotModel | None) -> None:
        """Take a robot's joints, and the model of those among them, the first ones, that place its tip."""
        self.joint_names, self.joint_units = joints.joint_names, joints.joint_units
        self._lower, self._upper = np.array(joints.lower), np.array(joints.upper)
        self._model = model
        self._speed = _FIRST_FACTOR
        self._moves = {  # joint and direction of each key
            key: (joint, sign)
            for keys, sign in ((FORWARD_KEYS, 1.0), (BACKWARD_KEYS, -1.0))
            for joint, key in enumerate(keys[: len(self.joint_names)])
        }
        self._full_speed = np.array([_JOINT_SPEED[unit] for unit in self.joint_units])
        self._pressed: dict[str, float] = {}  # when a held key came last [s]
        self._shares: dict[str, float] = {}  # of full speed, that a held key has
        self._q: Floats | None = None  # where the motion has led, until it ends

    @property
    def speed(self) -> float:
        """Factor on the full speeds of joints and tip."""
        return _SPEED_FACTORS[self._speed]

    @property
    def is_moving(self) -> bool:
        """A joint is under way."""
        return self._q is not None

    def press(self, key: str, now: float) -> bool:
        """Take a key, or a repeat of it, at a time [s]; return whether it is one of motion or speed."""
        if key in SPEED_KEYS:
            self._speed = min(max(self._speed + SPEED_KEYS[key], 0), len(_SPEED_FACTORS) - 1)
        elif key in self._moves or (key in _TIP_AXES and self._model is not None):
            self._pressed[key] = now
            self._shares.setdefault(key, 0.0)
        else:
            return False
        return True

    def stop(self) -> None:
        """End all motion at once."""
        self._pressed.clear()
        self._shares.clear()
        self._q = None

    def step(self, q: Floats, now: float, period: float) -> tuple[Floats | None, tuple[str, ...]]:
        """Move on by a tick of `period` [s] at `press`'s time [s]; a motion sets off from setpoint q (n,) [rad|m].

        Return where to go (n,), None where nothing moves, and the joints at a limit that the keys ask to pass.
        """
        self._ramp(now, period)
        if not self._shares:
            self._q = None
            return None, ()
        start = np.array(q) if self._q is None else self._q
        asked, velocity = np.zeros(len(start)), np.zeros(6)  # shares of full speed, of joints and of the tip
        for key, share in self._shares.items():
            steps, (place, sign) = (asked, self._moves[key]) if key in self._moves else (velocity, _TIP_AXES[key])
            steps[place] += sign * share
        own = self.speed * period * self._full_speed * asked
        tip = period * self._joint_velocity(start, self.speed * _TIP_SPEED_M_S * velocity)
        # a joint that is beyond a limit, as after homing against a stop, may come back
        low, high = np.minimum(self._lower, start), np.maximum(self._upper, start)
        blocked = self._beyond(start + own + tip, low, high)
        if blocked and tip.any() and self._beyond(start + tip, low, high):
            tip = np.zeros(len(start))  # all of it: the tip stays on its line
        self._q = np.clip(start + own + tip, low, high)
        return self._q.copy(), blocked

    def _ramp(self, now: float, period: float) -> None:
        """Ramp every key's share up or down for a tick, and forget those that move no more."""
        for key, pressed in list(self._pressed.items()):
            is_held = now - pressed <= KEY_TIMEOUT_S
            share = self._shares[key] + (period if is_held else -period) / RAMP_S
            self._shares[key] = min(max(share, 0.0), 1.0)
            if not is_held and share <= 0.0:
                del self._shares[key], self._pressed[key]

    def _joint_velocity(self, q: Floats, velocity: Floats) -> Floats:
        """Return joint velocities (n,) that move the tip at a velocity (6,); a tool that can turn keeps its turn."""
        qd = np.zeros(len(q))
        if self._model is None or not velocity.any():
            return qd
        k = self._model.n
        rows = 6 if k >= 6 else 3
        scale = np.where(np.array(self.joint_units[:k]) == "m", 0.1, 1.0)  # 0.1 m weighs as much as 1 rad
        weighted = jacobian(self._model, q[:k])[:rows] * scale
        square = weighted @ weighted.T + _DAMPING_M**2 * np.eye(rows)
        qd[:k] = scale * (weighted.T @ np.linalg.solve(square, velocity[:rows]))
        fastest = float((np.abs(qd[:k]) / (2.0 * self.speed * self._full_speed[:k])).max())
        return qd / max(1.0, fastest)

    def _beyond(self, q: Floats, low: Floats, high: Floats) -> tuple[str, ...]:
        bad = (q < low - _ROUNDING) | (q > high + _ROUNDING)
        return tuple(self.joint_names[j] for j in np.flatnonzero(bad))
