"""Units that numbers seem to be in: by the names of columns, the type of messages, the robot, and their range."""

import math
from collections.abc import Sequence

import numpy as np

from catenary.recording.import_formats.column_groups import Candidate
from catenary.recording.import_formats.joints import joints_meant
from catenary.recording.import_formats.mapping import SI
from catenary.robots.model import RobotModel

Units = tuple[str, ...]
_LARGEST_TURN = 7.0  # [rad]: more than a turn; joints of arms stay within
_LARGEST_SLIDE = 1.0  # [m]; what moves farther is in mm
_BEYOND = 0.25  # of a joint's range, by which a recording may leave its limits
_NEAR = 1.25  # factor within which ranges are taken for the same
_SLIDING = ("insertion", "prismatic", "slide", "slider", "lift", "linear", "rail", "gantry")
_IN_WORDS = {"rad": ("rad", "deg"), "m": ("m", "mm")}


def nominal_units(one: Candidate, model: RobotModel | None, given: str | None) -> tuple[Units, str, bool]:
    """Return the units of q_nominal, how they were told, and whether they are sure."""
    n = len(one.columns)
    if given is not None:
        units = tuple(unit.strip() for unit in given.split(",") if unit.strip())
        return (units * n if len(units) == 1 else units), "as given", True
    stated = one.stated_units()
    if stated is not None:
        return stated, "by the names of the columns", True
    sizes = [max(abs(low), abs(high)) for low, high in one.ranges]
    large = [size > _LARGEST_TURN for size in sizes]
    is_ros = one.stream.type.endswith("JointState")
    if model is not None and n <= model.n:
        meant = joints_meant(one.joints if all(one.joints) else one.columns, model)
        places = [model.joint_names.index(joint) for joint in meant] if all(meant) else list(range(n))
        within = [_within_limits(model, j, *limits) for j, limits in zip(places, one.ranges, strict=True)]
        its = [model.joint_units[j] for j in places]
        told = all(unit is not None for unit in within)
        units = tuple(
            found or _IN_WORDS[unit][is_large if unit == "rad" else size > _LARGEST_SLIDE]
            for found, unit, size, is_large in zip(within, its, sizes, large, strict=True)
        )
        by = "its limits" if told else "the range"
        return units, f"by the robot {model.name} and {by}", told or is_ros or not any(large)
    slides = [any(word in joint.lower() for word in _SLIDING) for joint in one.joints]
    large = [
        size > (_LARGEST_SLIDE if slide else _LARGEST_TURN) for size, slide in zip(sizes, slides, strict=True)
    ]
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
    why = f"by their range: more than a turn in rad is {moved}" + (
        "; which slide, by their names" if any(slides) else ""
    )
    named = all(slide for slide, is_large in zip(slides, large, strict=True) if is_large)
    return units, why, is_ros and named


def _within_limits(model: RobotModel, joint: int, low: float, high: float) -> str | None:
    """Return the unit in which a joint's range lies within its limits, SI's where both do; None where none does."""
    lower, upper = model.lower[joint], model.upper[joint]
    if not (math.isfinite(lower) and math.isfinite(upper)):
        return None
    margin = _BEYOND * (upper - lower)
    for unit in _IN_WORDS[model.joint_units[joint]]:
        scale = SI[unit][1]
        if lower - margin <= scale * low and scale * high <= upper + margin:
            return unit
    return None


def encoder_units(
    one: Candidate, nominal: Candidate, nominal_in: Sequence[str], given: str | None
) -> tuple[Units, str, bool]:
    """Return the units of q_encoder, how they were told, and whether they are sure."""
    stated = one.stated_units()
    if stated is not None:
        return stated, "by the names of the columns", True
    if given is not None:
        return tuple(nominal_in), "as given", True
    units, sure = [], True
    for own, other, unit in zip(one.ranges, nominal.ranges, nominal_in, strict=True):
        base, scale = SI.get(unit, ("", 1.0))
        ratio = (own[1] - own[0]) / ((other[1] - other[0]) * scale) if other[1] > other[0] else math.nan
        fits = [u for u in _IN_WORDS.get(base, ()) if 1 / _NEAR < ratio * SI[u][1] < _NEAR]
        sure &= len(fits) == 1
        loose = [
            u
            for u in _IN_WORDS.get(base, (unit,))
            if u == unit or np.isclose(ratio * SI[u][1], 1.0, rtol=0.8)
        ]
        units.append((fits or loose or [unit])[0])
    return tuple(units), "by their range beside q_nominal's", sure
