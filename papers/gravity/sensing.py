"""What the holding torque of a RAVEN-II on a rocking base still lacks, for each way to know gravity.

    python -m papers.gravity.sensing

The base rocks between 10 and 20 degrees at 1 Hz, as in figure 10 of Lewis and Hannaford 2014. Joint positions are
ideal; the truth is inverse dynamics at rest on the moving base. A residual is the RMS over time, poses and joints of
what a source's vectors give minus the truth, over the RMS of the truth, each joint against its own.
"""

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from catenary import BaseMotion, RobotModel, inverse_dynamics, load_robot
from catenary.arrays import Floats
from catenary.reports.page import Table
from catenary.sensing.checks import SensorRules
from catenary.sensing.imu import SensedGravity
from catenary.sensing.mailbox import Mailbox
from catenary.sensing.mounting import Mounting
from catenary.simulation.base_motion import RockingBase
from catenary.simulation.sensors import SensorModel, SimulatedSensor, ideal_sensor
from catenary.spatial import LEVEL
from papers.arguments import make_parser, results_folder
from papers.gravity.raven_base import rocking_base
from papers.results import write_results

# joint 1's axis, Z0, in the base frame: the paper tilts its base about it
ROCKING = rocking_base(lever=(0.0, 0.1, 0.3))
POSITION = np.array([0.15, -0.05, 0.1])  # [m] of the sensor, from the base's origin
TURNED = Rotation.from_euler("xyz", [90.0, 0.0, 30.0], degrees=True).as_matrix()  # R_base_imu
POSES = ((0.52, 1.57, 0.40), (0.9, 1.2, 0.36), (1.2, 1.9, 0.45))  # [rad, rad, m]
ASKEW_DEG = (0.5, 1.0, 2.0)
# RMS errors of joint positions on a real robot [rad, rad, m]; joint-calibration paper, table I, J2-J3
JOINTS_OFF = {
    "as reported": (math.radians(2.103), math.radians(7.963), 0.011715),
    "calibrated (linear)": (math.radians(0.174), math.radians(0.186), 0.000166),
}
SETTLE, DURATION, TICK = 0.5, 2.5, 0.001  # [s] two cycles, after half of one
EVERY = 7  # ticks of which one is looked at: no multiple of a sensor's period


class Residual(NamedTuple):
    """One way to know gravity, and what the holding torque lacks with it, over its RMS."""

    source: str
    joints: tuple[float, ...]
    whole: float  # of all joints, each over its own RMS


def residuals(base: RockingBase = ROCKING, *, seed: int = 0) -> list[Residual]:
    """Return every row of the table; errors of joint positions have the signs that do most harm."""
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

    def mispositioned(name: str, off: Sequence[float], gravity: Floats, rates: Floats) -> Residual:
        signs = np.array(np.meshgrid(*[[-1.0, 1.0]] * 3)).reshape(3, -1).T
        of = []
        for sign in signs:
            lacking = holding_torque(model, gravity, rates, sign * np.array(off)) - truth
            joints = np.sqrt(np.mean(lacking**2, axis=(0, 1)) / np.mean(truth**2, axis=(0, 1)))
            of.append(Residual(name, tuple(float(v) for v in joints), float(np.sqrt(np.mean(joints**2)))))
        return max(of, key=lambda residual: residual.whole)

    rows = [
        row("level base", np.tile(LEVEL, (len(times), 1))),
        row("true attitude, no accelerations", truth_base.gravity),
    ]
    believed = Mounting(rotation=TURNED, position=POSITION)
    real = SensorModel().mounting
    noisy = Mounting(TURNED, POSITION, acceleration_range=real.acceleration_range, rate_range=real.rate_range)
    sensors: list[tuple[str, SensorModel, Mounting, bool]] = [
        ("accelerometer at the origin, 100 Hz", ideal_sensor(100.0), Mounting(), False),
        ("accelerometer 0.19 m away, 100 Hz", ideal_sensor(100.0, believed), believed, False),
    ]
    for rate, angles in ((200.0, ASKEW_DEG), (100.0, (1.0,))):
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
        if name == "IMU, 200 Hz":
            rows += [
                mispositioned(f"{name}, joints {kind}", off, *sensed) for kind, off in JOINTS_OFF.items()
            ]
    return rows


def _askew(deg: float) -> Mounting:
    """Return the mounting turned by an angle about a horizontal axis between x and y."""
    off = Rotation.from_rotvec(np.radians(deg) * np.array([1.0, 1.0, 0.0]) / np.sqrt(2.0)).as_matrix()
    return Mounting(rotation=off @ TURNED, position=POSITION)


def holding_torque(model: RobotModel, gravity: Floats, rates: Floats, off: ArrayLike = 0.0) -> Floats:
    """Return the torques (T, poses, n) that hold each pose, under gravity (T, 3) on a base that turns (T, 2, 3).

    Positions are taken for `off` (n,) more than they are [rad|m].
    """
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
    rules = SensorRules(stuck_samples=0)  # an ideal gyroscope reads the same about axes that do not turn
    source = SensedGravity(mailbox, mounting, angular=angular, rules=rules, feed=feed)
    for tick in range(round(SETTLE / TICK)):
        source.read(tick * TICK)
    readings = [source.read(tick * TICK) for tick in range(round(SETTLE / TICK), round(DURATION / TICK))][
        ::EVERY
    ]
    return np.array([r.gravity for r in readings]), np.array([r.base_rates for r in readings])


def main(folder: Path | None = None) -> None:
    """Print the table; write gravity_sensing.json and .html into a folder."""
    rows = residuals()
    width = max(len(r.source) for r in rows)
    print(f"{'residual of the holding torque [%]':<{width}}  {'all':>7}  {'J1':>7}  {'J2':>7}  {'J3':>7}")
    for r in rows:
        print(f"{r.source:<{width}}  " + "  ".join(f"{100.0 * v:7.3f}" for v in (r.whole, *r.joints)))
    if folder is None:
        return
    cells = [[r.source, *(f"{100.0 * v:.3f}" for v in (r.whole, *r.joints))] for r in rows]
    write_results(
        folder,
        "gravity_sensing",
        "What the holding torque on a rocking base still lacks, simulated",
        "Residual for each way to know gravity and joint positions, in per cent of the holding torque, RMS over RMS.",
        [Table(["source", "all [%]", "J1", "J2", "J3"], cells)],
        configuration={
            "robot": "raven2",
            "base": "10 to 20 deg about Z0 at 1 Hz, 0.32 m from the axis",
            "poses": list(POSES),
            "noise_seed": 0,
        },
        results=[r._asdict() for r in rows],
    )


if __name__ == "__main__":
    parser = make_parser(__doc__)
    parser.add_argument(
        "folder", nargs="?", type=results_folder, help="where the results go; else only printed"
    )
    main(parser.parse_args().folder)
