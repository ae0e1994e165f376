"""A robot moved by held keys and keys that change its run level, wherever the keys come from: a terminal or a page."""

from collections.abc import Callable, Mapping
from contextlib import suppress
from types import MappingProxyType

import numpy as np

from catenary.arrays import Floats
from catenary.dynamics.kinematics import jacobian
from catenary.errors import CatenaryError, TransportError
from catenary.plant import Bounded, OperatingState, Plant, StateCommand, state_in_words
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
_FASTER_KEYS, _SLOWER_KEYS = "+=", "-_"  # with and without Shift
_SPEED_FACTORS = (0.05, 0.1, 0.25, 0.5, 1.0, 2.0)  # times joint and tip speeds
_FIRST_FACTOR = 2
_JOINT_SPEED = {"rad": 0.2, "m": 0.01}  # [rad/s], [m/s]
_TIP_SPEED_M_S = 0.01  # [m/s]
_DAMPING_M = 0.002  # of the inverse Jacobian [m]: near singular poses the tip slows down, joints do not race
_ROUNDING = 1e-9
KEY_TIMEOUT_S = 0.15  # [s] after the last repeat of a key, from which its motion ramps down
RAMP_S = 0.1  # [s] from rest to full speed, and back


class DeadMan:
    """The keys that are held, and the share of full speed, 0 to 1, that each of them has."""

    def __init__(self) -> None:
        self.shares: dict[str, float] = {}
        self._pressed: dict[str, float] = {}  # when a key came last [s]

    def press(self, key: str, now: float) -> None:
        """Take a key, or a repeat of it, at a time [s]."""
        self._pressed[key] = now
        self.shares.setdefault(key, 0.0)

    def stop(self) -> None:
        """Release all keys, without a ramp."""
        self._pressed.clear()
        self.shares.clear()

    def update(self, now: float, period: float) -> dict[str, float]:
        """Ramp every key's share up or down for a tick of `period` [s], and return those of the keys that move."""
        for key, pressed in list(self._pressed.items()):
            is_held = now - pressed <= KEY_TIMEOUT_S
            share = self.shares[key] + (period if is_held else -period) / RAMP_S
            self.shares[key] = min(max(share, 0.0), 1.0)
            if not is_held and share <= 0.0:
                del self.shares[key], self._pressed[key]
        return self.shares


class TeleopMotion:
    """Velocities of joints, and of the tip in base axes, by the keys that are held."""

    def __init__(self, joints: Bounded, model: RobotModel | None) -> None:
        """Take a robot's joints, and the model of those among them, the first ones, that place its tip."""
        self.joint_names, self.joint_units = joints.joint_names, joints.joint_units
        self._lower, self._upper = np.array(joints.lower), np.array(joints.upper)
        self._model = model
        self._speed = _FIRST_FACTOR
        n = len(self.joint_names)
        self._moves = {  # joint and direction of each key
            key: (joint, sign)
            for keys, sign in ((FORWARD_KEYS, 1.0), (BACKWARD_KEYS, -1.0))
            for joint, key in enumerate(keys[:n])
        }
        self._full_speed = np.array([_JOINT_SPEED[unit] for unit in self.joint_units])
        self._dead_man = DeadMan()
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
        """Take a key at a time [s], and return whether it is one of motion or speed."""
        if key in _FASTER_KEYS:
            self._speed = min(self._speed + 1, len(_SPEED_FACTORS) - 1)
        elif key in _SLOWER_KEYS:
            self._speed = max(self._speed - 1, 0)
        elif key in self._moves or (key in _TIP_AXES and self._model is not None):
            self._dead_man.press(key, now)
        else:
            return False
        return True

    def stop(self) -> None:
        """End all motion at once."""
        self._dead_man.stop()
        self._q = None

    def step(self, q: Floats, now: float, period: float) -> tuple[Floats | None, tuple[str, ...]]:
        """Move on by a tick of `period` [s] at `press`'s time [s]; a motion sets off from setpoint q (n,) [rad|m].

        Return where to go (n,), None where nothing moves, and the joints at a limit that the keys ask to pass.
        """
        shares = self._dead_man.update(now, period)
        if not shares:
            self._q = None
            return None, ()
        start = np.array(q) if self._q is None else self._q
        asked, velocity = np.zeros(len(start)), np.zeros(6)  # shares of full speed, of joints and of the tip
        for key, share in shares.items():
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


