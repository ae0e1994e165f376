"""Cable-driven arms for tests: homed ones, ones with linear cables, and steps of their physics with all that they did."""

import copy
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from catenary.kernels.compiled import compiled
from catenary.robots.model import Tree
from catenary.simulation.cable_parameters import Cable, CableArm, load_cable_arm
from catenary.simulation.cable_physics import ArmState, Work, link_dynamics, physics_step, unstretched_rotors
from catenary.simulation.cable_plant import CablePlant

Floats = NDArray[np.float64]
HOME = np.array([np.deg2rad(30.0), np.deg2rad(90.0), 0.40])


def without_runout(cable: Cable) -> Cable:
    return cable.replace(capstan_runout=np.zeros(3), pulley_runout=np.zeros(3))


def without_friction(cable: Cable) -> Cable:
    nothing = np.zeros(3)
    return cable.replace(
        rotor_friction=nothing,
        rotor_load_friction=nothing,
        link_friction=nothing,
        link_load_friction=nothing,
    )


def with_linear_cables(cable: Cable) -> Cable:
    """Springs and dampers and nothing else: no hysteresis, creep, backlash, run-out, set, wear or friction."""
    nothing = np.zeros(3)
    return without_friction(without_runout(cable)).replace(
        elastic_share=np.ones(3),
        slow_share=nothing,
        backlash=nothing,
        set_rate=nothing,
        loss_rate=nothing,
    )


def linear_arm() -> CableArm:
    arm = load_cable_arm()
    return arm._replace(cable=with_linear_cables(arm.cable))


@cache
def _homed(**options: Any) -> CablePlant:
    plant = CablePlant(**options)
    plant.home()
    return plant


def homed_plant(side: str = "left", **options: Any) -> CablePlant:
    """A homed and enabled arm of one's own, made with CablePlant's options and homed once per session."""
    return copy.deepcopy(_homed(side=side, **options))


def smooth_motion(start: Floats, seconds: float, period: float = 1e-3) -> Floats:
    """Setpoints (T, 7): the positioning joints swing at their own pace, from rest; the tool stays."""
    t = np.arange(round(seconds / period)) * period
    rows = np.tile(start, (len(t), 1))
    swing = np.minimum(t / 2.0, 1.0) ** 2 * (3.0 - 2.0 * np.minimum(t / 2.0, 1.0))
    rows[:, 0] += swing * np.deg2rad(15.0) * np.sin(1.1 * t)
    rows[:, 1] += swing * np.deg2rad(20.0) * np.sin(0.8 * t)
    rows[:, 2] += swing * 0.03 * np.sin(1.3 * t)
    return rows


class Steps(NamedTuple):
    """State after each of T steps."""

    rotor: Floats  # (T, 3)
    rotor_velocity: Floats
    q: Floats
    qd: Floats
    tension: Floats  # during the step
    hysteresis: Floats
    slow_stretch: Floats
    friction: Floats  # impulses of the links' friction during the step


def new_steps(count: int) -> Steps:
    return Steps._make(np.empty((count, 3)) for _ in Steps._fields)


@compiled
def take_steps(
    tree: Tree,
    cable: Cable,
    state: ArmState,
    shaft_torque: Floats,
    braked: bool,
    gravity: Floats,
    base_motion: Floats,
    step: float,
    work: Work,
    out: Steps,
) -> None:
    """Step the physics with shaft torques (T, 7), on a base at rest or in motion, and keep every step."""
    cable, state, work = cable[()], state[()], work[()]
    for k in range(len(shaft_torque)):
        link_dynamics(tree, state, gravity, base_motion, work)
        physics_step(cable, state, shaft_torque[k], braked, step, work)
        for j in range(3):
            out.rotor[k, j] = state.rotor[j]
            out.rotor_velocity[k, j] = state.rotor_velocity[j]
            out.q[k, j] = state.q[j]
            out.qd[k, j] = state.qd[j]
            out.tension[k, j] = state.tension[j]
            out.hysteresis[k, j] = state.hysteresis[j]
            out.slow_stretch[k, j] = state.slow_stretch[j]
            out.friction[k, j] = state.friction[j]


def resting_state(cable: Cable, q: Floats) -> ArmState:
    """At q, at rest, no cable stretched."""
    state = ArmState(q=q)
    state.rotor[:3] = unstretched_rotors(cable, q)
    return state
