"""Which way gravity pulled in a recording: by the masses of the robot's file, where the stated direction does not fit.

Torques of a motion are linear in gravity, so its three components are fitted beside friction, a rotor and a constant of
each axis. An arm on a wall that is taken for upright has torques that no masses give, and masses that no arm has.
"""

import numpy as np

from catenary.arrays import Floats
from catenary.dynamics.torque_regressor import link_parameters, torque_regressor
from catenary.identification.samples import Samples
from catenary.robots.model import RobotModel
from catenary.spatial import STANDARD_GRAVITY
from catenary.verdict.finding import Finding

TURNED = 15.0  # [deg] from the stated gravity, from which on another mounting is meant
SIZE = (0.5, 2.0)  # of the gravity that is found to standard gravity: a file's masses are wrong by less
LEFT = 0.4  # of the squared residual with the stated direction, at most
UPSIDE_DOWN = 150.0  # [deg]: torques of the wrong sign look like this as well
NEAR = 10.0  # [deg] from an axis of the base, within which a mounting has a name
NAMES = {
    "the base stands upright": (0, 0, -1), "the base hangs from a ceiling": (0, 0, 1),
    "the base is on a wall, its x axis down": (1, 0, 0), "the base is on a wall, its x axis up": (-1, 0, 0),
    "the base is on a wall, its y axis down": (0, 1, 0), "the base is on a wall, its y axis up": (0, -1, 0),
}  # fmt: skip


def fitted_gravity(model: RobotModel, samples: Samples, stated: Floats) -> tuple[Floats, float, bool] | None:
    """Fit gravity to a recording by the masses of the robot's file; None where these are unknown, or gravity recorded.

    Axes weigh as the spread of their torque.

    Returns:
        Gravity (3,) [m/s2] in base axes; what it leaves of the squared residual with the stated direction, of whatever
        size; whether friction takes power, as where torques have their sign.
    """
    if model.missing_inertia or samples.gravity is not None or not model.tree.mass.any():
        return None
    phi = link_parameters(model.tree)

    def own(gravity: Floats, moving: float) -> Floats:
        motion = samples.q, moving * samples.qd, moving * samples.qdd
        torque: Floats = torque_regressor(model, *motion, gravity) @ phi
        return torque

    spread = samples.tau.std(axis=0)
    axes = np.flatnonzero(spread > 1e-9 * spread.max(initial=0.0))
    if not len(axes):
        return None
    moving = own(np.zeros(3), 1.0)
    pulls = np.stack([own(e, 0.0) for e in np.eye(3)], axis=2)  # (N, n, 3)
    X, y, beside = [], [], []
    for i in axes:
        speed = samples.qd[:, i]
        columns = np.column_stack([np.sign(speed), speed, samples.qdd[:, i], np.ones(len(speed))])
        values = np.column_stack([samples.tau[:, i] - moving[:, i], pulls[:, i]]) / spread[i]
        factors = np.linalg.lstsq(columns, values)[0]
        rest = values - columns @ factors
        X.append(rest[:, 1:])
        y.append(rest[:, 0])
        beside.append((columns, factors * spread[i]))
    A, b = np.concatenate(X), np.concatenate(y)
    if np.linalg.matrix_rank(A, tol=1e-6 * np.linalg.norm(A)) < 3:
        return None
    vector = np.linalg.lstsq(A, b)[0]
    left = float(np.sum((b - A @ vector) ** 2))
    along = A @ stated
    upon = max(float(along @ b), 0.0)  # of whatever size, but not of the other sign
    before = float(b @ b) - upon**2 / max(float(along @ along), 1e-300)
    taken = [float(np.mean((c[:, :2] @ (f[:2, 0] - f[:2, 1:] @ vector)) * c[:, 1])) for c, f in beside]
    return vector, left / max(before, 1e-300), sum(taken) >= 0.0


def mounting_finding(model: RobotModel, samples: Samples, stated: Floats) -> Finding | None:
    """Find a recording in which gravity pulled along another direction than was stated; None where it did not."""
    found = fitted_gravity(model, samples, stated)
    if found is None or not stated.any():
        return None
    vector, left, braked = found
    size, turned = float(np.linalg.norm(vector)), angle_deg(vector, stated)
    if left > LEFT or not braked or not SIZE[0] < size / STANDARD_GRAVITY < SIZE[1]:
        return None
    if turned < TURNED or (turned > UPSIDE_DOWN and not samples.qd.any()):
        return None
    off, name = min((angle_deg(vector, np.array(axis, dtype=float)), name) for name, axis in NAMES.items())
    mounted = f"{name}, within {off:.0f} deg" if off < NEAR else f"the base is tilted, {off:.0f} deg from where {name}"
    exact = np.array(NAMES[name]) * float(np.linalg.norm(stated))
    given = exact if off < NEAR else vector * STANDARD_GRAVITY / size
    x, y, z = vector
    return Finding(
        "gravity",
        tuple(model.joint_names),
        f"with the masses of the robot's file, torques fit gravity of ({x:.2f}, {y:.2f}, {z:.2f}) m/s2, "
        f"{turned:.0f} deg from what was stated, and leave {100.0 * left:.0f} % of the squared residual: "
        f"{mounted}",
        "gravity of another mounting, or forgotten",
        f"--gravity {','.join(f'{v:.4g}' for v in given + 0.0)}",
    )


def angle_deg(a: Floats, b: Floats) -> float:
    """Return the angle between two vectors (3,) [deg]."""
    return float(np.rad2deg(np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b)))
