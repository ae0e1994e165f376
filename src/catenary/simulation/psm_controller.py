"""Parameters, physics and dVRK control (1 kHz) of a simulated PSM: encoders, coupling, PID, motor currents.

Seven rotors, cables and joints; the links' dynamics are those of the arm's parallelogram. The dVRK controls joints:
encoders give actuator positions, the instrument's coupling gives joint positions; a PID on each joint computes its
torque, the transpose of the coupling distributes it to the actuators, and each motor's current is limited.
[jhu-dvrk/sawIntuitiveResearchKit; its PSM's gains have no integral part] Compiled.
"""

import math
from dataclasses import replace
from importlib.resources import as_file, files
from typing import Annotated, NamedTuple

import numpy as np

from catenary.arrays import Floats
from catenary.config import Settings, load_toml
from catenary.kernels.compiled import compiled, inlined
from catenary.robots.catalog import load_robot
from catenary.robots.link_inertia import symmetric
from catenary.robots.model import RobotModel, Tree
from catenary.simulation.cable_parameters import AxisFirmware, CableDrive, Entry, Origin, parameters_of, varied
from catenary.simulation.cable_physics import (
    ArmState,
    Work,
    invert_symmetric,
    move_joints,
    pull_at_joint,
    pull_cable,
    tree_dynamics,
    turn_rotor,
    unstretched_rotors,
)
from catenary.simulation.compiled_records import AXES, OFF, POSITIONING, SIZES, TORQUE, PerAxis, PerTool, Record
from catenary.simulation.firmware import AxisControl, AxisLog, bounded_torque, write_row
from catenary.simulation.simulated_plant import PERIOD

ARM_JOINTS = AXES - 1  # number of joints without the jaw
_LINKS = 8  # moving links of the parallelogram and the insertion
# seven joints behind cables, a RAVEN-II has three
_PSM_SIZES = {**SIZES, "joint": AXES, "link": _LINKS, "node": _LINKS + 1}

_PerArmJoint = Annotated[Floats, "f8", (ARM_JOINTS,)]
_ToolMatrix = Annotated[Floats, "f8", ("tool", "tool")]


class PsmDrive(CableDrive):
    """True parameters of motors, gears, cables and joints of a PSM.

    Cables are in the dVRK's actuator coordinates: those of the first three joints, then the instrument's four discs.
    """

    sizes = _PSM_SIZES

    coupling: _ToolMatrix  # true: turns of the discs per turn of the tool's joints
    stop_lower: PerAxis  # joint positions of the stops [rad, rad, m, rad...]
    stop_upper: PerAxis
    stop_stiffness: PerAxis  # [Nm/rad, Nm/rad, N/m, Nm/rad...]
    stop_damping: PerAxis
    tool_inertia: PerTool  # at the tool's joints [kg m2]
    joint_damping: PerAxis  # [Nm s/rad, Nm s/rad, N s/m, Nm s/rad...]


class PsmController(AxisFirmware):
    """Control parameters of a PSM under the dVRK."""

    counts: PerAxis  # of an encoder per motor turn
    joints: _ToolMatrix  # from disc to tool joint positions
    discs: _ToolMatrix  # its inverse
    tolerance: PerAxis  # error of a joint beyond which the controller stops [rad, rad, m, rad...]
    current_limit: PerAxis  # [A]
    registration: PerAxis  # reported minus true actuator positions after homing [rad, rad, m, rad...]


def joints_per_actuator(controller: PsmController) -> Floats:
    """Return the controller's coupling matrix (7, 7) from actuator to joint positions."""
    coupling = np.eye(AXES)
    coupling[POSITIONING:, POSITIONING:] = np.reshape(controller.joints, (AXES - POSITIONING, -1))
    return coupling


class Tracker(Record):
    """Parameters of an external measurement of the joints, by a camera or encoders."""

    resolution: _PerArmJoint  # [rad, rad, m, rad, rad, rad]
    noise: _PerArmJoint  # standard deviation of a reading


class LinkEntry(Settings):
    """Inertial parameters of one link of the data file."""

    mass_kg: float
    com_m: tuple[float, float, float]
    # xx xy xz yy yz zz about the centre of mass
    inertia_kg_m2: tuple[float, float, float, float, float, float]
    origin: Origin


class PsmFile(Settings):
    """The data file."""

    name: str
    sources: list[str]
    drive: dict[str, Entry]
    controller: dict[str, Entry]
    tracker: dict[str, Entry]
    links: dict[str, LinkEntry]


class PsmArm(NamedTuple):
    """A PSM as defined by its data file."""

    name: str
    drive: PsmDrive
    controller: PsmController
    tracker: Tracker
    links: Tree  # of robot dvrk_psm_motors, in its own coordinates, with masses
    coupling: Floats  # (_LINKS, 3) from yaw, pitch, insertion to the links' coordinates
    file: PsmFile

    def loaded_model(self) -> RobotModel:
        """Return robot dvrk_psm_motors with these masses; its first three coordinates are the arm's first joints."""
        return replace(load_robot("dvrk_psm_motors"), tree=self.links, missing_inertia=())


