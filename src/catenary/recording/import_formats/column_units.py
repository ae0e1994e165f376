"""Units of columns: stated, or inferred from names, message types, the robot and ranges; factors to SI.

A mapping that states no units and a proposal ask the same functions, so that they give the same answer.
"""

import math
from collections.abc import Sequence
from typing import TypeVar

import numpy as np

from catenary.arrays import Floats
from catenary.errors import InputError
from catenary.recording.import_formats.column_groups import Candidate, joints_meant
from catenary.recording.import_formats.columns import WORDS
from catenary.recording.import_formats.mapping import SI, Quantity, RecordingMapping
from catenary.robots.model import RobotModel
from catenary.verdict.units_and_scale import MAX_LIMIT_RATIO

Units = tuple[str, ...]
Value = TypeVar("Value")
# messages of ROS whose joints are in rad and m by definition [REP 103]
_TYPES_IN_SI = ("JointState", "JointTrajectoryControllerState")
_MAX_TURN_RAD = 7.0  # [rad]: more than a turn; joints of arms stay within
_MAX_SLIDE_M = 1.0  # [m]; what moves farther is in mm
_BEYOND_RANGE_SHARE = 0.25  # of a joint's range, by which a recording may leave its limits
_TURN_END_RAD = 0.05  # [rad] by which a range that is one whole turn may miss its ends
_SAME_RANGE_FACTOR = 1.25  # factor within which ranges are taken for the same
_SLIDING, _TURNING = (WORDS["words"][key].split() for key in ("sliding", "turning"))
_IN_WORDS = {"rad": ("rad", "deg"), "m": ("m", "mm")}


def nominal_units(one: Candidate, model: RobotModel | None, option: str | None) -> tuple[Units, str, bool]:
    """Return the units of q_nominal, how they were inferred, and whether they are certain."""
    n = len(one.columns)
    if option is not None:
        units = tuple(unit.strip() for unit in option.split(",") if unit.strip())
        return (units * n if len(units) == 1 else units), "as given", True
    if (stated := one.stated_units()) is not None:
        return stated, "by the names of the columns", True
    ends = [low == -high and high in (1.0, 100.0) for low, high in one.ranges]
    # LeRobot's `.pos` are such shares, unless somebody chose degrees: nothing in a dataset says which
    if all(joint.endswith(".pos") for joint in one.joints) or (n > 1 and 2 * sum(ends) > n):
        return ("rad",) * n, "its numbers look like shares of each joint's range, whose ends nobody states", False
    sizes = [max(abs(low), abs(high)) for low, high in one.ranges]
    large = [size > _MAX_TURN_RAD for size in sizes]
    is_ros = _is_in_si(one)
    if model is not None and n <= model.n:
        meant = joints_meant(one.joints if all(one.joints) else one.columns, model)
        places = [model.joint_names.index(joint) for joint in meant] if all(meant) else list(range(n))
        within = [_within_limits(model, j, *limits) for j, limits in zip(places, one.ranges, strict=True)]
        its = [model.joint_units[j] for j in places]
        each = zip(its, within, one.ranges, strict=True)
        fitting = {(base, unit) for base, unit, (low, high) in each if unit is not None and high > low}
        if mixed := len(fitting) > len({base for base, _ in fitting}):  # no arm has angles in both rad and deg
            within = list(its) if is_ros else within
        is_within = all(unit is not None for unit in within)
        units = tuple(
            fits or _IN_WORDS[unit][is_large if unit == "rad" else size > _MAX_SLIDE_M]
            for fits, unit, size, is_large in zip(within, its, sizes, large, strict=True)
        )
        by = "its limits" if is_within else "the range"
        is_sure = is_ros or (not mixed and (is_within or not any(large)))
        return units, f"by the robot {model.name} and {by}", is_sure
    names = map(str.lower, one.joints)
    slides = [any(word in n for word in _SLIDING) and not any(word in n for word in _TURNING) for n in names]
    large = [size > (_MAX_SLIDE_M if slide else _MAX_TURN_RAD) for size, slide in zip(sizes, slides, strict=True)]
    if not any(large):
        told_by = "ROS's JointState is in rad and m" if is_ros else "nothing says them: rad"
        by_name = "; which slide, by their names" if is_ros else ", unless a name sounds as if it slides"
        return tuple("m" if slide else "rad" for slide in slides), told_by + by_name, is_ros
    # a message that has angles in rad has none in deg: what moves farther than a turn then slides, in mm
    in_rad = any(not slide and not is_large for slide, is_large in zip(slides, large, strict=True))
    units = tuple(
        ("mm" if is_large else "m") if slide else ("mm" if in_rad else "deg") if is_large else "rad"
        for slide, is_large in zip(slides, large, strict=True)
    )
    moved = "mm, as others are in rad" if in_rad else "deg"
    by_name = "; which slide, by their names" * any(slides)
    why = f"by their range: more than a turn in rad is {moved}{by_name}"
    named = all(slide for slide, is_large in zip(slides, large, strict=True) if is_large)
    return units, why, is_ros and named


