"""Joints behind elastic cables, and the unscented Kalman filter of them of Haghighipanah et al. (IROS 2015).

Motor and link of joints 1 to 3, in joint units, with a spring and a damper between them and Coulomb friction on both:

    Jm theta'' = tau - T - Fm sgn(theta')          T = k (theta - q) + d (theta' - q')
    M(q) q'' + h(q, q') = T - Fl sgn(q')

What is known: the makers' link masses and centres of mass, the motors' inertia and ratios, the nominal cable coupling.
What is identified on the training recordings: stiffness, both frictions, and the fixed offset of every joint, since
homing leaves degrees of it. M and h are taken at the reported pose, from which the true one differs by a few degrees.

The filter's state: positions and velocities of motors and links. Input: the motors' torques. Measurement: the motors'
encoders. The state is predicted by 24 sigma points of equal weight [Julier and Uhlmann 1997, kappa 0], each through the
elastic joints; the measurement is linear, so its update is Kalman's.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.optimize import lsq_linear

from catenary import MotionLog
from catenary.arrays import Floats
from catenary.dynamics.inverse_dynamics import inverse_dynamics, mass_matrix
from catenary.kernels.compiled import compiled, inlined
from catenary.robots.catalog import load_robot
from catenary.simulation.cable_parameters import load_cable_arm
from catenary.transmission.cable_friction import coulomb

ROBOT = "raven2"
GRAVITY = (0.0, 0.0, -9.81)  # [m/s2] on a level base
STEP = 1e-3  # [s] of the integration
# what a thin steel cable on pulleys of centimetres may have [Nm/rad, Nm/rad, N/m]
SOFTEST, STIFFEST = np.array([50.0, 50.0, 1e4]), np.array([2000.0, 2000.0, 4e5])
DAMPING = 0.2  # of critical: recordings at 30 Hz do not show it
COUNTS = 4000.0  # of a motor's encoder, per turn
STATES, MEASURED = 12, 3
FIRST_SPREAD = 0.01  # [rad, rad, m, and per second] of the first state


class Joints(NamedTuple):
    """Numbers of three elastic joints, in joint units."""

    stiffness: Floats  # (3,) k [Nm/rad, Nm/rad, N/m]
    damping: Floats  # (3,) d
    motor_inertia: Floats  # (3,) Jm
    motor_friction: Floats  # (3,) Fm [Nm, Nm, N]
    link_friction: Floats  # (3,) Fl
    offset: Floats  # (3,) true less estimated position at no load [rad, rad, m]
    torque_noise: Floats  # (3,) standard deviation of what the model leaves of the torque
    encoder_noise: Floats  # (3,) of a motor's encoder, seen at the joint


class Drive(NamedTuple):
    """What is known of N rows of a motion before anything is estimated."""

    time: Floats  # (N,) [s]
    position: Floats  # (N, 3) reported, by the motors
    torque: Floats  # (N, 3) commanded, at the joints
    bias: Floats  # (N, 3) h, from nominal links
    inverse: Floats  # (N, 3, 3) of M


def drive_of(log: MotionLog) -> Drive:
    """Return a recording as the filter takes it."""
    model = load_robot(ROBOT)
    q, qd, _ = derivatives(log)
    bias = inverse_dynamics(model, q, qd, np.zeros_like(q), GRAVITY)
    inverse: Floats = np.linalg.inv(mass_matrix(model, q)).astype(np.float64)
    return Drive(np.asarray(log.time), q, np.asarray(log.tau), bias, inverse)


def derivatives(log: MotionLog) -> tuple[Floats, Floats, Floats]:
    """Return reported positions, velocities and accelerations (N, 3), by central differences."""
    q, time = log.q_nominal, np.asarray(log.time)
    qd = np.gradient(q, time, axis=0)
    return q, qd, np.gradient(qd, time, axis=0)


def identified(logs: Sequence[MotionLog], stiffness: Floats | None = None) -> Joints:
    """Identify stiffness, friction and offset by least squares on recordings with external encoders.

    The torque less inertia and gravity is friction in all; the true less the reported position is the offset less
    the stretch, (h + M q'' + Fl sgn(q')) / k.

    Args:
        stiffness: (3,) where it is known; identified when None, between `SOFTEST` and `STIFFEST`.
    """
    arm, model = load_cable_arm(), load_robot(ROBOT)
    ratio = arm.cable.ratio
    inertia = arm.cable.rotor_inertia * ratio**2
    parts = []
    for log in logs:
        q, qd, qdd = derivatives(log)
        parts.append(
            (inverse_dynamics(model, q, qd, qdd, GRAVITY), qd, qdd, np.asarray(log.tau), np.asarray(log.q_encoder) - q)
        )
    load, qd, qdd, torque, error = (np.concatenate(part) for part in zip(*parts, strict=True))
    lower, upper = (SOFTEST, STIFFEST) if stiffness is None else (stiffness, stiffness)
    friction_torque = torque - load - inertia * qdd
    frictions = [_friction(friction_torque[:, j], qd[:, j]) for j in range(3)]
    stretches = [_stretch(error[:, j], load[:, j], qd[:, j], lower[j], upper[j]) for j in range(3)]
    friction, noise = np.array(frictions).T
    k, slip, offset = np.array(stretches).T
    of_links = np.minimum(slip, friction)
    light = 1.0 / np.diag(np.linalg.inv(mass_matrix(model, np.mean(logs[0].q_nominal, axis=0))))
    return Joints(
        stiffness=k,
        damping=2.0 * DAMPING * np.sqrt(k * light),
        motor_inertia=inertia,
        motor_friction=friction - of_links,
        link_friction=of_links,
        offset=offset,
        torque_noise=noise,
        encoder_noise=2.0 * np.pi / (COUNTS * ratio),
    )


def _friction(torque: Floats, qd: Floats) -> tuple[float, float]:
    """Return Coulomb friction and what it leaves of a torque (N,), as a standard deviation."""
    columns = np.column_stack((np.sign(qd), np.ones(len(torque))))
    solution = lsq_linear(columns, torque, ([0.0, -np.inf], [np.inf, np.inf])).x
    return float(solution[0]), float(np.std(torque - columns @ solution))


def _stretch(error: Floats, load: Floats, qd: Floats, softest: float, stiffest: float) -> tuple[float, float, float]:
    """Return stiffness, link friction and offset: error = offset - (load + friction sgn(qd)) / stiffness."""
    columns = np.column_stack((-load / stiffest, -np.sign(qd) / stiffest, np.ones(len(error))))
    # a hair's breadth between bounds that are alike, as the search wants
    lower, upper = [1.0 - 1e-9, 0.0, -np.inf], [stiffest / softest + 1e-9, np.inf, np.inf]
    give, slip, offset = lsq_linear(columns, error, (lower, upper)).x  # give: stiffest over stiffness
    return float(stiffest / give), float(slip / give), float(offset)


@inlined
def advance(x: Floats, joints: Joints, torque: Floats, bias: Floats, inverse: Floats, step: float, count: int) -> None:
    """Advance a state x (12,) by semi-implicit Euler steps of `step` [s]; torque, h and the inverse of M are held."""
    for _ in range(count):
        push_0 = joints.stiffness[0] * (x[0] - x[3]) + joints.damping[0] * (x[6] - x[9])
        push_1 = joints.stiffness[1] * (x[1] - x[4]) + joints.damping[1] * (x[7] - x[10])
        push_2 = joints.stiffness[2] * (x[2] - x[5]) + joints.damping[2] * (x[8] - x[11])
        push = (push_0, push_1, push_2)
        for j in range(3):
            light = step / joints.motor_inertia[j]
            free = x[6 + j] + light * (torque[j] - push[j])
            x[6 + j] = coulomb(free, light * joints.motor_friction[j])
            x[j] += step * x[6 + j]
        for j in range(3):
            change = 0.0
            for i in range(3):
                change += inverse[j, i] * (push[i] - bias[i])
            x[9 + j] = coulomb(x[9 + j] + step * change, step * inverse[j, j] * joints.link_friction[j])
        for j in range(3):
            x[3 + j] += step * x[9 + j]


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
                    velocity_noise = joints.torque_noise[j] * light * span
                    noise[6 + place], noise[place] = velocity_noise**2, (0.5 * velocity_noise * span) ** 2
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
