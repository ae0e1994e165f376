"""The tool behind a force/torque sensor at a wrist, and the sensor's sign, axes and biases, from poses at rest.

At rest the sensor reads, in its own axes, force = s m g + f0 and torque = s c x (m g) + t0: gravity g as its axes see
it, mass m and centre of mass c of all that hangs behind it, and s = -1 where it counts what holds the tool. Where sign
and axes are known it is linear in (m, m c, f0, t0), ten numbers.
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
from catenary.robots.plausible import LONG_LINK_M
from catenary.spatial import Pose, angle_between, as_rotation, rotation_vector
from catenary.verdict.finding import Finding

_MIN_POSES = 4  # poses
_MIN_JUDGED_POSES = 6  # poses, from which on what is left tells another cause
_BETTER_SHARE = 0.25  # of what is left, squared, by degree of freedom
_TURNED, _GAIN = 0.05, 0.05  # [rad] of gravity, and of the sensor's axes: less is not worth a doubt
_HEAVIEST_KG = 500.0  # few arms with a force sensor at the wrist lift more; grams taken for kilograms are beyond
_MIRRORED = 0.5  # [rad] from all axes negated, beyond which axes are left-handed
_MIN_TILT = 0.2  # least share of gravity that its directions must differ by along every axis, RMS
# what a tool leaves of forces (RMS), and the chance of a cable's columns by noise. Of 800 simulated weighings without a
# cable (6 to 20 poses, 0.3 to 3 kg) none leaves more; of 763 with a cable that puts the mass off by 1 % two are missed
_DRAG_SHARE, _DRAG_NOISES, _DRAG_CHANCE = 0.02, 3.0, 1e-3  # of the weight, of the means' noise
_USUAL_NOISE_N = 0.02  # of a pose's mean force, where it is not known
_HEAD = """# The tool behind a wrist's force/torque sensor, in SI: reading = sign load + bias, in its axes, which the
# rotation takes to those of the frame; inertia: xx, xy, xz, yy, yz, zz about `center`
"""
_Vector = Annotated[Floats, Listed((3,))]


@dataclass(frozen=True, eq=False)
class WristTool:
    """What hangs behind a sensor, and what it reads without; deviations are standard deviations of the estimates."""

    __pydantic_config__ = IN_FILES

    mass: float  # [kg]
    center: _Vector  # of mass, in the sensor's axes [m]
    force_bias: _Vector  # [N]
    torque_bias: _Vector  # [Nm]
    mass_deviation: float
    center_deviation: _Vector
    force_bias_deviation: _Vector
    torque_bias_deviation: _Vector
    force_rms: float  # that is left of the readings [N]
    torque_rms: float  # [Nm]
    sign: float = 1.0  # -1 of a sensor that counts what holds the tool, not the load
    rotation: Annotated[Floats, Listed((3, 3))] = field(default_factory=lambda: np.eye(3), repr=False)  # R_frame_sensor
    inertia: Annotated[Floats, Listed((6,))] = field(default_factory=lambda: np.zeros(6), repr=False)  # [kg m2]
    robot: str = ""  # that carries it, as it was typed
    frame: str = ""  # of the robot, that the sensor's origin and axes are given in

    def __post_init__(self) -> None:
        as_rotation("tool rotation", self.rotation)
        if self.sign not in (1.0, -1.0):
            raise InputError(f"tool sign: expected 1 or -1, got {self.sign:g}")
        check_inertia("tool", LinkInertia(self.mass, self.center, symmetric(self.inertia)))

    @property
    def bias(self) -> Floats:
        """What the sensor reads without load, (6,) [N, Nm]."""
        return np.concatenate([self.force_bias, self.torque_bias])

    def without(self, force: ArrayLike, torque: ArrayLike, gravity: ArrayLike) -> tuple[Floats, Floats]:
        """Return readings (3,) or (N, 3) less bias and the tool at rest; gravity [m/s2] is as the sensor sees it."""
        down, single = as_batch("gravity", gravity, 3)
        shape = (3,) if single else down.shape
        weight = self.mass * down.reshape(shape)
        forces = self.sign * (as_array("force", force, shape) - self.force_bias) - weight
        torques = self.sign * (as_array("torque", torque, shape) - self.torque_bias)
        return forces, torques - np.cross(self.center, weight)


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
    _require_turns(down, X)
    parts = (slice(0, 3), [0, 4, 5, 6], forces), (slice(3, 6), [1, 2, 3, 7, 8, 9], torques)
    found, covariance, rms = np.zeros(10), np.zeros((10, 10)), [0.0, 0.0]
    for part, (rows, columns, readings) in enumerate(parts):  # no number is in both
        A, y = X[:, rows][:, :, columns].reshape(-1, len(columns)), readings.ravel()
        found[columns] = np.linalg.lstsq(A, y, rcond=None)[0]
        left = y - A @ found[columns]
        rms[part] = float(np.sqrt(np.mean(left**2)))
        covariance[np.ix_(columns, columns)] = left @ left / (len(y) - len(columns)) * np.linalg.inv(A.T @ A)
    mass, moment = float(found[0]), found[1:4]
    if not mass > 0.0:
        raise InputError(f"wrist tool: mass {mass:.3g} kg: the sensor counts forces the other way, or has other axes")
    center = moment / mass
    if mass > _HEAVIEST_KG or np.linalg.norm(center) > LONG_LINK_M:
        raise InputError(
            f"wrist tool: mass {mass:.4g} kg, centre of mass {np.linalg.norm(center):.4g} m away: expected at most "
            f"{_HEAVIEST_KG:g} kg and {LONG_LINK_M:g} m; forces are in N (not mN or kN), torques in Nm, gravity in m/s2"
        )
    deviation = np.sqrt(np.diag(covariance))
    of_center = np.hypot(deviation[1:4], center * deviation[0]) / mass
    errors = float(deviation[0]), of_center, deviation[4:7], deviation[7:]
    return WristTool(mass, center, found[4:7], found[7:], *errors, rms[0], rms[1])


def _require_turns(down: Floats, X: Floats) -> None:
    """Refuse poses that gravity (N, 3) does not tell ten numbers in; X (N, 6, 10) are their columns."""
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
    """Fit a tool and how its sensor counts: sign and axes against a frame; and doubt what something else explains.

    The sensor may count loads or what holds them, in the frame's axes or in others, which are found. A base that is
    tilted, gains of axes, torques in other axes than forces, and a cable that pulls each compete with the tool alone.

    Args:
        force: (N, 3) means over each of six poses or more [N], as they were read; torque: likewise [Nm].
        poses: N of the sensor's frame in base axes, as `forward_kinematics` gives them.
        gravity: (3,) or (N, 3) in base axes [m/s2].
        noise: Standard deviation of a mean force [N].

    Raises:
        InputError: The sensor's axes are left-handed, or no tool explains the readings.
        ExcitationError: Gravity points nearly the same way in all poses, seen from the sensor.
    """
    turned = as_array("rotation", poses.rotation, (None, 3, 3))
    forces = as_array("force", force, (len(turned), 3))
    torques = as_array("torque", torque, forces.shape)
    if len(forces) < _MIN_JUDGED_POSES:
        raise InputError(f"wrist tool: {len(forces)} poses, expected {_MIN_JUDGED_POSES} or more, differently turned")
    to_frame = turned.transpose(0, 2, 1)
    down = np.einsum("nij,nj->ni", to_frame, np.broadcast_to(gravity_rows(gravity, len(forces)), forces.shape))
    gains, left_by_axes = _solved([np.einsum("nj,ik->nikj", down, np.eye(3))], forces)
    axes, is_tilted = _axes(down, to_frame, forces, gains[:9].reshape(3, 3), left_by_axes)
    sign = 1.0 if np.linalg.det(axes) > 0.0 else -1.0
    in_sensor, in_axes = down @ (sign * axes).T, axes @ to_frame  # in_axes turns base axes' vectors to readings
    found = fit_wrist_tool(sign * forces, sign * torques, in_sensor)
    force_bias, torque_bias = sign * found.force_bias, sign * found.torque_bias
    tool = replace(found, force_bias=force_bias, torque_bias=torque_bias, sign=sign, rotation=sign * axes.T)
    stated = np.einsum("nij,nj->ni", turned, down).mean(axis=0)
    place = np.einsum("nij,nj->ni", in_axes, poses.position - poses.position.mean(axis=0))
    doubts = [
        _tilted(_solved([in_axes], forces)[0][:3], stated) if is_tilted else None,
        _uneven(tool, gains[:9].reshape(3, 3) / tool.mass - axes, left_by_axes) if not is_tilted else None,
        _crossed(tool, torques, down),
        _dragged(tool, forces, in_axes, down @ axes.T, place, noise, is_tilted=is_tilted),
    ]
    return tool, [doubt for doubt in doubts if doubt is not None][:1]  # what explains most hides the others


def _solved(columns: list[Floats], readings: Floats) -> tuple[Floats, float]:
    """Return what least squares gives for columns (N, 3, ...) and a bias, and the squares left by degree of freedom."""
    count = len(readings)
    A = np.hstack([*(each.reshape(3 * count, -1) for each in columns), np.tile(np.eye(3), (count, 1))])
    solution = np.asarray(np.linalg.lstsq(A, readings.ravel(), rcond=None)[0], dtype=np.float64)
    left = readings.ravel() - A @ solution
    return solution, float(left @ left) / (len(left) - A.shape[1])


def _axes(down: Floats, to_frame: Floats, forces: Floats, gains: Floats, left_by_axes: float) -> tuple[Floats, bool]:
    """Return the matrix (3, 3), +-R, from loads in the frame's axes to readings, and whether the base is tilted."""
    (mass, *_), left = _solved([down], forces)
    as_framed = np.eye(3) if mass > 0.0 else -np.eye(3)
    pull, left_by_tilt = _solved([to_frame], forces)
    if left_by_tilt < _BETTER_SHARE * left and left_by_tilt <= left_by_axes:
        angle = angle_between(as_framed[0, 0] * pull[:3], np.einsum("nji,nj->ni", to_frame, down).mean(axis=0))
        return as_framed, bool(angle > _TURNED)
    if left_by_axes >= _BETTER_SHARE * left:
        return as_framed, False
    U, _, Vt = np.linalg.svd(gains)
    turn = np.asarray(U @ Vt)
    if np.linalg.det(turn) < 0.0 and np.linalg.norm(rotation_vector(-turn)) > _MIRRORED:
        rows = "; ".join(", ".join(f"{v:.2f}" for v in row) for row in turn)
        raise InputError(
            f"wrist tool: forces are ({rows}) times those in axes of the sensor's frame, which is left-handed: an axis "
            "of the sensor counts the other way: negate its force and torque; or all six do, in axes that are turned "
            "too: negate all six"
        )
    return turn, False


