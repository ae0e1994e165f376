import numpy as np
import pinocchio
from numpy.testing import assert_allclose

from catenary.dynamics.torque_derivatives import torque_derivatives
from oracles.pinocchio_trees import pinocchio_model, pinocchio_order, pinocchio_vector


def test_derivatives_are_those_of_pinocchio(random_robots, rng: np.random.Generator) -> None:
    for robot in random_robots:
        m, gravity = robot.model, 5.0 * rng.normal(size=3)
        q, qd, qdd = rng.normal(size=(3, m.n))
        pin = pinocchio_model(robot)
        pin.gravity.linear = gravity
        motion = (m.coupling @ q + m.offset, m.coupling @ qd, m.coupling @ qdd)
        data, order = pin.createData(), pinocchio_order(robot, pin)
        theirs = pinocchio.computeRNEADerivatives(pin, data, *(pinocchio_vector(robot, pin, v) for v in motion))
        found = torque_derivatives(m, q, qd, qdd, gravity)
        for ours, of_tree in zip(found, theirs, strict=True):
            expected = m.coupling.T @ np.asarray(of_tree)[np.ix_(order, order)] @ m.coupling
            assert_allclose(ours, expected, atol=1e-9, err_msg=m.name)
