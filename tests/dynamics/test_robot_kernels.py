"""A robot's kernels beside the plain recursions."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.dynamics import robot_kernels
from catenary.dynamics.inverse_dynamics import BaseMotion, inverse_dynamics, mass_matrix
from catenary.dynamics.kinematics import forward_kinematics
from catenary.gravity.torque import gravity_torque
from catenary.robots.catalog import load_robot
from catenary.robots.model import RobotModel
from oracles.random_trees import Floats, random_robot


def states(model: RobotModel, count: int) -> list[dict[str, Floats]]:
    """Coordinates, velocities, accelerations; gravity and rates of a base that turns."""
    rng = np.random.default_rng(1)
    sizes = {"q": model.n, "qd": model.n, "qdd": model.n, "gravity": 3, "omega": 3, "alpha": 3}
    scales = {"gravity": 5.0}
    return [{k: scales.get(k, 1.0) * rng.normal(size=n) for k, n in sizes.items()} for _ in range(count)]


@pytest.mark.parametrize("m", [load_robot("raven2"), random_robot(8).model, random_robot(17).model])
def test_kernels_give_what_the_recursions_give(m: RobotModel) -> None:
    frame = next(reversed(m.frames))
    made = (
        robot_kernels.gravity_kernel(m),
        robot_kernels.holding_kernel(m),
        robot_kernels.inverse_dynamics_kernel(m),
        robot_kernels.mass_matrix_kernel(m),
        robot_kernels.forward_kinematics_kernel(m, frame),
    )
    for given in states(m, 20):
        q, qd, qdd, gravity, omega, alpha = given.values()
        pose, base = forward_kinematics(m, q, frame), BaseMotion(omega, alpha)
        recursions = (
            gravity_torque(m, q, gravity),
            inverse_dynamics(m, q, 0 * q, 0 * q, gravity, base),
            inverse_dynamics(m, q, qd, qdd, gravity, base),
            mass_matrix(m, q),
            np.column_stack([pose.rotation, pose.position]),
        )
        for kernel, expected in zip(made, recursions, strict=True):
            result = kernel(*(given[name] for name in kernel.inputs))
            # torques up to 1 kNm, summed in another order
            assert_allclose(result, expected, rtol=0.0, atol=1e-12 * max(1.0, np.abs(expected).max()))


def test_many_configurations_go_through_the_kernel(monkeypatch: pytest.MonkeyPatch) -> None:
    m = load_robot("raven2")
    given = states(m, 300)
    q, g = np.array([state["q"] for state in given]), np.array([state["gravity"] for state in given])
    plain, matrices = gravity_torque(m, q, g), mass_matrix(m, q)
    assert robot_kernels.MANY_CONFIGURATIONS > 1000  # fewer are done before a kernel is compiled
    monkeypatch.setattr("catenary.dynamics.robot_kernels.MANY_CONFIGURATIONS", 100)
    assert_allclose(gravity_torque(m, q, g), plain, rtol=0.0, atol=1e-12)
    assert_allclose(gravity_torque(m, q, g[0])[0], plain[0], rtol=0.0, atol=1e-12)
    assert_allclose(mass_matrix(m, q), matrices, rtol=0.0, atol=1e-12)


def test_a_robots_kernels_are_made_once() -> None:
    m = load_robot("raven2")
    assert robot_kernels.gravity_kernel(m) is robot_kernels.gravity_kernel(m)
    assert robot_kernels.gravity_kernel(m) is not robot_kernels.gravity_kernel(replace(m, name="another"))


def test_a_robots_name_is_no_code() -> None:
    model = replace(load_robot("raven2"), name='"""\nraise SystemExit\n"""')
    assert robot_kernels.gravity_kernel(model)(np.zeros(3), np.zeros(3)).shape == (3,)
