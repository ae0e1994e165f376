"""On-line estimation of gravity parameters by recursive least squares with forgetting.

tau = Z(q, gravity) s + noise, whenever the arm rests. In information form, each torque taken weighs its parameters:
A <- f A + Z^T W Z, s <- s + (A + A_0)^-1 Z^T W (tau - Z s) [Ljung, Soederstroem 1983, Theory and practice of recursive
identification; A is the inverse of their P]. A_0 holds what is known beforehand, a standard deviation per parameter;
it is not forgotten, so that what the data do not tell stays where it is, and A + A_0 can always be inverted.

Where it is known which frames take things up, a torque three standard deviations off what noise and P = (A + A_0)^-1
let expect widens P by what a load there would change, P + V Q V^T, as a Kalman filter does whose state may jump, and
A_0^-1 alike: beforehand nothing is known of a load, and what is not forgotten must not hold it. So
the payload is told in the first pose, from all the joints that feel it, and what was learnt of the arm itself stays.
Which frame has it is told with probabilities (carriers.py): one pose seldom tells.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from catenary.arrays import Floats, as_array, as_positive
from catenary.errors import InputError
from catenary.gravity.carriers import LOAD, LoadBeliefs, LoadHypotheses
from catenary.gravity.estimator import EstimatedGravity, Observed, one_for_all
from catenary.plant import JointState
from catenary.robots.model import RobotModel

SURPRISE = 3.0  # standard deviations of torque that say that the load has changed
CHANGE = (
    1e-3  # probability that a load changes between two torques taken: of many, some stand out by noise alone
)
LEAST_SPREAD = 1e-6  # [kg m, kg] of a parameter: beside a load, less than that is lost in rounding
ANOTHER = 5.0  # the same, once a load is looked for: noise alone exceeds three of them now and then


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
        load: tuple[float, float] = LOAD,
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
            load: Standard deviations of a large load's mass [kg], and of its moment about the frame's origin [kg m];
                smaller ones, down to a 64th, are as likely.

        Raises:
            InputError: Another shape or range, a carrier that is no moving frame, or a robot on which gravity has no
                effect.
        """
        super().__init__(model, s0)
        n, p = model.n, len(self._s)
        self._max_speed = as_positive("max_speed", one_for_all(max_speed, n), (n,))
        self._noise = as_positive("noise", one_for_all(noise, n), (n,))
        from_stop = as_array("margin", one_for_all(margin, n), (n,))
        self._lower, self._upper = model.lower + from_stop, model.upper - from_stop
        deviations = as_positive("spread", one_for_all(spread, p), (p,))
        if deviations.min() < LEAST_SPREAD:
            raise InputError(f"spread: expected at least {LEAST_SPREAD} kg m, kg, got {deviations.min()}")
        self._prior = np.diag(1.0 / deviations**2)  # A_0
        for name, value in (("settle", settle), ("interval", interval), ("novelty", novelty)):
            if not 0.0 <= value < np.inf:
                raise InputError(f"{name}: expected zero or more, got {value}")
        if not 0.0 < forgetting <= 1.0:
            raise InputError(f"forgetting: expected more than 0 and at most 1, got {forgetting}")
        self._forgetting, self._settle, self._interval, self._novelty = forgetting, settle, interval, novelty
        self._hypotheses = LoadHypotheses(self.regressor, carriers, load)
        self._loads = self._hypotheses.directions  # V
        self._prior_of_loaded = _widened(self._prior, self._loads)
        self._unloaded: Floats | None = None  # s_hat before the load changed
        self._last_pose = np.zeros(n), np.zeros(3)  # configuration and gravity of the last torque taken
        self._information = np.zeros((p, p))  # A
        self._resting_since, self._last_taken, self._taken = np.nan, np.nan, 0

    @property
    def standard_deviations(self) -> Floats:
        """Standard deviations (p,) of s_hat, if the noise is as large as was said, and new in each sample."""
        deviations: Floats = np.sqrt(np.diag(np.linalg.inv(self._information + self._prior)))
        return deviations

    @property
    def load(self) -> LoadBeliefs | None:
        """Which carrier's load has changed, as far as torques since then tell; None where none has been noticed."""
        if self._unloaded is None:
            return None
        return self._hypotheses.beliefs(*self._last_pose, self._noise, CHANGE)

    @property
    def taken(self) -> int:
        """Torques that passed the gate."""
        return self._taken

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
        if time - self._resting_since < self._settle:
            return False
        if self._last_taken <= time < self._last_taken + self._interval:
            return False
        Z = self._kernel(q, gravity)
        if not np.isfinite(Z).all():
            return False
        if not self._learn(Z / self._noise[:, None], (tau - Z @ self._s) / self._noise):
            return False
        self._last_taken, self._taken = time, self._taken + 1
        self._last_pose = q.copy(), gravity.copy()
        return True

    def _learn(self, Z: Floats, missing: Floats) -> bool:
        """Take a torque, in standard deviations of its noise, if it tells something."""
        tells = bool((np.abs(missing) > SURPRISE).any())
        if not tells or self._loads.size:
            variance = np.sum(Z.T * np.linalg.solve(self._information + self._prior, Z.T), axis=0)
            tells |= bool((variance > self._novelty**2).any())
            surprise = float((np.abs(missing) / np.sqrt(1.0 + variance)).max())
            if surprise > SURPRISE:
                if self._loads.size and self._begins_anew(surprise):
                    self._hypotheses.restart(self._information + self._prior)
                    self._unloaded = self._s.copy()
                self._doubt_loads()
        if tells:
            if self._unloaded is not None:
                self._hypotheses.take(Z, missing + Z @ (self._s - self._unloaded))
            self._information = self._forgetting * self._information + Z.T @ Z
            self._s += np.linalg.solve(self._information + self._prior, Z.T @ missing)
        return tells

    def _begins_anew(self, surprise: float) -> bool:
        """Return whether a surprise is of a load that is not yet looked for."""
        none_so_far = self._unloaded is None or self._hypotheses.shares(CHANGE)[0] > 0.5
        return none_so_far or surprise > ANOTHER

    def _doubt_loads(self) -> None:
        """Widen the covariance by V V^T; from now on nothing is known beforehand of what a load changes."""
        widened = _widened(self._information + self._prior, self._loads)
        self._prior = self._prior_of_loaded
        self._information = widened - self._prior

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
    widened: Floats = information - B @ np.linalg.solve(np.eye(directions.shape[1]) + directions.T @ B, B.T)
    return widened
