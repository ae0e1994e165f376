import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.dynamics.inverse_dynamics import inverse_dynamics
from catenary.dynamics.torque_regressor import link_parameters, torque_regressor, tree_with_parameters
from catenary.errors import InputError
from catenary.robots.catalog import load_robot

TILTED = np.array([1.3, -2.1, -9.4])


def test_regressor_times_parameters_is_inverse_dynamics(random_robots, rng):
    """Column by column it is Pinocchio's: robots/test_submodels.py."""
    for robot in random_robots:
        q, qd, qdd = rng.normal(size=(3, 5, robot.model.n))
        Y = torque_regressor(robot.model, q, qd, qdd, TILTED)
        expected = inverse_dynamics(robot.model, q, qd, qdd, TILTED)
        assert_allclose(Y @ link_parameters(robot.model.tree), expected, rtol=1e-10, atol=1e-10)


def test_parameters_give_the_tree_back(random_robots):
    for robot in random_robots[:20]:
        bare = robot.model.tree._replace(
            mass=np.zeros_like(robot.model.tree.mass),
            com=np.zeros_like(robot.model.tree.com),
            inertia=np.zeros_like(robot.model.tree.inertia),
        )
        tree = tree_with_parameters(bare, link_parameters(robot.model.tree))
        for key in ("mass", "com", "inertia"):
            assert_allclose(getattr(tree, key), getattr(robot.model.tree, key), rtol=1e-10, atol=1e-12)


def test_parameters_that_no_body_has_are_refused():
    tree = load_robot("two_link").tree
    phi = link_parameters(tree)
    phi[0] = -1.0
    with pytest.raises(InputError, match="link 0: mass -1 kg"):
        tree_with_parameters(tree, phi)
