"""PD control through the mass matrix: the errors ask for accelerations, the model says what torques give them.

T. DeWolf, "Robot control part 3: accounting for mass and gravity" (docs/tutorial-two-link.md); with the velocity terms,
the computed torque of Luh, Walker, Paul 1980.
"""

import numpy as np
from numpy.typing import ArrayLike

from catenary.arrays import Floats, as_array, one_for_all
from catenary.control.gains import DAMPING_RATIO, NATURAL_FREQUENCY_HZ, DrivenJoints
from catenary.control.pd import Damping, JointPD, gravity_and_rates, nominal_gravity
from catenary.dynamics.robot_kernels import holding_kernel, inverse_dynamics_kernel, mass_matrix_kernel
from catenary.errors import InputError
from catenary.plant import JointState
from catenary.robots.model import RobotModel
from catenary.trajectories.reference import Reference


class InertiaPD:
    """u = M(q) (qdd_ref + kp (q_ref - q) + kv (qd_ref - qd)) + g(q), and C(q, qd) qd where asked for.

    Every joint's error then obeys e'' + kv e' + kp e = 0, but for the velocity terms. The tutorial leaves these out on
    purpose: they need a model that is right in its moments of inertia, and one that is wrong feeds energy in.

    `feedback` is M(q) (kp e + kv ed), `feedforward` the rest. On a base that turns (`state.base_rates`) g(q) is the
    whole term of a moving base.

    Examples:
        >>> arm = catenary.load_robot("two_link")
        >>> controller = catenary.InertiaPD(arm, kp=400.0, kv=40.0)
    """

    def __init__(
        self,
        model: RobotModel,
        kp: ArrayLike,
        kv: ArrayLike,
        *,
        gravity: ArrayLike | None = None,
        motor_inertia: ArrayLike | None = None,
        coriolis: bool = False,
    ) -> None:
        """Take the robot, with inertia, and the gains, and compile.

        Args:
            kp: () or (n,) square of the wanted natural frequency [1/s2].
            kv: () or (n,) twice damping ratio times frequency [1/s].
            gravity: (3,) nominal vector in base axes [m/s2]; None takes the sensed one.
            motor_inertia: (n, n) what motors and gearboxes add to M(q) at the joints; none when None. Behind ratios
                of a hundred it is the larger part (reflected_inertia).
            coriolis: Add C(q, qd) qd.
        """
        n = model.n
        self.model = model
        self.pd = JointPD(one_for_all(kp, n), one_for_all(kv, n), n=n)
        self.gravity = nominal_gravity(gravity)
        motors = np.zeros((n, n)) if motor_inertia is None else motor_inertia
        self.motor_inertia = as_array("motor_inertia", motors, (n, n))
        self.coriolis = coriolis
        self._mass_matrix = mass_matrix_kernel(model)
        self._bias_torque = inverse_dynamics_kernel(model) if coriolis else holding_kernel(model)
        self.feedback, self.feedforward = np.zeros(n), np.zeros(n)

    def torque(self, state: JointState, reference: Reference) -> Floats:
        """Return torques (n,) [Nm|N]; NaN where something that they depend on is."""
        correction = self.pd.torque(state, reference)
        if len(reference.qdd) != self.model.n:
            raise InputError(f"inertia PD: the model has {self.model.n} joints, the reference {len(reference.qdd)}")
        motion = (state.q, state.qd, np.zeros(self.model.n)) if self.coriolis else (state.q,)
        bias = self._bias_torque(*motion, *gravity_and_rates(state, self.gravity))
        inertia = self._mass_matrix(state.q) + self.motor_inertia
        self.feedback[:] = inertia @ correction
        self.feedforward[:] = inertia @ reference.qdd + bias
        return self.feedback + self.feedforward


def inertia_pd(arm: DrivenJoints, damping: Damping, *, coriolis: bool) -> InertiaPD:
    """Return the controller of an arm, all of whose errors decay at NATURAL_FREQUENCY_HZ and DAMPING_RATIO."""
    w = 2.0 * np.pi * NATURAL_FREQUENCY_HZ
    return InertiaPD(arm.model, w * w, 2.0 * DAMPING_RATIO * w, motor_inertia=arm.motor_inertia, coriolis=coriolis)
