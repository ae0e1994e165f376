"""A recording as states of the view: calibrated joints, their intervals, errors and torques of every row."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from catenary.arrays import Floats
from catenary.calibration.model import CalibrationModel
from catenary.errors import InputError
from catenary.gravity.torque import gravity_torque
from catenary.plant import Joints, MotionLog, places_of
from catenary.robots.model import RobotModel
from catenary.spatial import LEVEL
from catenary.view.curves import SPACING, JointColumns
from catenary.view.state import ViewState, unknown_state


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
        n = self.model.n
        warnings = []
        outside = [self.model.joint_names[j] for j in np.flatnonzero(self.inside[row] == 0.0)]
        if outside:
            warnings.append(f"outside the model's valid range: {', '.join(outside)}")
        if np.isfinite(self.true).any() and not np.isfinite(self.true[row, list(self.joints)]).all():
            warnings.append("no truth on this row")
        return unknown_state(n)._replace(
            time=float(self.time[row]),
            q=self.q[row],
            calibrated=self.calibrated[row],
            interval=self.interval[row],
            inside=self.inside[row],
            true=self.true[row],
            tau=self.tau[row],
            gravity_tau=self.gravity_tau[row],
            mode="recording of a simulated robot" if self.simulated else "recording",
            warnings=tuple(warnings),
        )

    def columns(self) -> JointColumns:
        """Return what is drawn as curves, no closer than SPACING."""
        kept = np.flatnonzero(np.diff(np.floor(self.time / SPACING), prepend=-1.0) != 0.0)
        unknown = np.full((len(kept), self.model.n), np.nan)
        return JointColumns(
            self.time[kept], self.q[kept], self.calibrated[kept], self.interval[kept], self.true[kept], unknown,
            self.tau[kept], self.gravity_tau[kept], unknown,
        )  # fmt: skip


def recorded_arm(log: MotionLog, robot: RobotModel, model: CalibrationModel | None = None) -> RecordedArm:
    """Return a recording's rows as a robot's joints, calibrated where there is a model.

    Args:
        log: With time; of several recordings one after the other, time goes on from one to the next.
        robot: Has the recording's joints by name; others of its joints are at zero.
        model: Of some of the recording's joints.
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
    there = places_of(here, log, whose=f'recording "{log.name}"', of=f'robot "{robot.name}" has')

    def of(values: Floats | None, missing: float = np.nan) -> Floats:
        rows = np.full((len(log), robot.n), missing)
        if values is not None:
            rows[:, named] = values[:, there]
        return rows

    q = of(log.q_nominal, 0.0)
    true = None if log.q_encoder is None else np.where(log.ok[:, None], log.q_encoder, np.nan)
    calibrated, interval, inside = _calibrated(log, model)
    absent = [j for j in range(robot.n) if j not in named]
    seen, said = of(true), of(calibrated)
    for values, known in ((seen, true), (said, calibrated)):
        if known is not None:
            values[:, absent] = 0.0
    time = np.concatenate([[0.0], np.cumsum(np.maximum(np.diff(log.time), 0.0))])
    return RecordedArm(
        robot, time, q, seen, said, of(interval), of(inside), of(log.tau), log.simulated, tuple(named)
    )


def _calibrated(
    log: MotionLog, model: CalibrationModel | None
) -> tuple[Floats | None, Floats | None, Floats | None]:
    """Return calibrated joints, half-widths and flags, each (N, joints of the log); None without a model."""
    if model is None:
        return None, None, None
    places = places_of(model, log, whose=f'recording "{log.name}"', of="the model is for")
    calibrated, interval = np.array(log.q_nominal), np.full(log.q_nominal.shape, np.nan)
    inside = np.ones(log.q_nominal.shape)
    features, leaping, _ = model.features.rows(log)
    correction, flags, widths = model.correct(features, log.q_nominal[:, places], leaping)
    calibrated[:, places] += correction
    interval[:, places], inside[:, places] = widths, flags
    return calibrated, interval, inside
