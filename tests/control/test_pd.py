import numpy as np
from numpy.testing import assert_allclose

from catenary.arrays import Floats
from catenary.control.pd import JointPD
from catenary.plant import JointState
from catenary.trajectories.reference import Reference


def state(q: Floats, qd: Floats) -> JointState:
    return JointState(0.0, q, qd, np.zeros_like(q), np.zeros(0), np.zeros(3), 0.0)


def test_torque_is_that_of_a_spring_and_a_damper() -> None:
    rng = np.random.default_rng(0)
    kp, kd = rng.uniform(0.0, 9.0, size=(2, 4))
    q, qd, q_ref, qd_ref = rng.normal(size=(4, 4))
    tau = JointPD(kp, kd).torque(state(q, qd), Reference(q_ref, qd_ref, np.zeros(4)))
    assert_allclose(tau, kp * (q_ref - q) + kd * (qd_ref - qd), rtol=1e-14)


def test_critically_damped_mass_follows_its_closed_form() -> None:
    w, dt = 20.0, 1e-5  # kp = w^2, kd = 2 w on a unit mass
    pd = JointPD([w * w], [2.0 * w])
    q, qd, reference = np.array([1.0]), np.zeros(1), Reference(np.zeros(1), np.zeros(1), np.zeros(1))
    for _ in range(10_000):
        qd = qd + dt * pd.torque(state(q, qd), reference)
        q = q + dt * qd
    t = 10_000 * dt
    assert_allclose(q, (1.0 + w * t) * np.exp(-w * t), rtol=1e-2)  # semi-implicit Euler, w dt = 2e-4
