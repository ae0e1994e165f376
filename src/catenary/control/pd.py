"""The PD law, what the loop asks of any controller, and what controllers share."""

from typing import Literal, Protocol, get_args

import numpy as np
from numpy.typing import ArrayLike

from catenary.arrays import Floats, as_array, as_not_negative
from catenary.control.gains import DrivenJoints
from catenary.errors import InputError
from catenary.plant import AT_REST, JointState
from catenary.trajectories.reference import Reference

# "relative": of the velocity's error. "absolute": of the velocity itself, as RAVEN-II's firmware does, which never
# sets a desired velocity; a moving joint then lags its reference by kd/kp seconds
Damping = Literal["relative", "absolute"]


class Controller(Protocol):
    """Joint torques from what is measured and what is wanted.

    Called once a tick, in order of time. It returns a new array each time and leaves its arguments as they are; a
    number that it cannot compute is NaN, never an exception. It raises only for a robot of another size.
    """

    def torque(self, state: JointState, reference: Reference) -> Floats:
        """Return torques (n,) [Nm|N] for the next tick; q of the state is calibrated where there is a corrector."""


class SplitController(Controller, Protocol):
    """A controller that also tells the parts of its last torque = feedback + feedforward, overwritten by the next."""

    @property
    def feedback(self) -> Floats:
        """PD term (n,) [Nm|N]."""

    @property
    def feedforward(self) -> Floats:
        """Model term (n,) [Nm|N]: gravity and inertia."""


def nominal_gravity(gravity: ArrayLike | None) -> Floats | None:
    """Return a gravity vector (3,) [m/s2] for all times, or None, which stands for the sensed one."""
    return None if gravity is None else as_array("gravity", gravity, (3,))


def gravity_and_rates(state: JointState, nominal: Floats | None) -> tuple[Floats, Floats, Floats]:
    """Return gravity [m/s2], and angular velocity and acceleration of the base, each (3,), as kernels take them.

    They are the state's own, or nominal gravity on a base at rest.
    """
    # copies: AT_REST is read-only, which kernels take too, but in five times the time
    if nominal is None:
        return state.gravity, *np.array(state.base_rates)
    return nominal, *np.array(AT_REST)


class JointPD:
    """A spring and a damper to the reference, tau = kp (q_ref - q) + kd (qd_ref - qd).

    [Spong, Hutchinson, Vidyasagar 2006, Robot modeling and control, chapter 8]
    Without gravity compensation it sags by gravity_torque / kp.

    Examples:
        >>> plant = catenary.MujocoPlant(catenary.load_robot("two_link"), start=[0.3, 0.5])
        >>> controller = catenary.JointPD(kp=[200.0, 200.0], kd=[20.0, 20.0])
        >>> reference = catenary.Reference(np.array([0.4, 0.5]), np.zeros(2), np.zeros(2))
        >>> controller.torque(plant.measured_js(), reference).round(6)
        array([20.,  0.])
    """

    def __init__(self, kp: ArrayLike, kd: ArrayLike, *, damping: Damping = "relative", n: int | None = None) -> None:
        """Take the gains, (n,) stiffness [Nm/rad|N/m] and damping [Nms/rad|Ns/m]; "absolute" leaves qd_ref out.

        n is the number of joints that the gains must be for; as many as there are when None.
        """
        self.kp = as_not_negative("kp", kp, (n,))
        self.kd = as_not_negative("kd", kd, self.kp.shape)
        if damping not in get_args(Damping):
            raise InputError(f'damping "{damping}": expected one of {", ".join(get_args(Damping))}')
        self.damping = damping
        self.feedback = np.zeros(len(self.kp))
        self.feedforward = np.zeros(len(self.kp))

    def torque(self, state: JointState, reference: Reference) -> Floats:
        """Return torques (n,) [Nm|N]; NaN if a position or velocity is."""
        if not len(state.q) == len(state.qd) == len(reference.q) == len(reference.qd) == len(self.kp):
            raise InputError(f"PD: the gains are for {len(self.kp)} joints, the robot has {len(state.q)}")
        # a desired velocity that does not count must not bring in its NaN
        velocity_error = reference.qd - state.qd if self.damping == "relative" else -state.qd
        self.feedback[:] = self.kp * (reference.q - state.q) + self.kd * velocity_error
        return self.feedback.copy()


def joint_pd(arm: DrivenJoints, damping: Damping) -> JointPD:
    """Return the PD law of an arm, with its own gains."""
    return JointPD(*arm.gains, damping=damping)
