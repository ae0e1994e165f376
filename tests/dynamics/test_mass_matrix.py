from dataclasses import replace

import numpy as np
import pinocchio
import pytest
from numpy.testing import assert_allclose

from catenary.dynamics.mass_matrix import mass_matrix
from catenary.robots.catalog import load_robot
from oracles.mujoco_trees import mujoco_data, mujoco_mass_matrix, mujoco_model
from oracles.pinocchio_trees import pinocchio_model, pinocchio_order, pinocchio_vector

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
        upper = np.triu(
            pinocchio.crba(pin, pin.createData(), pinocchio_vector(robot, pin, m.coupling @ q + m.offset))
        )
        order = pinocchio_order(robot, pin)
        in_pinocchio = (upper + np.triu(upper, 1).T)[np.ix_(order, order)]
        assert_allclose(M, m.coupling.T @ in_pinocchio @ m.coupling, atol=1e-10, err_msg=m.name)


def test_mass_matrix_is_symmetric_and_positive_definite(random_robots, rng):
    for robot in random_robots:
        M = mass_matrix(robot.model, rng.normal(size=(4, robot.model.n)))
        assert_allclose(M, M.transpose(0, 2, 1), atol=1e-12)  # coupling sums in two orders
        assert np.linalg.eigvalsh(M).min() > 0.0


@pytest.mark.parametrize("name", ["raven2", "raven2_right"])
def test_raven_point_masses_at_home_have_the_inertia_of_the_mechanism_page(name: str) -> None:
    model = load_robot(name)
    points = replace(model, tree=model.tree._replace(inertia=np.zeros((3, 3, 3))))
    # printed with four decimals, three for the mass
    assert_allclose(np.diag(mass_matrix(points, HOME)), [0.1032, 0.0480, 0.231], atol=0.6e-4)
