"""What the loop asks of any controller, and PD laws: alone, with gravity added, through the mass matrix.

Gravity is known or estimated meanwhile; gravity compensation alone is one, too. [A. Lewis, B. Hannaford, "Dynamically
evaluated gravity compensation for the RAVEN surgical robot", ICRA 2014: figure 6]
"""

from typing import Literal, Protocol, get_args

import numpy as np
from numpy.typing import ArrayLike

from catenary.arrays import Floats, as_array, as_not_negative, one_for_all
from catenary.control.gains import DAMPING_RATIO, NATURAL_FREQUENCY_HZ, DrivenJoints
from catenary.dynamics.robot_kernels import holding_kernel, inverse_dynamics_kernel, mass_matrix_kernel
from catenary.errors import InputError
from catenary.plant import AT_REST, JointState
from catenary.robots.model import RobotModel
from catenary.spatial import LEVEL
from catenary.trajectories.reference import Reference

_SLOW = {"rad": 0.02, "m": 0.005}  # [rad/s, m/s] v0: below it friction is helped over in part

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


class GravityHold:
    """Gravity compensation alone: the arm stays wherever it is put; the reference is not looked at.

    [The paper, section IV: "passive pose compensator"] Friction f is helped over by f v / max(|v|, v0) in the direction
    of the motion that is meant: v is the hand's here, as measured, and of less than the joint's own friction a part of
    it is left, so that nothing moves by itself. `GravityPD` takes the reference's, which no error can turn back and
    forth: no limit cycle follows, however large f.
    """

    def __init__(self, model: RobotModel, *, gravity: ArrayLike | None = None, friction: ArrayLike = 0.0) -> None:
        """Take the robot, a nominal vector (3,) in base axes [m/s2], the sensed one when None, and f (n,) [Nm|N]."""
        self.model, self.friction = model, as_not_negative("friction", one_for_all(friction, model.n), (model.n,))
        self._slow = np.array([_SLOW[unit] for unit in model.joint_units])
        self.gravity = nominal_gravity(gravity)
        self._holding_torque = holding_kernel(model)
        self.feedback, self.feedforward = np.zeros(model.n), np.zeros(model.n)

    def torque(self, state: JointState, reference: Reference) -> Floats:
        """Return the torques (n,) [Nm|N] that gravity asks for at the measured position."""
        if len(state.q) != self.model.n:
            raise InputError(f"gravity hold: the model has {self.model.n} joints, the robot has {len(state.q)}")
        return self._held(state, state.qd)

    def _held(self, state: JointState, meant: Floats) -> Floats:
        """Return the torques of gravity, and of friction against a motion that is meant, (n,) [rad/s or m/s]."""
        self.feedforward[:] = self._holding_torque(state.q, *gravity_and_rates(state, self.gravity))
        if self.friction.any():  # a velocity that does not count must not bring in its NaN
            self.feedforward += self.friction * meant / np.maximum(np.abs(meant), self._slow)
        return self.feedforward.copy()


class GravityPD(GravityHold):
    """PD plus gravity: tau = kp (q_ref - q) + kd (qd_ref - qd) + g(q).

    PD+DG, dynamic, takes the gravity that the robot senses tick by tick (`state.gravity`), and when its base turns
    (`state.base_rates`) the whole term of a moving base. PD+SG, static, takes one vector for all times.

    Examples:
        >>> arm = catenary.load_robot("two_link")
        >>> controller = catenary.GravityPD(arm, kp=[200.0, 200.0], kd=[20.0, 20.0])
        >>> state = catenary.MujocoPlant(arm, start=[0.3, 0.5]).measured_js()
        >>> reference = catenary.Reference(state.q, np.zeros(2), np.zeros(2))
        >>> np.allclose(controller.torque(state, reference), catenary.gravity_torque(arm, state.q, state.gravity))
        True
    """

    def __init__(
        self,
        model: RobotModel,
        kp: ArrayLike,
        kd: ArrayLike,
        *,
        gravity: ArrayLike | None = None,
        damping: Damping = "relative",
        friction: ArrayLike = 0.0,
    ) -> None:
        """Take the robot, with inertia, and the gains, and compile.

        Args:
            kp: (n,) stiffness [Nm/rad|N/m]; kd: (n,) damping [Nms/rad|Ns/m].
            gravity: (3,) nominal vector in base axes [m/s2]: PD+SG; None takes the sensed one: PD+DG.
            damping: "absolute" leaves qd_ref out.
            friction: (n,) Coulomb friction to help over [Nm|N], in the direction of qd_ref.
        """
        self.pd = JointPD(kp, kd, damping=damping, n=model.n)
        super().__init__(model, gravity=gravity, friction=friction)
        self.feedback = self.pd.feedback

    def torque(self, state: JointState, reference: Reference) -> Floats:
        """Return torques (n,) [Nm|N]; NaN where something that they depend on is."""
        return self.pd.torque(state, reference) + self._held(state, reference.qd)


