"""A RobotModel as plain data and back, so that a file made from a robot needs no other file to be used."""

from collections.abc import Mapping
from dataclasses import asdict
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from catenary.config import Recorded, parse_settings
from catenary.errors import FileFormatError, InputError
from catenary.robots.actuation import (
    Actuation,
    Friction,
    KnownTorque,
    LeverSpring,
    MotorInertia,
    SignalFilter,
    Spring,
    Weighting,
    check_actuation,
)
from catenary.robots.actuation_table import FilterTable
from catenary.robots.model import Frame, RobotModel, Tree
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
from catenary.spatial import Pose, as_rotation

NAMES = ("joint_names", "joint_units", "link_names", "missing_inertia", "missing_tensor", "massless", "sources",
         "notes", "doubts")  # fmt: skip
LIMITS = {"lower": -np.inf, "upper": np.inf, "velocity_limit": np.inf, "effort_limit": np.inf}  # where null
BOUNDS = {  # by array of the tree: most that a robot can have
    "rotation": (2.0, ""), "origin": (FARTHEST, "m"), "axis": (2.0, ""), "mass": (MOST_MASS, "kg"),
    "com": (FARTHEST, "m"), "inertia": (MOST_INERTIA, "kg m2"),
}  # fmt: skip
Vector = tuple[float, float, float]
Matrix = tuple[Vector, Vector, Vector]
Many = Field(max_length=MOST_LINKS)
Row = Annotated[tuple[float, ...], Many]
Texts = Annotated[tuple[str, ...], Many]
Limits = Annotated[tuple[float | None, ...], Many]


class TreeRecord(Recorded):
    """A robot's tree, a row a link."""

    parent: Annotated[tuple[int, ...], Many]
    prismatic: Annotated[tuple[bool, ...], Many]
    rotation: Annotated[tuple[Matrix, ...], Many]
    origin: Annotated[tuple[Vector, ...], Many]
    axis: Annotated[tuple[Vector, ...], Many]
    mass: Row
    com: Annotated[tuple[Vector, ...], Many]
    inertia: Annotated[tuple[Matrix, ...], Many]


class TermRecord(Recorded):
    """An effect on a combination of coordinates."""

    name: str
    combination: Row


class FrictionRecord(TermRecord):
    """Friction, as `Friction`."""

    coulomb: bool
    viscous: bool
    offset: bool
    asymmetric: bool = False
    stribeck: float | None = None
    load: bool = False
    presliding: float | None = None


class LeverRecord(Recorded):
    """A lever, as `LeverSpring`."""

    arm: float
    anchor: float
    rest: float
    angle: float


class SpringRecord(TermRecord):
    """A spring, as `Spring`."""

    lever: LeverRecord | None = None


class KnownTorqueRecord(TermRecord):
    """A known torque, as `KnownTorque`."""

    along: Row
    polynomial: Row


class ActuationRecord(Recorded):
    """What loads the joints beside the links, as `Actuation`."""

    friction: Annotated[tuple[FrictionRecord, ...], Many] = ()
    motor_inertia: Annotated[tuple[TermRecord, ...], Many] = ()
    springs: Annotated[tuple[SpringRecord, ...], Many] = ()
    known_torques: Annotated[tuple[KnownTorqueRecord, ...], Many] = ()
    filter: FilterTable
    weighting: Weighting
    coulomb_velocity: Annotated[float, Field(ge=0.0)]
    effort_scale: Row | None = None
    values: Annotated[tuple[float, ...], Field(max_length=10 * MOST_LINKS)] | None = None


class RobotRecord(Recorded):
    """A robot as plain data."""

    name: str
    tip: str
    closed_form: str | None
    joint_names: Texts
    joint_units: Annotated[tuple[Literal["rad", "m"], ...], Many]
    link_names: Texts
    missing_inertia: Texts
    missing_tensor: Texts = ()
    doubts: tuple[str, ...] = ()
    massless: Texts
    sources: tuple[str, ...]
    notes: tuple[str, ...]
    coupling: Annotated[tuple[Row, ...], Many]
    offset: Row
    lower: Limits
    upper: Limits
    velocity_limit: Limits
    effort_limit: Limits
    tree: TreeRecord
    frames: dict[str, tuple[int, Matrix, Vector]]
    actuation: ActuationRecord | None


def robot_record(model: RobotModel) -> dict[str, Any]:
    """Return a robot as plain data for JSON; infinite limits are null."""
    return {
        "name": model.name,
        "tip": model.tip,
        "closed_form": model.closed_form,
        **{key: list(getattr(model, key)) for key in NAMES},
        **{key: getattr(model, key).tolist() for key in ("coupling", "offset")},
        **{key: [float(v) if np.isfinite(v) else None for v in getattr(model, key)] for key in LIMITS},
        "tree": {key: array.tolist() for key, array in model.tree._asdict().items()},
        "frames": {
            name: [f.link, f.pose.rotation.tolist(), f.pose.position.tolist()]
            for name, f in model.frames.items()
        },
        "actuation": None if model.actuation is None else asdict(model.actuation, dict_factory=_plain),
    }


