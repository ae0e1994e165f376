"""Gains, limits and inertia at the joints: from a robot's own numbers at its motors, or from a rule.

A motor behind a gearbox and a capstan turns `ratio` times per joint. A torque asked for at the gearbox's output, as
RAVEN-II's firmware counts it, is ratio / gearbox times as large at the joint; so
    kp at the joint = kp ratio^2 / gearbox        kd likewise        inertia at the joint = inertia ratio^2
Coupling between the cables is left out of the gains. Seen from the joints the firmware's stiffness is C^T diag(kp) C;
with RAVEN-II's coupling its other entries are at most a seventh of the geometric mean of the diagonal ones beside them.
"""

from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike

from catenary.arrays import Floats, as_array, as_positive
from catenary.control.limits import TorqueLimits
from catenary.dynamics.inverse_dynamics import mass_matrix
from catenary.errors import InputError
from catenary.robots.model import RobotModel
from catenary.transmission.cable_elasticity import winding_of

NATURAL_FREQUENCY_HZ = 5.0  # of the rule: a natural frequency that a 1 kHz loop and a stiff arm follow with ease
DAMPING_RATIO = 0.7
_LOOP_RATE_HZ = 1000.0
_FASTEST_DECAY = 0.5  # of a mode in one tick; beyond 2 a sampled damper makes it grow
# ours: no torque rises from none to the largest faster than this, so that a wrong number shows before it does harm
_RISE_TIME_S = 0.02  # [s]
_TAPER_WIDTHS = {"rad": 0.035, "m": 0.002}  # [rad], [m] from a joint limit: 2 deg, 2 mm
_SAMPLES = 256  # of the joint range
_REDUCTION = 0.1  # in a step, of the inertia of a joint that alone moves in a mode


class JointGains(NamedTuple):
    """Stiffness and damping of every joint."""

    kp: Floats  # (n,) [Nm/rad|N/m]
    kd: Floats  # (n,) [Nms/rad|Ns/m]


class DrivenJoints(Protocol):
    """Parameters for controllers: an arm's model, joint gains, motors and springs."""

    @property
    def model(self) -> RobotModel:
        """The robot."""

    @property
    def gains(self) -> JointGains:
        """Stiffness and damping of its joints' PD, (n,) each."""

    @property
    def motor_inertia(self) -> Floats | None:
        """The motors' contribution to the mass matrix (n, n), if known."""

    @property
    def stiffness(self) -> Floats | None:
        """Stiffness (n,) of elastic joints [Nm/rad|N/m]; None for stiff ones."""


def gains_at_joints(kp: ArrayLike, kd: ArrayLike, ratio: ArrayLike, gearbox: ArrayLike) -> JointGains:
    """Return gains at the joints of a robot that controls its motors.

    Args:
        kp: Torque at the gearbox's output per turning of the motor (n,) [Nm/rad].
        kd: Likewise, per speed of the motor (n,) [Nms/rad].
        ratio: Turning of the motor per joint motion (n,) [rad/rad|rad/m].
        gearbox: Turning of the motor per turning of the gearbox's output (n,).
    """
    turns = as_array("ratio", ratio, (None,))
    lever = turns**2 / as_array("gearbox", gearbox, turns.shape)
    return JointGains(as_array("kp", kp, turns.shape) * lever, as_array("kd", kd, turns.shape) * lever)


def torque_at_joints(
    dac_limit: ArrayLike, dac_per_ampere: ArrayLike, torque_constant: ArrayLike, ratio: ArrayLike
) -> Floats:
    """Return the largest joint torques that a motor board can give.

    Args:
        dac_limit: Largest DAC value (n,); 0 for none.
        dac_per_ampere: DAC value per motor current (n,) [1/A].
        torque_constant: Motor torque per current (n,) [Nm/A].
        ratio: Turning of the motor per joint motion (n,) [rad/rad|rad/m].

    Returns:
        (n,) [Nm|N]; infinite without a limit.
    """
    turns = as_array("ratio", ratio, (None,))
    limit = as_array("dac_limit", dac_limit, turns.shape)
    current = np.where(limit > 0.0, limit, np.inf) / as_array("dac_per_ampere", dac_per_ampere, turns.shape)
    return current * as_array("torque_constant", torque_constant, turns.shape) * np.abs(turns)


