"""Designed poses and motions: what they show and what they keep."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from catenary.collision.bodies import box_at, floor_at
from catenary.errors import InputError, LimitError
from catenary.identification.excitation import fourier_motion, static_poses
from catenary.identification.motion_limits import MotionLimits, room_of
from catenary.spatial import LEVEL
from colliding_arm import PANDA, apart, capsule_arm

LIMITS = MotionLimits(PANDA, room_of(PANDA), np.array(LEVEL))


@pytest.fixture(scope="module")
def motion():
    return fourier_motion(LIMITS, np.random.default_rng(0), trials=20)


def test_a_motion_shows_all_that_the_recordings_of_the_arm_show(motion):
    assert motion.base.count == 64  # published by Gaz et al. 2019 with friction
    assert motion.condition < 100.0


def test_a_motion_above_a_floor_stays_there_and_shows_nearly_as_much():
    scene = apart(capsule_arm(), [floor_at(0.1)])
    kept = fourier_motion(replace(LIMITS, scene=scene), np.random.default_rng(0), trials=40)
    free = fourier_motion(LIMITS, np.random.default_rng(0), trials=40)
    assert kept.checked.clearance.is_kept
    assert scene.keeps_apart(kept.q, 0.01)
    assert not scene.keeps_apart(kept.q, kept.checked.clearance.distance + 0.002)  # between fewer rows
    assert not scene.keeps_apart(free.q, 0.0)  # so that the floor is in the way at all
    assert kept.condition < 2.0 * free.condition


def test_no_motion_is_given_where_none_keeps_clear():
    # free poses lie on both sides of walls that leave no room to move
    walls = [
        box_at(k, [0.35 * x, 0.35 * y, 0.5, 0.12, 0.12, 1.5])
        for k, (x, y) in enumerate([(1, 1), (-1, 1), (1, -1), (-1, -1)])
    ]
    limits = replace(LIMITS, scene=apart(capsule_arm(radius=0.02), walls), margin=0.12)
    with pytest.raises((LimitError, InputError), match=r"no motion found|none of 6000 poses"):
        fourier_motion(limits, np.random.default_rng(0), trials=2)


def test_a_robot_too_weak_for_its_weight_is_refused():
    weak = replace(LIMITS, room=room_of(PANDA, effort=np.full(7, 1e-3)))
    with pytest.raises(InputError, match=r"none of 6000 poses within .* its own weight cannot be held$"):
        fourier_motion(weak, np.random.default_rng(0), trials=2)


@pytest.mark.parametrize("wrong", [{"harmonics": 2}, {"period": -1.0}, {"rate": 1.0}, {"trials": 0}])
def test_motions_that_cannot_be_are_refused(wrong):
    with pytest.raises(InputError, match="fourier: expected"):
        fourier_motion(LIMITS, np.random.default_rng(0), **wrong)


def test_poses_stay_within_the_limits_and_follow_from_the_seed():
    first, second = (static_poses(LIMITS, 10, np.random.default_rng(4)) for _ in range(2))
    assert (first.q >= LIMITS.room.lower).all()
    assert (first.q <= LIMITS.room.upper).all()
    assert not first.qd.any()
    assert_array_equal(first.q, second.q)


@pytest.mark.parametrize(("obstacle", "name"), [(floor_at(0.5), "floor"), (box_at(1, [0, 0, 0.5, 2, 2, 2]), "box 1")])
def test_a_robot_that_stands_in_something_is_refused_by_its_name(monkeypatch, obstacle, name):
    monkeypatch.setattr("catenary.identification.excitation.POSE_ATTEMPTS", 3)
    limits = replace(LIMITS, scene=apart(capsule_arm(), [obstacle]))
    with pytest.raises(InputError, match=f"none of 60 poses .* is free: .* within 10 mm .*{name} in 100 %"):
        static_poses(limits, 15, np.random.default_rng(0))


def test_too_few_poses_are_refused():
    with pytest.raises(InputError, match=r"2 poses cannot show \d+ base parameters: expected 3 or more"):
        static_poses(LIMITS, 2, np.random.default_rng(0))
