"""Firmware of the simulated RAVEN-II: 1 kHz control with encoders, cable coupling, PD, DAC and gravity compensation.

Compiled; the physics runs inside its tick. [RAVEN-II source, branch master; sections 3 and 5 of its description in
docs/plant.md]

The firmware's gravity compensation [branches master and crtk: grav_comp.cpp, rt_raven.cpp, init.cpp] adds the holding
torques of the positioning joints under `grav_dir` to those of the PD, each to its own motor: the coupling of the
cables is neglected.
"""

import math
from collections.abc import Sequence

import numpy as np

from catenary.arrays import Floats
from catenary.dynamics.recursion import gravity_recursion, place_joints
from catenary.errors import InputError
from catenary.kernels.compiled import compiled, inlined
from catenary.raven2.transmission import COUNTS_PER_RADIAN
from catenary.robots.model import Tree
from catenary.simulation.cable_parameters import AxisFirmware, Cable, Firmware
from catenary.simulation.cable_physics import ArmState, TreeWork, Work, link_dynamics, physics_step
from catenary.simulation.compiled_records import (
    AXES,
    POSITION,
    POSITIONING,
    TORQUE,
    CodePerAxis,
    PerAxis,
    PerJoint,
    Record,
)
from catenary.simulation.simulated_plant import PERIOD
from catenary.transmission.cable_elasticity import joint_forces, joints_of, tensions_for, winding_of

STOP_SOUGHT, STOP_FOUND = 1, 2
_STOP_DAC = 20_000.0  # beyond: software e-stop
_DAC_RANGE = (-32_768.0, 32_767.0)  # 16-bit board
# deceleration of a torque-controlled joint towards its soft limit, ours: the robot accepts no torque commands
_BRAKING = (2.5, 2.5, 0.15, 25.0, 25.0, 25.0, 25.0)  # [rad/s2, rad/s2, m/s2, rad/s2...] far from the limit
_MIN_DAMPING = 0.02  # [s] damping over stiffness, for axes with less in their PD


class AxisControl(Record):
    """State of any arm's firmware between ticks, with its last readings and commands."""

    offset: PerAxis  # encoder offsets [counts], written at homing
    counts: PerAxis  # encoder readings
    motor: PerAxis  # measured motor positions [rad]
    motor_velocity: PerAxis  # difference over 1 ms [rad/s]
    joint: PerAxis  # measured joint positions [rad, rad, m, rad...]
    joint_velocity: PerAxis
    setpoint: PerAxis  # desired joint positions
    torque_command: PerAxis  # joint torques for axes in mode TORQUE [Nm, Nm, N, Nm...]
    torque: PerAxis  # RAVEN-II: demand at the gearbox's output before clipping [Nm]; PSM: joint torque of the currents
    mode: CodePerAxis  # OFF, POSITION or TORQUE
    braked: bool  # every motor's shaft is held
    stopped: bool  # the firmware has stopped itself
    guarded: bool  # setpoints are limited to the joint range and to one step a tick


class ControlState(AxisControl):
    """State of a RAVEN-II's firmware."""

    motor_setpoint: PerAxis  # desired motor positions [rad]
    integral: PerAxis  # of the motor position error [rad s]
    gravity_torque: PerJoint  # gravity compensation in the torque [Nm]; zero if off
    dac: PerAxis  # output, after clipping, with the board's sign
    seek: CodePerAxis  # of axes that search for their stop: STOP_SOUGHT, then STOP_FOUND


class AxisLog(Record):
    """State at the beginning of each tick: rows of one compiled run."""

    motor: PerAxis
    joint: PerAxis
    joint_velocity: PerAxis
    setpoint: PerAxis
    torque: PerAxis
    q: PerJoint  # true joint positions


class TickLog(AxisLog):
    """Log of a RAVEN-II."""

    counts: PerAxis
    motor_velocity: PerAxis
    motor_setpoint: PerAxis
    dac: PerAxis


@inlined
def write_row(row: AxisLog, control: AxisControl, arm: ArmState) -> None:
    """Write the columns that the logs of all arms share."""
    for j in range(AXES):
        row.motor[j] = control.motor[j]
        row.joint[j] = control.joint[j]
        row.joint_velocity[j] = control.joint_velocity[j]
        row.setpoint[j] = control.setpoint[j]
        row.torque[j] = control.torque[j]
    for j in range(len(row.q)):
        row.q[j] = arm.q[j]


