"""PD control with gravity that is estimated while the arm is controlled."""

from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from catenary.arrays import Floats
from catenary.control.pd import JointPD
from catenary.plant import JointState
from catenary.trajectories.reference import Reference


class GravityLearner(Protocol):
    """An estimator of gravity in the loop, such as `GravityEstimator` or `RecursiveGravityEstimator`."""

    def follow(self, state: JointState, q_desired: Floats) -> Floats:
        """Learn from a tick's state, and return the gravity torque (n,) [Nm|N] there."""
        ...


class EstimatedGravityPD:
    """PD and the estimated gravity torque, tau = kp (q_ref - q) + kd (qd_ref - qd) + Z(q, gravity) s_hat.

    [gravity-regressor paper, section III, whose reference rests while it estimates: qd_ref = 0] As s_hat comes to
    hold the arm, the sag of a PD alone goes to zero.
    """

    def __init__(self, kp: ArrayLike, kd: ArrayLike, estimator: GravityLearner) -> None:
        """Take the gains, (n,) stiffness [Nm/rad|N/m] and damping [Nms/rad|Ns/m], and the estimator.

        Raises:
            InputError: Gains of different lengths, negative or not finite.
        """
        self.pd = JointPD(kp, kd)
        self.estimator = estimator
        self.feedback, self.feedforward = self.pd.feedback, np.zeros(len(self.pd.kp))

    def torque(self, state: JointState, reference: Reference) -> Floats:
        """Return torques (n,) [Nm|N]; NaN where a position or velocity is, and where gravity depends on it.

        Raises:
            InputError: The robot has another number of joints than the gains.
        """
        tau = self.pd.torque(state, reference)
        self.feedforward[:] = self.estimator.follow(state, reference.q)
        tau += self.feedforward
        return tau
