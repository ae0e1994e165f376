"""Guide an arm by hand with a load that nobody told it of, and end a motion by a collision.

Prints what a Panda that holds itself by gravity torque alone does with 2 kg at its flange: with the gravity torque of
the bare arm it falls until the loop's guard of speeds ends it; with `HandGuiding` it holds, weighs the load within a
second, and carries it. A load above the bound is refused, and held. At the end 15 N on a still arm end the loop.
"""

import numpy as np

import catenary

arm = catenary.load_robot("panda")
q = np.array([0.0, 0.3, 0.0, -1.6, 0.0, 1.9, 0.0])
noise = np.array([0.3, 0.3, 0.3, 0.3, 0.1, 0.1, 0.1])  # Nm, of torques where nothing touches the arm
kp = np.array([250.0, 2190.0, 122.0, 764.0, 65.0, 68.0, 12.0])  # Nm/rad: 8 Hz, critically damped
kd = kp / 25.0
stay = catenary.go_to(q, q, max_velocity=np.ones(arm.n), max_acceleration=np.ones(arm.n))


def held(controller, load: float, **options) -> str:
    """Say how a simulated arm ends that carries a load."""
    true = arm.with_payload(arm.tip, load, [0.0, 0.0, 0.05])
    plant = catenary.MujocoPlant(true, start=q)
    plant.home()
    try:
        catenary.run_loop(plant, controller, stay, duration=3.0, **options)
    except catenary.CatenaryError as error:
        return str(error)
    lower, upper = (catenary.forward_kinematics(arm, at).position[2] for at in (plant.measured_js().q, q))
    return f"holds, {1000 * (upper - lower):.0f} mm lower"


print("2 kg, gravity torque alone:", held(catenary.GravityPD(arm, 0.0 * kp, 0.0 * kd), 2.0))
for load in (2.0, 5.0):
    guiding = catenary.HandGuiding(arm, kp, kd, deviation=noise, max_payload=3.0)
    end = held(guiding, load)
    print(f"{load:g} kg, HandGuiding: {guiding.state}, {guiding.mass:.2f} kg; {end}")

observer = catenary.MomentumObserver(arm, deviation=noise)  # or observer.learn(...) from a recording of free motion
guard = catenary.CollisionGuard(observer)


def pushed(tick) -> None:
    """Show the guard what the robot would report while 15 N push its tip, from 0.5 s on."""
    push = catenary.jacobian(arm, tick.state.q)[:3].T @ [9.0, 0.0, -12.0] * (tick.time > 0.5)
    guard(tick._replace(state=tick.state._replace(tau=tick.state.tau - push)))


print("15 N:", held(catenary.GravityPD(arm, kp, kd), 0.0, observers=[pushed]))