@inlined
def _motors_of(firmware: Firmware, joint: Floats, insertion_motor: float, out: Floats) -> None:
    """Write the motor positions at joint positions; the tools' depend on the insertion motor's position [rad]."""
    winding = winding_of(firmware.coupling, joint)
    for j in range(3):
        out[j] = firmware.ratio[j] * winding[j]
    carried = firmware.tool_sign * insertion_motor / firmware.insertion_ratio
    for t in range(3, 7):
        side = -1.0 if t == 5 else 1.0  # the first jaw's cable runs the other way
        out[t] = firmware.ratio[t] * joint[t] + side * carried


@inlined
def _joints_of(firmware: Firmware, motor: Floats, out: Floats) -> None:
    """Write the joint positions at motor positions, with rigid cables and nominal ratios."""
    first, second, third = joints_of(
        firmware.coupling, (motor[0] / firmware.ratio[0], motor[1] / firmware.ratio[1], motor[2] / firmware.ratio[2])
    )
    out[0], out[1], out[2] = first, second, third
    carried = firmware.tool_sign * motor[2] / firmware.insertion_ratio
    for t in range(3, 7):
        side = -1.0 if t == 5 else 1.0
        out[t] = (motor[t] - side * carried) / firmware.ratio[t]


@inlined
def read_encoders(firmware: Firmware, arm: ArmState, control: ControlState) -> None:
    """Read the encoders and compute motor and joint positions and velocities; the velocities ignore the coupling."""
    for j in range(7):
        control.counts[j] = math.floor(arm.rotor[j] * COUNTS_PER_RADIAN)
        motor = (control.counts[j] - control.offset[j]) / COUNTS_PER_RADIAN
        control.motor_velocity[j] = (motor - control.motor[j]) / PERIOD
        control.motor[j] = motor
        control.joint_velocity[j] = control.motor_velocity[j] / firmware.ratio[j]
    _joints_of(firmware, control.motor, control.joint)


@inlined
def control_motors(firmware: Firmware, control: ControlState, shaft_torque: Floats) -> None:
    """Write the motors' shaft torques [Nm]: PD on motor positions, through the DAC's steps and limits.

    tau = Kp (m_d - m) + Kd (0 - m_vel) + Ki integral(m_d - m); DAC = trunc(s tau / (Kt gearbox) DAC/A).
    The integral is never reset or limited, as on the robot. A commanded torque, which the real robot does not accept,
    is the joint's: it is bounded by `_bound_torques` and mapped through the coupling. Gravity compensation, if
    enabled, is added in the other modes.
    """
    _motors_of(firmware, control.setpoint, control.motor[2], control.motor_setpoint)
    joint_torque = np.zeros(AXES)
    pushed = False
    for j in range(7):
        pushed = pushed or control.mode[j] == TORQUE
    if pushed:
        _bound_torques(firmware, control, joint_torque)
    cable = tensions_for(firmware.coupling, joint_torque)
    for j in range(7):
        torque = 0.0
        if control.mode[j] == POSITION:
            error = control.motor_setpoint[j] - control.motor[j]
            control.integral[j] += error * PERIOD
            torque = (
                firmware.kp[j] * error
                - firmware.kd[j] * control.motor_velocity[j]
                + firmware.ki[j] * control.integral[j]
            )
        elif control.mode[j] == TORQUE:
            torque = (cable[j] if j < 3 else joint_torque[j]) * firmware.gearbox[j] / firmware.ratio[j]
            control.setpoint[j] = control.joint[j]  # no jump when the PD takes over
        if j < 3 and control.mode[j] != TORQUE and control.gravity_torque[j] != 0.0:
            torque += control.gravity_torque[j]
        per_torque = firmware.dac_per_ampere[j] / (firmware.torque_constant[j] * firmware.gearbox[j])
        dac = float(math.trunc(firmware.dac_sign[j] * torque * per_torque))
        limit = firmware.dac_limit[j]
        control.torque[j] = torque
        if limit > 0.0 and abs(dac) > _STOP_DAC:
            control.stopped = True
        if control.seek[j] == STOP_SOUGHT and abs(dac) >= firmware.home_threshold[j]:
            control.seek[j] = STOP_FOUND  # no output in this cycle, then the PD holds the present position
            control.setpoint[j] = control.joint[j]
            dac = 0.0
        if limit > 0.0:
            dac = min(max(dac, -limit), limit)
        dac = min(max(dac, _DAC_RANGE[0]), _DAC_RANGE[1])
        if control.stopped:
            dac = 0.0
        control.dac[j] = dac
        shaft_torque[j] = firmware.dac_sign[j] * dac / per_torque / firmware.gearbox[j]


