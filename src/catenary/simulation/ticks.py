"""Ticks of an arm and its firmware together, as many as wanted in one compiled call."""

import numpy as np
from numpy.typing import NDArray

from catenary.arrays import Floats
from catenary.kernels.compiled import compiled
from catenary.simulation.cable_physics import link_dynamics, new_work, physics_step
from catenary.simulation.firmware import (
    BRAKES,
    PERIOD,
    STOPPED,
    control_motors,
    read_encoders,
    take_setpoint,
)
from catenary.simulation.packed import arm_of, cable_of, control_of, firmware_of, log_of, tree_of


@compiled
def run_ticks(
    parent: NDArray[np.int64],
    prismatic: NDArray[np.bool_],
    tree_numbers: Floats,
    cable_numbers: Floats,
    firmware_numbers: Floats,
    arm_numbers: Floats,
    control_numbers: Floats,
    control_whole: NDArray[np.int64],
    setpoints: Floats,
    gravity: Floats,
    base_motion: Floats,
    substeps: int,
    log_numbers: Floats,
) -> int:
    """Run the firmware and the arm for T ticks of 1 ms.

    A tick reads nothing new: it acts on what the encoders gave at the end of the last one, advances the
    physics by 1 ms, and reads the encoders again. The log holds each tick's reading and what was sent on it.

    Args:
        parent: Of the positioning joints' tree.
        prismatic: Of it.
        tree_numbers: The rest of it, packed; payload included.
        cable_numbers: The arm, packed.
        firmware_numbers: Its control, packed.
        arm_numbers: The arm's state, packed; overwritten.
        control_numbers: The control's state, packed; overwritten.
        control_whole: Its whole numbers; overwritten.
        setpoints: (T, 7) desired joint positions; NaN leaves an axis where it is.
        gravity: (1, 3) or (T, 3) [m/s2] in base axes.
        base_motion: (1, 3, 3) or (T, 3, 3).
        substeps: Physics steps in a tick.
        log_numbers: (T, LOG) rows to write, or (0, LOG) to keep no log.

    Returns:
        Number of ticks run; fewer than T when the software e-stop tripped.
    """
    tree = tree_of(parent, prismatic, tree_numbers)
    cable, firmware = cable_of(cable_numbers), firmware_of(firmware_numbers)
    arm, control = arm_of(arm_numbers), control_of(control_numbers, control_whole)
    log = log_of(log_numbers)
    shaft_torque = np.zeros(7)
    work = new_work()
    step = PERIOD / substeps
    keep_log = len(log.q) > 0
    for k in range(len(setpoints)):
        take_setpoint(firmware, control, setpoints[k])
        control_motors(firmware, control, shaft_torque)
        if keep_log:
            for j in range(7):
                log.counts[k, j] = control.counts[j]
                log.motor[k, j] = control.motor[j]
                log.motor_velocity[k, j] = control.motor_velocity[j]
                log.joint[k, j] = control.joint[j]
                log.joint_velocity[k, j] = control.joint_velocity[j]
                log.setpoint[k, j] = control.setpoint[j]
                log.motor_setpoint[k, j] = control.motor_setpoint[j]
                log.torque[k, j] = control.torque[j]
                log.dac[k, j] = control.dac[j]
            for j in range(3):
                log.q[k, j] = arm.q[j]
        g = gravity[k] if len(gravity) > 1 else gravity[0]
        base = base_motion[k] if len(base_motion) > 1 else base_motion[0]
        link_dynamics(tree, arm, g, base, work)
        for _ in range(substeps):
            physics_step(cable, arm, shaft_torque, control.flags[BRAKES] != 0, step, work)
        read_encoders(firmware, arm, control)
        if control.flags[STOPPED] != 0:
            return k + 1
    return len(setpoints)
