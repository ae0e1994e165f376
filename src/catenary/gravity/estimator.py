"""On-line estimation of gravity parameters, as the gravity-regressor paper does: the pseudo-inverse law.

s_hat(t) = s_0 + integral of Z^+(q) Omega (Kp (q_d - q) - Kd qd) dt [gravity-regressor paper, section II]: with
tau = Kp (q_d - q) - Kd qd + Z s_hat, what the spring still has to hold is what s_hat lacks, and at rest s_hat moves
until the spring is slack.

The paper prints Omega before Z^+, where it would have to be (p, p), and says that it is (n, n). Here it stands behind
Z^+, where that fits: Omega is then the rate at which each joint's torque error falls, Z ds_hat/dt = Omega effort. For
a single number, as in all our experiments, both places are one.
"""

from collections.abc import Callable
from typing import Literal, Protocol, get_args

import numpy as np
from numpy.typing import ArrayLike

from catenary.arrays import Floats, as_array, as_positive
from catenary.errors import InputError
from catenary.gravity.compact import compact_regressor
from catenary.gravity.regressor import FullRegressor, require_parameters
from catenary.plant import JointState
from catenary.robots.model import RobotModel

LONGEST_STEP = 0.1  # [s] a longer time between two updates is a pause, in which nothing was seen


class Observed(Protocol):
    """What an estimator reads of a control loop's tick."""

    @property
    def time(self) -> float: ...  # noqa: D102  [s]
    @property
    def state(self) -> JointState: ...  # noqa: D102
    @property
    def tau(self) -> Floats | None: ...  # noqa: D102  (n,) [Nm|N] that was sent


Form = Literal[
    "compact", "full"
]  # of the regressor: merged, or as the paper derives it, 3 n (n + 1) parameters


class EstimatedGravity:
    """Parameters of a robot's gravity that are being estimated, and the torque that they give."""

    def __init__(self, model: RobotModel, s0: ArrayLike | None, form: Form = "compact") -> None:
        """Take a robot, of which only the geometry is used, and parameters (p,) to start from, zero when None.

        Raises:
            InputError: Another number of parameters, not finite, no such form, or a robot on which gravity has no
                effect.
        """
        if form not in get_args(Form):
            raise InputError(f'form "{form}": expected one of {", ".join(get_args(Form))}')
        self.regressor = compact = compact_regressor(model)
        if not compact.expressions:
            raise InputError(
                f'robot "{model.name}": no parameter has an effect: gravity loads none of its joints'
            )
        self.model = model
        self.labels = compact.labels if form == "compact" else FullRegressor(model).labels
        self._s = self._start(s0)
        self._kernel: Callable[[Floats, Floats], Floats] = (
            compact.kernel() if form == "compact" else FullRegressor(model).kernel()
        )

    @property
    def s_hat(self) -> Floats:
        """Estimated parameters (p,) [kg m, kg]; `labels` names them."""
        return self._s.copy()

    def torque(self, q: Floats, gravity: Floats) -> Floats:
        """Return the estimated gravity torque Z s_hat (n,) [Nm|N]."""
        torque: Floats = self._kernel(q, gravity) @ self._s
        return torque

    def _start(self, s0: ArrayLike | None) -> Floats:
        size = len(self.labels)
        return np.zeros(size) if s0 is None else np.array(require_parameters("s0", s0, self.labels))

    def _require_sizes(self, *arrays: Floats) -> None:
        n = self.model.n
        if any(len(array) != n for array in arrays):
            raise InputError(f"gravity estimator: is for {n} joints, the robot has {len(arrays[0])}")


