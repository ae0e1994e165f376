import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from catenary.errors import InputError
from catenary.identification.excitation import fourier_motion, room_of, static_poses
from catenary.robots.catalog import load_robot

PANDA = load_robot("panda")


@pytest.fixture(scope="module")
def room():
    return room_of(PANDA)


@pytest.fixture(scope="module")
def motion(room):
    return fourier_motion(PANDA, room, np.random.default_rng(0), trials=40)


def test_a_motion_stays_within_the_limits(motion, room):
    assert (motion.q >= room.lower).all()
    assert (motion.q <= room.upper).all()
    assert (np.abs(motion.qd) <= room.velocity).all()


def test_a_motion_begins_and_ends_at_rest_in_one_pose(motion):
    for end in (0, -1):
        assert_allclose(motion.qd[end], 0.0, atol=1e-12)
        assert_allclose(motion.qdd[end], 0.0, atol=1e-11)
    assert_allclose(motion.q[0], motion.q[-1], atol=1e-12)


def test_velocities_and_accelerations_are_derivatives(motion):
    step = motion.time[1]
    assert_allclose(motion.qd[1:-1], (motion.q[2:] - motion.q[:-2]) / (2 * step), atol=1e-3)  # (5 w h)^2 / 6
    assert_allclose(motion.qdd[1:-1], (motion.qd[2:] - motion.qd[:-2]) / (2 * step), atol=1e-2)


def test_more_trials_show_more(motion, room):
    better = fourier_motion(PANDA, room, np.random.default_rng(0), trials=200)
    assert better.condition < motion.condition


def test_a_motion_shows_all_that_the_recordings_of_the_arm_show(motion):
    assert motion.n_base == 64  # published by Gaz et al. 2019 with friction
    assert motion.condition < 100.0


def test_poses_stay_within_the_limits_and_follow_from_the_seed(room):
    first, second = (static_poses(PANDA, 10, room, np.random.default_rng(4)) for _ in range(2))
    assert (first.q >= room.lower).all()
    assert (first.q <= room.upper).all()
    assert not first.qd.any()
    assert_array_equal(first.q, second.q)


def test_chosen_poses_are_better_than_random_ones(room, monkeypatch):
    chosen = [static_poses(PANDA, 30, room, np.random.default_rng(seed)).condition for seed in range(3)]
    monkeypatch.setattr(
        "catenary.identification.excitation.CANDIDATES", 1
    )  # each pose the only one looked at
    random = [static_poses(PANDA, 30, room, np.random.default_rng(seed)).condition for seed in range(10)]
    assert np.median(chosen) < np.median(random)


def test_limits_may_be_narrower_than_the_robots(room):
    narrow = room_of(PANDA, velocity=np.full(7, 0.3))
    motion = fourier_motion(PANDA, narrow, np.random.default_rng(0), trials=5)
    assert np.abs(motion.qd).max() <= 0.3


@pytest.mark.parametrize(
    ("name", "limits", "said"),
    [
        ("panda", {"lower": np.full(7, -3.0)}, "the limits given go beyond the robot's own"),
        ("panda", {"velocity": np.zeros(7)}, "a velocity above zero"),
        ("panda", {"upper": np.zeros(6)}, "upper: expected shape (7,)"),
        ("panda", {"upper": np.full(7, np.nan)}, "no upper limit of q1"),
        ("dvrk_psm", {}, "no lower limit of q1: give --lower for all 7 joints"),
    ],
)
def test_limits_that_cannot_be_are_refused(name, limits, said):
    with pytest.raises(InputError) as caught:
        room_of(load_robot(name), **limits)
    assert said in str(caught.value)


def test_too_few_poses_are_refused(room):
    with pytest.raises(InputError, match=r"2 poses cannot show \d+ base parameters: expected 3 or more"):
        static_poses(PANDA, 2, room, np.random.default_rng(0))


@pytest.mark.parametrize("wrong", [{"harmonics": 2}, {"period": -1.0}, {"rate": 1.0}, {"trials": 0}])
def test_motions_that_cannot_be_are_refused(room, wrong):
    with pytest.raises(InputError, match="fourier: expected"):
        fourier_motion(PANDA, room, np.random.default_rng(0), **wrong)
