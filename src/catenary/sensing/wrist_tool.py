"""Identification of a tool on a wrist's force/torque sensor: mass, centre of mass, biases, sign and axes, from rests.

At rest the sensor reads, in its own axes, force = s m g + f0 and torque = s c x (m g) + t0, with gravity g in its axes,
mass m and centre of mass c of everything behind it, and s = -1 if it measures the reaction. With known sign and axes
this is linear in the ten parameters (m, m c, f0, t0).
"""

import json
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike

from catenary.arrays import Floats, Listed, as_array, as_batch
from catenary.config import IN_FILES, load_toml, plain_data
from catenary.dynamics.inverse_dynamics import gravity_rows
from catenary.errors import ConfigError, ExcitationError, InputError
from catenary.files import write_atomically
from catenary.robots.link_inertia import LinkInertia, check_inertia, symmetric
from catenary.robots.plausibility import LONG_LINK_M
from catenary.spatial import Pose, angle_between, as_rotation, rotation_vector
from catenary.verdict.finding import Finding

_MIN_POSES = 4  # poses
_MIN_JUDGED_POSES = 6  # poses, for residuals that distinguish causes
_BETTER_SHARE = 0.25  # largest ratio of squared residuals per degree of freedom of a better explanation
_MIN_TURN_RAD, _MIN_GAIN_ERROR = 0.05, 0.05  # least turn of gravity [rad] and gain error of axes that are reported
_MAX_MASS_KG = 500.0  # beyond the payload of wrists with a force sensor: detects grams taken for kilograms
_MIRRORED_RAD = 0.5  # [rad] largest angle from all axes negated, beyond which axes are left-handed
_MIN_TILT = 0.2  # least RMS variation of gravity along every axis of the sensor, relative to gravity
# limits of the force residual (RMS), and p-value of a cable's columns. Of 800 simulated weighings without a cable
# (6 to 20 poses, 0.3 to 3 kg) none exceeds them; of 763 with a cable that changes the mass by 1 % two are missed
_DRAG_SHARE, _DRAG_NOISES, _DRAG_CHANCE = 0.02, 3.0, 1e-3  # of the weight, of the means' noise
_USUAL_NOISE_N = 0.02  # of a pose's mean force, if unknown
_HEAD = """# The tool behind a wrist's force/torque sensor, in SI: reading = sign load + bias, in its axes, which the
# rotation takes to those of the frame; inertia: xx, xy, xz, yy, yz, zz about `center`
"""
_Vector = Annotated[Floats, Listed((3,))]


@dataclass(frozen=True, eq=False)
class WristTool:
    """Tool behind a force/torque sensor, and the sensor's biases; deviations are standard deviations of estimates."""

    __pydantic_config__ = IN_FILES

    mass: float  # [kg]
    center: _Vector  # of mass, in the sensor's axes [m]
    force_bias: _Vector  # [N]
    torque_bias: _Vector  # [Nm]
    mass_deviation: float
    center_deviation: _Vector
    force_bias_deviation: _Vector
    torque_bias_deviation: _Vector
    force_rms: float  # residual [N]
    torque_rms: float  # residual [Nm]
    sign: float = 1.0  # -1 of a sensor that measures the reaction, not the load
    rotation: Annotated[Floats, Listed((3, 3))] = field(default_factory=lambda: np.eye(3), repr=False)  # R_frame_sensor
    inertia: Annotated[Floats, Listed((6,))] = field(default_factory=lambda: np.zeros(6), repr=False)  # [kg m2]
    robot: str = ""  # robot that carries it, as given
    frame: str = ""  # frame of the robot at the sensor's origin, to which `rotation` leads

    def __post_init__(self) -> None:
        as_rotation("tool rotation", self.rotation)
        if self.sign not in (1.0, -1.0):
            raise InputError(f"tool sign: expected 1 or -1, got {self.sign:g}")
        check_inertia("tool", LinkInertia(self.mass, self.center, symmetric(self.inertia)))

    @property
    def bias(self) -> Floats:
        """Reading of the sensor without load (6,) [N, Nm]."""
        return np.concatenate([self.force_bias, self.torque_bias])

    def without(self, force: ArrayLike, torque: ArrayLike, gravity: ArrayLike) -> tuple[Floats, Floats]:
        """Return readings [N, Nm], (3,) or (N, 3), without bias and weight; gravity [m/s2] is in the sensor's axes."""
        down, single = as_batch("gravity", gravity, 3)
        shape = (3,) if single else down.shape
        weight = self.mass * down.reshape(shape)
        forces = self.sign * (as_array("force", force, shape) - self.force_bias) - weight
        torques = self.sign * (as_array("torque", torque, shape) - self.torque_bias)
        return forces, torques - np.cross(self.center, weight)


