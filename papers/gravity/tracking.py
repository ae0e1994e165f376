"""Cartesian sinusoids on tilted and rocking bases: what figures 9 and 10 of the gravity paper are made of.

Lewis and Hannaford 2014, sections IV and V: sinusoids of 3.1 inch and 4 s, two cycles along each Cartesian axis, sent
as workspace increments at 1000 Hz; base at 0 to 20 degrees about Z0, then rocked between 10 and 20 degrees at 1 Hz;
gravity from an accelerometer at 100 Hz. The measure is the RMS of desired minus reported joint position, at the
motors.
"""

from collections.abc import Callable, Sequence
from copy import deepcopy
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from catenary import CablePlant
from catenary.arrays import Floats, as_array
from catenary.control.controllers import make_controller
from catenary.control.loop import GravitySource, Tick
from catenary.control.pd import Damping, EstimatedGravityPD, GravityLearner, SplitController
from catenary.dynamics.kinematics import forward_kinematics
from catenary.dynamics.raven_inverse_kinematics import raven_path
from catenary.gravity.estimator import GravityEstimator, RecursiveGravityEstimator
from catenary.robots.model import RobotModel
from catenary.sensing.gravity_vector import FixedGravity, GravityReading, Mailbox, ReadingStatus
from catenary.sensing.imu import SensedGravity
from catenary.sensing.imu_faults import Fault
from catenary.simulation.base_motion import MovingBase
from catenary.simulation.cable_parameters import CableArm
from catenary.simulation.sensors import SensorModel, SimulatedSensor
from catenary.spatial import LEVEL, STANDARD_GRAVITY
from catenary.trajectories.cartesian import CYCLES, CartesianSinusoids
from catenary.trajectories.reference import SampledTrajectory, Trajectory
from catenary.workflows.gravity_trials import RAVEN_START, SimulatedArm, raven_arm, track
from papers.experiment import Result, run
from papers.gravity.raven_base import ASIDE, SHOWN, TrueAttitude, ideal_sensor, raven_of_2014, rocking_base, turned_base

# the base of figure 10, and one that is rocked alike about an axis 0.32 m away; others are angles about Z0 [deg]
ROCKING, ROCKING_ASIDE = "rocking", "rocking aside"
CONTROLLERS = ("pd", "sg", "dg")
Way = Literal["increments", "joints"]  # how the motion is sent
INCREMENT = 1e-6  # [m] the robot counts its tip's position in micrometres [RAVEN-II source]
CONTROL_PERIOD = 1e-3  # [s]
SENSOR_SEED = 1
# Bosch BMA180 data sheet, from memory: 14 bit over 2 g, 150 ug/sqrt(Hz); latency of rosserial over USB is assumed
BMA180 = SensorModel(
    rate_hz=100.0,
    noise=150e-6 * STANDARD_GRAVITY,
    resolution=0.25e-3 * STANDARD_GRAVITY,
    latency=0.01,
    has_gyroscope=False,
)
# how gravity is known: by the last sample of the accelerometer, as the paper's; by this package's estimator from the
# same accelerometer, or from an inertial unit (MPU-6050, 200 Hz); by an ideal accelerometer at every tick
SENSORS = ("dg", "dg-filter", "dg-imu", "dg-ideal")
CALLED = {
    "pd": "PD",
    "sg": "PD+SG",
    "dg": "PD+DG",
    "dg-filter": "PD+DG, our estimator",
    "dg-imu": "PD+DG, inertial unit",
    "dg-ideal": "PD+DG, ideal sensor",
    "dg-attitude": "PD+DG, orientation sensor",
    "adaptive": "PD+adaptive, no sensor",
    "adaptive-dg": "PD+adaptive",
    "adaptive-attitude": "PD+adaptive, orientation sensor",
    "recursive": "PD+least squares, no sensor",
    "recursive-dg": "PD+least squares",
    "recursive-attitude": "PD+least squares, orientation sensor",
}
# how gravity is learnt on the way, from nothing: by the pseudo-inverse law, or by recursive least squares; with
# gravity's direction from the paper's accelerometer, or as of a level base
ADAPTIVE = ("adaptive", "adaptive-dg", "recursive", "recursive-dg")
# the same terms by an orientation sensor alone: the true attitude, which knows nothing of the base's accelerations
BY_ORIENTATION = ("dg-attitude", "adaptive-attitude", "recursive-attitude")
# the laws are for arms at rest; here they learn in motion too, as adaptive control does [rad/s, rad/s, m/s]
ANY_SPEED = 10.0
FRICTION = (0.5, 0.5, 2.0)  # [Nm, Nm, N] of torques in motion, noise to least squares: about what the joints' is