def robot_from_record(record: Any) -> RobotModel:
    """Return the robot of a record.

    Raises:
        FileFormatError: Something is missing or of another kind, arrays do not fit together, or the numbers are none
            that a robot can have.
    """
    content = parse_settings(record, RobotRecord, "the robot in it is damaged")
    try:
        return _robot(content)
    except InputError as error:
        raise FileFormatError(f"the robot in it is damaged: {error}") from error


def _robot(content: RobotRecord) -> RobotModel:
    links, n = len(content.link_names), len(content.joint_names)
    check_names("robot", [content.name])
    for kind in ("joint", "link"):
        names = getattr(content, f"{kind}_names")
        check_names(kind, names)
        check_different(kind, names)
    if not links or not n:
        raise InputError(f"{links} links and {n} joints, expected at least one of each")
    if not all(-1 <= parent < i for i, parent in enumerate(content.tree.parent)):
        raise InputError("the tree's parents do not come first")
    tree = Tree(**{key: _array(key, getattr(content.tree, key), links) for key in Tree._fields})
    for key, (most, unit) in BOUNDS.items():
        check_within(key, getattr(tree, key), most, unit)
    if (tree.mass < 0.0).any():
        raise InputError(f"mass {tree.mass.min()} kg, expected zero or more")
    for i in range(links):
        as_rotation(f"rotation of link {i}", tree.rotation[i])
    if not np.allclose(np.linalg.norm(tree.axis, axis=1), 1.0, atol=1e-6):
        raise InputError("axes of joints: expected unit vectors")
    coupling = _array("coupling", content.coupling, links)
    if coupling.shape != (links, n):
        raise InputError(f"coupling has shape {coupling.shape}, expected {(links, n)}")
    check_within("coupling", coupling, MOST_FACTOR, "")
    offset = _array("offset", content.offset, links)
    check_within("offset", offset, FARTHEST, "rad or m")
    limits = {
        key: _array(key, [none if v is None else v for v in getattr(content, key)], n)
        for key, none in LIMITS.items()
    }
    if len(content.joint_units) != n:
        raise InputError(f"joint units: expected {n}, got {len(content.joint_units)}")
    if (limits["lower"] > limits["upper"]).any():
        raise InputError("a joint's lower limit is above its upper one")
    if min(limits["velocity_limit"].min(), limits["effort_limit"].min()) < 0.0:
        raise InputError("a limit of velocity or effort is negative, expected zero or more")
    return RobotModel(
        name=content.name,
        tip=content.tip,
        closed_form=content.closed_form,
        **{key: getattr(content, key) for key in NAMES},
        tree=tree,
        coupling=coupling,
        offset=offset,
        **limits,
        frames=_frames(content, links),
        actuation=None if content.actuation is None else _actuation(content.actuation, n),
    )


def _frames(content: RobotRecord, links: int) -> Mapping[str, Frame]:
    frames = {}
    for name, (link, rotation, position) in content.frames.items():
        check_names("frame", [name])
        if not -1 <= link < links:
            raise InputError(f'frame "{name}" stands on link {link} of {links}')
        check_within(f'frame "{name}": position', position, FARTHEST, "m")
        frames[name] = Frame(
            link, Pose(as_rotation(f'frame "{name}"', np.array(rotation)), np.array(position))
        )
    if content.tip not in frames:
        raise InputError(f"tip {content.tip!r} is no frame")
    return frames


def _plain(items: list[tuple[str, Any]]) -> dict[str, Any]:
    """Return a data class's fields with arrays as lists."""
    return {key: value.tolist() if isinstance(value, np.ndarray) else value for key, value in items}


def _array(key: str, values: Any, count: int) -> Any:
    if len(values) != count:
        raise InputError(f"{key} has {len(values)} rows, expected {count}")
    lengths = {len(row) for row in values} if key == "coupling" else {0}
    if len(lengths) > 1:
        raise InputError(f"{key}: rows of different lengths")
    return np.array(values, dtype={"parent": np.int64, "prismatic": np.bool_}.get(key, np.float64))


def _actuation(content: ActuationRecord, n: int) -> Actuation:
    def terms(kind: str, made: type) -> Any:
        return tuple(made(**_term(entry)) for entry in getattr(content, kind))

    actuation = Actuation(
        friction=terms("friction", Friction),
        motor_inertia=terms("motor_inertia", MotorInertia),
        springs=terms("springs", Spring),
        known_torques=terms("known_torques", KnownTorque),
        filter=SignalFilter(**content.filter.model_dump()),
        weighting=content.weighting,
        coulomb_velocity=content.coulomb_velocity,
        effort_scale=None if content.effort_scale is None else np.array(content.effort_scale),
        values=None if content.values is None else np.array(content.values),
    )
    check_actuation("actuation", actuation, n)
    return actuation


def _term(entry: TermRecord) -> dict[str, Any]:
    """Return a term's fields: numbers as arrays, a lever as what it is."""
    values: dict[str, Any] = {
        key: np.array(value) if isinstance(value, tuple) else value for key, value in dict(entry).items()
    }
    if isinstance(values.get("lever"), LeverRecord):
        values["lever"] = LeverSpring(**values["lever"].model_dump())
    return values
