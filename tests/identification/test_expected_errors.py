import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.identification.expected_errors import compare, expected, torque_noise
from catenary.identification.fourier import fourier_motion
from catenary.identification.motion_limits import MotionLimits, room_of
from catenary.robots.catalog import load_robot
from catenary.spatial import LEVEL

PLANAR = load_robot("ur5e")
LIMITS = MotionLimits(PLANAR, room_of(PLANAR, lower=np.full(6, -2.0), upper=np.full(6, 2.0)), np.array(LEVEL))


@pytest.fixture(scope="module")
def design():
    return fourier_motion(LIMITS, np.random.default_rng(0), trials=60, rate=50.0)


def test_expected_errors_are_the_spread_of_many_identifications(design):
    rows = design.q[::5], design.qd[::5], design.qdd[::5]
    noise = np.array([3.0, 2.0, 1.0, 0.5, 0.5, 0.2])
    told = expected("designed", design.base, rows, LIMITS.gravity, noise)
    Y = design.base.regressor(*rows, LIMITS.gravity) / noise[:, None]
    Y = Y.reshape(-1, design.n_base)
    rng = np.random.default_rng(1)
    found = np.linalg.lstsq(Y, rng.normal(size=(len(Y), 2000)), rcond=None)[0]  # true parameters are zero
    assert_allclose(found.std(axis=1), told.errors, rtol=0.1)  # of 2,000 draws: 1.6 %


def test_a_designed_motion_is_expected_to_do_better_than_others(design):
    found = compare(LIMITS, design, torque_noise(LIMITS, None), np.random.default_rng(0))
    assert found.designed.condition == pytest.approx(design.condition)
    assert found.designed.hidden == 0
    assert found.random is not None
    assert found.random.condition > design.condition
    assert found.random.times(found.designed)[0] > 1.0
    assert found.single is not None
    assert found.single.hidden > 0  # what couples two joints shows in no motion of one
    assert found.single.condition == np.inf


def test_parameters_that_a_motion_does_not_show_are_not_told_an_error(design):
    rest = np.tile(design.q[:1], (50, 1))
    still = expected("rest", design.base, (rest, 0 * rest, 0 * rest), LIMITS.gravity, np.ones(6))
    assert still.hidden > 20


def test_noise_is_a_hundredth_of_the_torque_limits_unless_given():
    assert_allclose(torque_noise(LIMITS, None), 0.01 * PLANAR.effort_limit)
    assert_allclose(torque_noise(LIMITS, 0.3), 0.3)
    raven = load_robot("raven2")
    limits = MotionLimits(raven, room_of(raven, velocity=[1, 1, 0.1]), np.array(LEVEL))
    assert_allclose(torque_noise(limits, None), 1.0)