_TWICE_WITHIN_S = 2.0  # [s] within which the key that homes comes a second time
_HOLD_KEY = " "
_COMMAND_KEYS: dict[str, StateCommand] = {
    "E": "enable", "D": "disable", "P": "pause", "R": "resume", "H": "home",
}  # fmt: skip


class TeleopDriver:
    """Takes keys and moves the robot tick by tick; `message` says what came of them."""

    def __init__(
        self,
        plant: Plant,
        model: RobotModel | None,
        *,
        keys: Mapping[str, str] = MappingProxyType({}),
        before_command: Callable[[], None] = lambda: None,
    ) -> None:
        """Take a robot in any state, the model of its first joints, and the `keys` to press by its state."""
        self.plant, self._before_command, self._keys = plant, before_command, keys
        self.motion = TeleopMotion(plant, model)
        self.message = "hold a key to move"
        self._asked_home = -_TWICE_WITHIN_S
        state = plant.operating_state()
        self._last_told = self.in_words(state)
        if not state.is_ready:
            self.message = self._last_told

    def press(self, key: str, now: float) -> bool:
        """Take a key at a time [s], and return whether it does anything."""
        if key == _HOLD_KEY:
            self.hold()
            self.message = "held"
        elif key in _COMMAND_KEYS:
            self._command(_COMMAND_KEYS[key], now)
        elif self.motion.press(key, now):
            if key in _FASTER_KEYS + _SLOWER_KEYS:
                self.message = f"speed x{self.motion.speed:g}"
            elif not self.plant.operating_state().is_ready:
                self.message = f"does not move: {self.in_words(self.plant.operating_state())}"
        else:
            return False
        return True

    def step(self, now: float) -> tuple[str, ...]:
        """Send a tick's motion to a robot that may move; return the joints at a limit that the keys ask to pass."""
        state = self.plant.operating_state()
        told = self.in_words(state)  # why a robot is in FAULT may come after its state
        if told != self._last_told:
            self.message = self._last_told = told
        if not state.is_ready:
            self.motion.stop()
            return ()
        goal, blocked = self.motion.step(self.plant.setpoint_js().q, now, self.plant.period)
        if goal is not None:
            self.plant.servo_jp(goal)
        if blocked:
            self.message = f"at its limit: {', '.join(blocked)}"
        return blocked

    def fail(self, error: CatenaryError) -> None:
        """End all motion because of an error: a robot that fell silent may come back, until then nothing is sent."""
        self.motion.stop()
        self.message = str(error)

    def hold(self) -> None:
        """Stop at the setpoint."""
        self.motion.stop()
        if self.plant.operating_state().is_ready:
            self.plant.servo_jp(self.plant.setpoint_js().q)
            self.plant.wait()

    def leave(self) -> None:
        """Hold, then pause; `message` tells of a robot that cannot be reached any more."""
        try:
            with suppress(TransportError):  # one that only stood still obeys when it goes on
                self.hold()
                if self.plant.operating_state().state != "ENABLED":
                    return
            self.plant.state_command("pause")
        except CatenaryError as error:
            self.message = f"the robot was not paused: {error}"

    def _command(self, command: StateCommand, now: float) -> None:
        self.motion.stop()
        if command == "home" and now - self._asked_home > _TWICE_WITHIN_S:
            self._asked_home = now
            self.message = "home moves every joint against its stop: clear the workspace, then home again"
            return
        self._asked_home = -_TWICE_WITHIN_S
        self.message = f"{command} ..."
        self._before_command()
        try:
            self.plant.state_command(command)
            self.message = self.in_words(self.plant.operating_state())
        except CatenaryError as error:
            self.message = str(error)

    def in_words(self, state: OperatingState) -> str:
        """Return the robot's state as a sentence, with what a person does about it."""
        home = self._keys.get("home", "home it first")
        homed = "homed" if state.is_homed else "homing" if state.is_busy else f"not homed: {home}"
        key = "" if state.is_busy else self._keys.get(state.state, "")
        return f"the robot is {state_in_words(self.plant, state)}, {homed}{key and f'; {key}'}"