def reflected_inertia(rotor_inertia: ArrayLike, ratio: ArrayLike, coupling: ArrayLike) -> Floats:
    """Return the inertia that the motors of three coupled joints add to the mass matrix: C^T diag(J ratio^2) C.

    Args:
        rotor_inertia: Inertia at the motor shafts (3,) [kg m2].
        ratio: Turning of the motor per joint motion (3,) [rad/rad|rad/m].
        coupling: Coefficients c01, c02, c12 of transmission/cable_elasticity.py (3,).

    Returns:
        (3, 3).
    """
    c = as_array("coupling", coupling, (3,))
    C = np.array([winding_of(c, unit) for unit in np.eye(3)]).T
    at_cables = as_array("rotor_inertia", rotor_inertia, (3,)) * as_array("ratio", ratio, (3,)) ** 2
    return C.T @ np.diag(at_cables) @ C


def gains_from_mass(
    model: RobotModel,
    *,
    frequency_hz: float = NATURAL_FREQUENCY_HZ,
    damping_ratio: float = DAMPING_RATIO,
    rate_hz: float = _LOOP_RATE_HZ,
    motor_inertia: ArrayLike | None = None,
) -> JointGains:
    """Return gains by a rule: kp = w^2 M_jj, kd = 2 damping_ratio w M_jj, with M_jj the largest over the joint range.

    Each joint alone, the others held, then oscillates at `frequency_hz` where its inertia is largest, and faster
    and less damped elsewhere. A joint without limits is taken over a whole turn, or a metre. Where axes fall into line
    with the others free, far less than M_jj moves: a wrist, or an upper arm that rolls below a stretched forearm. The
    joints that move in a mode of M^-1 kd too fast for the loop get less than their M_jj, until there is no such mode.

    Args:
        model: The robot; needs inertia.
        frequency_hz, damping_ratio: Natural frequency [Hz], and damping ratio.
        rate_hz: Rate of the control loop [Hz].
        motor_inertia: Inertia that motors add to the mass matrix (n, n); none when None.

    Raises:
        InputError: A number that is not positive.
    """
    for name, value in (("frequency_hz", frequency_hz), ("damping_ratio", damping_ratio), ("rate_hz", rate_hz)):
        as_positive(name, value)
    half = np.where(np.array(model.joint_units) == "rad", np.pi, 0.5)
    lower = np.where(np.isfinite(model.lower), model.lower, -half)
    upper = np.where(np.isfinite(model.upper), model.upper, half)
    from scipy.stats import qmc  # takes a quarter of a second to import

    points = lower + (upper - lower) * qmc.Halton(model.n, scramble=False).random(_SAMPLES)
    masses = mass_matrix(model, points)
    if motor_inertia is not None:
        masses = masses + as_array("motor_inertia", motor_inertia, (model.n, model.n))
    largest = np.einsum("kjj->kj", masses).max(axis=0)
    for j in np.flatnonzero(largest <= 0.0):
        raise InputError(
            f'robot "{model.name}": joint "{model.joint_names[j]}" moves no mass, expected some: give its motor\'s '
            "inertia, or gains"
        )
    w = 2.0 * np.pi * frequency_hz
    damping = 2.0 * damping_ratio * w
    counted = _reduced_inertia(largest, masses, _FASTEST_DECAY * rate_hz / damping)
    return JointGains(w * w * counted, damping * counted)


def _reduced_inertia(inertia: Floats, masses: Floats, max_eigenvalue: float) -> Floats:
    """Reduce inertia (n,) until M^-1 diag(inertia) has no eigenvalue beyond `max_eigenvalue`, for masses M (K, n, n).

    Less of it lowers every eigenvalue at every pose, so that each pose is looked at once.
    """
    inertia = inertia.copy()
    for mass in masses:
        inverse = np.linalg.inv(mass)
        while True:
            root = np.sqrt(inertia)
            eigenvalues, modes = np.linalg.eigh(root[:, None] * inverse * root)
            if eigenvalues[-1] <= max_eigenvalue:
                break
            inertia *= 1.0 - _REDUCTION * modes[:, -1] ** 2
    return inertia


def default_limits(torque: ArrayLike, units: tuple[str, ...], lower: Floats, upper: Floats) -> TorqueLimits:
    """Return torque limits with a rise time and a taper towards the joint limits.

    Args:
        torque: Largest torques (n,) [Nm|N]; infinity for none, which then has no largest rate either.
        units: Unit of each joint, "rad" or "m".
        lower, upper: Joint limits (n,) [rad|m]; infinite for none.
    """
    largest, taper = as_array("torque", torque, (len(units),), finite=False), [_TAPER_WIDTHS[unit] for unit in units]
    return TorqueLimits(largest, slew=largest / _RISE_TIME_S, lower=lower, upper=upper, taper=taper)
