"""Samples with stamps in order, interpolated, without the steps of clocks that are set while they are recorded from."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from catenary.errors import InputError
from catenary.recording.import_formats.sampled_signals import clean_series, interpolate, without_steps
from catenary.topics import SECOND

EPOCH = 1_700_000_000_000_000_000


def _ns(seconds: object) -> np.ndarray:
    return EPOCH + np.rint(np.asarray(seconds, dtype=float) * 1e9).astype(np.int64)


@given(
    stamps=st.lists(st.integers(0, 10**10), min_size=2, max_size=40, unique=True),
    wanted=st.lists(st.integers(-(10**9), 11 * 10**9), min_size=1, max_size=40),
    slope=st.floats(-10, 10),
    offset=st.floats(-10, 10),
    shuffle=st.randoms(use_true_random=False),
)
def test_linear_signals_are_interpolated_exactly(stamps, wanted, slope, offset, shuffle) -> None:
    shuffle.shuffle(stamps)
    stamp = EPOCH + np.array(stamps)
    series = clean_series("x", stamp, (slope * np.array(stamps) / 1e9 + offset)[:, None], max_gap=100.0)
    values = interpolate(series, EPOCH + np.array(wanted), 100.0)
    inside = (np.array(wanted) >= min(stamps)) & (np.array(wanted) <= max(stamps))
    assert_array_equal(np.isfinite(values[:, 0]), inside)
    # atol: a few roundings of numbers up to 110
    assert_allclose(values[inside, 0], slope * np.array(wanted)[inside] / 1e9 + offset, atol=1e-12)


def test_gaps_are_reported_and_nothing_is_interpolated_across_them() -> None:
    time = np.concatenate([np.arange(0.0, 1.0, 0.01), np.arange(1.6, 3.0, 0.01)])
    series = clean_series("x", _ns(time), time[:, None], max_gap=0.05)
    ((start, length),) = series.report.gaps
    assert_allclose((start, length), (0.99, 0.61), atol=1e-9)
    assert series.report.longest_gap == length
    wanted = np.array([0.5, 0.99, 0.9901, 1.3, 1.5999, 1.6, 1.605])
    near = interpolate(series, _ns(wanted), 0.05)[:, 0]
    assert_array_equal(np.isfinite(near), [True, True, False, False, False, True, True])


def test_what_is_missing_at_the_ends_of_the_state_is_a_gap() -> None:
    time = np.arange(1.0, 2.0, 0.01)
    series = clean_series("x", _ns(time), time[:, None], max_gap=0.05, span=(int(_ns(0.0)), int(_ns(5.0))))
    assert_allclose(series.report.gaps, [(0.0, 1.0), (1.99, 3.01)], atol=1e-9)
    near = interpolate(series, _ns([0.5, 1.5, 2.5]), 0.05)[:, 0]
    assert_array_equal(np.isfinite(near), [False, True, False])


def test_a_slow_topic_has_no_gaps_for_being_slow_and_an_empty_one_is_refused() -> None:
    with pytest.raises(InputError, match="no messages"):
        clean_series("x", np.zeros(0, dtype=np.int64), np.zeros((0, 1)), max_gap=0.05)
    assert clean_series("x", _ns(0.2 * np.arange(50)), np.zeros((50, 1)), max_gap=0.05).report.gaps == ()


def test_repeated_stamps_are_dropped_and_shuffled_ones_sorted_and_both_counted() -> None:
    time = np.array([0.0, 0.01, 0.01, 0.03, 0.02, 0.04, 0.04, 0.04, 0.05])
    series = clean_series("x", _ns(time), np.arange(9.0)[:, None], max_gap=0.05)
    assert_array_equal(series.stamp, _ns([0.0, 0.01, 0.02, 0.03, 0.04, 0.05]))
    assert_array_equal(series.values[:, 0], [0, 1, 4, 3, 5, 8])  # the first to arrive stays
    assert (series.report.repeated, series.report.shuffled, series.report.messages) == (3, 1, 9)
    assert any("3 repeated" in note for note in series.report.notes())
    assert any("1 messages were out of order" in note for note in series.report.notes())


def test_the_rate_is_measured_outside_gaps() -> None:
    rng = np.random.default_rng(1)
    steps = 0.01 + 0.001 * rng.standard_normal(5000)
    steps[1000] = 3.0
    report = clean_series("x", _ns(np.cumsum(steps)), np.zeros((5000, 1)), max_gap=0.05).report
    assert_allclose(report.rate, 100.0, rtol=0.005)  # 10 % of jitter over 5000 intervals


def test_clock_offset_is_the_median_delay_of_arrival() -> None:
    stamp = _ns(0.01 * np.arange(100))
    series = clean_series("x", stamp, np.zeros((100, 1)), max_gap=0.05, arrival=stamp + 42_000_000)
    assert series.report.clock_offset == pytest.approx(0.042)
    assert any("not corrected" in note for note in series.report.notes())


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
