"""What the holding torque of a RAVEN-II on a rocking base still lacks, for each way to know gravity.

    python -m catenary.reproduce.gravity_sensing

The base rocks between 10 and 20 degrees at 1 Hz, as in figure 10 of Lewis and Hannaford 2014. Joint positions are
ideal; the truth is inverse dynamics at rest on the moving base. A residual is the RMS over time, poses and joints of
what a source's vectors give minus the truth, over the RMS of the truth, each joint against its own.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from catenary.arrays import Floats
from catenary.dynamics.inverse_dynamics import BaseMotion, inverse_dynamics
from catenary.gravity.imu import SensedGravity
from catenary.gravity.mounting import Mounting
from catenary.gravity.samples import Mailbox
from catenary.gravity.sensor_checks import SensorRules
from catenary.gravity.vector import LEVEL
from catenary.robots.catalog import load_robot
from catenary.robots.model import RobotModel
from catenary.simulation.base_motion import RockingBase
from catenary.simulation.sensors import SensorModel, SimulatedSensor, ideal_sensor

# joint 1's axis, Z0, in the base frame: the paper tilts its base about it
AXIS = (0.0, -1.0, 0.0)
ROCKING = RockingBase(math.radians(15.0), math.radians(5.0), 1.0, AXIS, lever=(0.0, 0.1, 0.3))
POSITION = np.array([0.15, -0.05, 0.1])  # [m] of the sensor, from the base's origin
TURNED = Rotation.from_euler("xyz", [90.0, 0.0, 30.0], degrees=True).as_matrix()  # R_base_imu
POSES = ((0.52, 1.57, 0.40), (0.9, 1.2, 0.36), (1.2, 1.9, 0.45))  # [rad, rad, m]
SETTLE, DURATION, TICK = 0.5, 2.5, 0.001  # [s] two cycles, after half of one
EVERY = 7  # ticks of which one is looked at: no multiple of a sensor's period


class Residual(NamedTuple):
    """One way to know gravity, and what the holding torque lacks with it, over its RMS."""

    source: str
    joints: tuple[float, ...]
    whole: float  # of all joints, each over its own RMS


def residuals(base: RockingBase = ROCKING, *, seed: int = 0) -> list[Residual]:
    """Every row of the table."""
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

    rows = [
        row("level base", np.tile(LEVEL, (len(times), 1))),
        row("true attitude, no accelerations", truth_base.gravity),
    ]
    off_by_one = Rotation.from_rotvec(np.radians(1.0) * np.array([1.0, 1.0, 0.0]) / np.sqrt(2.0)).as_matrix()
    believed = Mounting(rotation=TURNED, position=POSITION)
    askew = Mounting(rotation=off_by_one @ TURNED, position=POSITION)
    real = SensorModel().mounting
    noisy = Mounting(TURNED, POSITION, acceleration_range=real.acceleration_range, rate_range=real.rate_range)
    sensors: list[tuple[str, SensorModel, Mounting, bool]] = [
        ("accelerometer at the origin, 100 Hz", ideal_sensor(100.0), Mounting(), False),
        ("accelerometer 0.19 m away, 100 Hz", ideal_sensor(100.0, believed), believed, False),
    ]
    for rate in (200.0, 100.0):
        sensors += [
            (f"IMU, {rate:g} Hz", ideal_sensor(rate, believed), believed, True),
            (f"IMU, {rate:g} Hz, noise", SensorModel(rate, mounting=noisy), believed, True),
            (f"IMU, {rate:g} Hz, mounted 1 deg askew", ideal_sensor(rate, askew), believed, True),
        ]
    for name, sensor, mounting, angular in sensors:
        rows.append(row(name, *_sensed(base, sensor, mounting, angular=angular, seed=seed)))
    return rows


def holding_torque(model: RobotModel, gravity: Floats, rates: Floats) -> Floats:
    """Torques (T, poses, n) of standing still in each pose, under gravity (T, 3) on a base that turns (T, 2, 3)."""
    q = np.array(POSES)
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


def main() -> None:
    """Print the table."""
    rows = residuals()
    width = max(len(r.source) for r in rows)
    print(f"{'residual of the holding torque [%]':<{width}}  {'all':>7}  {'J1':>7}  {'J2':>7}  {'J3':>7}")
    for r in rows:
        print(f"{r.source:<{width}}  " + "  ".join(f"{100.0 * v:7.3f}" for v in (r.whole, *r.joints)))


if __name__ == "__main__":
    main()
