"""PD control with the gravity torque added, known or estimated meanwhile, and gravity compensation alone.

A. Lewis, B. Hannaford, "Dynamically evaluated gravity compensation for the RAVEN surgical robot", ICRA 2014: figure 6.
"""

from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from catenary.arrays import Floats, as_not_negative, one_for_all
from catenary.control.gains import DrivenJoints
from catenary.control.pd import Damping, JointPD, gravity_and_rates, nominal_gravity
from catenary.dynamics.robot_kernels import holding_kernel
from catenary.errors import InputError
from catenary.plant import JointState
from catenary.robots.model import RobotModel
from catenary.spatial import LEVEL
from catenary.trajectories.reference import Reference

_SLOW = {"rad": 0.02, "m": 0.005}  # [rad/s, m/s] v0: below it friction is helped over in part


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


def gravity_pd(arm: DrivenJoints, damping: Damping, *, level: bool) -> GravityPD:
    """Return PD+SG of an arm, by the gravity of a level base, or PD+DG, by sensed gravity."""
    return GravityPD(arm.model, *arm.gains, gravity=LEVEL if level else None, damping=damping)


def gravity_hold(arm: DrivenJoints, damping: Damping, *, level: bool) -> GravityHold:
    """Return gravity compensation alone, likewise; it has no damping."""
    return GravityHold(arm.model, gravity=LEVEL if level else None)
