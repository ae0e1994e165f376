"""Torques that something outside asks of the joints: from measured torques, with an interval, and from momentum.

M(q) qdd + C(q, qd) qd + g(q) + friction = tau + tau_ext: a hand that pushes a joint along gives a positive tau_ext, and
the actuators supply so much less.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from catenary.arrays import Floats, as_array, as_not_negative, as_positive, one_for_all
from catenary.dynamics.actuation_loads import ActuationLoads
from catenary.dynamics.inverse_dynamics import coriolis_matrix, inverse_dynamics, mass_matrix, motion_rows
from catenary.dynamics.kinematics import jacobian
from catenary.errors import InputError
from catenary.plant import JointState
from catenary.robots.model import RobotModel

IN_95_PERCENT = 1.96  # standard deviations
# chance of Gaussian noise beyond a collision's bound. What models leave has longer tails: in an hour of a simulated
# Panda, as identified, it reaches 7.3 standard deviations; the bound of seven joints is 8.4
_FALSE_ALARM = 1e-12
_LEAST_DEVIATION = 1e-9  # [Nm or N]
_STICKING_SPEED = {"rad": 0.02, "m": 0.002}  # [rad/s], [m/s] below which dry friction may be anything up to its level
_SINGULAR_RATIO = 1e-3  # of a Jacobian's largest singular value, rad and m alike: below it a direction is unobservable


class ExternalTorque(NamedTuple):
    """External joint torques, with half-widths of their 95 % intervals."""

    torque: Floats  # (n,) or (N, n) [Nm or N]
    half_width: Floats  # (n,): the interval is torque - half_width to torque + half_width


class ExternalWrench(NamedTuple):
    """A force and a moment about a frame's origin, in base axes, that ask for given torques."""

    wrench: Floats  # (6,) force [N], moment [Nm]; NaN if the arm cannot tell
    half_width: Floats  # (6,) of intervals that hold 95 of 100


def external_torque(
    model: RobotModel,
    q: ArrayLike,
    qd: ArrayLike,
    qdd: ArrayLike,
    tau: ArrayLike,
    gravity: ArrayLike,
    *,
    deviation: ArrayLike,
    loads: ActuationLoads | None = None,
) -> ExternalTorque:
    """Return the joint torques that the outside world causes: those of the model less those measured.

    Args:
        q: (n,) or (N, n) coordinates [rad or m]; qd, qdd: velocities and accelerations.
        tau: The same shape, measured at the joints [Nm or N].
        gravity: (3,) or (N, 3) [m/s2] in base axes.
        deviation: Standard deviation of torques from the model where nothing touches the arm, one number or (n,): the
            RMS of an identification on recordings that it did not see, not the noise of a sensor alone.
        loads: Friction, rotors, springs and known torques, as `known_loads(model)`; nothing when None.

    Examples:
        >>> arm = catenary.load_robot("two_link")
        >>> q, still, level = [0.3, 0.5], [0.0, 0.0], [0.0, 0.0, -9.81]
        >>> measured = catenary.gravity_torque(arm, q, level) - [0.0, 1.5]
        >>> catenary.external_torque(arm, q, still, still, measured, level, deviation=0.2).torque.round(3)
        array([0. , 1.5])
    """
    (rows, rates, accelerations, measured), single = motion_rows(model, q, qd=qd, qdd=qdd, tau=tau)
    spread = as_not_negative("deviation", one_for_all(deviation, model.n), (model.n,))
    external = inverse_dynamics(model, rows, rates, accelerations, gravity, loads=loads) - measured
    return ExternalTorque(external[0] if single else external, IN_95_PERCENT * spread)


