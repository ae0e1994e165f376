"""Guide an arm by hand with a load that nobody told it of, and end a motion by a collision.

Prints what a Panda that holds itself by gravity torque alone does with 2 kg at its flange: with `GravityHold` it falls
until the loop's guard of speeds ends it; with `HandGuiding` it holds, weighs the load within a second, and carries it.
A load above the bound is refused, and held. At the end a hand in the way of a still arm, 15 N, ends the loop.
"""

import numpy as np

import catenary
from catenary.control.collision_guard import CollisionGuard
from catenary.control.gains import gains_from_mass
from catenary.control.gravity_pd import GravityHold, GravityPD
from catenary.control.hand_guiding import HandGuiding
from catenary.errors import LimitError
from catenary.gravity.payload import Payload
from catenary.trajectories.reference import Rest

arm = catenary.load_robot("panda")
q = np.array([0.0, 0.3, 0.0, -1.6, 0.0, 1.9, 0.0])
noise = np.array([0.3, 0.3, 0.3, 0.3, 0.1, 0.1, 0.1])  # Nm, of torques where nothing touches the arm
gains = gains_from_mass(arm, frequency_hz=8.0, damping_ratio=1.0)


def held(controller, load: float, seconds: float = 3.0, **options) -> str:
    """Say how a simulated arm with a load ends."""
    plant = catenary.MujocoPlant(arm, start=q, payload=Payload(load, position=(0.0, 0.0, 0.05)))
    plant.home()
    try:
        catenary.run_loop(plant, controller, Rest(q, seconds), **options)
    except LimitError as error:
        return str(error)
    sunk = catenary.forward_kinematics(arm, q).position[2]
    sunk -= catenary.forward_kinematics(arm, plant.measured_js().q).position[2]
    return f"holds, {1000 * sunk:.0f} mm lower"


print("2 kg, GravityHold:", held(GravityHold(arm), 2.0))
for load in (2.0, 5.0):
    guiding = HandGuiding(arm, *gains, deviation=noise, max_payload=3.0)
    end = held(guiding, load)
    print(f"{load:g} kg, HandGuiding: {guiding.state}, {guiding.mass:.2f} kg; {end}")

observer = catenary.MomentumObserver(arm, deviation=noise)  # or observer.learn(...) from a recording of free motion
guard = CollisionGuard(observer)


def pushed(tick) -> None:
    """Show the guard what the robot would report while 15 N push its tip, from 0.5 s on."""
    push = catenary.jacobian(arm, tick.state.q)[:3].T @ [9.0, 0.0, -12.0] * (tick.time > 0.5)
    guard(tick._replace(state=tick.state._replace(tau=tick.state.tau - push)))


print("15 N:", held(GravityPD(arm, *gains), 0.0, observers=[pushed]))
