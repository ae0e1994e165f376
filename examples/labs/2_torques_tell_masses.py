"""Lab 2: what torques tell of masses, g = Z(q) s.

Ninety minutes, pen and paper, no robot. The two links of lab 1 again, with masses that nobody knows. Where a line says
`...` your formula is missing; the line below checks it, and says what is wrong as far as that can be told.
"""

# ## 1. The arm as a table (15 minutes)
#
# The first rod is 1 m long, the second 0.5 m; both joints turn about parallel axes. Write the Denavit-Hartenberg table:
# alpha, d and the offsets of theta are zero, so two lengths `a` [m] remain. Choose the convention and say which:
#
# * standard: `T = Rz(theta) Tx(a)`, a frame at the end of its own link;
# * modified (Craig): `T = Tx(a) Rz(theta)`, a frame at the beginning of its own link.

import matplotlib.pyplot as plt
import numpy as np
from checks import check_estimate, check_regressor, check_silent_pose, check_table, measured_torques

import catenary

convention, a = "standard", [..., ...]

print(check_table(convention, a))

# ## 2. Masses leave the formula (30 minutes)
#
# In lab 1 every torque was a sum of cosines times something that does not move. Call that something
#
# * `s[0]` = m0 r0 + m1 L0, all that the first joint carries along the first rod [kg m],
# * `s[1]` = m1 r1, what the second joint carries [kg m],
#
# with masses m, centres of mass r from their joints, and the length L0 of the first rod. Write the torques as a matrix
# times `s`: the matrix holds angles and g = 9.81 m/s2, and not one mass. The gravity-regressor paper calls it Z(q).


def regressor(q):
    return [[..., ...], [..., ...]]  # [m/s2], times s [kg m] gives [Nm]


print(check_regressor(regressor))

# ## 3. Weigh the arm (25 minutes)
#
# `q` (200, 2) are poses at which the arm stood still, `tau` (200, 2) the torques that held it, as a sensor with 0.05 Nm
# of noise read them. Each pose gives two equations for two unknowns, and all are a little wrong. Find the `s` that is
# least wrong: stack the matrices, and let `np.linalg.lstsq` do the rest.

q, tau = measured_torques()


def estimate(q, tau):
    return [..., ...]  # s [kg m]


print(check_estimate(estimate))

# Nothing else is needed to hold the arm: no mass, no centre of mass. Which of m0, r0, m1, r1 could you find alone?
#
# ## 4. Poses that say nothing (20 minutes)
#
# There are poses at which the torques are the same whatever the masses. Find one, with both angles in rad.

silent = [..., ...]

print(check_silent_pose(silent))

# Far from it, is every pose as good? The picture shows how far errors of torque are magnified when `s` is estimated
# from one pose alone: the condition number of Z. Where is it least, where largest, and why does it not depend on g?
#
# The package derives Z for any arm. Compare its formula with yours; then load `"planar_3r"` instead.

arm = catenary.load_robot("two_link")
compact = catenary.compact_regressor(arm)
print(compact)
angles = np.linspace(-np.pi, np.pi, 181)
conditions = [[np.linalg.cond(compact.Z([first, second], [0, 0, -9.81])) for first in angles] for second in angles]
figure, axes = plt.subplots()
picture = axes.pcolormesh(angles, angles, np.log10(np.minimum(conditions, 1e3)))
figure.colorbar(picture, label="magnified by (power of ten)")
axes.set(xlabel="q[0] [rad]", ylabel="q[1] [rad]")
figure.savefig("poses.png")
