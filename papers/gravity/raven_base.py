"""The gravity paper's bases, turned about Z0, joint 1's axis; units of joints; an ideal sensor; the true attitude.

Lewis and Hannaford 2014, sections IV-B and V: base angles "about the Z0 axis" of the mechanism's frame 0.
"""

import numpy as np

from catenary import FixedBase
from catenary.arrays import frozen
from catenary.sensing.gravity_vector import GravityReading, ReadingStatus
from catenary.sensing.imu_faults import Fault
from catenary.sensing.mounting import Mounting
from catenary.simulation.base_motion import MovingBase, RockingBase
from catenary.simulation.cable_parameters import RAVEN2_STIFF, CableArm, load_cable_arm
from catenary.simulation.sensors import SensorModel


def raven_of_2014() -> CableArm:
    """Return the robot of the gravity paper's experiments: joint 1's friction of 0.2 to 0.5 Nm in all."""
    return load_cable_arm(RAVEN2_STIFF)


SHOWN = frozen(np.array([180.0 / np.pi, 180.0 / np.pi, 1000.0]))  # rad, rad, m to deg, deg, mm
Z0 = frozen(np.array([0.0, -1.0, 0.0]))  # in base axes, whose z is up
ASIDE = (0.0, 0.1, 0.3)  # [m] the base's origin seen from an axis that it is rocked about: the base accelerates too


def turned_base(angle_deg: float) -> FixedBase:
    """Return a base at rest, turned about Z0 [deg]."""
    return FixedBase(0.0, float(-np.deg2rad(angle_deg)))


def rocking_base(lever: tuple[float, float, float] = (0.0, 0.0, 0.0), hz: float = 1.0) -> RockingBase:
    """Return the base of figure 10, rocked about Z0 between 10 and 20 deg; lever from the axis to its origin [m]."""
    x, y, z = Z0.tolist()
    return RockingBase(float(np.deg2rad(15.0)), float(np.deg2rad(5.0)), hz, (x, y, z), lever)


def ideal_sensor(rate_hz: float, mounting: Mounting | None = None, *, has_gyroscope: bool = True) -> SensorModel:
    """Return a sensor without noise, resolution, latency or end of range."""
    return SensorModel(rate_hz, 0.0, 0.0, 0.0, 0.0, 0.0, has_gyroscope, mounting or Mounting(checked=True))


class TrueAttitude:
    """Gravity along the true vertical, without the base's acceleration or turning; a GravitySource."""

    def __init__(self, base: MovingBase) -> None:
        """Take the base."""
        self._base = base

    def read(self, time: float) -> GravityReading:
        """Return gravity at a time [s]."""
        gravity = self._base.sample(np.array([time])).gravity[0]
        return GravityReading(gravity, 0.0, np.zeros((2, 3)), ReadingStatus.LIVE, Fault.NONE)
