import mujoco
import numpy as np
import pinocchio
import pytest
from numpy.testing import assert_allclose

from catenary.dynamics.kinematics import (
    forward_kinematics,
    frame_poses,
    jacobian,
    link_poses,
    relative_pose,
)
from catenary.errors import InputError
from catenary.robots.catalog import load_robot
from oracles.mujoco_trees import mujoco_data, mujoco_model, mujoco_order
from oracles.pinocchio_trees import pinocchio_model, pinocchio_order, pinocchio_vector
from oracles.random_trees import RandomRobot
from oracles.raven2 import dh_frames


def test_every_link_and_fixed_frame_stands_where_mujoco_puts_it(random_robots: list[RandomRobot]) -> None:
    rng = np.random.default_rng(1)
    for robot in random_robots:
        q = rng.normal(size=robot.model.n)
        mj = mujoco_model(robot)
        data = mujoco_data(robot, mj, q)
        for link in robot.links:
            pose = forward_kinematics(robot.model, q, link.name)
            assert_allclose(pose.position, data.body(link.name).xpos, atol=1e-10, err_msg=robot.model.name)
            assert_allclose(pose.rotation.ravel(), data.body(link.name).xmat, atol=1e-10)


def test_every_link_and_fixed_frame_stands_where_pinocchio_puts_it(random_robots: list[RandomRobot]) -> None:
    rng = np.random.default_rng(2)
    for robot in random_robots:
        m = robot.model
        q = rng.normal(size=m.n)
        pin = pinocchio_model(robot)
        data = pin.createData()
        pinocchio.framesForwardKinematics(pin, data, pinocchio_vector(robot, pin, m.coupling @ q + m.offset))
        for link in robot.links:
            pose = forward_kinematics(m, q, link.name)
            placed = data.oMf[pin.getFrameId(f"{link.name}_frame")]
            assert_allclose(pose.position, placed.translation, atol=1e-10, err_msg=m.name)
            assert_allclose(pose.rotation, placed.rotation, atol=1e-10)


def test_jacobian_of_any_point_agrees_with_mujoco(random_robots: list[RandomRobot]) -> None:
    rng = np.random.default_rng(3)
    for robot in random_robots:
        m = robot.model
        q, point = rng.normal(size=m.n), rng.normal(size=3)
        mj = mujoco_model(robot)
        data = mujoco_data(robot, mj, q)
        for link in robot.links:
            body = data.body(link.name)
            linear, angular = np.zeros((3, mj.nv)), np.zeros((3, mj.nv))
            at = body.xmat.reshape(3, 3) @ point + body.xpos
            mujoco.mj_jac(mj, data, linear, angular, at, mj.body(link.name).id)
            expected = np.vstack([linear, angular])[:, mujoco_order(robot, mj)] @ m.coupling
            assert_allclose(jacobian(m, q, link.name, point), expected, atol=1e-10, err_msg=m.name)


def test_jacobian_of_a_frame_agrees_with_pinocchio(random_robots: list[RandomRobot]) -> None:
    rng = np.random.default_rng(4)
    for robot in random_robots:
        m = robot.model
        q = rng.normal(size=m.n)
        pin = pinocchio_model(robot)
        data = pin.createData()
        x = pinocchio_vector(robot, pin, m.coupling @ q + m.offset)
        for link in robot.links:
            J = pinocchio.computeFrameJacobian(
                pin, data, x, pin.getFrameId(f"{link.name}_frame"), pinocchio.LOCAL_WORLD_ALIGNED
            )
            # Pinocchio gives a vector for a single joint
            expected = J.reshape(6, -1)[:, pinocchio_order(robot, pin)] @ m.coupling
            assert_allclose(jacobian(m, q, link.name), expected, atol=1e-10, err_msg=m.name)


def test_jacobian_is_the_derivative_of_the_position(random_robots: list[RandomRobot]) -> None:
    rng = np.random.default_rng(5)
    h = 1e-6
    for robot in random_robots[:9]:
        m = robot.model
        q = rng.normal(size=m.n)
        J = jacobian(m, q)
        for k, step in enumerate(h * np.eye(m.n)):
            ahead, behind = forward_kinematics(m, q + step), forward_kinematics(m, q - step)
            slope = (ahead.position - behind.position) / (2 * h)
            assert_allclose(J[:3, k], slope, atol=1e-8)  # central difference, h = 1e-6
            turn = (ahead.rotation - behind.rotation) / (2 * h) @ forward_kinematics(m, q).rotation.T
            assert_allclose(J[3:, k], [turn[2, 1], turn[0, 2], turn[1, 0]], atol=1e-8)


