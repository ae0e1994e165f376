"""On-line estimation of gravity parameters: the gravity-regressor paper's pseudo-inverse law, and least squares.

s_hat(t) = s_0 + integral of Z^+(q) Omega (Kp (q_d - q) - Kd qd) dt [gravity-regressor paper, section II]: with
tau = Kp (q_d - q) - Kd qd + Z s_hat, what the spring still has to hold is what s_hat lacks, and at rest s_hat moves
until the spring is slack.

The paper prints Omega before Z^+, where it would have to be (p, p), and says that it is (n, n). Here it stands behind
Z^+, where that fits: Omega is then the rate at which each joint's torque error falls, Z ds_hat/dt = Omega effort. For
a single number, as in all our experiments, both places are one.

Recursive least squares with forgetting: tau = Z(q, gravity) s + noise, whenever the arm rests. In information form,
each torque taken weighs its parameters: A <- f A + Z^T W Z, s <- s + (A + A_0)^-1 Z^T W (tau - Z s) [Ljung,
Soederstroem 1983, Theory and practice of recursive identification; A is the inverse of their P]. A_0 holds what is
known beforehand, a standard deviation per parameter; it is not forgotten, so that what the data do not tell stays where
it is, and A + A_0 can always be inverted.

Where it is known which frames take things up, a torque three standard deviations off what noise and P = (A + A_0)^-1
let expect raises a question: has a load changed, before this torque or one of the last? If that is likelier than not,
P at that time is widened by what a load there would change, P + V Q V^T, as a Kalman filter does whose state may jump,
and A_0^-1 alike: beforehand nothing is known of a load, and what is not forgotten must not hold it. So the payload is
reported in the first pose, from all the joints that feel it, and what was learnt of the arm itself stays. Which frame
has it is reported with probabilities (load_location.py): one pose seldom suffices.
"""

from collections import deque
from collections.abc import Callable, Sequence
from copy import copy
from operator import itemgetter
from typing import Literal, NamedTuple, Protocol, get_args

import numpy as np
from numpy.typing import ArrayLike

from catenary.arrays import Floats, as_array, as_not_negative, as_positive, one_for_all
from catenary.errors import InputError
from catenary.gravity.compact_regressor import compact_regressor
from catenary.gravity.gravity_regressor import full_kernel, full_labels, require_parameters
from catenary.gravity.load_location import LOAD_SIZE, LoadBeliefs, LoadHypotheses
from catenary.plant import JointState
from catenary.robots.model import RobotModel

_MAX_STEP_S = 0.1  # [s] a longer time between two updates is a pause, in which nothing was seen


class Observed(Protocol):
    """Inputs of an estimator from a control loop's tick."""

    @property
    def time(self) -> float: ...  # noqa: D102  [s]
    @property
    def state(self) -> JointState: ...  # noqa: D102
    @property
    def tau(self) -> Floats | None: ...  # noqa: D102  (n,) [Nm|N] that was sent


# of the regressor: merged, or as the paper derives it, 3 n (n + 1) parameters
Form = Literal["compact", "full"]


class EstimatedGravity:
    """Parameters of a robot's gravity that are being estimated, and the torque that they give."""

    def __init__(self, model: RobotModel, s0: ArrayLike | None, form: Form = "compact") -> None:
        """Start from parameters (p,), zero if None; only the robot's geometry is used."""
        if form not in get_args(Form):
            raise InputError(f'form "{form}": expected one of {", ".join(get_args(Form))}')
        self.regressor = compact = compact_regressor(model)
        if not compact.expressions:
            raise InputError(f'robot "{model.name}": no parameter has an effect: gravity loads none of its joints')
        self.model = model
        self.labels = compact.labels if form == "compact" else full_labels(model)
        self._s = np.array(require_parameters("s0", np.zeros(len(self.labels)) if s0 is None else s0, self.labels))
        self._kernel: Callable[[Floats, Floats], Floats] = compact.kernel() if form == "compact" else full_kernel(model)

    @property
    def s_hat(self) -> Floats:
        """Estimated parameters (p,) [kg m, kg]; `labels` names them."""
        return self._s.copy()

    def torque(self, q: Floats, gravity: Floats) -> Floats:
        """Return the estimated gravity torque Z s_hat (n,) [Nm|N]."""
        return self._kernel(q, gravity) @ self._s

    def _require_sizes(self, *arrays: Floats) -> None:
        if any(len(array) != self.model.n for array in arrays):
            raise InputError(f"gravity estimator: is for {self.model.n} joints, the robot has {len(arrays[0])}")


