"""Lab 1: what gravity asks of two links, and what a PD controller makes of it.

Ninety minutes, pen and paper, no robot. Where a line says `...` your formula is missing; the line below checks it, and
says what is wrong as far as that can be told.
"""

# ## 1. The torques that hold the arm (40 minutes)
#
# Two uniform rods, 1 m and 0.5 m long, 1 kg each, turn in a vertical plane. `q[0]` is the first rod's angle from the
# horizontal, upwards; `q[1]` the second rod's from the first. Both in rad, g = 9.81 m/s2.
#
# Draw it. Write down the potential energy of both rods, whose masses sit half way along them. Its derivatives by `q[0]`
# and `q[1]` are the torques that motors must supply to hold the arm still.

import matplotlib.pyplot as plt
import numpy as np
from checks import check_sag, check_torque

import catenary


def torque(q):
    return [..., ...]  # [Nm]


print(check_torque(torque))

# ## 2. How far a PD controller sags (20 minutes)
#
# `tau = kp (q_ref - q) - kd qd` knows nothing of gravity. Where does the arm come to rest? Take the gravity torque at
# `q_ref` for that at `q`: the arm hardly moves. Use your `torque`.


def sag(q_ref, kp):
    return [..., ...]  # q - q_ref at rest [rad]; kp in Nm/rad


print(check_sag(sag))

# ## 3. See it (30 minutes)
#
# The same arm, simulated, first with PD alone, then with your torque added. Before you run it: how do the lines run on
# logarithmic axes? Then find out at which kp your formula is off by a tenth, and why.

arm = catenary.load_robot("two_link")
q_ref, stiffness = np.array([0.4, -0.7]), np.array([50.0, 100.0, 200.0, 400.0, 800.0])


class PDAnd:
    """A PD controller with a constant torque `held` (2,) on top."""

    def __init__(self, kp, held):
        self.pd, self.held = catenary.JointPD(kp=[kp] * 2, kd=np.array([1.2, 0.4]) * np.sqrt(kp)), np.asarray(held)

    def torque(self, state, reference):
        return self.pd.torque(state, reference) + self.held


def rest(kp, held):
    """Return q - q_ref once the arm has come to rest."""
    plant = catenary.MujocoPlant(arm, start=q_ref)
    plant.home()
    stay = catenary.go_to(q_ref, q_ref, max_velocity=[1.0] * 2, max_acceleration=[1.0] * 2)
    catenary.run_loop(plant, PDAnd(kp, held), stay, duration=3.0, max_speed=np.inf)
    return plant.measured_js().q - q_ref


alone = np.array([rest(kp, [0.0, 0.0]) for kp in stiffness])
print(f"PD alone, kp {stiffness[0]:g} Nm/rad: sags by {np.rad2deg(alone[0]).round(2)} deg")
figure, axes = plt.subplots()
axes.loglog(stiffness, np.abs(alone), "o", label=["joint 0, simulated", "joint 1, simulated"])
if ... not in torque(q_ref):
    print(f"with your torque: by {np.rad2deg(rest(stiffness[0], torque(q_ref))).round(4)} deg")
if ... not in sag(q_ref, 1.0):
    axes.loglog(stiffness, np.abs([sag(q_ref, kp) for kp in stiffness]), label=["joint 0, yours", "joint 1, yours"])
axes.set(xlabel="kp [Nm/rad]", ylabel="sag [rad]")
axes.legend()
figure.savefig("sag.png")
