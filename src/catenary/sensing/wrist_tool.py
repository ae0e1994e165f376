"""The tool behind a force/torque sensor at a wrist, and the sensor's biases, from poses at rest.

At rest the sensor reads, in its own axes, force = m g + f0 and torque = c x (m g) + t0: gravity g as the sensor's frame
sees it, mass m and centre of mass c of all that hangs behind it. Both are linear in (m, m c, f0, t0), ten numbers.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from catenary.arrays import Floats, as_array, as_batch
from catenary.errors import ExcitationError, InputError
from catenary.robots.plausible import FAR
from catenary.spatial import angle_between
from catenary.verdict.finding import Finding

_MIN_POSES = 4  # poses
_MIN_DOUBTED_POSES = 6  # poses, from which on what is left tells another cause
_BETTER_SHARE = 0.25  # of what is left, squared, by degree of freedom
TURNED, GAIN = 0.05, 0.05  # [rad] of gravity, and of the sensor's axes: less is not worth a doubt
_HEAVIEST_KG = 500.0  # few arms with a force sensor at the wrist lift more; grams taken for kilograms are beyond
_MIN_TILT = 0.2  # least share of gravity that its directions must differ by along every axis, RMS


class WristTool(NamedTuple):
    """What hangs behind a sensor, and what it reads without; deviations are standard deviations of the estimates."""

    mass: float  # [kg]
    center: Floats  # (3,) of mass, in the sensor's frame [m]
    force_bias: Floats  # (3,) [N]
    torque_bias: Floats  # (3,) [Nm]
    mass_deviation: float
    center_deviation: Floats
    force_bias_deviation: Floats
    torque_bias_deviation: Floats
    force_rms: float  # that is left of the readings [N]
    torque_rms: float  # [Nm]

    def without(self, force: ArrayLike, torque: ArrayLike, gravity: ArrayLike) -> tuple[Floats, Floats]:
        """Return readings (3,) or (N, 3) less bias and the tool at rest; gravity [m/s2] is as the sensor sees it."""
        down, single = as_batch("gravity", gravity, 3)
        shape = (3,) if single else down.shape
        weight = self.mass * down.reshape(shape)
        forces = as_array("force", force, shape) - weight - self.force_bias
        return forces, as_array("torque", torque, shape) - np.cross(self.center, weight) - self.torque_bias


def fit_wrist_tool(force: ArrayLike, torque: ArrayLike, gravity: ArrayLike) -> WristTool:
    """Fit mass, centre of mass and biases to readings of a force/torque sensor at rest, by least squares.

    Force and torque, about the sensor's origin, are (N, 3) means over each pose as the sensor reads them [N, Nm], the
    weight counted along gravity (N, 3) in the sensor's axes [m/s2], such as R_base_sensor.T @ gravity.

    Raises:
        ExcitationError: Gravity points nearly the same way in all poses, seen from the sensor.
    """
    down = as_array("gravity", gravity, (None, 3))
    forces, torques = as_array("force", force, down.shape), as_array("torque", torque, down.shape)
    count = len(down)
    if count < _MIN_POSES:
        raise InputError(f"wrist tool: {count} poses, expected {_MIN_POSES} or more")
    X = np.zeros((count, 6, 10))
    X[:, :3, 0], X[:, :3, 4:7], X[:, 3:, 7:] = down, np.eye(3), np.eye(3)
    for k, axis in enumerate(np.eye(3)):
        X[:, 3:, 1 + k] = np.cross(axis, down)
    size = float(np.sqrt(np.mean(down**2) * 3.0))
    directions, spread, _ = np.linalg.svd((down - down.mean(axis=0)).T / np.sqrt(count), full_matrices=False)
    if not spread[2] > _MIN_TILT * size / 3.0:
        along = ", ".join(f"{v:.2f}" for v in directions[:, 2])
        raise ExcitationError(
            f"wrist tool: along ({along}) in the sensor's axes gravity differs by {spread[2]:.2g} m/s2 (RMS) between "
            f"poses, expected {_MIN_TILT * size / 3.0:.2g} or more: turn the wrist about further axes",
            rank=int(np.linalg.matrix_rank(X.reshape(-1, 10), tol=float(np.sqrt(count)) * _MIN_TILT * size / 3.0)),
            n_base=10,
        )
    parts = (slice(0, 3), [0, 4, 5, 6], forces), (slice(3, 6), [1, 2, 3, 7, 8, 9], torques)
    found, covariance, rms = np.zeros(10), np.zeros((10, 10)), []
    for rows, columns, readings in parts:  # no number is in both
        A, y = X[:, rows][:, :, columns].reshape(-1, len(columns)), readings.ravel()
        found[columns] = np.linalg.lstsq(A, y, rcond=None)[0]
        left = y - A @ found[columns]
        rms.append(float(np.sqrt(np.mean(left**2))))
        covariance[np.ix_(columns, columns)] = left @ left / (len(y) - len(columns)) * np.linalg.inv(A.T @ A)
    mass, moment = float(found[0]), found[1:4]
    if not mass > 0.0:
        raise InputError(f"wrist tool: mass {mass:.3g} kg: the sensor counts forces the other way, or has other axes")
    center = moment / mass
    if mass > _HEAVIEST_KG or np.linalg.norm(center) > FAR:
        raise InputError(
            f"wrist tool: mass {mass:.4g} kg, centre of mass {np.linalg.norm(center):.4g} m away: expected at most "
            f"{_HEAVIEST_KG:g} kg and {FAR:g} m; forces are in N (not mN or kN), torques in Nm, gravity in m/s2"
        )
    deviation = np.sqrt(np.diag(covariance))
    of_center = np.hypot(deviation[1:4], center * deviation[0]) / mass
    return WristTool(
        mass, center, found[4:7], found[7:], float(deviation[0]), of_center, deviation[4:7], deviation[7:], *rms
    )


def wrist_tool_findings(tool: WristTool, force: ArrayLike, rotation: ArrayLike, gravity: ArrayLike) -> list[Finding]:
    """Doubt a tool whose forces fit another gravity, or other gains or axes of the sensor, much better.
    Forces are (N, 3) [N] as they were fitted, `rotation` (N, 3, 3) R_base_sensor of each pose, gravity (3,) [m/s2] in
    base axes.
    """
    stated = as_array("gravity", gravity, (3,))
    forces, turned = as_array("force", force, (None, 3)), as_array("rotation", rotation, (None, 3, 3))
    count = len(forces)
    if count < _MIN_DOUBTED_POSES:
        return []
    down = np.einsum("nji,j->ni", turned, stated)
    before = 3.0 * count / (3.0 * count - 4.0) * tool.force_rms**2  # per degree of freedom
    bias = np.tile(np.eye(3), (count, 1))
    of_base = np.hstack([turned.transpose(0, 2, 1).reshape(-1, 3), bias])
    pull, left_by_tilt = _solved(of_base, forces)
    of_sensor = np.hstack([np.einsum("nj,ik->nikj", down, np.eye(3)).reshape(-1, 9), bias])
    gains, left_by_axes = _solved(of_sensor, forces)
    angle = float(angle_between(pull[:3], stated))
    matrix = gains[:9].reshape(3, 3) / tool.mass
    off = float(np.abs(matrix - np.eye(3)).max())
    if left_by_tilt < _BETTER_SHARE * before and angle > TURNED and left_by_tilt <= left_by_axes:
        size = np.linalg.norm(stated) / np.linalg.norm(pull[:3])
        along = ",".join(f"{v:.4g}" for v in pull[:3] * size)
        mass = np.linalg.norm(pull[:3]) / np.linalg.norm(stated)
        says = f"forces fit gravity turned by {np.rad2deg(angle):.1f} deg and a mass of {mass:.4g} kg much better"
        return [Finding("gravity", (), says, "a base that is tilted", f"--gravity {along}", refuses=False)]
    if left_by_axes < _BETTER_SHARE * before and off > GAIN:
        rows = "; ".join(", ".join(f"{v:.2f}" for v in row) for row in matrix)
        says = f"forces fit much better as the matrix ({rows}) times those of this mass: what is printed is off"
        culprit = "axes of the sensor that are turned from its frame, or a gain of one of them"
        return [Finding("units", (), says, culprit, refuses=False)]
    return []


def _solved(columns: Floats, forces: Floats) -> tuple[Floats, float]:
    """Return what least squares gives, and the squares that it leaves by degree of freedom [N2]."""
    solution = np.asarray(np.linalg.lstsq(columns, forces.ravel())[0], dtype=np.float64)
    left = forces.ravel() - columns @ solution
    return solution, float(left @ left) / (len(left) - len(solution))
