import numpy as np
import pytest
from numpy.testing import assert_array_equal

from papers.calibration.judging import by_one_session, less, near, statement

ROBOTS = np.array([[1.0, 1.0, 1.0], [2.0, 2.0, 2.0], [3.0, 3.0, 3.0]])


def test_less_is_by_more_than_the_margin_on_robots_that_differ_among_themselves() -> None:
    assert_array_equal(less(ROBOTS * [0.9, 0.96, 1.0], ROBOTS), [True, False, False])
    assert_array_equal(less(ROBOTS * [0.9, 0.7, 0.81], ROBOTS, 0.2), [False, True, False])


def test_a_gain_within_the_spread_over_robots_is_a_tie() -> None:
    gained = np.array([0.5, 0.9, 1.05])  # log ratios 0.69, 0.11, -0.05: mean 0.25, deviation 0.39
    assert not less(gained, np.ones(3))
    assert less(gained[:1], np.ones(1))  # one robot has no spread


@pytest.mark.parametrize(
    ("core", "beside", "verdict"),
    [
        ([True, True, True], [True, True, True], "reproduced"),
        ([True, True, False], [True, True, False], "same direction"),
        ([False, False, True], [True, True, True], "not reproduced"),  # four of six, but not the statement
        ([False], [True, True], "not reproduced"),
        ([True, True, False], [False, False, False], "not reproduced"),
    ],
)
def test_what_stands_beside_a_statement_does_not_carry_it(core: list[bool], beside: list[bool], verdict: str) -> None:
    assert statement(core, beside, "told").verdict == verdict


def test_numbers_are_near_in_the_mean_and_told_with_their_spread() -> None:
    reached = {"a": np.array([0.9, 1.1])}
    found = near(reached, {"a": 1.2}, 0.2, direction=[False])
    assert found.verdict == "reproduced"
    assert found.measured == "a 1.000 ± 0.141"
    assert near(reached, {"a": 1.5}, 0.2, direction=[True]).verdict == "same direction"
    assert near(reached, {"a": 1.5}, 0.2, direction=[True, False]).verdict == "not reproduced"


@pytest.mark.parametrize("mean", [-1.0, 0.3, 1.5])
def test_the_probability_of_one_session_is_how_often_the_next_robot_shows_it(mean: float) -> None:
    rng = np.random.default_rng(0)
    told, shown = [], []
    for _ in range(4000):
        told.append(float(by_one_session([rng.normal(mean, 1.0, 6)], "").measured[-4:]))
        shown.append(rng.normal(mean, 1.0) > 0.0)
    assert np.mean(told) == pytest.approx(np.mean(shown), abs=0.06)


def test_one_session_tells_what_nearly_every_robot_shows_and_nothing_of_one_robot() -> None:
    clear, either = np.array([1.0, 1.1, 0.9, 1.05, 0.95, 1.0]), np.array([-1.0, 1.2, 0.1, -0.3, 0.5, -0.4])
    assert by_one_session([clear], "").verdict == "reproduced"
    assert by_one_session([-clear], "").verdict == "not reproduced"
    for undecided in ([either], [clear, either], [clear[:1]]):
        assert by_one_session(undecided, "").verdict == "cannot be judged by one session"
