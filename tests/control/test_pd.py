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
