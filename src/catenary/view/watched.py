"""A robot that is only shown, over ROS, read and never moved; a snapshot as a state of the view."""

import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from catenary.arrays import Floats
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
    rows = {name: getattr(snapshot, name) for name in _OF_JOINTS} | {"true": _true(snapshot)}
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


def _true(snapshot: Snapshot) -> Floats | None:
    encoder, error = snapshot.encoder, snapshot.error
    compared = snapshot.calibrated is not None or error is None
    if encoder is not None and compared and np.isfinite(encoder).any():
        return encoder
    return None if error is None else snapshot.q[: len(error)] - error


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
