import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from catenary.transmission.drift import LARGEST_LOSS, loss_rate, set_rate

tensions = st.floats(-100.0, 100.0)


def test_set_nears_its_largest_value_exponentially_with_travel():
    slack, rate, most, step = 0.0, 1e-3, 0.02, 0.01
    for _ in range(2000):  # 20 rad of travel without tension
        slack += step * set_rate(0.0, 1.5, 1.0, 1.0, slack, rate, most)
    assert_allclose(slack, most * (1.0 - math.exp(-0.5 * rate * 20.0 / most)), rtol=1e-3)  # Euler steps


@given(tensions)
def test_set_grows_with_tension_on_the_side_on_which_the_cable_is_laid(tension):
    plus = set_rate(tension, 1.5, 1.0, 1.0, 0.0, 1.0, 1.0)
    minus = set_rate(tension, 1.5, -1.0, 1.0, 0.0, 1.0, 1.0)
    assert_allclose(plus - minus, 2.0 * tension / 1.5, atol=1e-9)
    assert_allclose(plus + minus, 1.0, atol=1e-9)


@given(tensions, st.floats(0.0, 5.0), st.floats(0.0, LARGEST_LOSS))
def test_stiffness_is_lost_and_never_regained_and_nothing_happens_at_rest(tension, speed, loss):
    assert loss_rate(tension, 1.5, speed, loss, 1e-4) >= 0.0
    assert (
        loss_rate(tension, 1.5, 0.0, loss, 1e-4) == set_rate(tension, 1.5, 1.0, 0.0, 0.0, 1e-3, 0.02) == 0.0
    )


def test_loss_of_stiffness_ends_at_its_largest_share():
    loss = 0.0
    for _ in range(3000):
        loss += loss_rate(6.0, 1.5, 1.0, loss, 1e-3)
    assert_allclose(loss, LARGEST_LOSS * (1.0 - np.exp(-4e-3 * 3000 / LARGEST_LOSS)), rtol=1e-6)
