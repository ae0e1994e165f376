"""Keep the handle of a haptic device steady in an elevator and a van, as the gravity paper's reference 10 did.

The base of a two-joint handle accelerates, and so does the hand that rests on it: a mass that pulls at the handle.
Prints how far the handle moves within four seconds: compensated by the nominal gravity, by the sensed vector (gravity
less acceleration), and with a damping that grows with the sensed acceleration too, which the hand's pull needs.
"""

import numpy as np

import catenary

arm = catenary.load_robot("two_link")
q, level = np.array([0.5, 1.2]), np.array([0.0, 0.0, -9.81])
hand, damping = 0.5, np.array([4.0, 2.0])  # kg; Nms/rad
rides = {  # amplitude of the base's acceleration [m/s2], and its frequency [Hz]
    "elevator, 1.2 m/s2 up and down": (np.array([0.0, 0.0, 1.2]), 0.25),
    "van, 3 m/s2 forward and back": (np.array([3.0, 0.0, 0.0]), 0.5),
}


class Ride:  # a base that accelerates along a line
    def __init__(self, amplitude: np.ndarray, frequency: float) -> None:
        self.amplitude, self.frequency = amplitude, frequency

    def sample(self, times: np.ndarray):
        motion = np.zeros((len(times), 3, 3))
        motion[:, 2] = np.sin(2.0 * np.pi * self.frequency * times)[:, None] * self.amplitude
        return catenary.FixedBase().sample(times)._replace(motion=motion)


class Handle:
    """Hold the handle by gravity torque and damping; the hand's pull is part of the simulation."""

    def __init__(self, gravity: np.ndarray | None, per_acceleration: float) -> None:
        self.hold, self.gravity, self.gain = catenary.gravity_kernel(arm), gravity, per_acceleration

    def torque(self, state, reference) -> np.ndarray:
        acceleration = level - state.gravity  # of the base, which does not turn
        pull = catenary.jacobian(arm, state.q)[:3].T @ (-hand * acceleration)
        resisted = damping * (1.0 + self.gain * np.linalg.norm(acceleration)) * state.qd
        gravity = state.gravity if self.gravity is None else self.gravity
        return self.hold(state.q, gravity) - resisted + pull


stay = catenary.go_to(q, q, max_velocity=np.ones(arm.n), max_acceleration=np.ones(arm.n))
for ride, (amplitude, frequency) in rides.items():
    for name, handle in (
        ("nominal gravity", Handle(level, 0.0)),
        ("sensed gravity", Handle(None, 0.0)),
        ("sensed gravity, damping by acceleration", Handle(None, 1.0)),
    ):
        plant = catenary.MujocoPlant(arm, base=Ride(amplitude, frequency), start=q)
        plant.home()
        track = []
        watch = [lambda tick, track=track: track.append(catenary.forward_kinematics(arm, tick.state.q).position)]
        catenary.run_loop(plant, handle, stay, duration=4.0, max_speed=np.inf, observers=watch)
        moved = 1000.0 * np.linalg.norm(np.array(track) - track[0], axis=1).max()
        print(f"{ride}: {name}: moves by {moved:.0f} mm")
