import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from catenary import spatial
from catenary.errors import InputError

numbers = st.floats(-3.0, 3.0)
vectors = arrays(np.float64, 3, elements=numbers)
quaternions = arrays(np.float64, 4, elements=numbers).filter(lambda q: np.linalg.norm(q) > 1e-3)
poses = st.builds(lambda q, p: spatial.Pose(spatial.rotation_from_quaternion(q), p), quaternions, vectors)


@given(st.lists(st.tuples(poses, poses), min_size=1, max_size=4), poses)
def test_poses_compose_and_invert_as_their_matrices_one_by_one_and_row_by_row(pairs, common):
    first, second = (
        spatial.Pose(np.array([p.rotation for p in side]), np.array([p.position for p in side]))
        for side in zip(*pairs, strict=True)
    )
    for a, b in ((first, second), (first, common), (common, second), pairs[0]):
        assert_allclose((a @ b).matrix, a.matrix @ b.matrix, atol=1e-11)
        assert_allclose(a.inverse().matrix @ a.matrix, np.broadcast_to(np.eye(4), a.matrix.shape), atol=1e-11)


@given(quaternions, vectors.filter(lambda v: np.linalg.norm(v) < 3.1))
def test_rotations_are_those_of_scipy(q, v):
    R = Rotation.from_quat(np.roll(q, -1)).as_matrix()
    assert_allclose(spatial.rotation_from_quaternion(q), R, atol=1e-11)
    back = spatial.quaternion_from_rotation(R)
    assert back[0] >= 0.0
    assert_allclose(abs(q / np.linalg.norm(q) @ back), 1.0, atol=1e-12)
    turned = Rotation.from_rotvec(v).as_matrix()
    assert_allclose(spatial.rotation_from_vector(v), turned, atol=1e-11)
    assert_allclose(spatial.rotation_vector(turned), v, atol=1e-8)  # ill-conditioned close to pi
    about = [getattr(spatial, f"rotation_about_{axis}")(angle) for axis, angle in zip("xyz", v, strict=True)]
    for axis, angle, found in zip(np.eye(3), v, about, strict=True):
        assert_allclose(found, Rotation.from_rotvec(angle * axis).as_matrix(), atol=1e-11)
    # roll, then pitch, then yaw, about fixed axes
    assert_allclose(spatial.rotation_from_rpy(v), about[2] @ about[1] @ about[0], atol=1e-11)


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
