"""A robot moved by held keys and keys that change its run level, wherever the keys come from: a terminal or a page."""

from collections.abc import Callable

from catenary.errors import CatenaryError
from catenary.plant import OperatingState, Plant, StateCommand
from catenary.robots.model import RobotModel
from catenary.teleop.motion import FASTER, SLOWER, TeleopMotion

TWICE = 2.0  # [s] within which the key that homes comes a second time
HOLD = " "
COMMANDS: dict[str, StateCommand] = {
    "E": "enable", "D": "disable", "P": "pause", "R": "resume", "H": "home",
}  # fmt: skip


class TeleopDriver:
    """Takes keys and moves the robot tick by tick; `message` says what came of them."""

    def __init__(
        self, plant: Plant, model: RobotModel | None, *, before_command: Callable[[], None] = lambda: None
    ) -> None:
        """Take a robot.

        Args:
            plant: In any state.
            model: Of its first joints, which place the tip.
            before_command: Called before a run level is asked for, which may take its time; to show `message`.
        """
        self.plant, self._before_command = plant, before_command
        self.motion = TeleopMotion(plant, model)
        self.message = "hold a key to move"
        self._asked_home = -TWICE
        self._last_state = plant.operating_state()

    def press(self, key: str, now: float) -> bool:
        """Take a key at a time [s], and return whether it does anything.

        Raises:
            CatenaryError: The robot fell silent.
        """
        if key == HOLD:
            self.hold()
            self.message = "held"
        elif key in COMMANDS:
            self._command(COMMANDS[key], now)
        elif self.motion.press(key, now):
            if key in FASTER + SLOWER:
                self.message = f"speed x{self.motion.speed:g}"
            elif not may_move(self.plant.operating_state()):
                self.message = f"does not move: {in_words(self.plant.operating_state())}"
        else:
            return False
        return True

    def step(self, now: float) -> tuple[str, ...]:
        """Send the motion of one tick, and return the joints at a limit that the keys ask to pass.

        Nothing is sent to a robot that is not enabled, homed and idle, nor while no key is held.

        Raises:
            CatenaryError: The robot fell silent, or another program moves it.
        """
        state = self.plant.operating_state()
        if state != self._last_state:
            self.message, self._last_state = in_words(state), state
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
            self.hold()
            if self.plant.operating_state().state == "ENABLED":
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
            self.message = in_words(self.plant.operating_state())
        except CatenaryError as error:
            self.message = str(error)


def may_move(state: OperatingState) -> bool:
    """Return whether a robot obeys motion."""
    return state.state == "ENABLED" and state.is_homed and not state.is_busy


def in_words(state: OperatingState) -> str:
    """Return a robot's state as a sentence."""
    homed = "homed" if state.is_homed else "homing" if state.is_busy else "not homed: home it first"
    return f"the robot is {state.state}, {homed}"
