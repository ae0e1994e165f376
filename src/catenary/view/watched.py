"""A robot beside which the view only shows: over ROS, read and never moved."""

from collections.abc import Callable
from pathlib import Path

from catenary.view.from_snapshot import view_state
from catenary.view.page_like import StatePage
from catenary.view.shapes import ArmShapes
from catenary.view.shown import Shown
from catenary.workflows.robot.operated_robot import OperatedRobot
from catenary.workflows.robot.watch import watch_robot


class WatchedArm:
    """A robot that is read, and a model beside it; without one, what `catenary deploy` publishes is taken."""

    def __init__(self, robot: OperatedRobot, shapes: ArmShapes, model: Path | None = None) -> None:
        """Take a robot in any state."""
        self._robot, self._shapes, self._model = robot, shapes, model

    def shown(self, title: str) -> Shown:
        """Return what its page shows: nothing to drive it by."""
        legend = {"reported": "reported", "calibrated": "calibrated"}
        if self._robot.truth() is not None:
            legend["true"] = "true"
        return Shown(title, self._robot.model, self._shapes, legend=legend)

    def run(self, page: StatePage, ended: Callable[[], bool] = lambda: False) -> None:
        """Show the robot until the page is gone or `ended` says so."""
        n, hertz = self._robot.model.n, 1.0 / self._robot.plant.period
        for snapshot in watch_robot(self._robot, model=self._model):
            page.changes()  # nothing here drives a robot
            page.put(view_state(snapshot, n, nominal_hz=hertz))
            if ended() or not page.is_running:
                return
