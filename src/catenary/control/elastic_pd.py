"""PD on motor positions with gravity compensation, for arms whose joints hang on springs.

A. De Luca, B. Siciliano, L. Zollo, "PD control with on-line gravity compensation for robots with elastic joints: theory
and experiments", Automatica 41 (2005); P. Tomei, "A simple PD controller for robots with elastic joints", IEEE Trans.
Automatic Control 36 (1991).
"""

import warnings
from typing import Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import minimize

from catenary.arrays import Floats, as_array, as_positive
from catenary.control.gains import DrivenJoints
from catenary.control.pd import Damping, GravityPD, gravity_and_rates, nominal_gravity
from catenary.errors import ImplausibleWarning, InputError
from catenary.gravity.torque import gravity_torque
from catenary.plant import JointState
from catenary.robots.model import RobotModel
from catenary.spatial import STANDARD_GRAVITY
from catenary.trajectories.reference import Reference

Compensation = Literal["constant", "online", "biased"]
_SAMPLES = 512  # of the joint range and the directions of gravity, before the best are climbed
_CLIMBS = 4
_STEP = 1e-5  # [rad|m] of central differences


class ElasticPD(GravityPD):
    """tau = kp (theta_ref - theta) - kd theta' + gravity, theta_ref = q_ref + K^-1 g(q_ref).

    theta are the motors' positions as seen at the joints, through ratios and coupling: what `state.q` holds on robots
    that measure at their motors (RAVEN-II's q_nominal; a corrector would make link positions of it and must be left
    out). q is where the links are, K the joints' stiffness. The gravity term is

    - "constant": g(q_ref) [Tomei],
    - "online": g(theta), which ends where kp (theta_ref - theta) = g(q) - g(theta): not at q_ref,
    - "biased": g(theta - K^-1 g(q_ref)) [De Luca, Siciliano, Zollo], which ends at q_ref, and lets the motors move more
      smoothly and with smaller gains than "constant".

    The proofs need springs and gains that are stiffer than gravity's own: see `stiffness_margin`, which is asked here.

    Examples:
        >>> arm = catenary.load_robot("two_link")
        >>> controller = catenary.ElasticPD(arm, [200.0, 200.0], [20.0, 20.0], stiffness=[2000.0, 1000.0])
    """

    def __init__(
        self,
        model: RobotModel,
        kp: ArrayLike,
        kd: ArrayLike,
        stiffness: ArrayLike,
        *,
        compensation: Compensation = "biased",
        gravity: ArrayLike | None = None,
        damping: Damping = "relative",
    ) -> None:
        """Take the robot, with inertia, gains and springs; refuse those that gravity changes too fast for.

        Args:
            kp: (n,) [Nm/rad|N/m], positive; kd: (n,) [Nms/rad|Ns/m].
            stiffness: (n,) K of the joints' springs [Nm/rad|N/m], positive.
            compensation: The gravity term.
            gravity: (3,) nominal vector in base axes [m/s2]; None takes the sensed one.
            damping: "relative" adds kd qd_ref; the paper regulates to a constant reference.
        """
        super().__init__(model, kp, kd, gravity=gravity, damping=damping)
        self.stiffness = as_array("stiffness", stiffness, (model.n,))
        if compensation not in get_args(Compensation):
            raise InputError(f'compensation "{compensation}": expected one of {", ".join(get_args(Compensation))}')
        self.compensation = compensation
        margin = stiffness_margin(model, self.pd.kp, self.stiffness, gravity=self.gravity)
        if not margin.slope < 1.0:
            raise InputError(
                f'robot "{model.name}": gravity changes by {margin.slope:.3g} times the joints\' stiffness, expected '
                f"less than 1: springs and kp in series are {_short(margin.stiffness)} Nm/rad or N/m, gravity's own "
                f"slopes {_short(margin.gravity_slope)} at q = {_short(margin.q)}"
            )

    def torque(self, state: JointState, reference: Reference) -> Floats:
        """Return torques (n,) [Nm|N] at the motors, as seen at the joints; NaN where something they depend on is."""
        if len(reference.q) != self.model.n:
            raise InputError(f"elastic PD: the model has {self.model.n} joints, the robot {len(state.q)}")
        gravity, omega, alpha = gravity_and_rates(state, self.gravity)
        at_reference = self._holding_torque(reference.q, gravity, omega, alpha)
        wind_up = at_reference / self.stiffness
        feedback = self.pd.torque(state, reference._replace(q=reference.q + wind_up))
        if self.compensation == "constant":
            self.feedforward[:] = at_reference
        else:
            q = state.q - wind_up if self.compensation == "biased" else state.q
            self.feedforward[:] = self._holding_torque(q, gravity, omega, alpha)
        return feedback + self.feedforward


