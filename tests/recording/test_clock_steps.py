"""Clocks that are set while they are recorded from."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from catenary.recording.series import SECOND, without_steps

START = 1_700_000_000 * SECOND
ROWS, PERIOD, DELAY = 600, SECOND // 100, 2_000_000  # [ns]
TRUE = START + PERIOD * np.arange(ROWS)
HOUR = 3600 * SECOND


def arrivals(rng: np.random.Generator) -> np.ndarray:
    """In order, up to a millisecond later than they might be."""
    return np.maximum.accumulate(TRUE + DELAY + rng.integers(0, 1_000_000, ROWS))


def set_at(clock: np.ndarray, at: int, by: int) -> np.ndarray:
    return np.concatenate([clock[:at], clock[at:] + by])


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(3)


@pytest.mark.parametrize("by", [HOUR, -HOUR, SECOND, -SECOND, SECOND // 2, -SECOND // 2, 2 * SECOND, -2 * SECOND])
@pytest.mark.parametrize("at", [3, 300, ROWS - 3])
def test_a_robot_whose_clock_is_set_keeps_its_time_within_a_millisecond(rng, by: int, at: int) -> None:
    stamp, steps = without_steps(set_at(TRUE, at, by), arrivals(rng))
    assert_allclose(stamp, TRUE, atol=1_000_000)
    assert_array_equal(stamp[:at], TRUE[:at])
    ((when, how_far),) = steps
    assert abs(how_far - by) < 1_000_000
    assert abs(when - TRUE[at]) < 4_000_000


@pytest.mark.parametrize("by", [HOUR, -HOUR, 2 * SECOND, -2 * SECOND])
def test_a_recorder_whose_clock_is_set_leaves_stamps_alone(rng, by: int) -> None:
    stamp, steps = without_steps(TRUE, set_at(arrivals(rng), 300, by))
    assert_array_equal(stamp, TRUE)
    assert steps == ()


def test_one_clock_of_both_that_is_set_back_among_stamps_that_were_there_is_seen(rng) -> None:
    by = -2 * SECOND
    stamp, _ = without_steps(set_at(TRUE, 300, by), set_at(arrivals(rng), 300, by))
    assert_allclose(stamp, TRUE, atol=2 * PERIOD)
    assert (np.diff(stamp) > 0).all()


def test_clocks_that_are_set_several_times_are_followed(rng) -> None:
    clock = set_at(set_at(set_at(TRUE, 100, -HOUR), 200, 2 * HOUR), 450, -SECOND)
    stamp, steps = without_steps(clock, arrivals(rng))
    assert_allclose(stamp, TRUE, atol=1_000_000)
    assert_allclose([step.by / SECOND for step in steps], [-3600.0, 7200.0, -1.0], atol=1e-3)


def test_topics_of_one_clock_stay_as_near_to_one_another_as_they_were_stamped(rng) -> None:
    _, steps = without_steps(set_at(TRUE, 300, -HOUR), arrivals(rng))
    other, _ = without_steps(set_at(TRUE + 7, 300, -HOUR), arrivals(rng) + 5_000_000, steps)
    assert_array_equal(np.diff(other)[300:], np.diff(TRUE)[300:])
    assert (other - TRUE)[-1] == 7 - HOUR - steps[0].by


def test_stamps_that_stand_still_to_stay_in_order_go_on_by_arrival(rng) -> None:
    clock = TRUE.copy()
    clock[300:500] = clock[299] + 1 + np.arange(200)
    clock[500:] -= HOUR  # at last it has caught up
    stamp, steps = without_steps(clock, arrivals(rng))
    assert_allclose(stamp, TRUE, atol=2_000_000)
    assert len(steps) == 2


@pytest.mark.parametrize("case", ["late", "lost", "stalled", "shuffled", "files in another order", "a pause", "few"])
def test_what_is_no_clock_that_was_set_changes_nothing(rng, case: str) -> None:
    stamp, arrival = TRUE.copy(), arrivals(rng)
    if case == "late":  # one that was held back for two seconds
        order = np.concatenate([np.arange(100), np.arange(101, 301), [100], np.arange(301, ROWS)])
        stamp = stamp[order]
    elif case == "lost":
        stamp, arrival = np.delete(stamp, slice(200, 400)), np.delete(arrival, slice(200, 400))
    elif case == "stalled":  # for three seconds; then what had waited comes at once, and all but a second of it is lost
        arrival[200:300] = arrival[500]
        stamp, arrival = np.delete(stamp, slice(300, 500)), np.delete(arrival, slice(300, 500))
    elif case == "shuffled":
        stamp[100:120] = rng.permutation(stamp[100:120])
    elif case == "files in another order":
        order = np.concatenate([np.arange(300, ROWS), np.arange(300)])
        stamp, arrival = stamp[order], arrival[order]
    elif case == "a pause":
        stamp[300:] += HOUR
        arrival[300:] += HOUR
    else:
        stamp, arrival = set_at(stamp[:5], 3, HOUR), arrival[:5]
    found, steps = without_steps(stamp, arrival)
    assert_array_equal(found, stamp)
    assert steps == ()
