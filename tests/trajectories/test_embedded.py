import numpy as np
import pytest
from numpy.testing import assert_array_equal

from catenary.errors import InputError
from catenary.trajectories.embedded import Embedded
from catenary.trajectories.point_to_point import go_to
from catenary.trajectories.reference import Trajectory

HOLD = np.array([9.0, 8.0, 7.0, 6.0])


@pytest.fixture
def part() -> Trajectory:
    return go_to([0.0, 1.0], [1.0, 0.0], max_velocity=[1.0, 1.0], max_acceleration=[1.0, 1.0])


def test_moving_joints_follow_the_trajectory_in_its_order_and_the_others_stand_still(
    part: Trajectory,
) -> None:
    whole = Embedded(part, [2, 0], HOLD)
    assert whole.duration == part.duration
    for full, own, held in zip(whole(0.7), part(0.7), (HOLD[[1, 3]], 0.0, 0.0), strict=True):
        assert_array_equal(full[[2, 0]], own)
        assert_array_equal(full[[1, 3]], held)
    whole(0.0).q[:] = 99.0  # the receiver's own
    assert (whole(0.0).q != 99.0).all()


@pytest.mark.parametrize("joints", [[], [0], [0, 0], [0, 4], [-1, 0], [0, 1, 2]])
def test_numbers_of_joints_that_do_not_fit_are_refused(part: Trajectory, joints: list[int]) -> None:
    with pytest.raises(InputError, match="joints"):
        Embedded(part, joints, HOLD)


@pytest.mark.parametrize("hold", [3.0, [[1.0, 2.0]], [np.nan, 0.0, 0.0, 0.0], "here"])
def test_where_the_robot_stands_must_be_numbers(part: Trajectory, hold: object) -> None:
    with pytest.raises(InputError, match="q_hold"):
        Embedded(part, [0, 1], hold)  # type: ignore[arg-type]
