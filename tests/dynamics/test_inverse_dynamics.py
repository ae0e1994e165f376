from dataclasses import replace

import numpy as np
import pinocchio
import pytest
from numpy.testing import assert_allclose

from catenary.dynamics.inverse_dynamics import BaseMotion, coriolis_matrix, inverse_dynamics, mass_matrix
from catenary.errors import InputError
from catenary.gravity.torque import gravity_torque
from catenary.robots.catalog import load_robot
from oracles.floating_base import STILL, Free, by_mujoco, by_pinocchio
from oracles.mujoco_trees import mujoco_data, mujoco_mass_matrix, mujoco_model
from oracles.pinocchio_trees import pinocchio_model, pinocchio_order, pinocchio_vector
from oracles.random_trees import Floats, RandomRobot, random_rotation


def random_motion(robot: RandomRobot, rng: np.random.Generator) -> tuple[Floats, Floats, Floats]:
    return rng.normal(size=robot.model.n), rng.normal(size=robot.model.n), rng.normal(size=robot.model.n)


@pytest.mark.parametrize("moving", [False, True])
@pytest.mark.parametrize("peer", [by_mujoco, by_pinocchio])
def test_torques_are_what_peers_compute(peer, moving, random_robots, rng):
    for robot in random_robots:
        arm, gravity = random_motion(robot, rng), 5.0 * rng.normal(size=3)
        base = Free(random_rotation(rng), rng.normal(size=3), BaseMotion(*rng.normal(size=(3, 3))))
        tau = inverse_dynamics(robot.model, *arm, gravity, base.motion if moving else None)
        expected = peer(robot, *arm, gravity, base if moving else STILL)
        assert_allclose(tau, expected, atol=1e-10, err_msg=robot.model.name)


def test_coriolis_matrix_agrees_with_pinocchio_and_is_the_term_of_the_equation_of_motion(random_robots, rng):
    for robot in random_robots:
        m, gravity = robot.model, 5.0 * rng.normal(size=3)
        q, qd, qdd = random_motion(robot, rng)
        pin = pinocchio_model(robot)
        x, xd = (pinocchio_vector(robot, pin, v) for v in (m.coupling @ q + m.offset, m.coupling @ qd))
        order = pinocchio_order(robot, pin)
        C = pinocchio.computeCoriolisMatrix(pin, pin.createData(), x, xd)[np.ix_(order, order)]
        assert_allclose(coriolis_matrix(m, q, qd), m.coupling.T @ C @ m.coupling, atol=1e-10, err_msg=m.name)
        there, back = coriolis_matrix(m, q, qd) @ qdd, coriolis_matrix(m, q, qdd) @ qd
        assert_allclose(there, back, atol=1e-10, err_msg=m.name)  # as Christoffel's symbols have it
        terms = mass_matrix(m, q) @ qdd + coriolis_matrix(m, q, qd) @ qd + gravity_torque(m, q, gravity)
        assert_allclose(inverse_dynamics(m, q, qd, qdd, gravity), terms, atol=1e-10, err_msg=m.name)


def test_each_row_has_the_base_motion_of_its_own(random_robots, rng):
    for robot in random_robots[:3]:
        rows, gravity = [random_motion(robot, rng) for _ in range(4)], 5.0 * rng.normal(size=3)
        motion = BaseMotion(*rng.normal(size=(2, 4, 3)), rng.normal(size=3))  # the last one for all
        bases = [Free(np.eye(3), np.zeros(3), BaseMotion(w, a, motion[2])) for w, a in zip(*motion[:2], strict=True)]
        tau = inverse_dynamics(robot.model, *(np.array(part) for part in zip(*rows, strict=True)), gravity, motion)
        expected = [by_mujoco(robot, *row, gravity, base) for row, base in zip(rows, bases, strict=True)]
        assert_allclose(tau, expected, atol=1e-10, err_msg=robot.model.name)


def test_base_motions_of_another_number_of_rows_are_refused(random_robots):
    model = random_robots[0].model
    q = np.zeros((4, model.n))
    with pytest.raises(InputError, match=r"base angular acceleration: expected shape \(3,\) or \(4, 3\).*got \(2, 3\)"):
        inverse_dynamics(model, q, q, q, [0, 0, 0], BaseMotion(angular_acceleration=np.zeros((2, 3))))


HOME = [np.pi / 6, np.pi / 2, 0.40]


def test_mass_matrix_agrees_with_mujoco_and_pinocchio(random_robots, rng):
    for robot in random_robots:
        m = robot.model
        q = rng.normal(size=m.n)
        M = mass_matrix(m, q)
        mj = mujoco_model(robot)
        in_mujoco = mujoco_mass_matrix(robot, mj, mujoco_data(robot, mj, q))
        assert_allclose(M, m.coupling.T @ in_mujoco @ m.coupling, atol=1e-10, err_msg=m.name)
        pin = pinocchio_model(robot)
        upper = np.triu(pinocchio.crba(pin, pin.createData(), pinocchio_vector(robot, pin, m.coupling @ q + m.offset)))
        order = pinocchio_order(robot, pin)
        in_pinocchio = (upper + np.triu(upper, 1).T)[np.ix_(order, order)]
        assert_allclose(M, m.coupling.T @ in_pinocchio @ m.coupling, atol=1e-10, err_msg=m.name)


@pytest.mark.parametrize("name", ["raven2", "raven2_right"])
def test_raven_point_masses_at_home_have_the_inertia_of_the_mechanism_page(name: str) -> None:
    model = load_robot(name)
    points = replace(model, tree=model.tree._replace(inertia=np.zeros((3, 3, 3))))
    # printed with four decimals, three for the mass
    assert_allclose(np.diag(mass_matrix(points, HOME)), [0.1032, 0.0480, 0.231], atol=0.6e-4)
