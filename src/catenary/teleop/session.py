"""Keyboard teleoperation in a terminal: held keys move joints or tip, others change the state; a fixed display."""

from collections.abc import Callable
from contextlib import suppress
from textwrap import wrap

import numpy as np

from catenary.arrays import Floats
from catenary.dynamics.kinematics import forward_kinematics, jacobian
from catenary.errors import CatenaryError, TransportError
from catenary.plant import Bounded, OperatingState, Plant, StateCommand, state_in_words
from catenary.robots.model import RobotModel
from catenary.teleop.terminal import KeyReader, RawTerminal
from catenary.terminal_text import range_bar, visible
from catenary.units import in_words

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


_BAR_CHARACTERS = 20  # characters of a joint's range
_HELP = (
    "E enable  D disable  P pause  R resume  H H home  Space hold  + - speed",
    "arrows: tip along x, y   page up/down: along z   ? keys   Q quit (pauses)",
)
_MORE = (
    f"Hold a key to move; motion stops {KEY_TIMEOUT_S + RAMP_S:g} s after its last repeat.",
    "Lower case moves, capitals change the robot's state. H twice within 2 s homes.",
    "Ctrl-C and Q hold the robot, then pause it; Ctrl-Z holds it meanwhile.",
)
_DRAW_EVERY_S = 0.05  # [s] between two frames of the display
_TWICE_WITHIN_S = 2.0  # [s] longest interval of the two key presses that home
_COMMAND_KEYS: dict[str, StateCommand] = {
    "E": "enable", "D": "disable", "P": "pause", "R": "resume", "H": "home",
}  # fmt: skip
_REMEDIES = {"DISABLED": "; E enables it", "PAUSED": "; R resumes it"}


