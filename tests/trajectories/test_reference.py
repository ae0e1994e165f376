from collections.abc import Callable

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from catenary.errors import InputError
from catenary.trajectories.reference import Embedded, InTurn, Rest
from catenary.trajectories.smoothed_path import go_to

LOW, HIGH = np.array([0.0, 1.0]), np.array([0.5, 0.4])
BOUNDS = {"max_velocity": [0.5, 0.3], "max_acceleration": [1.0, 1.0]}
THERE = go_to(LOW, HIGH, **BOUNDS)
HOLD = np.array([9.0, 8.0, 7.0, 6.0])


def test_each_motion_begins_when_the_last_one_has_ended() -> None:
    back = go_to(HIGH, LOW, **BOUNDS)
    whole = InTurn([THERE, Rest(HIGH, 0.7), back])
    assert whole.starts == (0.0, THERE.duration, THERE.duration + 0.7)
    assert whole.duration == pytest.approx(THERE.duration + 0.7 + back.duration)
    assert_array_equal(whole(0.4).q, THERE(0.4).q)
    assert_allclose(whole(THERE.duration + 0.3).q, HIGH, atol=1e-12)
    assert_allclose(whole(whole.starts[2] + 0.4).q, back(0.4).q, atol=1e-12)


def test_moving_joints_follow_the_trajectory_in_its_order_and_the_others_stand_still() -> None:
    whole = Embedded(THERE, [2, 0], HOLD)
    assert whole.duration == THERE.duration
    for full, own, held in zip(whole(0.7), THERE(0.7), (HOLD[[1, 3]], 0.0, 0.0), strict=True):
        assert_array_equal(full[[2, 0]], own)
        assert_array_equal(full[[1, 3]], held)
    whole(0.0).q[:] = 99.0  # the receiver's own
    assert (whole(0.0).q != 99.0).all()


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: InTurn([Rest(LOW, 1.0), Rest(HIGH, 1.0)]), "number 2 begins at"),
        (lambda: InTurn([Rest(LOW, 1.0), Rest(LOW[:1], 1.0)]), "number 2 begins at"),
        (lambda: InTurn([]), "at least one"),
        (lambda: Rest(LOW, -1.0), "zero or more seconds"),
        *(
            (lambda joints=joints: Embedded(THERE, joints, HOLD), "joints")
            for joints in ([], [0], [0, 0], [0, 4], [-1, 0], [0, 1, 2])
        ),
        *(
            (lambda hold=hold: Embedded(THERE, [0, 1], hold), "q_hold")
            for hold in (3.0, [[1.0, 2.0]], [np.nan, 0.0, 0.0, 0.0], "here")
        ),
    ],
)
def test_impossible_motions_are_refused(make: Callable[[], object], message: str) -> None:
    with pytest.raises(InputError, match=message):
        make()
