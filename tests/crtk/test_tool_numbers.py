import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from catenary.crtk.tool_numbers import POSES, POSITIONS_0, ROTATIONS_0, SIZE, TWIST, quaternion
from catenary.crtk.tool_pose import ToolPose
from catenary.dynamics.kinematics import forward_kinematics, relative_pose
from catenary.robots.catalog import load_robot
from catenary.simulation.cable_plant import JOINTS
from catenary.spatial import rotation_from_quaternion, rotation_from_vector

RAVENS = ["raven2_full", "raven2_full_right"]
MEASURED = np.array([0.6, 1.5, 0.38, 0.2, -0.3, 0.5, 0.9])
SETPOINT = np.array([0.5, 1.7, 0.42, -1.2, 0.4, -0.1, 0.6])
VELOCITY = np.linspace(-0.3, 0.3, 7)

turns = st.tuples(*[st.floats(-np.pi, np.pi)] * 3).map(np.array)


def numbers(tool, measured, velocity, setpoint):
    joints, out = np.zeros((6, len(measured))), np.full(SIZE, np.nan)
    joints[0], joints[1], joints[3] = measured, velocity, setpoint
    tool.numbers.write(joints, out)
    return out


def raven_numbers(name):
    return numbers(ToolPose(load_robot(name), JOINTS), MEASURED, VELOCITY, SETPOINT)


def at_tip(q):
    """The model's joints at the robot's: half the difference of the jaws turns the tool."""
    return [*q[:5], 0.5 * (q[6] - q[5])]


@settings(deadline=None)  # SciPy is loaded within the first example
@given(turns)
def test_a_quaternion_in_plain_arithmetic_is_the_rotation(turn):
    rotation = rotation_from_vector(turn)
    x, y, z, w = quaternion(*map(tuple, rotation.tolist()))
    assert_allclose(rotation_from_quaternion([w, x, y, z]), rotation, atol=1e-9)  # roots near a half turn


@pytest.mark.parametrize("name", RAVENS)
def test_poses_are_those_of_forward_kinematics(name):
    found = raven_numbers(name)
    for at, q in zip(POSES, (MEASURED, SETPOINT), strict=True):
        pose = forward_kinematics(load_robot(name), at_tip(q))
        x, y, z, w = found[at + 3 : at + 7]
        assert_allclose(found[at : at + 3], pose.position, atol=1e-12)
        assert_allclose(rotation_from_quaternion([w, x, y, z]), pose.rotation, atol=1e-12)


@pytest.mark.parametrize("name", RAVENS)
def test_frame_0_is_the_models(name):
    found = raven_numbers(name)
    for place, turn, q in zip(POSITIONS_0, ROTATIONS_0, (MEASURED, SETPOINT), strict=True):
        pose = relative_pose(load_robot(name), at_tip(q), "tool", "frame0")
        assert_allclose(found[place : place + 3], pose.position, atol=1e-12)
        assert_allclose(found[turn : turn + 9].reshape(3, 3), pose.rotation, atol=1e-12)


@pytest.mark.parametrize("name", RAVENS)
def test_a_velocity_is_the_derivative_of_the_pose(name):
    tool, h = ToolPose(load_robot(name), JOINTS), 1e-6
    ahead, behind = (tool.pose(MEASURED + step * VELOCITY) for step in (h, -h))
    turning = (ahead.rotation - behind.rotation) / (2 * h) @ tool.pose(MEASURED).rotation.T
    expected = [*(ahead.position - behind.position) / (2 * h), turning[2, 1], turning[0, 2], turning[1, 0]]
    assert_allclose(raven_numbers(name)[TWIST : TWIST + 6], expected, atol=1e-8)  # central difference


@pytest.mark.parametrize("name", ["planar_3r", "panda", "raven2"])
def test_other_robots_tools_are_told_too_and_the_base_is_their_frame_0(name):
    model = load_robot(name)
    rng = np.random.default_rng(3)
    q, qd, q_set = rng.uniform(0.1, 0.5, (3, model.n))
    found = numbers(ToolPose(model, tuple(model.joint_names)), q, qd, q_set)
    pose = forward_kinematics(model, q_set)
    assert_allclose(found[POSES[1] : POSES[1] + 3], pose.position, atol=1e-12)
    if "frame0" not in model.frames:
        assert_allclose(found[ROTATIONS_0[1] : ROTATIONS_0[1] + 9].reshape(3, 3), pose.rotation, atol=1e-12)
