import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from catenary.errors import InputError
from catenary.recording.series import clean_series, interpolate

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
    shuffle.shuffle(stamps)  # type: ignore[attr-defined]
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
