import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.dynamics.inverse_kinematics import inverse_kinematics
from catenary.dynamics.kinematics import forward_kinematics
from catenary.dynamics.raven_inverse_kinematics import raven_path
from catenary.errors import InputError, UnreachablePoseError, UnsupportedModelError
from catenary.robots.catalog import load_robot
from catenary.robots.model import RobotModel
from catenary.spatial import Pose

ARMS = ["raven2_full", "raven2_full_right", "raven2", "raven2_right"]
L, D = 0.013, 0.47  # m, from the mechanism's table


@pytest.fixture(params=ARMS)
def arm(request) -> RobotModel:
    return load_robot(request.param)


@pytest.fixture(params=ARMS[:2])
def full_arm(request) -> RobotModel:
    return load_robot(request.param)


@pytest.mark.parametrize("wrist", [0.0, 1e-12, -1e-7])
def test_the_roll_is_known_though_the_tool_is_straight(full_arm, wrist: float) -> None:
    q = np.array([np.pi / 6, np.pi / 2, 0.40, 0.7, wrist, -0.4])
    assert_allclose(inverse_kinematics(full_arm, forward_kinematics(full_arm, q), q + 0.1), q, atol=1e-9)


def test_poses_to_the_limits_are_recovered_but_near_the_remote_centre_and_refused_only_there(
    arm, rng: np.random.Generator
) -> None:
    drawn = rng.uniform(arm.lower, arm.upper, size=(1000, arm.n))
    drawn[:100] = np.where(rng.random((100, arm.n)) < 0.5, arm.lower, arm.upper)
    near_it = [*(L * np.array([1.0, -1.0]) * (1.0 - 1e-7)), *(L * np.array([1.0, -1.0]) * (1.0 + 1e-7)), 0.0]
    drawn[100:105, 2] = D + np.array(near_it)
    refused = 0
    for q in drawn:
        d = q[2] - D
        # either wrist candidate within L: the true one at d, the other one 2 L back through the tool's joint
        near = abs(d) <= L or (arm.n == 6 and d**2 - 4 * d * L * np.cos(q[4]) + 4 * L**2 <= L**2)
        pose = forward_kinematics(arm, q)
        if near:
            refused += 1
            with pytest.raises(UnreachablePoseError, match=r"mm from the remote centre"):
                inverse_kinematics(arm, pose, q)
        else:
            found = inverse_kinematics(arm, pose, q + 0.1 * rng.uniform(-1, 1, arm.n))
            assert_allclose(found, q, atol=1e-9)
            assert ((found >= arm.lower) & (found <= arm.upper)).all()
    assert 50 < refused < 130  # about a tenth of the box


def test_roll_stays_on_the_side_of_the_start(full_arm) -> None:
    q = np.array([0.5, 1.5, 0.4, np.deg2rad(179.0), 0.3, 0.2])
    pose = forward_kinematics(full_arm, q)
    assert_allclose(inverse_kinematics(full_arm, pose, q), q, atol=1e-9)
    other = q - [0.0, 0.0, 0.0, 2 * np.pi, 0.0, 0.0]
    assert_allclose(inverse_kinematics(full_arm, pose, other), other, atol=1e-9)


def test_a_frame_fixed_to_the_tool_is_brought_to_its_pose(full_arm) -> None:
    q = np.array([0.5, 1.5, 0.4, 0.1, 0.3, 0.2])
    offset = Pose(np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]), np.array([0.01, 0.0, 0.0]))
    tool = full_arm.frames["tool"]
    object.__setattr__(full_arm, "frames", {**full_arm.frames, "jaw": tool._replace(pose=tool.pose @ offset)})
    found = inverse_kinematics(full_arm, forward_kinematics(full_arm, q, "jaw"), q, frame="jaw")
    assert_allclose(found, q, atol=1e-9)


def test_a_pose_beyond_a_limit_names_the_limit(arm) -> None:
    q = np.array([0.5, 1.5, 0.2, 0.1, 0.3, 0.2])[: arm.n]
    with pytest.raises(UnreachablePoseError, match=r'joint "insertion": 0.2 m outside \[0.23, 0.56\]'):
        inverse_kinematics(arm, forward_kinematics(arm, q), q)
    q[1:3] = 0.6, 0.4
    with pytest.raises(UnreachablePoseError, match=r'joint "elbow": 0.6 rad outside'):
        inverse_kinematics(arm, forward_kinematics(arm, q), q)


@pytest.mark.parametrize("name", ["raven2", "raven2_right"])
def test_a_shaft_along_the_shoulders_axis_is_out_of_reach(name: str) -> None:
    model = load_robot(name)
    # the shoulder turns about the base's y
    with pytest.raises(UnreachablePoseError, match="too near the shoulder's axis"):
        inverse_kinematics(model, Pose(np.eye(3), np.array([0.0, 0.1, 0.0])))


def test_a_path_of_poses_is_followed_along_one_branch(arm, rng: np.random.Generator) -> None:
    clear = np.where(np.arange(arm.n) == 2, D - L, arm.upper)
    a, b = rng.uniform(arm.lower, clear, size=(2, arm.n))
    q = a + np.linspace(0.0, 1.0, 200)[:, None] * (b - a)
    assert_allclose(raven_path(arm, *forward_kinematics(arm, q), a), q, atol=1e-9)


def test_a_path_names_the_pose_that_it_cannot_reach() -> None:
    model = load_robot("raven2_full")
    q = np.tile([0.5, 1.5, 0.4, 0.1, 0.3, 0.2], (5, 1))
    q[3, 0] = 1.7
    with pytest.raises(UnreachablePoseError, match=r'pose 3 of 5: .*joint "shoulder": 1.7 rad outside'):
        raven_path(model, *forward_kinematics(model, q))
    q[2, 2] = D
    with pytest.raises(UnreachablePoseError, match=r"pose 2 of 5: .*remote centre"):
        raven_path(model, *forward_kinematics(model, q))
    assert raven_path(model, np.empty((0, 3, 3)), np.empty((0, 3))).shape == (0, 6)


def test_what_is_no_pose_or_no_raven_is_refused() -> None:
    model = load_robot("raven2_full")
    with pytest.raises(InputError, match="rotation matrix"):
        inverse_kinematics(model, Pose(np.diag([1.0, 1.0, -1.0]), np.array([0.1, 0.0, 0.0])))
    with pytest.raises(InputError, match=r"pose position\[0\] is nan"):
        inverse_kinematics(model, Pose(np.eye(3), np.array([np.nan, 0.0, 0.0])))
    with pytest.raises(InputError, match=r"rotations\[1\]: expected a rotation matrix"):
        raven_path(model, [np.eye(3), 2.0 * np.eye(3)], np.full((2, 3), 0.1))
    with pytest.raises(UnsupportedModelError, match='robot "planar_3r": no closed form'):
        raven_path(load_robot("planar_3r"), np.eye(3)[None], np.zeros((1, 3)))
