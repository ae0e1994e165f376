"""What clients of the benchmarks of serving command: the shoulder, to and fro, at 100 Hz."""

import time

import numpy as np

from catenary.crtk.message import message_class
from catenary.crtk.transport import Publisher

RESUME, MOVE = 1.3, 1.5  # [s] from the beginning until the state command, and until commands
COMMANDS = 100.0  # [Hz]
STEP = 1e-5  # [rad] a command
TURN = 1000  # commands, after which it goes the other way


class ShoulderCommands:
    """Increments of the first joint, sent when they are due."""

    def __init__(self, moving: Publisher, command: Publisher, resume: str) -> None:
        """Begin now; `resume` is the state command that lets the robot move."""
        self._moving, self._command, self._resume = moving, command, resume
        self._step, self._is_told, self._first = np.zeros(7), False, np.nan
        self.begin, self.sent = time.monotonic(), 0
        self._due = self.begin + MOVE

    def send(self, now: float, shoulder: float) -> None:
        """Send what is due at a time [s]; the robot's setpoint of the shoulder [rad] was heard last."""
        if not self._is_told and now >= self.begin + RESUME:
            self._is_told = True
            self._command.publish(message_class("crtk_msgs/StringStamped")(string=self._resume))
        if now >= self._due:
            self._first = shoulder if self.sent == 0 else self._first
            self._due = max(self._due + 1.0 / COMMANDS, now - 0.1)
            self._step[0] = STEP if self.sent // TURN % 2 == 0 else -STEP
            self._moving.publish(message_class("sensor_msgs/JointState")(position=self._step.copy()))
            self.sent += 1

    def pause(self, now: float) -> float:
        """Return how long [s] to wait for the next."""
        return min(max(0.0, self._due - now), 1.0 / COMMANDS)

    def error(self, shoulder: float) -> float:
        """Return how far [rad] a setpoint is from where the commands lead."""
        rest = self.sent % (2 * TURN)
        return abs(shoulder - self._first - STEP * min(rest, 2 * TURN - rest))
