import mujoco
import numpy as np
import pinocchio
import pytest
from numpy.testing import assert_allclose

from catenary.dynamics.kinematics import forward_kinematics, jacobian, relative_pose
from catenary.robots.catalog import load_robot
from oracles.mujoco_trees import mujoco_data, mujoco_model, mujoco_order
from oracles.pinocchio_trees import pinocchio_model, pinocchio_order, pinocchio_vector
from oracles.raven2 import dh_frames


def test_links_and_fixed_frames_stand_and_move_as_in_mujoco_and_pinocchio(random_robots, rng) -> None:
    for robot in random_robots:
        m = robot.model
        q, point = rng.normal(size=m.n), rng.normal(size=3)
        mj, pin = mujoco_model(robot), pinocchio_model(robot)
        data, pin_data = mujoco_data(robot, mj, q), pin.createData()
        x = pinocchio_vector(robot, pin, m.coupling @ q + m.offset)
        pinocchio.framesForwardKinematics(pin, pin_data, x)
        for link in robot.links:
            pose, body = forward_kinematics(m, q, link.name), data.body(link.name)
            frame = pin.getFrameId(f"{link.name}_frame")
            for position in (body.xpos, pin_data.oMf[frame].translation):
                assert_allclose(pose.position, position, atol=1e-10, err_msg=m.name)
            for rotation in (body.xmat.reshape(3, 3), pin_data.oMf[frame].rotation):
                assert_allclose(pose.rotation, rotation, atol=1e-10)
            linear, angular = np.zeros((3, mj.nv)), np.zeros((3, mj.nv))
            at = body.xmat.reshape(3, 3) @ point + body.xpos
            mujoco.mj_jac(mj, data, linear, angular, at, mj.body(link.name).id)
            expected = np.vstack([linear, angular])[:, mujoco_order(robot, mj)] @ m.coupling
            assert_allclose(jacobian(m, q, link.name, point), expected, atol=1e-10, err_msg=m.name)
            J = pinocchio.computeFrameJacobian(pin, pin_data, x, frame, pinocchio.LOCAL_WORLD_ALIGNED)
            # Pinocchio gives a vector for a single joint
            expected = J.reshape(6, -1)[:, pinocchio_order(robot, pin)] @ m.coupling
            assert_allclose(jacobian(m, q, link.name), expected, atol=1e-10, err_msg=m.name)


@pytest.mark.parametrize(("name", "arm"), [("raven2_full", "left"), ("raven2_full_right", "right")])
def test_raven_frames_are_those_of_its_table(name: str, arm: str, rng: np.random.Generator) -> None:
    model = load_robot(name)
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


def test_base_frames_do_not_move() -> None:
    model = load_robot("raven2")
    q = np.array([[0.1, 1.0, 0.3], [0.5, 1.5, 0.4]])
    rotations, positions = forward_kinematics(model, q, "frame0")
    assert_allclose(rotations, np.broadcast_to(model.frames["frame0"].pose.rotation, (2, 3, 3)), atol=0.0)
    assert_allclose(positions, np.zeros((2, 3)), atol=0.0)
    assert_allclose(jacobian(model, q, "frame0"), np.zeros((2, 6, 3)), atol=0.0)
