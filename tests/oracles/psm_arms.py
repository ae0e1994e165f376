"""Simulated PSMs for tests: homed ones, one whose cables are springs and nothing else, and steps of their physics."""

import copy
from functools import cache

import numpy as np
from numpy.typing import NDArray

from catenary.kernels.compiled import compiled
from catenary.robots.model import Tree
from catenary.simulation.psm_controller import PsmDrive, PsmState, PsmWork, psm_dynamics, psm_step, unstretched_motors
from catenary.simulation.psm_plant import PsmPlant

Floats = NDArray[np.float64]
HOME = np.array([0.1, -0.2, 0.12, 0.3, -0.2, 0.25, 0.2])
NOTHING = (
    *("rotor_friction", "rotor_load_friction", "link_friction", "link_load_friction", "slow_share", "backlash"),
    *("set_rate", "loss_rate", "capstan_runout", "pulley_runout", "damping", "rotor_damping", "joint_damping"),
)


def with_plain_springs(drive: PsmDrive) -> PsmDrive:
    """Cables that are springs: no friction, damping, hysteresis, creep, backlash, run-out, set or wear."""
    return drive.replace(**dict.fromkeys(NOTHING, 0.0), elastic_share=1.0)


@cache
def _homed() -> PsmPlant:
    plant = PsmPlant()
    plant.home()
    return plant


def homed_psm() -> PsmPlant:
    """A homed and enabled PSM of one's own, homed once per session."""
    return copy.deepcopy(_homed())


def psm_motion(start: Floats, seconds: float, period: float = 1e-3) -> Floats:
    """Setpoints (T, 7): all joints swing at their own pace, from rest."""
    t = (np.arange(round(seconds / period)) * period)[:, None]
    swing = np.minimum(t / 2.0, 1.0) ** 2 * (3.0 - 2.0 * np.minimum(t / 2.0, 1.0))
    amplitude = np.array([0.2, 0.15, 0.03, 0.6, 0.4, 0.4, 0.2])
    pace = np.array([1.1, 0.8, 1.3, 0.9, 1.2, 1.0, 0.7])
    return start + swing * amplitude * np.sin(pace * t)


def resting_psm(drive: PsmDrive, q: Floats) -> PsmState:
    """At q, at rest, no cable stretched."""
    return PsmState(q=q, rotor=unstretched_motors(drive, q))


@compiled
def take_psm_steps(
    tree: Tree,
    coupling: Floats,
    drive: PsmDrive,
    state: PsmState,
    shaft_torque: Floats,
    gravity: Floats,
    base_motion: Floats,
    step: float,
    work: PsmWork,
    steps: PsmState,
) -> None:
    """Step the physics with shaft torques (T, 7), and write the state after each step into `steps`, T rows."""
    drive, state, work = drive[()], state[()], work[()]
    for k in range(len(shaft_torque)):
        psm_dynamics(tree, coupling, drive, state, gravity, base_motion, work)
        psm_step(drive, state, shaft_torque[k], False, step, work)
        steps[k] = state
