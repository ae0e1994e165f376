"""One step of a PSM: seven rotors, cables and joints; the links' dynamics are those of its parallelogram. Compiled."""

from typing import Annotated

import numpy as np

from catenary.arrays import Floats
from catenary.kernels.compiled import inlined
from catenary.robots.model import Tree
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
from catenary.simulation.psm_parameters import PSM_SIZES, PsmDrive
from catenary.simulation.records import AXES, POSITIONING

_PerLink = Annotated[Floats, "f8", ("link",)]


class PsmState(ArmState):
    """What changes while a PSM moves: all seven joints are behind cables."""

    sizes = PSM_SIZES


class PsmWork(Work):
    """Scratch for `psm_dynamics`, whose results are `load` and `inverse`, and for `psm_step`."""

    sizes = PSM_SIZES

    coordinate: _PerLink  # of the tree [rad|m]
    rate: _PerLink
    load: Annotated[Floats, "f8", ("joint",)]  # bias torques of the joints [Nm, Nm, N, 0...]
    reduced: Annotated[Floats, "f8", (POSITIONING, POSITIONING)]  # mass matrix of the first three joints
    winding: Annotated[Floats, "f8", ("joint",)]
    winding_rate: Annotated[Floats, "f8", ("joint",)]


@inlined
def through(main: Floats, matrix: Floats, out: Floats, transposed: bool) -> None:
    """Write the first three of main (7,) as they are, and a matrix (4, 4) or its transpose times the other four.

    So joints wind up cables, and actuators move joints: the tool's are coupled, the others not.
    """
    for j in range(3):
        out[j] = main[j]
    for t in range(4):
        total = 0.0
        for s in range(4):
            total += (matrix[s, t] if transposed else matrix[t, s]) * main[3 + s]
        out[3 + t] = total


@inlined
def psm_step(drive: PsmDrive, state: PsmState, shaft_torque: Floats, braked: bool, step: float, work: PsmWork) -> None:
    """Advance a PSM by one semi-implicit Euler step: forces, then velocities, then positions.

    shaft_torque (7,) is of the motors [Nm]; in work `psm_dynamics` has left the dynamics of the links.
    """
    q, qd = state.q, state.qd
    through(q, drive.coupling, work.winding, False)
    through(qd, drive.coupling, work.winding_rate, False)
    for j in range(7):
        pull_cable(drive, state, j, work.winding[j], work.winding_rate[j], step)
        turn_rotor(drive, state, j, shaft_torque[j], braked, step)
    for j in range(7):
        if j < 3:
            force = pull_at_joint(drive, state, j)
        else:  # the transpose of the winding, so that power is kept
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
    """Write the joints' bias torques (velocity, gravity, moving base) and the inverse of their mass matrix.

    The links' coordinates are x = A q, a parallelogram's: M = A^T M_x A and h = A^T h_x. What was identified of the
    real arm's first three joints has their rotors in it; those turn by themselves here, and are taken out. The tool's
    joints move what they move alone, without weight. gravity (3,) [m/s2] and the motion (3, 3) of the base are in base
    axes; `load` and `inverse` of work are the result.
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
    """Return the motors' positions (7,) [rad] at which no cable is stretched at joint positions q (7,)."""
    winding = np.empty(AXES)
    through(q, drive.coupling, winding, False)
    return unstretched_rotors(drive, q, winding)
