from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.dynamics.inverse_dynamics import BaseMotion, inverse_dynamics
from catenary.errors import MissingInertiaError
from catenary.gravity.holding import HoldingKernel
from catenary.gravity.torque import gravity_torque
from catenary.plant import AT_REST
from catenary.robots.catalog import load_robot
from oracles.random_trees import RandomRobot


def test_holding_on_a_turning_base_is_inverse_dynamics_without_joint_motion(
    random_robots: list[RandomRobot],
) -> None:
    rng = np.random.default_rng(1)
    for robot in random_robots:
        m = robot.model
        q, (gravity, linear) = rng.normal(size=m.n), 5.0 * rng.normal(size=(2, 3))
        rates = rng.normal(size=(2, 3))
        expected = inverse_dynamics(
            m, q, np.zeros(m.n), np.zeros(m.n), gravity, BaseMotion(rates[0], rates[1], linear)
        )
        tau = HoldingKernel(m)(q, gravity - linear, rates)
        assert_allclose(tau, expected, atol=1e-11, err_msg=m.name)  # rounding of gravity - linear


def test_holding_on_a_base_at_rest_is_gravity_torque(random_robots: list[RandomRobot]) -> None:
    rng = np.random.default_rng(2)
    for robot in random_robots[:20]:
        m = robot.model
        q, gravity = rng.normal(size=m.n), 5.0 * rng.normal(size=3)
        assert_allclose(
            HoldingKernel(m)(q, gravity, AT_REST), gravity_torque(m, q, gravity), rtol=1e-11, atol=1e-11
        )


def test_angular_acceleration_of_the_base_loads_the_raven_as_much_as_rocking_gravity_does() -> None:
    # rocked between 10 and 20 deg at 1 Hz about joint 1's axis, as in the 2014 paper: 0.74 Nm of torque swing
    model = load_robot("raven2")
    alpha = np.deg2rad(5.0) * (2.0 * np.pi) ** 2
    q = np.array([np.pi / 6, np.pi / 2, 0.40])
    rates = np.array([[0.0, 0.0, 0.0], [0.0, alpha, 0.0]])
    kernel, down = HoldingKernel(model), np.array([0.0, 0.0, -9.81])
    swing = 2.0 * abs(kernel(q, down, rates) - kernel(q, down, AT_REST))[0]
    assert 0.4 < swing < 1.0  # of the order of the holding torque


@pytest.mark.parametrize("which", ["q", "gravity", "rates"])
def test_nan_comes_through(which: str) -> None:
    model = load_robot("raven2")
    given = {
        "q": np.array([0.5, 1.4, 0.4]),
        "gravity": np.array([0.0, 0.0, -9.81]),
        "rates": np.zeros((2, 3)),
    }
    given[which].flat[0] = np.nan
    assert np.isnan(HoldingKernel(model)(given["q"], given["gravity"], given["rates"])).any()


def test_robot_without_inertia_is_refused() -> None:
    with pytest.raises(MissingInertiaError):
        HoldingKernel(replace(load_robot("raven2"), missing_inertia=("link",)))
