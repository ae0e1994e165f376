"""Proportional-derivative control of every joint by itself."""

from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

from catenary.arrays import Floats, as_array
from catenary.errors import InputError
from catenary.plant import JointState
from catenary.trajectories.reference import Reference

# "relative": of the velocity's error. "absolute": of the velocity itself, as RAVEN-II's firmware does, which never
# sets a desired velocity; a moving joint then lags its reference by kd/kp seconds
Damping = Literal["relative", "absolute"]


class JointPD:
    """A spring and a damper to the reference, tau = kp (q_ref - q) + kd (qd_ref - qd).

    [Spong, Hutchinson, Vidyasagar 2006, Robot modeling and control, chapter 8]
    Without gravity compensation it sags by gravity_torque / kp.
    """

    def __init__(
        self, kp: ArrayLike, kd: ArrayLike, *, damping: Damping = "relative", n: int | None = None
    ) -> None:
        """Take the gains.

        Args:
            kp: (n,) stiffness [Nm/rad|N/m].
            kd: (n,) damping [Nms/rad|Ns/m].
            damping: "absolute" leaves qd_ref out.
            n: Number of joints that the gains must be for; as many as there are when None.

        Raises:
            InputError: Gains of other lengths, negative or not finite; or no such damping.
        """
        self.kp = as_array("kp", kp, (n,))
        self.kd = as_array("kd", kd, self.kp.shape)
        for name, gains in (("kp", self.kp), ("kd", self.kd)):
            if (gains < 0.0).any():
                raise InputError(f"{name}: expected gains of zero or more, got {gains.tolist()}")
        if damping not in get_args(Damping):
            raise InputError(f'damping "{damping}": expected one of {", ".join(get_args(Damping))}')
        self.damping = damping
        self.feedback = np.zeros(len(self.kp))
        self.feedforward = np.zeros(len(self.kp))

    def torque(self, state: JointState, reference: Reference) -> Floats:
        """Return torques (n,) [Nm|N]; NaN where a position or velocity is.

        Raises:
            InputError: The robot has another number of joints than the gains.
        """
        if not len(state.q) == len(state.qd) == len(reference.q) == len(reference.qd) == len(self.kp):
            raise InputError(f"PD: the gains are for {len(self.kp)} joints, the robot has {len(state.q)}")
        # a desired velocity that does not count must not bring in its NaN
        velocity_error = reference.qd - state.qd if self.damping == "relative" else -state.qd
        self.feedback[:] = self.kp * (reference.q - state.q) + self.kd * velocity_error
        return self.feedback.copy()
