"""A motor, its gear and a cable: how it stretches, and how the rotor turns against it. Compiled.

Any joint of a cable-driven arm has this between its motor and itself; which joints a cable moves is the arm's matter.
"""

import math
from typing import TYPE_CHECKING

from catenary.kernels.compiled import inlined
from catenary.transmission.drift import loss_rate, set_rate
from catenary.transmission.elasticity import beyond_backlash, bouc_wen_step, maxwell_step, tension_of
from catenary.transmission.friction import coulomb

if TYPE_CHECKING:
    from catenary.simulation.cable_parameters import CableDrive
    from catenary.simulation.cabled.arm_state import ArmState


@inlined
def pull_cable(
    cable: "CableDrive", state: "ArmState", j: int, winding: float, winding_rate: float, step: float
) -> None:
    """Stretch cable j and write its tension; update its hysteresis, creep, set and wear.

    Args:
        cable: The arm's numbers.
        state: Overwritten.
        j: Which cable.
        winding: What the joints wind up of it, in units of the motor's side of the gear [rad or m].
        winding_rate: Its rate.
        step: [s].
    """
    true_ratio = cable.ratio[j] * (1.0 + cable.ratio_error[j])
    runout = cable.capstan_runout[j] * math.sin(
        state.rotor[j] / cable.gearbox[j] + cable.capstan_phase[j]
    ) + cable.pulley_runout[j] * math.sin(state.q[j] + cable.pulley_phase[j])
    pulled = state.rotor[j] / true_ratio - winding + runout - state.slack[j]
    stretch = beyond_backlash(pulled, cable.backlash[j])
    # run-out moves slowly: it enters the stretch, not its rate
    rate = state.rotor_velocity[j] / true_ratio - winding_rate
    # of the travel since the last step only what lay outside the backlash stretched the cable
    stretched = stretch - beyond_backlash(pulled - rate * step, cable.backlash[j])
    if stretch == 0.0:
        rate = 0.0
    state.hysteresis[j] = bouc_wen_step(state.hysteresis[j], stretched, cable.hysteresis_width[j])
    state.slow_stretch[j] = maxwell_step(state.slow_stretch[j], stretch, step, cable.slow_time[j])
    tension = tension_of(
        stretch,
        rate,
        state.hysteresis[j],
        state.slow_stretch[j],
        cable.stiffness[j] * (1.0 - state.loss[j]),
        cable.elastic_share[j],
        cable.hysteresis_width[j],
        cable.slow_share[j],
        cable.damping[j],
    )
    state.tension[j] = tension
    speed = abs(state.qd[j])
    if speed > 0.0:
        state.slack[j] += step * set_rate(
            tension,
            cable.reference_tension[j],
            cable.set_side[j],
            speed,
            state.slack[j],
            cable.set_rate[j],
            cable.largest_set[j],
        )
        state.loss[j] += step * loss_rate(
            tension, cable.reference_tension[j], speed, state.loss[j], cable.loss_rate[j]
        )


@inlined
def turn_rotor(
    cable: "CableDrive", state: "ArmState", j: int, torque: float, braked: bool, step: float
) -> None:
    """Turn motor j against its cable: torque [Nm] at its shaft, or held by its brake."""
    if braked:
        state.rotor_velocity[j] = 0.0
        return
    load = state.tension[j] / (cable.ratio[j] * (1.0 + cable.ratio_error[j]))
    velocity = state.rotor_velocity[j]
    free = velocity + step / cable.rotor_inertia[j] * (torque - load - cable.rotor_damping[j] * velocity)
    friction = cable.rotor_friction[j] + cable.rotor_load_friction[j] * abs(load)
    velocity = coulomb(free, step * friction / cable.rotor_inertia[j])
    state.rotor_velocity[j] = velocity
    state.rotor[j] += step * velocity