def fit_wrist_tool(force: ArrayLike, torque: ArrayLike, gravity: ArrayLike) -> WristTool:
    """Fit mass, centre of mass and biases to readings of a force/torque sensor at rest, by least squares.

    Args:
        force: (N, 3) means of N >= 4 poses [N], positive along gravity for the tool's weight.
        torque: (N, 3) means about the sensor's origin [Nm].
        gravity: (N, 3) in the sensor's axes [m/s2], such as R_base_sensor.T @ gravity.

    Raises:
        InputError: Too few poses, or a mass or centre of mass out of range, as of a wrong sign or unit.
        ExcitationError: Gravity has nearly the same direction in all poses, in the sensor's axes.

    Examples:
        >>> gravity = 9.81 * np.vstack([np.eye(3), -np.eye(3)])
        >>> tool = catenary.fit_wrist_tool(0.5 * gravity + 1.0, np.cross([0.0, 0.0, 0.1], 0.5 * gravity), gravity)
        >>> round(tool.mass, 3), tool.center.round(3) + 0.0
        (0.5, array([0. , 0. , 0.1]))
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
    _require_orientations(down, X)
    parts = (slice(0, 3), [0, 4, 5, 6], forces), (slice(3, 6), [1, 2, 3, 7, 8, 9], torques)
    solution, covariance, rms = np.zeros(10), np.zeros((10, 10)), [0.0, 0.0]
    for part, (rows, columns, readings) in enumerate(parts):  # they share no parameter
        A, y = X[:, rows][:, :, columns].reshape(-1, len(columns)), readings.ravel()
        solution[columns] = np.linalg.lstsq(A, y, rcond=None)[0]
        residuals = y - A @ solution[columns]
        rms[part] = float(np.sqrt(np.mean(residuals**2)))
        covariance[np.ix_(columns, columns)] = residuals @ residuals / (len(y) - len(columns)) * np.linalg.inv(A.T @ A)
    mass, moment = float(solution[0]), solution[1:4]
    if not mass > 0.0:
        raise InputError(f"wrist tool: mass {mass:.3g} kg: the sensor counts forces the other way, or has other axes")
    center = moment / mass
    if mass > _MAX_MASS_KG or np.linalg.norm(center) > LONG_LINK_M:
        raise InputError(
            f"wrist tool: mass {mass:.4g} kg, centre of mass {np.linalg.norm(center):.4g} m away: expected at most "
            f"{_MAX_MASS_KG:g} kg and {LONG_LINK_M:g} m; forces are in N (not mN or kN), torques in Nm, gravity in m/s2"
        )
    deviation = np.sqrt(np.diag(covariance))
    of_center = np.hypot(deviation[1:4], center * deviation[0]) / mass
    errors = float(deviation[0]), of_center, deviation[4:7], deviation[7:]
    return WristTool(mass, center, solution[4:7], solution[7:], *errors, rms[0], rms[1])


def _require_orientations(down: Floats, X: Floats) -> None:
    """Refuse poses whose gravity (N, 3) does not determine the ten parameters; X (N, 6, 10) is their regressor."""
    size, count = float(np.sqrt(np.mean(down**2) * 3.0)), len(down)
    directions, spread, _ = np.linalg.svd((down - down.mean(axis=0)).T / np.sqrt(count), full_matrices=False)
    if not spread[2] > _MIN_TILT * size / 3.0:
        along = ", ".join(f"{v:.2f}" for v in directions[:, 2])
        raise ExcitationError(
            f"wrist tool: along ({along}) in the sensor's axes gravity differs by {spread[2]:.2g} m/s2 (RMS) between "
            f"poses, expected {_MIN_TILT * size / 3.0:.2g} or more: turn the wrist about further axes",
            rank=int(np.linalg.matrix_rank(X.reshape(-1, 10), tol=float(np.sqrt(count)) * _MIN_TILT * size / 3.0)),
            n_base=10,
        )


def weigh_tool(
    force: ArrayLike, torque: ArrayLike, poses: Pose, gravity: ArrayLike, *, noise: float = _USUAL_NOISE_N
) -> tuple[WristTool, list[Finding]]:
    """Fit a tool with its sensor's sign and axes relative to a frame, and test other explanations of the readings.

    The sensor may measure the load or its reaction, in the frame's axes or in others. A tilted base, gains of axes,
    torques in other axes than forces, and a cable that pulls each compete with the tool alone.

    Args:
        force: (N, 3) means as read, of N >= 6 poses [N].
        torque: (N, 3) means as read, about the sensor's origin [Nm].
        poses: N poses of the sensor's frame in base axes, as from `forward_kinematics`.
        gravity: (3,) or (N, 3) in base axes [m/s2].
        noise: Standard deviation of a mean force [N].

    Returns:
        Tool, and the finding that explains most of the residual, if any.

    Raises:
        InputError: Too few poses, left-handed axes, or readings that no tool explains.
        ExcitationError: Gravity has nearly the same direction in all poses, in the sensor's axes.
    """
    turned = as_array("rotation", poses.rotation, (None, 3, 3))
    forces = as_array("force", force, (len(turned), 3))
    torques = as_array("torque", torque, forces.shape)
    if len(forces) < _MIN_JUDGED_POSES:
        raise InputError(f"wrist tool: {len(forces)} poses, expected {_MIN_JUDGED_POSES} or more, differently turned")
    to_frame = turned.transpose(0, 2, 1)
    down = np.einsum("nij,nj->ni", to_frame, np.broadcast_to(gravity_rows(gravity, len(forces)), forces.shape))
    gains, axes_residual = _least_squares([np.einsum("nj,ik->nikj", down, np.eye(3))], forces)
    axes, is_tilted = _axes(down, to_frame, forces, gains[:9].reshape(3, 3), axes_residual)
    sign = 1.0 if np.linalg.det(axes) > 0.0 else -1.0
    in_sensor, in_axes = down @ (sign * axes).T, axes @ to_frame  # in_axes takes vectors in base axes to readings
    tool = fit_wrist_tool(sign * forces, sign * torques, in_sensor)
    force_bias, torque_bias = sign * tool.force_bias, sign * tool.torque_bias
    tool = replace(tool, force_bias=force_bias, torque_bias=torque_bias, sign=sign, rotation=sign * axes.T)
    stated = np.einsum("nij,nj->ni", turned, down).mean(axis=0)
    place = np.einsum("nij,nj->ni", in_axes, poses.position - poses.position.mean(axis=0))
    doubts = [
        _tilt_finding(_least_squares([in_axes], forces)[0][:3], stated) if is_tilted else None,
        _gain_finding(tool, gains[:9].reshape(3, 3) / tool.mass - axes, axes_residual) if not is_tilted else None,
        _torque_finding(tool, torques, down),
        _cable_finding(tool, forces, in_axes, down @ axes.T, place, noise, is_tilted=is_tilted),
    ]
    return tool, [doubt for doubt in doubts if doubt is not None][:1]  # the first one hides the others


def _least_squares(columns: list[Floats], readings: Floats) -> tuple[Floats, float]:
    """Solve for columns (N, 3, ...) and a bias; return the solution and the residual variance."""
    count = len(readings)
    A = np.hstack([*(column.reshape(3 * count, -1) for column in columns), np.tile(np.eye(3), (count, 1))])
    solution = np.asarray(np.linalg.lstsq(A, readings.ravel(), rcond=None)[0], dtype=np.float64)
    residuals = readings.ravel() - A @ solution
    return solution, float(residuals @ residuals) / (len(residuals) - A.shape[1])


def _axes(down: Floats, to_frame: Floats, forces: Floats, gains: Floats, axes_residual: float) -> tuple[Floats, bool]:
    """Return the matrix (3, 3), +-R, from loads in the frame's axes to readings, and true if the base is tilted."""
    (mass, *_), residual = _least_squares([down], forces)
    as_framed = np.eye(3) if mass > 0.0 else -np.eye(3)
    pull, tilt_residual = _least_squares([to_frame], forces)
    if tilt_residual < _BETTER_SHARE * residual and tilt_residual <= axes_residual:
        angle = angle_between(as_framed[0, 0] * pull[:3], np.einsum("nji,nj->ni", to_frame, down).mean(axis=0))
        return as_framed, bool(angle > _MIN_TURN_RAD)
    if axes_residual >= _BETTER_SHARE * residual:
        return as_framed, False
    U, _, Vt = np.linalg.svd(gains)
    turn = np.asarray(U @ Vt)
    if np.linalg.det(turn) < 0.0 and np.linalg.norm(rotation_vector(-turn)) > _MIRRORED_RAD:
        rows = "; ".join(", ".join(f"{v:.2f}" for v in row) for row in turn)
        raise InputError(
            f"wrist tool: forces are ({rows}) times those in axes of the sensor's frame, which is left-handed: an axis "
            "of the sensor has the opposite sign: negate its force and torque; or all six have, in axes that are "
            "turned too: negate all six"
        )
    return turn, False


