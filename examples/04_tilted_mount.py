"""A UR5e on a mount tilted by 30 degrees: what its joints hold, and what becomes of it when the gravity is wrong.

Prints the torque of every joint on a level and on the tilted mount: the first joint, which turns about the vertical on
a level mount, holds nothing there and most here. Then it floats the simulated arm by gravity torque alone, half a
second each: with the gravity of the mount it stays, with that of a level base it falls on every joint that is loaded
otherwise. The last lines hold it with a PD controller, which sags unless the gravity is right.
"""

from pathlib import Path

import numpy as np

import catenary

arm = catenary.load_robot(Path(__file__).with_name("ur5e.urdf"))
q = np.deg2rad([0.0, -60.0, 80.0, -110.0, -90.0, 0.0])
mount = catenary.FixedBase(roll=np.deg2rad(30.0))
level = np.array([0.0, 0.0, -9.81])
tilted = mount.sample(np.zeros(1)).gravity[0]


class Compensation:
    """A PD controller that also carries the arm, under the gravity that it believes in."""

    def __init__(self, stiffness: float, gravity: np.ndarray) -> None:
        share = np.array([1.0, 1.0, 0.5, 0.05, 0.05, 0.002])  # the wrist's links are light
        self.pd = catenary.JointPD(stiffness * share, 0.05 * stiffness * share)
        self.hold, self.gravity = catenary.gravity_kernel(arm), gravity

    def torque(self, state, reference):
        return self.pd.torque(state, reference) + self.hold(state.q, self.gravity)


print("joint            level [Nm]   tilted [Nm]")
for row in zip(arm.joint_names, *(catenary.gravity_torque(arm, q, g) for g in (level, tilted)), strict=True):
    print("{:14} {:12.2f} {:13.2f}".format(*row))

stay = catenary.go_to(q, q, max_velocity=np.ones(arm.n), max_acceleration=np.ones(arm.n))
for stiffness, seconds in ((0.0, 0.5), (1000.0, 1.0)):
    for name, gravity in (("level", level), ("tilted", tilted)):
        plant = catenary.MujocoPlant(arm, base=mount, start=q)
        plant.home()
        catenary.run_loop(plant, Compensation(stiffness, gravity), stay, duration=seconds, max_speed=np.inf)
        moved = np.rad2deg(np.abs(plant.measured_js().q - q))
        what = f"PD, {stiffness:.0f} Nm/rad" if stiffness else "gravity torque alone"
        print(f"{what}, gravity of a {name} base: moved by {moved.round(3)} deg")
