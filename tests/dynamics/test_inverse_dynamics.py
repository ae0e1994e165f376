from dataclasses import replace

import mujoco
import numpy as np
import pinocchio
import pytest
from numpy.testing import assert_allclose

from catenary.dynamics.inverse_dynamics import BaseMotion, coriolis_matrix, inverse_dynamics
from catenary.dynamics.mass_matrix import mass_matrix
from catenary.errors import InputError, MissingInertiaError
from catenary.gravity.torque import gravity_torque, potential_energy
from catenary.robots.catalog import load_robot
from oracles.mujoco_trees import mujoco_model, mujoco_order
from oracles.pinocchio_trees import pinocchio_model, pinocchio_order, pinocchio_vector
from oracles.random_trees import Floats, RandomRobot, random_rotation


def random_motion(robot: RandomRobot, rng: np.random.Generator) -> tuple[Floats, Floats, Floats]:
    return rng.normal(size=robot.model.n), rng.normal(size=robot.model.n), rng.normal(size=robot.model.n)


def test_torques_on_a_fixed_base_agree_with_mujoco(random_robots: list[RandomRobot]) -> None:
    rng = np.random.default_rng(1)
    for robot in random_robots:
        m = robot.model
        q, qd, qdd = random_motion(robot, rng)
        gravity = 5.0 * rng.normal(size=3)
        mj = mujoco_model(robot, gravity=gravity)
        data = mujoco.MjData(mj)
        order = mujoco_order(robot, mj)
        data.qpos[order] = m.coupling @ q + m.offset
        data.qvel[order] = m.coupling @ qd
        mujoco.mj_forward(mj, data)
        data.qacc[order] = m.coupling @ qdd
        result = np.zeros(mj.nv)
        mujoco.mj_rne(mj, data, 1, result)
        tau = inverse_dynamics(m, q, qd, qdd, gravity)
        assert_allclose(tau, m.coupling.T @ result[order], atol=1e-10, err_msg=m.name)


def test_torques_on_a_fixed_base_agree_with_pinocchio(random_robots: list[RandomRobot]) -> None:
    rng = np.random.default_rng(2)
    for robot in random_robots:
        m = robot.model
        q, qd, qdd = random_motion(robot, rng)
        gravity = 5.0 * rng.normal(size=3)
        pin = pinocchio_model(robot)
        pin.gravity.linear = gravity
        tree_motion = m.coupling @ q + m.offset, m.coupling @ qd, m.coupling @ qdd
        x, xd, xdd = (pinocchio_vector(robot, pin, values) for values in tree_motion)
        expected = pinocchio.rnea(pin, pin.createData(), x, xd, xdd)[pinocchio_order(robot, pin)]
        tau = inverse_dynamics(m, q, qd, qdd, gravity)
        assert_allclose(tau, m.coupling.T @ expected, atol=1e-10, err_msg=m.name)


def test_torques_on_a_moving_base_agree_with_mujoco(random_robots: list[RandomRobot]) -> None:
    rng = np.random.default_rng(3)
    for robot in random_robots:
        m = robot.model
        q, qd, qdd = random_motion(robot, rng)
        R_world_base = random_rotation(rng)
        velocity, omega, alpha, acceleration, gravity = rng.normal(size=(5, 3))
        mj = mujoco_model(robot, gravity=R_world_base @ gravity, base="free")
        data = mujoco.MjData(mj)
        order = mujoco_order(robot, mj)
        quaternion = np.zeros(4)
        mujoco.mju_mat2Quat(quaternion, R_world_base.ravel())
        data.qpos[3:7] = quaternion
        data.qpos[order + 1] = m.coupling @ q + m.offset  # a free joint has 7 positions and 6 velocities
        # MuJoCo's free joint: linear parts in world axes, angular parts in the body's own
        data.qvel[:3], data.qvel[3:6] = velocity, omega
        data.qvel[order] = m.coupling @ qd
        mujoco.mj_forward(mj, data)
        data.qacc[:3], data.qacc[3:6] = R_world_base @ acceleration, alpha
        data.qacc[order] = m.coupling @ qdd
        result = np.zeros(mj.nv)
        mujoco.mj_rne(mj, data, 1, result)
        tau = inverse_dynamics(m, q, qd, qdd, gravity, BaseMotion(omega, alpha, acceleration))
        assert_allclose(tau, m.coupling.T @ result[order], atol=1e-10, err_msg=m.name)


