import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.crtk.serving.tool_pose import ToolPose
from catenary.dynamics.kinematics import forward_kinematics
from catenary.errors import InputError
from catenary.robots.catalog import load_robot
from catenary.simulation.cable_plant import JOINTS

Q = np.array([0.6, 1.5, 0.38, 0.2, -0.3, 0.5, 0.9])


def test_a_model_of_the_robots_own_joints_needs_no_jaws():
    model = load_robot("raven2")
    q = Q[:3]
    assert_allclose(ToolPose(model, JOINTS[:3]).pose(q).position, forward_kinematics(model, q).position)


def test_a_model_of_another_robot_is_refused():
    with pytest.raises(InputError, match="expected 7"):
        ToolPose(load_robot("two_link"), JOINTS)


def test_what_runs_along_paths_is_prepared_wherever_the_robot_is():
    for name, joints in (("raven2_full", JOINTS), ("two_link", ("joint1", "joint2"))):
        ToolPose(load_robot(name), joints).prepare()


def test_the_base_is_the_frame_0_of_a_robot_that_has_none():
    tool = ToolPose(load_robot("panda"), load_robot("panda").joint_names)
    pose = tool.pose(np.full(7, 0.2))
    for ours, expected in zip(tool.in_frame_0(pose), pose, strict=True):
        assert_allclose(ours, expected, atol=1e-15)
