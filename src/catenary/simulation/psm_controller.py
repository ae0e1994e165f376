"""The dVRK's control of a PSM at 1 kHz: encoders, coupling, PID on joints, currents; and ticks of it and the arm.

The dVRK controls joints, not motors: encoders give the actuators' positions, the instrument's coupling gives the
joints'; a PID on each joint asks for its torque, the transpose of the coupling divides that among the actuators, and
each motor gets a current within its limit. [jhu-dvrk/sawIntuitiveResearchKit; its PSM's gains have no integral part]
"""

import math

import numpy as np

from catenary.arrays import Floats
from catenary.kernels.compiled import compiled, inlined
from catenary.robots.model import Tree
from catenary.simulation.firmware import BRAKING, LEAST_DAMPING, AxisControl, AxisLog, approach_speed, write_row
from catenary.simulation.psm_parameters import PSM_SIZES, PsmController, PsmDrive
from catenary.simulation.psm_physics import PsmState, PsmWork, psm_dynamics, psm_step, through
from catenary.simulation.records import AXES, OFF, TORQUE, PerAxis
from catenary.simulation.simulated_plant import PERIOD

TURN = 2.0 * math.pi


class PsmControlState(AxisControl):
    """What the dVRK's controller keeps."""

    setpoint_velocity: PerAxis
    wanted: PerAxis  # joint torques that are asked for
    current: PerAxis  # [A] sent


class PsmLog(AxisLog):
    """Ticks of a PSM."""

    sizes = PSM_SIZES

    current: PerAxis


@inlined
def read_psm_encoders(controller: PsmController, arm: PsmState, control: PsmControlState) -> None:
    """Read the encoders and derive motor and joint positions and velocities."""
    actuator, velocity = np.empty(AXES), np.empty(AXES)
    for j in range(7):
        control.counts[j] = math.floor(arm.rotor[j] / TURN * controller.counts[j])
        motor = (control.counts[j] - control.offset[j]) / controller.counts[j] * TURN
        control.motor_velocity[j] = (motor - control.motor[j]) / PERIOD
        control.motor[j] = motor
        actuator[j] = motor / controller.ratio[j]
        velocity[j] = control.motor_velocity[j] / controller.ratio[j]
    through(actuator, controller.joints, control.joint, False)
    through(velocity, controller.joints, control.joint_velocity, False)


@inlined
def control_joints(controller: PsmController, control: PsmControlState, shaft_torque: Floats) -> None:
    """Write the motors' shaft torques [Nm]: a PID on joints, through the coupling, the currents' steps and limits.

    tau = Kp (q_d - q) + Kd (qd_d - qd); actuators get joints^T tau; I = tau_a / (Kt ratio), within its limit.
    """
    for j in range(7):
        torque = 0.0
        if control.mode[j] == TORQUE:
            torque = _bounded(controller, control, j)
            control.setpoint[j] = control.joint[j]  # no jump when the PID takes over
        elif control.mode[j] != OFF:
            error = control.setpoint[j] - control.joint[j]
            if abs(error) > controller.tolerance[j]:
                control.stopped = True
            torque = controller.kp[j] * error + controller.kd[j] * (
                control.setpoint_velocity[j] - control.joint_velocity[j]
            )
        control.wanted[j] = torque
    actuator = np.empty(AXES)
    through(control.wanted, controller.joints, actuator, True)
    for j in range(7):
        per_ampere = controller.torque_constant[j] * controller.ratio[j]
        current = actuator[j] / per_ampere
        limit = controller.current_limit[j]
        current = min(max(current, -limit), limit)
        current = math.floor(current * controller.dac_per_ampere[j] + 0.5) / controller.dac_per_ampere[j]
        if control.stopped:
            current = 0.0
        control.current[j] = current
        shaft_torque[j] = current * controller.torque_constant[j]
        actuator[j] = current * per_ampere
    through(actuator, controller.discs, control.torque, True)


@inlined
def _bounded(controller: PsmController, control: PsmControlState, j: int) -> float:
    """Return the torque of a joint as commanded, such that it stays within its limits: as a RAVEN-II's here does."""
    slowness = max(controller.kd[j] / controller.kp[j], LEAST_DAMPING)
    damping, q, qd = slowness * controller.kp[j], control.joint[j], control.joint_velocity[j]
    most = damping * (approach_speed(controller.upper[j] - q, slowness, BRAKING[j]) - qd)
    least = -damping * (approach_speed(q - controller.lower[j], slowness, BRAKING[j]) + qd)
    return float(min(max(control.torque_command[j], least), most))


@inlined
def take_psm_setpoint(controller: PsmController, control: PsmControlState, wanted: Floats) -> None:
    """Move the setpoint towards what is wanted, by one clamped step and, guarded, within the joint limits."""
    for j in range(7):
        before = control.setpoint[j]
        if not math.isnan(wanted[j]):
            most = controller.step_limit[j]
            moved = before + min(max(wanted[j] - before, -most), most)
            if control.guarded:
                moved = min(max(moved, controller.lower[j]), controller.upper[j])
            control.setpoint[j] = moved
        control.setpoint_velocity[j] = (control.setpoint[j] - before) / PERIOD


def register_psm(controller: PsmController, control: PsmControlState, drive: PsmDrive, rotor: Floats) -> None:
    """Write encoder offsets from what the potentiometers say of the actuators: true but for `registration`."""
    actuator = rotor / (drive.ratio * (1.0 + drive.ratio_error)) + controller.registration
    motor = actuator * controller.ratio
    control.offset = np.trunc(control.counts - motor * controller.counts / TURN)
    control.motor = (control.counts - control.offset) * TURN / controller.counts
    through(control.motor / controller.ratio, controller.joints, control.joint, False)
    control.setpoint = control.joint


@compiled
def run_psm_ticks(
    tree: Tree,
    coupling: Floats,
    drive: PsmDrive,
    controller: PsmController,
    arm: PsmState,
    control: PsmControlState,
    work: PsmWork,
    setpoints: Floats,
    gravity: Floats,
    base_motion: Floats,
    substeps: int,
    log: PsmLog,
) -> int:
    """Run the controller and the arm for T ticks of 1 ms; as `run_ticks` does for a RAVEN-II.

    coupling (links, 3) holds the coordinates of the links of the first three joints.
    """
    drive, controller, arm, control, work = drive[()], controller[()], arm[()], control[()], work[()]
    shaft_torque = np.zeros(7)
    step = PERIOD / substeps
    for k in range(len(setpoints)):
        take_psm_setpoint(controller, control, setpoints[k])
        control_joints(controller, control, shaft_torque)
        if len(log) > 0:
            write_row(log[k], control, arm)
            for j in range(AXES):
                log[k].current[j] = control.current[j]
        g = gravity[k] if len(gravity) > 1 else gravity[0]
        base = base_motion[k] if len(base_motion) > 1 else base_motion[0]
        psm_dynamics(tree, coupling, drive, arm, g, base, work)
        for _ in range(substeps):
            psm_step(drive, arm, shaft_torque, control.braked, step, work)
        read_psm_encoders(controller, arm, control)
        if control.stopped:
            return k + 1
    return len(setpoints)
