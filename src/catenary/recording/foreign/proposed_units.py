"""Units that numbers seem to be in: by the names of columns, the type of messages, the robot, and their range."""

import math
from collections.abc import Sequence

import numpy as np

from catenary.recording.foreign.candidates import Candidate
from catenary.recording.foreign.mapping import SI
from catenary.robots.model import RobotModel

Units = tuple[str, ...]
_LARGEST_TURN = 7.0  # [rad]: more than a turn; joints of arms stay within
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
        units = tuple(
            _IN_WORDS[unit][is_large if unit == "rad" else size > 1.0]
            for unit, size, is_large in zip(model.joint_units, sizes, large, strict=False)
        )
        return units, f"by the robot {model.name} and the range", is_ros or not any(large)
    slides = ["m" if any(word in joint.lower() for word in _SLIDING) else "rad" for joint in one.joints]
    if is_ros and not any(large):
        return tuple(slides), "ROS's JointState is in rad and m; which slide, by their names", True
    if any(large):
        return (
            tuple("deg" if one else "rad" for one in large),
            "by their range: more than a turn in rad",
            False,
        )
    return tuple(slides), "nothing says them: rad, unless a name sounds as if it slides", False


def encoder_units(one: Candidate, nominal: Candidate, nominal_in: Sequence[str]) -> tuple[Units, str, bool]:
    """Return the units of q_encoder, how they were told, and whether they are sure."""
    stated = one.stated_units()
    if stated is not None:
        return stated, "by the names of the columns", True
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
