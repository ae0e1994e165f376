"""A robot over ROS that is shown, and never moved: a snapshot of it as a state of the view."""

import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from catenary.monitor import Snapshot
from catenary.plant import OperatingState
from catenary.view.page_process import PageProcess
from catenary.view.shapes import ArmShapes
from catenary.view.shown import Shown
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
        # what comes from the page is discarded: nothing here moves a robot
        for snapshot in watch_robot(self._robot, model=self._model, tick=page.changes, clock=self._clock):
            page.put(view_state(snapshot, n, hertz, mode=operating_in_words(snapshot.operating)))
            if ended() or not page.is_running:
                return
