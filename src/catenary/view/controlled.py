"""A robot that is moved from the page by held buttons: run levels, dead man and limits are those of teleop."""

from collections.abc import Callable
from dataclasses import replace
from functools import cached_property

from catenary.errors import CatenaryError
from catenary.monitor import Snapshot
from catenary.plant import Bounded
from catenary.teleop.driver import AXES, BACKWARD, COMMANDS, FORWARD, HOLD, TeleopDriver
from catenary.view.page_process import PageProcess
from catenary.view.shown import NOBODY, ButtonsControl, Change, Control, ControlTab, HeldControl, Shown
from catenary.view.watched import WatchedArm

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
        HeldControl(f"{HELD}{key}", f"{name} {sign}")
        for name, keys in zip(limits.joint_names, zip(FORWARD, BACKWARD, strict=True), strict=False)
        for key, sign in zip(keys, "+-", strict=True)
    ]
    axes = [
        HeldControl(f"{HELD}{key}", f"{'xyz'[axis]} {'+' if sign > 0.0 else '-'}") for key, (axis, sign) in AXES.items()
    ]
    text = "Moves for as long as a button is held."
    return (
        ControlTab("Joints", (*_rows("joints"), *joints), text),
        ControlTab("Tip", (*_rows("tip"), *axes), f"{text} Along the axes of the base."),
    )


def _rows(tab: str) -> tuple[Control, ...]:
    return (
        ButtonsControl(f"{LEVEL}{tab}", "run level", tuple(LEVELS), hint="Home wants to be pressed twice."),
        ButtonsControl(f"{STOP}{tab}", "motion", tuple(STOPS), hint="Stop: at once. The robot stays enabled."),
    )
