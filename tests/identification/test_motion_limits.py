import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from catenary.collision.bodies import floor_at
from catenary.dynamics.inverse_dynamics import inverse_dynamics
from catenary.errors import InputError
from catenary.identification.excitation import fourier_motion
from catenary.identification.motion_limits import MotionLimits, room_of
from catenary.robots.catalog import load_robot
from catenary.spatial import LEVEL
from colliding_arm import PANDA, apart, capsule_arm, motion

ROOM = room_of(PANDA)
LIMITS = MotionLimits(PANDA, ROOM, np.array(LEVEL))


@given(st.integers(0, 10**6), st.floats(0.02, 1.0), st.floats(0.3, 1.0), st.floats(1.0, 6.0))
@settings(max_examples=4)
def test_designed_motions_keep_every_limit_whatever_they_are(seed, slow, weak, brisk):
    room = room_of(
        PANDA,
        velocity=slow * PANDA.velocity_limit,
        effort=np.maximum(weak * PANDA.effort_limit, [1, 60, 1, 30, 1, 5, 1]),  # what its weight needs
        acceleration=np.full(7, brisk),
    )
    limits = MotionLimits(PANDA, room, np.array(LEVEL))
    found = fourier_motion(limits, np.random.default_rng(seed), trials=6)
    q, qd, qdd = found.series.sample(np.linspace(0.0, 10.0, 5000))
    assert (q >= room.lower).all()
    assert (q <= room.upper).all()
    assert (np.abs(qd) <= room.velocity).all()
    assert (np.abs(qdd) <= room.acceleration).all()
    torque = np.abs(inverse_dynamics(PANDA, q, qd, qdd, LEVEL))
    assert (torque <= room.effort).all()
    assert_allclose(found.checked.torque, (torque / room.effort).max(axis=0), rtol=0.01)  # between a thousand rows


@pytest.mark.parametrize(
    ("room", "said"),
    [
        (replace(ROOM, upper=ROOM.lower + 0.5), "q1 exceeds its upper limit"),
        (replace(ROOM, lower=ROOM.upper - 0.5), "q1 falls below its lower limit"),
        (replace(ROOM, velocity=np.full(7, 0.1)), "q1 exceeds its limit of velocity"),
        (replace(ROOM, acceleration=np.full(7, 0.1)), "q1 exceeds its limit of acceleration"),
        (replace(ROOM, effort=np.full(7, 20.0)), r"q2 needs \d\.\d\d of its torque limit"),
    ],
)
def test_a_motion_that_breaks_a_limit_is_told_which(room, said):
    path = motion(PANDA, 0)
    assert LIMITS.check(path).fault is None
    fault = replace(LIMITS, room=room).check(path).fault
    assert fault is not None
    assert re.match(said, fault)


def test_a_motion_that_hits_something_is_told_what_and_when():
    limits = replace(LIMITS, scene=apart(capsule_arm(), [floor_at(0.3)]), margin=0.02)
    checked = limits.check(motion(PANDA, 0, centre=np.array([0.0, 1.0, 0.0, -1.8, 0.0, 1.8, 0.0]), amplitude=0.6))
    assert "floor" in checked.clearance.pair
    assert re.search(r"come within 20 mm: -?\d+\.\d mm at \d\.\d{3} s", checked.fault)


def test_poses_whose_weight_cannot_be_held_are_not_free():
    weak = replace(LIMITS, room=replace(ROOM, effort=np.full(7, 15.0)))
    q = np.array([[0, 1.5, 0, -0.5, 0, 1.5, 0], [0, 0, 0, -0.1, 0, 0.1, 0]], dtype=float)
    assert len(weak.free_poses(q)) == 1  # stretched out it is too heavy, upright it is not
    assert len(LIMITS.free_poses(q)) == 2


@pytest.mark.parametrize(
    ("name", "limits", "said"),
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
def test_limits_that_cannot_be_are_refused(name, limits, said):
    with pytest.raises(InputError) as caught:
        room_of(load_robot(name), **limits)
    assert said in str(caught.value)
