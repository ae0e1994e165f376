import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from catenary.errors import InputError
from catenary.trajectories.in_turn import InTurn, Rest
from catenary.trajectories.point_to_point import go_to

LOW, HIGH = np.array([0.0, 1.0]), np.array([0.5, 0.4])
BOUNDS = {"max_velocity": [0.5, 0.3], "max_acceleration": [1.0, 1.0]}


def test_each_motion_begins_when_the_last_one_has_ended() -> None:
    there, back = go_to(LOW, HIGH, **BOUNDS), go_to(HIGH, LOW, **BOUNDS)
    whole = InTurn([there, Rest(HIGH, 0.7), back])
    assert whole.starts == (0.0, there.duration, there.duration + 0.7)
    assert whole.duration == pytest.approx(there.duration + 0.7 + back.duration)
    assert_array_equal(whole(0.4).q, there(0.4).q)
    assert_allclose(whole(there.duration + 0.3).q, HIGH, atol=1e-12)
    assert_allclose(whole(whole.starts[2] + 0.4).q, back(0.4).q, atol=1e-12)


def test_a_motion_that_would_leap_is_refused() -> None:
    with pytest.raises(InputError, match="number 2 begins at"):
        InTurn([Rest(LOW, 1.0), Rest(HIGH, 1.0)])
    with pytest.raises(InputError, match="number 2 begins at"):
        InTurn([Rest(LOW, 1.0), Rest(LOW[:1], 1.0)])


def test_nothing_is_no_motion() -> None:
    with pytest.raises(InputError, match="at least one"):
        InTurn([])


def test_a_rest_that_lasts_less_than_nothing_is_refused() -> None:
    with pytest.raises(InputError, match="zero or more seconds"):
        Rest(LOW, -1.0)
