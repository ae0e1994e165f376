"""Plausibility bounds on a robot's numbers, which no arm reaches and damaged files exceed."""

import re
from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import ArrayLike

from catenary.arrays import as_array
from catenary.bounded_parsers import cut, shortened
from catenary.errors import InputError

MAX_LINKS = 1_000
MAX_MASS_KG = 1e6  # [kg] of a link; a loaded harbour crane has as much
MAX_LENGTH_M = 1e3  # [m] of any length, and [rad] of any constant angle
MAX_INERTIA = MAX_MASS_KG * MAX_LENGTH_M**2  # [kg m2]
LONG_LINK_M = 10.0  # [m] from a joint to the next or to a centre of mass: no arm is so long, numbers in mm are
MAX_FACTOR = 1e6  # of a coordinate in a joint's: gear ratios in both directions
HEAVY_RATIO = 10.0  # times an arm's own mass
_EARTH_GRAVITY_M_S2 = (9.7, 9.9)  # [m/s2] on its surface 9.76 to 9.83 (WGS 84, with altitude)
_MAX_NAME_LENGTH = 500
_CONTROL = re.compile(r"[\x00-\x1f\x7f-\x9f\u2028\u2029\ud800-\udfff]")


def check_names(what: str, names: Iterable[str]) -> None:
    """Refuse names that are empty, too long, or hold control characters.

    Args:
        what: What is named, such as `robot "a": link`, which opens every message.
        names: The names.

    Raises:
        InputError: One of them is refused.
    """
    for name in names:
        if not 0 < len(name) <= _MAX_NAME_LENGTH or _CONTROL.search(name):
            raise InputError(
                f"{what} {shortened(name)}: expected a name of 1 to {_MAX_NAME_LENGTH} characters, none a "
                "control character"
            )


def check_different(what: str, names: Sequence[str]) -> None:
    """Refuse duplicate names.

    Args:
        what, names: The things named, which opens every message, and their names.

    Raises:
        InputError: A name occurs twice.
    """
    if len(set(names)) != len(names):
        raise InputError(f"{what} names must differ, got {cut(', '.join(names))}")


def check_within(what: str, values: ArrayLike, bound: float, unit: str) -> None:
    """Refuse numbers whose magnitude exceeds a bound, and NaN.

    Args:
        what: The quantity, which opens every message.
        values: Numbers of any shape.
        bound: Bound, in `unit`.
        unit: Unit, for the message.

    Raises:
        InputError: A number is beyond the bound.
    """
    magnitudes = np.abs(np.asarray(values, dtype=np.float64))
    if not (magnitudes <= bound).all():
        raise InputError(f"{what}: {magnitudes.max():g} {unit}, expected at most {bound:g} {unit}")


def check_length(what: str, vector: ArrayLike) -> None:
    """Refuse a vector (3,) [m] that is longer in any direction than a robot is."""
    check_within(what, as_array(what, vector, (3,)), MAX_LENGTH_M, "m")


def gravity_doubts(gravity: ArrayLike, *, hanging: bool = False) -> list[str]:
    """Return the reasons to doubt a gravity vector: its magnitude and its direction, as sentences.

    Args:
        gravity: Free-fall acceleration in base axes (3,) [m/s2].
        hanging: Whether the arm hangs upside down, so that gravity points along +z.
    """
    vector = as_array("gravity", gravity, (3,))
    length, shown = float(np.linalg.norm(vector)), ", ".join(f"{v:.4g}" for v in vector)
    doubts = []
    if not _EARTH_GRAVITY_M_S2[0] <= length <= _EARTH_GRAVITY_M_S2[1]:
        doubts.append(
            f"gravity ({shown}) has a magnitude of {length:.4g} m/s2, on Earth it is {_EARTH_GRAVITY_M_S2[0]} to "
            f"{_EARTH_GRAVITY_M_S2[1]}: right for another planet or a base that accelerates only"
        )
    if vector[2] > 0.0 and not hanging:
        doubts.append(
            f"gravity ({shown}) points up in base axes: right for a base that hangs only; gravity is the acceleration "
            "of free fall, down, where an accelerometer at rest reads its opposite"
        )
    return doubts
