from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.collision.bodies import box_at, floor_at
from catenary.errors import InputError, LimitError
from catenary.identification.fourier import fourier_motion
from catenary.identification.motion_limits import MotionLimits, room_of
from catenary.spatial import LEVEL
from colliding_arm import PANDA, apart, capsule_arm

LIMITS = MotionLimits(PANDA, room_of(PANDA), np.array(LEVEL))


@pytest.fixture(scope="module")
def motion():
    return fourier_motion(LIMITS, np.random.default_rng(0), trials=40)


def test_a_motion_begins_and_ends_at_rest_in_one_pose(motion):
    for end in (0, -1):
        assert_allclose(motion.qd[end], 0.0, atol=1e-12)
        assert_allclose(motion.qdd[end], 0.0, atol=1e-11)
    assert_allclose(motion.q[0], motion.q[-1], atol=1e-12)


def test_velocities_and_accelerations_are_derivatives(motion):
    step = motion.time[1]
    assert_allclose(motion.qd[1:-1], (motion.q[2:] - motion.q[:-2]) / (2 * step), atol=1e-3)  # (5 w h)^2 / 6
    assert_allclose(motion.qdd[1:-1], (motion.qd[2:] - motion.qd[:-2]) / (2 * step), atol=1e-2)


def test_more_trials_show_more(motion):
    better = fourier_motion(LIMITS, np.random.default_rng(0), trials=200)
    assert better.condition < motion.condition


def test_a_motion_shows_all_that_the_recordings_of_the_arm_show(motion):
    assert motion.n_base == 64  # published by Gaz et al. 2019 with friction
    assert motion.condition < 100.0


def test_limits_may_be_narrower_than_the_robots():
    narrow = replace(LIMITS, room=room_of(PANDA, velocity=np.full(7, 0.3)))
    assert np.abs(fourier_motion(narrow, np.random.default_rng(0), trials=5).qd).max() <= 0.3


def test_a_motion_above_a_floor_stays_there_and_shows_nearly_as_much():
    scene = apart(capsule_arm(), [floor_at(0.1)])
    kept = fourier_motion(replace(LIMITS, scene=scene), np.random.default_rng(0), trials=150)
    free = fourier_motion(LIMITS, np.random.default_rng(0), trials=150)
    assert kept.checked.clearance.is_kept
    bounds = scene.lower_bounds(scene.place(kept.q))
    assert bounds.min() >= 0.01
    assert kept.checked.clearance.distance == pytest.approx(bounds.min(), abs=0.002)  # between fewer rows
    assert scene.lower_bounds(scene.place(free.q)).min() < 0.0  # so that the floor is in the way at all
    assert kept.condition < 2.0 * free.condition


def test_no_motion_is_given_where_none_keeps_clear():
    # free poses lie on both sides of walls that leave no room to move
    walls = [
        box_at(k, [0.35 * x, 0.35 * y, 0.5, 0.12, 0.12, 1.5])
        for k, (x, y) in enumerate([(1, 1), (-1, 1), (1, -1), (-1, -1)])
    ]
    limits = replace(LIMITS, scene=apart(capsule_arm(radius=0.02), walls), margin=0.12)
    with pytest.raises((LimitError, InputError), match=r"no motion found|in none of 300 poses"):
        fourier_motion(limits, np.random.default_rng(0), trials=2)


def test_a_robot_too_weak_for_its_weight_is_refused():
    weak = replace(LIMITS, room=room_of(PANDA, effort=np.full(7, 1e-3)))
    with pytest.raises(InputError, match="in none of 300 poses within the limits can its own weight be held"):
        fourier_motion(weak, np.random.default_rng(0), trials=2)


@pytest.mark.parametrize("wrong", [{"harmonics": 2}, {"period": -1.0}, {"rate": 1.0}, {"trials": 0}])
def test_motions_that_cannot_be_are_refused(wrong):
    with pytest.raises(InputError, match="fourier: expected"):
        fourier_motion(LIMITS, np.random.default_rng(0), **wrong)
