"""Views without control: replay of a recording, with navigation to its largest error, and a watched robot on ROS."""

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from catenary.arrays import Flags, Floats
from catenary.calibration.model import CalibrationModel
from catenary.errors import ConfigError, InputError
from catenary.gravity.torque import gravity_torque
from catenary.monitor import Snapshot
from catenary.plant import Joints, MotionLog, joint_indices
from catenary.robots.model import RobotModel
from catenary.spatial import LEVEL
from catenary.view.meshes import ArmShapes, arm_shapes
from catenary.view.page_content import SPACING_S, Change, Control, ControlTab, PageContent, Value
from catenary.view.page_process import PageProcess
from catenary.workflows.project.calibrate import RECOMMENDED, TEST, TRAIN
from catenary.workflows.project.folder import project_settings
from catenary.workflows.robot.operated_robot import OperatedRobot
from catenary.workflows.robot.snapshots import Corrected, corrected_rows, watch_robot

_SPEEDS = ("1/4", "1", "4", "16", "64")
_STATE_EVERY_S = 0.04  # [s] between two states
_SLIDER_STEP_S = 0.25  # [s] between two updates of the time slider


@dataclass(frozen=True, eq=False)
class RecordedArm:
    """A robot's joints over a recording; joints that are not recorded stay at zero."""

    model: RobotModel
    rows: Mapping[str, Floats]  # arrays (N, n) of `Curves`, `inside` 0 outside, and `time` (N,); NaN: unknown
    simulated: bool
    joints: tuple[int, ...]  # indices of the recorded joints

    def knows(self, name: str) -> bool:
        """Return true if any row has values of a field."""
        return bool(np.isfinite(self.rows[name]).any())

    def worst_row(self, joint: int) -> int | None:
        """Return the row of the largest error of calibrated, or else reported, positions; None without truth."""
        known = self.rows["calibrated" if self.knows("calibrated") else "q"]
        error = np.abs(known - self.rows["true"])[:, joint]
        return int(np.nanargmax(error)) if np.isfinite(error).any() else None

    def state(self, row: int) -> Snapshot:
        """Return the state of a row."""
        row_of = {name: column[row] for name, column in self.rows.items()}
        is_measured = np.isfinite(row_of["true"][list(self.joints)]).all() or not self.knows("true")
        return Snapshot(
            float(row_of["time"]), self.model.joint_names, self.model.joint_units, row_of["q"],
            calibrated=row_of["calibrated"], inside=row_of["inside"] != 0.0, interval=row_of["interval"],
            encoder=row_of["true"], tau=row_of["tau"], gravity_tau=row_of["gravity_tau"],
            doing=" of a simulated robot" * self.simulated,
            notes=() if is_measured else ("no truth on this row",),
        )  # fmt: skip

    def columns(self) -> dict[str, Floats]:
        """Return the columns for curves, at intervals of at least SPACING_S."""
        kept = np.flatnonzero(np.diff(np.floor(self.rows["time"] / SPACING_S), prepend=-1.0) != 0.0)
        return {name: column[kept] for name, column in self.rows.items()}


def recorded_arm(log: MotionLog, robot: RobotModel, model: CalibrationModel | None = None) -> RecordedArm:
    """Map a recording to a robot's joints by name.

    Gravity torques are those on a level base; unknown without recorded torques to compare with.

    Args:
        log: Recording with time.
        robot: Robot with some of its joints; the others are at zero.
        model: Calibration model of some joints, if any.
    """
    if log.time is None:
        raise InputError(f'recording "{log.name}": has no time; it cannot be shown')
    named = [j for j, name in enumerate(robot.joint_names) if name in log.joint_names]
    if not named:
        raise InputError(
            f'recording "{log.name}": has joints {", ".join(log.joint_names)}, robot "{robot.name}" has '
            f"{', '.join(robot.joint_names)}; name the robot that it is of"
        )
    here = Joints(*(tuple(of[j] for j in named) for of in (robot.joint_names, robot.joint_units)))
    there = joint_indices(here, log, whose=f'recording "{log.name}"', of=f'robot "{robot.name}" has')

    def of(values: Floats | Flags | None, others: float = np.nan) -> Floats:
        """Return values (N, n) of the robot's joints, `others` for joints that are not recorded."""
        rows = np.full((len(log), robot.n), np.nan if values is None else others)
        if values is not None:
            rows[:, named] = values[:, there]
        return rows

    q, tau = of(log.q_nominal, 0.0), of(log.tau)
    true = None if log.q_encoder is None else np.where(log.ok[:, None], log.q_encoder, np.nan)
    calibrated, inside, interval = Corrected() if model is None else corrected_rows(log, model)
    holding = np.full_like(tau, np.nan)
    if np.isfinite(tau).any() and not robot.missing_inertia:
        holding = np.asarray(gravity_torque(robot, q, LEVEL))
    rows = {
        "time": np.concatenate([[0.0], np.cumsum(np.maximum(np.diff(log.time), 0.0))]),
        "q": q, "calibrated": of(calibrated, 0.0), "interval": of(interval), "inside": of(inside),
        "true": of(true, 0.0), "tau": tau, "gravity_tau": holding,
    }  # fmt: skip
    return RecordedArm(robot, rows, log.simulated, tuple(named))


