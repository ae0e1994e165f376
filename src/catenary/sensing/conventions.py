"""Units and axes of inertial units as they come out of the box, and what turns their numbers into SI and base axes.

Here the axes are x forward, y left, z up [REP 103], and an accelerometer at rest on a level base reads (0, 0, +9.81).
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from catenary.arrays import Floats
from catenary.errors import InputError
from catenary.units import ACCELERATION_UNITS, RATE_UNITS

# which of a sensor's axes are forward, left and up
FRAMES = {
    "flu": "x,y,z",
    "frd": "x,-y,-z",  # forward, right, down: aircraft's
    "ned": "x,-y,-z",  # the same of a body whose axes are north, east, down when it points north
    "enu": "y,-x,z",  # x right, y forward, z up
    "optical": "z,-x,-y",  # a camera's: x right, y down, z forward
}


class Convention(NamedTuple):
    """What a sensor's numbers are multiplied by, units and axes at once."""

    force: Floats  # (3, 3) to m/s2
    rate: Floats  # (3, 3) to rad/s


class Driver(NamedTuple):
    """How a driver or a logger writes its readings."""

    units: tuple[str, str]
    axes: str  # of FRAMES
    columns: str = ""  # what it calls the accelerometer's x and the gyroscope's x in its files


# manuals and sources of these drivers; a driver that can be set otherwise as it comes
DRIVERS: dict[str, Driver] = {
    "xsens": Driver(("m/s2", "rad/s"), "flu", "Acc_X, Gyr_X"),  # MT Manager; as ROS's driver
    "microstrain": Driver(("g", "rad/s"), "frd", "scaledAccelX, scaledGyroX"),  # SensorConnect
    "vectornav": Driver(("m/s2", "rad/s"), "frd", "UncompAccelX, UncompGyroX"),  # Control Center
    "bno055": Driver(("m/s2", "deg/s"), "flu"),  # registers as they come from reset
    "mpu6050": Driver(("g", "deg/s"), "flu"),  # as most sketches print it
    "livox": Driver(("g", "rad/s"), "flu"),  # Mid-360, Avia; ROS's driver passes g on
    "realsense": Driver(("m/s2", "rad/s"), "optical"),  # D435i, camera_imu_optical_frame
    "zed": Driver(("m/s2", "deg/s"), "optical"),  # SDK, its COORDINATE_SYSTEM::IMAGE; ROS's wrapper gives rad/s, flu
    "x-io": Driver(("g", "deg/s"), "flu", "Accelerometer X (g), Gyroscope X (deg/s)"),  # x-IMU3, NGIMU
}


def axes_matrix(text: str) -> Floats:
    """Return the (3, 3) order of axes that a text says: a frame, or which of a sensor's axes give x, y, z: y,-x,z."""
    words = FRAMES.get(text.strip().lower(), text).lower().replace(" ", "").split(",")
    names = [word.lstrip("+-") for word in words]
    if len(words) != 3 or sorted(names) != ["x", "y", "z"]:
        raise InputError(f'axes "{text}": expected {", ".join(FRAMES)}, or x, y and z in some order, as y,-x,z')
    matrix = np.zeros((3, 3))
    for row, (word, name) in enumerate(zip(words, names, strict=True)):
        matrix[row, "xyz".index(name)] = -1.0 if word.startswith("-") else 1.0
    return matrix


def convention_of(units: Sequence[str] = (), axes: Sequence[str] = (), driver: str | None = None) -> Convention:
    """Return what readings are multiplied by.

    Units are of the accelerometer, then of the gyroscope; SI, or the driver's, where not said. Axes are of both, or of
    the accelerometer and of the gyroscope, each a frame or an order of axes.
    """
    usual = Driver(("m/s2", "rad/s"), "flu") if driver is None else DRIVERS.get(driver)
    if usual is None:
        raise InputError(f'driver "{driver}": expected one of {", ".join(DRIVERS)}')
    said = (*units, *usual.units[len(units) :])
    frames = tuple(axes) or (usual.axes,)
    known = [ACCELERATION_UNITS, {unit: value for unit, value in RATE_UNITS.items() if value > 0.0}]
    if len(said) > 2 or len(frames) > 2:
        raise InputError(f"expected two units and two frames at most, got {', '.join((*said, *frames))}")
    for unit, choices, what in zip(said, known, ("accelerometer", "gyroscope"), strict=True):
        if unit not in choices:
            raise InputError(f'unit "{unit}" of the {what}: expected one of {", ".join(choices)}')
    force, rate = axes_matrix(frames[0]), axes_matrix(frames[-1])
    if np.linalg.det(force) < 0.0:
        raise InputError(f'axes "{frames[0]}": left-handed: a rotation cannot bring them there; which sign is wrong?')
    return Convention(known[0][said[0]] * force, known[1][said[1]] * rate)
