import numpy as np
from numpy.testing import assert_allclose

from catenary.arrays import Floats
from catenary.control.pd import InertiaPD
from catenary.dynamics.inverse_dynamics import coriolis_matrix, mass_matrix
from catenary.gravity.torque import gravity_torque
from catenary.plant import AT_REST, JointState
from catenary.robots.catalog import load_robot
from catenary.trajectories.reference import Reference
from oracles.random_trees import RandomRobot

GRAVITY = np.array([3.0, -1.0, -9.2])


def state(q: Floats, qd: Floats, rates: Floats = AT_REST) -> JointState:
    return JointState(0.0, q, qd, np.zeros(len(q)), np.zeros(0), GRAVITY, 0.0, rates)


def test_torque_is_that_of_the_matrices(random_robots: list[RandomRobot]) -> None:
    rng = np.random.default_rng(1)
    m = random_robots[3].model
    q, qd, q_ref, qd_ref, qdd_ref = rng.normal(size=(5, m.n))
    kp, kv = rng.uniform(0.0, 50.0, (2, m.n))
    M, C = mass_matrix(m, q), coriolis_matrix(m, q, qd)
    g = gravity_torque(m, q, GRAVITY)
    feedback = M @ (kp * (q_ref - q) + kv * (qd_ref - qd))
    reference = Reference(q_ref, qd_ref, qdd_ref)
    plain, full = InertiaPD(m, kp, kv), InertiaPD(m, kp, kv, coriolis=True)
    assert_allclose(plain.torque(state(q, qd), reference), feedback + M @ qdd_ref + g, atol=1e-8)
    assert_allclose(full.torque(state(q, qd), reference), feedback + M @ qdd_ref + C @ qd + g, atol=1e-8)
    assert_allclose(plain.feedback, feedback, atol=1e-8)


def test_motors_add_their_inertia_to_both_terms() -> None:
    arm = load_robot("raven2")
    q, qd = np.array([0.5, 1.4, 0.4]), np.zeros(3)
    reference = Reference(q + np.array([0.1, 0.0, 0.01]), qd, np.array([1.0, 2.0, 0.1]))
    motors = np.array([[0.27, 0.03, 0.5], [0.03, 0.21, 0.5], [0.5, 0.5, 65.0]])
    with_motors = InertiaPD(arm, 900.0, 40.0, motor_inertia=motors)
    without = InertiaPD(arm, 900.0, 40.0)
    added = with_motors.torque(state(q, qd), reference) - without.torque(state(q, qd), reference)
    assert_allclose(added, motors @ (900.0 * (reference.q - q) + reference.qdd), rtol=1e-10)
