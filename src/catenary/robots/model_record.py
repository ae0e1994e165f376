"""A RobotModel as plain data and back, and out of the file of its identified parameters."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from catenary.archives import content_in_words, read_arrays
from catenary.bounded_parsers import cut, json_table, shortened
from catenary.cards import card_of
from catenary.config import parse_settings, plain_data
from catenary.errors import FileFormatError, InputError
from catenary.robots.actuation import check_actuation
from catenary.robots.model import Massless, RobotModel, Tree
from catenary.robots.plausibility import MAX_LINKS

FORMAT = "catenary.identification.3"
REMEDY = "`catenary identify` makes it again"
IDENTIFIED = "identified"  # array of the archive that holds the robot, as JSON
# of what was declared or carried, an identified robot knows nothing
_UNSAVED_FIELDS = ("axes_of_com", "without_payload", "loops")


def robot_record(model: RobotModel) -> dict[str, Any]:
    """Return a robot as plain data for JSON; infinite limits are null."""
    record = {key: value for key, value in plain_data(model).items() if key not in _UNSAVED_FIELDS}
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


def structure_of(arrays: Mapping[str, NDArray[Any]]) -> dict[str, Any]:
    """Return the record in an identification's archive; refuse another version's."""
    structure = json_table(str(arrays.get("structure")), "structure")
    if (version := structure.get("format")) != FORMAT:
        raise FileFormatError(f"format {shortened(version)}, expected {FORMAT!r}: another version wrote it; {REMEDY}")
    return structure


def load_identified(path: Path, *, massless: Massless = ()) -> RobotModel:
    """Load the robot that `catenary identify` found."""
    arrays = read_arrays(path)
    if IDENTIFIED not in arrays:
        if {"structure", "combination"} <= set(arrays):
            raise FileFormatError(f"{path}: holds parameters that make no robot; identify once more without --free")
        raise FileFormatError(f"{path}: holds no robot ({content_in_words(arrays)}); catenary identify writes one")
    try:
        structure_of(arrays)
        card_of(arrays, path, REMEDY)
        robot = robot_from_record(json_table(str(arrays[IDENTIFIED]), IDENTIFIED))
    except FileFormatError as error:
        raise FileFormatError(f"{path}: {cut(str(error).removeprefix(f'{path}: '))}") from error
    return robot.with_massless(massless) if massless else robot


def _check(model: RobotModel) -> None:
    """Refuse arrays that do not fit together: compiled code trusts their sizes and the tree's indices."""
    tree, links, n = model.tree, len(model.link_names), model.n
    if not 0 < links <= MAX_LINKS or not n:
        raise InputError(f"{links} links and {n} joints, expected at least one of each, and {MAX_LINKS} at most")
    counts = dict.fromkeys((*Tree._fields, "coupling", "offset"), links)
    counts |= dict.fromkeys(("joint_units", "lower", "upper", "velocity_limit", "effort_limit"), n)
    for key, count in counts.items():
        values = getattr(tree if key in Tree._fields else model, key)
        if len(values) != count:
            raise InputError(f"{key} has {len(values)} rows, expected {count}")
    if model.coupling.shape != (links, n):
        raise InputError(f"coupling has shape {model.coupling.shape}, expected {(links, n)}")
    if not all(-1 <= parent < i for i, parent in enumerate(tree.parent)):
        raise InputError("the tree's parents do not come first")
    for name, (link, _) in model.frames.items():
        if not -1 <= link < links:
            raise InputError(f'frame "{name}" stands on link {link} of {links}')
    if model.tip not in model.frames:
        raise InputError(f"tip {model.tip!r} is no frame")
    for entry in model.unseen:
        if len(entry.change) != links:
            raise InputError(f"unseen change has {len(entry.change)} rows, expected {links}")
    if model.actuation is not None:
        check_actuation("actuation", model.actuation, n)
