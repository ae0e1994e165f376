"""A robot over ROS that is shown, or moved from the page by held buttons: run levels, dead man, limits are teleop's.

A snapshot of it as a state of the view.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from catenary.errors import CatenaryError
from catenary.monitor import Snapshot
from catenary.plant import Bounded, OperatingState
from catenary.teleop.driver import AXES, BACKWARD, COMMANDS, FORWARD, HOLD, TeleopDriver
from catenary.view.page_process import PageProcess
from catenary.view.shapes import ArmShapes
from catenary.view.shown import NOBODY, Change, Control, ControlTab, Shown
from catenary.view.state import ViewState, unknown_state
from catenary.workflows.robot.operated_robot import OperatedRobot
from catenary.workflows.robot.snapshots import watch_robot

_OF_JOINTS = ("q", "calibrated", "interval", "inside", "setpoint", "tau", "gravity_tau")  # of a snapshot


def view_state(snapshot: Snapshot, n: int, nominal_hz: float, *, notes: Sequence[str] = (), **known: Any) -> ViewState:
    """Return what the view shows of a snapshot of a robot whose first n joints are the model's.

    The true arm is what external encoders tell where a model is there that learned from them, else the joints
    themselves: a RAVEN-II's encoders call other places zero. `known` are fields of ViewState that a snapshot does not
    have.
    """
    encoder, error = snapshot.encoder, snapshot.error
    true = None if error is None else snapshot.q[: len(error)] - error
    if encoder is not None and (snapshot.calibrated is not None or error is None) and np.isfinite(encoder).any():
        true = encoder
    rows = {name: getattr(snapshot, name) for name in _OF_JOINTS} | {"true": true}
    known = {name: value for name, value in known.items() if value is not None}
    known |= {name: np.asarray(row, dtype=float)[:n] for name, row in rows.items() if row is not None}
    known |= {} if snapshot.gravity is None else {"gravity": snapshot.gravity}
    rate = np.nan if snapshot.rate_hz is None else snapshot.rate_hz / nominal_hz
    return unknown_state(n)._replace(
        time=snapshot.time, gravity_age=snapshot.gravity_age, rate=rate, late=float(snapshot.late),
        warnings=(*snapshot.warnings(), *notes), **known,
    )  # fmt: skip


def operating_in_words(state: OperatingState | None) -> str:
    """Return a robot's operating state as text; nothing of a recording."""
    if state is None:
        return ""
    homed = "homing" if state.is_busy else "homed" if state.is_homed else "not homed"
    return f"{state.state}, {homed}"


class WatchedArm:
    """A robot that is read, and its model; without one, the page shows what `catenary deploy` publishes."""

    def __init__(
        self,
        robot: OperatedRobot,
        shapes: ArmShapes,
        model: Path | None = None,
        *,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """Take a robot in any state."""
        self._robot, self._shapes, self._model, self._clock = robot, shapes, model, clock

    def shown(self, title: str) -> Shown:
        """Return what its page shows: nothing to drive it by."""
        legend = {"reported": "reported", "calibrated": "calibrated"}
        if self._robot.truth() is not None:
            legend["true"] = "true"
        return Shown(title, self._robot.model, self._shapes, legend=legend)

    def run(self, page: PageProcess, ended: Callable[[], bool] = lambda: False) -> None:
        """Show the robot until the page is gone or `ended` says so."""
        n, hertz = self._robot.model.n, 1.0 / self._robot.plant.period
        watched = watch_robot(self._robot, model=self._model, tick=lambda: self._tick(page), clock=self._clock)
        for snapshot in watched:
            page.put(view_state(snapshot, n, hertz, mode=self._mode(snapshot)))
            if ended() or not page.is_running:
                return

    def _tick(self, page: PageProcess) -> None:
        """Discard the page's changes: nothing here moves a robot."""
        page.changes()

    def _mode(self, snapshot: Snapshot) -> str:
        return operating_in_words(snapshot.operating)


HELD = "held:"  # begins the name of a button that moves; a key of teleop ends it
LEVEL, STOP = "level:", "stop:"  # begin the names of rows of buttons, which are in every tab
LEVELS: dict[str, str] = {command: key for key, command in COMMANDS.items()}
STOPS = {"stop": HOLD, "slower": "-", "faster": "+"}
FIRST = "hold a button to move"


class ControlledArm(WatchedArm):
    """A robot, a page that moves it, and its model."""

    @cached_property
    def _driver(self) -> TeleopDriver:
        """Sends nothing until somebody presses a button."""
        driver = TeleopDriver(self._robot.plant, self._robot.model)
        driver.message = FIRST
        return driver

    def shown(self, title: str) -> Shown:
        """Return what its page shows: buttons for joints, tip and run levels."""
        return replace(super().shown(title), tabs=held_tabs(self._robot.plant))

    def run(self, page: PageProcess, ended: Callable[[], bool] = lambda: False) -> None:
        """Move the robot as the page says until it is gone or `ended` says so; then hold and pause it."""
        try:
            super().run(page, ended)
        finally:
            self._driver.leave()

    def _tick(self, page: PageProcess) -> None:
        """Do what the page wants in a tick; a robot that cannot be reached or is another's is sent nothing."""
        try:
            for change in page.changes():
                if self._take(change):
                    page.changes()  # what was held while a run level was being reached is not made up for
                    break
            self._driver.step(self._clock())
        except CatenaryError as error:
            self._driver.fail(error)

    def _mode(self, snapshot: Snapshot) -> str:
        state, message = snapshot.operating, self._driver.message
        said = super()._mode(snapshot)
        return said if state is not None and message == self._driver.in_words(state) else f"{said}: {message}"

    def _take(self, change: Change) -> bool:
        """Take a change, and return whether it asked for a run level, which takes its time."""
        name, value = change
        now = self._clock()
        if name.startswith(HELD):
            self._driver.press(name.removeprefix(HELD), now)
        elif name.startswith(STOP) and value in STOPS:
            self._driver.press(STOPS[str(value)], now)
        elif name.startswith(LEVEL) and value in LEVELS:
            self._driver.press(LEVELS[str(value)], now)
            return True
        elif change == NOBODY:  # as when a terminal is closed
            self._driver.leave()
            return True
        return False


def held_tabs(limits: Bounded) -> tuple[ControlTab, ...]:
    """Return tabs of buttons: one pair per joint, nine joints at most, and one per axis that the tip moves along."""
    joints = [
        Control("held", f"{HELD}{key}", f"{name} {sign}")
        for name, keys in zip(limits.joint_names, zip(FORWARD, BACKWARD, strict=True), strict=False)
        for key, sign in zip(keys, "+-", strict=True)
    ]
    axes = [
        Control("held", f"{HELD}{key}", f"{'xyz'[axis]} {'+' if sign > 0.0 else '-'}")
        for key, (axis, sign) in AXES.items()
    ]
    text = "Moves for as long as a button is held."
    return (
        ControlTab("Joints", (*_rows("joints"), *joints), text),
        ControlTab("Tip", (*_rows("tip"), *axes), f"{text} Along the axes of the base."),
    )


def _rows(tab: str) -> tuple[Control, ...]:
    return (
        Control("buttons", f"{LEVEL}{tab}", "run level", None, tuple(LEVELS), "Home wants to be pressed twice."),
        Control("buttons", f"{STOP}{tab}", "motion", None, tuple(STOPS), "Stop: at once. The robot stays enabled."),
    )
