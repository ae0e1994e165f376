"""Rotations, poses, and gravity on a level base, (0, 0, -9.81).

`R_a_b` takes vectors in b to a; quaternions are (w, x, y, z).
scipy is imported where it is used: it takes as long as numba to import, and most robots load without it. Conversions
that a served robot's tick makes are plain arithmetic, in a tenth of scipy's time.
"""

from math import atan2, cos, hypot, inf, sin, sqrt
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from catenary.arrays import Floats, Listed, as_array, frozen
from catenary.errors import InputError

STANDARD_GRAVITY = 9.81  # [m/s2], as everywhere in this package
_HOMOGENEOUS = 1e-9  # by which the last row of a homogeneous matrix may be off
LEVEL = frozen(np.array([0.0, 0.0, -STANDARD_GRAVITY]))  # gravity (3,) in the axes of a level base


def cross(a: Floats, b: Floats) -> Floats:
    """Return the cross product a x b, in a tenth of the time of `np.cross`.

    Args:
        a, b: Vectors (3,), or columns (3, N).
    """
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


class Pose(NamedTuple):
    """Pose of a frame b in a frame a: p_a = rotation p_b + position; or N poses, which compose row by row."""

    rotation: Annotated[Floats, Listed((3, 3))]  # (3, 3) or (N, 3, 3) R_a_b
    position: Annotated[Floats, Listed((3,))]  # (3,) or (N, 3) origin of b in a [m]

    def __matmul__(self, other: "Pose") -> "Pose":
        """Return T_a_c of T_a_b @ T_b_c."""
        return Pose(self.rotation @ other.rotation, _turned(self.rotation, other.position) + self.position)

    def inverse(self) -> "Pose":
        """Return T_b_a."""
        inverse = np.swapaxes(self.rotation, -1, -2)
        return Pose(inverse, -_turned(inverse, self.position))

    @property
    def matrix(self) -> Floats:
        """The homogeneous matrix [R p; 0 0 0 1], (4, 4) or (N, 4, 4)."""
        upper = np.concatenate([self.rotation, self.position[..., None]], axis=-1)
        last = np.broadcast_to([0.0, 0.0, 0.0, 1.0], (*upper.shape[:-2], 1, 4))
        return np.concatenate([upper, last], axis=-2)


def as_pose(name: str, pose: Pose | ArrayLike) -> Pose:
    """Return a rigid pose, given as `Pose` or as a homogeneous matrix.

    Args:
        name: The quantity, which opens every message.
        pose: `Pose` (3, 3), (3,) or matrix (4, 4) with last row 0 0 0 1; translation in m.
    """
    if isinstance(pose, Pose):
        return Pose(as_rotation(f"{name} rotation", pose.rotation), as_array(f"{name} position", pose.position, (3,)))
    matrix = as_array(f"{name}, a Pose or a homogeneous matrix", pose, (4, 4))
    last = (0.0, 0.0, 0.0, 1.0)
    if np.abs(matrix[3] - last).max() > _HOMOGENEOUS:
        turned = "; it is transposed" if np.abs(matrix[:, 3] - last).max() <= _HOMOGENEOUS else ""
        raise InputError(f"{name}: expected a last row 0 0 0 1 of a homogeneous matrix, got {matrix[3]}{turned}")
    return Pose(as_rotation(f"{name} rotation", matrix[:3, :3]), matrix[:3, 3])


def _turned(rotation: Floats, vector: Floats) -> Floats:
    """Return R v of one or of each of N."""
    if rotation.ndim == 2 and vector.ndim == 1:
        return rotation @ vector
    return np.asarray((rotation @ vector[..., None])[..., 0])


def identity_pose() -> Pose:
    """Return the pose of a frame in itself."""
    return Pose(np.eye(3), np.zeros(3))


def rotation_about_x(angle: float) -> Floats:
    """Return the rotation by `angle` [rad] about x, (3, 3)."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])


def rotation_about_y(angle: float) -> Floats:
    """Return the rotation by `angle` [rad] about y, (3, 3)."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])


