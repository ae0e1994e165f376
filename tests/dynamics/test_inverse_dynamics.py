from typing import NamedTuple

import mujoco
import numpy as np
import pinocchio
import pytest
from numpy.testing import assert_allclose

from catenary.dynamics.inverse_dynamics import BaseMotion, coriolis_matrix, inverse_dynamics
from catenary.dynamics.mass_matrix import mass_matrix
from catenary.gravity.torque import gravity_torque, potential_energy
from oracles.mujoco_trees import mujoco_model, mujoco_order
from oracles.pinocchio_trees import pinocchio_model, pinocchio_order, pinocchio_vector
from oracles.random_trees import Floats, RandomRobot, random_rotation


def random_motion(robot: RandomRobot, rng: np.random.Generator) -> tuple[Floats, Floats, Floats]:
    return rng.normal(size=robot.model.n), rng.normal(size=robot.model.n), rng.normal(size=robot.model.n)


class Free(NamedTuple):
    """A base that floats in a world: how it stands, its velocity, and how it moves in its own axes."""

    R_world_base: Floats
    velocity: Floats
    motion: BaseMotion


def by_mujoco(robot: RandomRobot, q: Floats, qd: Floats, qdd: Floats, gravity: Floats, base: Free) -> Floats:
    m, (omega, alpha, acceleration) = robot.model, base.motion
    mj = mujoco_model(robot, gravity=base.R_world_base @ gravity, base="free")
    data = mujoco.MjData(mj)
    order = mujoco_order(robot, mj)
    quaternion = np.zeros(4)
    mujoco.mju_mat2Quat(quaternion, base.R_world_base.ravel())
    data.qpos[3:7] = quaternion
    data.qpos[order + 1] = m.coupling @ q + m.offset  # a free joint has 7 positions and 6 velocities
    # MuJoCo's free joint: linear parts in world axes, angular parts in the body's own
    data.qvel[:3], data.qvel[3:6] = base.velocity, omega
    data.qvel[order] = m.coupling @ qd
    mujoco.mj_forward(mj, data)
    data.qacc[:3], data.qacc[3:6] = base.R_world_base @ acceleration, alpha
    data.qacc[order] = m.coupling @ qdd
    result = np.zeros(mj.nv)
    mujoco.mj_rne(mj, data, 1, result)
    return m.coupling.T @ result[order]


def by_pinocchio(
    robot: RandomRobot, q: Floats, qd: Floats, qdd: Floats, gravity: Floats, base: Free
) -> Floats:
    m, (omega, alpha, acceleration) = robot.model, base.motion
    pin = pinocchio_model(robot, base="free")
    pin.gravity.linear = base.R_world_base @ gravity
    order = pinocchio_order(robot, pin)
    x, xd, xdd = np.zeros(pin.nq), np.zeros(pin.nv), np.zeros(pin.nv)
    x[3:7] = pinocchio.Quaternion(base.R_world_base).coeffs()
    x[order + 1] = m.coupling @ q + m.offset
    xd[:3], xd[3:6] = base.velocity, omega
    # Pinocchio's acceleration is the spatial one: that of the origin as a point, less omega x velocity
    xdd[:3], xdd[3:6] = acceleration - np.cross(omega, base.velocity), alpha
    xd[order], xdd[order] = m.coupling @ qd, m.coupling @ qdd
    return m.coupling.T @ pinocchio.rnea(pin, pin.createData(), x, xd, xdd)[order]


@pytest.mark.parametrize("moving", [False, True])
@pytest.mark.parametrize("peer", [by_mujoco, by_pinocchio])
def test_torques_are_what_peers_compute(peer, moving: bool, random_robots: list[RandomRobot]) -> None:
    rng = np.random.default_rng(1)
    for robot in random_robots:
        arm, gravity = random_motion(robot, rng), 5.0 * rng.normal(size=3)
        still = Free(np.eye(3), np.zeros(3), BaseMotion(*np.zeros((3, 3))))
        base = Free(random_rotation(rng), rng.normal(size=3), BaseMotion(*rng.normal(size=(3, 3))))
        tau = inverse_dynamics(robot.model, *arm, gravity, base.motion if moving else None)
        expected = peer(robot, *arm, gravity, base if moving else still)
        assert_allclose(tau, expected, atol=1e-10, err_msg=robot.model.name)


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
