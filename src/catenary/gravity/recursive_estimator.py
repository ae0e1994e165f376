"""On-line estimation of gravity parameters by recursive least squares with forgetting.

tau = Z(q, gravity) s + noise, whenever the arm rests. In information form, each torque taken weighs its parameters:
A <- f A + Z^T W Z, s <- s + (A + A_0)^-1 Z^T W (tau - Z s) [Ljung, Soederstroem 1983, Theory and practice of recursive
identification; A is the inverse of their P]. A_0 holds what is known beforehand, a standard deviation per parameter;
it is not forgotten, so that what the data do not tell stays where it is, and A + A_0 can always be factorised.

Where it is known which frames take things up, a torque three standard deviations off what noise and P = (A + A_0)^-1
let expect widens P by what a load there would change, P + V Q V^T, as a Kalman filter does whose state may jump. So
the payload is told in the first pose, from all the joints that feel it, and what was learnt of the arm itself stays.
"""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from catenary.arrays import Floats, as_array
from catenary.errors import InputError
from catenary.gravity.cholesky import factorise, solve_lower, solve_upper
from catenary.gravity.estimator import Observed, as_speeds, regressor_with_effect
from catenary.gravity.payload import PER_LOAD, load_directions
from catenary.gravity.regressor import require_parameters
from catenary.kernels.compiled import compiled
from catenary.plant import JointState
from catenary.robots.model import RobotModel

SURPRISE = 3.0  # standard deviations of torque that say that the load has changed


class RecursiveGravityEstimator:
    """Recursive least squares on torques that hold the arm still.

    A torque is taken only when it tells something, the excitation gate:

    - the arm is quasi-static: every joint slower than `max_speed`, for `settle` seconds;
    - no joint is within `margin` of a limit, whose stop would hold a part of the load;
    - `interval` seconds after the last one, as ticks in a row are the same torque;
    - its pose is new (the estimate's own uncertainty there exceeds `novelty` standard deviations of the noise), or
      it is a surprise (three of them off what was expected): a payload was taken up. An arm that rests for hours
      forgets nothing.

    Older torques count less by `forgetting` with each one taken. With `carriers`, a surprise is first looked for in
    what they carry. Works beside any controller, as an observer of
    `run_loop`; friction that holds a resting arm is noise to it.
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
        load: tuple[float, float] = (2.0, 0.3),
    ) -> None:
        """Take a robot, of which geometry and limits are used.

        Args:
            model: The robot.
            noise: Standard deviation of torques at rest, one for all or (n,) [Nm|N].
            s0: (p,) parameters to start from, those of the compact regressor; zero when None.
            spread: Standard deviation of s0, one for all or (p,) [kg m, kg].
            forgetting: Over 0 to 1.
            max_speed: One for all or (n,) [rad/s|m/s].
            settle: [s].
            margin: To the model's joint limits, one for all or (n,) [rad|m].
            interval: [s].
            novelty: In standard deviations of the noise.
            carriers: Frames that may take up or put down a load on the way, such as hands.
            load: Standard deviations of its mass [kg], and of its moment about the frame's origin [kg m].

        Raises:
            InputError: Another shape or range, a carrier that is no moving frame, or a robot on which gravity has no
                effect.
        """
        self.regressor = regressor_with_effect(model)
        n, labels = model.n, self.regressor.labels
        p = len(labels)
        self._s = np.zeros(p) if s0 is None else np.array(require_parameters("s0", s0, labels))
        self._rows = np.stack(
            [
                as_speeds(max_speed, n),
                model.lower + _each("margin", margin, n),
                model.upper - _each("margin", margin, n),
                1.0 / _positive("noise", noise, n),
            ]
        )
        self._prior = 1.0 / _positive("spread", spread, p) ** 2
        for name, value in (("settle", settle), ("interval", interval), ("novelty", novelty)):
            if not 0.0 <= value < np.inf:
                raise InputError(f"{name}: expected zero or more, got {value}")
        if not 0.0 < forgetting <= 1.0:
            raise InputError(f"forgetting: expected more than 0 and at most 1, got {forgetting}")
        self._options = np.array([forgetting, settle, interval, novelty])
        sizes = np.repeat(_positive("load", load, 2), (1, PER_LOAD - 1))
        loads = [load_directions(self.regressor, frame) * sizes for frame in carriers]
        self._loads = np.ascontiguousarray(np.hstack([np.empty((p, 0)), *loads]))
        self._load_work = np.empty((2, self._loads.shape[1], max(p, self._loads.shape[1])))
        self._information = np.zeros((p, p))
        self._kernel = self.regressor.kernel()
        self._work = np.empty(p * p + p + n)
        self._clock = np.array([np.nan, np.nan, 0.0])  # resting since, last torque taken, torques taken

    @property
    def s_hat(self) -> Floats:
        """Estimated parameters (p,) [kg m, kg]; `regressor.labels` names them."""
        return self._s.copy()

    @property
    def standard_deviations(self) -> Floats:
        """Standard deviations (p,) of s_hat, if the noise is as large as was said, and new in each sample."""
        deviations: Floats = np.sqrt(np.diag(np.linalg.inv(self._information + np.diag(self._prior))))
        return deviations

    @property
    def taken(self) -> int:
        """Torques that passed the gate."""
        return int(self._clock[2])

    def update(self, q: Floats, qd: Floats, tau: Floats, gravity: Floats, time: float) -> bool:
        """See a state and the torque tau (n,) [Nm|N] that acts, at a time [s]; say whether it was taken.

        Arrays are float64 and of the robot's size; what is not finite is not taken.
        """
        n = self.regressor.model.n
        if not (len(q) == len(qd) == len(tau) == n):
            raise InputError(f"gravity estimator: is for {n} joints, the robot has {len(q)}")
        return _take(
            self._kernel(q, gravity),
            self._work,
            self._rows,
            self._prior,
            self._loads,
            self._load_work,
            self._options,
            self._clock,
            self._information,
            self._s,
            q,
            qd,
            tau,
            time,
        )

    def follow(self, state: JointState, q_desired: Floats) -> Floats:
        """Update from a robot's state and the torque it reports, and give the gravity torque (n,) [Nm|N] there."""
        self.update(state.q, state.qd, state.tau, state.gravity, state.time)
        return self.torque(state.q, state.gravity)

    def torque(self, q: Floats, gravity: Floats) -> Floats:
        """Estimated gravity torque Z s_hat (n,) [Nm|N]."""
        torque: Floats = self._kernel(q, gravity) @ self._s
        return torque

    def __call__(self, tick: Observed) -> None:
        """Observe a tick of the control loop."""
        if tick.tau is not None:
            self.update(tick.state.q, tick.state.qd, tick.tau, tick.state.gravity, tick.time)


