import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from catenary.errors import InputError
from catenary.trajectories.point_to_point import go_to

positions = st.lists(st.floats(-3.0, 3.0).map(lambda x: round(x, 6)), min_size=3, max_size=3)
bounds = st.lists(st.floats(0.01, 10.0), min_size=3, max_size=3)


@settings(deadline=None)
@given(positions, positions, bounds, bounds, st.booleans())
def test_motion_goes_from_start_to_goal_within_its_bounds(
    start: list[float], goal: list[float], velocity: list[float], acceleration: list[float], together: bool
) -> None:
    motion = go_to(start, goal, max_velocity=velocity, max_acceleration=acceleration, together=together)
    q, qd, qdd = motion.sample(np.linspace(0.0, motion.duration, 501))
    assert_allclose(q[[0, -1]], [start, goal], atol=1e-12)
    way = np.subtract(goal, start)
    assert (np.diff(q, axis=0) * np.sign(way)).min() >= -1e-9  # never back, never beyond
    assert (np.abs(qd) <= np.multiply(velocity, 1.0 + 1e-9)).all()
    assert (np.abs(qdd) <= np.multiply(acceleration, 1.0 + 1e-9)).all()
    if together and np.abs(way).max() > 0.0:  # on a straight line
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


def test_joint_by_itself_does_not_wait_for_others() -> None:
    bounds = {"max_velocity": [1.0, 1.0], "max_acceleration": [1.0, 1.0]}
    motion = go_to([0.0, 0.0], [5.0, 0.1], **bounds, together=False)
    alone = go_to([0.0], [0.1], max_velocity=[1.0], max_acceleration=[1.0])
    assert motion(alone.duration).q[1] == pytest.approx(0.1)
    assert motion.duration == go_to([0.0], [5.0], max_velocity=[1.0], max_acceleration=[1.0]).duration


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"q_goal": [1.0]}, r"q_goal: expected shape \(2,\)"),
        ({"q_start": [0.0, np.nan]}, r"q_start\[1\] is nan"),
        ({"max_velocity": [1.0, 0.0]}, "max_velocity: expected more than 0"),
        ({"max_acceleration": [-1.0, 1.0]}, "max_acceleration: expected more than 0"),
        ({"max_velocity": 1.0}, r"max_velocity: expected shape \(2,\)"),
        ({"max_velocity": [np.inf, 1.0]}, "max_velocity"),
    ],
)
def test_bad_arguments_are_refused(arguments: dict[str, object], message: str) -> None:
    good = {"q_start": [0.0, 0.0], "q_goal": [1.0, 1.0], "max_velocity": [1, 1], "max_acceleration": [1, 1]}
    with pytest.raises(InputError, match=message):
        go_to(**{**good, **arguments})
