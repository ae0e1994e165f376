"""Units of joints and their torques: SI inside, degrees and millimetres where people read."""

import math

# what people read: the unit, and how many of it make one SI unit
DISPLAY = {"rad": ("deg", math.degrees(1.0)), "m": ("mm", 1000.0)}
TORQUE_UNIT = {"rad": "Nm", "m": "N"}


def in_words(value: float, unit: str, digits: int) -> str:
    """Return a joint's value, in rad or m, as text in deg or mm."""
    shown, scale = DISPLAY[unit]
    return f"{scale * value:.{digits}f} {shown}"
