import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.dynamics.kinematics import forward_kinematics
from catenary.reports.arm_in_space import end_frames, link_segments
from catenary.robots.catalog import load_robot, robot_names


@pytest.mark.parametrize("name", robot_names())
def test_every_line_begins_at_the_base_or_where_another_ends_and_one_leads_to_the_tip(name: str) -> None:
    robot = load_robot(name)
    q = np.linspace(-0.4, 0.7, robot.n)
    lines = link_segments(robot, q)
    ends = np.vstack([np.zeros((1, 3)), lines[:, 1]])
    for start in lines[:, 0]:
        assert np.linalg.norm(ends - start, axis=1).min() < 1e-12
    assert_allclose(lines[len(robot.link_names), 1], forward_kinematics(robot, q).position, atol=1e-12)


def test_both_hands_of_two_arms_are_ends() -> None:
    assert end_frames(load_robot("dual_arm_19")) == ["left_hand", "right_hand"]
    assert end_frames(load_robot("panda")) == ["flange"]
