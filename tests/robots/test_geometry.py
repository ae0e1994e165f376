import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from catenary.errors import InputError
from catenary.robots.geometry import Ball, Box, Capsule, TriangleMesh, capsule_between, check_form


@given(st.lists(st.floats(-2, 2), min_size=6, max_size=6))
@example([0.0, 0.0, 0.0, 0.0, 0.0, 8.9e-161])  # whose square is hardly a number
@example([0.0, 0.0, 0.0, 0.0, 5e-324, 5e-324])
def test_a_capsule_between_two_points_ends_there(numbers):
    start, end = np.array(numbers[:3]), np.array(numbers[3:])
    pose, form = capsule_between(start, end, 0.1)
    half = 0.5 * form.length * pose.rotation[:, 2]
    assert_allclose(pose.position - half, start, atol=1e-9)
    assert_allclose(pose.position + half, end, atol=1e-9)
    assert_allclose(pose.rotation @ pose.rotation.T, np.eye(3), atol=1e-9)
    assert np.linalg.det(pose.rotation) == pytest.approx(1.0)


@pytest.mark.parametrize(
    "form",
    [Ball(0.0), Ball(np.nan), Box(1, -1, 1), Capsule(0.1, -0.1), Capsule(2e3, 1), TriangleMesh(np.zeros((0, 3)), np.zeros((0, 3), dtype=int))],
)  # fmt: skip
def test_forms_that_nothing_has_are_refused(form):
    with pytest.raises(InputError, match=r"^shape: "):
        check_form("shape", form)
