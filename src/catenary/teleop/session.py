"""The loop of teleop in a terminal: keys read, the robot moved, and its picture, lines of a fixed size, drawn."""

from collections.abc import Callable
from textwrap import wrap

from catenary.dynamics.kinematics import forward_kinematics
from catenary.errors import CatenaryError
from catenary.plant import Plant
from catenary.robots.model import RobotModel
from catenary.teleop.driver import BACKWARD_KEYS, FORWARD_KEYS, KEY_TIMEOUT_S, RAMP_S, TeleopDriver
from catenary.teleop.terminal import KeyReader, RawTerminal
from catenary.units import in_words
from catenary.visible import range_bar, visible

_BAR_CHARACTERS = 20  # characters of a joint's range
_HELP = (
    "E enable  D disable  P pause  R resume  H H home  Space hold  + - speed",
    "arrows: tip along x, y   page up/down: along z   ? keys   Q quit (pauses)",
)
_MORE = (
    f"Hold a key to move; {KEY_TIMEOUT_S + RAMP_S:g} s after its last repeat everything has stopped.",
    "Lower case moves, capitals change the robot's state. H twice within 2 s homes.",
    "Ctrl-C and Q hold the robot, then pause it; Ctrl-Z holds it meanwhile.",
)


_DRAW_EVERY_S = 0.05  # [s] between two pictures
_STATE_KEYS = {"DISABLED": "E enables it", "PAUSED": "R resumes it", "home": "H H homes it"}


class TeleopSession:
    """Reads keys, moves the robot, shows it, tick by tick."""

    def __init__(self, plant: Plant, model: RobotModel | None, name: str, terminal: RawTerminal) -> None:
        """Take a robot, the model of its first joints, which place the tip, and a terminal."""
        self.plant, self._model, self._name, self._terminal = plant, model, name, terminal
        self._driver = TeleopDriver(plant, model, keys=_STATE_KEYS, before_command=lambda: self._draw(()))
        self._keys = KeyReader()
        self._with_help = False
        self._drawn = -_DRAW_EVERY_S
        self._quit = False

    @property
    def message(self) -> str:
        """What happened last, in words."""
        return self._driver.message

    def run(self, clock: Callable[[], float]) -> str:
        """Run until somebody quits or the terminal ends, hold and pause the robot, and return why it ended."""
        why = "quit"
        try:
            while not self._quit and self._terminal.ended is None:
                if self._terminal.wants_suspension:
                    self._driver.hold()
                    self._terminal.suspend()
                try:
                    self.tick(clock())
                except CatenaryError as error:
                    self._driver.fail(error)
                    self._show_message(clock())
            why = self._terminal.ended or why
        except KeyboardInterrupt:
            why = "Ctrl-C"
        finally:
            self._driver.leave()
        return why

    def tick(self, now: float) -> None:
        """Read keys, move the robot by a tick, show it."""
        for key in self._keys.feed(self._terminal.read(), now):
            self._take(key, now)
        blocked = self._driver.step(now)
        self.plant.wait()
        if now - self._drawn >= _DRAW_EVERY_S:
            self._drawn = now
            self._draw(blocked)

    def _take(self, key: str, now: float) -> None:
        if key == "Q":
            self._quit = True
        elif key == "?":
            self._with_help = not self._with_help
        elif not self._driver.press(key, now):
            self._driver.message = f"{key}: does nothing; ? shows the keys"

    def _show_message(self, now: float) -> None:
        """Show that the robot is silent, and let its tick pass."""
        if now - self._drawn >= _DRAW_EVERY_S:
            self._drawn = now
            self._terminal.draw([f"catenary teleop  {self._name}", "", self.message, "", "Q quit"])
        self.plant.wait()

    def _draw(self, blocked: tuple[str, ...]) -> None:
        """Draw exactly as many lines as the terminal has, none wider than it is."""
        columns, lines = self._terminal.size
        footer = [*(_MORE if self._with_help else ()), *_HELP]
        room = max(0, lines - len(footer))
        shown = [*self._robot_lines(blocked), "", *wrap(visible(self.message), max(8, columns))][:room]
        shown += [""] * (room - len(shown)) + footer[:lines]
        self._terminal.draw([visible(text.replace("\n", " "))[:columns] for text in shown[:lines]])

    def _robot_lines(self, blocked: tuple[str, ...]) -> list[str]:
        """Return the robot's state, its joints and its tip as text."""
        plant, motion, state = self.plant, self._driver.motion, self.plant.operating_state()
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
