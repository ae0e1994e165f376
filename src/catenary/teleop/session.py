"""The loop of teleop in a terminal: keys read, the robot moved, and its picture, lines of a fixed size, drawn."""

from collections.abc import Callable, Sequence
from textwrap import wrap
from typing import NamedTuple

import numpy as np

from catenary.arrays import Floats
from catenary.dynamics.kinematics import forward_kinematics
from catenary.errors import CatenaryError
from catenary.plant import Bounded, JointState, OperatingState, Plant
from catenary.robots.model import RobotModel
from catenary.teleop.dead_man import RAMP, TIMEOUT
from catenary.teleop.driver import TeleopDriver
from catenary.teleop.key_motion import BACKWARD, FORWARD
from catenary.teleop.terminal import KeyReader, RawTerminal
from catenary.visible import visible

BAR = 20  # characters of a joint's range
_HELP = (
    "E enable  D disable  P pause  R resume  H H home  Space hold  + - speed",
    "arrows: tip along x, y   page up/down: along z   ? keys   Q quit (pauses)",
)
_MORE = (
    f"Hold a key to move; {TIMEOUT + RAMP:g} s after its last repeat everything has stopped.",
    "Lower case moves, capitals change the robot's state. H twice within 2 s homes.",
    "Ctrl-C and Q hold the robot, then pause it; Ctrl-Z holds it meanwhile.",
)


class View(NamedTuple):
    """The robot and the session as they are shown."""

    robot: str
    simulated: bool
    operating: OperatingState
    measured: JointState
    setpoint: Floats  # (n,) [rad|m]
    speed: float
    is_moving: bool
    blocked: Sequence[str]
    message: str
    joints: Bounded
    tip: Floats | None  # (3,) [m] in the base frame
    recording: str | None = None
    with_help: bool = False


def teleop_lines(view: View, columns: int = 80, lines: int = 24) -> list[str]:
    """Return exactly `lines` lines of at most `columns` characters."""
    state = view.operating
    what = "simulated" if view.simulated else "ROBOT"
    title = f"catenary teleop  {view.robot} ({what})  {state.state}{'' if state.is_homed else ', NOT HOMED'}"
    title += ", busy" if state.is_busy else ""
    shown = [title, f"speed x{view.speed:g}   {'moving' if view.is_moving else 'still'}", ""]
    shown.append(f"{'keys':>4}  {'joint':<18}{'now':>11}{'set':>11}   range")
    joints, lower, upper = view.joints, view.joints.lower, view.joints.upper
    for j, (name, unit) in enumerate(zip(joints.joint_names, joints.joint_units, strict=True)):
        keys = f"{FORWARD[j]} {BACKWARD[j]}" if j < len(FORWARD) else ""
        mark = " LIMIT" if name in view.blocked else ""
        shown.append(
            f"{keys:>4}  {name[:17]:<18}{_number(view.measured.q[j], unit):>11}{_number(view.setpoint[j], unit):>11}   "
            f"{_bar(view.setpoint[j], lower[j], upper[j])}{mark}"
        )
    if view.tip is not None:
        x, y, z = 1e3 * view.tip
        shown += ["", f"tip  x {x:8.1f}  y {y:8.1f}  z {z:8.1f} mm, in the base frame"]
    shown += ["", *wrap(visible(view.message), max(8, columns))]
    if view.recording is not None:
        shown.append(view.recording)
    footer = [*(_MORE if view.with_help else ()), *_HELP]
    room = max(0, lines - len(footer))
    shown = shown[:room] + [""] * (room - len(shown)) + footer[:lines]
    return [visible(line.replace("\n", " "))[:columns] for line in shown[:lines]]


def _number(value: float, unit: str) -> str:
    return f"{np.rad2deg(value):.2f} deg" if unit == "rad" else f"{1e3 * value:.2f} mm"


def _bar(value: float, low: float, high: float) -> str:
    if not (np.isfinite(low) and np.isfinite(high)):
        return "no limits"
    place = int(np.clip((value - low) / (high - low), 0.0, 1.0) * (BAR - 1) + 0.5)
    return "[" + "." * place + "#" + "." * (BAR - 1 - place) + "]"


DRAW = 0.05  # [s] between two pictures
KEYS = {"DISABLED": "E enables it", "PAUSED": "R resumes it", "home": "H H homes it"}


class TeleopSession:
    """Reads keys, moves the robot, shows it, tick by tick."""

    def __init__(
        self,
        plant: Plant,
        model: RobotModel | None,
        name: str,
        terminal: RawTerminal,
        *,
        observe: Callable[[], str | None] = lambda: None,
    ) -> None:
        """Take a robot and a terminal.

        Args:
            plant: In any state.
            model: Of its first joints, which place the tip.
            name: Of the robot.
            terminal: Entered.
            observe: Called after each tick, as a recorder is; returns a line for the screen.
        """
        self.plant, self._model, self._name, self._terminal = plant, model, name, terminal
        self._observe = observe
        self._driver = TeleopDriver(plant, model, keys=KEYS, before_command=lambda: self._draw((), None))
        self._keys = KeyReader()
        self._with_help = False
        self._drawn = -DRAW
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
        line = self._observe()
        if now - self._drawn >= DRAW:
            self._drawn = now
            self._draw(blocked, line)

    def _take(self, key: str, now: float) -> None:
        if key == "Q":
            self._quit = True
        elif key == "?":
            self._with_help = not self._with_help
        elif not self._driver.press(key, now):
            self._driver.message = f"{key}: does nothing; ? shows the keys"

    def _show_message(self, now: float) -> None:
        """Show that the robot is silent, and let its tick pass."""
        if now - self._drawn >= DRAW:
            self._drawn = now
            self._terminal.draw([f"catenary teleop  {self._name}", "", self.message, "", "Q quit"])
        self.plant.wait()

    def _draw(self, blocked: tuple[str, ...], line: str | None) -> None:
        plant, motion = self.plant, self._driver.motion
        measured = plant.measured_js()
        tip = None
        if self._model is not None:
            tip = forward_kinematics(self._model, measured.q[: self._model.n]).position
        view = View(
            self._name, plant.simulated, plant.operating_state(), measured, plant.setpoint_js().q, motion.speed,
            motion.is_moving, blocked, self.message, plant, tip, line, self._with_help,
        )  # fmt: skip
        self._terminal.draw(teleop_lines(view, *self._terminal.size))
