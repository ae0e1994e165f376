"""Robots from Denavit-Hartenberg tables, standard or modified, with branches and coupled joints."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from catenary.errors import InputError
from catenary.robots.actuation import Actuation
from catenary.robots.assembly import ANYWHERE, Coordinate, JointKind, Link, assemble
from catenary.robots.link_inertia import LinkInertia
from catenary.robots.model import BASE, Massless, RobotModel
from catenary.robots.plausible import FARTHEST, check_within
from catenary.spatial import Pose, identity_pose, rotation_about_x, rotation_about_z

Convention = Literal["modified", "standard"]


@dataclass(frozen=True)
class DHRow:
    """One row of the table; lengths in m, angles in rad.

    modified: T_parent_i = Rx(alpha) Tx(a) Rz(theta) Tz(d), alpha and a of the previous link (Craig).
    standard: T_parent_i = Rz(theta) Tz(d) Tx(a) Rx(alpha) (Denavit and Hartenberg).
    The joint's variable adds to theta (revolute) or d (prismatic): sum(variable[name] q[name]); a row
    without `variable` moves with the coordinate of its own name. Limits are those of the row's own
    coordinate. Inertia is given in the row's DH frame.
    """

    name: str
    joint: JointKind
    alpha: float
    a: float
    d: float
    theta: float
    parent: str | None = None  # the row above when None, the base for the first
    variable: Mapping[str, float] | None = None
    lower: float = -np.inf
    upper: float = np.inf
    velocity: float = np.inf
    effort: float = np.inf
    inertia: LinkInertia | None = None
    massless: bool = False
    axes_of_com: tuple[bool, bool, bool] = ANYWHERE  # axes of the DH frame on which the CoM may lie


@dataclass(frozen=True)
class DHRobot:
    """What a table says beyond its rows: base pose, frames, coordinates."""

    name: str
    convention: Convention
    rows: Sequence[DHRow]
    base: Pose = field(default_factory=identity_pose)  # of the table's base frame in the robot's base frame
    base_frame: str | None = None  # a name for the table's base frame
    root: str = BASE  # a name for the robot's base frame
    coordinates: Sequence[Coordinate] | None = None  # when None, one per row that moves with its own name
    frames: Mapping[str, tuple[str, Pose]] = field(default_factory=dict)
    tip: str | None = None
    massless: Massless = ()  # rows without inertia that are meant to have none; "all" such rows
    strict: bool = False  # refuse inertias that are missing or that no body has
    closed_form: str | None = None
    actuation: Actuation | None = None
    sources: Sequence[str] = ()


def from_dh(robot: DHRobot) -> RobotModel:
    """Build the model of a Denavit-Hartenberg table.

    Raises:
        InputError: No rows, unknown parent or coordinate, NaN, a number that is not physical, or limits on
            a row that has no coordinate of its own.
    """
    if robot.convention not in ("modified", "standard"):
        raise InputError(f'convention "{robot.convention}": expected "modified" or "standard"')
    if not robot.rows:
        raise InputError(f'robot "{robot.name}": the DH table has no rows')
    links: list[Link] = []
    frames = dict(robot.frames)
    above = BASE
    for row in robot.rows:
        _check_row(robot, row)
        parent = above if row.parent is None else row.parent
        base = robot.base if parent == BASE else identity_pose()
        before, after = _constant_parts(row, robot.convention)
        links.append(
            Link(
                name=row.name,
                parent=robot.root if parent == BASE else parent,
                joint=row.joint,
                pose=base @ before,
                frame=after,
                variable=_variable(row),
                inertia=row.inertia,
                massless=row.massless,
                axes_of_com=row.axes_of_com,
            )
        )
        above = row.name
    if robot.base_frame is not None:
        frames[robot.base_frame] = (robot.root, robot.base)
    return assemble(
        robot.name,
        links,
        robot.coordinates if robot.coordinates is not None else own_coordinates(robot.rows),
        frames=frames,
        root=robot.root,
        tip=robot.tip if robot.tip is not None else above,
        massless=robot.massless,
        closed_form=robot.closed_form,
        actuation=robot.actuation,
        sources=robot.sources,
        strict=robot.strict,
    )


def _constant_parts(row: DHRow, convention: Convention) -> tuple[Pose, Pose]:
    """Return what comes before and after the joint; Rz(theta + q) Tz(d + q) commute, so both orders do."""
    along_z = Pose(rotation_about_z(row.theta), np.array([0.0, 0.0, row.d]))
    along_x = Pose(rotation_about_x(row.alpha), np.array([row.a, 0.0, 0.0]))
    if convention == "modified":
        return along_x @ along_z, identity_pose()
    return along_z, along_x


def _variable(row: DHRow) -> Mapping[str, float]:
    if row.variable is not None:
        return row.variable
    return {} if row.joint == "fixed" else {row.name: 1.0}


def _has_own_coordinate(row: DHRow) -> bool:
    return row.joint != "fixed" and (row.variable is None or row.name in row.variable)


def own_coordinates(rows: Sequence[DHRow]) -> list[Coordinate]:
    """Return the coordinates of rows that move with their own names."""
    return [
        Coordinate(
            row.name,
            "m" if row.joint == "prismatic" else "rad",
            row.lower,
            row.upper,
            row.velocity,
            row.effort,
        )
        for row in rows
        if _has_own_coordinate(row)
    ]


def _check_row(robot: DHRobot, row: DHRow) -> None:
    what = f'robot "{robot.name}": DH row "{row.name}"'
    for column in ("alpha", "a", "d", "theta"):
        value = getattr(row, column)
        if not np.isfinite(value):
            raise InputError(f"{what}: {column} is {value}, expected a finite number")
        check_within(f"{what}: {column}", value, FARTHEST, "m" if column in ("a", "d") else "rad")
    limited = np.isfinite(row.lower) or np.isfinite(row.upper)
    if limited and (robot.coordinates is not None or not _has_own_coordinate(row)):
        raise InputError(f"{what}: has limits but no coordinate of its own; give limits to the coordinate")
