"""Robot tables beside a description: what a URDF, MJCF or a dVRK's JSON lacks, or which arm of it is meant.

That is actuation above all, joints that one motor moves together, and what closes loops.
"""

from dataclasses import replace
from pathlib import Path
from typing import Annotated

from pydantic import Field, JsonValue

from catenary.bounded_parsers import MAX_TOML_BYTES, read_bounded, toml_table
from catenary.config import load_toml, parse_settings
from catenary.errors import ConfigError, FileFormatError, InputError, UnsupportedModelError
from catenary.robots.actuation import Actuation, check_actuation
from catenary.robots.assembly import file_source
from catenary.robots.dh_table import CoordinateTable, coordinate_of
from catenary.robots.loops import LoopSettings, close_loops, stated_places
from catenary.robots.model import RobotModel
from catenary.robots.submodels import couple_joints, cut_arm, lock_joints

XML_ENDINGS = (".urdf", ".xml", ".mjcf")  # of descriptions that may state shapes


class DrivenTable(CoordinateTable):
    """A coordinate that moves joints of a description."""

    moves: Annotated[dict[str, float], Field(min_length=1)]  # by the joint's name, how far per unit of the coordinate


class DescribedRobot(LoopSettings):
    """A robot whose links stand in another file."""

    description: str  # the file, beside the table
    instrument: str | None = None  # of a dVRK's arm, whose description is its kinematics
    name: str | None = None
    base: str | None = None  # with `tip`: the arm between these frames, on its own base
    tip: str | None = None
    locked_deg: dict[str, float] = Field(default_factory=dict)  # turning joints that are held
    locked_m: dict[str, float] = Field(default_factory=dict)  # sliding ones
    massless: tuple[str, ...] = ()
    coordinate: tuple[DrivenTable, ...] = ()  # before anything is locked
    # in place of what the description states, on the joints that are left
    actuation: dict[str, JsonValue] | None = None


def described_table(path: Path) -> DescribedRobot | None:
    """Return the table in a TOML file that names a description; None if the file is a DH table or no TOML."""
    content = read_bounded(path, MAX_TOML_BYTES)
    try:
        names_one = b"description" in content and "description" in toml_table(content, str(path))
    except FileFormatError:
        return None
    return load_toml(path, DescribedRobot) if names_one else None


def description_of(path: Path, named: str) -> Path:
    """Return the file that a table names as its description, or as the instrument's."""
    place = path.parent / named
    kinds = (*XML_ENDINGS, ".json")
    if place.suffix.lower() not in kinds or not place.is_file():
        raise ConfigError(f'{path}: description "{named}": expected a {", ".join(kinds)} file beside it')
    return place


def as_described(model: RobotModel, path: Path, table: DescribedRobot) -> RobotModel:
    """Return the robot of a description as its table has it."""
    try:
        model = table.on(model)
        if table.coordinate or table.base or table.locked_deg or table.locked_m or table.actuation:
            model = close_loops(model)
        if table.coordinate:
            coordinates = [coordinate_of(str(path), c.name, c.unit, c) for c in table.coordinate]
            model = couple_joints(model, coordinates, [c.moves for c in table.coordinate])
        locked = stated_places(model, table.locked_deg, table.locked_m, "locked")
        if table.base is not None:
            model = cut_arm(model, table.base, table.tip or model.tip, locked=locked)
        elif locked:
            model = lock_joints(model, locked)
        model.frame(table.tip)
        changes: dict[str, object] = {"tip": table.tip or model.tip, "name": table.name or model.name}
        if table.actuation is not None:
            where = f"{path}: actuation"
            actuation = parse_settings(table.actuation, Actuation, where, context=model.joint_names)
            check_actuation(where, actuation, model.n)
            changes["actuation"] = actuation
    except (InputError, UnsupportedModelError) as error:
        raise type(error)(f"{path}: {error}") from error
    sources = (*model.sources, file_source(path, read_bounded(path, MAX_TOML_BYTES)))
    return replace(model, sources=sources, **changes)  # type: ignore[arg-type]
