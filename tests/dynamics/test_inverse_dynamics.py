from dataclasses import replace

import numpy as np
import pinocchio
import pytest
from numpy.testing import assert_allclose
from scipy.integrate import solve_ivp

from catenary.dynamics.inverse_dynamics import BaseMotion, coriolis_matrix, inverse_dynamics, mass_matrix
from catenary.errors import InputError
from catenary.gravity.torque import gravity_torque, potential_energy
from catenary.robots.catalog import load_robot
from oracles.floating_base import Free, by_mujoco, by_pinocchio
from oracles.mujoco_trees import mujoco_data, mujoco_mass_matrix, mujoco_model
from oracles.pinocchio_trees import pinocchio_model, pinocchio_order, pinocchio_vector
from oracles.random_trees import Floats, RandomRobot, random_rotation


def random_motion(robot: RandomRobot, rng: np.random.Generator) -> tuple[Floats, Floats, Floats]:
    return rng.normal(size=robot.model.n), rng.normal(size=robot.model.n), rng.normal(size=robot.model.n)


@pytest.mark.parametrize("moving", [False, True])
@pytest.mark.parametrize("peer", [by_mujoco, by_pinocchio])
def test_torques_are_what_peers_compute(peer, moving, random_robots, rng):
    for robot in random_robots:
        arm, gravity = random_motion(robot, rng), 5.0 * rng.normal(size=3)
        still = Free(np.eye(3), np.zeros(3), BaseMotion(*np.zeros((3, 3))))
        base = Free(random_rotation(rng), rng.normal(size=3), BaseMotion(*rng.normal(size=(3, 3))))
        tau = inverse_dynamics(robot.model, *arm, gravity, base.motion if moving else None)
        expected = peer(robot, *arm, gravity, base if moving else still)
        assert_allclose(tau, expected, atol=1e-10, err_msg=robot.model.name)


def test_coriolis_matrix_agrees_with_pinocchio_and_is_the_term_of_the_equation_of_motion(random_robots, rng):
    for robot in random_robots:
        m, gravity = robot.model, 5.0 * rng.normal(size=3)
        q, qd, qdd = random_motion(robot, rng)
        pin = pinocchio_model(robot)
        x, xd = (pinocchio_vector(robot, pin, v) for v in (m.coupling @ q + m.offset, m.coupling @ qd))
        order = pinocchio_order(robot, pin)
        C = pinocchio.computeCoriolisMatrix(pin, pin.createData(), x, xd)[np.ix_(order, order)]
        assert_allclose(coriolis_matrix(m, q, qd), m.coupling.T @ C @ m.coupling, atol=1e-10, err_msg=m.name)
        there, back = coriolis_matrix(m, q, qd) @ qdd, coriolis_matrix(m, q, qdd) @ qd
        assert_allclose(there, back, atol=1e-10, err_msg=m.name)  # as Christoffel's symbols have it
        terms = mass_matrix(m, q) @ qdd + coriolis_matrix(m, q, qd) @ qd + gravity_torque(m, q, gravity)
        assert_allclose(inverse_dynamics(m, q, qd, qdd, gravity), terms, atol=1e-10, err_msg=m.name)


def test_rate_of_the_mass_matrix_less_twice_the_coriolis_matrix_is_skew(random_robots, rng):
    h = 1e-6
    for robot in random_robots:
        m = robot.model
        q, qd, _ = random_motion(robot, rng)
        M_dot = (mass_matrix(m, q + h * qd) - mass_matrix(m, q - h * qd)) / (2 * h)
        C = coriolis_matrix(m, q, qd)
        # central difference, h = 1e-6, of entries up to 200
        assert_allclose(M_dot, C + C.T, atol=3e-7, err_msg=m.name)


