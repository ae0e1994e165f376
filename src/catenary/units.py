"""Conversion of units of joints and torques: to SI where something is read, to degrees and millimetres where shown."""

import math
from typing import Any

# units of files and options: the SI unit, and how many of it one of them is
TO_SI = {
    "rad": ("rad", 1.0),
    "deg": ("rad", math.pi / 180.0),
    "m": ("m", 1.0),
    "mm": ("m", 1e-3),
    "cm": ("m", 1e-2),
    "mdeg": ("m", math.pi / 180.0),  # metres times 180/pi, as RAVEN-II's firmware writes every joint
}
# of inertial units
ACCELERATION_UNITS = {"m/s2": 1.0, "cm/s2": 0.01, "g": 9.80665, "mg": 0.00980665}  # [m/s2]
RATE_UNITS = {"rad/s": 1.0, "deg/s": math.pi / 180.0, "none": 0.0}  # [rad/s]
# what people read: the unit, and how many of it make one SI unit
DISPLAY = {"rad": ("deg", math.degrees(1.0)), "m": ("mm", 1000.0)}
TORQUE_UNIT = {"rad": "Nm", "m": "N"}


def from_display(shown: Any, unit: str) -> Any:
    """Return values shown in deg or mm in a joint's SI unit.

    Args:
        shown, unit: Number or array [deg or mm]; "rad" or "m".
    """
    return shown * TO_SI["deg"][1] if unit == "rad" else shown / 1000.0


def in_words(value: float, unit: str, digits: int) -> str:
    """Return a joint's value as text in deg or mm.

    Args:
        value, unit, digits: Value [rad or m]; "rad" or "m"; number of decimals.
    """
    shown, scale = DISPLAY[unit]
    return f"{scale * value:.{digits}f} {shown}"


def shown_rows(joints: Any, *columns: Any) -> list[tuple[Any, ...]]:
    """Return a row for each joint: its name, its unit as shown, and its numbers of columns (n,) [rad|m] in that."""
    shown = [DISPLAY[unit] for unit in joints.joint_units]
    values = ([scale * value for (_, scale), value in zip(shown, column, strict=True)] for column in columns)
    return list(zip(joints.joint_names, (unit for unit, _ in shown), *values, strict=True))
