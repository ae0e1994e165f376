"""A robot that is only shown, over ROS, read and never moved; a snapshot as a state of the view."""

import time
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

from catenary.arrays import Floats
from catenary.monitor import Snapshot
from catenary.plant import OperatingState
from catenary.view.page_process import PageProcess
from catenary.view.shapes import ArmShapes
from catenary.view.shown import Shown, Value
from catenary.view.state import ViewState, unknown_state
from catenary.workflows.robot.operated_robot import OperatedRobot
from catenary.workflows.robot.snapshots import watch_robot

_OF_JOINTS = ("q", "calibrated", "interval", "inside", "setpoint", "tau", "gravity_tau")  # of a snapshot


def view_state(
    snapshot: Snapshot,
    n: int,
    *,
    feedback: Floats | None = None,
    assumed: Floats | None = None,
    actual: Floats | None = None,
    nominal_hz: float | None = None,
    mode: str = "",
    notes: tuple[str, ...] = (),
    values: Mapping[str, Value] = {},  # nobody writes it
) -> ViewState:
    """Return what the view shows of a snapshot.

    The true arm is the one that external encoders tell of where a model is there that learned from them, and that of
    the joints themselves otherwise: a RAVEN-II's encoders call other places zero than the robot does.

    Args:
        snapshot: Of a robot whose first n joints are the model's.
        feedback: (n,) torque of the PD term [Nm|N].
        assumed: (3,) gravity that the controller goes by [m/s2].
        actual: (3,) gravity as it is [m/s2].
        nominal_hz: At which ticks should come.
        mode: What the robot does, in words; its operating state when empty.
    """
    state = unknown_state(n)
    of_joints = {name: getattr(snapshot, name) for name in _OF_JOINTS} | {"true": _true(snapshot), "feedback": feedback}
    vectors = {"gravity": snapshot.gravity, "assumed": assumed, "actual": actual}
    known = {name: np.asarray(row, dtype=float)[:n] for name, row in of_joints.items() if row is not None}
    known |= {name: vector for name, vector in vectors.items() if vector is not None}
    rate = np.nan
    if nominal_hz is not None and snapshot.rate_hz is not None:
        rate = snapshot.rate_hz / nominal_hz
    return state._replace(
        **known,
        time=snapshot.time,
        gravity_age=snapshot.gravity_age,
        rate=rate,
        late=float(snapshot.late),
        mode=mode or operating_in_words(snapshot.operating),
        warnings=(*snapshot.warnings(), *notes),
        values=values,
    )


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

    def run(self, page: PageProcess, ended: Callable[[], bool] = lambda: False) -> None:
        """Show the robot until the page is gone or `ended` says so."""
        n, hertz = self._robot.model.n, 1.0 / self._robot.plant.period
        watched = watch_robot(self._robot, model=self._model, observe=lambda: self._tick(page), clock=self._clock)
        for snapshot in watched:
            page.put(view_state(snapshot, n, nominal_hz=hertz, mode=self._mode(snapshot)))
            if ended() or not page.is_running:
                return

    def _tick(self, page: PageProcess) -> None:
        """Let the page's changes go: nothing here moves a robot."""
        page.changes()

    def _mode(self, snapshot: Snapshot) -> str:
        return operating_in_words(snapshot.operating)
