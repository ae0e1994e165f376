"""The loop of teleop: keys read, the robot moved and shown, tick by tick."""

from collections.abc import Callable
from typing import Protocol

from catenary.dynamics.kinematics import forward_kinematics
from catenary.errors import CatenaryError
from catenary.plant import OperatingState, Plant, StateCommand, state_in_words
from catenary.robots.model import RobotModel
from catenary.teleop.keys import KeyReader
from catenary.teleop.motion import TeleopMotion
from catenary.teleop.screen import View, teleop_lines

DRAW = 0.05  # [s] between two pictures
TWICE = 2.0  # [s] within which the key that homes comes a second time
COMMANDS: dict[str, StateCommand] = {
    "E": "enable", "D": "disable", "P": "pause", "R": "resume", "H": "home",
}  # fmt: skip
_KEYS = {"DISABLED": "; E enables it", "PAUSED": "; R resumes it"}


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
        self.motion = TeleopMotion(plant, model)
        self._keys = KeyReader()
        self.message = "hold a key to move"
        self._with_help = False
        self._asked_home = -TWICE
        self._drawn = -DRAW
        self._quit = False
        state = plant.operating_state()
        self._last_told = self._in_words(state)
        if not _may_move(state):
            self.message = self._last_told

    def run(self, clock: Callable[[], float]) -> str:
        """Run until somebody quits or the terminal ends, hold and pause the robot, and return why it ended."""
        why = "quit"
        try:
            while not self._quit and self._terminal.ended is None:
                if self._terminal.wants_suspension:
                    self.hold()
                    self._terminal.suspend()
                try:
                    self.tick(clock())
                except CatenaryError as error:
                    self.motion.stop()  # a robot that fell silent may come back; until then nothing is sent
                    self.message = str(error)
                    self._show_message(clock())
            why = self._terminal.ended or why
        except KeyboardInterrupt:
            why = "Ctrl-C"
        finally:
            self._leave()
        return why

    def _leave(self) -> None:
        """Hold, then pause; `message` tells of a robot that cannot be reached any more."""
        try:
            self.hold()
            if self.plant.operating_state().state == "ENABLED":
                self.plant.state_command("pause")
        except CatenaryError as error:
            self.message = f"the robot was not paused: {error}"

    def hold(self) -> None:
        """Stop at the setpoint."""
        self.motion.stop()
        if _may_move(self.plant.operating_state()):
            self.plant.servo_jp(self.plant.setpoint_js().q)
            self.plant.wait()

    def tick(self, now: float) -> None:
        """Read keys, move the robot by a tick, show it."""
        for key in self._keys.feed(self._terminal.read(), now):
            self._take(key, now)
        state = self.plant.operating_state()
        told = self._in_words(state)  # why a robot is in FAULT may come after its state
        if told != self._last_told:
            self.message = self._last_told = told
        blocked: tuple[str, ...] = ()
        if _may_move(state):
            setpoint = self.plant.setpoint_js().q
            goal, blocked = self.motion.step(setpoint, now, self.plant.period)
            if goal is not None:
                self.plant.servo_jp(goal)
            if blocked:
                self.message = f"at its limit: {', '.join(blocked)}"
        else:
            self.motion.stop()
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
        elif key == " ":
            self.hold()
            self.message = "held"
        elif key in COMMANDS:
            self._command(COMMANDS[key], now)
        elif self.motion.press(key, now):
            if key in "+=-_":
                self.message = f"speed x{self.motion.speed:g}"
            elif not _may_move(self.plant.operating_state()):
                self.message = f"does not move: {self._in_words(self.plant.operating_state())}"
        else:
            self.message = f"{key}: does nothing; ? shows the keys"

    def _command(self, command: StateCommand, now: float) -> None:
        self.motion.stop()
        if command == "home" and now - self._asked_home > TWICE:
            self._asked_home = now
            self.message = "home moves every joint against its stop: clear the workspace, then H again"
            return
        self._asked_home = -TWICE
        self.message = f"{command} ..."
        self._draw((), None)
        try:
            self.plant.state_command(command)
            self.message = self._in_words(self.plant.operating_state())
        except CatenaryError as error:
            self.message = str(error)

    def _show_message(self, now: float) -> None:
        """Show that the robot is silent, and let its tick pass."""
        if now - self._drawn >= DRAW:
            self._drawn = now
            self._terminal.draw([f"catenary teleop  {self._name}", "", self.message, "", "Q quit"])
        self.plant.wait()

    def _in_words(self, state: OperatingState) -> str:
        homed = "homed" if state.is_homed else "homing" if state.is_busy else "not homed: H H homes it"
        key = "" if state.is_busy else _KEYS.get(state.state, "")
        return f"the robot is {state_in_words(self.plant, state)}, {homed}{key}"

    def _draw(self, blocked: tuple[str, ...], line: str | None) -> None:
        plant = self.plant
        measured = plant.measured_js()
        tip = None
        if self._model is not None:
            tip = forward_kinematics(self._model, measured.q[: self._model.n]).position
        view = View(
            self._name, plant.simulated, plant.operating_state(), measured, plant.setpoint_js().q, self.motion.speed,
            self.motion.is_moving, blocked, self.message, plant, tip, line, self._with_help,
        )  # fmt: skip
        self._terminal.draw(teleop_lines(view, *self._terminal.size))


def _may_move(state: OperatingState) -> bool:
    return state.state == "ENABLED" and state.is_homed and not state.is_busy