class GravityEstimator(EstimatedGravity):
    """The paper's law, on the compact regressor or on the paper's full one.

    The law, quasi-static arms and s from zero are the paper's. Ours are: Omega's place in the law, above; the damping
    of Z^+; `max_speed` and what else holds the law still; the use as an observer; any base's gravity, prismatic and
    coupled joints; the compact form as what is estimated. The forms are two laws: on the full Z each joint learns by
    itself, on the compact one joints share parameters.

    In a controller, `update` each tick gives the torque to add to the PD's. As an observer of `run_loop`, beside any
    controller, it takes what the torque sent has beyond Z s_hat in place of the PD's.

    Z^+ is Z^T (Z Z^T + lambda 1)^-1 with lambda = `damping` times the mean square of Z's rows: the pseudo-inverse, but
    for directions in which gravity hardly loads the joints. The law holds for arms at rest: while a joint is faster
    than `max_speed`, or a number is missing, s_hat stays.

    Examples:
        >>> arm = catenary.load_robot("two_link")
        >>> estimator = catenary.GravityEstimator(arm, kp=[200.0, 200.0], kd=[20.0, 20.0])
        >>> controller = catenary.EstimatedGravityPD([200.0, 200.0], [20.0, 20.0], estimator)
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
            kp: (n,) stiffness of the controller [Nm/rad|N/m]; kd: (n,) its damping [Nms/rad|Ns/m].
            omega: Omega of the law [1/s]: one rate, one per joint (n,), or a symmetric positive definite (n, n).
            s0: (p,) parameters to start from, of `compact_regressor` or `gravity_parameters`; zero when None.
            max_speed: Of joints that count as resting [rad/s|m/s], one for all or (n,).
            damping: Positive; see above.
            form: Of the regressor; the full one is not compiled: a millisecond a tick for 19 joints.
        """
        super().__init__(model, s0, form)
        n = model.n
        self.kp, self.kd = as_not_negative("kp", kp, (n,)), as_not_negative("kd", kd, (n,))
        self.omega = _as_omega(omega, n)
        if not 0.0 < damping < np.inf:
            raise InputError(f"damping: expected a positive number, got {damping}")
        self.max_speed, self.damping = as_positive("max_speed", one_for_all(max_speed, n), (n,)), damping
        self._time = np.nan

    def update(self, q: Floats, qd: Floats, q_desired: Floats, gravity: Floats, dt: float) -> Floats:
        """Let dt [s] pass at a measured state, and return the gravity torque (n,) [Nm|N] now estimated there.

        Arrays are float64 and of the robot's size; NaN, or no time, stops the law for the tick; NaN gives NaN.
        """
        if not 0.0 <= dt < np.inf:
            raise InputError(f"dt: expected a time of zero or more, got {dt} s")
        self._require_sizes(q, qd, q_desired)
        Z = self._kernel(q, gravity)
        if self._at_rest(Z, qd, dt) and np.isfinite(q).all() and np.isfinite(q_desired).all():
            self._learn(Z, self.kp * (q_desired - q) - self.kd * qd, dt)
        return Z @ self._s

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
        return step if 0.0 < step <= _MAX_STEP_S else 0.0  # zero, too, the first time

    def _at_rest(self, Z: Floats, qd: Floats, dt: float) -> bool:
        """Return True if the law applies: time passes, no joint is fast, and no number is missing."""
        return dt > 0.0 and bool((np.abs(qd) <= self.max_speed).all() and np.isfinite(Z).all())

    def _learn(self, Z: Floats, effort: Floats, dt: float) -> None:
        """Move s_hat by dt Z^+ Omega effort."""
        squares = Z @ Z.T
        damping = self.damping * np.trace(squares) / len(Z)
        if damping > 0.0:  # else there is no gravity
            inverse = np.linalg.inv(squares + damping * np.eye(len(Z)))
            self._s += dt * (Z.T @ (inverse @ (self.omega @ effort)))


def _as_omega(omega: ArrayLike, n: int) -> Floats:
    is_whole = np.ndim(omega) == 2
    matrix = as_array("omega", omega if is_whole else one_for_all(omega, n), (n, n) if is_whole else (n,))
    matrix = matrix if is_whole else np.diag(matrix)
    if not np.allclose(matrix, matrix.T) or not (np.linalg.eigvalsh(matrix) > 0.0).all():
        raise InputError(f"omega: expected a symmetric positive definite matrix, got {matrix.tolist()}")
    return np.ascontiguousarray(matrix)


_SURPRISE_DEVIATIONS = 3.0  # standard deviations of torque that say that the load has changed
# probability that a load changes between two torques taken: of many, some stand out by noise alone
_CHANGE_PER_S = 1e-3
_MIN_SPREAD = 1e-6  # [kg m, kg] of a parameter: beside a load, less than that is lost in rounding
_REMEMBERED_TORQUES = 20  # before one of which a load may have changed that is noticed now
_ANOTHER_DEVIATIONS = 5.0  # the same, once a load is looked for: noise alone exceeds three of them now and then


