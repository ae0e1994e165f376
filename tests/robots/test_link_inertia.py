import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from catenary.robots.link_inertia import LinkInertia, is_negative, unphysical
from catenary.spatial import Pose, rotation_from_rpy
from oracles.point_masses import cloud, inertia_of

seeds = st.integers(0, 2**32 - 1)


def random_pose(rng):
    return Pose(rotation_from_rpy(rng.normal(size=3)), rng.normal(size=3))


def test_a_body_of_which_one_part_has_no_inertia_has_none():
    whole = LinkInertia(1.0, np.array([0.2, 0.0, 0.0]), np.eye(3))
    part = LinkInertia(3.0, np.array([0.0, 0.4, 0.0]), None)
    turned = Pose(rotation_from_rpy([0.1, 0.2, 0.3]), np.ones(3))
    for both in (whole.plus(part), part.plus(whole)):
        assert both.inertia is None
        assert both.mass == 4.0
        np.testing.assert_allclose(both.com, [0.05, 0.3, 0.0])
    assert part.moved(turned).inertia is None


@given(seeds)
def test_no_cloud_of_masses_has_an_inertia_that_no_body_has_whatever_digits_a_file_keeps(seed):
    body = inertia_of(*cloud(np.random.default_rng(seed)))
    rounded = np.array([float(f"{value:.7g}") for value in body.inertia.ravel()]).reshape(3, 3)
    assert unphysical(body.mass, rounded) is None
    rod = body.mass * np.diag([1.0, 1.0, -1e-20])  # of no width, but for rounding
    assert unphysical(body.mass, rod) is None


@given(seeds, st.floats(1e-3, 1.0))
def test_moments_that_are_negative_or_larger_than_the_sum_of_the_others_are_told(seed, beyond):
    rng = np.random.default_rng(seed)
    R = random_pose(rng).rotation
    a, b = rng.uniform(0.1, 1.0, 2)
    too_large = R @ np.diag([a, b, (a + b) * (1.0 + beyond)]) @ R.T
    negative = R @ np.diag([a, b, -beyond * min(a, b)]) @ R.T
    assert "larger than the sum" in unphysical(1.0, too_large)
    assert not is_negative(1.0, too_large)
    assert "negative principal moment" in unphysical(1.0, negative)
    assert is_negative(1.0, negative)
