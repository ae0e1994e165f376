"""Gravity vector in the base frame: IMU samples and their mailbox, units and axes of drivers, readings, tilt.

Raw values of IMUs are converted to SI and base axes: x forward, y left, z up [REP 103]; an accelerometer at rest on a
level base reads (0, 0, +9.81).
"""

import logging
from collections import deque
from collections.abc import Sequence
from enum import Enum
from math import hypot
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from catenary.arrays import Floats, as_array, frozen
from catenary.errors import InputError
from catenary.plant import AT_REST
from catenary.robots.plausibility import gravity_doubts
from catenary.sensing.imu_faults import Fault
from catenary.spatial import LEVEL, STANDARD_GRAVITY
from catenary.units import ACCELERATION_UNITS, RATE_UNITS

# which of a sensor's axes are forward, left and up
_FRAMES = {
    "flu": "x,y,z",
    "frd": "x,-y,-z",  # forward, right, down: aircraft
    "ned": "x,-y,-z",  # the same: a body pointing north has axes north, east, down
    "enu": "y,-x,z",  # x right, y forward, z up
    "optical": "z,-x,-y",  # camera: x right, y down, z forward
}


class Convention(NamedTuple):
    """Matrices that convert a sensor's readings to SI and base axes."""

    force: Floats  # (3, 3) to m/s2
    rate: Floats  # (3, 3) to rad/s


class Driver(NamedTuple):
    """Units, axes and column names of a driver or a logger."""

    units: tuple[str, str]  # of accelerometer and gyroscope
    axes: str  # of _FRAMES
    columns: str = ""  # its names of the accelerometer's x and the gyroscope's x in files


# manuals and sources of these drivers, at their default settings
_DRIVERS: dict[str, Driver] = {
    "xsens": Driver(("m/s2", "rad/s"), "flu", "Acc_X, Gyr_X"),  # MT Manager; as ROS's driver
    "microstrain": Driver(("g", "rad/s"), "frd", "scaledAccelX, scaledGyroX"),  # SensorConnect
    "vectornav": Driver(("m/s2", "rad/s"), "frd", "UncompAccelX, UncompGyroX"),  # Control Center
    "bno055": Driver(("m/s2", "deg/s"), "flu"),  # registers after a reset
    "mpu6050": Driver(("g", "deg/s"), "flu"),  # as most sketches print it
    "livox": Driver(("g", "rad/s"), "flu"),  # Mid-360, Avia; ROS's driver passes g on
    "realsense": Driver(("m/s2", "rad/s"), "optical"),  # D435i, camera_imu_optical_frame
    "zed": Driver(("m/s2", "deg/s"), "optical"),  # SDK, its COORDINATE_SYSTEM::IMAGE; ROS's wrapper gives rad/s, flu
    "x-io": Driver(("g", "deg/s"), "flu", "Accelerometer X (g), Gyroscope X (deg/s)"),  # x-IMU3, NGIMU
}


def axes_matrix(text: str) -> Floats:
    """Parse a frame's name, or the sensor's axes that give x, y and z (`y,-x,z`), into a signed permutation (3, 3)."""
    words = _FRAMES.get(text.strip().lower(), text).lower().replace(" ", "").split(",")
    names = [word.lstrip("+-") for word in words]
    if len(words) != 3 or sorted(names) != ["x", "y", "z"]:
        raise InputError(f'axes "{text}": expected {", ".join(_FRAMES)}, or x, y and z in some order, as y,-x,z')
    matrix = np.zeros((3, 3))
    for row, (word, name) in enumerate(zip(words, names, strict=True)):
        matrix[row, "xyz".index(name)] = -1.0 if word.startswith("-") else 1.0
    return matrix


def convention_of(units: Sequence[str] = (), axes: Sequence[str] = (), driver: str | None = None) -> Convention:
    """Return the conversion of a sensor's readings to SI and base axes.

    Args:
        units: Of the accelerometer, then of the gyroscope; missing ones are the driver's, or SI without a driver.
        axes: One for both sensors, or one each; a frame or an order of axes as in `axes_matrix`.
        driver: Name of a known driver, which sets the defaults.
    """
    usual = Driver(("m/s2", "rad/s"), "flu") if driver is None else _DRIVERS.get(driver)
    if usual is None:
        raise InputError(f'driver "{driver}": expected one of {", ".join(_DRIVERS)}')
    all_units = (*units, *usual.units[len(units) :])
    frames = tuple(axes) or (usual.axes,)
    known = [ACCELERATION_UNITS, {unit: value for unit, value in RATE_UNITS.items() if value > 0.0}]
    if len(all_units) > 2 or len(frames) > 2:
        raise InputError(f"expected two units and two frames at most, got {', '.join((*all_units, *frames))}")
    for unit, choices, sensor in zip(all_units, known, ("accelerometer", "gyroscope"), strict=True):
        if unit not in choices:
            raise InputError(f'unit "{unit}" of the {sensor}: expected one of {", ".join(choices)}')
    force, rate = axes_matrix(frames[0]), axes_matrix(frames[-1])
    if np.linalg.det(force) < 0.0:
        raise InputError(f'axes "{frames[0]}": left-handed: no rotation gives base axes; which sign is wrong?')
    return Convention(known[0][all_units[0]] * force, known[1][all_units[1]] * rate)


