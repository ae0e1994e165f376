"""Lab 3: gravity on a base that tilts and rocks.

Ninety minutes, pen and paper, no robot. The two links of lab 1 stand on a table that somebody tilts, as an operating
table is, or on a ship. Where a line says `...` your formula is missing; the line below checks it, and says what is
wrong as far as that can be told.
"""

# ## 1. Gravity, as the base sees it (20 minutes)
#
# The base has axes of its own: x forward, z up, and y to the left. It is turned about y by `pitch` [rad]: for a
# positive angle its x axis dips. Gravity stays where it is, but the arm knows only its base. Write gravity in the
# base's axes.

import matplotlib.pyplot as plt
import numpy as np
from checks import check_base_gravity, check_felt, check_tilted_torque

import catenary
from catenary.simulation.base_motion import RockingBase


def base_gravity(pitch):
    return [..., ..., ...]  # [m/s2]; on a level base (0, 0, -9.81)


print(check_base_gravity(base_gravity))

# ## 2. The torques under any gravity (30 minutes)
#
# The arm moves in the x-z plane, angles count from x upwards (lab 1). Take the vector `gravity` (3,) as given. A mass
# at the point p takes the potential energy -m gravity . p; its derivatives by `q[0]` and `q[1]` are the torques. The
# rods are uniform, 1 m and 0.5 m long, 1 kg each.


def torque(q, gravity):
    return [..., ...]  # [Nm]


print(check_tilted_torque(torque))

# ## 3. What the sensor says (10 minutes)
#
# An accelerometer on the base feels what holds it up: at rest on a level base it reads (0, 0, +9.81). On a base that
# also moves it reads its acceleration minus gravity. The arm feels the same. Which vector do your torques need?


def felt(reading):
    return [..., ..., ...]  # [m/s2], from reading (3,)


print(check_felt(felt))

# ## 4. See it (30 minutes)
#
# The simulated arm on a base that rocks by 5 degrees about 15 degrees of pitch, once in five seconds, held by
#
# * PD alone,
# * PD and static gravity: that of a level base,
# * PD and dynamic gravity: that which the sensor feels, tick by tick [Lewis and Hannaford, ICRA 2014, figure 6].
#
# Before you run it: by which factor does each help? Then let the base rock once a second. Yours is now hardly better
# than the static one, and the package's is: what does the arm feel besides gravity when its base turns?

arm = catenary.load_robot("two_link")
q_ref, kp, kd = np.array([0.4, -0.7]), [200.0, 200.0], [20.0, 8.0]
stay = catenary.go_to(q_ref, q_ref, max_velocity=[1.0] * 2, max_acceleration=[1.0] * 2)
base = RockingBase(mean=np.deg2rad(15.0), amplitude=np.deg2rad(5.0), frequency=0.2, axis=(0.0, 1.0, 0.0))


class WithYours:
    """PD and your torque, under the gravity that the sensor feels."""

    def __init__(self):
        self.pd = catenary.JointPD(kp, kd)

    def torque(self, state, reference):
        return self.pd.torque(state, reference) + np.asarray(torque(state.q, felt(-state.gravity)))


controllers = {
    "PD": catenary.JointPD(kp, kd),
    "PD + static": catenary.GravityPD(arm, kp, kd, gravity=[0.0, 0.0, -9.81]),
    "PD + dynamic": catenary.GravityPD(arm, kp, kd),
}
if ... not in [*torque(q_ref, np.zeros(3)), *felt(np.zeros(3))]:
    controllers["PD + yours"] = WithYours()
errors = {}
for name, controller in controllers.items():
    plant = catenary.MujocoPlant(arm, base=base, start=q_ref)
    plant.home()
    report = catenary.run_loop(plant, controller, stay, duration=10.0, max_speed=np.inf)
    errors[name] = np.rad2deg(report.tracking_nominal)
    print(f"{name:13} RMS error {errors[name].round(4)} deg")
figure, axes = plt.subplots()
for joint in range(2):
    axes.semilogy(range(len(errors)), [error[joint] for error in errors.values()], "o-", label=f"joint {joint}")
axes.set(xticks=range(len(errors)), xticklabels=errors, ylabel="RMS error [deg]")
axes.legend()
figure.savefig("rocking.png")
