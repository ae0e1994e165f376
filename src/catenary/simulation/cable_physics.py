"""Physics step of a cable-driven arm, compiled: rotors, gears, elastic cables with friction and drift, links."""

import math
from typing import Annotated

import numpy as np

from catenary.arrays import Floats
from catenary.dynamics.recursion import composite_body_recursion, newton_euler_recursion, place_joints
from catenary.kernels.compiled import inlined
from catenary.robots.model import Tree
from catenary.simulation.cable_parameters import Cable, CableDrive
from catenary.simulation.compiled_records import PerAxis, PerJoint, Record
from catenary.transmission.cable_elasticity import (
    beyond_backlash,
    bouc_wen_step,
    joint_forces,
    loss_rate,
    maxwell_step,
    next_draw,
    set_rate,
    tension_of,
    wander_step,
    winding_of,
)
from catenary.transmission.cable_friction import coulomb, coulomb_coupled, dragged

_PerLink = Annotated[Floats, "f8", ("link",)]
_Vectors = Annotated[Floats, "f8", ("node", 3)]
_FRICTION_SWEEPS = 4


class ArmState(Record):
    """State of an arm. Positioning joints come first among the seven rotors."""

    rotor: PerAxis  # motor shafts [rad]
    rotor_velocity: PerAxis  # [rad/s]
    q: PerJoint  # true joint positions [rad, rad, m]
    qd: PerJoint  # [rad/s, rad/s, m/s]
    hysteresis: PerJoint  # Bouc-Wen states, -1 to 1
    slow_stretch: PerJoint  # Maxwell branches [rad, rad, m]
    slack: PerJoint  # permanent set of the cables [rad, rad, m]
    loss: PerJoint  # relative loss of stiffness
    tension: PerJoint  # of the last step [Nm, Nm, N]
    dice: PerJoint  # random numbers of the set's random walk
    node: PerJoint  # friction of idlers: difference of the tensions at the cable's two ends [Nm, Nm, N]
    friction: PerJoint  # impulses of the last step, from which the next solution starts


@inlined
def pull_cable(cable: CableDrive, state: ArmState, j: int, winding: float, winding_rate: float, step: float) -> None:
    """Stretch cable j and write its tension; update its friction, hysteresis, creep, set and wear.

    The friction f of idlers is lumped in one node that slides on the cable, with `node_share` of its compliance on the
    motor's side: the motor feels T + (1 - share) f, the joint T - share f. While the node sticks, f grows with the
    displacement of the free node by the stiffness K / share + K / (1 - share) of both parts.

    winding is the cable wound up by the joints, in joint units [rad or m], winding_rate its rate, step in s.
    """
    true_ratio = cable.ratio[j] * (1.0 + cable.ratio_error[j])
    runout = cable.capstan_runout[j] * math.sin(
        state.rotor[j] / cable.gearbox[j] + cable.capstan_phase[j]
    ) + cable.pulley_runout[j] * math.sin(state.q[j] + cable.pulley_phase[j])
    runout += cable.idler_runout[j] * math.sin(cable.idler_turns[j] * winding + cable.idler_phase[j])
    pulled = state.rotor[j] / true_ratio - winding + runout - state.slack[j]
    stretch = beyond_backlash(pulled, cable.backlash[j])
    # run-out changes slowly: it enters the stretch, not its rate
    rate = state.rotor_velocity[j] / true_ratio - winding_rate
    # of the travel since the last step only the part outside the backlash stretched the cable
    stretched = stretch - beyond_backlash(pulled - rate * step, cable.backlash[j])
    if stretch == 0.0:
        rate = 0.0
    state.hysteresis[j] = bouc_wen_step(state.hysteresis[j], stretched, cable.hysteresis_width[j])
    state.slow_stretch[j] = maxwell_step(state.slow_stretch[j], stretch, step, cable.slow_time[j])
    stiffness = cable.stiffness[j] * (1.0 - state.loss[j])
    tension = tension_of(
        stretch, rate, state.hysteresis[j], state.slow_stretch[j], stiffness, cable.elastic_share[j],
        cable.hysteresis_width[j], cable.slow_share[j], cable.damping[j],
    )  # fmt: skip
    state.tension[j] = tension
    share = cable.node_share[j]
    way = step * ((1.0 - share) * state.rotor_velocity[j] / true_ratio + share * winding_rate)
    slip_force = cable.node_friction[j] + cable.node_load_friction[j] * abs(tension)
    state.node[j] = dragged(state.node[j], way, stiffness / (share * (1.0 - share)), slip_force)
    speed = abs(state.qd[j])
    if speed > 0.0:
        state.slack[j] += step * set_rate(
            tension, cable.reference_tension[j], cable.set_side[j], speed, state.slack[j], cable.set_rate[j],
            cable.largest_set[j],
        )  # fmt: skip
        if cable.set_wander[j] > 0.0:
            state.dice[j] = next_draw(state.dice[j])
            state.slack[j] = wander_step(
                state.slack[j], state.dice[j], step * speed, cable.set_wander[j], cable.largest_set[j]
            )
        state.loss[j] += step * loss_rate(tension, cable.reference_tension[j], speed, state.loss[j], cable.loss_rate[j])


