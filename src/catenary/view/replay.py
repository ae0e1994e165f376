"""A recording on the page, or a project's: its rows as states, played, and the way to its largest error."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from catenary.arrays import Flags, Floats
from catenary.calibration.model import CalibrationModel
from catenary.errors import ConfigError, InputError
from catenary.gravity.torque import gravity_torque
from catenary.plant import Joints, MotionLog, places_of
from catenary.robots.model import RobotModel
from catenary.spatial import LEVEL
from catenary.view.curves import SPACING, JointColumns
from catenary.view.page_process import PageProcess
from catenary.view.shapes import ArmShapes, arm_shapes
from catenary.view.shown import (
    ButtonsControl,
    Change,
    ChoiceControl,
    ControlTab,
    Shown,
    SliderControl,
    ToggleControl,
    Value,
)
from catenary.view.state import ViewState, unknown_state
from catenary.workflows.project.calibrate import RECOMMENDED, TEST, TRAIN
from catenary.workflows.project.folder import project_settings
from catenary.workflows.robot.snapshots import Corrected, corrected_rows

SPEEDS = ("1/4", "1", "4", "16", "64")
EVERY = 0.04  # [s] between two states
NOW = 0.25  # [s] between two places of the time line's slider


@dataclass(frozen=True, eq=False)
class RecordedArm:
    """A robot's joints as a recording has them, rows (N, n) [rad|m]; joints that it does not have stay at zero."""

    model: RobotModel
    time: Floats  # (N,) [s]
    q: Floats
    true: Floats  # NaN where it has no truth
    calibrated: Floats  # NaN without a model
    interval: Floats
    inside: Floats
    tau: Floats  # NaN where it has no torques
    simulated: bool
    joints: tuple[int, ...]  # of the model's joints, those that the recording has

    @cached_property
    def gravity_tau(self) -> Floats:
        """What holds the arm still on a level base, (N, n) [Nm|N]; NaN where there are no torques to compare with."""
        if self.model.missing_inertia or not np.isfinite(self.tau).any():
            return np.full_like(self.tau, np.nan)
        return np.asarray(gravity_torque(self.model, self.q, LEVEL))

    @cached_property
    def error(self) -> Floats:
        """What is wrong with the best that is known, calibrated or reported, (N, n) [rad|m]; NaN without truth."""
        known = self.q if np.isnan(self.calibrated).all() else self.calibrated
        return known - self.true

    def worst_row(self, joint: int) -> int | None:
        """Return where a joint's error is largest; None without truth."""
        error = np.abs(self.error[:, joint])
        return int(np.nanargmax(error)) if np.isfinite(error).any() else None

    def state(self, row: int) -> ViewState:
        """Return the state of a row."""
        warnings = []
        outside = [self.model.joint_names[j] for j in np.flatnonzero(self.inside[row] == 0.0)]
        if outside:
            warnings.append(f"outside the model's valid range: {', '.join(outside)}")
        if np.isfinite(self.true).any() and not np.isfinite(self.true[row, list(self.joints)]).all():
            warnings.append("no truth on this row")
        told = ("q", "calibrated", "interval", "inside", "true", "tau", "gravity_tau")
        mode = "recording of a simulated robot" if self.simulated else "recording"
        return unknown_state(self.model.n)._replace(
            **{name: getattr(self, name)[row] for name in told},
            time=float(self.time[row]), mode=mode, warnings=tuple(warnings),
        )  # fmt: skip

    def columns(self) -> JointColumns:
        """Return what is drawn as curves, no closer than SPACING."""
        kept = np.flatnonzero(np.diff(np.floor(self.time / SPACING), prepend=-1.0) != 0.0)
        unknown = np.full((len(kept), self.model.n), np.nan)
        return JointColumns(
            self.time[kept], self.q[kept], self.calibrated[kept], self.interval[kept], self.true[kept], unknown,
            self.tau[kept], self.gravity_tau[kept], unknown,
        )  # fmt: skip


