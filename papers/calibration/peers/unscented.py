"""An unscented Kalman filter of elastic joints, as Haghighipanah et al. estimate a RAVEN-II's (IROS 2015).

State: positions and velocities of motors and links of joints 1 to 3. Input: the motors' torques. Measurement: the
motors' encoders. The state is predicted by 24 sigma points of equal weight [Julier and Uhlmann 1997, kappa 0], each
through the elastic joints (elastic_joints.py); the measurement is linear, so its update is Kalman's.
"""

from dataclasses import dataclass

import numpy as np

from catenary import MotionLog
from catenary.arrays import Floats
from catenary.kernels.compiled import compiled
from papers.calibration.peers.elastic_joints import STEP, Drive, Joints, advance, drive_of

STATES, MEASURED = 12, 3
FIRST_SPREAD = 0.01  # [rad, rad, m, and per second] of the first state


@dataclass(frozen=True)
class Filter:
    """A filter of identified joints."""

    joints: Joints

    def correction(self, log: MotionLog) -> Floats:
        """Return what to add to the reported positions of every row of a recording, (N, 3) [rad, rad, m]."""
        drive = drive_of(log)
        estimated: Floats = filtered(drive, self.joints)[:, 3:6] + self.joints.offset - drive.position
        return estimated


def filtered(drive: Drive, joints: Joints) -> Floats:
    """Return the estimated states of every row, (N, 12): theta, q, theta', q'."""
    states = np.empty((len(drive.time), STATES))
    first = np.concatenate((drive.position[0], drive.position[0] - drive.bias[0] / joints.stiffness, np.zeros(6)))
    covariance = np.diag(np.full(STATES, FIRST_SPREAD**2))
    counts = np.maximum(1, np.round(np.diff(drive.time, prepend=drive.time[0]) / STEP)).astype(np.int64)
    run_filter(drive, joints, counts, first, covariance, states)
    return states


@compiled
def run_filter(drive: Drive, joints: Joints, counts: np.ndarray, x: Floats, P: Floats, states: Floats) -> None:
    """Filter rows, after `counts` (N,) steps each, from state x (12,) and covariance P, overwritten, into `states`."""
    points = np.empty((2 * STATES, STATES))
    noise = np.zeros(STATES)
    for row in range(len(drive.time)):
        if row > 0:
            torque = 0.5 * (drive.torque[row - 1] + drive.torque[row])
            bias, inverse = drive.bias[row], drive.inverse[row]
            root = np.linalg.cholesky(P)
            for k in range(STATES):
                for i in range(STATES):
                    out = np.sqrt(float(STATES)) * root[i, k]
                    points[k, i], points[STATES + k, i] = x[i] + out, x[i] - out
            for k in range(2 * STATES):
                advance(points[k], joints, torque, bias, inverse, STEP, counts[row])
            # what the model leaves of the torque accelerates motors and links
            span = STEP * counts[row]
            for j in range(MEASURED):
                for place, light in ((j, 1.0 / joints.motor_inertia[j]), (3 + j, inverse[j, j])):
                    most = joints.torque_noise[j] * light * span
                    noise[6 + place], noise[place] = most**2, (0.5 * most * span) ** 2
            for i in range(STATES):
                x[i] = np.mean(points[:, i])
            for i in range(STATES):
                for k in range(i + 1):
                    total = noise[i] if i == k else 0.0
                    for s in range(2 * STATES):
                        total += (points[s, i] - x[i]) * (points[s, k] - x[k]) / (2 * STATES)
                    P[i, k] = P[k, i] = total
        for j in range(MEASURED):  # one encoder after the other: they err apart
            gain = P[:, j] / (P[j, j] + joints.encoder_noise[j] ** 2)
            x += gain * (drive.position[row, j] - x[j])
            P -= np.outer(gain, P[j].copy())
        states[row] = x
