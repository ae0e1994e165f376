"""One step of a cable-driven arm: rotors, cables, links. Compiled; every array is the caller's."""

from typing import Annotated

import numpy as np

from catenary.arrays import Floats
from catenary.kernels.compiled import inlined
from catenary.robots.model import Tree
from catenary.simulation.cable_parameters import Cable
from catenary.simulation.cabled.arm_state import ArmState
from catenary.simulation.cabled.cable_drive import pull_cable, turn_rotor
from catenary.simulation.cabled.tree_dynamics import TreeWork, invert_symmetric, tree_dynamics
from catenary.simulation.records import PerJoint
from catenary.transmission.coupling import joint_forces, winding_of
from catenary.transmission.friction import coulomb, coulomb_coupled

FRICTION_SWEEPS = 4


class Work(TreeWork):
    """Scratch for `link_dynamics`, whose results are `bias` and `inverse`, and for `physics_step`."""

    inverse: Annotated[Floats, "f8", ("joint", "joint")]  # of the mass matrix
    push: PerJoint
    impulse: PerJoint


@inlined
def physics_step(
    cable: Cable,
    state: ArmState,
    shaft_torque: Floats,
    braked: bool,
    step: float,
    work: Work,
) -> None:
    """Advance an arm by one semi-implicit Euler step: forces, then velocities, then positions.

    Args:
        cable: The arm's numbers.
        state: Overwritten.
        shaft_torque: (7,) of the motors [Nm].
        braked: Every motor's shaft is held.
        step: [s].
        work: Scratch, in which `link_dynamics` has left the links' dynamics.
    """
    q, qd = state.q, state.qd
    rate = winding_of(cable.coupling, qd)
    winding = winding_of(cable.coupling, q)
    for t in range(4):
        _turn_tool(cable, state, t, shaft_torque[3 + t], braked, step)
    for j in range(3):
        pull_cable(cable, state, j, winding[j], rate[j], step)
        turn_rotor(cable, state, j, shaft_torque[j], braked, step)

    force = joint_forces(cable.coupling, (state.tension[0], state.tension[1], state.tension[2]))
    for j in range(3):
        push = 0.0
        into = cable.stop_side[j] * (q[j] - cable.stop_position[j])
        if into > 0.0:
            resist = cable.stop_stiffness[j] * into + cable.stop_damping[j] * cable.stop_side[j] * qd[j]
            push = -cable.stop_side[j] * max(0.0, resist)
        work.push[j] = force[j] + push - work.bias[j]
        work.impulse[j] = step * (
            cable.link_friction[j] + cable.link_load_friction[j] * abs(state.tension[j])
        )
    for j in range(3):
        change = 0.0
        for i in range(3):
            change += work.inverse[j, i] * work.push[i]
        qd[j] += step * change
    coulomb_coupled(work.inverse, work.impulse, qd, state.friction, FRICTION_SWEEPS)
    for j in range(3):
        q[j] += step * qd[j]


def unstretched_rotors(cable: Cable, q: Floats) -> Floats:
    """Return the positioning motors' positions (3,) [rad] at which no cable is stretched at joint positions q (3,)."""
    true_ratio = cable.ratio * (1.0 + cable.ratio_error)
    fixed = np.array(winding_of(cable.coupling, q)) - cable.pulley_runout * np.sin(q + cable.pulley_phase)
    rotor = true_ratio * fixed
    for _ in range(20):  # the capstan's run-out turns with the rotor; each round leaves 1/20 of the error
        runout = cable.capstan_runout * np.sin(rotor / cable.gearbox + cable.capstan_phase)
        rotor = true_ratio * (fixed - runout)
    return rotor


@inlined
def _turn_tool(cable: Cable, state: ArmState, t: int, torque: float, braked: bool, step: float) -> None:
    """Turn tool motor t: its cables are taken as rigid, its joint meets a stop."""
    if braked:
        state.rotor_velocity[3 + t] = 0.0
        return
    joint = (state.rotor[3 + t] - cable.tool_carried[t] * state.rotor[2]) / cable.tool_ratio[t]
    into = joint - cable.tool_stop[t]
    push = -cable.tool_stop_stiffness[t] * into / cable.tool_ratio[t] if into > 0.0 else 0.0
    velocity = state.rotor_velocity[3 + t]
    free = velocity + step / cable.tool_inertia[t] * (torque + push - cable.tool_damping[t] * velocity)
    velocity = coulomb(free, step * cable.tool_friction[t] / cable.tool_inertia[t])
    state.rotor_velocity[3 + t] = velocity
    state.rotor[3 + t] += step * velocity


@inlined
def link_dynamics(tree: Tree, state: ArmState, gravity: Floats, base_motion: Floats, work: Work) -> None:
    """Write the links' bias torques (velocity, gravity, moving base) and the inverse of their mass matrix.

    They change with the pose, which a millisecond hardly moves; cables, rotors and friction are what substeps
    are for.

    Args:
        tree: The three positioning joints, payload included.
        state: Where the arm is.
        gravity: (3,) in base axes [m/s2].
        base_motion: (3, 3) angular velocity, angular acceleration, linear acceleration of the base, base axes.
        work: Scratch; `bias` and `inverse` are the result.
    """
    tree_dynamics(tree, state.q, state.qd, gravity, base_motion, work)
    invert_symmetric(work.matrix, work.inverse)
