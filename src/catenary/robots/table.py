"""Robot files in TOML: a Denavit-Hartenberg table with units in its keys."""

from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from catenary.config import Settings, load_toml
from catenary.errors import ConfigError, InputError, UnsupportedModelError
from catenary.robots.actuation_table import ActuationTable, read_actuation
from catenary.robots.assembly import Coordinate
from catenary.robots.dh import DHRobot, DHRow, from_dh, own_coordinates
from catenary.robots.link_inertia import LinkInertia
from catenary.robots.model import Massless, RobotModel
from catenary.spatial import Pose

Vector = tuple[float, float, float]
Matrix = tuple[Vector, Vector, Vector]


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
    """What a link looks like: all points within a distance of a segment, in the axes of a frame."""

    frame: str  # a link, a named frame, or base
    from_m: Vector
    to_m: Vector
    radius_m: Annotated[float, Field(gt=0.0)]


class RobotTable(Settings):
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
    actuation: ActuationTable | None = None


def load_table(path: Path, *, massless: Massless = (), strict: bool = False) -> RobotModel:
    """Load a robot from a TOML table.

    Raises:
        ConfigError: A key is missing, unknown, of the wrong type or without its unit; the message names it.
        InputError: The numbers do not make a robot; the message names the file and the row.
        UnsupportedModelError: The rows form a loop, or none moves.
    """
    table = load_toml(path, RobotTable)
    try:
        return from_dh(_robot(path, table, massless, strict=strict))
    except (InputError, UnsupportedModelError) as error:
        raise type(error)(f"{path}: {error}") from error


def _robot(path: Path, table: RobotTable, massless: Massless, *, strict: bool) -> DHRobot:
    coordinates = None
    if table.coordinate is not None:
        coordinates = [_coordinate(path, c.name, c.unit, c) for c in table.coordinate]
    names = [f.name for f in table.frame] + ([table.base_frame] if table.base_frame else [])
    for name in names:
        if names.count(name) > 1:
            raise ConfigError(f'{path}: two frames are named "{name}"')
    rows = [_row(path, row) for row in table.link]
    actuation = None
    if table.actuation is not None:
        named = coordinates if coordinates is not None else own_coordinates(rows)
        actuation = read_actuation(path, table.actuation, [c.name for c in named])
    return DHRobot(
        name=table.name,
        convention=table.convention,
        rows=rows,
        base=Pose(np.array(table.base_rotation, dtype=float), np.array(table.base_position_m)),
        base_frame=table.base_frame,
        root=table.root,
        coordinates=coordinates,
        frames={
            f.name: (f.link, Pose(np.array(f.rotation, dtype=float), np.array(f.position_m)))
            for f in table.frame
        },
        tip=table.tip,
        massless=massless,
        strict=strict,
        closed_form=table.closed_form,
        actuation=actuation,
        sources=[*table.sources, *(f"{row.name}: {row.source}" for row in table.link if row.source)],
    )


def _row(path: Path, row: LinkTable) -> DHRow:
    limits = _coordinate(path, row.name, "m" if row.joint == "prismatic" else "rad", row)
    return DHRow(
        name=row.name,
        joint=row.joint,
        alpha=float(np.deg2rad(row.alpha_deg)),
        a=row.a_m,
        d=row.d_m,
        theta=float(np.deg2rad(row.theta_deg)),
        parent=row.parent,
        variable=row.variable,
        lower=limits.lower,
        upper=limits.upper,
        velocity=limits.velocity,
        effort=limits.effort,
        inertia=_inertia(path, row),
        massless=row.massless,
        axes_of_com=("x" in row.axes_of_com, "y" in row.axes_of_com, "z" in row.axes_of_com),
    )


def _inertia(path: Path, row: LinkTable) -> LinkInertia | None:
    if row.mass_kg is None:
        if row.com_m is not None or row.inertia_kg_m2 is not None:
            raise ConfigError(f'{path}: link "{row.name}": com_m or inertia_kg_m2 without mass_kg')
        return None
    if row.massless:
        raise ConfigError(f'{path}: link "{row.name}": is massless and has mass_kg; expected one of the two')
    if row.com_m is None:
        raise ConfigError(f'{path}: link "{row.name}": has mass_kg but no com_m; gravity needs both')
    if row.inertia_kg_m2 is None:
        return LinkInertia(row.mass_kg, np.array(row.com_m), None)
    xx, xy, xz, yy, yz, zz = row.inertia_kg_m2
    tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    return LinkInertia(row.mass_kg, np.array(row.com_m), tensor)


def _coordinate(path: Path, name: str, unit: str, limits: LimitsTable) -> Coordinate:
    suffix = "deg" if unit == "rad" else "m"
    for key in ("limits_deg", "limits_m", "velocity_deg_s", "velocity_m_s"):
        if getattr(limits, key) is not None and f"_{suffix}" not in key:
            wanted = key.replace("_deg", "_m") if suffix == "m" else key.replace("_m", "_deg", 1)
            raise ConfigError(f'{path}: "{name}" is in {unit}: expected {wanted} for its limits')
    strongest, other = ("effort_nm", "effort_n") if unit == "rad" else ("effort_n", "effort_nm")
    if getattr(limits, other) is not None:
        raise ConfigError(f'{path}: "{name}" is in {unit}: expected {strongest} for its limits')
    given_effort: float | None = getattr(limits, strongest)
    effort = np.inf if given_effort is None else given_effort
    to_si = np.pi / 180.0 if unit == "rad" else 1.0
    given: tuple[float, float] | None = getattr(limits, f"limits_{suffix}")
    velocity: float | None = getattr(limits, f"velocity_{suffix}_s")
    fastest = np.inf if velocity is None else velocity * to_si
    if given is None:
        return Coordinate(name, unit, velocity=fastest, effort=effort)
    lower, upper = (v * to_si for v in given)
    if not lower < upper:
        raise ConfigError(f'{path}: "{name}": limits {given}: expected the lower one first')
    return Coordinate(name, unit, lower, upper, fastest, effort)