def load_psm() -> PsmArm:
    """Load the package's PSM."""
    with as_file(files("catenary.simulation") / "data" / "dvrk_psm.toml") as path:
        content = load_toml(path, PsmFile)
    model = load_robot("dvrk_psm_motors")
    links = [content.links[name] for name in model.link_names]
    tree = model.tree._replace(
        mass=np.array([link.mass_kg for link in links]),
        com=np.array([link.com_m for link in links]),
        inertia=np.array([symmetric(link.inertia_kg_m2) for link in links]),
    )
    return PsmArm(
        content.name,
        parameters_of(path, "drive", content.drive, PsmDrive),
        parameters_of(path, "controller", content.controller, PsmController),
        parameters_of(path, "tracker", content.tracker, Tracker),
        # writable, as all others: another kind would compile the code once more
        Tree._make(np.array(part) for part in tree),
        np.array(model.coupling[:, :POSITIONING]),
        content,
    )


_SHARES = {
    "stiffness": 0.15, "backlash": 0.15, "rotor_friction": 0.15, "link_friction": 0.15,
    "capstan_runout": 0.2, "pulley_runout": 0.2, "capstan_phase": 0.0, "pulley_phase": 0.0,
}  # fmt: skip


def varied_psm(arm: PsmArm, rng: np.random.Generator) -> PsmArm:
    """Draw a random arm of the kind: gears by 0.5 %, stiffness, backlash and friction by 15 %, registration by 30 %."""
    drive = varied(arm.drive, rng, 0.005, _SHARES)
    registration = arm.controller.registration * np.exp(0.3 * rng.standard_normal(AXES))
    return arm._replace(drive=drive, controller=arm.controller.replace(registration=registration))


_PerLink = Annotated[Floats, "f8", ("link",)]


class PsmState(ArmState):
    """State of a PSM, whose seven joints are all behind cables."""

    sizes = _PSM_SIZES


class PsmWork(Work):
    """Work arrays of `psm_dynamics`, whose results are `load` and `inverse`, and of `psm_step`."""

    sizes = _PSM_SIZES

    coordinate: _PerLink  # of the tree [rad|m]
    rate: _PerLink
    load: Annotated[Floats, "f8", ("joint",)]  # bias torques of the joints [Nm, Nm, N, 0...]
    reduced: Annotated[Floats, "f8", (POSITIONING, POSITIONING)]  # mass matrix of the first three joints
    winding: Annotated[Floats, "f8", ("joint",)]
    winding_rate: Annotated[Floats, "f8", ("joint",)]


@inlined
def apply_coupling(main: Floats, matrix: Floats, out: Floats, transposed: bool) -> None:
    """Write the product of the coupling and main (7,): identity for three joints, matrix (4, 4) for the tool's four."""
    for j in range(3):
        out[j] = main[j]
    for t in range(4):
        total = 0.0
        for s in range(4):
            total += (matrix[s, t] if transposed else matrix[t, s]) * main[3 + s]
        out[3 + t] = total


@inlined
def psm_step(drive: PsmDrive, state: PsmState, shaft_torque: Floats, braked: bool, step: float, work: PsmWork) -> None:
    """Advance a PSM by one semi-implicit Euler step; `physics_step` for a PSM, after `psm_dynamics`."""
    q, qd = state.q, state.qd
    apply_coupling(q, drive.coupling, work.winding, False)
    apply_coupling(qd, drive.coupling, work.winding_rate, False)
    for j in range(7):
        pull_cable(drive, state, j, work.winding[j], work.winding_rate[j], step)
        turn_rotor(drive, state, j, shaft_torque[j], braked, step)
    for j in range(7):
        if j < 3:
            force = pull_at_joint(drive, state, j)
        else:  # transpose of the winding: conserves power
            force = 0.0
            for t in range(4):
                force += drive.coupling[t, j - 3] * pull_at_joint(drive, state, 3 + t)
        force -= drive.joint_damping[j] * qd[j]
        below, above = drive.stop_lower[j] - q[j], q[j] - drive.stop_upper[j]
        if below > 0.0:
            force += max(0.0, drive.stop_stiffness[j] * below - drive.stop_damping[j] * qd[j])
        elif above > 0.0:
            force -= max(0.0, drive.stop_stiffness[j] * above + drive.stop_damping[j] * qd[j])
        work.push[j] = force - work.load[j]
        work.impulse[j] = step * (drive.link_friction[j] + drive.link_load_friction[j] * abs(state.tension[j]))
    move_joints(state, step, work)


