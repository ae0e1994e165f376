"""A simulated arm follows a motion with a controller: tracking error, and how much of the torque the PD term gives.

The two measures of A. Lewis, B. Hannaford, "Dynamically evaluated gravity compensation for the RAVEN surgical robot",
ICRA 2014: RMS of desired minus sensed joint position, and RMS of the PD term over RMS of the whole torque, near 0 %
when the model is right and beyond 100 % when the PD fights it.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from catenary.arrays import Floats, as_array
from catenary.control.controller import SplitController
from catenary.control.loop import StateCorrector, Tick, run_loop
from catenary.control.report import LoopReport
from catenary.errors import InputError
from catenary.trajectories.in_turn import InTurn, Rest
from catenary.trajectories.point_to_point import go_to
from catenary.trajectories.reference import Trajectory
from catenary.workflows.gravity_torques import TORQUE_UNIT
from catenary.workflows.motion import GENTLE_ACCELERATION, GENTLE_VELOCITY, check_motion
from catenary.workflows.simulated_arm import SimulatedArm

DISPLAY = {"rad": ("deg", float(np.rad2deg(1.0))), "m": ("mm", 1000.0)}
SETTLE = 1.0  # [s] at the start of a motion, before it begins


@dataclass(frozen=True)
class Tracking:
    """What a controller did along a motion, tick by tick, and in sum; joints in the robot's order."""

    joint_names: tuple[str, ...]
    joint_units: tuple[str, ...]  # "rad" or "m"
    time: Floats  # (T,) [s] since the motion began
    error: Floats  # (T, n) desired minus sensed position [rad|m]
    feedback: Floats  # (T, n) PD term [Nm|N]
    torque: Floats  # (T, n) as sent [Nm|N]
    counted: Floats  # (T,) 1 on the ticks that the measures are of, else 0
    loop: LoopReport

    @property
    def rms_error(self) -> Floats:
        """RMS of the joint errors over the ticks that count, (n,) [rad|m]."""
        return self._rms(self.error)

    @property
    def pd_share(self) -> Floats:
        """RMS of the PD term over RMS of the torque, (n,); 0.1 is 10 %. NaN where no torque was sent at all."""
        return pd_share(self._rms(self.feedback), self._rms(self.torque))

    @property
    def rms_feedback(self) -> Floats:
        """RMS of the PD term, (n,) [Nm|N]."""
        return self._rms(self.feedback)

    @property
    def rms_torque(self) -> Floats:
        """RMS of the torque, (n,) [Nm|N]."""
        return self._rms(self.torque)

    def _rms(self, rows: Floats) -> Floats:
        kept = rows[self.counted > 0.0]
        rms: Floats = np.sqrt(np.mean(kept**2, axis=0))
        return rms

    def as_data(self) -> dict[str, Any]:
        """Plain data: errors in deg and mm, torques in Nm and N, shares in percent."""
        joints = [
            {
                "name": name,
                "unit": DISPLAY[unit][0],
                "rms_error": error * DISPLAY[unit][1],
                "torque_unit": TORQUE_UNIT[unit],
                "rms_pd": pd,
                "rms_torque": torque,
                "pd_share_percent": 100.0 * share,
            }
            for name, unit, error, pd, torque, share in zip(
                self.joint_names,
                self.joint_units,
                self.rms_error.tolist(),
                self.rms_feedback.tolist(),
                self.rms_torque.tolist(),
                self.pd_share.tolist(),
                strict=True,
            )
        ]
        return {
            "simulated": True,
            "seconds": float(self.counted.sum()) / self.loop.rate_hz,
            "joints": joints,
            "limited_ticks": self.loop.limited_ticks,
            "not_finite_ticks": self.loop.not_finite_ticks,
        }


def pd_share(rms_feedback: Floats, rms_torque: Floats) -> Floats:
    """RMS of the PD term over RMS of the torque; NaN where there is no torque."""
    return np.divide(rms_feedback, rms_torque, out=np.full_like(rms_torque, np.nan), where=rms_torque > 0.0)


def track(
    arm: SimulatedArm,
    controller: SplitController,
    trajectory: Trajectory,
    *,
    settle: float = SETTLE,
    windows: Sequence[tuple[float, float]] | None = None,
    corrector: StateCorrector | None = None,
) -> Tracking:
    """Bring an arm to a motion's start, let it settle there, and follow the motion, all with the same controller.

    Args:
        arm: Homed and enabled.
        controller: Of the arm's joints.
        trajectory: Of the arm's joints.
        settle: Time at the start before the motion begins [s].
        windows: Times of the motion that count in the measures, from and to [s]; all of it when None.
        corrector: Turns reported positions into calibrated ones; without it all is measured at the motors, as the
            paper did.

    Raises:
        LimitError: The motion leaves the joint limits; nothing has moved.
        InputError: The motion is of other joints, or a window lies outside it.
        NotReadyError: The arm is not ready.
    """
    plant = arm.plant
    check_motion(plant, trajectory)
    spans = [(0.0, trajectory.duration)] if windows is None else list(windows)
    for first, last in spans:
        if not 0.0 <= first < last <= trajectory.duration + 1e-9:
            raise InputError(f"windows: expected within 0 to {trajectory.duration} s, got {first} to {last}")
    whole, begin = with_approach(arm, trajectory, settle)
    times: list[float] = []
    rows: list[tuple[Floats, Floats, Floats]] = []

    def observe(tick: Tick) -> None:
        if tick.time >= begin - 1e-9 and tick.tau is not None:
            times.append(tick.time - begin)
            rows.append((tick.reference.q - tick.state.q, controller.feedback.copy(), tick.tau))

    report = run_loop(
        plant,
        controller,
        whole,
        limits=arm.limits(),
        rate_hz=1.0 / plant.period,
        corrector=corrector,
        observers=[observe],
    )
    time = np.array(times)
    counted = np.zeros(len(time))
    for first, last in spans:
        counted[(time >= first - 1e-9) & (time <= last + 1e-9)] = 1.0
    error, feedback, torque = (np.array(column) for column in zip(*rows, strict=True))
    return Tracking(plant.joint_names, plant.joint_units, time, error, feedback, torque, counted, report)


def with_approach(arm: SimulatedArm, trajectory: Trajectory, settle: float) -> tuple[InTurn, float]:
    """The motion with the way to its start before it, and when it then begins [s].

    The way begins where the arm is measured to be, so that no controller starts with a leap.
    """
    plant = arm.plant
    start, goal = as_array("measured q", plant.measured_js().q, (None,)), trajectory(0.0).q
    units = plant.joint_units
    way = go_to(
        start,
        as_array("trajectory", goal, start.shape),
        max_velocity=[GENTLE_VELOCITY[unit] for unit in units],
        max_acceleration=[GENTLE_ACCELERATION[unit] for unit in units],
    )
    # the motion begins on a tick
    begin = math.ceil((way.duration + settle) / plant.period - 1e-6) * plant.period
    return InTurn([way, Rest(goal, max(0.0, begin - way.duration)), trajectory]), begin
