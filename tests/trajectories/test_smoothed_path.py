import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from catenary.errors import InputError
from catenary.trajectories.smoothed_path import PEAK, BrokenLine, SmoothedPath

steps = st.lists(
    st.tuples(st.floats(0.01, 3.0), st.floats(-5.0, 5.0)), min_size=2, max_size=12
)  # time since the corner before, point


def line_of(corners: list[tuple[float, float]], blend: float) -> BrokenLine:
    gaps, points = zip(*corners, strict=True)
    return BrokenLine(np.cumsum(gaps) - gaps[0], points, blend)


@settings(deadline=None)
@given(steps, st.floats(0.01, 10.0), st.floats(0.0, 1.0))
def test_position_is_the_line_averaged_over_the_window(corners, blend, when) -> None:
    line = line_of(corners, blend)
    path = SmoothedPath([line])
    t = when * path.duration
    x = (np.arange(4000) + 0.5) / 4000
    weight = 6.0 * x * (1.0 - x)
    average = np.mean(weight * np.interp(t - blend * x, line.times, line.points))
    # midpoint rule over a line with kinks: error of order h² slope blend, both up to 1000 * 10
    assert_allclose(path(t).q[0], average, atol=2e-3)


@settings(deadline=None)
@given(steps, st.floats(0.01, 10.0))
def test_path_stays_within_the_range_of_its_corners_and_below_their_speeds(corners, blend) -> None:
    line = line_of(corners, blend)
    q, qd, qdd = SmoothedPath([line]).sample(np.linspace(-1.0, line.times[-1] + blend + 1.0, 2000))
    speed = np.abs(np.diff(line.points) / np.diff(line.times)).max()
    rounding = 1e-9 * (1.0 + speed)
    assert q.min() >= min(line.points) - rounding
    assert q.max() <= max(line.points) + rounding
    assert np.abs(qd).max() <= speed + rounding
    assert np.abs(qdd).max() <= 2.0 * PEAK * speed / blend + rounding / blend


def test_lone_corner_is_passed_at_three_thirty_seconds_of_velocity_change_times_blend() -> None:
    path = SmoothedPath.through([0.0, 2.0, 5.0], [[0.0], [1.0], [-2.0]], 0.8)
    # from 0.5/s to -1/s; the corners at rest are reached exactly, one blend after the line ends
    assert_allclose(path.corner_distance, [3.0 / 32.0 * 1.5 * 0.8])
    assert_allclose(path(2.4).q, [1.0 - 3.0 / 32.0 * 1.5 * 0.8])
    assert_allclose(path(2.4).qdd, [-PEAK * 1.5 / 0.8])


def test_samples_depend_neither_on_the_order_of_times_nor_on_other_joints(rng: np.random.Generator) -> None:
    times = np.cumsum(rng.uniform(0.02, 1.0, 60))
    lines = [BrokenLine(times[k:], rng.normal(size=60 - k), 0.05 + 0.5 * k) for k in (0, 2, 59)]
    path = SmoothedPath(lines)
    ordered = np.linspace(-1.0, path.duration + 1.0, 3000)
    shuffled = rng.permutation(3000)
    together = path.sample(ordered)
    for one, other in zip(together, path.sample(ordered[shuffled]), strict=True):
        assert_array_equal(one[shuffled], other)
    for j, line in enumerate(lines):
        assert_array_equal(together[0][:, [j]], SmoothedPath([line]).sample(ordered)[0])


def test_single_point_is_a_joint_at_rest_and_no_line_no_path() -> None:
    path = SmoothedPath([BrokenLine([0.0], [0.7], 1.0)])
    assert path.duration == 0.0
    assert all(path(t) == ([0.7], [0.0], [0.0]) for t in (-1.0, 0.0, 0.5, 3.0))
    with pytest.raises(InputError, match="one for each joint"):
        SmoothedPath([])


@pytest.mark.parametrize(
    ("times", "points", "blend", "message"),
    [
        ([0.0, 0.0], [1.0, 2.0], 0.1, "later than the one before"),
        ([1.0, 0.0], [1.0, 2.0], 0.1, "later than the one before"),
        ([], [], 0.1, "at least one"),
        ([0.0, 1.0], [1.0], 0.1, r"points: expected shape \(2,\)"),
        ([0.0, 1.0], [1.0, np.nan], 0.1, r"points\[1\] is nan"),
        ([0.0, np.inf], [1.0, 1.0], 0.1, r"times\[1\] is inf"),
        ([0.0, 1.0], [1.0, 2.0], 0.0, "blend: expected more than 0"),
        ([0.0, 1.0], [1.0, 2.0], np.nan, "blend"),
    ],
)
def test_bad_lines_are_refused(times: list[float], points: list[float], blend: float, message: str) -> None:
    with pytest.raises(InputError, match=message):
        SmoothedPath([BrokenLine(times, points, blend)])
