import numpy as np
import pinocchio
import pytest
from numpy.testing import assert_allclose

from catenary.dynamics.inverse_dynamics import inverse_dynamics
from catenary.dynamics.lines import inverse_dynamics_line
from catenary.dynamics.torque_derivatives import torque_derivatives
from catenary.errors import MissingInertiaError
from catenary.kernels.derivatives import derivative_line
from catenary.kernels.tracing import evaluate_line
from catenary.robots.catalog import load_robot
from oracles.pinocchio_trees import pinocchio_model, pinocchio_order, pinocchio_vector

LEVEL = np.array([0.0, 0.0, -9.81])


def test_derivatives_are_those_of_pinocchio(random_robots, rng: np.random.Generator) -> None:
    for robot in random_robots[::3]:
        m, gravity = robot.model, 5.0 * rng.normal(size=3)
        q, qd, qdd = rng.normal(size=(3, m.n))
        pin = pinocchio_model(robot)
        pin.gravity.linear = gravity
        motion = (m.coupling @ q + m.offset, m.coupling @ qd, m.coupling @ qdd)
        data, order = pin.createData(), pinocchio_order(robot, pin)
        theirs = pinocchio.computeRNEADerivatives(pin, data, *(pinocchio_vector(robot, pin, v) for v in motion))
        # run as Python: to compile a line takes seconds
        line = derivative_line(inverse_dynamics_line(m, moving_base=False), ("q", "qd", "qdd"))
        both = np.reshape(evaluate_line(line, q=q, qd=qd, qdd=qdd, gravity=gravity), (m.n, 3, m.n))
        for ours, of_tree in zip(both.swapaxes(0, 1), theirs, strict=True):
            expected = m.coupling.T @ np.asarray(of_tree)[np.ix_(order, order)] @ m.coupling
            assert_allclose(ours, expected, atol=1e-9, err_msg=m.name)


@pytest.mark.parametrize("name", ["raven2", "two_link", "ur5e"])
def test_derivatives_are_differences_of_torques_in_every_row(name: str, rng: np.random.Generator) -> None:
    model, h = load_robot(name), 1e-6
    q, qd, qdd = rng.normal(size=(3, 4, model.n))
    found = torque_derivatives(model, q, qd, qdd, LEVEL)
    for i, step in enumerate(h * np.eye(model.n)):
        moves = [(step, 0.0, 0.0), (0.0, step, 0.0), (0.0, 0.0, step)]
        for part, (dq, dqd, dqdd) in zip(found, moves, strict=True):
            more, less = (inverse_dynamics(model, q + s * dq, qd + s * dqd, qdd + s * dqdd, LEVEL) for s in (1.0, -1.0))
            assert_allclose(part[:, :, i], (more - less) / (2 * h), atol=1e-6)  # central difference, h = 1e-6
    single = torque_derivatives(model, q[2], qd[2], qdd[2], LEVEL)
    assert_allclose(single.by_q, found.by_q[2], atol=1e-12)
    assert single.by_qd.shape == (model.n, model.n)


def test_links_without_inertia_are_refused() -> None:
    model = load_robot("dvrk_psm")
    with pytest.raises(MissingInertiaError):
        torque_derivatives(model, *np.zeros((3, model.n)), LEVEL)