class Run(NamedTuple):
    """What one controller did along the motion."""

    controller: str
    damping: Damping
    rms_error: tuple[float, ...]  # (n,) [deg, deg, mm]
    pd_share: tuple[float, ...]  # (n,)
    rms_torque: tuple[float, ...]  # (n,) [Nm, Nm, N]
    tip_mm: tuple[float, ...]  # RMS of the tip's error along x, y, z, and of its distance, as reported
    true_tip_mm: float  # RMS distance between where the tip was wanted and where it truly was


class WorkspaceIncrements(SampledTrajectory):
    """A motion of the tip sent as increments, as a master sends it: the robot adds them up, and solves for its joints.

    Positions are counted in micrometres, joints stand for a millisecond, and no velocity comes with them.
    """

    def __init__(self, model: RobotModel, motion: CartesianSinusoids) -> None:
        """Add up the increments of a motion, and solve the inverse kinematics after each."""
        self.duration = motion.duration
        times = np.arange(round(motion.duration / CONTROL_PERIOD) + 1) * CONTROL_PERIOD
        counts = np.rint(np.diff(motion.tip_positions(times), axis=0) / INCREMENT)
        start = motion(0.0).q
        here = forward_kinematics(model, start)
        tips = here.position + np.vstack([np.zeros(3), np.cumsum(counts, axis=0)]) * INCREMENT
        rotations = np.broadcast_to(here.rotation, (len(times), 3, 3))
        self._q = raven_path(model, rotations, tips, start)

    def sample(self, times: ArrayLike) -> tuple[Floats, Floats, Floats]:
        """Return references at many times (N,) [s]: q, qd, qdd, each (N, n)."""
        t = as_array("times", times, (None,))
        q: Floats = self._q[np.clip((t / CONTROL_PERIOD + 1e-6).astype(int), 0, len(self._q) - 1)]
        return q, np.zeros_like(q), np.zeros_like(q)


class LastSample:
    """Gravity as the newest sample of an accelerometer says, however old it is: the paper's; a GravitySource."""

    def __init__(self, mailbox: Mailbox, feed: Callable[[float], None]) -> None:
        """Take samples from a mailbox that a sensor fills when it is fed the time."""
        self._mailbox, self._feed = mailbox, feed
        self._gravity, self._stamp = LEVEL, 0.0

    def read(self, time: float) -> GravityReading:
        """Return gravity at a time [s]; that of a level base before the first sample."""
        self._feed(time)
        while (sample := self._mailbox.take()) is not None:
            self._gravity, self._stamp = -np.array(sample.vector), sample.stamp
        return GravityReading(self._gravity, time - self._stamp, np.zeros((2, 3)), ReadingStatus.LIVE, Fault.NONE)


def gravity_source(name: str, plant: CablePlant) -> GravitySource:
    """Return what tells a controller of a name what gravity is: a sensor on the plant's base, or a level base."""
    if name in ("adaptive", "recursive"):
        return FixedGravity()
    if name in BY_ORIENTATION:
        return TrueAttitude(plant.base)
    if name == "dg-imu":
        model = SensorModel()
    elif name == "dg-ideal":
        model = ideal_sensor(1000.0, has_gyroscope=False)
    else:
        model = BMA180
    mailbox = Mailbox()
    sensor = SimulatedSensor(plant.base, mailbox, model, seed=SENSOR_SEED, start=plant.time)
    if name in ("dg-filter", "dg-imu"):
        angular = model.has_gyroscope
        return SensedGravity(mailbox, model.mounting, feed=sensor.advance, angular=angular)
    return LastSample(mailbox, sensor.advance)


