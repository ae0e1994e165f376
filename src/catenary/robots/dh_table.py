"""Robot files in TOML: Denavit-Hartenberg tables, with branches and coupled joints, and tables beside a description.

modified: T_parent_i = Rx(alpha) Tx(a) Rz(theta) Tz(d), alpha and a of the previous link (Craig).
standard: T_parent_i = Rz(theta) Tz(d) Tx(a) Rx(alpha) (Denavit and Hartenberg).
A joint's variable adds to theta (revolute) or d (prismatic): sum(variable[name] q[name]); a row without `variable`
moves with the coordinate of its own name. Inertia is given in the row's DH frame. Keys of numbers end in their units.

A table beside a description has what a URDF, MJCF or a dVRK's JSON lacks, or which arm of it is meant: actuation above
all, joints that one motor moves together, and what closes loops.
"""

from dataclasses import replace
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, JsonValue

from catenary.bounded_parsers import MAX_TOML_BYTES, read_bounded, toml_table
from catenary.config import Settings, load_toml, parse_settings
from catenary.errors import ConfigError, FileFormatError, InputError, UnsupportedModelError
from catenary.robots.actuation import Actuation, check_actuation
from catenary.robots.assembly import Coordinate, Link, assemble, depth_first, file_source
from catenary.robots.link_inertia import LinkInertia, symmetric
from catenary.robots.loops import LoopSettings, close_loops, stated_places
from catenary.robots.model import BASE, Massless, RobotModel
from catenary.robots.submodels import couple_joints, cut_arm, lock_joints
from catenary.spatial import Pose, identity_pose, rotation_about_x, rotation_about_z

Vector = tuple[float, float, float]
Matrix = tuple[Vector, Vector, Vector]


_LIMITS = (("limits_deg", "limits_m"), ("velocity_deg_s", "velocity_m_s"), ("effort_nm", "effort_n"))


class LimitsTable(Settings):
    """Limits of a coordinate, in the unit that its keys end in."""

    limits_deg: tuple[float, float] | None = None
    limits_m: tuple[float, float] | None = None
    velocity_deg_s: Annotated[float, Field(gt=0.0)] | None = None
    velocity_m_s: Annotated[float, Field(gt=0.0)] | None = None
    effort_nm: Annotated[float, Field(gt=0.0)] | None = None  # of a turning coordinate
    effort_n: Annotated[float, Field(gt=0.0)] | None = None  # of a sliding one


class LinkTable(LimitsTable):
    """One row: all four DH columns must stand there; nothing is silently zero."""

    name: str
    joint: Literal["revolute", "prismatic", "fixed"]
    alpha_deg: float
    a_m: float
    d_m: float
    theta_deg: float
    parent: str | None = None
    variable: dict[str, float] | None = None
    mass_kg: float | None = None
    com_m: Vector | None = None
    # xx xy xz yy yz zz, about the CoM; gravity does without
    inertia_kg_m2: tuple[float, float, float, float, float, float] | None = None
    massless: bool = False
    axes_of_com: tuple[Literal["x", "y", "z"], ...] = ("x", "y", "z")  # on which the CoM may lie
    source: str | None = None


class CoordinateTable(LimitsTable):
    """One of the robot's coordinates, where they are not simply the table's joints."""

    name: str
    unit: Literal["rad", "m"]


class FrameTable(Settings):
    """A named frame fixed to a link."""

    name: str
    link: str
    position_m: Vector
    rotation: Matrix = ((1, 0, 0), (0, 1, 0), (0, 0, 1))


class CapsuleTable(Settings):
    """Shape of a link: all points within a distance of a segment, in the axes of a frame."""

    frame: str  # a link, a named frame, or base
    from_m: Vector
    to_m: Vector
    radius_m: Annotated[float, Field(gt=0.0)]


class RobotTable(LoopSettings):
    """A robot file."""

    name: str
    convention: Literal["modified", "standard"]
    sources: list[str]
    base_rotation: Matrix = ((1, 0, 0), (0, 1, 0), (0, 0, 1))  # R_base_table, base z up
    base_position_m: Vector = (0.0, 0.0, 0.0)
    base_frame: str | None = None
    root: str = "base"  # what all hangs on; another name where the table's frame is "base"
    tip: str | None = None
    closed_form: Literal["raven2"] | None = None
    link: Annotated[list[LinkTable], Field(min_length=1)]
    coordinate: list[CoordinateTable] | None = None
    frame: tuple[FrameTable, ...] = ()
    capsule: tuple[CapsuleTable, ...] = ()
    capsules_from: str = "whose source it does not state"  # where the capsules' numbers come from
    actuation: dict[str, JsonValue] | None = None  # an `Actuation`, once the coordinates have names


def load_table(path: Path, *, massless: Massless = ()) -> RobotModel:
    """Load a robot from a TOML table."""
    table = load_toml(path, RobotTable)
    try:
        return robot_of_table(str(path), table, massless)
    except (InputError, UnsupportedModelError) as error:
        raise type(error)(f"{path}: {error}") from error


