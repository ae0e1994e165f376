import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.devices.board_clock import WRAP, BoardClock


def stamps(taken, arrivals, *, speed=1.0, start=0):
    """What the clock makes of samples taken at host times, on a board whose clock runs at another speed."""
    clock = BoardClock()
    return np.array(
        [clock.stamp(round(start + 1e6 * speed * t) % WRAP, a) for t, a in zip(taken, arrivals, strict=True)]
    )


@pytest.mark.parametrize("speed", [1.0, 0.995, 1.005])
def test_jitter_of_the_line_does_not_reach_the_stamps(speed):
    rng = np.random.default_rng(0)
    taken = np.arange(0.0, 60.0, 0.01)
    arrivals = taken + 0.001 + rng.exponential(0.004, len(taken))
    late = stamps(taken, arrivals, speed=speed) - taken
    # once settled; between two undelayed samples, ten apart, the offset may drift by 1 % of 0.1 s, and more by chance
    assert late[200:].min() > 0.0
    assert late[200:].max() < 0.006
    assert np.std(late[200:]) < 0.001
    assert np.std(arrivals - taken) > 0.003


def test_the_boards_clock_may_wrap():
    taken = np.arange(0.0, 4.0, 0.01)
    assert_allclose(stamps(taken, taken + 0.002, start=WRAP - 2_000_000), taken + 0.002, atol=2e-6)


def test_a_restarted_board_is_followed_and_counted():
    clock = BoardClock()
    for k in range(100):
        clock.stamp(50_000_000 + 10_000 * k, 0.01 * k)
    assert clock.stamp(1000, 3.0) == pytest.approx(3.0)
    assert clock.stamp(11000, 3.01) == pytest.approx(3.01)
    assert clock.restarts == 1


def test_samples_that_come_in_one_piece_are_as_far_apart_as_they_were_taken():
    clock = BoardClock()
    clock.stamp(0, 0.0)
    piece = [clock.stamp(10_000 * k, 0.05) for k in range(1, 6)]
    assert_allclose(np.diff(piece), 0.01, atol=5e-4)  # the offset may drift by 1 % of 50 ms
