"""Proportional-derivative control of every joint by itself."""

from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

from catenary.arrays import Floats, as_array
from catenary.errors import InputError
from catenary.kernels.compiled import compiled, inlined
from catenary.plant import JointState
from catenary.trajectories.reference import Reference

# "relative": of the velocity's error. "absolute": of the velocity itself, as RAVEN-II's firmware does, which never
# sets a desired velocity; a moving joint then lags its reference by kd/kp seconds
Damping = Literal["relative", "absolute"]


class Gains:
    """Stiffness and damping of n joints, checked."""

    def __init__(self, kp: ArrayLike, kd: ArrayLike, damping: Damping, n: int | None = None) -> None:
        """Take kp (n,) [Nm/rad|N/m] and kd (n,) [Nms/rad|Ns/m].

        Raises:
            InputError: Of different lengths, negative or not finite; or no such damping.
        """
        self.kp = as_array("kp", kp, (n,))
        self.kd = as_array("kd", kd, self.kp.shape)
        for name, gains in (("kp", self.kp), ("kd", self.kd)):
            if (gains < 0.0).any():
                raise InputError(f"{name}: expected gains of zero or more, got {gains.tolist()}")
        if damping not in get_args(Damping):
            raise InputError(f'damping "{damping}": expected one of {", ".join(get_args(Damping))}')
        self.damping = damping
        # kp, kd, and what the reference's velocity is multiplied by
        follow = 1.0 if damping == "relative" else 0.0
        self.rows = np.stack([self.kp, self.kd, np.full(len(self.kp), follow)])


class JointPD:
    """A spring and a damper to the reference, tau = kp (q_ref - q) + kd (qd_ref - qd).

    [Spong, Hutchinson, Vidyasagar 2006, Robot modeling and control, chapter 8]
    Without gravity compensation it sags by gravity_torque / kp.
    """

    def __init__(self, kp: ArrayLike, kd: ArrayLike, *, damping: Damping = "relative") -> None:
        """Take the gains.

        Args:
            kp: (n,) stiffness [Nm/rad|N/m].
            kd: (n,) damping [Nms/rad|Ns/m].
            damping: "absolute" leaves qd_ref out.

        Raises:
            InputError: Gains of different lengths, negative or not finite.
        """
        self.gains = Gains(kp, kd, damping)
        self.kp, self.kd = self.gains.kp, self.gains.kd
        self.feedback = np.zeros(len(self.kp))
        self.feedforward = np.zeros(len(self.kp))

    def torque(self, state: JointState, reference: Reference) -> Floats:
        """Torques (n,) [Nm|N]; NaN where a position or velocity is.

        Raises:
            InputError: The robot has another number of joints than the gains.
        """
        tau = np.empty(len(self.kp))
        rows = self.gains.rows
        if not pd(rows, state.q, state.qd, reference.q, reference.qd, self.feedback, tau):
            raise InputError(f"PD: gains are of {len(tau)} joints, the robot has {len(state.q)}")
        return tau


@inlined
def fits(n: int, q: Floats, qd: Floats, q_ref: Floats, qd_ref: Floats) -> bool:
    """Whether state and reference are of n joints; compiled code does not look at bounds."""
    return len(q) == n and len(qd) == n and len(q_ref) == n and len(qd_ref) == n


@inlined
def pd_term(gains: Floats, j: int, q: float, qd: float, q_ref: float, qd_ref: float) -> float:
    """Spring and damper of joint j; `gains` are the rows of Gains."""
    # a desired velocity that does not count must not bring in its NaN
    moving = qd_ref if gains[2, j] != 0.0 else 0.0
    return float(gains[0, j] * (q_ref - q) + gains[1, j] * (moving - qd))


@compiled
def pd(
    gains: Floats, q: Floats, qd: Floats, q_ref: Floats, qd_ref: Floats, feedback: Floats, tau: Floats
) -> bool:
    """Write the torques of JointPD, twice; false for wrong sizes. `gains` are the rows of Gains."""
    n = len(tau)
    if not fits(n, q, qd, q_ref, qd_ref):
        return False
    for j in range(n):
        tau[j] = pd_term(gains, j, q[j], qd[j], q_ref[j], qd_ref[j])
        feedback[j] = tau[j]
    return True
