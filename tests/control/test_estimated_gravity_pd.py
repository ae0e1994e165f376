import numpy as np
from numpy.testing import assert_allclose

from catenary.control.estimated_gravity_pd import EstimatedGravityPD
from catenary.control.pd import JointPD
from catenary.gravity.compact import compact_regressor
from catenary.gravity.estimator import GravityEstimator
from catenary.gravity.torque import gravity_torque
from catenary.plant import JointState
from catenary.robots.catalog import load_robot
from catenary.trajectories.reference import Reference

KP, KD = np.array([9.0, 8.0, 7.0]), np.array([3.0, 2.0, 1.0])


def test_torque_is_the_pds_and_the_estimated_gravity() -> None:
    arm = load_robot("raven2")
    estimator = GravityEstimator(arm, KP, KD, s0=compact_regressor(arm).parameters())
    gravity = np.array([1.0, 2.0, -9.0])
    q, qd = np.array([0.4, 1.2, 0.4]), np.array([0.01, 0.0, -0.02])
    state = JointState(0.0, q, qd, np.zeros(3), np.zeros(0), gravity, 0.0)
    reference = Reference(q + 0.1, qd + 0.2, np.zeros(3))
    # at the first tick no time has passed: the parameters are still those that it began with
    assert_allclose(
        EstimatedGravityPD(KP, KD, estimator).torque(state, reference),
        JointPD(KP, KD).torque(state, reference) + gravity_torque(arm, q, gravity),
        atol=1e-12,
    )


def test_what_the_spring_holds_at_rest_moves_into_the_estimate() -> None:
    arm = load_robot("raven2")
    controller = EstimatedGravityPD(KP, KD, GravityEstimator(arm, KP, KD))
    q = np.array([0.4, 1.2, 0.4])
    down = np.array([0.0, 0.0, -9.81])
    reference = Reference(q + 0.1, np.zeros(3), np.zeros(3))
    states = (JointState(t, q, np.zeros(3), np.zeros(3), np.zeros(0), down, 0.0) for t in (0.0, 0.05))
    first, second = (controller.torque(state, reference) for state in states)
    # Omega = 2 / s over 0.05 s adds a tenth of kp (q_d - q); Z Z^+ is 1 but for its damping
    assert_allclose(second - first, 0.1 * 0.1 * KP, rtol=0.02)
