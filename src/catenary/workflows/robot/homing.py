"""A robot homed: one simulated here, or one behind a transport, with a person beside it who is guided step by step.

Each step is checked against what the robot reports.
"""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from catenary.arrays import Floats
from catenary.crtk.client import CrtkClient, press_button
from catenary.crtk.reader import CrtkReader
from catenary.errors import CatenaryError, NotReadyError, TransportError
from catenary.plant import OperatingState, state_in_words
from catenary.workflows.robot.motion import pause, paused_if_interrupted
from catenary.workflows.robot.operated_robot import OperatedRobot

Check = Callable[[], str | None]  # what is still missing, as the robot reports it, or None
PATIENCE = 60.0  # [s] until the robot must report it; as long as its encoder rig is given to register
LOOK = 0.1  # [s] between two looks at the robot
PRESS_DELAY_S = 1.0  # [s] in which a press of the button may still be on its way


class Guide(Protocol):
    """Asks a person to do things by hand."""

    def say(self, text: str) -> None:
        """Show a message."""
        ...

    def confirm(self, text: str) -> bool:
        """Ask for something to be done and confirmed; False gives up."""
        ...


class AnswerYes:
    """Confirms everything, for scripts; the robot's reports decide whether it is so."""

    def __init__(self, say: Callable[[str], None] = lambda _: None) -> None:
        self._say = say

    def say(self, text: str) -> None:
        """Show a message."""
        self._say(text)

    def confirm(self, text: str) -> bool:
        """Confirm."""
        self._say(f"{text} (--yes)")
        return True


def clear_workspace(guide: Guide) -> None:
    """Ask a person to confirm that the robot may move."""
    text = "clear the arm's workspace, and keep the e-stop at hand: it is going to move"
    if not guide.confirm(text):
        raise NotReadyError(f"{text}: cancelled; nothing has moved")


def have_done(
    guide: Guide, text: str, missing: Check, sleep: Callable[[float], None], *, patience: float = PATIENCE
) -> None:
    """Ask for something to be done unless the robot reports that it is, and wait `patience` [s] after each answer."""
    if missing() is None:
        return
    while True:
        if not guide.confirm(text):
            raise NotReadyError(f"{text}: cancelled; {missing() or 'although the robot reports it done'}")
        waited = 0.0
        while (fault := missing()) is not None and waited < patience:
            sleep(LOOK)
            waited += LOOK
        if fault is None:
            return
        if isinstance(guide, AnswerYes):
            raise NotReadyError(f"{text}: not done after {patience:g} s: {fault}")
        guide.say(f"not yet: {fault}")


HOMING = 180.0  # [s] that a robot may take from the press of its button until it is homed


@dataclass(frozen=True)
class Homing:
    """Positions and state of a robot after homing."""

    robot: str
    simulated: bool
    was_run: bool  # False: it was homed before, and nothing has moved
    seconds: float  # of the robot's time
    joint_names: tuple[str, ...]
    joint_units: tuple[str, ...]
    believed: Floats  # (n,) [rad|m] reported afterwards
    external_encoders: Floats | None  # (3,) [rad, rad, m], NaN if they say nothing; None without any
    state: OperatingState

    def as_data(self) -> dict[str, Any]:
        """Return plain data, SI."""
        keys = ("robot", "simulated", "seconds", "joint_names", "believed", "external_encoders")
        values = {name: getattr(self, name) for name in keys}
        return values | {"run": self.was_run, "state": self.state._asdict()}


def home_operated(robot: OperatedRobot, guide: Guide) -> Homing:
    """Home a robot, in any state, unless it is homed; one behind a transport is paused then, and its operator asked.

    Args:
        guide: Asks the operator.
    """
    plant = robot.plant
    begin = plant.measured_js().time
    was_run = not plant.operating_state().is_homed
    if was_run:
        if isinstance(plant, CrtkClient):
            with paused_if_interrupted(plant):
                if not plant.simulated:
                    clear_workspace(guide)
                home_client(plant, guide)
                pause(plant)
        else:
            if plant.operating_state().state != "ENABLED":
                plant.state_command("enable")
            plant.state_command("home")
            while plant.operating_state().is_busy:
                plant.wait()
    now, seen = plant.measured_js(), plant.telemetry().get("ext_jpos")
    if isinstance(plant, CrtkReader) and np.isfinite(encoders := plant.external_encoders()).any():
        seen = encoders
    return Homing(
        robot.name, plant.simulated, was_run, now.time - begin, plant.joint_names, plant.joint_units, now.q,
        None if seen is None else np.array(seen), plant.operating_state(),
    )  # fmt: skip


def home_client(client: CrtkClient, guide: Guide, *, patience: float = HOMING) -> None:
    """Home a robot whose workspace is clear: by its own button, or by commands where its dialect has them.

    An interrupted homing is ended by `disable`, which acts in every state; `patience` in s.
    """
    requested = False
    try:
        now = client.operating_state()
        has_begun = now.state == "ENABLED" and now.is_busy  # by somebody else's press of the button
        if not has_begun:
            requested = not client.dialect.has_run_levels or isinstance(guide, AnswerYes)
            if not client.dialect.has_run_levels:
                _command_home(client)
            elif isinstance(guide, AnswerYes):
                _press_button(client, guide)
        text = "wait until the robot is homed"
        if not has_begun:
            text = "press the robot's start button and wait until it is homed"
        have_done(guide, text, lambda: not_homed(client.operating_state()), client.transport.sleep, patience=patience)
    except BaseException as error:
        _stop(client, error, requested=requested and isinstance(error, KeyboardInterrupt))
        raise


def not_homed(now: OperatingState) -> str | None:
    """Return the condition that is missing until a robot is homed, or None."""
    if now.is_homed and not now.is_busy:
        return None
    return f"the robot is {now.state}, {'busy' if now.is_busy else 'not homed'}"


def _press_button(client: CrtkClient, guide: Guide) -> None:
    """Press what stands for a simulated robot's button; use CRTK's commands where there is none."""
    guide.say("pressing the start button (--yes)")
    try:
        success, message = press_button(client.transport)
    except TransportError:
        _command_home(client)
        return
    if not success:
        raise NotReadyError(f"the start button: {message}")


def _command_home(client: CrtkClient) -> None:
    state = client.operating_state()
    if state.state == "FAULT":
        raise NotReadyError(
            f"the robot is in {state_in_words(client, state)}; clear the fault, then enable it; home does neither"
        )
    if state.state != "ENABLED":
        client.state_command("enable")
    client.state_command("home")


def _stop(client: CrtkClient, error: BaseException, *, requested: bool) -> None:
    """End a homing that is under way, or that was asked for and does not show yet: disabled before, it would begin."""
    try:
        with suppress(KeyboardInterrupt):  # a second one: disable it at once
            for _ in range(round(PRESS_DELAY_S / client.period) if requested else 0):
                if client.operating_state().is_busy:
                    break
                client.transport.sleep(client.period)
        now = client.operating_state()
        if now.is_busy or (requested and not now.is_homed):
            client.state_command("disable")
            error.add_note("the robot was homing; it was disabled")
    except CatenaryError as another:
        error.add_note(f"the robot may still be homing, press its e-stop; disabling it failed: {another}")
