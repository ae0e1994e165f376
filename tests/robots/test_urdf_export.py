import numpy as np
import pinocchio
import pytest
from numpy.testing import assert_allclose

import own_base
from catenary.dynamics.inverse_dynamics import inverse_dynamics
from catenary.errors import UnsupportedModelError
from catenary.robots.catalog import load_robot
from catenary.robots.urdf import load_urdf, parse_urdf
from catenary.robots.urdf_export import urdf_text
from oracles.tree_poses import frame_pose

LEVEL = [0.0, 0.0, -9.81]


@pytest.mark.parametrize("name", ["two_link", "planar_3r", "raven2", "raven2_full_right"])
def test_a_written_robot_moves_as_it_did(name, tmp_path):
    model = load_robot(name)
    (tmp_path / "robot.urdf").write_text(urdf_text(model), "utf-8")
    again = load_urdf(tmp_path / "robot.urdf", massless=model.massless)
    assert again.joint_names == model.joint_names
    assert_allclose([again.lower, again.upper], [model.lower, model.upper])
    q, qd, qdd = np.random.default_rng(0).normal(size=(3, 5, model.n))
    expected = inverse_dynamics(model, q, qd, qdd, LEVEL)
    assert_allclose(inverse_dynamics(again, q, qd, qdd, LEVEL), expected, atol=1e-9)
    for frame in model.frames:
        assert_allclose(frame_pose(again, frame, q[0]), frame_pose(model, frame, q[0]), atol=1e-9)


def test_pinocchio_reads_the_same_robot():
    model = load_robot("raven2")
    peer = pinocchio.buildModelFromXML(urdf_text(model))
    q, qd, qdd = np.random.default_rng(1).normal(size=(3, 3))
    theirs = pinocchio.rnea(peer, peer.createData(), q, qd, qdd)
    assert_allclose(theirs, inverse_dynamics(model, q, qd, qdd, LEVEL), atol=1e-9)


def test_coupled_joints_mimic_and_idle_motors_are_left_out():
    model = load_robot("dvrk_psm_motors")
    again = parse_urdf(urdf_text(model))
    assert again.joint_names == ("q1", "q2", "q3")  # q4 to q7 move no link
    q = np.array([0.3, -0.4, 0.15, 0.0, 0.0, 0.0, 0.0])
    for link in model.link_names:
        assert_allclose(frame_pose(again, link, q[:3]), frame_pose(model, link, q), atol=1e-9)


def test_random_robots_that_urdf_can_say_come_back(random_robots):
    written = 0
    for robot in random_robots:
        try:
            text = urdf_text(robot.model)
        except UnsupportedModelError:
            continue
        again = parse_urdf(text)
        order = [again.joint_names.index(name) for name in robot.model.joint_names]
        q, qd, qdd = np.random.default_rng(2).normal(size=(3, robot.model.n))
        moved = [np.zeros(again.n) for _ in range(3)]
        for into, values in zip(moved, (q, qd, qdd), strict=True):
            into[order] = values
        tau = inverse_dynamics(again, *moved, LEVEL)[order]
        assert_allclose(tau, inverse_dynamics(robot.model, q, qd, qdd, LEVEL), atol=1e-8)
        written += 1
    assert written >= 5


def test_a_joint_that_follows_two_coordinates_is_refused():
    with pytest.raises(UnsupportedModelError, match='link "forearm" moves with q2 and q3: URDF joints follow one'):
        urdf_text(load_robot("dvrk_mtm_motors"))


def test_a_files_own_base_is_written_under_its_name():
    model = parse_urdf(own_base.URDF)
    expected, written = (
        own_base.poses(own_base.URDF, np.array([0.3, -0.7])),
        own_base.poses(urdf_text(model), np.array([0.3, -0.7])),
    )
    for frame in own_base.LINKS:
        assert_allclose(written[frame].homogeneous, expected[frame].homogeneous, atol=1e-12)
