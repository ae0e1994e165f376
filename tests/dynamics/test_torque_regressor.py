import numpy as np
import pinocchio
import pytest
from numpy.testing import assert_allclose

from catenary.dynamics.inverse_dynamics import inverse_dynamics
from catenary.dynamics.torque_regressor import link_parameters, torque_regressor, tree_with_parameters
from catenary.errors import InputError
from catenary.robots.catalog import load_robot
from oracles.pinocchio_trees import pinocchio_model, pinocchio_order, pinocchio_vector

TILTED = np.array([1.3, -2.1, -9.4])


def test_regressor_is_pinocchios_and_gives_torques_by_the_links_parameters(random_robots, rng):
    # theirs is (m, mc, Ixx, Ixy, Iyy, Ixz, Iyz, Izz)
    order = np.array([0, 1, 2, 3, 4, 5, 7, 6, 8, 9])
    for robot in random_robots:
        model, peer = robot.model, pinocchio_model(robot)
        peer.gravity.linear = TILTED
        q, qd, qdd = rng.normal(size=(3, model.n))
        x, xd, xdd = model.coupling @ q + model.offset, model.coupling @ qd, model.coupling @ qdd
        theirs = pinocchio.computeJointTorqueRegressor(
            peer, peer.createData(), *(pinocchio_vector(robot, peer, v) for v in (x, xd, xdd))
        )
        rows = pinocchio_order(robot, peer)
        columns = np.concatenate([10 * k + order for k in rows])
        theirs = theirs.reshape(peer.nv, -1)  # of one joint it comes flat
        expected = model.coupling.T @ theirs[np.ix_(rows, columns)]
        ours = torque_regressor(model, q, qd, qdd, TILTED)
        assert_allclose(ours, expected, rtol=1e-10, atol=1e-10)
        torques = inverse_dynamics(model, q, qd, qdd, TILTED)
        assert_allclose(ours @ link_parameters(model.tree), torques, rtol=1e-10, atol=1e-10)


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
