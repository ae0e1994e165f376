import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.dynamics.kinematics import forward_kinematics
from catenary.dynamics.workspace import reachable_points
from catenary.errors import InputError
from catenary.robots.catalog import load_robot


def test_a_planar_arm_reaches_a_ring_between_its_lengths_difference_and_sum() -> None:
    points = reachable_points(load_robot("two_link"), count=2_000, rng=np.random.default_rng(1))
    assert_allclose(points[:, 1], 0.0, atol=1e-12)  # it moves in the x-z plane
    distances = np.linalg.norm(points, axis=1)
    assert distances.max() <= 1.5 + 1e-12  # lengths of 1 and 0.5 m
    assert distances.min() >= 0.5 - 1e-12
    assert_allclose(distances.max(), 1.5, rtol=1e-4)  # random, close to either end
    assert_allclose(distances.min(), 0.5, rtol=1e-4)


def test_a_slide_goes_to_its_limits_and_no_farther() -> None:
    # all axes of RAVEN-II meet at the base: its slide alone says how far the wrist is
    raven = load_robot("raven2")
    at_limits = [
        np.linalg.norm(forward_kinematics(raven, [0.3, 1.0, slide]).position)
        for slide in (raven.lower[2], raven.upper[2])
    ]
    distances = np.linalg.norm(reachable_points(raven, rng=np.random.default_rng(2)), axis=1)
    assert_allclose(distances.max(), max(at_limits), rtol=1e-12)


def test_a_joint_that_slides_without_limits_is_refused_by_name() -> None:
    with pytest.raises(InputError, match='joint "q3" slides without limits'):
        reachable_points(load_robot("dvrk_psm_motors"), rng=np.random.default_rng(0))