def _tilted(pull: Floats, stated: Floats) -> Finding:
    """Say which gravity (3,) in base axes forces fit; pull is its direction times mass, of either sign [N]."""
    pull = pull * np.sign(pull @ stated)
    size = np.linalg.norm(stated) / np.linalg.norm(pull)
    along = ",".join(f"{v:.4g}" for v in pull * size)
    angle = np.rad2deg(angle_between(pull, stated))
    says = f"forces fit gravity turned by {angle:.1f} deg and a mass of {1.0 / size:.4g} kg much better"
    return Finding("gravity", (), says, "a base that is tilted, or a cable that pulls evenly", f"--gravity {along}")


def _uneven(tool: WristTool, off: Floats, left_by_axes: float) -> Finding | None:
    """Doubt gains of the sensor's axes, (3, 3) off a rotation."""
    if not (left_by_axes < _BETTER_SHARE * tool.force_rms**2 and np.abs(off).max() > _GAIN):
        return None
    worst = np.unravel_index(int(np.abs(off).argmax()), off.shape)
    says = f"forces fit gains of the sensor's axes much better, off by {off[worst]:+.2f} in axis {'xyz'[worst[0]]}"
    return Finding("units", (), says, "a gain of one of its axes, or a calibration of another sensor")


def _crossed(tool: WristTool, torques: Floats, down: Floats) -> Finding | None:
    """Doubt torques that follow gravity, but not as a weight at one place."""
    matrix, left = _solved([np.einsum("nj,ik->nikj", down, np.eye(3))], torques)
    size = float(np.abs(matrix[:9]).max()) * float(np.linalg.norm(down[0]))
    if left < _BETTER_SHARE * tool.torque_rms**2 and tool.torque_rms > _GAIN * size:
        says = f"torques follow gravity, but {tool.torque_rms:.3g} Nm (RMS) are left of a weight at one place"
        return Finding("units", (), says, "axes or signs of torques that are not those of forces")
    return None


