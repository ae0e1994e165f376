"""The ideal position servo of a simulated robot that has no firmware."""

import numpy as np

from catenary.arrays import Floats
from catenary.simulation.joint_hardware import DriveParameters
from catenary.simulation.joint_step import StepMotion, TreeTerms

BANDWIDTH = 200.0  # [rad/s] a steady motion lags by 2 / BANDWIDTH, 10 ms
SLIP = 1e-4  # [rad|m] from its setpoint within which the servo lets a joint stick


def servo_torques(joints: DriveParameters, motion: StepMotion, tree: TreeTerms, wanted: Floats) -> Floats:
    """Return the torques (n,) [Nm|N] of an ideal position servo: computed torque on what the motors move.

    a = w² (wanted - theta) - 2 w theta', tau = M a + h + damping + friction, with w the BANDWIDTH and friction fed
    forward as F clip(error / SLIP, -1, 1): within SLIP of where it should be, a joint may stick.

    Args:
        joints: The arm's hardware.
        motion: As a step begins.
        tree: Its terms there.
        wanted: (n,) positions of the motors [rad|m].
    """
    n, dof, drive = len(joints.joints), joints.tree.dof, joints.joints.drive
    hardware, position, rate = joints.parts, motion.parts.start, motion.parts.start_rate
    mass = joints.coupling.T @ tree.mass[np.ix_(dof, dof)] @ joints.coupling + np.diag(hardware.inertia[:n])
    bias = joints.coupling.T @ tree.bias[dof]
    springs, elastic = joints.springs, joints.springs.joint
    pull = springs.stiffness * (position[n:] - position[elastic])
    pull += springs.damping * (rate[n:] - rate[elastic])
    error = wanted - position[drive]
    a = np.zeros(len(position))
    a[drive] = BANDWIDTH * (BANDWIDTH * error - 2.0 * rate[drive])
    # what hangs on springs accelerates as it must, and loads the rigid joints: M_ee a_e = pull - h_e - M_er a_r
    load = pull - bias[elastic] - mass[elastic] @ a[:n]
    a[elastic] = np.linalg.solve(mass[np.ix_(elastic, elastic)], load)
    torque: Floats = bias + mass @ a[:n]
    torque[elastic] = hardware.inertia[n:] * a[n:] + pull
    torque += hardware.damping[drive] * rate[drive]
    torque += hardware.friction[drive] * np.clip(error / SLIP, -1.0, 1.0)
    return torque
