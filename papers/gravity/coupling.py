"""From a base's motion to joint errors and back: frequency response of PD with gravity, and when it may swing up.

Lewis and Hannaford 2014, future work: "a study of the frequency response of the system with the PD+DG controller could
show a case in which specific perturbations of the base could create a positive feedback instability between the robot
motion and the accelerometer". Here is that case, linearised about a pose at rest:

    (M s² + Kd s + Kp) q = -(h s² + t) x + F(s) (h' s² + t) x     joints, x a small motion of the base
    m (s² + 2 zeta w_b s + w_b²) x = -(h s² + t)ᵀ q               base on a spring, pushed by the arm

h is what the joints feel of the base's acceleration, t of its tilt (zero where it sways), F what the sensor and its
filter make of the truth; h' is what the sensor tells: all of h for sway, by the accelerometer; of a turning base
nothing without a gyroscope. PD and PD+SG have F = 0. Around the loop

    L(s) = (h s² + t)ᵀ (M s² + Kd s + Kp)⁻¹ ((h - F h') s² + t (1 - F)) / (m (s² + 2 zeta w_b s + w_b²))

and the base is stable where |L| < 1 at all frequencies (small gain), for any phase of F: m above

    max over s = j w of |(h s² + t)ᵀ D⁻¹ (...)| / |s² + 2 zeta w_b s + w_b²|.

`unstable_roots` counts the closed loop's roots to the right by the argument principle, without that margin. Gravity's
own stiffness, a hundredth of the gains, is left out. The arm is RAVEN-II's links with its motors' inertia; the gains
are its own. F of this package's estimator is measured by feeding it; a held sample is a formula.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catenary import BaseMotion, gravity_torque, inverse_dynamics, load_robot, mass_matrix
from catenary.arrays import Floats
from catenary.sensing.gravity_vector import Mailbox
from catenary.sensing.imu import SensedGravity
from catenary.sensing.mounting import Mounting
from catenary.simulation.base_motion import RockingBase
from catenary.simulation.sensors import SensorModel, SimulatedSensor
from catenary.workflows.gravity_trials import RAVEN_START, raven_gains, raven_motor_inertia
from papers.gravity.raven_base import Z0, raven_of_2014, turned_base

Complexes = NDArray[np.complexfloating[Any, Any]]
Response = Callable[[Floats], Complexes]  # of frequencies (N,) [Hz]
BASE_DEG = 15.0
LATENCY = 0.002  # [s]
ZETA = 0.02  # damping ratio of a base, as of bolted steel
SIZES = 80  # of a base, tried for whether it swings up
GRID = np.geomspace(0.05, 60.0, 160)  # [Hz]


class Linear(NamedTuple):
    """An arm at rest, and a motion of its base, seen by the joints."""

    mass: Floats  # (n, n) with motors
    kp: Floats  # (n,)
    kd: Floats  # (n,)
    h: Floats  # (n,) torque per acceleration of the base
    t: Floats  # (n,) torque per tilt of the base
    own: float = 0.0  # mass, or inertia about the base's axis, of the arm itself: no base with arm has less

    def stiff(self, s: Complexes) -> Complexes:
        """Return M s² + Kd s + Kp, (N, n, n), for s (N, 1)."""
        at = s[..., None]
        matrix: Complexes = self.mass * at * at + np.eye(len(self.kp)) * (self.kd * s + self.kp)[..., None]
        return matrix


class Sensing(NamedTuple):
    """What a sensor makes of gravity with the base's acceleration, and of its angular acceleration."""

    gravity: Response
    turning: Response


def blind(hz: Floats) -> Complexes:
    """Return the response of no sensor: zero."""
    return 0j * hz


def held_sample(rate_hz: float, latency: float) -> Response:
    """Return the response of a sample held until the next: a delay of the latency and, on average, half a period."""

    def response(hz: Floats) -> Complexes:
        x = hz / rate_hz
        held: Complexes = np.exp(-2j * np.pi * hz * latency) * np.exp(-1j * np.pi * x) * np.sinc(x)
        return held

    return response


def raven_on(motion: str, q: ArrayLike = RAVEN_START, base_deg: float = BASE_DEG) -> Linear:
    """Return RAVEN-II at rest on a base that turns about Z0 ("turn"), or sways along its x, y or z."""
    model, arm = load_robot("raven2"), raven_of_2014()
    pose, zero = np.asarray(q, dtype=float)[None], np.zeros((1, model.n))
    gains = raven_gains(arm.firmware)
    links = mass_matrix(model, pose)[0]
    mass = links + raven_motor_inertia(arm)
    gravity = turned_base(base_deg).sample(np.zeros(1)).gravity[0]
    if motion != "turn":
        # accelerating along u is falling along -u, and torque is linear in gravity
        away = -np.eye(3)["xyz".index(motion)]
        own = float(model.tree.mass.sum())
        return Linear(mass, *gains, gravity_torque(model, pose[0], away), np.zeros(model.n), own)
    h = inverse_dynamics(model, pose, zero, zero, np.zeros((1, 3)), BaseMotion(np.zeros(3), Z0))[0]
    # gravity turns the other way in a base that turns
    t = gravity_torque(model, pose[0], -np.cross(Z0, gravity))
    # the base turns about joint 1's axis, through the same point
    return Linear(mass, *gains, h, t, float(links[0, 0]))


def joint_response(arm: Linear, hz: ArrayLike, sensing: Sensing) -> Complexes:
    """Return joint errors per motion of the base, (N, n), at frequencies (N,) [Hz]."""
    at = np.atleast_1d(np.asarray(hz, dtype=float))
    lacking = _lacking(arm, at, sensing)
    response: Complexes = np.linalg.solve(arm.stiff(2j * np.pi * at[:, None]), lacking[..., None])[..., 0]
    return response


