"""The loop of teleop: keys read, the robot moved and shown, tick by tick."""

from collections.abc import Callable
from typing import Protocol

from catenary.dynamics.kinematics import forward_kinematics
from catenary.errors import CatenaryError
from catenary.plant import Plant
from catenary.robots.model import RobotModel
from catenary.teleop.driver import TeleopDriver
from catenary.teleop.keys import KeyReader
from catenary.teleop.screen import View, teleop_lines

DRAW = 0.05  # [s] between two pictures
KEYS = {"DISABLED": "E enables it", "PAUSED": "R resumes it", "home": "H H homes it"}


class Terminal(Protocol):
    """Where keys come from and lines go."""

    ended: str | None
    wants_suspension: bool

    @property
    def size(self) -> tuple[int, int]: ...  # noqa: D102

    def read(self) -> bytes: ...  # noqa: D102

    def draw(self, lines: list[str]) -> None: ...  # noqa: D102

    def suspend(self) -> None: ...  # noqa: D102


class TeleopSession:
    """Reads keys, moves the robot, shows it, tick by tick."""

    def __init__(
        self,
        plant: Plant,
        model: RobotModel | None,
        name: str,
        terminal: Terminal,
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