@inlined
def pull_at_joint(cable: CableDrive, state: ArmState, j: int) -> float:
    """Return the pull of cable j at the joint's end [Nm or N]."""
    return state.tension[j] - cable.node_share[j] * state.node[j]


@inlined
def turn_rotor(cable: CableDrive, state: ArmState, j: int, torque: float, braked: bool, step: float) -> None:
    """Advance motor j against its cable by a step [s], with a torque [Nm] at its shaft, or held by its brake."""
    if braked:
        state.rotor_velocity[j] = 0.0
        return
    pull = state.tension[j] + (1.0 - cable.node_share[j]) * state.node[j]
    load = pull / (cable.ratio[j] * (1.0 + cable.ratio_error[j]))
    velocity = state.rotor_velocity[j]
    free = velocity + step / cable.rotor_inertia[j] * (torque - load - cable.rotor_damping[j] * velocity)
    friction = cable.rotor_friction[j] + cable.rotor_load_friction[j] * abs(load)
    velocity = coulomb(free, step * friction / cable.rotor_inertia[j])
    state.rotor_velocity[j] = velocity
    state.rotor[j] += step * velocity


class TreeWork(Record):
    """Work arrays of `tree_dynamics`, whose results are `bias` and `matrix`."""

    sine: _PerLink
    cosine: _PerLink
    rotation: Annotated[Floats, "f8", ("link", 3, 3)]
    position: Annotated[Floats, "f8", ("link", 3)]
    # rows of the recursions: the links, then the base
    omega: _Vectors
    alpha: _Vectors
    acceleration: _Vectors
    force: _Vectors
    moment: _Vectors
    mass: Annotated[Floats, "f8", ("node",)]
    first_moment: _Vectors
    inertia: Annotated[Floats, "f8", ("node", 3, 3)]
    matrix: Annotated[Floats, "f8", ("link", "link")]  # mass matrix [kg m2, kg m, kg]
    bias: _PerLink  # torques of velocity, gravity and a moving base [Nm, N]
    zero: _PerLink  # accelerations for the bias: stays zero


@inlined
def tree_dynamics(tree: Tree, x: Floats, xd: Floats, gravity: Floats, base_motion: Floats, work: TreeWork) -> None:
    """Write a tree's bias torques and mass matrix in its own coordinates to `bias` and `matrix` of `work`.

    x and its rates xd have n entries or more [rad|m]; gravity (3,) [m/s2] and base_motion (3, 3), angular velocity,
    angular acceleration and linear acceleration of the base, are in base axes.
    """
    n = len(tree.parent)
    for j in range(n):
        work.sine[j] = math.sin(x[j])
        work.cosine[j] = math.cos(x[j])
    place_joints(tree, x, work.sine, work.cosine, work.rotation, work.position)
    for r in range(3):
        work.omega[n, r] = base_motion[0, r]
        work.alpha[n, r] = base_motion[1, r]
        work.acceleration[n, r] = base_motion[2, r] - gravity[r]
    newton_euler_recursion(
        tree, work.rotation, work.position, xd, work.zero, work.omega, work.alpha, work.acceleration,
        work.force, work.moment, work.bias,
    )  # fmt: skip
    composite_body_recursion(
        tree, work.rotation, work.position, work.mass, work.first_moment, work.inertia, work.matrix
    )


@inlined
def invert_symmetric(m: Floats, inverse: Floats) -> None:
    """Write the inverse of a symmetric 3 x 3 matrix, by cofactors, into the first three rows and columns."""
    a = m[1, 1] * m[2, 2] - m[1, 2] * m[1, 2]
    b = m[0, 2] * m[1, 2] - m[0, 1] * m[2, 2]
    c = m[0, 1] * m[1, 2] - m[0, 2] * m[1, 1]
    scale = 1.0 / (m[0, 0] * a + m[0, 1] * b + m[0, 2] * c)
    inverse[0, 0] = scale * a
    inverse[0, 1] = inverse[1, 0] = scale * b
    inverse[0, 2] = inverse[2, 0] = scale * c
    inverse[1, 1] = scale * (m[0, 0] * m[2, 2] - m[0, 2] * m[0, 2])
    inverse[1, 2] = inverse[2, 1] = scale * (m[0, 1] * m[0, 2] - m[0, 0] * m[1, 2])
    inverse[2, 2] = scale * (m[0, 0] * m[1, 1] - m[0, 1] * m[0, 1])


