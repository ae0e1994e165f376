"""A simulated arm follows a motion with a controller: tracking error, and how much of the torque the PD term gives."""

import math
from collections.abc import Sequence

import numpy as np

from catenary.arrays import Floats, as_array
from catenary.control.loop import GravitySource, Observer, StateCorrector, Tick, run_loop
from catenary.control.loop_report import Tracking
from catenary.control.pd import SplitController
from catenary.errors import InputError
from catenary.trajectories.reference import InTurn, Rest, Trajectory
from catenary.workflows.gravity.simulated_arm import SimulatedArm
from catenary.workflows.robot.motion import check_motion, gentle_way

SETTLE = 1.0  # [s] at the start of a motion, before it begins


def track(
    arm: SimulatedArm,
    controller: SplitController,
    trajectory: Trajectory,
    *,
    settle: float = SETTLE,
    windows: Sequence[tuple[float, float]] | None = None,
    corrector: StateCorrector | None = None,
    gravity: GravitySource | None = None,
    observers: Sequence[Observer] = (),
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
        gravity: Says what gravity is; what the plant says when None.
        observers: Called with every tick of the motion itself, the way to its start and the settling left out.

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
            for observer in observers:
                observer(tick)

    report = run_loop(
        plant, controller, whole, limits=arm.limits(), rate_hz=1.0 / plant.period,
        corrector=corrector, gravity=gravity, observers=[observe],
    )  # fmt: skip
    time = np.array(times)
    counted = np.zeros(len(time))
    for first, last in spans:
        counted[(time >= first - 1e-9) & (time <= last + 1e-9)] = 1.0
    error, feedback, torque = (np.array(column) for column in zip(*rows, strict=True))
    return Tracking(plant.joint_names, plant.joint_units, time, error, feedback, torque, counted, report)


def with_approach(arm: SimulatedArm, trajectory: Trajectory, settle: float) -> tuple[InTurn, float]:
    """Return a motion with the way to its start before it, and when it then begins [s].

    The way begins where the arm is measured to be, so that no controller starts with a leap.
    """
    plant = arm.plant
    start, goal = as_array("measured q", plant.measured_js().q, (None,)), trajectory(0.0).q
    way = gentle_way(start, as_array("trajectory", goal, start.shape), plant.joint_units)
    # the motion begins on a tick
    begin = math.ceil((way.duration + settle) / plant.period - 1e-6) * plant.period
    return InTurn([way, Rest(goal, max(0.0, begin - way.duration)), trajectory]), begin
