"""PD control through the mass matrix: the errors ask for accelerations, the model says what torques give them.

T. DeWolf, "Robot control part 3: accounting for mass and gravity" (docs/tutorial-two-link.md); with the velocity terms,
the computed torque of Luh, Walker, Paul 1980.
"""

import numpy as np
from numpy.typing import ArrayLike

from catenary.arrays import Floats, as_array
from catenary.control.at_rest import INERTIA_PD, torque_at_rest
from catenary.control.gravity_pd import nominal_gravity
from catenary.control.pd import Gains, fits, pd_term
from catenary.dynamics.loop_kernels import new_workspace, newton_euler_torque
from catenary.errors import InputError
from catenary.gravity.holding import copy_gravity
from catenary.kernels.compiled import compiled
from catenary.plant import AT_REST, JointState
from catenary.robots.model import RobotModel, Tree
from catenary.trajectories.reference import Reference


class InertiaPD:
    """u = M(q) (qdd_ref + kp (q_ref - q) + kv (qd_ref - qd)) + g(q), and C(q, qd) qd where asked for.

    Every joint's error then obeys e'' + kv e' + kp e = 0 by itself, at any pose, but for the velocity terms. The
    tutorial leaves those out on purpose: they need a model that is right in its moments of inertia, grow with the
    square of the speed, and one that is wrong feeds energy in.

    `feedback` is M(q) (kp e + kv ed), `feedforward` the rest. Each is one Newton-Euler recursion; no matrix is formed.
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
        """Take the robot and the gains, and compile.

        Args:
            model: With inertia.
            kp: () or (n,) square of the wanted natural frequency [1/s2].
            kv: () or (n,) twice damping ratio times frequency [1/s].
            gravity: (3,) nominal vector in base axes [m/s2]; None takes the sensed one.
            motor_inertia: (n, n) what motors and gearboxes add to M(q) at the joints; none when None. Behind ratios
                of a hundred it is the larger part (reflected_inertia).
            coriolis: Add C(q, qd) qd.

        Raises:
            MissingInertiaError: Links without inertia.
            InputError: Something of another shape, negative or not finite.
        """
        model.require_inertia()
        n = model.n
        self.model = model
        self._gains = Gains(
            np.broadcast_to(kp, (n,)) if np.ndim(kp) == 0 else kp,
            np.broadcast_to(kv, (n,)) if np.ndim(kv) == 0 else kv,
            "relative",
            n,
        )
        self.kp, self.kv = self._gains.kp, self._gains.kd
        self.gravity = nominal_gravity(gravity)
        motors = np.zeros((n, n)) if motor_inertia is None else motor_inertia
        self.motor_inertia = as_array("motor_inertia", motors, (n, n))
        self.coriolis = coriolis
        self.feedback, self.feedforward = np.zeros(n), np.zeros(n)
        self._arrays = (
            model.tree,
            model.coupling,
            model.offset,
            self._gains.rows,
            self.motor_inertia,
            new_workspace(model),
            np.zeros((5, n)),
            np.empty(3),
            np.empty((2, 3)),
            self.feedback,
            self.feedforward,
        )
        self._at_rest = torque_at_rest(
            model,
            INERTIA_PD.format(qd="qd" if coriolis else "still"),
            gains=self._gains.rows,
            motor_inertia=self.motor_inertia,
            nothing=np.zeros(3),
            work=np.zeros((2, n)),
            feedback=self.feedback,
            feedforward=self.feedforward,
        )

    def torque(self, state: JointState, reference: Reference) -> Floats:
        """Torques (n,) [Nm|N]; NaN where something that they depend on is.

        Raises:
            InputError: The robot has another number of joints than the model.
        """
        tau = np.empty(len(self.feedback))
        fixed = self.gravity
        gravity, rates = (state.gravity, state.base_rates) if fixed is None else (fixed, AT_REST)
        if self._at_rest(state.q, state.qd, reference.q, reference.qd, reference.qdd, gravity, rates, tau):
            return tau
        moving = state.q, state.qd, reference.q, reference.qd, reference.qdd, gravity, rates
        if not _inertia_pd(*self._arrays, self.coriolis, *moving, tau):
            raise InputError(f"inertia PD: the model has {len(tau)} joints, the robot {len(state.q)}")
        return tau


@compiled
def _inertia_pd(
    tree: Tree,
    coupling: Floats,
    offset: Floats,
    gains: Floats,
    motor_inertia: Floats,
    flat: Floats,
    rows: Floats,
    gravity_here: Floats,
    rates_here: Floats,
    feedback: Floats,
    feedforward: Floats,
    coriolis: bool,
    q: Floats,
    qd: Floats,
    q_ref: Floats,
    qd_ref: Floats,
    qdd_ref: Floats,
    gravity: Floats,
    base_rates: Floats,
    tau: Floats,
) -> bool:
    n = len(tau)
    if not fits(n, q, qd, q_ref, qd_ref) or len(qdd_ref) != n:
        return False
    q_here, qd_here, wanted, correction, zero = rows[0], rows[1], rows[2], rows[3], rows[4]
    for j in range(n):
        q_here[j] = q[j]
        qd_here[j] = qd[j] if coriolis else 0.0
        wanted[j] = qdd_ref[j]
        correction[j] = pd_term(gains, j, q[j], qd[j], q_ref[j], qd_ref[j])
    copy_gravity(gravity, base_rates, gravity_here, rates_here)
    newton_euler_torque(
        tree, coupling, offset, q_here, qd_here, wanted, gravity_here, rates_here, flat, feedforward
    )
    # M(q) times an acceleration is what it takes from rest where nothing pulls
    for r in range(3):
        gravity_here[r] = 0.0
        rates_here[0, r] = 0.0
        rates_here[1, r] = 0.0
    newton_euler_torque(
        tree, coupling, offset, q_here, zero, correction, gravity_here, rates_here, flat, feedback
    )
    for j in range(n):
        for k in range(n):
            feedback[j] += motor_inertia[j, k] * correction[k]
            feedforward[j] += motor_inertia[j, k] * wanted[k]
        tau[j] = feedback[j] + feedforward[j]
    return True