class Work(TreeWork):
    """Work arrays of `link_dynamics`, whose results are `bias` and `inverse`, and of `physics_step`."""

    inverse: Annotated[Floats, "f8", ("joint", "joint")]  # of the mass matrix
    push: PerJoint
    impulse: PerJoint


@inlined
def physics_step(cable: Cable, state: ArmState, shaft_torque: Floats, braked: bool, step: float, work: Work) -> None:
    """Advance an arm by one semi-implicit Euler step: forces, then velocities, then positions.

    shaft_torque (7,) is that of the motors [Nm]; `braked` holds every shaft; `link_dynamics` must have filled `work`.
    """
    q, qd = state.q, state.qd
    rate = winding_of(cable.coupling, qd)
    winding = winding_of(cable.coupling, q)
    for t in range(4):
        _turn_tool(cable, state, t, shaft_torque[3 + t], braked, step)
    for j in range(3):
        pull_cable(cable, state, j, winding[j], rate[j], step)
        turn_rotor(cable, state, j, shaft_torque[j], braked, step)

    pull = (pull_at_joint(cable, state, 0), pull_at_joint(cable, state, 1), pull_at_joint(cable, state, 2))
    force = joint_forces(cable.coupling, pull)
    for j in range(3):
        push = 0.0
        into = cable.stop_side[j] * (q[j] - cable.stop_position[j])
        if into > 0.0:
            resist = cable.stop_stiffness[j] * into + cable.stop_damping[j] * cable.stop_side[j] * qd[j]
            push = -cable.stop_side[j] * max(0.0, resist)
        work.push[j] = force[j] + push - work.bias[j]
        work.impulse[j] = step * (cable.link_friction[j] + cable.link_load_friction[j] * abs(state.tension[j]))
    move_joints(state, step, work)


@inlined
def move_joints(state: ArmState, step: float, work: Work) -> None:
    """Advance the joints by the forces and friction impulses in `work`, by semi-implicit Euler."""
    q, qd = state.q, state.qd
    for j in range(len(q)):
        change = 0.0
        for i in range(len(q)):
            change += work.inverse[j, i] * work.push[i]
        qd[j] += step * change
    coulomb_coupled(work.inverse, work.impulse, qd, state.friction, _FRICTION_SWEEPS)
    for j in range(len(q)):
        q[j] += step * qd[j]


def unstretched_rotors(cable: CableDrive, q: Floats, winding: Floats) -> Floats:
    """Return motor positions (n,) [rad] with unstretched cables, at joint positions q (n,) and their winding (n,)."""
    true_ratio = cable.ratio * (1.0 + cable.ratio_error)
    fixed = winding - cable.pulley_runout * np.sin(q + cable.pulley_phase)
    fixed = fixed - cable.idler_runout * np.sin(cable.idler_turns * winding + cable.idler_phase)
    rotor: Floats = true_ratio * fixed
    for _ in range(20):  # the capstan's run-out turns with the rotor; an iteration leaves 1/20 of the error
        rotor = true_ratio * (fixed - cable.capstan_runout * np.sin(rotor / cable.gearbox + cable.capstan_phase))
    return rotor


@inlined
def _turn_tool(cable: Cable, state: ArmState, t: int, torque: float, braked: bool, step: float) -> None:
    """Advance tool motor t, with rigid cables and a stop of its joint."""
    if braked:
        state.rotor_velocity[3 + t] = 0.0
        return
    joint = (state.rotor[3 + t] - cable.tool_carried[t] * state.rotor[2]) / cable.tool_ratio[t]
    into = joint - cable.tool_stop[t]
    push = -cable.tool_stop_stiffness[t] * into / cable.tool_ratio[t] if into > 0.0 else 0.0
    velocity = state.rotor_velocity[3 + t]
    free = velocity + step / cable.tool_inertia[t] * (torque + push - cable.tool_damping[t] * velocity)
    friction = cable.tool_friction[t] * (1.0 + cable.tool_ripple[t] * math.sin(cable.tool_wave[t] * joint))
    if velocity == 0.0:
        friction *= 1.0 + cable.tool_stiction[t]
    velocity = coulomb(free, step * friction / cable.tool_inertia[t])
    state.rotor_velocity[3 + t] = velocity
    state.rotor[3 + t] += step * velocity


@inlined
def link_dynamics(tree: Tree, state: ArmState, gravity: Floats, base_motion: Floats, work: Work) -> None:
    """Write bias torques and the inverse mass matrix of the three positioning joints, payload included.

    They are constant over a millisecond's substeps, which are for cables, rotors and friction.
    """
    tree_dynamics(tree, state.q, state.qd, gravity, base_motion, work)
    invert_symmetric(work.matrix, work.inverse)
