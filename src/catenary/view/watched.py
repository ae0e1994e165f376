"""A robot beside which the view only shows: over ROS, read and never moved."""

import time
from collections.abc import Callable
from pathlib import Path

from catenary.monitor import Snapshot
from catenary.view.from_snapshot import state_in_words, view_state
from catenary.view.page_process import StatePage
from catenary.view.shapes import ArmShapes
from catenary.view.shown import Shown
from catenary.workflows.robot.operated_robot import OperatedRobot
from catenary.workflows.robot.snapshots import watch_robot


class WatchedArm:
    """A robot that is read, and a model beside it; without one, what `catenary deploy` publishes is taken."""

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

    def run(self, page: StatePage, ended: Callable[[], bool] = lambda: False) -> None:
        """Show the robot until the page is gone or `ended` says so."""
        n, hertz = self._robot.model.n, 1.0 / self._robot.plant.period
        watched = watch_robot(
            self._robot, model=self._model, observe=lambda: self._tick(page), clock=self._clock
        )
        for snapshot in watched:
            page.put(view_state(snapshot, n, nominal_hz=hertz, mode=self._mode(snapshot)))
            if ended() or not page.is_running:
                return

    def _tick(self, page: StatePage) -> None:
        """Let the page's changes go: nothing here moves a robot."""
        page.changes()

    def _mode(self, snapshot: Snapshot) -> str:
        return state_in_words(snapshot)