@inlined
def psm_dynamics(
    tree: Tree, coupling: Floats, drive: PsmDrive, state: PsmState, gravity: Floats, base_motion: Floats, work: PsmWork
) -> None:
    """Write the joints' bias torques (velocity, gravity, moving base) to `load` and the inverse mass matrix.

    The links' coordinates are x = A q, those of a parallelogram: M = A^T M_x A and h = A^T h_x. The identified inertia
    of the real arm's first three joints includes their rotors, which are separate here and are subtracted. The tool's
    joints are uncoupled and weightless. Gravity (3,) [m/s2] and base_motion (3, 3) are in base axes.
    """
    links = len(tree.parent)
    for k in range(links):
        x, xd = 0.0, 0.0
        for j in range(3):
            x += coupling[k, j] * state.q[j]
            xd += coupling[k, j] * state.qd[j]
        work.coordinate[k], work.rate[k] = x, xd
    tree_dynamics(tree, work.coordinate, work.rate, gravity, base_motion, work)
    for j in range(3):
        load = 0.0
        for k in range(links):
            load += coupling[k, j] * work.bias[k]
        work.load[j] = load
        for i in range(3):
            entry = 0.0
            for k in range(links):
                for l in range(links):
                    entry += coupling[k, j] * work.matrix[k, l] * coupling[l, i]
            work.reduced[j, i] = entry
        work.reduced[j, j] -= drive.ratio[j] * drive.ratio[j] * drive.rotor_inertia[j]
    invert_symmetric(work.reduced, work.inverse)
    for t in range(4):
        work.inverse[3 + t, 3 + t] = 1.0 / drive.tool_inertia[t]


def unstretched_motors(drive: PsmDrive, q: Floats) -> Floats:
    """Return the motor positions (7,) [rad] with unstretched cables at joint positions q (7,)."""
    winding = np.empty(AXES)
    apply_coupling(q, drive.coupling, winding, False)
    return unstretched_rotors(drive, q, winding)


_FULL_TURN = 2.0 * math.pi


class PsmControlState(AxisControl):
    """State of the dVRK's controller."""

    setpoint_velocity: PerAxis
    wanted: PerAxis  # joint torques of the PID or commanded
    current: PerAxis  # [A] sent


class PsmLog(AxisLog):
    """Log of a PSM."""

    sizes = _PSM_SIZES

    current: PerAxis


@inlined
def read_psm_encoders(controller: PsmController, arm: PsmState, control: PsmControlState) -> None:
    """Read the encoders and compute motor and joint positions and velocities."""
    actuator, velocity = np.empty(AXES), np.empty(AXES)
    for j in range(7):
        control.counts[j] = math.floor(arm.rotor[j] / _FULL_TURN * controller.counts[j])
        motor = (control.counts[j] - control.offset[j]) / controller.counts[j] * _FULL_TURN
        control.motor_velocity[j] = (motor - control.motor[j]) / PERIOD
        control.motor[j] = motor
        actuator[j] = motor / controller.ratio[j]
        velocity[j] = control.motor_velocity[j] / controller.ratio[j]
    apply_coupling(actuator, controller.joints, control.joint, False)
    apply_coupling(velocity, controller.joints, control.joint_velocity, False)


@inlined
def control_joints(controller: PsmController, control: PsmControlState, shaft_torque: Floats) -> None:
    """Write the motors' shaft torques [Nm]: PID on joints, coupling, then quantised and limited currents.

    tau = Kp (q_d - q) + Kd (qd_d - qd); tau_a = joints^T tau; I = tau_a / (Kt ratio), within its limit.
    """
    for j in range(7):
        torque = 0.0
        if control.mode[j] == TORQUE:
            torque = bounded_torque(controller, control, j, control.joint_velocity[j], 1.0, 1.0)
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
    apply_coupling(control.wanted, controller.joints, actuator, True)
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
    apply_coupling(actuator, controller.discs, control.torque, True)


@inlined
def take_psm_setpoint(controller: PsmController, control: PsmControlState, command: Floats) -> None:
    """Move the setpoint to the command, by at most one step and, if guarded, within the joint limits."""
    for j in range(7):
        before = control.setpoint[j]
        if not math.isnan(command[j]):
            max_step = controller.step_limit[j]
            moved = before + min(max(command[j] - before, -max_step), max_step)
            if control.guarded:
                moved = min(max(moved, controller.lower[j]), controller.upper[j])
            control.setpoint[j] = moved
        control.setpoint_velocity[j] = (control.setpoint[j] - before) / PERIOD


def register_psm(controller: PsmController, control: PsmControlState, drive: PsmDrive, rotor: Floats) -> None:
    """Write encoder offsets from the potentiometers' actuator positions, true but for `registration`."""
    actuator = rotor / (drive.ratio * (1.0 + drive.ratio_error)) + controller.registration
    motor = actuator * controller.ratio
    control.offset = np.trunc(control.counts - motor * controller.counts / _FULL_TURN)
    control.motor = (control.counts - control.offset) * _FULL_TURN / controller.counts
    apply_coupling(control.motor / controller.ratio, controller.joints, control.joint, False)
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
    """Run the controller and the arm for T ticks of 1 ms; see `run_ticks` for arguments and result.

    coupling (links, 3) maps the first three joints to the links' coordinates.
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
