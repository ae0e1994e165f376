"""Rotations, poses, and gravity on a level base. `R_a_b` takes vectors in b to a; quaternions are (w, x, y, z).

scipy is imported where it is used: it takes as long as numba to import, and most robots load without it.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from catenary.arrays import Floats, as_array, frozen
from catenary.errors import InputError

STANDARD_GRAVITY = 9.81  # [m/s2], as everywhere in this package
LEVEL = frozen(np.array([0.0, 0.0, -STANDARD_GRAVITY]))  # gravity (3,) in the axes of a level base


def cross(a: Floats, b: Floats) -> Floats:
    """Return a x b of two vectors (3,), in a tenth of np.cross's time."""
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


class Pose(NamedTuple):
    """Pose of a frame b in a frame a: p_a = rotation p_b + position."""

    rotation: Floats  # (3, 3) R_a_b
    position: Floats  # (3,) origin of b in a [m]

    def __matmul__(self, other: "Pose") -> "Pose":
        """Return T_a_c of T_a_b @ T_b_c."""
        return Pose(self.rotation @ other.rotation, self.rotation @ other.position + self.position)

    def inverse(self) -> "Pose":
        """Return T_b_a."""
        return Pose(self.rotation.T, -self.rotation.T @ self.position)


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

    matrix: Floats = Rotation.from_euler("xyz", as_array("rpy", rpy, (3,))).as_matrix()
    return matrix


def rotation_from_quaternion(quaternion: ArrayLike) -> Floats:
    """Return the rotation matrix of a quaternion (w, x, y, z), which is normalised first.

    Raises:
        InputError: The quaternion is zero.
    """
    q = as_array("quaternion", quaternion, (4,))
    if not np.linalg.norm(q) > 0.0:
        raise InputError(f"quaternion: expected (w, x, y, z) of non-zero length, got {q}")
    from scipy.spatial.transform import Rotation

    matrix: Floats = Rotation.from_quat(np.roll(q, -1)).as_matrix()
    return matrix


def quaternion_from_rotation(rotation: ArrayLike) -> Floats:
    """Return the unit quaternion (w, x, y, z) with w >= 0 of a rotation matrix (3, 3)."""
    from scipy.spatial.transform import Rotation

    x, y, z, w = Rotation.from_matrix(as_rotation("rotation", rotation)).as_quat(canonical=True)
    return np.array([w, x, y, z])


def rotation_vector(rotation: ArrayLike) -> Floats:
    """Return the axis times angle [rad] of a rotation matrix, (3,); the inverse of the exponential map."""
    from scipy.spatial.transform import Rotation

    vector: Floats = Rotation.from_matrix(as_array("rotation", rotation, (3, 3))).as_rotvec()
    return vector


def rotation_from_vector(vector: ArrayLike) -> Floats:
    """Return the rotation matrix (3, 3) of an axis times angle (3,) [rad]; the inverse of `rotation_vector`."""
    from scipy.spatial.transform import Rotation  # slow to import

    matrix: Floats = Rotation.from_rotvec(as_array("vector", vector, (3,))).as_matrix()
    return matrix


def as_rotation(name: str, values: ArrayLike) -> Floats:
    """Return the values as a proper rotation matrix (3, 3).

    Raises:
        InputError: Not orthonormal to 1e-6, or a reflection.
    """
    matrix = as_array(name, values, (3, 3))
    deviation = float(np.abs(matrix @ matrix.T - np.eye(3)).max())
    determinant = float(np.linalg.det(matrix))
    if deviation > 1e-6 or determinant < 0.0:
        raise InputError(
            f"{name}: expected a rotation matrix, got rows orthonormal to {deviation:.1e}, "
            f"determinant {determinant:.6g}"
        )
    return matrix
