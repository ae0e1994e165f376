"""A robot moved by held keys and keys that change its run level, wherever the keys come from: a terminal or a page."""

from collections.abc import Callable, Mapping
from contextlib import suppress
from types import MappingProxyType

from catenary.errors import CatenaryError, TransportError
from catenary.plant import OperatingState, Plant, StateCommand, state_in_words
from catenary.robots.model import RobotModel
from catenary.teleop.key_motion import FASTER, SLOWER, TeleopMotion

TWICE = 2.0  # [s] within which the key that homes comes a second time
HOLD = " "
COMMANDS: dict[str, StateCommand] = {
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
        self._asked_home = -TWICE
        state = plant.operating_state()
        self._last_told = self.in_words(state)
        if not may_move(state):
            self.message = self._last_told

    def press(self, key: str, now: float) -> bool:
        """Take a key at a time [s], and return whether it does anything."""
        if key == HOLD:
            self.hold()
            self.message = "held"
        elif key in COMMANDS:
            self._command(COMMANDS[key], now)
        elif self.motion.press(key, now):
            if key in FASTER + SLOWER:
                self.message = f"speed x{self.motion.speed:g}"
            elif not may_move(self.plant.operating_state()):
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
        if not may_move(state):
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
        if may_move(self.plant.operating_state()):
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
        if command == "home" and now - self._asked_home > TWICE:
            self._asked_home = now
            self.message = "home moves every joint against its stop: clear the workspace, then home again"
            return
        self._asked_home = -TWICE
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


def may_move(state: OperatingState) -> bool:
    """Return whether a robot obeys motion."""
    return state.state == "ENABLED" and state.is_homed and not state.is_busy