def loop(arm: Linear, hz: ArrayLike, sensing: Sensing, base_hz: float, zeta: float = ZETA) -> Complexes:
    """Return the loop gain L (N,) of a base of mass or inertia 1: through sensor, torque and arm back to it."""
    s, w = 2j * np.pi * np.atleast_1d(np.asarray(hz, dtype=float)), 2.0 * np.pi * base_hz
    back = arm.h * (s * s)[:, None] + arm.t
    around: Complexes = (back * joint_response(arm, hz, sensing)).sum(axis=1) / (s * s + 2.0 * zeta * w * s + w * w)
    return around


def smallest_base(arm: Linear, sensing: Sensing, base_hz: float, zeta: float = ZETA) -> float:
    """Return the mass [kg] or inertia [kg m2] of base with arm above which small gain makes it stable."""
    grid = np.unique(np.concatenate([GRID, base_hz * np.linspace(0.9, 1.1, 41)]))
    return float(np.abs(loop(arm, grid, sensing, base_hz, zeta)).max())


def unstable_roots(
    arm: Linear, sensing: Sensing, base_hz: float, size: float, zeta: float = ZETA, *, most_hz: float = 2000.0
) -> int:
    """Count the roots of 1 - L to the right of the imaginary axis, for a base of a mass or inertia.

    L has none of its own poles there: arm and base are stable by themselves.
    """
    return _roots_of(_around(arm, sensing, base_hz, zeta, most_hz) / size)


def largest_unstable_base(
    arm: Linear, sensing: Sensing, base_hz: float, zeta: float = ZETA, *, most_hz: float = 200.0
) -> float:
    """Return the largest base [kg|kg m2] with arm, from small gain's down to the arm alone, that is unstable; or 0."""
    L = _around(arm, sensing, base_hz, zeta, most_hz)
    largest = float(np.abs(L).max())
    if largest <= arm.own:
        return 0.0
    sizes = np.geomspace(largest, max(arm.own, 0.02 * largest), SIZES)
    return next((float(size) for size in sizes if _roots_of(L / size) > 0), 0.0)


def _around(arm: Linear, sensing: Sensing, base_hz: float, zeta: float, most_hz: float) -> Complexes:
    """Return L of a base of size 1 along the imaginary axis, densely near the base's own frequency."""
    grid = np.unique(np.concatenate([np.geomspace(1e-3, most_hz, 4000), base_hz * np.linspace(0.8, 1.2, 2001)]))
    return loop(arm, grid, sensing, base_hz, zeta)


def _roots_of(L: Complexes) -> int:
    turned = np.unwrap(np.angle(1.0 - L))
    # both halves of the axis; the arc at infinity turns nothing, where L is below 1
    return round(float(-(turned[-1] - turned[0]) / np.pi))


def estimator_response(hz: float, rate_hz: float = 200.0) -> tuple[complex, complex]:
    """Return SensedGravity's response to gravity's x and to the angular acceleration of a rocking base."""
    w = 2.0 * np.pi * hz
    # below the estimator's own rates of change
    amplitude = min(0.02, 0.1 / w, 0.2 * 400.0 / w**3)
    base = RockingBase(0.0, amplitude, hz, tuple(Z0.tolist()))
    sensor = SensorModel(rate_hz, 0.0, 0.0, 0.0, 0.0, LATENCY, True, Mounting())
    mailbox = Mailbox()
    feed = SimulatedSensor(base, mailbox, sensor).advance
    source = SensedGravity(mailbox, Mounting(checked=True), stuck_samples=0, feed=feed)
    first = max(0.6, 1.0 / hz)
    times = np.arange(0.0, first + max(0.5, round(1.0 / hz + 0.5)), 0.001)
    readings = [source.read(float(time)) for time in times]
    kept = times >= first
    waves = np.stack([np.sin(w * times), np.cos(w * times), np.ones(len(times))], axis=1)[kept]
    truth = base.sample(times[kept])
    read = np.array([[r.gravity[0], r.base_rates[1] @ Z0] for r in readings])[kept]
    true = np.stack([truth.gravity[:, 0], truth.motion[:, 1] @ Z0], axis=1)
    fits = [np.linalg.lstsq(waves, values, rcond=None)[0] for values in (read, true)]
    ratio = (fits[0][0] + 1j * fits[0][1]) / (fits[1][0] + 1j * fits[1][1])
    return complex(ratio[0]), complex(ratio[1])


def estimator(rate_hz: float = 200.0, points: int = 28) -> Sensing:
    """Return the response of SensedGravity with accelerometer and gyroscope, measured on a grid and interpolated."""
    grid = np.geomspace(0.5, 60.0, points)
    measured = np.array([estimator_response(hz, rate_hz) for hz in grid])

    def of(column: int) -> Response:
        values = np.concatenate([[1.0 + 0.0j], measured[:, column]])
        known = np.concatenate([[0.0], grid])
        return lambda hz: np.interp(hz, known, values.real) + 1j * np.interp(hz, known, values.imag)

    return Sensing(of(0), of(1))


def _lacking(arm: Linear, hz: Floats, sensing: Sensing) -> Complexes:
    s = 2j * np.pi * hz[:, None]
    gravity, turning = sensing.gravity(hz)[:, None], sensing.turning(hz)[:, None]
    # an accelerometer tells sway as it tells gravity; a turning only a gyroscope
    sensed = turning if arm.t.any() else gravity
    lacking: Complexes = arm.h * s * s * (1.0 - sensed) + arm.t * (1.0 - gravity)
    return lacking