def recorded_arm(log: MotionLog, robot: RobotModel, model: CalibrationModel | None = None) -> RecordedArm:
    """Return a recording's rows as a robot's joints by name, others at zero, calibrated by a model of some."""
    if log.time is None:
        raise InputError(f'recording "{log.name}": has no time; it cannot be shown')
    named = [j for j, name in enumerate(robot.joint_names) if name in log.joint_names]
    if not named:
        raise InputError(
            f'recording "{log.name}": has joints {", ".join(log.joint_names)}, robot "{robot.name}" has '
            f"{', '.join(robot.joint_names)}; name the robot that it is of"
        )
    here = Joints(*(tuple(of[j] for j in named) for of in (robot.joint_names, robot.joint_units)))
    there = places_of(here, log, whose=f'recording "{log.name}"', of=f'robot "{robot.name}" has')

    def of(values: Floats | Flags | None, missing: float = np.nan) -> Floats:
        rows = np.full((len(log), robot.n), missing)
        if values is not None:
            rows[:, named] = values[:, there]
        return rows

    q = of(log.q_nominal, 0.0)
    true = None if log.q_encoder is None else np.where(log.ok[:, None], log.q_encoder, np.nan)
    calibrated, inside, interval = Corrected() if model is None else corrected_rows(log, model)
    absent = [j for j in range(robot.n) if j not in named]
    seen, said = of(true), of(calibrated)
    for values, known in ((seen, true), (said, calibrated)):
        if known is not None:
            values[:, absent] = 0.0
    time = np.concatenate([[0.0], np.cumsum(np.maximum(np.diff(log.time), 0.0))])
    return RecordedArm(robot, time, q, seen, said, of(interval), of(inside), of(log.tau), log.simulated, tuple(named))


def shown_project(folder: Path) -> tuple[Path, Path | None, str | None]:
    """Return a project's test or training recording, its recommended model and its robot, where there are any."""
    settings = project_settings(folder)
    logs = [folder / f"{name}.parquet" for name in (TEST, TRAIN)]
    found = [log for log in logs if log.is_file()]
    if not found:
        raise ConfigError(f"{folder}: holds no motion log yet; run catenary calibrate {folder}")
    model = folder / "models" / f"{RECOMMENDED}.npz"
    robot = None
    if settings is not None:
        robot = "raven2_right" if settings.side == "right" and settings.robot == "raven2" else settings.robot
    return found[0], model if model.is_file() else None, robot


class Replay:
    """A recording, where it is being played, and how fast."""

    def __init__(self, arm: RecordedArm, shapes: ArmShapes | None = None) -> None:
        """Begin at the first row, playing; without shapes the arm is drawn from its kinematics."""
        self._arm = arm
        self._shapes = arm_shapes(arm.model) if shapes is None else shapes
        self._now = float(arm.time[0])  # [s]
        self._speed, self._plays = 1.0, True
        self._told = -np.inf
        self._values: dict[str, Value] = {}

    def shown(self, title: str) -> Shown:
        """Return what its page shows."""
        arm, end = self._arm, float(self._arm.time[-1])
        legend = {"reported": "reported"}
        if np.isfinite(arm.calibrated).any():
            legend["calibrated"] = "calibrated"
        if np.isfinite(arm.true).any():
            legend["true"] = "measured"
        step = max(round(end / 2000.0, 2), 0.01)
        controls = (
            ToggleControl("plays", "play", True),
            SliderControl("time", "time [s]", 0.0, max(step, float(np.ceil(end / step)) * step), step, 0.0),
            ChoiceControl("speed", "speed", SPEEDS, "1"),
        )
        worst = tuple(arm.model.joint_names[j] for j in arm.joints)
        if "true" in legend:
            controls = (*controls, ButtonsControl("worst", "largest error of", worst))  # type: ignore[assignment]
        text = "The curves show 15 s before and after now."
        return Shown(
            title, arm.model, self._shapes, (ControlTab("Recording", controls, text),), arm.q[0], legend,
            arm.columns(),
        )  # fmt: skip

    def run(
        self,
        page: PageProcess,
        ended: Callable[[], bool] = lambda: False,
        *,
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        """Play until the page is gone or `ended` says so; at its end the recording begins again."""
        before = clock()
        while page.is_running and not ended():
            for change in page.changes():
                self.take(change)
            now = clock()
            if self._plays:
                self._now += self._speed * (now - before)
                if self._now > self._arm.time[-1]:
                    self._now = 0.0
            before = now
            if self._plays and now - self._told >= NOW:  # the slider of the time line moves along
                self._told, self._values = now, {"time": round(self._now, 2)}
            row = int(np.searchsorted(self._arm.time, self._now, side="right")) - 1
            page.put(self._arm.state(max(row, 0))._replace(values=dict(self._values)))
            sleep(EVERY)

    def take(self, change: Change) -> None:
        """Do what somebody wants."""
        name, value = change
        if name == "plays":
            self._plays = bool(value)
        elif name == "time":
            self._now = float(np.clip(float(value), 0.0, self._arm.time[-1]))
        elif name == "speed" and value in SPEEDS:
            self._speed = 0.25 if value == "1/4" else float(value)
        elif name == "worst" and value in self._arm.model.joint_names:
            row = self._arm.worst_row(self._arm.model.joint_names.index(str(value)))
            if row is not None:
                self._now, self._plays = float(self._arm.time[row]), False
                self._values |= {"plays": False, "time": round(self._now, 2)}
