"""Gravity compensation with an undeclared load: weighed while the arm holds, then carried, or refused."""

from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from catenary.arrays import Floats, as_not_negative, as_positive
from catenary.control.pd import GravityHold, JointPD
from catenary.dynamics.actuation_loads import ActuationLoads
from catenary.dynamics.external_torque import IN_95_PERCENT, MomentumObserver
from catenary.dynamics.kinematics import forward_kinematics, jacobian
from catenary.plant import JointState
from catenary.robots.model import RobotModel
from catenary.spatial import angle_between
from catenary.trajectories.reference import Reference

GuidingState = Literal["weighing", "guided", "refused"]
_SETTLE_S, _STILL_S = 0.1, 0.25  # [s] until the observer's torques count, and at rest until the load is known
_SURE_S = 0.5  # [s] after which a load that is above the bound for sure is refused, at rest or not
_ADAPT_S = 0.1  # [s] time constant by which a load is carried
_LIGHT_KG = 0.1  # [kg] of a load whose place is hardly known
_STILL_SPEED = 0.02  # [rad/s or m/s] of joints that hold
_REACH_M = 0.15  # [m] standard deviation of a load's place about its frame
_PLUMB_RAD = 0.35  # [rad] from gravity, within which a force is a load's and not a hand's
_FALLING_S = 0.1  # [s] for which it is, until the arm holds
_KEPT_SHARE = 0.8  # of what earlier poses tell of a load, at each later one
_ODD_SIGMAS = 4.0  # standard deviations that a load leaves of a joint's torque: something else pushes


