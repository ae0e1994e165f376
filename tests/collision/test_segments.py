import coal
import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.optimize import lsq_linear

from catenary.collision.segments import segment_distance
from catenary.robots.geometry import capsule_between


def ends(seed, scale=1.0):
    return scale * np.random.default_rng(seed).normal(size=(4, 3))


@given(st.integers(0, 10**6))
def test_no_points_of_two_segments_are_closer_and_some_are_as_close(seed):
    p0, p1, q0, q1 = ends(seed)
    found = segment_distance(p0, p1, q0, q1)
    sides = np.column_stack([p1 - p0, q0 - q1])
    best = lsq_linear(sides, q0 - p0, bounds=(0.0, 1.0), tol=1e-14)  # shares of both segments
    assert_allclose(found, np.sqrt(2.0 * best.cost), atol=1e-6)


@given(st.integers(0, 10**6), st.floats(0.01, 0.3), st.floats(0.01, 0.3))
def test_capsules_are_as_far_apart_as_coal_says(seed, one, other):
    p0, p1, q0, q1 = ends(seed, 2.0)
    forms = [capsule_between(p0, p1, one), capsule_between(q0, q1, other)]
    bodies = [(coal.Capsule(*form), coal.Transform3s(*pose)) for pose, form in forms]
    request, result = coal.DistanceRequest(), coal.DistanceResult()
    theirs = coal.distance(*bodies[0], *bodies[1], request, result)
    ours = float(segment_distance(p0, p1, q0, q1)) - one - other
    if ours > 1e-3:  # what overlaps has many depths
        assert_allclose(ours, theirs, atol=1e-5)  # Coal's tolerance


def test_degenerate_segments_are_points():
    zero, x, y = np.zeros(3), np.array([1.0, 0, 0]), np.array([0, 1.0, 0])
    assert_allclose(segment_distance(zero, zero, x, x), 1.0)
    assert_allclose(segment_distance(zero, zero, x, x + y), 1.0)
    assert_allclose(segment_distance(x - y, x + y, zero, zero), 1.0)
    assert_allclose(segment_distance(zero, x, y, x + y), 1.0)  # parallel
    assert_allclose(segment_distance(zero, x, 3 * x, 4 * x), 2.0)  # on one line
    assert_allclose(segment_distance(-x, x, y * -1, y), 0.0, atol=1e-12)  # crossing


def test_many_pairs_at_once_are_the_same_as_one_by_one():
    many = np.random.default_rng(0).normal(size=(4, 5, 7, 3))
    found = segment_distance(*many)
    assert found.shape == (5, 7)
    assert_allclose(found[2, 3], segment_distance(*many[:, 2, 3]))