def _tilt_finding(pull: Floats, stated: Floats) -> Finding:
    """Return the finding of tilted gravity (3,); pull (3,) [N] is the weight that fits the forces, of either sign."""
    pull = pull * np.sign(pull @ stated)
    size = np.linalg.norm(stated) / np.linalg.norm(pull)
    along = ",".join(f"{v:.4g}" for v in pull * size)
    angle = np.rad2deg(angle_between(pull, stated))
    says = f"forces fit gravity turned by {angle:.1f} deg and a mass of {1.0 / size:.4g} kg much better"
    return Finding("gravity", (), says, "a tilted base, or a cable that pulls constantly", f"--gravity {along}")


def _gain_finding(tool: WristTool, off: Floats, axes_residual: float) -> Finding | None:
    """Return the finding of wrong gains of the sensor's axes; `off` (3, 3) is their difference from a rotation."""
    if not (axes_residual < _BETTER_SHARE * tool.force_rms**2 and np.abs(off).max() > _MIN_GAIN_ERROR):
        return None
    worst = np.unravel_index(int(np.abs(off).argmax()), off.shape)
    says = f"forces fit gains of the sensor's axes much better, off by {off[worst]:+.2f} in axis {'xyz'[worst[0]]}"
    return Finding("units", (), says, "a gain of one of its axes, or a calibration of another sensor")


