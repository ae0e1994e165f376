"""Feel what touches an arm by a force/torque sensor under its base, on a rover that leans [Iagnemma et al. 2000].

The sensor carries the whole arm, so its reading is mostly weight, and where the base leans the weight acts in another
direction. Prints how far the force and the place of a touch of 10 N are off: as read, with the weight on a level base
subtracted, and with the weight by the accelerometer's gravity. The real arm is 2 % heavier than the model.
"""

import numpy as np

import catenary

arm = catenary.load_robot("panda")
rng = np.random.default_rng(0)
level, push = np.array([0.0, 0.0, -9.81]), np.array([6.0, 0.0, -8.0])  # m/s2; N, at the flange


def weight(q: np.ndarray, gravity: np.ndarray) -> np.ndarray:
    """Return force [N] and moment about the base's origin [Nm] of the arm's weight, in base axes."""
    force = arm.tree.mass.sum() * gravity
    return np.r_[force, np.cross(catenary.center_of_mass(arm, q), force)]


def pushed_at(wrench: np.ndarray, point: np.ndarray) -> float:
    """Return how far [m] the line along which a wrench acts passes by a point."""
    force, moment = wrench[:3], wrench[3:]
    return float(np.linalg.norm(moment - np.cross(point, force)) / np.linalg.norm(force))


print("lean [deg]   gravity     force off [N]   line of force off [mm]")
for lean in (0.0, 10.0, 20.0):
    true = catenary.FixedBase(roll=np.deg2rad(lean)).sample(np.zeros(1)).gravity[0]
    sensed = true + rng.normal(0.0, 0.03, 3)  # an accelerometer at rest reads the opposite
    for name, believed in (("none", 0.0 * level), ("level", level), ("sensed", sensed)):
        errors = []
        for _ in range(200):
            q = rng.uniform(arm.lower, arm.upper)
            flange = catenary.forward_kinematics(arm, q).position
            noise = rng.normal(0.0, [0.2, 0.2, 0.2, 0.02, 0.02, 0.02])
            reading = 1.02 * weight(q, true) + np.r_[push, np.cross(flange, push)] + noise
            touch = reading - weight(q, believed)
            errors.append([np.linalg.norm(touch[:3] - push), 1000.0 * pushed_at(touch, flange)])
        force, line = np.median(errors, axis=0)
        print(f"{lean:10.0f}   {name:8} {force:15.1f} {line:24.0f}")