@inlined
def _bound_torques(firmware: Firmware, control: ControlState, torque: Floats) -> None:
    """Write the commanded joint torques (7,), bounded by the motors' limits and such that joints stay in their range.

    tau <= D (v(upper - q) - qd) and tau >= -D (v(q - lower) + qd), with v(d) = min(sqrt(2 a d), d K / D) the approach
    speed at a distance d from a limit: deceleration a, the _BRAKING, then that of the PD that holds the joint at the
    limit. K and D are that PD's gains at the joint, D at least _MIN_DAMPING K. Beyond a limit the joint is pushed back,
    up to the motors' limits: the DAC's, or _STOP_DAC without one.
    """
    velocity = np.empty(AXES)
    _joints_of(firmware, control.motor_velocity, velocity)  # linear, so it takes velocities too
    for j in range(AXES):
        per_motor = firmware.ratio[j] / firmware.gearbox[j]
        limit = firmware.dac_limit[j] if firmware.dac_limit[j] > 0.0 else _STOP_DAC
        strongest = limit * firmware.torque_constant[j] * firmware.gearbox[j] / firmware.dac_per_ampere[j] * per_motor
        bounded = bounded_torque(firmware, control, j, velocity[j], firmware.ratio[j], per_motor)
        torque[j] = min(max(bounded, -strongest), strongest)


@inlined
def bounded_torque(
    firmware: AxisFirmware, control: AxisControl, j: int, velocity: float, per_joint: float, per_motor: float
) -> float:
    """Return a joint's commanded torque [Nm|N], bounded by the law of `_bound_torques` to keep it in its range.

    Gains at the joint are the firmware's times `per_joint` and `per_motor`.
    """
    slowness = max(firmware.kd[j] / firmware.kp[j], _MIN_DAMPING)  # D / K [s]
    damping = slowness * firmware.kp[j] * per_joint * per_motor
    upper = damping * (_approach_speed(firmware.upper[j] - control.joint[j], slowness, _BRAKING[j]) - velocity)
    lower = -damping * (_approach_speed(control.joint[j] - firmware.lower[j], slowness, _BRAKING[j]) + velocity)
    return float(min(max(control.torque_command[j], lower), upper))


@inlined
def _approach_speed(distance: float, slowness: float, braking: float) -> float:
    """Return the approach speed at a distance from a limit; beyond it, negative, the speed of return."""
    held = distance / slowness
    return min(held, math.sqrt(2.0 * braking * distance)) if distance > 0.0 else held


@inlined
def take_setpoint(firmware: Firmware, control: ControlState, command: Floats) -> None:
    """Move the setpoint to the command; if guarded, by at most one step and within the software limits."""
    for j in range(7):
        if math.isnan(command[j]):
            continue
        if not control.guarded:
            control.setpoint[j] = command[j]
            continue
        max_step = firmware.step_limit[j]
        moved = control.setpoint[j] + min(max(command[j] - control.setpoint[j], -max_step), max_step)
        control.setpoint[j] = min(max(moved, firmware.lower[j]), firmware.upper[j])


def register_encoders(firmware: Firmware, control: ControlState, joint: Floats) -> None:
    """Write encoder offsets for which the axes read joint positions (7,) now."""
    motor = np.empty(AXES)
    _motors_of(firmware, joint, 0.0, motor)
    _motors_of(firmware, joint, motor[2], motor)
    control.offset = np.trunc(control.counts - motor * COUNTS_PER_RADIAN)
    control.motor = (control.counts - control.offset) / COUNTS_PER_RADIAN
    _joints_of(firmware, control.motor, control.joint)