def _dragged(
    tool: WristTool, forces: Floats, in_axes: Floats, weight: Floats, place: Floats, noise: float, *, is_tilted: bool
) -> Finding | None:
    """Doubt forces that a spring in base axes explains beyond chance, or of which much is left."""
    from scipy.stats import f  # takes a quarter of a second to import

    size, count = tool.mass * float(np.linalg.norm(weight[0])), forces.size
    if tool.force_rms <= noise:  # less than anything could explain
        return None
    alone, few = (in_axes, 6) if is_tilted else (weight, 4)
    _, before = _solved([alone], forces)
    _, after = _solved([in_axes, place], forces)
    gain = (before * (count - few) - after * (count - 7)) / (7 - few) / max(after, 1e-12 * before)
    by_chance = float(f.sf(gain, 7 - few, count - 7))
    if by_chance >= _DRAG_CHANCE and np.sqrt(before) <= max(_DRAG_SHARE * size, _DRAG_NOISES * noise):
        return None
    says = (
        f"{np.sqrt(before):.3g} N (RMS) of {size:.3g} N are left, where noise leaves {noise:.2g} N: mass and zeros may "
        "be off by ten times that share"
    )
    culprit = "a cable or hose that drags at the tool, or a pose in which something touched it"
    return Finding("cable", (), says, culprit, "fasten it to the tool, with slack behind the sensor, and weigh again")


def load_tool(path: Path | str) -> WristTool:
    """Read a tool file."""
    try:
        return load_toml(Path(path), WristTool)
    except InputError as error:
        raise ConfigError(f"{path}: {error}") from error


def save_tool(path: Path | str, tool: WristTool) -> None:
    """Write a tool file, which appears whole or not at all."""
    rows = [f"{key} = {json.dumps(value, ensure_ascii=False)}\n" for key, value in plain_data(tool).items()]
    write_atomically(Path(path), (_HEAD + "".join(rows)).encode())
