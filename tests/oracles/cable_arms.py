"""Cable-driven arms for tests: homed ones, ones with linear cables, and steps of their physics with all that they did."""

import copy
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catenary.kernels.compiled import compiled
from catenary.robots.model import Tree
from catenary.simulation.cable_parameters import RAVEN2, RAVEN2_STIFF, Cable, CableArm, load_cable_arm
from catenary.simulation.cable_physics import ArmState, Work, link_dynamics, physics_step, unstretched_rotors
from catenary.simulation.cable_plant import CablePlant
from catenary.transmission.cable_elasticity import winding_of

Floats = NDArray[np.float64]
ROBOTS = (RAVEN2_STIFF, RAVEN2)  # data files of RAVEN-IIs
HOME = np.array([np.deg2rad(30.0), np.deg2rad(90.0), 0.40])


def _without(cable: Cable, *fields: str) -> Cable:
    return cable.replace(**dict.fromkeys(fields, 0.0))


def without_runout(cable: Cable) -> Cable:
    return _without(cable, "capstan_runout", "pulley_runout", "idler_runout")


def without_wear(cable: Cable) -> Cable:
    return _without(cable, "set_rate", "set_wander", "loss_rate")


def without_friction(cable: Cable) -> Cable:
    parts = ("rotor", "node", "link")
    return _without(cable, *(f"{part}_{kind}" for part in parts for kind in ("friction", "load_friction")))


def with_linear_cables(cable: Cable) -> Cable:
    """Springs and dampers and nothing else: no hysteresis, creep, backlash, run-out, set, wear or friction."""
    plain = _without(without_wear(without_friction(without_runout(cable))), "slow_share", "backlash")
    return plain.replace(elastic_share=1.0)


def linear_arm() -> CableArm:
    arm = load_cable_arm(RAVEN2_STIFF)
    return arm._replace(cable=with_linear_cables(arm.cable))


@cache
def _homed(robot: str = RAVEN2, **options: Any) -> CablePlant:
    plant = CablePlant(load_cable_arm(robot), **options)
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


@compiled
def take_steps(
    tree: Tree,
    cable: Cable,
    state: ArmState,
    shaft_torque: Floats,
    gravity: Floats,
    base_motion: Floats,
    step: float,
    work: Work,
    steps: ArmState,
) -> None:
    """Step the physics with shaft torques (T, 7), and write the state after each step into `steps`, T rows."""
    cable, state, work = cable[()], state[()], work[()]
    for k in range(len(shaft_torque)):
        link_dynamics(tree, state, gravity, base_motion, work)
        physics_step(cable, state, shaft_torque[k], False, step, work)
        steps[k] = state


def resting_state(cable: Cable, q: Floats) -> ArmState:
    """At q, at rest, no cable stretched."""
    state = ArmState(q=q)
    state.rotor[:3] = unstretched_rotors(cable, q, np.array(winding_of(cable.coupling, q)))
    return state
