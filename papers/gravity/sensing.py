"""Gravity by sensor on a rocking base, by arithmetic.

What the holding torque of a RAVEN-II on a rocking base still lacks, for each way to know gravity.

The base rocks between 10 and 20 degrees at 1 Hz, as in figure 10 of Lewis and Hannaford 2014, 0.32 m from its axis.
Three poses. Joint positions are ideal unless said otherwise; errors of positions are those of the joint-calibration
paper's table I, with the signs that do most harm. The truth is inverse dynamics at rest on the moving base. A residual
is the RMS over time, poses and joints of what a source's vectors give minus the truth, over the RMS of the truth, each
joint against its own. That is torque by arithmetic; how well a robot follows with each sensor is seen in experiment
gravity-adaptive.
"""

import itertools
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from catenary import BaseMotion, RobotModel, inverse_dynamics, load_robot
from catenary.arrays import Floats
from catenary.sensing.gravity_vector import Mailbox
from catenary.sensing.imu import SensedGravity
from catenary.sensing.mounting import Mounting
from catenary.simulation.base_motion import RockingBase
from catenary.simulation.sensors import SensorModel, SimulatedSensor
from catenary.spatial import LEVEL
from papers.calibration.published import TABLE_1
from papers.experiment import Case, Experiment, Judgement, Outcomes, Report, Result, Scope, run
from papers.figures import panels
from papers.gravity.raven_base import ASIDE, SHOWN, ideal_sensor, rocking_base
from papers.kit import by_count, table

# joint 1's axis, Z0, in the base frame: the paper tilts its base about it
ROCKING = rocking_base(lever=ASIDE)
POSITION = np.array([0.15, -0.05, 0.1])  # [m] of the sensor, from the base's origin
TURNED = Rotation.from_euler("xyz", [90.0, 0.0, 30.0], degrees=True).as_matrix()  # R_base_imu
POSES = ((0.52, 1.57, 0.40), (0.9, 1.2, 0.36), (1.2, 1.9, 0.45))  # [rad, rad, m]
ASKEW_DEG = (0.5, 1.0, 2.0)
# RMS errors of joint positions on a real robot [rad, rad, m]; joint-calibration paper, table I, J2-J3
JOINTS_OFF = {
    source: np.array(TABLE_1["J2-J3"][method]) / SHOWN
    for source, method in (("as reported", "raw"), ("calibrated (linear)", "linear"))
}
SETTLE, DURATION, TICK = 0.5, 2.5, 0.001  # [s] two cycles, after half of one
LEVEL_BASE, ATTITUDE = "level base", "true attitude, no accelerations"
ACCELEROMETER, UNIT = "accelerometer at the origin, 100 Hz", "IMU, 200 Hz"
EVERY = 7  # ticks of which one is looked at: no multiple of a sensor's period


class Residual(NamedTuple):
    """One way to know gravity, and what the holding torque lacks with it, over its RMS."""

    source: str
    joints: tuple[float, ...]
    whole: float  # of all joints, each over its own RMS


def residuals(base: RockingBase = ROCKING, *, seed: int = 0, quick: bool = False) -> list[Residual]:
    """Return every row of the table; quick ones have no sensors of 100 Hz, and mountings askew by 1 deg alone."""
    model = load_robot("raven2")
    times = np.arange(SETTLE, DURATION, TICK)[::EVERY]
    truth_base = base.sample(times)
    zero = np.zeros((len(times), 2, 3))
    gamma = truth_base.gravity - truth_base.motion[:, 2]
    truth = holding_torque(model, gamma, truth_base.motion[:, :2])

    def row(name: str, gravity: Floats, rates: Floats = zero) -> Residual:
        off = holding_torque(model, gravity, rates) - truth
        joints = np.sqrt(np.mean(off**2, axis=(0, 1)) / np.mean(truth**2, axis=(0, 1)))
        return Residual(name, tuple(float(v) for v in joints), float(np.sqrt(np.mean(joints**2))))

    def mispositioned(name: str, off: Floats, gravity: Floats, rates: Floats) -> Residual:
        signs = np.array(np.meshgrid(*[[-1.0, 1.0]] * 3)).reshape(3, -1).T
        of = []
        for sign in signs:
            lacking = holding_torque(model, gravity, rates, sign * off) - truth
            joints = np.sqrt(np.mean(lacking**2, axis=(0, 1)) / np.mean(truth**2, axis=(0, 1)))
            of.append(Residual(name, tuple(float(v) for v in joints), float(np.sqrt(np.mean(joints**2)))))
        return max(of, key=lambda residual: residual.whole)

    rows = [row(LEVEL_BASE, np.tile(LEVEL, (len(times), 1))), row(ATTITUDE, truth_base.gravity)]
    believed = Mounting(rotation=TURNED, position=POSITION, checked=True)
    real = SensorModel().mounting
    noisy = replace(believed, acceleration_range=real.acceleration_range, rate_range=real.rate_range)
    sensors: list[tuple[str, SensorModel, Mounting, bool]] = [
        (ACCELEROMETER, ideal_sensor(100.0), Mounting(), False),
        ("accelerometer 0.19 m away, 100 Hz", ideal_sensor(100.0, believed), believed, False),
    ]
    for rate, angles in ((200.0, (1.0,)),) if quick else ((200.0, ASKEW_DEG), (100.0, (1.0,))):
        sensors += [
            (f"IMU, {rate:g} Hz", ideal_sensor(rate, believed), believed, True),
            (f"IMU, {rate:g} Hz, noise", SensorModel(rate, mounting=noisy), believed, True),
        ]
        sensors += [
            (f"IMU, {rate:g} Hz, mounted {deg:g} deg askew", ideal_sensor(rate, _askew(deg)), believed, True)
            for deg in angles
        ]
    for name, sensor, mounting, angular in sensors:
        sensed = _sensed(base, sensor, mounting, angular=angular, seed=seed)
        rows.append(row(name, *sensed))
        if name == UNIT:
            rows += [mispositioned(f"{name}, joints {kind}", off, *sensed) for kind, off in JOINTS_OFF.items()]
    return rows


