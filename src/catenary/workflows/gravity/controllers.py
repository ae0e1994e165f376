"""Controllers by name, put together for an arm."""

import numpy as np

from catenary.control.elastic_pd import Compensation, ElasticPD
from catenary.control.gains import DAMPING_RATIO, FREQUENCY_HZ
from catenary.control.gravity_pd import GravityHold, GravityPD
from catenary.control.inertia_pd import InertiaPD
from catenary.control.pd import Damping, JointPD, SplitController
from catenary.errors import InputError
from catenary.spatial import LEVEL
from catenary.workflows.gravity.simulated_arm import SimulatedArm

CONTROLLERS: dict[str, str] = {
    "pd": "PD alone",
    "sg": "PD and gravity of a level base (PD+SG)",
    "dg": "PD and sensed gravity (PD+DG)",
    "inertia": "PD through the mass matrix, and sensed gravity",
    "computed-torque": "the same with the velocity terms",
    "elastic-constant": "PD on motors, gravity at the reference",
    "elastic-online": "PD on motors, gravity at the motors",
    "elastic-biased": "PD on motors, gravity at the motors less the springs' wind-up",
}
HOLDS = ("sg", "dg")  # those that gravity compensation is also tried of alone


def make_controller(name: str, arm: SimulatedArm, *, damping: Damping = "relative") -> SplitController:
    """Return one of CONTROLLERS for an arm, with the arm's own gains.

    Damping "absolute" leaves the reference's velocity out, as RAVEN-II's firmware does.
    """
    if name not in CONTROLLERS:
        raise InputError(f'controller "{name}": expected one of {", ".join(CONTROLLERS)}')
    kp, kd = arm.gains
    if name == "pd":
        return JointPD(kp, kd, damping=damping)
    if name in HOLDS:
        return GravityPD(arm.model, kp, kd, gravity=LEVEL if name == "sg" else None, damping=damping)
    if name in ("inertia", "computed-torque"):
        if damping != "relative":
            raise InputError(f'controller "{name}": follows velocities, expected damping relative')
        w = 2.0 * np.pi * FREQUENCY_HZ
        gains, coriolis = (w * w, 2.0 * DAMPING_RATIO * w), name == "computed-torque"
        return InertiaPD(arm.model, *gains, motor_inertia=arm.motor_inertia, coriolis=coriolis)
    if arm.stiffness is None:
        raise InputError(f'controller "{name}": robot "{arm.model.name}" has no springs at its joints')
    compensation: Compensation = name.removeprefix("elastic-")  # type: ignore[assignment]
    return ElasticPD(arm.model, kp, kd, arm.stiffness, compensation=compensation, damping=damping)


def make_hold(name: str, arm: SimulatedArm) -> GravityHold:
    """Return gravity compensation alone, by the gravity of a level base (sg) or the sensed one (dg)."""
    if name not in HOLDS:
        raise InputError(f'controller "{name}": expected one of {", ".join(HOLDS)}')
    return GravityHold(arm.model, gravity=LEVEL if name == "sg" else None)
