"""A RobotModel as plain data and back, and out of the file of its identified parameters."""

from pathlib import Path
from typing import Any

import numpy as np

from catenary.archives import content_in_words, read_arrays
from catenary.cards import card_of
from catenary.config import parse_settings, plain_data
from catenary.documents import cut, json_table
from catenary.errors import FileFormatError, InputError
from catenary.robots.actuation import check_actuation
from catenary.robots.model import Massless, RobotModel, Tree
from catenary.robots.plausible import (
    FARTHEST,
    MOST_FACTOR,
    MOST_INERTIA,
    MOST_LINKS,
    MOST_MASS,
    check_different,
    check_names,
    check_within,
)
from catenary.spatial import as_rotation

REMEDY = "`catenary identify` makes it again"
IDENTIFIED = "identified"  # array of the archive that holds the robot, as JSON
# of what was declared or carried, an identified robot knows nothing
UNSAVED = ("axes_of_com", "without_payload")
BOUNDS = {  # by array of the tree: most that a robot can have
    "rotation": (2.0, ""), "origin": (FARTHEST, "m"), "axis": (2.0, ""), "mass": (MOST_MASS, "kg"),
    "com": (FARTHEST, "m"), "inertia": (MOST_INERTIA, "kg m2"),
}  # fmt: skip


def robot_record(model: RobotModel) -> dict[str, Any]:
    """Return a robot as plain data for JSON; infinite limits are null."""
    record = {key: value for key, value in plain_data(model).items() if key not in UNSAVED}
    return record | {"tree": dict(zip(Tree._fields, record["tree"], strict=True))}


def robot_from_record(record: Any) -> RobotModel:
    """Return the robot of a record."""
    where = "the robot in it is damaged"
    model = parse_settings(record, RobotModel, where)
    try:
        _check(model)
    except InputError as error:
        raise FileFormatError(f"{where}: {error}") from error
    return model


def load_identified(path: Path, *, massless: Massless = ()) -> RobotModel:
    """Load the robot that `catenary identify` found."""
    arrays = read_arrays(path)
    if IDENTIFIED not in arrays:
        if {"structure", "combination"} <= set(arrays):
            raise FileFormatError(
                f"{path}: holds combinations of links' parameters, of which no robot follows (identify --free, or an "
                "earlier version): identify once more without --free"
            )
        raise FileFormatError(
            f"{path}: holds no robot ({content_in_words(arrays)}); catenary identify writes one beside its parameters"
        )
    try:
        card_of(arrays, path, REMEDY)
        robot = robot_from_record(json_table(str(arrays[IDENTIFIED]), IDENTIFIED))
    except FileFormatError as error:
        raise FileFormatError(f"{path}: {cut(str(error).removeprefix(f'{path}: '))}") from error
    return robot.with_massless(massless) if massless else robot


def _check(model: RobotModel) -> None:
    """Refuse arrays that do not fit together, and numbers that no robot has."""
    tree, links, n = model.tree, len(model.link_names), model.n
    check_names("robot", [model.name])
    for kind, names in (("joint", model.joint_names), ("link", model.link_names)):
        check_names(kind, names)
        check_different(kind, names)
    if not 0 < links <= MOST_LINKS or not n:
        raise InputError(f"{links} links and {n} joints, expected at least one of each, and {MOST_LINKS} at most")
    counts = {**dict.fromkeys((*Tree._fields, "coupling", "offset"), links)}
    counts |= dict.fromkeys(("joint_units", "lower", "upper", "velocity_limit", "effort_limit"), n)
    for key, count in counts.items():
        values = getattr(tree if key in Tree._fields else model, key)
        if len(values) != count:
            raise InputError(f"{key} has {len(values)} rows, expected {count}")
    if not all(-1 <= parent < i for i, parent in enumerate(tree.parent)):
        raise InputError("the tree's parents do not come first")
    for key, (most, unit) in BOUNDS.items():
        check_within(key, getattr(tree, key), most, unit)
    if (tree.mass < 0.0).any():
        raise InputError(f"mass {tree.mass.min()} kg, expected zero or more")
    for i in range(links):
        as_rotation(f"rotation of link {i}", tree.rotation[i])
    if not np.allclose(np.linalg.norm(tree.axis, axis=1), 1.0, atol=1e-6):
        raise InputError("axes of joints: expected unit vectors")
    if model.coupling.shape != (links, n):
        raise InputError(f"coupling has shape {model.coupling.shape}, expected {(links, n)}")
    check_within("coupling", model.coupling, MOST_FACTOR, "")
    check_within("offset", model.offset, FARTHEST, "rad or m")
    if not set(model.joint_units) <= {"rad", "m"}:
        raise InputError(f"joint_units: expected rad or m, got {', '.join(model.joint_units)}")
    if (model.lower > model.upper).any():
        raise InputError("a joint's lower limit is above its upper one")
    if min(model.velocity_limit.min(), model.effort_limit.min()) < 0.0:
        raise InputError("a limit of velocity or effort is negative, expected zero or more")
    for name, (link, pose) in model.frames.items():
        check_names("frame", [name])
        if not -1 <= link < links:
            raise InputError(f'frame "{name}" stands on link {link} of {links}')
        check_within(f'frame "{name}": position', pose.position, FARTHEST, "m")
        as_rotation(f'frame "{name}"', pose.rotation)
    if model.tip not in model.frames:
        raise InputError(f"tip {model.tip!r} is no frame")
    for each in model.unseen:
        if len(each.change) != links:
            raise InputError(f"unseen change has {len(each.change)} rows, expected {links}")
    if model.actuation is not None:
        check_actuation("actuation", model.actuation, n)