def shown_project(folder: Path) -> tuple[Path, Path | None, str | None]:
    """Return a project's test or training recording, its recommended model and its robot, if available."""
    settings = project_settings(folder)
    logs = [log for log in (folder / f"{name}.parquet" for name in (TEST, TRAIN)) if log.is_file()]
    if not logs:
        raise ConfigError(f"{folder}: holds no motion log yet; run catenary calibrate {folder}")
    model = folder / "models" / f"{RECOMMENDED}.npz"
    robot = None
    if settings is not None:
        robot = "raven2_right" if settings.side == "right" and settings.robot == "raven2" else settings.robot
    return logs[0], model if model.is_file() else None, robot


class Replay:
    """Player of a recording, from its first row on; the arm's links are tubes where `shapes` is None."""

    def __init__(self, arm: RecordedArm, shapes: ArmShapes | None = None) -> None:
        self._arm, self._time = arm, arm.rows["time"]
        self._shapes = arm_shapes(arm.model) if shapes is None else shapes
        self._now = float(self._time[0])  # [s]
        self._speed, self._plays = 1.0, True
        self._updated = -np.inf  # time of the last slider update [s]
        self._values: dict[str, Value] = {}

    def shown(self, title: str) -> PageContent:
        """Return the content of its page."""
        arm, end = self._arm, float(self._time[-1])
        legend = {"reported": "reported"}
        legend |= {"calibrated": "calibrated"} if arm.knows("calibrated") else {}
        step = max(round(end / 2000.0, 2), 0.01)
        controls = [
            Control("switch", "plays", "play", True),
            Control("slider", "time", "time [s]", 0.0, (0.0, max(step, float(np.ceil(end / step)) * step), step)),
            Control("choice", "speed", "speed", "1", _SPEEDS),
        ]
        if arm.knows("true"):
            legend["true"] = "measured"
            names = tuple(arm.model.joint_names[j] for j in arm.joints)
            controls.append(Control("buttons", "worst", "largest error of", options=names))
        tab = ControlTab("Recording", tuple(controls), "The curves show 15 s before and after now.")
        return PageContent(title, arm.model, self._shapes, (tab,), arm.rows["q"][0], legend, arm.columns())

    def run(
        self,
        page: PageProcess,
        ended: Callable[[], bool] = lambda: False,
        *,
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        """Play in a loop until the page or `ended` ends it."""
        before = clock()
        while page.is_running and not ended():
            for change in page.changes():
                self.take(change)
            now = clock()
            if self._plays:
                self._now += self._speed * (now - before)
                if self._now > self._time[-1]:
                    self._now = 0.0
            before = now
            if self._plays and now - self._updated >= _SLIDER_STEP_S:
                self._updated, self._values = now, {"time": round(self._now, 2)}
            row = int(np.searchsorted(self._time, self._now, side="right")) - 1
            page.put(self._arm.state(max(row, 0)), self._values)
            sleep(_STATE_EVERY_S)

    def take(self, change: Change) -> None:
        """Apply a change of a control."""
        name, value = change
        if name == "plays":
            self._plays = bool(value)
        elif name == "time":
            self._now = float(np.clip(float(value), 0.0, self._time[-1]))
        elif name == "speed" and value in _SPEEDS:
            self._speed = 0.25 if value == "1/4" else float(value)
        elif name == "worst" and value in self._arm.model.joint_names:
            row = self._arm.worst_row(self._arm.model.joint_names.index(str(value)))
            if row is not None:
                self._now, self._plays = float(self._time[row]), False
                self._values |= {"plays": False, "time": round(self._now, 2)}


class WatchedArm:
    """View of a robot that is only read; without a model, it shows the positions published by `catenary deploy`."""

    def __init__(self, robot: OperatedRobot, shapes: ArmShapes, model: CalibrationModel | None = None) -> None:
        """Set the robot, in any state, and the model that corrects it, if any."""
        self._robot, self._shapes, self._model = robot, shapes, model

    def shown(self, title: str) -> PageContent:
        """Return the content of its page, without controls."""
        legend = {"reported": "reported", "calibrated": "calibrated"}
        if self._robot.truth() is not None:
            legend["true"] = "true"
        hertz = 1.0 / self._robot.plant.period
        return PageContent(title, self._robot.model, self._shapes, legend=legend, nominal_hz=hertz)

    def run(self, page: PageProcess, ended: Callable[[], bool] = lambda: False) -> None:
        """Show the robot until the page or `ended` ends it."""
        # changes on the page are discarded: nothing here moves a robot
        for snapshot in watch_robot(self._robot, model=self._model, tick=page.changes):
            page.put(snapshot)
            if ended() or not page.is_running:
                return