def robot_of_table(where: str, table: RobotTable, massless: Massless = ()) -> RobotModel:
    """Return the robot of a table; `where` opens what is said of its keys."""
    base = Pose(np.array(table.base_rotation, dtype=float), np.array(table.base_position_m))
    links: list[Link] = []
    for row in table.link:
        above = links[-1].name if links else BASE
        parent = above if row.parent is None else row.parent
        stands = base if parent == BASE else identity_pose()
        before, after = _constant_parts(row, table.convention)
        own = {} if row.joint == "fixed" else {row.name: 1.0}
        links.append(
            Link(
                name=row.name,
                parent=table.root if parent == BASE else parent,
                joint=row.joint,
                pose=stands @ before,
                frame=after,
                variable=own if row.variable is None else row.variable,
                inertia=_inertia(where, row),
                massless=row.massless,
                axes_of_com=("x" in row.axes_of_com, "y" in row.axes_of_com, "z" in row.axes_of_com),
            )
        )
    coordinates = _coordinates(where, table)
    as_listed = [c.name for c in coordinates]
    if table.coordinate is None:
        places = [link.name for link in depth_first(f'robot "{table.name}"', links, table.root)]
        coordinates.sort(key=lambda coordinate: places.index(coordinate.name))
    actuation = None
    if table.actuation is not None:
        names = [c.name for c in coordinates]
        actuation = parse_settings(table.actuation, Actuation, f"{where}: actuation", context=names)
    model = assemble(
        table.name,
        links,
        coordinates,
        frames=_frames(where, table, base),
        root=table.root,
        tip=links[-1].name if table.tip is None else table.tip,
        massless=massless,
        closed_form=table.closed_form,
        actuation=actuation,
        sources=[*table.sources, *(f"{row.name}: {row.source}" for row in table.link if row.source)],
        file_order=as_listed,
    )
    return table.on(model)


def _coordinates(where: str, table: RobotTable) -> list[Coordinate]:
    """Return a table's coordinates as it lists them, else those of rows that move with their own names."""
    listed = None
    if table.coordinate is not None:
        listed = [coordinate_of(where, c.name, c.unit, c) for c in table.coordinate]
    own = []
    for row in table.link:
        what = f'robot "{table.name}": DH row "{row.name}"'
        coordinate = coordinate_of(where, row.name, "m" if row.joint == "prismatic" else "rad", row)
        moves_itself = row.joint != "fixed" and (row.variable is None or row.name in row.variable)
        if coordinate != Coordinate(row.name, coordinate.unit) and (listed is not None or not moves_itself):
            raise InputError(f"{what}: has limits but no coordinate of its own; give limits to the coordinate")
        if moves_itself:
            own.append(coordinate)
    return own if listed is None else listed


def _frames(where: str, table: RobotTable, base: Pose) -> dict[str, tuple[str, Pose]]:
    names = [f.name for f in table.frame] + ([] if table.base_frame is None else [table.base_frame])
    for name in names:
        if names.count(name) > 1:
            raise ConfigError(f'{where}: two frames are named "{name}"')
    frames = {f.name: (f.link, Pose(np.array(f.rotation, dtype=float), np.array(f.position_m))) for f in table.frame}
    return frames | ({} if table.base_frame is None else {table.base_frame: (table.root, base)})


def _constant_parts(row: LinkTable, convention: str) -> tuple[Pose, Pose]:
    """Return the constant transforms before and after the joint; Rz(theta + q) and Tz(d + q) commute."""
    along_z = Pose(rotation_about_z(float(np.deg2rad(row.theta_deg))), np.array([0.0, 0.0, row.d_m]))
    along_x = Pose(rotation_about_x(float(np.deg2rad(row.alpha_deg))), np.array([row.a_m, 0.0, 0.0]))
    if convention == "modified":
        return along_x @ along_z, identity_pose()
    return along_z, along_x


def _inertia(where: str, row: LinkTable) -> LinkInertia | None:
    if row.mass_kg is None:
        if row.com_m is not None or row.inertia_kg_m2 is not None:
            raise ConfigError(f'{where}: link "{row.name}": com_m or inertia_kg_m2 without mass_kg')
        return None
    if row.massless:
        raise ConfigError(f'{where}: link "{row.name}": is massless and has mass_kg; expected one of the two')
    if row.com_m is None:
        raise ConfigError(f'{where}: link "{row.name}": has mass_kg but no com_m; gravity needs both')
    tensor = None if row.inertia_kg_m2 is None else symmetric(row.inertia_kg_m2)
    return LinkInertia(row.mass_kg, np.array(row.com_m), tensor)


def coordinate_of(where: str, name: str, unit: str, limits: LimitsTable) -> Coordinate:
    """Return a coordinate in "rad" or "m" with its table's limits; refuse limits in the other unit."""
    slides = unit == "m"
    for pair in _LIMITS:
        if getattr(limits, pair[not slides]) is not None:
            raise ConfigError(f'{where}: "{name}" is in {unit}: expected {pair[slides]} for its limits')
    bounds, velocity, effort = (getattr(limits, pair[slides]) for pair in _LIMITS)
    to_si = 1.0 if slides else np.pi / 180.0
    lower, upper = (-np.inf, np.inf) if bounds is None else (to_si * float(limit) for limit in bounds)
    fastest = np.inf if velocity is None else to_si * float(velocity)
    return Coordinate(name, unit, lower, upper, fastest, np.inf if effort is None else float(effort))


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