def test_torques_on_a_moving_base_agree_with_pinocchio(random_robots: list[RandomRobot]) -> None:
    rng = np.random.default_rng(4)
    for robot in random_robots:
        m = robot.model
        q, qd, qdd = random_motion(robot, rng)
        R_world_base = random_rotation(rng)
        velocity, omega, alpha, acceleration, gravity = rng.normal(size=(5, 3))
        pin = pinocchio_model(robot, base="free")
        pin.gravity.linear = R_world_base @ gravity
        order = pinocchio_order(robot, pin)
        x = np.zeros(pin.nq)
        x[3:7] = pinocchio.Quaternion(R_world_base).coeffs()
        x[order + 1] = m.coupling @ q + m.offset
        xd, xdd = np.zeros(pin.nv), np.zeros(pin.nv)
        xd[:3], xd[3:6] = velocity, omega
        # Pinocchio's acceleration is the spatial one: that of the origin as a point, less omega x velocity
        xdd[:3], xdd[3:6] = acceleration - np.cross(omega, velocity), alpha
        xd[order], xdd[order] = m.coupling @ qd, m.coupling @ qdd
        expected = pinocchio.rnea(pin, pin.createData(), x, xd, xdd)[order]
        tau = inverse_dynamics(m, q, qd, qdd, gravity, BaseMotion(omega, alpha, acceleration))
        assert_allclose(tau, m.coupling.T @ expected, atol=1e-10, err_msg=m.name)


def test_torques_are_the_terms_of_the_equation_of_motion(random_robots: list[RandomRobot]) -> None:
    rng = np.random.default_rng(5)
    for robot in random_robots:
        m = robot.model
        q, qd, qdd = random_motion(robot, rng)
        gravity = 5.0 * rng.normal(size=3)
        terms = mass_matrix(m, q) @ qdd + coriolis_matrix(m, q, qd) @ qd + gravity_torque(m, q, gravity)
        assert_allclose(inverse_dynamics(m, q, qd, qdd, gravity), terms, atol=1e-10, err_msg=m.name)


def test_an_accelerating_base_is_gravity_the_other_way(random_robots: list[RandomRobot]) -> None:
    rng = np.random.default_rng(6)
    for robot in random_robots[:18]:
        q, qd, qdd = random_motion(robot, rng)
        gravity, acceleration = rng.normal(size=(2, 3))
        base = BaseMotion(linear_acceleration=acceleration)
        assert_allclose(
            inverse_dynamics(robot.model, q, qd, qdd, gravity, base),
            inverse_dynamics(robot.model, q, qd, qdd, gravity - acceleration),
            atol=1e-12,
        )


def test_coriolis_matrix_agrees_with_pinocchio(random_robots: list[RandomRobot]) -> None:
    rng = np.random.default_rng(7)
    for robot in random_robots:
        m = robot.model
        q, qd, _ = random_motion(robot, rng)
        pin = pinocchio_model(robot)
        x, xd = (pinocchio_vector(robot, pin, v) for v in (m.coupling @ q + m.offset, m.coupling @ qd))
        order = pinocchio_order(robot, pin)
        C = pinocchio.computeCoriolisMatrix(pin, pin.createData(), x, xd)[np.ix_(order, order)]
        assert_allclose(coriolis_matrix(m, q, qd), m.coupling.T @ C @ m.coupling, atol=1e-10, err_msg=m.name)


def test_rate_of_the_mass_matrix_less_twice_the_coriolis_matrix_is_skew(
    random_robots: list[RandomRobot],
) -> None:
    rng = np.random.default_rng(8)
    h = 1e-6
    for robot in random_robots:
        m = robot.model
        q, qd, _ = random_motion(robot, rng)
        M_dot = (mass_matrix(m, q + h * qd) - mass_matrix(m, q - h * qd)) / (2 * h)
        C = coriolis_matrix(m, q, qd)
        # central difference, h = 1e-6, of entries up to 200
        assert_allclose(M_dot, C + C.T, atol=3e-7, err_msg=m.name)


