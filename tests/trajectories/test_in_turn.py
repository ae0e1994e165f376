from collections.abc import Callable

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


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: InTurn([Rest(LOW, 1.0), Rest(HIGH, 1.0)]), "number 2 begins at"),
        (lambda: InTurn([Rest(LOW, 1.0), Rest(LOW[:1], 1.0)]), "number 2 begins at"),
        (lambda: InTurn([]), "at least one"),
        (lambda: Rest(LOW, -1.0), "zero or more seconds"),
    ],
)
def test_impossible_motions_are_refused(make: Callable[[], object], message: str) -> None:
    with pytest.raises(InputError, match=message):
        make()
