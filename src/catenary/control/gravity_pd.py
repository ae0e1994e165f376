"""PD control with the gravity torque added, and gravity compensation alone.

A. Lewis, B. Hannaford, "Dynamically evaluated gravity compensation for the RAVEN surgical robot", ICRA 2014: figure 6.
"""

from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

from catenary.arrays import Floats, as_array
from catenary.control.at_rest import GRAVITY_PD, HOLD, torque_at_rest
from catenary.control.pd import Damping, Gains, fits, pd_term
from catenary.dynamics.loop_kernels import new_workspace
from catenary.errors import InputError
from catenary.gravity.holding import HoldingKernel, copy_gravity, holding_torque
from catenary.kernels.compiled import compiled
from catenary.plant import AT_REST, JointState
from catenary.robots.model import RobotModel, Tree
from catenary.trajectories.reference import Reference

At = Literal["measured", "desired"]


class GravityPD:
    """PD plus gravity: tau = kp (q_ref - q) + kd (qd_ref - qd) + g(q).

    PD+DG, dynamic, takes the gravity that the robot senses tick by tick (`state.gravity`), and when its base turns
    (`state.base_rates`) the whole term of a moving base (HoldingKernel). PD+SG, static, takes one vector for all times.

    At the measured position g(q) cancels gravity where the arm is. At the desired one it is a function of time and adds
    no feedback, as Tomei's proof (1991) for elastic joints has it, but it is wrong while the arm is elsewhere.
    """

    def __init__(
        self,
        model: RobotModel,
        kp: ArrayLike,
        kd: ArrayLike,
        *,
        gravity: ArrayLike | None = None,
        at: At = "measured",
        damping: Damping = "relative",
    ) -> None:
        """Take the robot and the gains, and compile.

        Args:
            model: With inertia.
            kp: (n,) stiffness [Nm/rad|N/m].
            kd: (n,) damping [Nms/rad|Ns/m].
            gravity: (3,) nominal vector in base axes [m/s2]: PD+SG; None takes the sensed one: PD+DG.
            at: The position at which gravity is evaluated.
            damping: "absolute" leaves qd_ref out.

        Raises:
            MissingInertiaError: Links without inertia.
            InputError: Gains or gravity of another shape, negative or not finite.
        """
        model.require_inertia()
        self.model = model
        self._gains = Gains(kp, kd, damping, model.n)
        self.kp, self.kd = self._gains.kp, self._gains.kd
        self.gravity = nominal_gravity(gravity)
        if at not in get_args(At):
            raise InputError(f'at "{at}": expected one of {", ".join(get_args(At))}')
        self.at = at
        self.feedback, self.feedforward = np.zeros(model.n), np.zeros(model.n)
        self._arrays: tuple[Any, ...] = (
            model.tree,
            model.coupling,
            model.offset,
            self._gains.rows,
            new_workspace(model),
            np.empty(model.n),
            np.empty(3),
            np.empty((2, 3)),
            np.zeros(model.n),
            self.feedback,
            self.feedforward,
        )
        law = GRAVITY_PD.format(at="q" if at == "measured" else "q_ref")
        self._at_rest = torque_at_rest(
            model, law, gains=self._gains.rows, feedback=self.feedback, feedforward=self.feedforward
        )

    def torque(self, state: JointState, reference: Reference) -> Floats:
        """Torques (n,) [Nm|N]; NaN where something that they depend on is.

        Raises:
            InputError: The robot has another number of joints than the model.
        """
        tau = np.empty(len(self.feedback))
        fixed = self.gravity
        gravity, rates = (state.gravity, state.base_rates) if fixed is None else (fixed, AT_REST)
        if self._at_rest(state.q, state.qd, reference.q, reference.qd, gravity, rates, tau):
            return tau
        moving: tuple[Any, ...] = state.q, state.qd, reference.q, reference.qd, gravity, rates
        everything = (*self._arrays, self.at == "measured", *moving, tau)
        if not _gravity_pd(*everything):
            raise InputError(f"gravity PD: the model has {len(tau)} joints, the robot {len(state.q)}")
        return tau


class GravityHold:
    """Gravity compensation alone: the arm stays wherever it is put, and whatever else holds it is friction.

    The reference is not looked at. [The paper, section IV: "passive pose compensator"]
    """

    def __init__(self, model: RobotModel, *, gravity: ArrayLike | None = None) -> None:
        """Take the robot, and compile.

        Args:
            model: With inertia.
            gravity: (3,) nominal vector in base axes [m/s2]; None takes the sensed one.

        Raises:
            MissingInertiaError: Links without inertia.
            InputError: Gravity of another shape, or not finite.
        """
        self.model = model
        self.gravity = nominal_gravity(gravity)
        self._kernel = HoldingKernel(model)
        n = model.n
        self.feedback, self.feedforward = np.zeros(n), np.zeros(n)
        self._at_rest = torque_at_rest(model, HOLD, feedforward=self.feedforward)

    def torque(self, state: JointState, reference: Reference) -> Floats:
        """Torques (n,) [Nm|N] that gravity asks for at the measured position.

        Raises:
            InputError: The robot has another number of joints than the model.
        """
        n = self.model.n
        if len(state.q) != n:
            raise InputError(f"gravity hold: the model has {n} joints, the robot {len(state.q)}")
        tau = np.empty(n)
        gravity, rates = (
            (state.gravity, state.base_rates) if self.gravity is None else (self.gravity, AT_REST)
        )
        q = state.q
        if not self._at_rest(q, q, q, q, gravity, rates, tau):
            self.feedforward[:] = self._kernel(q, gravity, rates, tau)
        return tau


def nominal_gravity(gravity: ArrayLike | None) -> Floats | None:
    """A vector (3,) for all times [m/s2], or None: the sensed one.

    Raises:
        InputError: Another shape, or not finite.
    """
    return None if gravity is None else as_array("gravity", gravity, (3,))


@compiled
def _gravity_pd(
    tree: Tree,
    coupling: Floats,
    offset: Floats,
    gains: Floats,
    flat: Floats,
    q_here: Floats,
    gravity_here: Floats,
    rates_here: Floats,
    zero: Floats,
    feedback: Floats,
    feedforward: Floats,
    at_measured: bool,
    q: Floats,
    qd: Floats,
    q_ref: Floats,
    qd_ref: Floats,
    gravity: Floats,
    base_rates: Floats,
    tau: Floats,
) -> bool:
    n = len(tau)
    if not fits(n, q, qd, q_ref, qd_ref):
        return False
    for j in range(n):
        q_here[j] = q[j] if at_measured else q_ref[j]
    copy_gravity(gravity, base_rates, gravity_here, rates_here)
    holding_torque(tree, coupling, offset, q_here, gravity_here, rates_here, zero, flat, feedforward)
    for j in range(n):
        feedback[j] = pd_term(gains, j, q[j], qd[j], q_ref[j], qd_ref[j])
        tau[j] = feedback[j] + feedforward[j]
    return True