class GravityEstimator(EstimatedGravity):
    """The paper's law, on the compact regressor or on the paper's full one.

    The law, quasi-static arms and s from zero are the paper's. Ours are: Omega's place in the law, above; the damping
    of Z^+; `max_speed` and what else holds the law still; the use as an observer; any base's gravity, prismatic and
    coupled joints; the compact form as what is estimated, which the paper derives and does not say that it ran. The
    forms are two laws: on the full Z each joint has parameters of its own and learns by itself, on the compact one
    joints share them, and what one learns changes what the others hold.

    In a controller, `update` each tick gives the torque to add to the PD's. As an observer of `run_loop` it takes
    what the torque sent has beyond Z s_hat in place of the PD's torque: with the paper's controller that is the same
    thing, and with any other one the estimate settles as well.

    Z^+ is Z^T (Z Z^T + lambda 1)^-1 with lambda = `damping` times the mean square of Z's rows: the pseudo-inverse,
    but for directions in which gravity hardly loads the joints, where that would take torques for huge parameters;
    and one linear system of n equations, whose time is bounded. The law holds for arms at rest: while a joint is faster
    than `max_speed`, or a number is missing, s_hat stays.
    """

    def __init__(
        self,
        model: RobotModel,
        kp: ArrayLike,
        kd: ArrayLike,
        *,
        omega: ArrayLike = 2.0,
        s0: ArrayLike | None = None,
        max_speed: ArrayLike = 0.1,
        damping: float = 1e-4,
        form: Form = "compact",
    ) -> None:
        """Take a robot, of which only the geometry is used, and the gains.

        Args:
            model: The robot.
            kp: (n,) stiffness of the controller [Nm/rad|N/m].
            kd: (n,) its damping [Nms/rad|Ns/m].
            omega: Omega of the law [1/s]: one rate, one per joint (n,), or a symmetric positive definite (n, n).
            s0: (p,) parameters to start from, of `compact_regressor` or `gravity_parameters`; zero when None.
            max_speed: Of joints that count as resting [rad/s|m/s], one for all or (n,).
            damping: Positive; see above.
            form: Of the regressor; the full one is not compiled: a millisecond a tick for 19 joints.

        Raises:
            InputError: Another shape, not finite, a negative gain, an Omega that is not positive definite, no such
                form, or a robot on which gravity has no effect.
        """
        super().__init__(model, s0, form)
        n = model.n
        self.kp, self.kd = as_array("kp", kp, (n,)), as_array("kd", kd, (n,))
        for name, gains in (("kp", self.kp), ("kd", self.kd)):
            if (gains < 0.0).any():
                raise InputError(f"{name}: expected gains of zero or more, got {gains.tolist()}")
        self.omega = _as_omega(omega, n)
        if not 0.0 < damping < np.inf:
            raise InputError(f"damping: expected a positive number, got {damping}")
        self.max_speed, self.damping = as_positive("max_speed", one_for_all(max_speed, n), (n,)), damping
        self._time = np.nan

    def reset(self, s0: ArrayLike | None = None) -> None:
        """Begin anew, from parameters (p,) or from zero."""
        self._s, self._time = self._start(s0), np.nan

    def update(self, q: Floats, qd: Floats, q_desired: Floats, gravity: Floats, dt: float) -> Floats:
        """Let dt [s] pass at a measured state, and return the gravity torque (n,) [Nm|N] now estimated there.

        Arrays are float64 and of the robot's size; NaN stops the law for the tick, and gives NaN.
        """
        self._require_sizes(q, qd, q_desired)
        Z = self._kernel(q, gravity)
        if self._at_rest(Z, qd, dt) and np.isfinite(q).all() and np.isfinite(q_desired).all():
            self._learn(Z, self.kp * (q_desired - q) - self.kd * qd, dt)
        torque: Floats = Z @ self._s
        return torque

    def follow(self, state: JointState, q_desired: Floats) -> Floats:
        """Update with time and gravity from a robot's state."""
        return self.update(state.q, state.qd, q_desired, state.gravity, self._passed(state.time))

    def __call__(self, tick: Observed) -> None:
        """Observe a tick of the control loop."""
        if tick.tau is not None:
            state, dt = tick.state, self._passed(tick.time)
            self._require_sizes(state.q, state.qd, tick.tau)
            Z = self._kernel(state.q, state.gravity)
            if self._at_rest(Z, state.qd, dt) and np.isfinite(tick.tau).all():
                self._learn(Z, tick.tau - Z @ self._s, dt)

    def _passed(self, time: float) -> float:
        last, self._time = self._time, time
        step = time - last
        return step if 0.0 < step <= LONGEST_STEP else 0.0  # zero, too, the first time

    def _at_rest(self, Z: Floats, qd: Floats, dt: float) -> bool:
        """Return whether the law holds: time passes, no joint is fast, and no number is missing."""
        return dt > 0.0 and bool((np.abs(qd) <= self.max_speed).all() and np.isfinite(Z).all())

    def _learn(self, Z: Floats, effort: Floats, dt: float) -> None:
        """Move s_hat by dt Z^+ Omega effort."""
        squares = Z @ Z.T
        damping = self.damping * np.trace(squares) / len(Z)
        if damping > 0.0:  # else there is no gravity
            inverse = np.linalg.inv(squares + damping * np.eye(len(Z)))
            self._s += dt * (Z.T @ (inverse @ (self.omega @ effort)))


def one_for_all(values: ArrayLike, n: int) -> ArrayLike:
    """Return a single number as (n,), and anything else as it is."""
    return np.full(n, values) if np.ndim(values) == 0 else values


def _as_omega(omega: ArrayLike, n: int) -> Floats:
    shape = np.shape(omega)
    if shape == ():
        matrix = float(as_array("omega", omega, ())) * np.eye(n)
    elif len(shape) == 1:
        matrix = np.diag(as_array("omega", omega, (n,)))
    else:
        matrix = as_array("omega", omega, (n, n))
    if not np.allclose(matrix, matrix.T) or not (np.linalg.eigvalsh(matrix) > 0.0).all():
        raise InputError(f"omega: expected a symmetric positive definite matrix, got {matrix.tolist()}")
    return np.ascontiguousarray(matrix)