class GravityLearner(Protocol):
    """An estimator of gravity in the loop, such as `GravityEstimator` or `RecursiveGravityEstimator`."""

    def follow(self, state: JointState, q_desired: Floats) -> Floats:
        """Learn from a tick's state, and return the gravity torque (n,) [Nm|N] there."""


class EstimatedGravityPD:
    """PD and the estimated gravity torque, tau = kp (q_ref - q) + kd (qd_ref - qd) + Z(q, gravity) s_hat.

    [gravity-regressor paper, section III, which prints -Kd qd: that is `damping="absolute"`; relative is ours, the same
    while the reference rests] As s_hat comes to hold the arm, the sag of a PD alone goes to zero.

    Examples:
        >>> arm, kp, kd = catenary.load_robot("two_link"), [200.0, 200.0], [20.0, 20.0]
        >>> controller = catenary.EstimatedGravityPD(kp, kd, catenary.GravityEstimator(arm, kp, kd))
        >>> plant = catenary.MujocoPlant(arm, start=[0.3, 0.5])
        >>> plant.home()
        >>> stay = catenary.go_to([0.3, 0.5], [0.3, 0.5], max_velocity=[1.0, 1.0], max_acceleration=[1.0, 1.0])
        >>> report = catenary.run_loop(plant, controller, stay, duration=5.0)
        >>> bool(np.abs(plant.measured_js().q - [0.3, 0.5]).max() < 1e-3)
        True
    """

    def __init__(
        self, kp: ArrayLike, kd: ArrayLike, estimator: GravityLearner, *, damping: Damping = "relative"
    ) -> None:
        """Take the gains, (n,) stiffness [Nm/rad|N/m] and damping [Nms/rad|Ns/m], and the estimator."""
        self.pd = JointPD(kp, kd, damping=damping)
        self.estimator = estimator
        self.feedback, self.feedforward = self.pd.feedback, np.zeros(len(self.pd.kp))

    def torque(self, state: JointState, reference: Reference) -> Floats:
        """Return torques (n,) [Nm|N]; NaN if a position or velocity is, and where gravity depends on it."""
        feedback = self.pd.torque(state, reference)
        self.feedforward[:] = self.estimator.follow(state, reference.q)
        return feedback + self.feedforward


class InertiaPD:
    """u = M(q) (qdd_ref + kp (q_ref - q) + kv (qd_ref - qd)) + g(q), and C(q, qd) qd where asked for.

    [T. DeWolf, "Robot control part 3: accounting for mass and gravity" (docs/tutorial-two-link.md); with the velocity
    terms, the computed torque of Luh, Walker, Paul 1980]
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


def joint_pd(arm: DrivenJoints, damping: Damping) -> JointPD:
    """Return the PD law of an arm, with its own gains."""
    return JointPD(*arm.gains, damping=damping)


def gravity_pd(arm: DrivenJoints, damping: Damping, *, level: bool) -> GravityPD:
    """Return PD+SG of an arm, by the gravity of a level base, or PD+DG, by sensed gravity."""
    return GravityPD(arm.model, *arm.gains, gravity=LEVEL if level else None, damping=damping)


def gravity_hold(arm: DrivenJoints, damping: Damping, *, level: bool) -> GravityHold:
    """Return gravity compensation alone, likewise; it has no damping."""
    return GravityHold(arm.model, gravity=LEVEL if level else None)


def inertia_pd(arm: DrivenJoints, damping: Damping, *, coriolis: bool) -> InertiaPD:
    """Return the controller of an arm, all of whose errors decay at NATURAL_FREQUENCY_HZ and DAMPING_RATIO."""
    w = 2.0 * np.pi * NATURAL_FREQUENCY_HZ
    return InertiaPD(arm.model, w * w, 2.0 * DAMPING_RATIO * w, motor_inertia=arm.motor_inertia, coriolis=coriolis)
