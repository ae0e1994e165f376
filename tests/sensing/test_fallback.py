import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from catenary.sensing.fallback import SlowAttitude, SmoothTransfer
from catenary.sensing.gravity_vector import tilted_gravity


def transfer(follow=100.0, recover=10.0):
    return SmoothTransfer(np.array([follow]), np.array([recover]))


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 500))
def test_nothing_leaps_whatever_the_targets_do(seed):
    rng = np.random.default_rng(seed)
    smooth, last = transfer(), None
    for _ in range(200):
        out = smooth.follow(30.0 * rng.normal(size=(1, 3)), 0.001, changed=bool(rng.integers(2)))
        assert np.isfinite(out).all()
        if last is not None:
            assert np.linalg.norm(out - last) <= 0.11 + 1e-9
        last = out


def test_targets_that_move_slowly_are_followed_exactly():
    smooth = transfer()
    assert_allclose(smooth.follow(np.full((1, 3), 9.0), 0.001, changed=True), 9.0)  # the first as it is
    smooth = transfer()
    for k in range(100):
        target = np.full((1, 3), 0.05 * k)
        out = smooth.follow(target, 0.001, changed=False)
        assert_allclose(out, target)


def test_another_source_is_approached_at_the_rate_of_recovery():
    smooth = transfer()
    out = smooth.follow(np.zeros((1, 3)), 0.001, changed=False)
    for k in range(1, 500):
        out = smooth.follow(np.array([[3.0, 0.0, 0.0]]), 0.001, changed=k == 1)
        assert_allclose(out[0], [min(3.0, 0.01 * k), 0.0, 0.0], atol=1e-9)


def test_the_mean_direction_of_a_rocking_base_is_where_it_rocks_about():
    slow = SlowAttitude(2.0)
    for t in np.arange(0.0, 10.0, 0.01):
        slow.add(t, tilted_gravity(0.3 + 0.1 * np.sin(2.0 * np.pi * t), 0.0))
    # 1 Hz through a low-pass of 2 s keeps 1 / (2 pi 2) of 0.1 rad
    assert_allclose(slow.gravity(), tilted_gravity(0.3, 0.0), atol=9.81 * 0.1 / 12.0)
    assert np.linalg.norm(slow.gravity()) == pytest.approx(9.81)