def _each(name: str, values: ArrayLike, n: int) -> Floats:
    return as_array(name, np.broadcast_to(values, (n,)) if np.ndim(values) == 0 else values, (n,))


def _positive(name: str, values: ArrayLike, n: int) -> Floats:
    array = _each(name, values, n)
    if not (array > 0.0).all():
        raise InputError(f"{name}: expected more than 0, got {array.tolist()}")
    return array


@compiled
def _take(
    Z: Floats,
    work: Floats,
    rows: Floats,
    prior: Floats,
    loads: Floats,
    load_work: Floats,
    options: Floats,
    clock: Floats,
    information: Floats,
    s: Floats,
    q: Floats,
    qd: Floats,
    tau: Floats,
    time: float,
) -> bool:
    n, p = len(q), len(s)
    forgetting, settle, interval, novelty = options[0], options[1], options[2], options[3]
    for j in range(n):
        # comparisons with NaN are false
        free = rows[1, j] < q[j] < rows[2, j]
        if not (abs(qd[j]) <= rows[0, j] and free and abs(tau[j]) < np.inf):
            clock[0] = np.nan
            return False
    if not clock[0] <= time:  # also when it is NaN
        clock[0] = time
    if time - clock[0] < settle or (clock[1] <= time < clock[1] + interval):
        return False

    L, column, missing = work[: p * p].reshape(p, p), work[p * p : p * p + p], work[p * p + p :]
    tells = False
    for i in range(n):
        expected = 0.0
        for c in range(p):
            Z[i, c] *= rows[3, i]
            expected += Z[i, c] * s[c]
        missing[i] = tau[i] * rows[3, i] - expected
        if not abs(missing[i]) < np.inf:
            return False
        tells |= abs(missing[i]) > SURPRISE
    if not tells or loads.shape[1] > 0:
        _copy(information, prior, L)
        if not factorise(L):
            return False
        unexpected = False
        for i in range(n):
            variance = 0.0
            for c in range(p):
                column[c] = Z[i, c]
            solve_lower(L, column)
            for c in range(p):
                variance += column[c] * column[c]
            tells |= variance > novelty * novelty
            unexpected |= abs(missing[i]) > SURPRISE * math.sqrt(1.0 + variance)
        if unexpected:
            _doubt(information, prior, loads, load_work)
    if not tells:
        return False

    for c in range(p):
        for d in range(c + 1):
            total = 0.0
            for i in range(n):
                total += Z[i, c] * Z[i, d]
            information[c, d] = forgetting * information[c, d] + total
            information[d, c] = information[c, d]
    _copy(information, prior, L)
    if not factorise(L):
        return False
    for c in range(p):
        column[c] = 0.0
        for i in range(n):
            column[c] += Z[i, c] * missing[i]
    solve_lower(L, column)
    solve_upper(L, column)
    for c in range(p):
        s[c] += column[c]
    clock[1] = time
    clock[2] += 1.0
    return True


@compiled
def _doubt(information: Floats, prior: Floats, loads: Floats, work: Floats) -> None:
    """Widen the covariance by loads loads^T: I - I V (1 + V^T I V)^-1 V^T I of the information I [Woodbury]."""
    p, m = loads.shape
    W, S = work[0, :, :p], work[1, :, :m]  # V^T I (m, p); 1 + V^T I V
    for a in range(m):
        for c in range(p):
            total = prior[c] * loads[c, a]
            for d in range(p):
                total += information[c, d] * loads[d, a]
            W[a, c] = total
    for a in range(m):
        for b in range(a + 1):
            total = 1.0 if a == b else 0.0
            for c in range(p):
                total += W[a, c] * loads[c, b]
            S[a, b] = total
    if not factorise(S):
        return
    for c in range(p):
        solve_lower(S, W[:, c])
    for c in range(p):
        for d in range(p):
            for a in range(m):
                information[c, d] -= W[a, c] * W[a, d]


@compiled
def _copy(information: Floats, prior: Floats, L: Floats) -> None:
    for c in range(len(prior)):
        for d in range(c + 1):
            L[c, d] = information[c, d]
        L[c, c] += prior[c]
