"""Gravity compensation alone on a simulated arm: does it stay where it is put, whatever its base does?

[Lewis, Hannaford 2014, section V: with the sensed vector "the robot passively held any new position manually imposed",
upside down too; with the static one it drifts once "tipped more than a few degrees"]
"""

import numpy as np
from numpy.typing import ArrayLike

from catenary.arrays import Floats, as_array
from catenary.control.gravity_pd import GravityPD
from catenary.control.loop import GravitySource, Tick, run_loop
from catenary.control.loop_report import Holding
from catenary.control.pd import Controller
from catenary.errors import InputError
from catenary.trajectories.reference import Rest
from catenary.workflows.gravity.simulated_arm import SimulatedArm
from catenary.workflows.gravity.track import SETTLE, with_approach
from catenary.workflows.robot.motion import check_motion


def hold(
    arm: SimulatedArm,
    controller: Controller,
    q: ArrayLike,
    seconds: float,
    *,
    settle: float = SETTLE,
    gravity: GravitySource | None = None,
) -> Holding:
    """Place an arm by PD and sensed gravity, then let the controller alone hold it.

    Args:
        arm: Homed and enabled.
        controller: Such as GravityHold.
        q: (n,) where to [rad|m].
        seconds: How long to watch [s].
        settle: Time at q before [s].
        gravity: Says what gravity is; what the plant says when None.

    Raises:
        LimitError: q lies outside the joint limits; nothing has moved.
        InputError: q of another shape, or a time that is not positive.
        NotReadyError: The arm is not ready.
    """
    plant = arm.plant
    pose = as_array("q", q, (arm.model.n,))
    if not 0.0 < seconds < np.inf:
        raise InputError(f"seconds: expected more than 0, got {seconds}")
    check_motion(plant, Rest(pose, 0.0))
    placing = GravityPD(arm.model, arm.gains.kp, arm.gains.kd)
    whole, _ = with_approach(arm, Rest(pose, 0.0), settle)
    rate = 1.0 / plant.period
    limits = arm.limits()
    run_loop(plant, placing, whole, limits=limits, rate_hz=rate, gravity=gravity)
    times: list[float] = []
    reported: list[Floats] = []
    true: list[Floats] = []

    def observe(tick: Tick) -> None:
        times.append(tick.time)
        reported.append(tick.q_nominal)
        true.append(arm.q_true())

    report = run_loop(
        plant,
        controller,
        Rest(plant.measured_js().q, seconds),
        limits=limits,
        rate_hz=rate,
        gravity=gravity,
        observers=[observe],
    )
    columns = np.array(times), np.array(reported), np.array(true)
    return Holding(plant.joint_names, plant.joint_units, *columns, gravity=report.gravity)