MAILBOX_SIZE = 1024  # samples; 5 s of an accelerometer at 200 Hz
_log = logging.getLogger(__name__)


class Kind(Enum):
    """Physical quantity of a sample."""

    SPECIFIC_FORCE = "specific force"  # [m/s2] an accelerometer's reading: upwards at rest
    FREE_FALL = "free-fall acceleration"  # [m/s2] the opposite: gravity, downwards at rest
    ANGULAR_RATE = "angular rate"  # [rad/s]


class SensorSample(NamedTuple):
    """One reading, in the sensor's axes."""

    stamp: float  # [s] of the measurement, on the clock of JointState.time
    vector: tuple[float, float, float]
    kind: Kind


class Mailbox:
    """Queue of unchecked samples from any thread to the tick, without locks; if full, the oldest is dropped.

    Args:
        size: Capacity in samples.
        convention: Conversion of samples to SI and base axes; None if they are converted already.
    """

    def __init__(self, size: int = MAILBOX_SIZE, convention: Convention | None = None) -> None:
        # append, popleft and len of a deque are atomic
        self._samples: deque[SensorSample] = deque(maxlen=size)
        self._convention = convention
        self.dropped = 0

    def put(self, stamp: float, vector: Sequence[float] | Floats, kind: Kind) -> None:
        """Append a copy of a sample (3,), measured at `stamp` [s]."""
        if self._convention is not None:
            matrix = self._convention.rate if kind is Kind.ANGULAR_RATE else self._convention.force
            vector = matrix @ np.asarray(vector, dtype=float)
        x, y, z = vector
        if len(self._samples) == self._samples.maxlen:
            self.dropped += 1
        self._samples.append(SensorSample(float(stamp), (float(x), float(y), float(z)), kind))

    def take(self) -> SensorSample | None:
        """Remove and return the oldest sample; None if empty. Only one thread may call it."""
        return self._samples.popleft() if self._samples else None

    def __len__(self) -> int:
        return len(self._samples)


class ReadingStatus(Enum):
    """Trustworthiness of a gravity vector."""

    NOMINAL = "nominal"  # not measured: that of a level base, or a given one
    LIVE = "live"  # measured
    DEGRADED = "degraded"  # measured, with an error as large as the reading's deviation
    STALE = "stale"  # no new sample: the last one, held
    FALLBACK = "fallback"  # older than the age limit: the configured fallback
    STOP = "stop"  # older than the age limit, and configured to stop the robot


class GravityReading(NamedTuple):
    """Output of a source of gravity at one instant; the caller owns the arrays."""

    gravity: Floats  # (3,) [m/s2] in base axes: g - a, a the acceleration of the base's origin
    age: float  # [s] since the measurement; inf when it is nominal
    base_rates: Floats  # (2, 3) angular velocity and acceleration of the base, in its axes [rad/s, rad/s2]
    status: ReadingStatus
    faults: Fault
    deviation: float = np.inf  # [m/s2] standard deviation of gravity along each axis, without the sensor's bias

    @property
    def covariance(self) -> Floats:
        """Covariance of gravity (3, 3) [m2/s4]."""
        return self.deviation**2 * np.eye(3)


class FixedGravity:
    """A constant gravity vector of a fixed base; a GravitySource."""

    def __init__(self, gravity: ArrayLike = LEVEL) -> None:
        """Set gravity (3,) [m/s2] in base axes, pointing down; log a warning if it is not Earth's."""
        self.gravity = frozen(as_array("gravity", gravity, (3,)))
        for doubt in gravity_doubts(self.gravity):
            _log.warning("%s", doubt)

    def read(self, time: float) -> GravityReading:
        """Return the vector, with infinite age: it is not measured."""
        return GravityReading(self.gravity.copy(), np.inf, AT_REST, ReadingStatus.NOMINAL, Fault.NONE)


def tilted_gravity(roll: float, pitch: float) -> Floats:
    """Return gravity (3,) [m/s2] in the axes of a tilted base, R_world_base^T (0, 0, -g).

    Args:
        roll, pitch: Angle about x [rad], first, and about the rolled y axis [rad].
    """
    r, p = as_array("roll and pitch", [roll, pitch], (2,))
    return STANDARD_GRAVITY * np.array([np.cos(r) * np.sin(p), -np.sin(r), -np.cos(r) * np.cos(p)])


def tilt_of(gravity: ArrayLike) -> tuple[float, float]:
    """Return roll about x, within 90 degrees, then pitch about the base's y [rad], of gravity (3,) in base axes."""
    x, y, z = as_array("gravity", gravity, (3,))
    length = hypot(x, y, z)
    if length == 0.0:
        raise InputError("gravity: expected a vector that is not zero")
    return float(np.arcsin(np.clip(-y / length, -1.0, 1.0))), float(np.arctan2(x, -z))


def tilt_angle(gravity: ArrayLike) -> float:
    """Return the angle [rad] between gravity (3,) and that of a level base; NaN if it is zero."""
    x, y, z = as_array("gravity", gravity, (3,))
    return float(np.arctan2(np.hypot(x, y), -z)) if x or y or z else float("nan")
