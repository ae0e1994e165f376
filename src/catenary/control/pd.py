"""Proportional-derivative control of every joint by itself."""

import numpy as np
from numpy.typing import ArrayLike

from catenary.arrays import Floats, as_array
from catenary.compiled import compiled
from catenary.errors import InputError
from catenary.plant import JointState
from catenary.trajectories.reference import Reference


class JointPD:
    """A spring and a damper to the reference, tau = kp (q_ref - q) + kd (qd_ref - qd).

    [Spong, Hutchinson, Vidyasagar 2006, Robot modeling and control, chapter 8]
    Without gravity compensation it sags by gravity_torque / kp.
    """

    def __init__(self, kp: ArrayLike, kd: ArrayLike) -> None:
        """Take the gains.

        Args:
            kp: (n,) stiffness [Nm/rad|N/m].
            kd: (n,) damping [Nms/rad|Ns/m].

        Raises:
            InputError: Gains of different lengths, negative or not finite.
        """
        self.kp = as_array("kp", kp, (None,))
        self.kd = as_array("kd", kd, self.kp.shape)
        for name, gains in (("kp", self.kp), ("kd", self.kd)):
            if (gains < 0.0).any():
                raise InputError(f"{name}: expected gains of zero or more, got {gains.tolist()}")

    def torque(self, state: JointState, reference: Reference) -> Floats:
        """Torques (n,) [Nm|N]; NaN where a position or velocity is.

        Raises:
            InputError: The robot has another number of joints than the gains.
        """
        tau = np.empty(len(self.kp))
        if not pd(self.kp, self.kd, state.q, state.qd, reference.q, reference.qd, tau):
            raise InputError(f"PD: gains are of {len(tau)} joints, the robot has {len(state.q)}")
        return tau


@compiled
def pd(kp: Floats, kd: Floats, q: Floats, qd: Floats, q_ref: Floats, qd_ref: Floats, tau: Floats) -> bool:
    """Write the torques of JointPD; false for wrong sizes."""
    n = len(tau)
    if len(q) != n or len(qd) != n or len(q_ref) != n or len(qd_ref) != n:
        return False
    for j in range(n):
        tau[j] = kp[j] * (q_ref[j] - q[j]) + kd[j] * (qd_ref[j] - qd[j])
    return True
