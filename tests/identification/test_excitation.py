"""Designed poses and motions: what they show and what they keep."""

import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from catenary.collision.scene import box_at, floor_at
from catenary.dynamics.inverse_dynamics import inverse_dynamics
from catenary.errors import ExcitationError, InputError, LimitError
from catenary.identification.excitation import MotionLimits, fourier_motion, motion_room, series_at_rest, static_poses
from catenary.robots.actuation import Friction
from catenary.robots.catalog import load_robot
from catenary.spatial import LEVEL
from colliding_arm import PANDA, apart, capsule_arm, motion

LIMITS = MotionLimits(PANDA, motion_room(PANDA), np.array(LEVEL))


@pytest.fixture(scope="module")
def designed():
    return fourier_motion(LIMITS, np.random.default_rng(0), trials=20)


def test_a_motion_shows_all_that_the_recordings_of_the_arm_show(designed):
    assert designed.base.count == 64  # published by Gaz et al. 2019 with friction
    assert designed.condition < 100.0


@pytest.mark.parametrize(
    "part",
    [{"presliding": 0.01}, {"stribeck": 0.1}, {"stribeck": 1e-3}, {"load": True}, {"recording": "monday"}],
    ids=str,
)
@pytest.mark.parametrize(
    "design", [lambda *of: fourier_motion(*of, trials=3), lambda *of: static_poses(of[0], 40, of[1])]
)
def test_friction_that_an_identification_found_changes_no_design(part, design):
    actuation = PANDA.actuation
    parts = [Friction(f"{own.name} too", own.combination, **part) for own in actuation.friction]
    added = tuple(parts) if "recording" in part else tuple(replace(own, **part) for own in actuation.friction)
    own = actuation.friction if "recording" in part else ()
    identified = replace(PANDA, actuation=replace(actuation, friction=(*own, *added), values=None))
    plain, same = (design(replace(LIMITS, model=arm), np.random.default_rng(0)) for arm in (PANDA, identified))
    assert plain.base.count == same.base.count
    assert same.condition == pytest.approx(plain.condition)
    assert_array_equal(plain.q, same.q)


def test_what_is_designed_and_shows_no_parameters_is_refused_by_their_names():
    narrow = replace(LIMITS, room=replace(LIMITS.room, upper=LIMITS.room.lower + 1e-8))
    for design in (lambda *of: fourier_motion(*of, trials=3), lambda *of: static_poses(of[0], 40, of[1])):
        with pytest.raises(
            ExcitationError, match=r"shows \d+ of \d+ base parameters \(condition .*least of all \w+"
        ) as caught:
            design(narrow, np.random.default_rng(0))
        assert caught.value.rank < caught.value.n_base


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
    weak = replace(LIMITS, room=motion_room(PANDA, effort=np.full(7, 1e-3)))
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
    monkeypatch.setattr("catenary.identification.excitation._POSE_ATTEMPTS", 3)
    limits = replace(LIMITS, scene=apart(capsule_arm(), [obstacle]))
    with pytest.raises(InputError, match=f"none of 60 poses .* is free: .* within 10 mm .*{name} in 100 %"):
        static_poses(limits, 15, np.random.default_rng(0))


def test_too_few_poses_are_refused():
    with pytest.raises(InputError, match=r"2 poses cannot show \d+ base parameters: expected 3 or more"):
        static_poses(LIMITS, 2, np.random.default_rng(0))


def series(seed, harmonics, period):
    return series_at_rest(np.random.default_rng(seed).normal(size=(2, harmonics, 3)), period)


@given(st.integers(0, 10**6), st.integers(3, 9), st.floats(0.5, 60.0))
def test_nothing_exceeds_the_bounds_at_any_instant(seed, harmonics, period):
    one = series(seed, harmonics, period)
    q, qd, qdd = one.sample(np.random.default_rng(1).uniform(0.0, period, 2000))
    low, high, fastest = one.extremes()
    scale = 1e-9 * period
    assert (q >= low - scale).all()
    assert (q <= high + scale).all()
    assert (np.abs(qd) <= fastest + 1e-9).all()
    assert (np.abs(qdd) <= one.acceleration_bound * (1 + 1e-9)).all()
    # and the bounds are not far off
    assert (high - low <= 1.05 * np.ptp(one.sample(np.linspace(0, period, 4000))[0], axis=0)).all()