def run_controllers(
    seed: int | None,
    base: MovingBase,
    controllers: Sequence[tuple[str, Damping]],
    *,
    cycles: int = CYCLES,
    axes: Sequence[str] = ("x", "y", "z"),
    arm: CableArm | None = None,
    way: Way = "joints",
) -> list[Run]:
    """Home a robot, drawn by `seed` from an arm where one is given, and let each controller follow the motion."""
    plant = CablePlant(arm or raven_of_2014(), seed=seed, base=base)
    plant.home()
    model = raven_arm(plant).model
    sinusoids = CartesianSinusoids(model, RAVEN_START, cycles=cycles, axes=axes)
    motion: Trajectory = WorkspaceIncrements(model, sinusoids) if way == "increments" else sinusoids
    return [_follow(deepcopy(plant), name, damping, motion) for name, damping in controllers]


def _follow(plant: CablePlant, name: str, damping: Damping, motion: Trajectory) -> Run:
    arm = raven_arm(plant)
    seen: list[tuple[Floats, Floats, Floats]] = []

    def observe(tick: Tick) -> None:
        seen.append((tick.reference.q, tick.state.q, arm.q_true()))

    controller = _controller(name, arm, damping)
    source = gravity_source(name, plant) if name in (*SENSORS, *ADAPTIVE, *BY_ORIENTATION) else None
    result = track(arm, controller, motion, gravity=source, observers=[observe])
    reference, reported, true = (forward_kinematics(arm.model, np.array(q))[1] for q in zip(*seen, strict=True))
    off = 1000.0 * (reference - reported)
    return Run(
        name,
        damping,
        tuple((result.rms_error * SHOWN).tolist()),
        tuple(result.pd_share.tolist()),
        tuple(result.rms_torque.tolist()),
        (*np.sqrt(np.mean(off**2, axis=0)).tolist(), float(np.sqrt(np.mean(np.sum(off**2, axis=1))))),
        float(1000.0 * np.sqrt(np.mean(np.sum((reference - true) ** 2, axis=1)))),
    )


def _controller(name: str, arm: SimulatedArm, damping: Damping) -> SplitController:
    if name.startswith(("adaptive", "recursive")):
        return _adaptive(name, arm, damping)
    return make_controller("dg" if name.startswith("dg") else name, arm, damping=damping)


def _adaptive(name: str, arm: SimulatedArm, damping: Damping) -> EstimatedGravityPD:
    kp, kd = arm.gains
    estimator: GravityLearner
    if name.startswith("recursive"):
        estimator = RecursiveGravityEstimator(arm.model, noise=FRICTION, max_speed=ANY_SPEED, settle=0.0)
    else:
        estimator = GravityEstimator(arm.model, kp, kd, max_speed=ANY_SPEED)
    return EstimatedGravityPD(kp, kd, estimator, damping=damping)


@run(revision=1)
def follow_sinusoids(
    seed: int | None,
    base: str,
    way: Way,
    controllers: Sequence[Sequence[str]],
    cycles: int = CYCLES,
    axes: Sequence[str] = ("x", "y", "z"),
) -> Result:
    """Follow the sinusoids on a base, an angle about Z0 in degrees or one that is rocked, with controllers and damping.

    Returns:
        For each "controller damping": RMS of the joint errors [deg, deg, mm], share of the PD term, torques, and the
        tip's errors [mm].
    """
    pairs: list[tuple[str, Damping]] = [(name, _damping(damping)) for name, damping in controllers]
    runs = run_controllers(seed, _base(base), pairs, cycles=cycles, axes=axes, way=way)
    return {f"{one.controller} {one.damping}": one._asdict() for one in runs}


def _base(name: str) -> MovingBase:
    if name in (ROCKING, ROCKING_ASIDE):
        return rocking_base() if name == ROCKING else rocking_base(lever=ASIDE)
    return turned_base(float(name))


def _damping(name: str) -> Damping:
    return "relative" if name == "relative" else "absolute"