def _within_limits(model: RobotModel, joint: int, low: float, high: float) -> str | None:
    """Return the unit in which a joint's range lies within its limits, SI's first; None where SI is hardly beyond."""
    lower, upper = model.lower[joint], model.upper[joint]
    if not (math.isfinite(lower) and math.isfinite(upper)):
        return None
    if model.joint_units[joint] == "rad" and (
        max(abs(low + math.pi), abs(high - math.pi)) < _TURN_END_RAD
        or max(abs(low), abs(high - 2.0 * math.pi)) < _TURN_END_RAD
    ):
        return "rad"  # recorded within one turn, whatever the limits are
    margin = _BEYOND_RANGE_SHARE * (upper - lower)
    for unit in _IN_WORDS[model.joint_units[joint]]:
        scale = SI[unit][1]
        if scale < 1.0 and max(abs(low), abs(high)) < MAX_LIMIT_RATIO * max(abs(lower), abs(upper)):
            return None
        if lower - margin <= scale * low and scale * high <= upper + margin:
            return unit
    return None


def encoder_units(
    one: Candidate, nominal: Candidate, nominal_in: Sequence[str], option: str | None
) -> tuple[Units, str, bool]:
    """Return the units of q_encoder, how they were inferred, and whether they are certain."""
    if (stated := one.stated_units()) is not None:
        return stated, "by the names of the columns", True
    if option is not None:
        return tuple(nominal_in), "as given", True
    units, sure = [], True
    for own, other, unit in zip(one.ranges, nominal.ranges, nominal_in, strict=True):
        base, scale = SI.get(unit, ("", 1.0))
        ratio = (own[1] - own[0]) / ((other[1] - other[0]) * scale) if other[1] > other[0] else math.nan
        fits = [u for u in _IN_WORDS.get(base, ()) if 1 / _SAME_RANGE_FACTOR < ratio * SI[u][1] < _SAME_RANGE_FACTOR]
        sure &= len(fits) == 1
        loose = [u for u in _IN_WORDS.get(base, (unit,)) if u == unit or np.isclose(ratio * SI[u][1], 1.0, rtol=0.8)]
        units.append((fits or loose or [unit])[0])
    if not sure and _is_in_si(one):
        return tuple(SI[unit][0] for unit in nominal_in), "ROS's JointState is in rad and m", True
    return tuple(units), "by comparison with the range of q_nominal", sure


def _is_in_si(one: Candidate) -> bool:
    return one.stream.type.rpartition("/")[2] in _TYPES_IN_SI


def joint_units_of(
    mapping: RecordingMapping, one: Candidate, model: RobotModel | None, names: Sequence[str]
) -> tuple[Units, Units | None, bool, list[str]]:
    """Return joints' SI units, those of q_nominal's columns, whether any were assumed, and what to say of it."""
    n = len(names)
    mapped: tuple[str, ...] | None = mapping.joint_units or None
    if model is not None and mapped is None:
        mapped = tuple(model.joint_units[model.joint_names.index(joint)] for joint in names)
    stated, _ = factors("q_nominal", mapping.q_nominal, mapped, n)
    if stated is not None:
        return stated, mapping.q_nominal.units, False, []
    if mapping.joint_units and model is None:
        return mapped or (), None, False, []
    guess, why, is_sure = nominal_units(one, model, None)
    if is_sure:
        si = tuple(SI[unit][0] for unit in guess)
        if mapped is not None and si != mapped:
            raise InputError(
                f"q_nominal: its units are {', '.join(guess)}, {why}, but the joints' are {', '.join(mapped)}"
            )
        return si, guess, True, [f"q_nominal: its units were not stated; taken in {', '.join(guess)}: {why}"]
    for units in (units for units in mapping.assumed_units if len(units) == n):
        note = f"units not stated: took {','.join(units)} (order of RAVEN-II and da Vinci PSM)"
        return units, None, True, [note]
    raise InputError(
        f"{one.stream.name}: the units of its {n} joints are not stated, and not clear; give one of rad, deg, m, mm "
        f"for each of {', '.join(names)}, for example --units {','.join(guess)}, or the robot"
    )


def factors(
    name: str, quantity: Quantity, joint_units: Sequence[str] | None, n: int
) -> tuple[tuple[str, ...] | None, Floats]:
    """Return the joints' units that a quantity's stand for, or None, and factors to SI, (n,)."""
    units = _each(f"{name}: units", quantity.units, n)
    scale = np.array(_each(f"{name}: scale", quantity.scale, n) or (1.0,) * n)
    scale = scale * np.array(_each(f"{name}: sign", quantity.sign, n) or (1.0,) * n)
    if name == "tau" or units is None:
        return None, scale
    if "counts" in units and not quantity.scale:
        raise InputError(f"{name}: counts: give the scale, rad or m per count (@counts*SCALE, or scale = ...)")
    if "counts" in units and joint_units is None:
        raise InputError(f'{name}: counts of which unit? give joint_units = ["rad", ...], or the robot')
    words = tuple(
        joint_units[i] if unit == "counts" and joint_units is not None else SI[unit][0] for i, unit in enumerate(units)
    )
    if joint_units is not None and words != tuple(joint_units):
        raise InputError(
            f"{name}: units {', '.join(units)}, but the joints' are {', '.join(joint_units)}; expected deg or rad for "
            "joints that turn, mm or m for those that slide"
        )
    return words, scale * np.array([1.0 if unit == "counts" else SI[unit][1] for unit in units])


def _each(what: str, values: tuple[Value, ...], n: int) -> tuple[Value, ...] | None:
    if not values:
        return None
    if len(values) not in (1, n):
        raise InputError(f"{what}: {len(values)} for {n} columns, expected one, or one for each")
    return values * n if len(values) == 1 else values