@pytest.mark.parametrize("seed", [6, 15])
def test_an_unforced_arm_keeps_its_energy(random_robots, seed: int, rng) -> None:
    m, gravity = random_robots[seed].model, np.array([0.0, 0.0, -9.81])

    def rate(_: float, state: Floats) -> Floats:
        q, qd = np.split(state, 2)
        bias = inverse_dynamics(m, q, qd, np.zeros(m.n), gravity)
        return np.concatenate([qd, np.linalg.solve(mass_matrix(m, q), -bias)])

    motion = solve_ivp(rate, (0.0, 1.0), 0.3 * rng.normal(size=2 * m.n), rtol=1e-9, atol=1e-9)
    q, qd = np.split(motion.y.T, 2, axis=1)
    potential = potential_energy(m, q, gravity)
    energy = potential + 0.5 * np.einsum("ki,kij,kj->k", qd, mass_matrix(m, q), qd)
    assert_allclose(energy, energy[0], atol=1e-5)  # the integrator's own error
    assert np.ptp(potential) > 1.0  # J: it did fall


def test_each_row_has_the_base_motion_of_its_own(random_robots, rng):
    for robot in random_robots[:3]:
        rows, gravity = [random_motion(robot, rng) for _ in range(4)], 5.0 * rng.normal(size=3)
        motion = BaseMotion(*rng.normal(size=(2, 4, 3)), rng.normal(size=3))  # the last one for all
        bases = [Free(np.eye(3), np.zeros(3), BaseMotion(w, a, motion[2])) for w, a in zip(*motion[:2], strict=True)]
        tau = inverse_dynamics(robot.model, *(np.array(part) for part in zip(*rows, strict=True)), gravity, motion)
        expected = [by_mujoco(robot, *row, gravity, base) for row, base in zip(rows, bases, strict=True)]
        assert_allclose(tau, expected, atol=1e-10, err_msg=robot.model.name)


def test_base_motions_of_another_number_of_rows_are_refused(random_robots):
    model = random_robots[0].model
    q = np.zeros((4, model.n))
    with pytest.raises(InputError, match=r"base angular acceleration: expected shape \(3,\) or \(4, 3\).*got \(2, 3\)"):
        inverse_dynamics(model, q, q, q, [0, 0, 0], BaseMotion(angular_acceleration=np.zeros((2, 3))))


HOME = [np.pi / 6, np.pi / 2, 0.40]


def test_mass_matrix_agrees_with_mujoco_and_pinocchio(random_robots, rng):
    for robot in random_robots:
        m = robot.model
        q = rng.normal(size=m.n)
        M = mass_matrix(m, q)
        mj = mujoco_model(robot)
        in_mujoco = mujoco_mass_matrix(robot, mj, mujoco_data(robot, mj, q))
        assert_allclose(M, m.coupling.T @ in_mujoco @ m.coupling, atol=1e-10, err_msg=m.name)
        pin = pinocchio_model(robot)
        upper = np.triu(pinocchio.crba(pin, pin.createData(), pinocchio_vector(robot, pin, m.coupling @ q + m.offset)))
        order = pinocchio_order(robot, pin)
        in_pinocchio = (upper + np.triu(upper, 1).T)[np.ix_(order, order)]
        assert_allclose(M, m.coupling.T @ in_pinocchio @ m.coupling, atol=1e-10, err_msg=m.name)


def test_mass_matrix_is_symmetric_and_positive_definite(random_robots, rng):
    for robot in random_robots:
        M = mass_matrix(robot.model, rng.normal(size=(4, robot.model.n)))
        assert_allclose(M, M.transpose(0, 2, 1), atol=1e-12)  # coupling sums in two orders
        assert np.linalg.eigvalsh(M).min() > 0.0


@pytest.mark.parametrize("name", ["raven2", "raven2_right"])
def test_raven_point_masses_at_home_have_the_inertia_of_the_mechanism_page(name: str) -> None:
    model = load_robot(name)
    points = replace(model, tree=model.tree._replace(inertia=np.zeros((3, 3, 3))))
    # printed with four decimals, three for the mass
    assert_allclose(np.diag(mass_matrix(points, HOME)), [0.1032, 0.0480, 0.231], atol=0.6e-4)