class HandGuiding(GravityHold):
    """Zero gravity in which no untold load falls: the arm holds until the load is weighed, and then carries it.

    It begins "weighing": PD holds it where it is, and a load on a frame, mass and place together, that explains the
    observer's torques is carried at once. At rest for a quarter of a second it is "guided", or, where the load may be
    more than `max_payload` in its interval of 95 %, "refused": then it goes on holding. While guided, a force along
    gravity that noise does not explain (a load was taken up or put down), or any beyond `max_push`, makes it hold and
    weigh again. One pose does not tell how high above or below the frame a load is; each later one at rest does.

    Examples:
        >>> arm = catenary.load_robot("panda")
        >>> kp = np.array([250.0, 2190.0, 122.0, 764.0, 65.0, 68.0, 12.0])
        >>> guiding = catenary.HandGuiding(arm, kp, kp / 25.0, deviation=np.full(7, 0.3), max_payload=3.0)
        >>> guiding.state
        'weighing'
    """

    def __init__(
        self,
        model: RobotModel,
        kp: ArrayLike,
        kd: ArrayLike,
        *,
        deviation: ArrayLike,
        max_payload: float,
        max_push: float = 60.0,
        damping: float = 0.3,
        frame: str | None = None,
        gravity: ArrayLike | None = None,
        loads: ActuationLoads | None = None,
    ) -> None:
        """Take the robot, and the gains (n,) that hold it.

        Args:
            deviation: Standard deviation (n,) of torques where nothing touches, as of `MomentumObserver`.
            max_payload: Largest mass that is carried [kg].
            max_push: Force of a hand at the frame, beyond which the arm holds [N].
            damping: Share of kd that damps it while guided.
            frame: What carries the load; the tip when None.
            gravity: A nominal vector (3,) [m/s2]; None takes the sensed one.
            loads: Friction and rotors, as `known_loads(model)`.
        """
        super().__init__(model, gravity=gravity)
        self.pd, self.frame = JointPD(kp, kd, n=model.n), model.tip if frame is None else frame
        model.frame(self.frame)
        self.max_payload = float(as_positive("max_payload", max_payload))
        self.max_push = float(as_positive("max_push", max_push))
        self.damping = float(as_not_negative("damping", damping))
        spread = as_not_negative("deviation", deviation, np.shape(deviation))
        self.observer = MomentumObserver(model, loads=loads, deviation=spread)
        self.state: GuidingState = "weighing"
        self._held_at: Floats | None = None
        self.reset()

    def reset(self) -> None:
        """Hold and weigh, whatever was carried."""
        self.observer.reset()
        self.load, self.mass_half_width = np.zeros(4), np.inf  # mass [kg], and times place in the frame [kg m]; [kg]
        self._hold()

    @property
    def mass(self) -> float:
        """The load that is carried [kg]."""
        return float(self.load[0])

    def torque(self, state: JointState, reference: Reference) -> Floats:
        """Return the torques (n,) [Nm|N] that carry arm and load, and hold it while it is weighed."""
        super().torque(state, reference)
        if np.isfinite(state.q).all():
            down = state.gravity if self.gravity is None else self.gravity
            J = jacobian(self.model, state.q, self.frame)
            R = forward_kinematics(self.model, state.q, self.frame).rotation
            # what a load asks of the joints (n, 4): per kg at the frame, per kg m along each of its axes
            A = -np.column_stack([J[:3].T @ down, J[3:].T @ np.cross(R.T, down).T])
            # the load's mass matrix (n, n), without which its inertia would count as further load
            of_center = J[:3] - np.cross(R @ self.load[1:] / max(self.mass, _LIGHT_KG), J[3:], axisb=0, axisc=0)
            self.observer.added_mass = max(self.mass, 0.0) * of_center.T @ of_center
            if elapsed := self.observer.follow(state, down):
                self._decide(state, A, J[:3], down, elapsed)
            self.feedforward += A @ self.load
        self.feedback[:] = -self.damping * self.pd.kd * state.qd
        if self.state != "guided":
            self._held_at = state.q.copy() if self._held_at is None else self._held_at
            self.feedback[:] = self.pd.kp * (self._held_at - state.q) - self.pd.kd * state.qd
        return self.feedback + self.feedforward

    def _hold(self) -> None:
        self.state, self._held_at = "weighing", None
        self._known = self._now = np.zeros((4, 4)), np.zeros(4)  # what poses tell of the load, as normal equations
        self._since = self._still = self._falling = 0.0  # [s]

    def _decide(self, state: JointState, A: Floats, J: Floats, down: Floats, elapsed: float) -> None:
        """Go from one state to the next by what the observer shows."""
        # noise, and dry friction of joints that stick
        spread = np.hypot(self.observer.deviation, self.observer.sticking / np.sqrt(3.0))
        self._since += elapsed
        is_still = bool(np.abs(state.qd).max() < _STILL_SPEED)
        if self.state == "weighing":
            is_load = self._since > _SETTLE_S and self._weigh(A, spread, min(1.0, elapsed / _ADAPT_S))
            self._still = self._still + elapsed if is_still and is_load else 0.0
            if self._still >= _STILL_S:
                self._still, self._known = 0.0, self._now
                self.state = "refused" if self.mass + self.mass_half_width > self.max_payload else "guided"
            elif self._since > _SURE_S and self.mass - self.mass_half_width > self.max_payload:
                self.state = "refused"
        elif self.state == "refused":
            # a mean that grows longer: a heavy load swings by its own carrying
            self._weigh(A, spread, min(1.0, elapsed / max(_ADAPT_S, self._since - _SURE_S)))
        elif self.state == "guided":
            self._still = self._still + elapsed if is_still else 0.0
            if self._still >= _STILL_S:
                self._still = 0.0
                if self._weigh(A, spread, 1.0):
                    self._known = self._now
            beyond = self.observer.torque + A @ self.load
            force = np.asarray(np.linalg.lstsq(J.T / spread[:, None], beyond / spread, rcond=1e-3)[0], dtype=np.float64)
            angle = float(angle_between(force, down))
            is_detected = bool((np.abs(beyond) > self.observer.half_width).any())
            is_plumb = is_detected and min(angle, np.pi - angle) < _PLUMB_RAD
            self._falling = self._falling + elapsed if is_plumb else 0.0
            if self._falling > _FALLING_S or (is_detected and np.linalg.norm(force) > self.max_push):
                self._hold()

    def _weigh(self, A: Floats, spread: Floats, share: float) -> bool:
        """Go by a share to the load that explains torques here and before, if one does; return whether one does."""
        prior = self.max_payload * np.array([2.0, _REACH_M, _REACH_M, _REACH_M])
        W, y = A / spread[:, None], -self.observer.torque / spread
        information, evidence = self._known
        self._now = _KEPT_SHARE * information + W.T @ W, _KEPT_SHARE * evidence + W.T @ y
        covariance = np.linalg.inv(self._now[0] + np.diag(prior**-2.0))
        load = covariance @ self._now[1]
        explains = bool((np.abs(y - W @ load) <= _ODD_SIGMAS).all())
        if explains or self.state != "guided":
            self.load = self.load + share * (load - self.load)
            self.mass_half_width = float(IN_95_PERCENT * np.sqrt(covariance[0, 0]))
        return explains