def _askew(deg: float) -> Mounting:
    """Return the mounting turned by an angle about a horizontal axis between x and y."""
    off = Rotation.from_rotvec(np.radians(deg) * np.array([1.0, 1.0, 0.0]) / np.sqrt(2.0)).as_matrix()
    return Mounting(rotation=off @ TURNED, position=POSITION, checked=True)


def holding_torque(model: RobotModel, gravity: Floats, rates: Floats, off: ArrayLike = 0.0) -> Floats:
    """Return torques (T, poses, n) that hold poses, `off` [rad|m] away, under gravity (T, 3) and rates (T, 2, 3)."""
    q = np.array(POSES) + np.asarray(off)
    zero = np.zeros_like(q)
    torques = [
        inverse_dynamics(model, q, zero, zero, np.tile(g, (len(q), 1)), BaseMotion(omega, alpha))
        for g, (omega, alpha) in zip(gravity, rates, strict=True)
    ]
    return np.array(torques)


def _sensed(
    base: RockingBase, sensor: SensorModel, mounting: Mounting, *, angular: bool, seed: int
) -> tuple[Floats, Floats]:
    mailbox = Mailbox()
    feed: Callable[[float], None] = SimulatedSensor(base, mailbox, sensor, seed=seed).advance
    source = SensedGravity(
        mailbox, mounting, angular=angular, stuck_samples=0, feed=feed
    )  # an ideal one repeats itself
    for tick in range(round(SETTLE / TICK)):
        source.read(tick * TICK)
    readings = [source.read(tick * TICK) for tick in range(round(SETTLE / TICK), round(DURATION / TICK))][::EVERY]
    return np.array([r.gravity for r in readings]), np.array([r.base_rates for r in readings])


@run(revision=1)
def lacking_torque(noise_seed: int, quick: bool = False) -> Result:
    """Return what the holding torque lacks with every source, of all joints and of each, in percent."""
    rows = residuals(seed=noise_seed, quick=quick)
    return {row.source: [round(100.0 * value, 4) for value in (row.whole, *row.joints)] for row in rows}


def cases(scope: Scope) -> list[Case]:
    """Return the one case: the model is the nominal robot's."""
    quick = {"quick": True} if scope.quick else {}
    return [lacking_torque.case(noise_seed=0, **quick)]


def report(o: Outcomes) -> Report:
    """Return the table and its picture."""
    (result,) = o.of(lacking_torque)
    content = [[source, *(f"{value:.2f}" for value in values)] for source, values in result.items()]
    return Report(
        [table("What the holding torque lacks, RMS over its RMS", "gravity by | all [%] | J1 | J2 | J3", content)],
        {"What the holding torque on a rocking base lacks, all joints": _picture(result)},
    )


def _picture(result: Result) -> Any:
    figure, (axes,) = panels(1, 0.3 * len(result) + 0.9)
    axes.barh(list(result), [values[0] for values in result.values()], color="#d9622b")
    axes.set_xscale("log")
    axes.invert_yaxis()
    axes.tick_params(axis="y", labelsize=8)
    axes.set_xlabel("lacking, RMS over RMS [%]")
    return figure


def _falls(o: Outcomes, names: Sequence[str]) -> Judgement:
    """Judge whether every joint lacks less from one source to the next."""
    result, *_ = o.of(lacking_torque)
    text = "; ".join(f"J{joint} {' > '.join(f'{result[name][joint]:.1f}' for name in names)} %" for joint in (1, 2, 3))
    steps = list(itertools.pairwise(names))
    return by_count([result[a][joint] > result[b][joint] for joint in (1, 2, 3) for a, b in steps], text)


EXPERIMENT = Experiment(
    "gravity-sensing", "beside figure 10", "What the holding torque on a rocking base lacks, by sensor", __doc__,
    cases, report, minutes=0.3, drawn=0,
)  # fmt: skip


@EXPERIMENT.claim(
    "The holding torque on a moving base lacks less with an orientation sensor, and less again with an accelerometer",
    "beside II-C, of its reference [8]",
    "tracking greatly improved, further improved; no number",
    "each joint's holding torque lacks less with the true attitude than with level gravity, and less again with an "
    "accelerometer; same direction: more than half of the six comparisons",
)
def _orientation_then_accelerometer(o: Outcomes) -> Judgement:
    return _falls(o, (LEVEL_BASE, ATTITUDE, ACCELEROMETER))


@EXPERIMENT.claim(
    "In the holding torque changes in the magnitude of acceleration are compensated, beside those of gravity's "
    "direction",
    "beside VI",
    "tracking performance increased; no number",
    "each joint's holding torque lacks less with the accelerometer than with the true attitude; same direction: two of "
    "three joints",
)
def _magnitude(o: Outcomes) -> Judgement:
    return _falls(o, (ATTITUDE, ACCELEROMETER))