def _torque_finding(tool: WristTool, torques: Floats, down: Floats) -> Finding | None:
    matrix, residual = _least_squares([np.einsum("nj,ik->nikj", down, np.eye(3))], torques)
    size = float(np.abs(matrix[:9]).max()) * float(np.linalg.norm(down[0]))
    if residual < _BETTER_SHARE * tool.torque_rms**2 and tool.torque_rms > _MIN_GAIN_ERROR * size:
        says = f"torques follow gravity, but {tool.torque_rms:.3g} Nm (RMS) remain after fitting a centre of mass"
        return Finding("units", (), says, "axes or signs of torques that are not those of forces")
    return None


def _cable_finding(
    tool: WristTool, forces: Floats, in_axes: Floats, weight: Floats, place: Floats, noise: float, *, is_tilted: bool
) -> Finding | None:
    """Return the finding of forces that a spring in base axes explains beyond chance, or of a large residual."""
    from scipy.stats import f  # takes a quarter of a second to import

    size, count = tool.mass * float(np.linalg.norm(weight[0])), forces.size
    if tool.force_rms <= noise:  # nothing to explain
        return None
    alone, few = (in_axes, 6) if is_tilted else (weight, 4)
    _, before = _least_squares([alone], forces)
    _, after = _least_squares([in_axes, place], forces)
    gain = (before * (count - few) - after * (count - 7)) / (7 - few) / max(after, 1e-12 * before)
    by_chance = float(f.sf(gain, 7 - few, count - 7))
    if by_chance >= _DRAG_CHANCE and np.sqrt(before) <= max(_DRAG_SHARE * size, _DRAG_NOISES * noise):
        return None
    says = (
        f"{np.sqrt(before):.3g} N (RMS) of {size:.3g} N remain, expected {noise:.2g} N by noise: mass and zeros may be "
        "off by ten times that share"
    )
    cause = "a cable or hose that drags at the tool, or contact in a pose"
    return Finding("cable", (), says, cause, "fasten it to the tool, with slack behind the sensor, and weigh again")


def load_tool(path: Path | str) -> WristTool:
    """Load a tool file (TOML)."""
    try:
        return load_toml(Path(path), WristTool)
    except InputError as error:
        raise ConfigError(f"{path}: {error}") from error


def save_tool(path: Path | str, tool: WristTool) -> None:
    """Write a tool file (TOML) atomically.

    Args:
        path, tool: The file, and the tool.
    """
    rows = [f"{key} = {json.dumps(value, ensure_ascii=False)}\n" for key, value in plain_data(tool).items()]
    write_atomically(Path(path), (_HEAD + "".join(rows)).encode())
