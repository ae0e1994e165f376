from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from catenary.collision.bodies import floor_at
from catenary.collision.contacts import is_free
from catenary.errors import InputError
from catenary.identification.excitation import static_poses
from catenary.identification.motion_limits import MotionLimits, room_of
from catenary.spatial import LEVEL
from colliding_arm import PANDA, apart, capsule_arm

LIMITS = MotionLimits(PANDA, room_of(PANDA), np.array(LEVEL))


def test_poses_stay_within_the_limits_and_follow_from_the_seed():
    first, second = (static_poses(LIMITS, 10, np.random.default_rng(4)) for _ in range(2))
    assert (first.q >= LIMITS.room.lower).all()
    assert (first.q <= LIMITS.room.upper).all()
    assert not first.qd.any()
    assert_array_equal(first.q, second.q)


def test_chosen_poses_are_better_than_random_ones(monkeypatch):
    chosen = [static_poses(LIMITS, 30, np.random.default_rng(seed)).condition for seed in range(3)]
    # each pose the only one looked at
    monkeypatch.setattr("catenary.identification.excitation.CANDIDATES", 1)
    random = [static_poses(LIMITS, 30, np.random.default_rng(seed)).condition for seed in range(10)]
    assert np.median(chosen) < np.median(random)


def test_poses_touch_nothing():
    scene = apart(capsule_arm(), [floor_at(0.2)])
    found = static_poses(replace(LIMITS, scene=scene), 15, np.random.default_rng(0))
    assert is_free(scene, found.q, 0.01).all()


def test_poses_are_refused_where_none_is_free(monkeypatch):
    monkeypatch.setattr("catenary.identification.excitation.ATTEMPTS", 3)
    limits = replace(LIMITS, scene=apart(capsule_arm(), [floor_at(1.5)]))
    with pytest.raises(InputError, match="none of 60 poses within the limits is free"):
        static_poses(limits, 15, np.random.default_rng(0))


def test_too_few_poses_are_refused():
    with pytest.raises(InputError, match=r"2 poses cannot show \d+ base parameters: expected 3 or more"):
        static_poses(LIMITS, 2, np.random.default_rng(0))
