"""What a robot's messages do not say about its joints: which are in metres, and how far they go."""

from typing import NamedTuple

import numpy as np

from catenary.arrays import Floats, as_array
from catenary.errors import InputError
from catenary.plant import JOINT_UNITS
from catenary.recording.topics import JOINTS, Arm
from catenary.robots.catalog import load_robot
from catenary.robots.model import RobotModel


class RobotJoints(NamedTuple):
    """Joints of a robot, in the order of its messages."""

    names: tuple[str, ...]
    units: tuple[str, ...]  # rad or m
    lower: Floats  # (n,) [rad|m]
    upper: Floats  # (n,) [rad|m]


def raven_joints(arm: Arm = "gold") -> RobotJoints:
    """Return the seven joints of a RAVEN-II's arm; the tool's angle lies between the jaws, which have its limits."""
    model = load_robot("raven2_full" if arm == "gold" else "raven2_full_right")
    places = [model.joint_names.index("tool" if name.startswith("jaw") else name) for name in JOINTS]
    units = tuple(model.joint_units[place] for place in places)
    return RobotJoints(JOINTS, units, model.lower[places], model.upper[places])


def model_joints(model: RobotModel) -> RobotJoints:
    """Return the joints of a model, for a robot whose messages have the same names."""
    return checked_joints(RobotJoints(model.joint_names, model.joint_units, model.lower, model.upper))


def checked_joints(joints: RobotJoints) -> RobotJoints:
    """Refuse joints that no robot has; return them with arrays of their own."""
    names, units = tuple(joints.names), tuple(joints.units)
    n = len(names)
    if n == 0 or len(set(names)) < n or len(units) != n or any(unit not in JOINT_UNITS for unit in units):
        raise InputError(
            f"joints: expected different names, each in rad or m; "
            f"got {', '.join(names) or 'none'} in {', '.join(units)}"
        )
    lower, upper = (
        as_array(f"{which} limits", values, (n,), finite=False).copy()
        for which, values in (("lower", joints.lower), ("upper", joints.upper))
    )
    wrong = [names[j] for j in np.flatnonzero(~(lower < upper))]
    if wrong:
        raise InputError(f"joints: {', '.join(wrong)}: expected a lower limit below the upper one")
    return RobotJoints(names, units, lower, upper)