@pytest.mark.parametrize(("name", "arm"), [("raven2_full", "left"), ("raven2_full_right", "right")])
def test_raven_frames_are_those_of_its_table(name: str, arm: str) -> None:
    model = load_robot(name)
    rng = np.random.default_rng(6)
    for _ in range(50):
        q = rng.uniform(model.lower, model.upper)
        for link, expected in zip(model.link_names, dh_frames(arm, q), strict=True):
            pose = relative_pose(model, q, link, "frame0")
            assert_allclose(pose.rotation, expected[:3, :3], atol=1e-12)
            assert_allclose(pose.position, expected[:3, 3], atol=1e-12)


@pytest.mark.parametrize(("name", "side"), [("raven2_full", -1.0), ("raven2_full_right", 1.0)])
def test_raven_tip_at_home_is_where_the_mechanism_page_says(name: str, side: float) -> None:
    home = [np.pi / 6, np.pi / 2, 0.40, 0.0, 0.0, 0.0]
    tip = relative_pose(load_robot(name), home, "tool", "frame0")
    # printed with three decimals of a millimetre
    assert_allclose(tip.position, [-0.077947, side * 0.025266, 0.013226], atol=0.6e-6)


@pytest.mark.parametrize(("name", "n"), [("raven2", 3), ("raven2_full", 6)])
def test_raven_arms_mirror_each_other(name: str, n: int) -> None:
    left, right = load_robot(name), load_robot(f"{name}_right")
    S = np.diag([1.0, -1.0, 1.0])
    rng = np.random.default_rng(7)
    for _ in range(50):
        q = rng.uniform(left.lower, left.upper)
        mirrored = q * np.array([1, 1, 1, -1, 1, -1])[:n]
        pose_left = relative_pose(left, q, left.tip, "frame0")
        pose_right = relative_pose(right, mirrored, right.tip, "frame0")
        assert_allclose(pose_right.position, S @ pose_left.position, atol=1e-14)
        if n == 6:
            assert_allclose(pose_right.rotation, S @ pose_left.rotation @ S, atol=1e-14)


def test_batch_gives_what_single_configurations_give(random_robots: list[RandomRobot]) -> None:
    rng = np.random.default_rng(8)
    for robot in random_robots[:9]:
        m = robot.model
        q = rng.normal(size=(5, m.n))
        rotations, positions = frame_poses(m, q)
        links = link_poses(m, q)
        J = jacobian(m, q, point=[0.1, 0.2, 0.3])
        assert rotations.shape == (5, 3, 3)
        assert positions.shape == (5, 3)
        assert J.shape == (5, 6, m.n)
        for k in range(5):
            pose = forward_kinematics(m, q[k])
            assert_allclose(rotations[k], pose.rotation, atol=0.0)
            assert_allclose(positions[k], pose.position, atol=0.0)
            assert_allclose(links[0][k], link_poses(m, q[k])[0], atol=0.0)
            assert_allclose(J[k], jacobian(m, q[k], point=[0.1, 0.2, 0.3]), atol=0.0)


def test_empty_batch_gives_empty_results() -> None:
    model = load_robot("raven2")
    rotations, positions = frame_poses(model, np.empty((0, 3)))
    assert rotations.shape == (0, 3, 3)
    assert positions.shape == (0, 3)
    assert jacobian(model, np.empty((0, 3))).shape == (0, 6, 3)


def test_base_frames_do_not_move() -> None:
    model = load_robot("raven2")
    q = np.array([[0.1, 1.0, 0.3], [0.5, 1.5, 0.4]])
    rotations, positions = frame_poses(model, q, "frame0")
    assert_allclose(rotations, np.broadcast_to(model.frames["frame0"].pose.rotation, (2, 3, 3)), atol=0.0)
    assert_allclose(positions, np.zeros((2, 3)), atol=0.0)
    assert_allclose(jacobian(model, q, "frame0"), np.zeros((2, 6, 3)), atol=0.0)


def test_wrong_arguments_are_refused_with_a_reason() -> None:
    model = load_robot("raven2")
    with pytest.raises(InputError, match=r"q: expected shape \(3,\)"):
        forward_kinematics(model, np.zeros((2, 3)))
    with pytest.raises(InputError, match=r"q\[1\] is nan"):
        jacobian(model, [0.0, np.nan, 0.3])
    with pytest.raises(InputError, match=r'no frame "hand"; frames: .*wrist'):
        frame_poses(model, np.zeros(3), "hand")
    with pytest.raises(InputError, match="point"):
        jacobian(model, np.zeros(3), point=[0.0, 1.0])


def test_a_model_without_inertia_has_kinematics() -> None:
    model = load_robot("raven2_full")
    assert jacobian(model, np.full(6, 0.3)).shape == (6, 6)
