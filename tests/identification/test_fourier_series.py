import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from catenary.identification.fourier_series import series_at_rest


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