def test_coriolis_matrix_is_the_one_of_christoffels_symbols(random_robots: list[RandomRobot]) -> None:
    rng = np.random.default_rng(9)
    for robot in random_robots:
        m = robot.model
        q, a, b = random_motion(robot, rng)
        there, back = coriolis_matrix(m, q, a) @ b, coriolis_matrix(m, q, b) @ a
        assert_allclose(there, back, atol=1e-10, err_msg=m.name)


@pytest.mark.parametrize("seed", [6, 15])
def test_an_unforced_arm_keeps_its_energy(random_robots: list[RandomRobot], seed: int) -> None:
    m = random_robots[seed].model
    gravity = np.array([0.0, 0.0, -9.81])
    rng = np.random.default_rng(seed)

    def rate(state: Floats) -> Floats:
        q, qd = state[: m.n], state[m.n :]
        bias = inverse_dynamics(m, q, qd, np.zeros(m.n), gravity)
        return np.concatenate([qd, np.linalg.solve(mass_matrix(m, q), -bias)])

    def energy(state: Floats) -> float:
        q, qd = state[: m.n], state[m.n :]
        return float(0.5 * qd @ mass_matrix(m, q) @ qd + potential_energy(m, q, gravity))

    state = 0.3 * rng.normal(size=2 * m.n)
    start, moved, h = energy(state), 0.0, 5e-4
    for _ in range(2000):  # one second by Runge-Kutta of fourth order
        k1 = rate(state)
        k2 = rate(state + h / 2 * k1)
        k3 = rate(state + h / 2 * k2)
        k4 = rate(state + h * k3)
        state = state + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        moved = max(moved, abs(float(potential_energy(m, state[: m.n], gravity)) - start))
        assert abs(energy(state) - start) < 1e-5  # the integrator's own error, h^4 times rates of order 100
    assert moved > 1.0  # J: it did fall


def test_batch_gives_what_single_configurations_give(random_robots: list[RandomRobot]) -> None:
    rng = np.random.default_rng(10)
    for robot in random_robots[:9]:
        m = robot.model
        q, qd, qdd = rng.normal(size=(3, 4, m.n))
        gravity = rng.normal(size=(4, 3))
        base = BaseMotion(*rng.normal(size=(3, 3)))
        tau = inverse_dynamics(m, q, qd, qdd, gravity, base)
        level = inverse_dynamics(m, q, qd, qdd, gravity[0])
        C = coriolis_matrix(m, q, qd)
        for k in range(4):
            assert_allclose(tau[k], inverse_dynamics(m, q[k], qd[k], qdd[k], gravity[k], base), atol=0.0)
            assert_allclose(level[k], inverse_dynamics(m, q[k], qd[k], qdd[k], gravity[0]), atol=0.0)
            assert_allclose(C[k], coriolis_matrix(m, q[k], qd[k]), atol=0.0)


def test_wrong_arguments_are_refused_with_a_reason() -> None:
    model = load_robot("raven2")
    q = np.array([0.5, 1.5, 0.4])
    g = np.array([0.0, 0.0, -9.81])
    with pytest.raises(InputError, match=r"qd: expected shape \(3,\), got \(2, 3\)"):
        inverse_dynamics(model, q, np.zeros((2, 3)), q, g)
    with pytest.raises(InputError, match=r"qdd: expected shape \(2, 3\), got \(3,\)"):
        inverse_dynamics(model, [q, q], [q, q], q, g)
    with pytest.raises(InputError, match=r"gravity: expected shape \(3,\) or \(2, 3\)"):
        inverse_dynamics(model, [q, q], [q, q], [q, q], [g, g, g])
    with pytest.raises(InputError, match=r"base angular acceleration\[1\] is inf"):
        inverse_dynamics(model, q, q, q, g, BaseMotion(angular_acceleration=(0.0, np.inf, 0.0)))
    with pytest.raises(InputError, match="qd"):
        coriolis_matrix(model, q, [0.0, np.nan, 0.0])


def test_a_model_without_inertia_is_refused_by_the_links_names() -> None:
    model = replace(load_robot("raven2"), missing_inertia=("elbow",))
    with pytest.raises(MissingInertiaError, match='"elbow"'):
        inverse_dynamics(model, np.zeros(3), np.zeros(3), np.zeros(3), np.zeros(3))
    with pytest.raises(MissingInertiaError, match='"elbow"'):
        coriolis_matrix(model, np.zeros(3), np.zeros(3))