def external_wrench(
    model: RobotModel, q: ArrayLike, external: ExternalTorque, frame: str | None = None
) -> ExternalWrench:
    """Estimate the external wrench on a frame from external torques, by weighted least squares: J^T w = torque.

    With fewer than six joints, or in a singular pose, components that no joint feels are NaN; the others then hold for
    a wrench without those components.

    Args:
        model: The robot.
        q: Configuration (n,) [rad or m].
        external: External torques (n,) with half-widths above zero, at `q`.
        frame: Frame that the wrench acts on, about whose origin the moment is; the tip when None.

    Raises:
        InputError: Another shape, or a half-width of zero.

    Examples:
        >>> arm = catenary.load_robot("puma560")
        >>> q, level = np.array([0.1, -0.8, 0.3, 0.4, 0.5, 0.6]), [0.0, 0.0, -9.81]
        >>> push = catenary.jacobian(arm, q).T @ [10.0, 0.0, 0.0, 0.0, 0.0, 0.0]
        >>> measured = catenary.gravity_torque(arm, q, level) - push
        >>> torque = catenary.external_torque(arm, q, 0 * q, 0 * q, measured, level, deviation=0.2)
        >>> catenary.external_wrench(arm, q, torque).wrench[:3].round(3)
        array([10.,  0.,  0.])
    """
    torque = as_array("external torque", external.torque, (model.n,))
    spread = as_positive("half-width of the external torque", external.half_width, (model.n,))
    A = jacobian(model, q, frame).T / spread[:, None]
    _, sizes, directions = np.linalg.svd(A, full_matrices=False)
    observable = sizes > _SINGULAR_RATIO * sizes[0]
    inverse = np.linalg.pinv(A, rcond=_SINGULAR_RATIO)
    hidden = np.ones(6) - np.sum(directions[observable] ** 2, axis=0) > _SINGULAR_RATIO
    wrench = np.where(hidden, np.nan, inverse @ (torque / spread))
    return ExternalWrench(wrench, np.where(hidden, np.nan, np.linalg.norm(inverse, axis=1)))