def elastic_pd(arm: DrivenJoints, damping: Damping, compensation: Compensation) -> ElasticPD:
    """Return the controller of an arm with springs, with its own gains."""
    stiffness = np.array([]) if arm.stiffness is None else arm.stiffness
    return ElasticPD(arm.model, *arm.gains, stiffness, compensation=compensation, damping=damping)


class StiffnessMargin(NamedTuple):
    """The slope of gravity compared with the stiffness of the joints."""

    slope: float  # largest share of the joints' stiffness that dg/dq takes; the proofs need less than 1
    stiffness: Floats  # (n,) of spring and gain in series [Nm/rad|N/m]
    gravity_slope: Floats  # (n,) own slopes dg_j/dq_j at the steepest place [Nm/rad|N/m]
    q: Floats  # (n,) that place [rad|m]


def stiffness_margin(
    model: RobotModel, kp: ArrayLike, stiffness: ArrayLike, *, gravity: ArrayLike | None = None
) -> StiffnessMargin:
    """Compare springs and gains with how fast gravity changes over the joint range, a whole turn without limits.

    The paper asks that the smallest eigenvalue of [[K, -K], [-K, K + kp]] exceeds the bound of |dg/dq|, so that the
    potential energy has one minimum. Of joints in rad and m a norm has no meaning, and a stiff joint says nothing of a
    soft one; so the same is asked free of units: the largest |S^-1/2 dg/dq S^-1/2| below one, S = K kp / (K + kp) the
    stiffness that is left once the motors have settled; the paper's condition implies it. The largest is searched for:
    quasi-random points, the best of them climbed.

    kp and stiffness K are (n,) [Nm/rad|N/m]; gravity (3,) is in base axes [m/s2], any direction of 9.81 m/s2 when None.
    """
    gains, springs = as_positive("kp", kp, (model.n,)), as_positive("stiffness", stiffness, (model.n,))
    series = springs * gains / (springs + gains)
    turn = np.array([unit == "rad" for unit in model.joint_units])
    lower = np.where(np.isfinite(model.lower) | ~turn, model.lower, -np.pi)
    upper = np.where(np.isfinite(model.upper) | ~turn, model.upper, np.pi)
    for j in np.flatnonzero(~(np.isfinite(lower) & np.isfinite(upper))):
        raise InputError(
            f'robot "{model.name}": joint "{model.joint_names[j]}" has no limits, expected some: gravity\'s '
            "slope may grow with it"
        )
    fixed, n = nominal_gravity(gravity), model.n
    scale = np.sqrt(np.outer(series, series))

    def slope_at(x: Floats) -> Floats:
        q = lower + (upper - lower) * np.clip(x[:n], 0.0, 1.0)
        g = fixed if fixed is not None else STANDARD_GRAVITY * _direction(x[n], x[n + 1])
        steps = _STEP * np.eye(n)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ImplausibleWarning)  # any direction of gravity is meant here
            torques = gravity_torque(model, np.concatenate([q + steps, q - steps]), g)
        return (torques[:n] - torques[n:]) / (2.0 * _STEP)

    def negative_share(x: Floats) -> float:
        return -float(np.linalg.norm(slope_at(x) / scale, 2))

    from scipy.stats import qmc  # takes a quarter of a second to import

    points = qmc.Halton(n if fixed is not None else n + 2, scramble=False).random(_SAMPLES)
    values = np.array([negative_share(x) for x in points])
    best, where = float(values.min()), points[int(values.argmin())]
    for k in np.argsort(values)[:_CLIMBS]:
        bounds = [(0.0, 1.0)] * len(points[k])
        climbed = minimize(negative_share, np.array(points[k], dtype=np.float64), bounds=bounds, method="L-BFGS-B")
        if climbed.fun < best:
            best, where = float(climbed.fun), climbed.x
    own_slopes = np.diag(slope_at(where)).copy()
    return StiffnessMargin(-best, series, own_slopes, lower + (upper - lower) * where[:n])


def _short(values: Floats) -> str:
    return "[" + ", ".join(f"{value:.4g}" for value in values) + "]"


def _direction(u: float, v: float) -> Floats:
    """Return a unit vector from two numbers in [0, 1], evenly over the sphere."""
    z, angle = 2.0 * u - 1.0, 2.0 * np.pi * v
    r = np.sqrt(max(0.0, 1.0 - z * z))
    return np.array([r * np.cos(angle), r * np.sin(angle), z])
