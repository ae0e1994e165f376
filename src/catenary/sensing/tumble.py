"""Accelerometer calibration from readings at rest: bias and scale (tumble test), and mounting rotation (Wahba)."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from catenary.arrays import Floats, as_array
from catenary.errors import InputError
from catenary.spatial import STANDARD_GRAVITY, angle_between
from catenary.units import ACCELERATION_UNITS

_MIN_READINGS = 6  # readings: bias and scale are six numbers
_COVERING_COSINE = np.cos(np.radians(55.0))  # of the largest angle from an axis at which a reading covers that side
_SIDES = ("+x up", "-x up", "+y up", "-y up", "+z up", "-z up")
_MAX_BIAS, _MAX_SCALE = 3.0, 0.2  # [m/s2], relative: beyond them an accelerometer is broken
_MAX_RESIDUAL = 0.1  # [m/s2] of readings at rest
_MIN_TURN_RATIO = 0.005  # of two directions 8 degrees apart: (1 - cos) / (1 + cos)
_MIN_PLANE_RATIO = 0.002  # of three directions, level and tilted by 8 degrees about two axes
_MAX_MISALIGNMENT_DEG = 30.0  # [deg] between expected and fitted rotation


@dataclass(frozen=True)
class SensorFit:
    """Accelerometer errors from readings at rest: reading = scale (R^T up g) + bias."""

    bias: Floats  # (3,) [m/s2]
    scale: Floats  # (3,) ones if not fitted
    residual: float  # [m/s2] RMS of lengths or of readings; NaN without redundancy
    faults: tuple[str, ...]  # reasons not to use the result
    missing: tuple[str, ...] = ()  # sides of the sensor that were never up
    # (3, 3) from the sensor's axes to those of `up`; the identity if not fitted
    rotation: Floats = field(default_factory=lambda: np.eye(3))


@dataclass(frozen=True)
class Alignment:
    """Rotation of a sensor relative to reference axes."""

    rotation: Floats  # (3, 3) from the sensor's axes to those of `up`
    residual_deg: float  # RMS angle between `up` and the readings
    faults: tuple[str, ...]


def fit_tumble(readings: ArrayLike) -> SensorFit:
    """Fit bias and scale of an accelerometer to readings at rest in unknown attitudes.

    Minimises sum_i (|(y_i - b) / s| - g)^2 over bias b and scale s, both (3,): at rest specific force has gravity's
    length in every attitude. [Frosio, Pedersini, Borghese 2009, Autocalibration of MEMS accelerometers, without
    their cross-axis terms]

    Args:
        readings: (N, 3) specific force [m/s2], N >= 6, each side up at least once; more than six give a residual.
    """
    y = as_array("readings", readings, (None, 3))
    if len(y) < _MIN_READINGS:
        raise InputError(f"tumble: expected at least {_MIN_READINGS} readings at rest, got {len(y)}")
    faults = length_faults(y)
    directions = y / np.maximum(np.linalg.norm(y, axis=1, keepdims=True), 1e-12)
    covered = (np.stack([directions, -directions], axis=2).reshape(-1, 6) >= _COVERING_COSINE).any(axis=0)
    missing = tuple(side for side, seen in zip(_SIDES, covered, strict=True) if not seen)
    if missing:
        faults.append(f"too little spread: no reading with {', '.join(missing)}")
    if faults:
        return SensorFit(np.zeros(3), np.ones(3), float("nan"), tuple(faults), missing)

    def off(p: Floats) -> Floats:
        lengths: Floats = np.linalg.norm((y - p[:3]) / p[3:], axis=1)
        return lengths - STANDARD_GRAVITY

    solution = least_squares(off, np.r_[np.zeros(3), np.ones(3)], x_scale="jac", xtol=1e-14, ftol=1e-14, gtol=1e-14)
    bias, scale = solution.x[:3], solution.x[3:]
    residual = float(np.sqrt(np.mean(solution.fun**2))) if len(y) > _MIN_READINGS else float("nan")
    if np.abs(bias).max() > _MAX_BIAS or np.abs(scale - 1.0).max() > _MAX_SCALE:
        faults.append(
            f"bias {np.round(bias, 2).tolist()} m/s2, scale {np.round(scale, 3).tolist()}: beyond {_MAX_BIAS:g} m/s2 "
            f"and 1 ± {_MAX_SCALE:g}: was it at rest, and is its unit right?"
        )
    if residual > _MAX_RESIDUAL:
        faults.append(f"residual {residual:.3f} m/s2, expected below {_MAX_RESIDUAL:g}: it was moved during a reading")
    return SensorFit(bias, scale, residual, tuple(faults), missing)


def align(readings: ArrayLike, up: ArrayLike, *, expected: ArrayLike | None = None) -> Alignment:
    """Fit the sensor's rotation to readings at rest with known directions of up.

    Kabsch's solution of Wahba's problem, readings and directions normalised. Two directions that are not parallel
    are enough; three that are not in one plane reveal mirrored axes.

    Args:
        readings: (N, 3) means at rest [m/s2], N >= 2, corrected for bias and scale.
        up: (N, 3) directions of up in reference axes: (0, 0, 1) for a level base.
        expected: (3, 3) approximate rotation, which distinguishes a wrong sign from swapped axes; without it no
            rotation is a fault.
    """
    force = as_array("readings", readings, (None, 3))
    true = as_array("up", up, (len(force), 3))
    rough = np.eye(3) if expected is None else as_array("expected", expected, (3, 3))
    lengths, true_lengths = np.linalg.norm(force, axis=1), np.linalg.norm(true, axis=1)
    if len(force) < 2 or not (lengths > 0.0).all() or not (true_lengths > 0.0).all():
        raise InputError(f"align: expected at least two readings and directions that are not zero, got {len(force)}")
    force, true = force / lengths[:, None], true / true_lengths[:, None]
    U, sizes, Vt = np.linalg.svd(true.T @ force)
    if sizes[1] < _MIN_TURN_RATIO * sizes[0]:
        raise InputError("align: all directions are parallel: tilt the base by 10 degrees or more, or turn it over")
    mirrored = np.linalg.det(U @ Vt) < 0.0
    rotation: Floats = U @ np.diag([1.0, 1.0, -1.0 if mirrored else 1.0]) @ Vt
    residual = float(np.degrees(np.sqrt(np.mean(angle_between(true, force @ rotation.T) ** 2))))
    faults: list[str] = []
    shows_mirror, orthogonal = mirrored and sizes[2] > _MIN_PLANE_RATIO * sizes[0], U @ Vt  # the best reflection
    # two directions cannot reveal a reflection, but all of them upside down do
    upside_down = np.mean(np.sum(true * (force @ rough.T), axis=1)) < -0.5
    wrong_sign = _rotation_deg(-orthogonal @ rough.T) <= _MAX_MISALIGNMENT_DEG if shows_mirror else upside_down
    if wrong_sign:
        faults.append("wrong sign: at rest it reads +g downwards; specific force points up")
    elif shows_mirror:
        faults.append(f"wrong axes: {_axes_text(rough.T @ orthogonal)}: not right-handed")
    elif expected is not None and _rotation_deg(rotation @ rough.T) > _MAX_MISALIGNMENT_DEG:
        faults.append(
            f"wrong axes: {_axes_text(rough.T @ rotation)}: {_rotation_deg(rotation @ rough.T):.0f} deg from the "
            "expected rotation"
        )
    elif residual > 5.0:
        faults.append(f"readings and attitudes differ by {residual:.1f} deg: check the stated attitudes")
    return Alignment(rotation, residual, tuple(faults))


def level_and_tilts(level: ArrayLike, roll: ArrayLike, pitch: ArrayLike) -> tuple[Floats, Floats]:
    """Return readings and directions of up for `align`, of a base that was level, then tilted by unknown angles.

    Rolled about its x axis, positive (y side up), it has up in its y-z plane; pitched about its y axis from level,
    positive (x side down), in its x-z plane. The tilt angles are those between the readings.

    Args:
        level: (3,) specific force of the level base [m/s2].
        roll, pitch: (3,) of the rolled and of the pitched base.

    Returns:
        Readings (3, 3) [m/s2] and unit directions of up (3, 3) in base axes, one a row.
    """
    rows = np.array([as_array("reading", reading, (3,)) for reading in (level, roll, pitch)])
    a, b = angle_between(rows[0], rows[1]), angle_between(rows[0], rows[2])
    return rows, np.array([[0.0, 0.0, 1.0], [0.0, np.sin(a), np.cos(a)], [-np.sin(b), 0.0, np.cos(b)]])


def _handedness_faults(force: Floats, true: Floats) -> list[str]:
    spread_up, spread = STANDARD_GRAVITY * (true - true.mean(axis=0)), force - force.mean(axis=0)
    U, sizes, Vt = np.linalg.svd(spread_up.T @ spread)
    mirror = U @ Vt  # the best orthogonal matrix; three directions that are not in one plane reveal a reflection
    off = float(np.sqrt(np.mean((spread_up - spread @ mirror.T) ** 2)))
    if np.linalg.det(mirror) > 0.0 or sizes[2] < _MIN_PLANE_RATIO * sizes[0] or off > 3.0 * _MAX_RESIDUAL:
        return []
    return [
        "axes are left-handed: all signs are wrong (specific force points up at rest), or one is, or two axes are "
        "swapped: set --axes"
    ]


def length_faults(y: Floats) -> list[str]:
    """Detect a wrong unit or removed gravity from the length of readings at rest (N, 3) [m/s2]."""
    length = float(np.median(np.linalg.norm(y, axis=1)))
    if abs(length - STANDARD_GRAVITY) <= _MAX_BIAS:
        return []
    off = {unit: abs(length * factor / STANDARD_GRAVITY - 1.0) for unit, factor in ACCELERATION_UNITS.items()}
    unit = min(off, key=lambda name: off[name])
    if off[unit] < 0.05:
        return [f"readings are of length {length:.4g}: they seem to be in {unit}, expected m/s2"]
    if length < 1.0:
        return [f"readings are of length {length:.3g} m/s2: the driver removes gravity"]
    return [f"readings are of length {length:.3g}, expected about {STANDARD_GRAVITY} m/s2"]


def _axes_text(matrix: Floats) -> str:
    nearest = np.argmax(np.abs(matrix), axis=0)
    return ", ".join(f"{'xyz'[j]} reads {'-' if matrix[k, j] < 0 else '+'}{'xyz'[k]}" for j, k in enumerate(nearest))


def _rotation_deg(matrix: Floats) -> float:
    return float(np.degrees(Rotation.from_matrix(matrix).magnitude()))


_MIN_ORIENTATIONS = 4  # rotation and bias are six numbers, of which one rest gives three
_MIN_FOR_SCALE = 9  # orientations from which scale is fitted too
_MIN_SPREAD = 0.05  # least singular value of the directions of up, relative to sqrt N


def fit_orientations(readings: ArrayLike, up: ArrayLike) -> SensorFit:
    """Fit rotation and bias, and scale from nine orientations on, to means at rest in known orientations.

    Minimises sum_i |s (R^T up_i g) + b - y_i|^2, beginning at Kabsch's rotation without bias.

    Args:
        readings: (N, 3) means at rest [m/s2], N >= 4.
        up: (N, 3) directions of up in reference axes, not all on one line.
    """
    y = as_array("readings", readings, (None, 3))
    true = as_array("up", up, (len(y), 3))
    if len(y) < _MIN_ORIENTATIONS:
        raise InputError(f"orientations: expected at least {_MIN_ORIENTATIONS} rests, got {len(y)}")
    true = true / np.linalg.norm(true, axis=1, keepdims=True)
    if faults := [*length_faults(y), *_handedness_faults(y, true)]:
        return SensorFit(np.zeros(3), np.ones(3), float("nan"), tuple(faults))
    spread = np.linalg.svd(true - true.mean(axis=0), compute_uv=False)
    if spread[1] < _MIN_SPREAD * np.sqrt(len(y)):
        raise InputError("orientations: up moved along one line at most: tilt about two axes, by 10 degrees or more")
    with_scale = len(y) >= _MIN_FOR_SCALE and spread[2] > _MIN_SPREAD * np.sqrt(len(y))

    def off(p: Floats) -> Floats:
        R, scale = Rotation.from_rotvec(p[:3]), p[6:9] if with_scale else np.ones(3)
        error: Floats = scale * R.inv().apply(STANDARD_GRAVITY * true) + p[3:6] - y
        return error.ravel()

    turned = Rotation.from_matrix(align(y, true).rotation).as_rotvec()
    first = np.r_[turned, np.zeros(3), np.ones(3 if with_scale else 0)]
    best = least_squares(off, first, xtol=1e-14, ftol=1e-14, gtol=1e-14)
    residual = float(np.sqrt(np.mean(best.fun**2)))
    if residual > _MAX_RESIDUAL:
        faults = [
            f"residual {residual:.3f} m/s2, expected below {_MAX_RESIDUAL:g}: are the orientations right, in order? "
            "roll_deg turns about x, then pitch_deg about the rotated y axis"
        ]
    rotation: Floats = Rotation.from_rotvec(best.x[:3]).as_matrix()
    scale = best.x[6:9] if with_scale else np.ones(3)
    return SensorFit(best.x[3:6], scale, residual, tuple(faults), rotation=rotation)