class MomentumObserver:
    """External torques from positions, speeds and torques alone: no acceleration is differentiated.

    The momentum p = M(q) qd changes by dp/dt = tau + C^T qd - g - friction + tau_ext, and r follows what it tells of
    tau_ext as a filter of first order, dr/dt = K (tau_ext - r) [De Luca, Albu-Schaffer, Haddadin, Hirzinger, "Collision
    detection and safe reaction with the DLR-III lightweight robot arm", IROS 2006].

    What r has beyond the level of dry friction of joints that turn back, by the same filter, is noise of a standard
    deviation, or a collision: where its sum of squares over all joints is beyond chance.

    Examples:
        >>> arm = catenary.load_robot("two_link")
        >>> observer = catenary.MomentumObserver(arm)
        >>> q, level = np.array([0.3, 0.5]), [0.0, 0.0, -9.81]
        >>> measured = catenary.gravity_torque(arm, q, level) - [0.0, 1.5]
        >>> for _ in range(500):
        ...     external = observer.update(q, 0 * q, measured, level, dt=0.001)
        >>> external.round(3)
        array([0. , 1.5])
    """

    def __init__(
        self,
        model: RobotModel,
        *,
        cutoff_hz: float = 10.0,
        loads: ActuationLoads | None = None,
        deviation: ArrayLike = np.inf,
    ) -> None:
        """Take a robot with its payload, the filter's K / (2 pi) [Hz], loads and deviation as in `external_torque`."""
        if loads is not None and loads.depends_on_load:
            raise InputError(
                f'robot "{model.name}": friction depends on the load: expected loads without, for momentum'
            )
        from scipy.stats import chi2  # takes a quarter of a second to import

        model.require_inertia()
        self.model, self.loads = model, loads
        spread = as_not_negative("deviation", one_for_all(deviation, model.n), (model.n,), finite=False)
        self.deviation = np.maximum(spread, _LEAST_DEVIATION)  # (n,) of r where nothing touches
        self._bound = float(np.sqrt(chi2.isf(_FALSE_ALARM, model.n)))
        self._sticking_speed = np.array([_STICKING_SPEED[unit] for unit in model.joint_units])
        self.gain = 2.0 * np.pi * float(as_positive("cutoff_hz", cutoff_hz, ()))
        self._rotors = np.zeros((model.n, model.n)) if loads is None else loads.rotors
        self.added_mass = np.zeros((model.n, model.n))  # of a load, that the mass matrix lacks, in slow motion
        self.reset()

    def reset(self) -> None:
        """Forget what was seen."""
        self._before: Floats | None = None
        self._time = np.nan  # [s] of the last state
        self.torque, self.sticking = np.zeros((2, self.model.n))  # sticking: what dry friction may hide of each joint

    @property
    def half_width(self) -> Floats:
        """Torque (n,) of each joint alone that is no collision [Nm or N]; infinite where no deviation is known."""
        return self._bound * self.deviation + self.sticking

    @property
    def collided(self) -> tuple[str, ...]:
        """The joints that tell a collision, most telling first; none where noise and friction may be all."""
        shares = np.maximum(np.abs(self.torque) - self.sticking, 0.0) / self.deviation
        if not float(np.linalg.norm(shares)) > self._bound:
            return ()
        return tuple(self.model.joint_names[k] for k in np.argsort(-shares) if shares[k] > IN_95_PERCENT)

    def learn(self, q: ArrayLike, qd: ArrayLike, tau: ArrayLike, gravity: ArrayLike, dt: float) -> None:
        """Take the deviation from rows (N, n) of a motion, `dt` [s] apart, in which nothing touched the arm.

        An identification's held-out recordings are such; its own RMS is of filtered accelerations, not of this filter.
        """
        self.reset()
        shape = (None, self.model.n)
        rows = zip(as_array("q", q, shape), as_array("qd", qd, shape), as_array("tau", tau, shape), strict=True)
        seen = np.array([(self.update(*row, gravity, dt), self.sticking) for row in rows])
        settled = seen[round(5.0 / self.gain / dt) :]
        if len(settled) < 2:
            raise InputError("observer: expected rows of more than five time constants of its filter")
        torques, sticks = settled[:, 0], settled[:, 1]
        beyond = np.maximum(np.abs(torques) - sticks, 0.0) ** 2
        slides = sticks <= 0.1 * np.sqrt(np.mean(torques**2, axis=0))
        count = slides.sum(axis=0)
        sliding = np.sum(np.where(slides, torques**2, 0.0), axis=0) / np.maximum(count, 1)
        squares = np.where(count > 0.1 * len(settled), sliding, beyond.mean(axis=0))
        self.deviation = np.maximum(np.sqrt(squares), _LEAST_DEVIATION)
        self.reset()

    def follow(self, state: JointState, gravity: ArrayLike) -> float:
        """Update by a robot's state; return the time since the last one [s], 0 where none passed or a number lacks."""
        elapsed, self._time = state.time - self._time, state.time
        if not (elapsed > 0.0 and all(np.isfinite(array).all() for array in (state.q, state.qd, state.tau))):
            return 0.0
        self.update(state.q, state.qd, state.tau, gravity, elapsed)
        return elapsed

    def update(self, q: ArrayLike, qd: ArrayLike, tau: ArrayLike, gravity: ArrayLike, dt: float) -> Floats:
        """Return the external torques (n,) [Nm or N] at q, qd, tau (n,), some dt [s] after the last ones."""
        step = float(as_positive("dt", dt))
        (rows, rates, torques), _ = motion_rows(self.model, as_array("q", q, (self.model.n,)), qd=qd, tau=tau)
        momentum = (mass_matrix(self.model, rows[0]) + self._rotors + self.added_mass) @ rates[0]
        still = np.zeros_like(rows)
        pushed = torques[0] + coriolis_matrix(self.model, rows[0], rates[0]).T @ rates[0]
        pushed -= inverse_dynamics(self.model, rows[0], still[0], still[0], gravity)
        share, level = 1.0 - np.exp(-self.gain * step), np.zeros(self.model.n)
        if self.loads is not None:
            friction, level = self._friction(self.loads, rows, rates)
            pushed -= friction
        if self._before is not None:
            # p' = pushed + tau_ext, and r' = K (tau_ext - r): both over one step, r by its exact exponential
            mean = (momentum - self._before[0]) / step - 0.5 * (pushed + self._before[1])
            self.torque = self.torque + share * (mean - self.torque)
        self.sticking = self.sticking + share * (level - self.sticking)
        self._before = np.array([momentum, pushed])
        return self.torque.copy()

    def _friction(self, loads: ActuationLoads, q: Floats, qd: Floats) -> tuple[Floats, Floats]:
        """Return the loads' torques (n,), and by how much friction near rest may differ: there it goes straight."""
        still = np.abs(qd[0]) < self._sticking_speed
        high, low = (np.where(still, way * self._sticking_speed, qd) for way in (1.0, -1.0))
        both = loads.torque(np.vstack([q, q]), np.vstack([high, low]), np.zeros((2, self.model.n)))
        middle, level = 0.5 * (both[0] + both[1]), 0.5 * (both[0] - both[1])
        return middle + level * np.where(still, qd[0] / self._sticking_speed, 0.0), np.abs(level)