class _TakenTorque(NamedTuple):
    """A torque that was taken, over the noise, with the parameters and their information before it."""

    known: Floats  # (p, p)
    s: Floats  # (p,)
    Z: Floats  # (n, p)
    torque: Floats  # (n,)
    misfit: float  # mean square of what was not expected, over its variance


class RecursiveGravityEstimator(EstimatedGravity):
    """Recursive least squares on torques that hold the arm still.

    A torque is taken only when it tells something, the excitation gate:

    - the arm is quasi-static: every joint slower than `max_speed`, for `settle` seconds;
    - no joint is within `margin` of a limit, whose stop would hold a part of the load;
    - `interval` seconds after the last one, as ticks in a row are the same torque;
    - its pose is new (the estimate's own uncertainty there exceeds `novelty` standard deviations of the noise), or
      it is a surprise (three of them off what was expected): a payload was taken up. An arm that rests for hours
      forgets nothing.

    Older torques count less by `forgetting` with each one taken. With `carriers`, a surprise is first looked for in
    what they carry. Works beside any controller, as an observer of `run_loop`; friction at rest is noise to it.
    """

    def __init__(
        self,
        model: RobotModel,
        *,
        noise: ArrayLike,
        s0: ArrayLike | None = None,
        spread: ArrayLike = 10.0,
        forgetting: float = 0.98,
        max_speed: ArrayLike = 0.02,
        settle: float = 0.2,
        margin: ArrayLike = 0.01,
        interval: float = 0.01,
        novelty: float = 0.3,
        carriers: Sequence[str] = (),
        load: tuple[float, float] = LOAD_SIZE,
    ) -> None:
        """Take a robot, of which geometry and limits are used.

        Args:
            noise: Standard deviation of torques at rest, one for all or (n,) [Nm|N].
            s0: (p,) parameters to start from, those of the compact regressor; zero when None.
            spread: Standard deviation of s0, one for all or (p,) [kg m, kg].
            forgetting: Over 0 to 1.
            max_speed: One for all or (n,) [rad/s|m/s]; settle, interval: [s].
            margin: To the model's joint limits, one for all or (n,) [rad|m].
            novelty: In standard deviations of the noise.
            carriers: Frames that may take up or put down a load on the way, such as hands; load: as of
                `LoadHypotheses`.
        """
        super().__init__(model, s0)
        n, p = model.n, len(self._s)
        self._max_speed = as_positive("max_speed", one_for_all(max_speed, n), (n,))
        self._noise = as_positive("noise", one_for_all(noise, n), (n,))
        from_stop = as_array("margin", one_for_all(margin, n), (n,))
        self._lower, self._upper = model.lower + from_stop, model.upper - from_stop
        deviations = as_positive("spread", one_for_all(spread, p), (p,))
        if deviations.min() < _MIN_SPREAD:
            raise InputError(f"spread: expected at least {_MIN_SPREAD} kg m, kg, got {deviations.min()}")
        self._prior = np.diag(1.0 / deviations**2)  # A_0
        for name, value in (("settle", settle), ("interval", interval), ("novelty", novelty)):
            as_not_negative(name, value)
        if not 0.0 < forgetting <= 1.0:
            raise InputError(f"forgetting: expected more than 0 and at most 1, got {forgetting}")
        self._forgetting, self._settle, self._interval, self._novelty = forgetting, settle, interval, novelty
        self._hypotheses = LoadHypotheses(self.regressor, carriers, load)
        self._loads = self._hypotheses.directions  # V
        self._prior_of_loaded = _widened(self._prior, self._loads)
        self._unloaded: Floats | None = None  # s_hat before the load changed
        self._past: deque[_TakenTorque] = deque(maxlen=_REMEMBERED_TORQUES)
        self._misfits: deque[float] = deque(maxlen=_REMEMBERED_TORQUES)
        self._excess = 1.0  # of the torques' noise over what was said
        self._last_pose = np.zeros(n), np.zeros(3)  # configuration and gravity of the last torque taken
        self._information = np.zeros((p, p))  # A
        self._resting_since, self._last_taken = np.nan, np.nan
        self.taken = 0  # torques that passed the gate

    @property
    def standard_deviations(self) -> Floats:
        """Standard deviations (p,) of s_hat, if the noise is as large as was said, and new in each sample."""
        return np.sqrt(np.diag(np.linalg.inv(self._information + self._prior)))

    @property
    def load(self) -> LoadBeliefs | None:
        """Carrier whose load has changed, by the torques since then; None if no change was detected."""
        if self._unloaded is None:
            return None
        return self._hypotheses.beliefs(*self._last_pose, self._noise, _CHANGE_PER_S)

    def update(self, q: Floats, qd: Floats, tau: Floats, gravity: Floats, time: float) -> bool:
        """Update from a state and the torque tau (n,) [Nm|N] that acts at a time [s]; return whether it was taken.

        Arrays are float64 and of the robot's size; what is not finite is not taken.
        """
        self._require_sizes(q, qd, tau)
        free = (self._lower < q) & (q < self._upper) & (np.abs(qd) <= self._max_speed) & np.isfinite(tau)
        if not free.all():  # also where a number is NaN
            self._resting_since = np.nan
            return False
        if not self._resting_since <= time:  # also when it is NaN
            self._resting_since = time
        is_soon = self._last_taken <= time < self._last_taken + self._interval
        if is_soon or time - self._resting_since < self._settle:
            return False
        Z = self._kernel(q, gravity)
        if not np.isfinite(Z).all():
            return False
        if not self._learn(Z / self._noise[:, None], (tau - Z @ self._s) / self._noise):
            return False
        self._last_taken, self.taken = time, self.taken + 1
        self._last_pose = q.copy(), gravity.copy()
        return True

    def _learn(self, Z: Floats, missing: Floats) -> bool:
        """Take a torque, in standard deviations of its noise, if it tells something."""
        known = self._information + self._prior
        variance = np.sum(Z.T * np.linalg.solve(known, Z.T), axis=0)
        deviations = np.abs(missing) / np.sqrt(1.0 + variance)
        surprise = float(deviations.max())
        tells = bool((np.abs(missing) > _SURPRISE_DEVIATIONS).any() or (variance > self._novelty**2).any())
        row = _TakenTorque(known, self._s.copy(), Z, missing + Z @ self._s, float(np.mean(deviations**2)))
        if self._loads.size:
            surprises = surprise > _SURPRISE_DEVIATIONS and (
                surprise > _ANOTHER_DEVIATIONS
                or self._unloaded is None
                or self._hypotheses.shares(_CHANGE_PER_S)[0] > 0.5
            )
            tells |= surprises
            if not (surprises and self._suspect([*self._past, row])) and tells:
                self._misfits.append(row.misfit)
                self._past.append(row)
                if self._unloaded is not None:
                    self._take(self._hypotheses, row, self._unloaded)
        if tells:
            self._add(row)
        return tells

    def _suspect(self, rows: Sequence[_TakenTorque]) -> bool:
        """Look for a load that has changed before one of the last torques; return whether that is likelier than not.

        A small load is no surprise at once: the arm's own parameters take up some of it before it is noticed. Where
        torques have scattered more than their noise was said to, evidence counts for less.
        """
        starts = []
        self._excess = max(1.0, float(np.sqrt(np.mean(self._misfits)))) if self._misfits else 1.0
        for k, start in enumerate(rows):
            hypotheses = copy(self._hypotheses)
            hypotheses.restart(start.known / self._excess**2)
            for row in rows[k:]:
                self._take(hypotheses, row, start.s)
            starts.append((max(hypotheses.evidence()), k, hypotheses))
        _, k, hypotheses = max(starts, key=itemgetter(0, 1))
        if hypotheses.shares(_CHANGE_PER_S)[0] > 0.5:
            return False
        start = rows[k]
        self._hypotheses, self._unloaded, self._s = hypotheses, start.s, start.s.copy()
        # the covariance is widened by V V^T; from now on nothing is known beforehand of what a load changes
        self._prior = self._prior_of_loaded
        self._information = _widened(start.known, self._loads) - self._prior
        for row in rows[k:-1]:
            self._add(row)
        self._past.clear()
        return True

    def _take(self, hypotheses: LoadHypotheses, row: _TakenTorque, unloaded: Floats) -> None:
        hypotheses.take(row.Z / self._excess, (row.torque - row.Z @ unloaded) / self._excess)

    def _add(self, row: _TakenTorque) -> None:
        self._information = self._forgetting * self._information + row.Z.T @ row.Z
        self._s += np.linalg.solve(self._information + self._prior, row.Z.T @ (row.torque - row.Z @ self._s))

    def follow(self, state: JointState, q_desired: Floats) -> Floats:
        """Update from a robot's state and the torque it reports, and return the gravity torque (n,) [Nm|N] there."""
        self.update(state.q, state.qd, state.tau, state.gravity, state.time)
        return self.torque(state.q, state.gravity)

    def __call__(self, tick: Observed) -> None:
        """Observe a tick of the control loop."""
        if tick.tau is not None:
            self.update(tick.state.q, tick.state.qd, tick.tau, tick.state.gravity, tick.time)


def _widened(information: Floats, directions: Floats) -> Floats:
    """Return the inverse of a covariance widened by V V^T: A - B (1 + V^T B)^-1 B^T with B = A V [Woodbury]."""
    B = information @ directions
    return information - B @ np.linalg.solve(np.eye(directions.shape[1]) + directions.T @ B, B.T)
