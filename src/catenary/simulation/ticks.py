"""Ticks of an arm and its firmware together, as many as wanted in one compiled call."""

import numpy as np

from catenary.arrays import Floats
from catenary.kernels.compiled import compiled, inlined
from catenary.robots.model import Tree
from catenary.simulation.cable_parameters import Cable, Firmware
from catenary.simulation.cable_physics import Work, link_dynamics, physics_step
from catenary.simulation.cabled.arm_state import ArmState
from catenary.simulation.firmware import (
    ControlState,
    TickLog,
    control_motors,
    read_encoders,
    take_setpoint,
)
from catenary.simulation.own_gravity import OwnGravity, weigh
from catenary.simulation.records import AXES, POSITIONING
from catenary.simulation.simulated_plant import PERIOD


@compiled
def run_ticks(
    tree: Tree,
    cable: Cable,
    firmware: Firmware,
    arm: ArmState,
    control: ControlState,
    own: OwnGravity,
    work: Work,
    setpoints: Floats,
    gravity: Floats,
    base_motion: Floats,
    substeps: int,
    log: TickLog,
) -> int:
    """Run the firmware and the arm for T ticks of 1 ms.

    A tick reads nothing new: it acts on what the encoders gave at the end of the last one, advances the
    physics by 1 ms, and reads the encoders again. The log holds each tick's reading and what was sent on it. Joint
    torques act within the motors' limits and the joints' soft ones.

    Args:
        tree: The positioning joints, payload included.
        cable: The arm.
        firmware: Its control.
        arm: The arm's state; overwritten.
        control: The control's state; overwritten.
        own: Its gravity compensation.
        work: Scratch.
        setpoints: (T, 7) desired joint positions; NaN leaves an axis where it is.
        gravity: (1, 3) or (T, 3) [m/s2] in base axes.
        base_motion: (1, 3, 3) or (T, 3, 3).
        substeps: Physics steps in a tick.
        log: T rows to write, or none to keep no log.

    Returns:
        Number of ticks run; fewer than T when the software e-stop tripped.
    """
    cable, firmware, arm, control, work = cable[()], firmware[()], arm[()], control[()], work[()]
    own = own[()]
    shaft_torque = np.zeros(7)
    step = PERIOD / substeps
    for k in range(len(setpoints)):
        take_setpoint(firmware, control, setpoints[k])
        if own.weighs:
            weigh(firmware, own, control)
        control_motors(firmware, control, shaft_torque)
        if len(log) > 0:
            _write_row(log[k], control, arm)
        g = gravity[k] if len(gravity) > 1 else gravity[0]
        base = base_motion[k] if len(base_motion) > 1 else base_motion[0]
        link_dynamics(tree, arm, g, base, work)
        for _ in range(substeps):
            physics_step(cable, arm, shaft_torque, control.braked, step, work)
        read_encoders(firmware, arm, control)
        if control.stopped:
            return k + 1
    return len(setpoints)


@inlined
def _write_row(row: TickLog, control: ControlState, arm: ArmState) -> None:
    for j in range(AXES):
        row.counts[j] = control.counts[j]
        row.motor[j] = control.motor[j]
        row.motor_velocity[j] = control.motor_velocity[j]
        row.joint[j] = control.joint[j]
        row.joint_velocity[j] = control.joint_velocity[j]
        row.setpoint[j] = control.setpoint[j]
        row.motor_setpoint[j] = control.motor_setpoint[j]
        row.torque[j] = control.torque[j]
        row.dac[j] = control.dac[j]
    for j in range(POSITIONING):
        row.q[j] = arm.q[j]
