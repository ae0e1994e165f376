"""A robot with some joints locked, an arm cut out of a scene or humanoid, and robot tables beside a description.

Such a table states what a URDF, MJCF or a dVRK's JSON lacks, actuation above all, or which arm of it is meant.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import numpy as np
from pydantic import Field, JsonValue

from catenary.arrays import Floats, as_array
from catenary.config import Settings, load_toml, parse_settings
from catenary.documents import MOST_TOML, read_bounded, toml_table
from catenary.errors import ConfigError, FileFormatError, InputError
from catenary.robots.actuation import Actuation, Effect, KnownTorque, Spring, actuation_terms, check_actuation
from catenary.robots.assembly import Folded, JointKind, Link, file_source, fold, tree_of
from catenary.robots.link_inertia import LinkInertia
from catenary.robots.model import BASE, Frame, RobotModel
from catenary.spatial import Pose, identity_pose, rotation_from_vector

_ROOT = ""  # no link's name


def lock_joints(model: RobotModel, locked: Mapping[str, float]) -> RobotModel:
    """Return the robot with some coordinates held at values [rad or m]; links that no longer move are folded in.

    Its other coordinates, frames, masses and what loads its joints stay: torques are those of the whole robot at these
    values and rates of zero. Effects on locked coordinates alone are left out, friction and rotors on others too lose
    their locked part.

    Raises:
        InputError: An unknown coordinate, all of them, a value outside the limits or not finite, or as
            `held_actuation`.
    """
    where = f'robot "{model.name}": lock'
    for name, value in locked.items():
        if name not in model.joint_names:
            raise InputError(f'{where}: no joint "{name}"; joints: {", ".join(model.joint_names)}')
        k = model.joint_names.index(name)
        if not model.lower[k] <= float(as_array(f"{where}: {name}", value, ())) <= model.upper[k]:
            raise InputError(
                f'{where}: joint "{name}": {value:g} {model.joint_units[k]} outside '
                f"[{model.lower[k]:g}, {model.upper[k]:g}]"
            )
    free = [k for k, name in enumerate(model.joint_names) if name not in locked]
    held = np.array([locked.get(name, 0.0) for name in model.joint_names])
    coupling, offset = model.coupling[:, free], model.offset + model.coupling @ held
    moving = [i for i in range(len(offset)) if coupling[i].any()]
    if not moving:
        raise InputError(f"{where}: no joint is left that moves; expected at least one")
    folded = _folded(model, moving, offset)
    carriers, tree = [folded.carrier[name] for name in model.link_names], tree_of(folded)
    names = tuple(model.link_names[i] for i in moving)

    def whose(links: tuple[str, ...]) -> tuple[str, ...]:
        kept = {carriers[model.link_names.index(link)].link for link in links}
        return tuple(name for k, name in enumerate(names) if k in kept)

    frames = {
        name: frame if frame.link < 0 else Frame((on := carriers[frame.link]).link, on.pose @ frame.pose)
        for name, frame in model.frames.items()
    }
    per_joint = {key: getattr(model, key)[free] for key in ("lower", "upper", "velocity_limit", "effort_limit")}
    return replace(
        model,
        joint_names=tuple(model.joint_names[k] for k in free),
        joint_units=tuple(model.joint_units[k] for k in free),
        link_names=names,
        tree=tree,
        coupling=coupling[moving],
        offset=offset[moving],
        **per_joint,
        frames=frames,
        missing_inertia=whose(model.missing_inertia),
        missing_tensor=whose(model.missing_tensor),
        massless=tuple(
            name for name, mass in zip(names, tree.mass, strict=True) if mass == 0.0 and name in model.massless
        ),
        axes_of_com=np.array(folded.axes_of_com),
        closed_form=None,
        actuation=None if model.actuation is None else held_actuation(where, model.actuation, free, held),
        unseen=(),
        without_payload=None,
        file_order=tuple(name for name in model.file_order if name not in locked),
        notes=(*model.notes, *([f"locked: {', '.join(f'{n} at {v:g}' for n, v in locked.items())}"] if locked else [])),
    )


def cut_arm(model: RobotModel, base: str, tip: str, *, locked: Mapping[str, float] | None = None) -> RobotModel:
    """Return the arm between two frames of a larger robot, on its own base: the first frame, at rest.

    Coordinates that move nothing between the two are locked: at the values given, or at zero, or the limit that is
    nearest to it. What hangs on the arm stays as a load, what else the robot has is gone. Gravity is then given in the
    axes of `base`.

    Raises:
        InputError: An unknown frame, a tip that the base does not carry, or as `lock_joints`.
    """
    start, end = model.frame(base), model.frame(tip)
    path, link = list[int](), end.link
    while link not in (start.link, -1):
        path.append(link)
        link = int(model.tree.parent[link])
    if link != start.link or not path:
        raise InputError(f'robot "{model.name}": frame "{tip}" is not moved by joints on "{base}": no arm is between')
    kept = np.atleast_1d(model.coupling[path].any(axis=0))
    nearest = np.clip(0.0, model.lower, model.upper)
    rest = {name: float(nearest[k]) for k, name in enumerate(model.joint_names) if not kept[k]}
    arm = lock_joints(model, rest | dict(locked or {}))
    link, stands = arm.frame(base)
    if link >= 0:
        raise InputError(
            f'robot "{model.name}": frame "{base}" is moved by joints of its own arm: {", ".join(arm.joint_names)}'
        )
    back = Pose(stands.rotation.T, -stands.rotation.T @ stands.position)
    rotation, origin = arm.tree.rotation.copy(), arm.tree.origin.copy()
    for i in np.flatnonzero(arm.tree.parent < 0):
        rotation[i], origin[i] = back @ Pose(rotation[i], origin[i])
    moved = {name: frame._replace(pose=back @ frame.pose) for name, frame in arm.frames.items() if frame.link < 0}
    moved[base] = Frame(-1, identity_pose())
    if base != BASE and (BASE not in model.frames or model.base == BASE):
        moved[BASE] = Frame(-1, identity_pose())
    tree = arm.tree._replace(rotation=rotation, origin=origin)
    return replace(
        arm, tree=tree, frames={**arm.frames, **moved}, tip=tip, notes=(*arm.notes, f"cut out: {base} to {tip}")
    )


def _folded(model: RobotModel, moving: list[int], offset: Floats) -> Folded:
    """Return the links that move still, with those that are held folded in."""
    tree, links = model.tree, list[Link]()
    for i, name in enumerate(model.link_names):
        pose, kind = Pose(tree.rotation[i], tree.origin[i]), "prismatic" if tree.prismatic[i] else "revolute"
        if i not in moving:
            along = tree.axis[i] * offset[i]
            slid = kind == "prismatic"
            pose = pose @ (Pose(np.eye(3), along) if slid else Pose(rotation_from_vector(along), np.zeros(3)))
            kind = "fixed"
        parent = _ROOT if tree.parent[i] < 0 else model.link_names[tree.parent[i]]
        body = LinkInertia(float(tree.mass[i]), tree.com[i], tree.inertia[i]) if tree.mass[i] > 0.0 else None
        x, y, z = model.axes_of_com[i].tolist()
        links.append(Link(name, parent, cast(JointKind, kind), pose, tree.axis[i], inertia=body, axes_of_com=(x, y, z)))
    return fold(links, _ROOT)


def held_actuation(where: str, actuation: Actuation, free: Sequence[int], held: Floats) -> Actuation:
    """Return what acts on the coordinates that are free, the others held at `held` (n,), zero of the free ones.

    Lever springs and known torques that both move go on from where the held ones stand.
    """
    kept: dict[str, tuple[Effect, ...]] = {}
    for kind in ("friction", "motor_inertia", "springs", "known_torques"):
        effects = list[Effect]()
        for effect in getattr(actuation, kind):
            shift, change = float(effect.combination @ held), dict[str, Any](combination=effect.combination[free])
            if isinstance(effect, KnownTorque):
                of_rest = np.poly1d(effect.polynomial)(np.poly1d([1.0, shift]))
                change |= {"along": effect.along[free], "polynomial": np.atleast_1d(of_rest.coeffs)}
            if not change.get("along", change["combination"]).any():
                continue
            if isinstance(effect, Spring) and effect.lever is not None:
                angle = effect.lever.angle_deg + float(np.rad2deg(shift))
                change["lever"] = replace(effect.lever, angle_deg=angle)
            elif isinstance(effect, Spring) and shift != 0.0:
                raise InputError(f'{where}: spring "{effect.name}" acts on free joints as well')
            effects.append(replace(effect, **change))
        kept[kind] = tuple(effects)
    cut = replace(actuation, **kept, values=None)  # type: ignore[arg-type]
    scale = actuation.effort_scale
    values = None
    if actuation.values is not None:
        known = {(t.kind, t.name): v for t, v in zip(actuation_terms(actuation), actuation.values, strict=True)}
        values = np.array([known[term.kind, term.name] for term in actuation_terms(cut)])
    return replace(cut, values=values, effort_scale=None if scale is None else scale[free])


XML_ENDINGS = (".urdf", ".xml", ".mjcf")  # of descriptions that may state shapes


class DescribedRobot(Settings):
    """A robot whose links stand in another file."""

    description: str  # the file, beside the table
    instrument: str | None = None  # of a dVRK's arm, whose description is its kinematics
    name: str | None = None
    base: str | None = None  # with `tip`: the arm between these frames, on its own base
    tip: str | None = None
    locked_deg: dict[str, float] = Field(default_factory=dict)  # turning joints that are held
    locked_m: dict[str, float] = Field(default_factory=dict)  # sliding ones
    massless: tuple[str, ...] = ()
    # in place of what the description states, on the joints that are left
    actuation: dict[str, JsonValue] | None = None


def described_table(path: Path) -> DescribedRobot | None:
    """Return the table in a TOML file that names a description; None where the file is a DH table or no TOML."""
    content = read_bounded(path, MOST_TOML)
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
        locked = {name: float(np.deg2rad(angle)) for name, angle in table.locked_deg.items()} | table.locked_m
        for name in [*table.locked_deg, *table.locked_m]:
            if name in model.joint_names:
                unit = model.joint_units[model.joint_names.index(name)]
                if (unit == "rad") != (name in table.locked_deg):
                    raise InputError(
                        f'"{name}" is in {unit}: expected {"locked_deg" if unit == "rad" else "locked_m"} for it'
                    )
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
    except InputError as error:
        raise InputError(f"{path}: {error}") from error
    sources = (*model.sources, file_source(path, read_bounded(path, MOST_TOML)))
    return replace(model, sources=sources, **changes)  # type: ignore[arg-type]
