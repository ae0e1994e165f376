"""The ideal position servo of a simulated robot that has no firmware. Compiled."""

import numpy as np

from catenary.arrays import Floats
from catenary.kernels.compiled import compiled
from catenary.simulation.cholesky import factorise, solve_factored
from catenary.simulation.joint_hardware import JointNumbers
from catenary.simulation.joint_step import StepMotion, TreeTerms, along_robot, spring_torques

BANDWIDTH = 200.0  # [rad/s] a steady motion lags by 2 / BANDWIDTH, 10 ms
SLIP = 1e-4  # [rad|m] from its setpoint within which the servo lets a joint stick


@compiled
def servo_torques(
    joints: JointNumbers, motion: StepMotion, tree: TreeTerms, wanted: Floats, out: Floats
) -> bool:
    """Write the torques (n,) of an ideal position servo: computed torque on what the motors move.

    a = w² (wanted - theta) - 2 w theta', tau = M a + h + damping + friction, with w the BANDWIDTH and friction fed
    forward as F clip(error / SLIP, -1, 1): within SLIP of where it should be, a joint may stick.

    Args:
        joints: The arm's hardware.
        motion: As a step begins.
        tree: Its terms there.
        wanted: (n,) positions of the motors [rad|m].
        out: (n,) torques [Nm|N].

    Returns:
        False where the mass matrix is singular.
    """
    n, m = len(joints.joints), len(joints.springs)
    mass, bias, pull = np.empty((n, n)), np.empty(n), np.empty(m)
    along_robot(joints, tree, mass, bias)
    spring_torques(joints, motion.parts.start, motion.parts.start_rate, pull)
    a = np.empty(n + m)
    for j in range(n):
        k = joints.joints[j].drive
        part = motion.parts[k]
        a[k] = BANDWIDTH * (BANDWIDTH * (wanted[j] - part.start) - 2.0 * part.start_rate)
    # what hangs on springs accelerates as it must, and loads the rigid joints: M_ee a_e = pull - h_e - M_er a_r
    if m > 0:
        inner, rest = np.empty((m, m)), np.empty(m)
        for e in range(m):
            i = joints.springs[e].joint
            rest[e] = pull[e] - bias[i]
            for j in range(n):
                if joints.joints[j].drive < n:
                    rest[e] -= mass[i, j] * a[j]
            for f in range(m):
                inner[e, f] = mass[i, joints.springs[f].joint]
        if not factorise(inner):
            return False
        solve_factored(inner, rest)
        for e in range(m):
            a[joints.springs[e].joint] = rest[e]
    for j in range(n):
        k = joints.joints[j].drive
        part, driven = motion.parts[k], joints.parts[k]
        ahead = min(max((wanted[j] - part.start) / SLIP, -1.0), 1.0)
        torque = driven.damping * part.start_rate + driven.friction * ahead
        if k == j:
            torque += bias[j]
            for i in range(n):
                torque += mass[j, i] * a[i]
        else:
            torque += driven.inertia * a[k] + pull[k - n]
        out[j] = torque
    return True
