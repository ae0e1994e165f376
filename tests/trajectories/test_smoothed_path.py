from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from catenary.errors import InputError
from catenary.trajectories.smoothed_path import _PEAK_WEIGHT, BrokenLine, SmoothedPath, go_to

# time since the corner before, point
steps = st.lists(st.tuples(st.floats(0.01, 3.0), st.floats(-5.0, 5.0)), min_size=2, max_size=12)


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
    assert np.abs(qdd).max() <= 2.0 * _PEAK_WEIGHT * speed / blend + rounding / blend


def test_lone_corner_is_passed_at_three_thirty_seconds_of_velocity_change_times_blend() -> None:
    path = SmoothedPath.through([0.0, 2.0, 5.0], [[0.0], [1.0], [-2.0]], 0.8)
    # from 0.5/s to -1/s; the corners at rest are reached exactly, one blend after the line ends
    assert_allclose(path.corner_distance, [3.0 / 32.0 * 1.5 * 0.8])
    assert_allclose(path(2.4).q, [1.0 - 3.0 / 32.0 * 1.5 * 0.8])
    assert_allclose(path(2.4).qdd, [-_PEAK_WEIGHT * 1.5 / 0.8])


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


positions = st.lists(st.floats(-3.0, 3.0).map(lambda x: round(x, 6)), min_size=3, max_size=3)
bounds = st.lists(st.floats(0.01, 10.0), min_size=3, max_size=3)


@settings(deadline=None)
@given(positions, positions, bounds, bounds)
def test_motion_goes_from_start_to_goal_within_its_bounds(
    start: list[float], goal: list[float], velocity: list[float], acceleration: list[float]
) -> None:
    motion = go_to(start, goal, max_velocity=velocity, max_acceleration=acceleration)
    q, qd, qdd = motion.sample(np.linspace(0.0, motion.duration, 501))
    assert_allclose(q[[0, -1]], [start, goal], atol=1e-12)
    way = np.subtract(goal, start)
    assert (np.diff(q, axis=0) * np.sign(way)).min() >= -1e-9  # never back, never beyond
    assert (np.abs(qd) <= np.multiply(velocity, 1.0 + 1e-9)).all()
    assert (np.abs(qdd) <= np.multiply(acceleration, 1.0 + 1e-9)).all()
    if np.abs(way).max() > 0.0:  # on a straight line
        done = (q - start) @ way / (way @ way)
        assert_allclose(q, start + done[:, np.newaxis] * way, atol=1e-9)


@pytest.mark.parametrize(
    ("way", "duration", "speed", "acceleration"),
    [
        (2.0, 4.0 + 1.5 * 0.5, 0.5, 1.5 * 0.5 / 0.75),  # 4 s at full speed and one blend of 3/2 * 0.5 s
        (0.06, 2.0 * 0.06 / 0.2, 0.2, 1.0),  # sqrt(way a / 1.5): all of the acceleration
        (0.0, 0.0, 0.0, 0.0),
    ],
)
def test_way_is_covered_as_quickly_as_the_bounds_allow(way, duration, speed, acceleration) -> None:
    motion = go_to([0.3], [0.3 + way], max_velocity=[0.5], max_acceleration=[1.0])
    _, qd, qdd = motion.sample(np.linspace(0.0, motion.duration, 10001))
    assert motion.duration == pytest.approx(duration)
    assert qd.max() == pytest.approx(speed)
    assert np.abs(qdd).max() == pytest.approx(acceleration, rel=1e-6)  # sampled


def line(times: object, points: object, blend: float) -> SmoothedPath:
    return SmoothedPath([BrokenLine(times, points, blend)])  # type: ignore[arg-type]


def gone_to(**wrong: object) -> SmoothedPath:
    bounds = {"max_velocity": [1.0, 1.0], "max_acceleration": [1.0, 1.0]}
    return go_to(**{"q_start": [0.0, 0.0], "q_goal": [1.0, 1.0], **bounds, **wrong})  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: line([0.0, 0.0], [1.0, 2.0], 0.1), "later than the one before"),
        (lambda: line([], [], 0.1), "at least one"),
        (lambda: line([0.0, 1.0], [1.0], 0.1), r"points: expected shape \(2,\)"),
        (lambda: line([0.0, 1.0], [1.0, np.nan], 0.1), r"points\[1\] is nan"),
        (lambda: line([0.0, 1.0], [1.0, 2.0], 0.0), "blend: expected more than 0"),
        (lambda: gone_to(q_goal=[1.0]), r"q_goal: expected shape \(2,\)"),
        (lambda: gone_to(max_velocity=[1.0, 0.0]), "max_velocity: expected more than 0"),
        (lambda: gone_to(max_acceleration=[-1.0, 1.0]), "max_acceleration: expected more than 0"),
    ],
)
def test_what_makes_no_motion_is_refused(make: Callable[[], object], message: str) -> None:
    with pytest.raises(InputError, match=message):
        make()
