from dataclasses import replace

import mujoco
import numpy as np
import pinocchio
import pytest
from numpy.testing import assert_allclose

from catenary.errors import InputError
from catenary.gravity.torque import center_of_mass, center_of_mass_jacobian
from catenary.robots.catalog import load_robot
from oracles.mujoco_trees import mujoco_data, mujoco_model, mujoco_order
from oracles.pinocchio_trees import pinocchio_model, pinocchio_order, pinocchio_vector


def test_it_is_where_mujoco_and_pinocchio_have_it(random_robots, rng) -> None:
    for robot in random_robots[::2]:
        m = robot.model
        q = rng.normal(size=m.n)
        mj, pin = mujoco_model(robot), pinocchio_model(robot)
        data, pin_data = mujoco_data(robot, mj, q), pin.createData()
        x = pinocchio_vector(robot, pin, m.coupling @ q + m.offset)
        # Pinocchio counts the moving links alone, MuJoCo also those fixed to the base
        assert_allclose(center_of_mass(m, q), pinocchio.centerOfMass(pin, pin_data, x), atol=1e-10)
        if np.isclose(mj.body_subtreemass[0], m.tree.mass.sum()):
            assert_allclose(center_of_mass(m, q), data.subtree_com[0], atol=1e-10)
        linear = np.zeros((3, mj.nv))
        mujoco.mj_jacSubtreeCom(mj, data, linear, 0)
        share = mj.body_subtreemass[0] / m.tree.mass.sum()
        expected = share * linear[:, mujoco_order(robot, mj)] @ m.coupling
        assert_allclose(center_of_mass_jacobian(m, q), expected, atol=1e-10, err_msg=m.name)
        J = np.asarray(pinocchio.jacobianCenterOfMass(pin, pin_data, x)).reshape(3, -1)
        expected = J[:, pinocchio_order(robot, pin)] @ m.coupling
        assert_allclose(center_of_mass_jacobian(m, q), expected, atol=1e-10, err_msg=m.name)


def test_what_has_no_mass_is_refused() -> None:
    arm = load_robot("raven2")
    empty = replace(arm, tree=arm.tree._replace(mass=np.zeros(3)))
    with pytest.raises(InputError, match="no moving link has a mass"):
        center_of_mass(empty, np.zeros(3))
