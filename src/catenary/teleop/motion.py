"""Keyboard teleoperation: joint and Cartesian velocities by held keys, with ramps and joint limits."""

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
_DAMPING_M = 0.002  # of the damped inverse Jacobian [m]: near singularities the tip slows down
_ROUNDING = 1e-9
KEY_TIMEOUT_S = 0.15  # [s] after the last repeat of a key until its motion ramps down
RAMP_S = 0.1  # [s] from rest to full speed, and back


class TeleopMotion:
    """Integrate the motion of held keys: each ramps up to its joint's or axis's speed, and down when released."""

    def __init__(self, joints: Bounded, model: RobotModel | None) -> None:
        """Set a robot's joints, and the model of the first ones, which determine its tip; None without a tip."""
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
        self._pressed: dict[str, float] = {}  # time of the last repeat of each held key [s]
        self._shares: dict[str, float] = {}  # relative speed of each held key
        self._q: Floats | None = None  # integrated position, until the motion ends

    @property
    def speed(self) -> float:
        """Factor on the full speeds of joints and tip."""
        return _SPEED_FACTORS[self._speed]

    @property
    def is_moving(self) -> bool:
        """A joint is moving."""
        return self._q is not None

    def press(self, key: str, now: float) -> bool:
        """Process a key, or a repeat of it, at a time [s]; return true for keys of motion or speed."""
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
        """Integrate a tick of `period` [s] at a time `now` [s]; a motion starts at setpoint q (n,) [rad|m].

        Return the new setpoint (n,), None at rest, and the joints that keys push against a limit.
        """
        self._ramp(now, period)
        if not self._shares:
            self._q = None
            return None, ()
        start = np.array(q) if self._q is None else self._q
        speeds, velocity = np.zeros(len(start)), np.zeros(6)  # relative speeds of joints and of the tip
        for key, share in self._shares.items():
            steps, (place, sign) = (speeds, self._moves[key]) if key in self._moves else (velocity, _TIP_AXES[key])
            steps[place] += sign * share
        own = self.speed * period * self._full_speed * speeds
        tip = period * self._joint_velocity(start, self.speed * _TIP_SPEED_M_S * velocity)
        # a joint beyond a limit, as after homing against a stop, may return
        low, high = np.minimum(self._lower, start), np.maximum(self._upper, start)
        blocked = self._beyond(start + own + tip, low, high)
        if blocked and tip.any() and self._beyond(start + tip, low, high):
            tip = np.zeros(len(start))  # of all joints, so that the tip stays on its line
        self._q = np.clip(start + own + tip, low, high)
        return self._q.copy(), blocked

    def _ramp(self, now: float, period: float) -> None:
        """Ramp the relative speed of every key for a tick, and remove keys at rest."""
        for key, pressed in list(self._pressed.items()):
            is_held = now - pressed <= KEY_TIMEOUT_S
            share = self._shares[key] + (period if is_held else -period) / RAMP_S
            self._shares[key] = min(max(share, 0.0), 1.0)
            if not is_held and share <= 0.0:
                del self._shares[key], self._pressed[key]

    def _joint_velocity(self, q: Floats, velocity: Floats) -> Floats:
        """Return joint velocities (n,) of a tip velocity (6,); with six joints or more the orientation is kept."""
        qd = np.zeros(len(q))
        if self._model is None or not velocity.any():
            return qd
        k = self._model.n
        rows = 6 if k >= 6 else 3
        scale = np.where(np.array(self.joint_units[:k]) == "m", 0.1, 1.0)  # 0.1 m is equivalent to 1 rad
        weighted = jacobian(self._model, q[:k])[:rows] * scale
        square = weighted @ weighted.T + _DAMPING_M**2 * np.eye(rows)
        qd[:k] = scale * (weighted.T @ np.linalg.solve(square, velocity[:rows]))
        fastest = float((np.abs(qd[:k]) / (2.0 * self.speed * self._full_speed[:k])).max())
        return qd / max(1.0, fastest)

    def _beyond(self, q: Floats, low: Floats, high: Floats) -> tuple[str, ...]:
        bad = (q < low - _ROUNDING) | (q > high + _ROUNDING)
        return tuple(self.joint_names[j] for j in np.flatnonzero(bad))
