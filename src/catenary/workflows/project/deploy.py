"""Run a calibration model in the 1 kHz loop of a robot, and measure its latency and error there."""

import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from math import nan
from typing import Any

import numpy as np

from catenary.arrays import Floats
from catenary.calibration.corrector import Corrector
from catenary.calibration.evaluate import rms
from catenary.calibration.kernels import Flags
from catenary.calibration.model import CalibrationModel
from catenary.calibration.upkeep.watch import DriftWatch, WatchResult
from catenary.control.loop import Tick, run_loop
from catenary.control.realtime import Durations, Timing
from catenary.control.report import LoopReport
from catenary.crtk.client import CrtkClient
from catenary.crtk.raven_telemetry import registration_of
from catenary.plant import JointState
from catenary.simulation.cabled.firmware_plant import FirmwarePlant
from catenary.trajectories.in_turn import Embedded
from catenary.trajectories.reference import Trajectory
from catenary.units import DISPLAY
from catenary.workflows.robot.motion import check_motion, move_to


@dataclass(frozen=True)
class Deployment:
    """Loop report of a deployed model, and its errors against the joints' true positions."""

    loop: LoopReport
    joint_names: tuple[str, ...]  # of the model
    units: tuple[str, ...]  # deg or mm
    raw_rmse: tuple[float, ...]
    rmse: tuple[float, ...]
    outside: tuple[float, ...]  # share of ticks outside the valid range
    correction: Timing  # [s] of the model's part of each tick
    simulated: bool = True
    leaps: dict[str, int] = field(default_factory=dict)  # by input: positions that play states did not follow
    coverage: tuple[float, ...] | None = (
        None  # share of errors within the model's intervals; None without any
    )
    level: float | None = None  # that they are to hold
    watch: WatchResult | None = None  # signs of drift that need no encoder

    def as_data(self) -> dict[str, Any]:
        """Return plain data: times in microseconds, errors in deg and mm."""
        compute, jitter = self.loop.compute, self.loop.jitter
        return {
            "simulated": self.simulated,
            "ticks": self.loop.ticks,
            "rate_hz": self.loop.rate_hz,
            "compute_us": None if compute is None else compute.in_us(),
            "jitter_us": None if jitter is None else jitter.in_us(),
            "correction_us": self.correction.in_us(),
            "overruns": self.loop.overruns,
            "real_time_priority": self.loop.has_priority,
            "leaps": self.leaps,
            "coverage_asked": self.level,
            "watch": None if self.watch is None else self.watch.as_data(),
            "joints": [
                {
                    "name": name,
                    "unit": unit,
                    "raw_rmse": raw,
                    "rmse": rmse,
                    "outside_valid_range": outside,
                    "coverage": held,
                }
                for name, unit, raw, rmse, outside, held in zip(
                    self.joint_names,
                    self.units,
                    self.raw_rmse,
                    self.rmse,
                    self.outside,
                    self.coverage or [None] * len(self.joint_names),
                    strict=True,
                )
            ],
        }


def deploy_on_robot(
    plant: FirmwarePlant[Any] | CrtkClient,
    model: CalibrationModel,
    trajectory: Trajectory,
    *,
    real_time: bool = False,
) -> Deployment:
    """Run a model in the 1 kHz loop of a robot that follows a trajectory by its own firmware.

    Args:
        plant: Homed and enabled; its external encoders are read in every tick.
        model: Fitted to recordings of this robot.
        trajectory: Of the model's joints.
        real_time: Keep time with the clock also on a simulated robot, to see jitter and overruns.

    Raises:
        LimitError: The trajectory leaves the limits; nothing has moved.
        InputError: The robot lacks a joint or an input of the model.
    """
    places = [plant.joint_names.index(name) for name in model.joint_names if name in plant.joint_names]
    corrector = TimedCorrector(Corrector(model))
    # refuses before anything moves
    corrector.prepare(plant.joint_names, plant.joint_units, 1.0 / plant.period)
    joints = [plant.joint_names[j] for j in places]
    check_motion(plant, trajectory, joints=joints)
    move_to(plant, trajectory(0.0).q, joints=joints)
    motion = Embedded(trajectory, places, plant.setpoint_js().q)
    true: list[Floats] = []
    ticks: list[Tick] = []
    watch = DriftWatch(model, plant.joint_names, plant.joint_units)
    registration = registration_of(plant)
    if registration is not None:
        watch.registered(plant.measured_js().time, registration)

    def observe(tick: Tick) -> None:  # light: it is part of the loop
        watch.update(tick.state.time, tick.q_nominal, tick.state.tau, tick.inside)
        true.append(plant.external_encoders())
        ticks.append(tick)

    report = run_loop(plant, None, motion, corrector=corrector, observers=[observe], real_time=real_time)
    leaps = corrector.corrector.leaps
    scale = np.array([DISPLAY[unit][1] for unit in model.joint_units])
    known = np.array(true)
    half_widths = np.array([tick.state.q_interval[places] for tick in ticks]) * scale
    rows = np.isfinite(known).all(axis=1)
    before = (known - np.array([tick.q_nominal[places] for tick in ticks]))[rows] * scale
    after = (known - np.array([tick.state.q[places] for tick in ticks]))[rows] * scale
    return Deployment(
        loop=report,
        joint_names=model.joint_names,
        units=tuple(DISPLAY[unit][0] for unit in model.joint_units),
        raw_rmse=tuple(rms(column) if len(column) else nan for column in before.T),
        rmse=tuple(rms(column) if len(column) else nan for column in after.T),
        outside=tuple((report.outside_valid_range or ())[place] for place in places),
        correction=corrector.timing(),
        simulated=plant.simulated,
        leaps=leaps,
        coverage=_coverage(after, half_widths[rows]) if model.intervals is not None else None,
        level=None if model.intervals is None else model.intervals.level,
        watch=watch.result(),
    )


def _coverage(errors: Floats, half_widths: Floats) -> tuple[float, ...]:
    """Return the share of errors (N, n) within their intervals, per joint; NaN where no truth is known."""
    return tuple(
        float(np.mean(np.abs(e) <= w)) if len(e) else nan
        for e, w in zip(errors.T, half_widths.T, strict=True)
    )


class TimedCorrector:
    """A corrector that times what it does in each tick but the first, as the loop times whole ticks."""

    def __init__(self, corrector: Corrector) -> None:
        self.corrector = corrector
        self._durations = Durations()
        self._started = False

    def prepare(self, joint_names: Sequence[str], joint_units: Sequence[str], rate_hz: float) -> None:
        """Get ready for a robot; forget all previous ticks."""
        self.corrector.prepare(joint_names, joint_units, rate_hz)
        self._durations, self._started = Durations(), False

    def correct_state(self, state: JointState, out: Floats, inside: Flags, interval: Floats) -> None:
        """Write calibrated positions (n,) [rad|m], whether each is inside the valid range, and half-widths [rad|m]."""
        begin = time.perf_counter()
        self.corrector.correct_state(state, out, inside, interval)
        if self._started:
            self._durations.add(time.perf_counter() - begin)
        self._started = True

    def timing(self) -> Timing:
        """Return how long it took; NaN when there were no ticks."""
        return self._durations.timing() or Timing(nan, nan, nan, nan)