@given(st.integers(0, 10**6), st.integers(3, 9))
def test_a_series_begins_and_ends_at_rest(seed, harmonics):
    one = series(seed, harmonics, 10.0)
    q, qd, qdd = one.sample(np.array([0.0, 10.0]))
    assert_allclose(qd, 0.0, atol=1e-12)
    assert_allclose(qdd, 0.0, atol=1e-11)
    assert_allclose(q[0], q[1], atol=1e-11)


ROOM = motion_room(PANDA)
BOUNDS = MotionLimits(PANDA, ROOM, np.array(LEVEL))


@given(st.integers(0, 10**6), st.floats(0.02, 1.0), st.floats(0.3, 1.0), st.floats(1.0, 6.0))
@settings(max_examples=4)
def test_designed_motions_keep_every_limit_whatever_they_are(seed, slow, weak, brisk):
    room = motion_room(
        PANDA,
        velocity=slow * PANDA.velocity_limit,
        effort=np.maximum(weak * PANDA.effort_limit, [1, 60, 1, 30, 1, 5, 1]),  # what its weight needs
        acceleration=np.full(7, brisk),
    )
    limits = MotionLimits(PANDA, room, np.array(LEVEL))
    motion = fourier_motion(limits, np.random.default_rng(seed), trials=6)
    q, qd, qdd = motion.series.sample(np.linspace(0.0, 10.0, 5000))
    assert (q >= room.lower).all()
    assert (q <= room.upper).all()
    assert (np.abs(qd) <= room.velocity).all()
    assert (np.abs(qdd) <= room.acceleration).all()
    torque = np.abs(inverse_dynamics(PANDA, q, qd, qdd, LEVEL))
    assert (torque <= room.effort).all()
    assert_allclose(motion.checked.torque, (torque / room.effort).max(axis=0), rtol=0.01)  # between a thousand rows


@pytest.mark.parametrize(
    ("room", "message"),
    [
        (replace(ROOM, upper=ROOM.lower + 0.5), "q1 exceeds its upper limit"),
        (replace(ROOM, lower=ROOM.upper - 0.5), "q1 falls below its lower limit"),
        (replace(ROOM, velocity=np.full(7, 0.1)), "q1 exceeds its limit of velocity"),
        (replace(ROOM, acceleration=np.full(7, 0.1)), "q1 exceeds its limit of acceleration"),
        (replace(ROOM, effort=np.full(7, 20.0)), r"q2 needs \d\.\d\d of its torque limit"),
    ],
)
def test_a_motion_that_breaks_a_limit_is_told_which(room, message):
    path = motion(PANDA, 0)
    assert BOUNDS.check(path).fault is None
    fault = replace(BOUNDS, room=room).check(path).fault
    assert fault is not None
    assert re.match(message, fault)


def test_a_motion_that_hits_something_is_told_what_and_when():
    limits = replace(BOUNDS, scene=apart(capsule_arm(), [floor_at(0.3)]), margin=0.02)
    checked = limits.check(motion(PANDA, 0, centre=np.array([0.0, 1.0, 0.0, -1.8, 0.0, 1.8, 0.0]), amplitude=0.6))
    assert "floor" in checked.clearance.pair
    assert re.search(r"come within 20 mm: -?\d+\.\d mm at \d\.\d{3} s", checked.fault)


def test_poses_whose_weight_cannot_be_held_are_not_free():
    weak = replace(BOUNDS, room=replace(ROOM, effort=np.full(7, 15.0)))
    q = np.array([[0, 1.5, 0, -0.5, 0, 1.5, 0], [0, 0, 0, -0.1, 0, 0.1, 0]], dtype=float)
    assert len(weak.free_poses(q)) == 1  # stretched out it is too heavy, upright it is not
    assert len(BOUNDS.free_poses(q)) == 2


@pytest.mark.parametrize(
    ("name", "limits", "message"),
    [
        ("panda", {"lower": np.full(7, -3.0)}, "the limits given go beyond the robot's own"),
        ("panda", {"effort": np.full(7, 1000.0)}, "the limits given go beyond the robot's own"),
        ("panda", {"velocity": np.zeros(7)}, "a velocity above zero"),
        ("panda", {"acceleration": np.zeros(7)}, "limits of acceleration and torque above zero"),
        ("panda", {"upper": np.zeros(6)}, "upper: expected shape (7,)"),
        ("panda", {"upper": np.full(7, np.nan)}, "no upper limit of q1"),
        ("dvrk_psm_motors", {}, "no lower limit of q1: give --lower for all 7 joints"),
    ],
)
def test_limits_that_cannot_be_are_refused(name, limits, message):
    with pytest.raises(InputError) as caught:
        motion_room(load_robot(name), **limits)
    assert message in str(caught.value)