def rotation_about_z(angle: float) -> Floats:
    """Return the rotation by `angle` [rad] about z, (3, 3)."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def rotation_from_rpy(rpy: ArrayLike) -> Floats:
    """Return the rotation Rz(yaw) Ry(pitch) Rx(roll) of fixed-axis angles (roll, pitch, yaw) [rad], as URDF has it."""
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_euler("xyz", as_array("rpy", rpy, (3,))).as_matrix())


def rotation_from_quaternion(quaternion: ArrayLike) -> Floats:
    """Return the rotation matrix of a quaternion (w, x, y, z), which is normalised first."""
    return _rotation_of(*unit_vector("quaternion (w, x, y, z)", quaternion, 4).tolist())


def unit_vector(name: str, vector: ArrayLike, size: int = 3) -> Floats:
    """Return a vector scaled to length one; no square overflows or vanishes.

    Args:
        name: The quantity, which opens every message.
        vector, size: Numbers (size,), and their number.
    """
    components = as_array(name, vector, (size,))
    largest = float(np.abs(components).max())
    if not largest > 0.0:
        raise InputError(f"{name}: expected non-zero length, got {components}")
    scaled = components / largest
    return np.asarray(scaled / hypot(*scaled.tolist()))


def _rotation_of(w: float, x: float, y: float, z: float) -> Floats:
    return np.array(
        [
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
            [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
            [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
        ]
    )


def quaternion_from_rotation(rotation: ArrayLike) -> Floats:
    """Return the unit quaternion (w, x, y, z) with w >= 0 of a rotation matrix (3, 3)."""
    x, y, z, w = quaternion_of_rows(as_rotation("rotation", rotation).tolist())
    return np.array([w, x, y, z] if w >= 0.0 else [-w, -x, -y, -z])


def quaternion_of_rows(rotation: list[list[float]]) -> list[float]:
    """Return a quaternion (x, y, z, w), as messages have it, of a rotation matrix, row by row [Shepperd 1978]."""
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = rotation
    products = (  # of any two of x, y, z, w; four times each
        (1.0 + xx - yy - zz, xy + yx, xz + zx, zy - yz),
        (xy + yx, 1.0 - xx + yy - zz, yz + zy, xz - zx),
        (xz + zx, yz + zy, 1.0 - xx - yy + zz, yx - xy),
        (zy - yz, xz - zx, yx - xy, 1.0 + xx + yy + zz),
    )
    largest = max(range(4), key=lambda i: products[i][i])
    scale = 0.5 / sqrt(products[largest][largest])
    return [scale * product for product in products[largest]]


def rotation_vector(rotation: ArrayLike) -> Floats:
    """Return the axis times angle [rad] of a rotation matrix, (3,); the inverse of the exponential map."""
    x, y, z, w = quaternion_of_rows(as_array("rotation", rotation, (3, 3)).tolist())
    sine = hypot(x, y, z)
    # twice half the angle, over its sine; the shorter way round
    share = 2.0 * (atan2(sine, w) if w >= 0.0 else atan2(-sine, -w)) / sine if sine > 0.0 else 0.0
    return np.array([share * x, share * y, share * z])


def rotation_from_vector(vector: ArrayLike) -> Floats:
    """Return the rotation matrix (3, 3) of an axis times angle (3,) [rad]; the inverse of `rotation_vector`."""
    x, y, z = as_array("vector", vector, (3,)).tolist()
    angle = hypot(x, y, z)
    if angle == inf:
        raise InputError(f"vector: expected an angle [rad], got the length of {[x, y, z]}, which overflows")
    share = sin(0.5 * angle) / angle if angle > 0.0 else 0.5
    return _rotation_of(cos(0.5 * angle), share * x, share * y, share * z)


def angle_between(a: Floats, b: Floats) -> Floats:
    """Return angles [rad], 0 to pi (...,), between vectors, exact also for nearly parallel ones.

    Args:
        a, b: Vectors (..., 3) of any length.
    """
    return np.asarray(np.arctan2(np.linalg.norm(np.cross(a, b), axis=-1), np.sum(a * b, axis=-1)))


def as_rotation(name: str, values: ArrayLike) -> Floats:
    """Return a rotation matrix, checked to be orthonormal to 1e-6 and right-handed.

    Args:
        name, values: Quantity, which opens every message, and matrix (3, 3).
    """
    matrix = as_array(name, values, (3, 3))
    if np.abs(matrix).max() > 2.0:
        raise InputError(f"{name}: expected a rotation matrix, got numbers up to {np.abs(matrix).max():.3g}")
    deviation = float(np.abs(matrix @ matrix.T - np.eye(3)).max())
    determinant = float(np.linalg.det(matrix))
    if deviation > 1e-6 or determinant < 0.0:
        raise InputError(
            f"{name}: expected a rotation matrix, got rows orthonormal to {deviation:.1e}, "
            f"determinant {determinant:.6g}"
        )
    return matrix
