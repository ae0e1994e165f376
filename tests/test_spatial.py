import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.testing import assert_allclose
from scipy.linalg import expm

from catenary import spatial
from catenary.errors import InputError

numbers = st.floats(-3.0, 3.0)
vectors = arrays(np.float64, 3, elements=numbers)
quaternions = arrays(np.float64, 4, elements=numbers).filter(lambda q: np.linalg.norm(q) > 1e-3)
poses = st.builds(lambda q, p: spatial.Pose(spatial.rotation_from_quaternion(q), p), quaternions, vectors)


def cross_matrix(v):
    return np.cross(np.eye(3), np.asarray(v))


def assert_same_pose(a, b):
    assert_allclose(a.rotation, b.rotation, atol=1e-12)  # a few products of numbers around one
    assert_allclose(a.position, b.position, atol=1e-11)


@given(poses, poses, vectors)
def test_composing_poses_applies_one_after_the_other(a_b, b_c, point):
    moved_once = b_c.rotation @ point + b_c.position
    moved_twice = a_b.rotation @ moved_once + a_b.position
    both = a_b @ b_c
    assert_allclose(both.rotation @ point + both.position, moved_twice, atol=1e-11)


@given(poses)
def test_a_pose_times_its_inverse_is_the_identity(pose):
    assert_same_pose(pose @ pose.inverse(), spatial.identity_pose())
    assert_same_pose(pose.inverse() @ pose, spatial.identity_pose())


@given(quaternions)
def test_a_quaternion_survives_the_way_through_a_matrix_but_for_sign_and_length(q):
    unit = q / np.linalg.norm(q)
    back = spatial.quaternion_from_rotation(spatial.rotation_from_quaternion(q))
    assert back[0] >= 0.0
    assert_allclose(abs(unit @ back), 1.0, atol=1e-12)


@given(quaternions, vectors)
def test_a_quaternion_rotates_as_its_product_with_a_vector(q, v):
    w, u = q[0] / np.linalg.norm(q), q[1:] / np.linalg.norm(q)
    rotated = v + 2.0 * np.cross(u, np.cross(u, v) + w * v)  # q v q*, written out
    assert_allclose(spatial.rotation_from_quaternion(q) @ v, rotated, atol=1e-11)


@given(vectors)
def test_rpy_is_roll_then_pitch_then_yaw_about_fixed_axes(rpy):
    roll, pitch, yaw = (expm(cross_matrix(axis) * angle) for axis, angle in zip(np.eye(3), rpy, strict=True))
    assert_allclose(spatial.rotation_from_rpy(rpy), yaw @ pitch @ roll, atol=1e-11)


@given(st.floats(-7.0, 7.0))
def test_rotations_about_axes_are_the_exponentials_of_their_axes(angle):
    assert_allclose(spatial.rotation_about_x(angle), expm(cross_matrix([1, 0, 0]) * angle), atol=1e-11)
    assert_allclose(spatial.rotation_about_y(angle), expm(cross_matrix([0, 1, 0]) * angle), atol=1e-11)
    assert_allclose(spatial.rotation_about_z(angle), expm(cross_matrix([0, 0, 1]) * angle), atol=1e-11)


@given(vectors.filter(lambda v: np.linalg.norm(v) < 3.1))
def test_rotation_vector_inverts_the_exponential(v):
    # ill-conditioned close to pi
    assert_allclose(spatial.rotation_vector(expm(cross_matrix(v))), v, atol=1e-8)


@pytest.mark.parametrize("size", [1e-300, 1e-200, 1.0, 1e200, 1.7e308])
def test_a_vector_of_any_length_has_a_direction(size):
    assert_allclose(spatial.unit_vector("axis", [0.6 * size, 0.0, -0.8 * size]), [0.6, 0.0, -0.8], rtol=1e-14)
    turned = spatial.rotation_from_quaternion([size, size, 0.0, 0.0])
    assert_allclose(turned, spatial.rotation_about_x(np.pi / 2.0), atol=1e-15)


def test_a_zero_quaternion_is_refused():
    with pytest.raises(InputError, match=r"quaternion \(w, x, y, z\): expected non-zero length"):
        spatial.rotation_from_quaternion([0, 0, 0, 0])


@pytest.mark.parametrize(
    ("matrix", "words"),
    [
        *((m, "R: expected a rotation matrix") for m in (np.diag([1.0, 1.0, -1.0]), 2.0 * np.eye(3), np.zeros((3, 3)))),
        (np.ones((3, 3)), "R: expected a rotation matrix"),
        (np.full((3, 3), np.nan), "finite"),
    ],
)  # fmt: skip
def test_what_is_no_proper_rotation_is_refused(matrix, words):
    with pytest.raises(InputError, match=words):
        spatial.as_rotation("R", matrix)


@given(poses)
def test_a_pose_survives_the_way_through_its_matrix(pose):
    again = spatial.as_pose("T", pose.matrix)
    assert_allclose(again.rotation, pose.rotation)
    assert_allclose(again.position, pose.position)
    assert spatial.Pose(np.stack([pose.rotation] * 2), np.stack([pose.position] * 2)).matrix.shape == (2, 4, 4)


SHIFTED = np.block([[np.eye(3), np.array([[0.1], [0.2], [0.3]])], [np.zeros((1, 3)), np.ones((1, 1))]])


@pytest.mark.parametrize(
    ("matrix", "words"),
    [
        (SHIFTED.T, r"T: expected a last row 0 0 0 1 of a homogeneous matrix, got .*; it is transposed"),
        (SHIFTED + np.outer([0, 0, 0, 1], [0, 0, 0, 0.5]), "T: expected a last row 0 0 0 1"),
        (SHIFTED @ np.diag([1.0, 1.0, -1.0, 1.0]), "T rotation: expected a rotation matrix, .*determinant -1"),
        (SHIFTED @ np.diag([1.1, 1.0, 1.0, 1.0]), "T rotation: expected a rotation matrix"),
        (SHIFTED[:3], r"T, a Pose or a homogeneous matrix: expected shape \(4, 4\), got \(3, 4\)"),
        (SHIFTED * np.nan, "expected finite numbers"),
    ],
)  # fmt: skip
def test_a_matrix_that_is_no_rigid_motion_is_refused(matrix, words):
    with pytest.raises(InputError, match=words):
        spatial.as_pose("T", matrix)


@given(st.lists(st.tuples(poses, poses), min_size=1, max_size=4), poses)
def test_many_poses_compose_row_by_row(pairs, common):
    first, second = (
        spatial.Pose(np.array([p.rotation for p in side]), np.array([p.position for p in side]))
        for side in zip(*pairs, strict=True)
    )
    for k, (a, b) in enumerate(pairs):
        for both, expected in ((first @ second, a @ b), (first @ common, a @ common), (common @ second, common @ b)):
            assert_same_pose(spatial.Pose(both.rotation[k], both.position[k]), expected)
        inverse = first.inverse()
        assert_same_pose(spatial.Pose(inverse.rotation[k], inverse.position[k]), a.inverse())