def joint_torques(firmware: Firmware, torque: Floats) -> Floats:
    """Return the joint torques (..., 7) [Nm, Nm, N, Nm...] of motor torques, without friction.

    Args:
        torque: (..., 7) at the gearboxes' outputs [Nm].
    """
    cable: Floats = torque * firmware.ratio / firmware.gearbox
    joint = cable.copy()
    joint[..., 0], joint[..., 1], joint[..., 2] = joint_forces(
        firmware.coupling, (cable[..., 0], cable[..., 1], cable[..., 2])
    )
    return joint


NOMINAL_GRAV_DIR = (0, 0, 980)  # [cm/s2] grav_dir on a level base, z down; no public software writes another
_MAX_GRAV_DIR = 32_767  # [cm/s2] of a component
# from grav_dir's axes to the base's, whose z points up: a half turn about y
_AXES = np.array([-1.0, 1.0, -1.0])


class OwnGravity(TreeWork):
    """Settings and work arrays of the firmware's gravity compensation."""

    is_enabled: bool
    gravity: PerJoint  # in base axes [m/s2]


def gravity_of(grav_dir: Sequence[float]) -> Floats:
    """Return gravity (3,) in base axes [m/s2] from the robot's integers [cm/s2], with z down."""
    vector = np.asarray(grav_dir, dtype=float)
    if vector.shape != (3,) or not (np.abs(vector) <= _MAX_GRAV_DIR).all() or (vector != np.round(vector)).any():
        raise InputError(f"grav_dir: expected three whole numbers [cm/s2] of at most {_MAX_GRAV_DIR}, got {grav_dir}")
    return np.asarray(_AXES * vector / 100.0)


def grav_dir_of(gravity: Floats) -> tuple[int, int, int]:
    """Return gravity (3,) in base axes [m/s2] as the robot's integers [cm/s2], with z down."""
    x, y, z = np.round(100.0 * _AXES * gravity).astype(int).tolist()
    return x, y, z


@inlined
def write_gravity_torque(firmware: Firmware, links: Tree, own: OwnGravity, control: ControlState) -> None:
    """Write the motor torques that balance gravity at the measured positions [Nm at the gearbox's output]."""
    for j in range(POSITIONING):
        own.sine[j] = math.sin(control.joint[j])
        own.cosine[j] = math.cos(control.joint[j])
    place_joints(links, control.joint, own.sine, own.cosine, own.rotation, own.position)
    gravity = (own.gravity[0], own.gravity[1], own.gravity[2])
    gravity_recursion(links, own.rotation, own.position, gravity, own.mass, own.first_moment, own.force, own.bias)
    for j in range(POSITIONING):
        control.gravity_torque[j] = own.bias[j] / firmware.ratio[j] * firmware.gearbox[j]


@compiled
def run_ticks(
    tree: Tree,
    links: Tree,
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

    A tick acts on the encoder readings of the last one, advances the physics by 1 ms, and reads them again. `tree` is
    that of the positioning joints with payload, `links` the firmware's model of it. Setpoints (T, 7) are joint
    positions [rad, rad, m, rad...], NaN for no motion; gravity is (1, 3) or (T, 3) [m/s2] in base axes, base_motion
    (1, 3, 3) or (T, 3, 3); the log has T rows or none. Returns the number of ticks, less than T after a software
    e-stop.
    """
    cable, firmware, arm, control, work = cable[()], firmware[()], arm[()], control[()], work[()]
    own = own[()]
    shaft_torque = np.zeros(7)
    step = PERIOD / substeps
    for k in range(len(setpoints)):
        take_setpoint(firmware, control, setpoints[k])
        if own.is_enabled:
            write_gravity_torque(firmware, links, own, control)
        control_motors(firmware, control, shaft_torque)
        if len(log) > 0:
            write_row(log[k], control, arm)
            for j in range(AXES):
                log[k].counts[j] = control.counts[j]
                log[k].motor_velocity[j] = control.motor_velocity[j]
                log[k].motor_setpoint[j] = control.motor_setpoint[j]
                log[k].dac[j] = control.dac[j]
        g = gravity[k] if len(gravity) > 1 else gravity[0]
        base = base_motion[k] if len(base_motion) > 1 else base_motion[0]
        link_dynamics(tree, arm, g, base, work)
        for _ in range(substeps):
            physics_step(cable, arm, shaft_torque, control.braked, step, work)
        read_encoders(firmware, arm, control)
        if control.stopped:
            return k + 1
    return len(setpoints)
