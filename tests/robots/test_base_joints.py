import numpy as np
import pinocchio
import pytest
from numpy.testing import assert_allclose

from catenary.dynamics.inverse_dynamics import BaseMotion
from catenary.dynamics.torque_regressor import torque_regressor
from catenary.robots.submodels import on_base_joints
from catenary.spatial import quaternion_from_rotation
from oracles.pinocchio_trees import pinocchio_model, pinocchio_order
from oracles.random_trees import random_robot, random_rotation

_ORDER = np.array([0, 1, 2, 3, 4, 5, 7, 6, 8, 9])  # theirs is (m, mc, Ixx, Ixy, Iyy, Ixz, Iyz, Izz)


@pytest.mark.parametrize("seed", range(20))
def test_regressor_on_base_joints_is_pinocchios_of_a_free_flyer(seed):
    rng, robot = np.random.default_rng(seed), random_robot(seed)
    m, peer = robot.model, pinocchio_model(robot, base="free")
    q, qd, qdd = rng.normal(size=(3, m.n))
    omega, alpha, acceleration, velocity, gravity = rng.normal(size=(5, 3)) * [[1], [3], [3], [1], [6]]
    R, order = random_rotation(rng), pinocchio_order(robot, peer)
    peer.gravity.linear = R @ gravity
    x, xd, xdd = np.zeros(peer.nq), np.zeros(peer.nv), np.zeros(peer.nv)
    x[3:7] = np.roll(quaternion_from_rotation(R), -1)
    x[order + 1], xd[order], xdd[order] = m.coupling @ q + m.offset, m.coupling @ qd, m.coupling @ qdd
    # Pinocchio's acceleration is the spatial one: that of the origin as a point, less omega x velocity
    xd[:6], xdd[:6] = np.r_[velocity, omega], np.r_[acceleration - np.cross(omega, velocity), alpha]
    theirs = pinocchio.computeJointTorqueRegressor(peer, peer.createData(), x, xd, xdd).reshape(peer.nv, -1)
    held, still = on_base_joints(m), np.zeros(6)
    base = BaseMotion(omega, alpha, acceleration, velocity)
    ours = torque_regressor(held, *(np.r_[still, rate] for rate in (q, qd, qdd)), gravity, base)
    # the base's body and each link; their joints count from the free flyer, which has six rates
    bodies = np.concatenate([_ORDER, *(10 * (k - 5) + _ORDER for k in order)])
    assert_allclose(ours[:6, 50:], theirs[:6, bodies], rtol=1e-10, atol=1e-10)
    assert_allclose(ours[6:, 50:], m.coupling.T @ theirs[np.ix_(order, bodies)], rtol=1e-10, atol=1e-10)
