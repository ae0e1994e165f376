import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from catenary.sensing.gravity_vector import tilted_gravity
from catenary.sensing.gyro_prediction import RestRate

BIAS = np.array([0.03, -0.02, 0.01])


def drawn(rates, gravity=(0.0, 0.0, -9.81), hz=100.0):
    rest = RestRate(0.15)
    for k, rate in enumerate(rates):
        rest.add(k / hz, rate, gravity and np.array(gravity))
    return rest.bias


def test_a_bias_is_learnt_at_rest(rng):
    rates = BIAS + 0.001 * rng.normal(size=(3000, 3))
    assert_allclose(drawn(rates), BIAS, atol=5e-4)  # 30 s are 5.6 time constants after the first two


@pytest.mark.parametrize("amplitude", [0.05, 0.5])
def test_nothing_is_learnt_of_a_base_that_rocks(amplitude):
    turning = amplitude * np.sin(0.2 * np.pi * np.arange(0.0, 20.0, 0.01))  # 0.1 Hz
    assert np.abs(drawn(np.outer(turning, [1.0, 0.0, 0.0]))).max() < 0.1 * amplitude


def test_a_slow_even_turn_about_the_horizontal_is_no_bias():
    rest, rate = RestRate(0.15), np.array([0.09, 0.0, 0.0])  # 5 deg/s
    for t in np.arange(0.0, 10.0, 0.01):
        rest.add(t, rate, tilted_gravity(0.09 * t, 0.0))
    assert_array_equal(rest.bias, np.zeros(3))


def test_nothing_is_learnt_while_gravity_moves_or_of_what_is_too_fast_for_a_bias():
    assert_array_equal(drawn(np.tile(BIAS, (1000, 1)), None), np.zeros(3))
    assert_array_equal(drawn(np.tile(10.0 * BIAS, (1000, 1))), np.zeros(3))