class TeleopSession:
    """Teleoperation loop: read keys, move the robot, display it; `message` holds the last event.

    Args:
        plant: Robot in any state.
        model: Model of the first joints, which determine the tip; None without a tip.
    """

    def __init__(self, plant: Plant, model: RobotModel | None, name: str, terminal: RawTerminal) -> None:
        self.plant, self._model, self._name, self._terminal = plant, model, name, terminal
        self._motion, self._keys = TeleopMotion(plant, model), KeyReader()
        state = plant.operating_state()
        self._reported = self._in_words(state)  # last reported state
        self.message = "hold a key to move" if state.is_ready else self._reported
        self._asked_home, self._drawn = -_TWICE_WITHIN_S, -_DRAW_EVERY_S  # time of the last request and frame [s]
        self._with_help = self._quit = False

    def run(self, clock: Callable[[], float]) -> str:
        """Run until the user quits or the terminal ends, then hold and pause the robot; return the reason."""
        why = "quit"
        try:
            while not self._quit and self._terminal.ended is None:
                if self._terminal.wants_suspension:
                    self._hold()
                    self._terminal.suspend()
                try:
                    self._tick(clock())
                except CatenaryError as error:  # a silent robot may return; until then no commands are sent
                    self._motion.stop()
                    self.message = str(error)
                    if self._is_due(clock()):
                        self._terminal.draw([f"catenary teleop  {self._name}", "", self.message, "", "Q quit"])
                    self.plant.wait()
            why = self._terminal.ended or why
        except KeyboardInterrupt:
            why = "Ctrl-C"
        finally:
            self._leave()
        return why

    def _tick(self, now: float) -> None:
        for key in self._keys.feed(self._terminal.read(), now):
            self._take(key, now)
        blocked = self._move(now)
        self.plant.wait()
        if self._is_due(now):
            self._draw(blocked)

    def _take(self, key: str, now: float) -> None:
        if key == "Q":
            self._quit = True
        elif key == "?":
            self._with_help = not self._with_help
        elif key == " ":
            self._hold()
            self.message = "held"
        elif key in _COMMAND_KEYS:
            self._command(_COMMAND_KEYS[key], now)
        elif not self._motion.press(key, now):
            self.message = f"{key}: unknown key; ? shows the keys"
        elif key in SPEED_KEYS:
            self.message = f"speed x{self._motion.speed:g}"
        elif not (state := self.plant.operating_state()).is_ready:
            self.message = f"not moving: {self._in_words(state)}"

    def _move(self, now: float) -> tuple[str, ...]:
        """Command a tick's motion if the robot is ready; return the joints that keys push against a limit."""
        state = self.plant.operating_state()
        summary = self._in_words(state)  # the reason of a FAULT may arrive after the state
        if summary != self._reported:
            self.message = self._reported = summary
        if not state.is_ready:
            self._motion.stop()
            return ()
        goal, blocked = self._motion.step(self.plant.setpoint_js().q, now, self.plant.period)
        if goal is not None:
            self.plant.servo_jp(goal)
        if blocked:
            self.message = f"at its limit: {', '.join(blocked)}"
        return blocked

    def _hold(self) -> None:
        self._motion.stop()
        if self.plant.operating_state().is_ready:
            self.plant.servo_jp(self.plant.setpoint_js().q)
            self.plant.wait()

    def _leave(self) -> None:
        """Hold, then pause; `message` reports a robot that cannot be reached."""
        try:
            with suppress(TransportError):  # a suspended robot obeys when it continues
                self._hold()
                if self.plant.operating_state().state != "ENABLED":
                    return
            self.plant.state_command("pause")
        except CatenaryError as error:
            self.message = f"the robot was not paused: {error}"

    def _command(self, command: StateCommand, now: float) -> None:
        self._motion.stop()
        is_second = now - self._asked_home <= _TWICE_WITHIN_S
        self._asked_home = now if command == "home" and not is_second else -_TWICE_WITHIN_S
        if command == "home" and not is_second:
            self.message = "home moves every joint against its stop: clear the workspace, then home again"
            return
        self.message = f"{command} ..."
        self._draw(())
        try:
            self.plant.state_command(command)
            self.message = self._in_words(self.plant.operating_state())
        except CatenaryError as error:
            self.message = str(error)

    def _in_words(self, state: OperatingState) -> str:
        homed = "homed" if state.is_homed else "homing" if state.is_busy else "not homed: H H homes it"
        remedy = "" if state.is_busy else _REMEDIES.get(state.state, "")
        return f"the robot is {state_in_words(self.plant, state)}, {homed}{remedy}"

    def _is_due(self, now: float) -> bool:
        """Return true if a frame is due, and mark it as drawn."""
        is_due = now - self._drawn >= _DRAW_EVERY_S
        self._drawn = now if is_due else self._drawn
        return is_due

    def _draw(self, blocked: tuple[str, ...]) -> None:
        columns, lines = self._terminal.size
        footer = [*(_MORE if self._with_help else ()), *_HELP]
        room = max(0, lines - len(footer))
        shown = [*self._robot_lines(blocked), "", *wrap(visible(self.message), max(8, columns))][:room]
        shown += [""] * (room - len(shown)) + footer[:lines]
        self._terminal.draw([visible(text.replace("\n", " "))[:columns] for text in shown[:lines]])

    def _robot_lines(self, blocked: tuple[str, ...]) -> list[str]:
        plant, motion, state = self.plant, self._motion, self.plant.operating_state()
        measured, setpoint, lower, upper = plant.measured_js(), plant.setpoint_js().q, plant.lower, plant.upper
        what = "simulated" if plant.simulated else "ROBOT"
        title = f"catenary teleop  {self._name} ({what})  {state.state}{'' if state.is_homed else ', NOT HOMED'}"
        shown = [title + (", busy" if state.is_busy else "")]
        shown += [f"speed x{motion.speed:g}   {'moving' if motion.is_moving else 'still'}", ""]
        shown.append(f"{'keys':>4}  {'joint':<18}{'now':>11}{'set':>11}   range")
        for j, (name, unit) in enumerate(zip(plant.joint_names, plant.joint_units, strict=True)):
            keys = f"{FORWARD_KEYS[j]} {BACKWARD_KEYS[j]}" if j < len(FORWARD_KEYS) else ""
            mark = " LIMIT" if name in blocked else ""
            shown.append(
                f"{keys:>4}  {name[:17]:<18}{in_words(measured.q[j], unit, 2):>11}{in_words(setpoint[j], unit, 2):>11}"
                f"   {range_bar(setpoint[j], lower[j], upper[j], _BAR_CHARACTERS)}{mark}"
            )
        if self._model is not None:
            x, y, z = 1e3 * forward_kinematics(self._model, measured.q[: self._model.n]).position
            shown += ["", f"tip  x {x:8.1f}  y {y:8.1f}  z {z:8.1f} mm, in the base frame"]
        return shown
