"""From a list of links, as files describe them, to a RobotModel: fixed links folded in, depth first; mimic joints."""

import logging
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from hashlib import sha256
from pathlib import Path
from typing import Literal, NamedTuple, get_args

import numpy as np

from catenary.arrays import Flags, Floats, as_array
from catenary.errors import FileFormatError, InputError, UnsupportedModelError
from catenary.robots import plausibility
from catenary.robots.actuation import Actuation, check_actuation
from catenary.robots.link_inertia import MIN_DOUBTED_KG, NO_INERTIA, LinkInertia, check_inertia, is_negative, unphysical
from catenary.robots.model import BASE, Frame, Massless, RobotModel, Tree, is_base
from catenary.robots.quarter_turns import quarter_turn_notes
from catenary.spatial import Pose, as_rotation, identity_pose, unit_vector

JointKind = Literal["revolute", "prismatic", "fixed"]
_OFF_AXIS_M = 1e-12  # [m] more than rounding leaves of a coordinate that is zero
_SHOWN_DOUBTS = 3  # doubts that a warning names
_log = logging.getLogger(__name__)
_ANYWHERE_AXES = (True, True, True)  # a centre of mass of which nothing is known


@dataclass(frozen=True)
class Link:
    """One link and the joint that carries it.

    The joint sits at `pose` in the parent's frame and turns about or moves along `axis` by
    sum(variable[name] * q[name]) + offset; `variable` names the robot's coordinates. The link's own frame,
    in which its inertia is given and on which its children hang, is `frame` in the moved joint's frame.
    `axes_of_com` declares along which of its axes the centre of mass may lie: what is known of the link's make.
    """

    name: str
    parent: str
    joint: JointKind
    pose: Pose
    axis: Floats = field(default_factory=lambda: np.array([0.0, 0.0, 1.0]))
    variable: Mapping[str, float] = field(default_factory=dict)
    offset: float = 0.0
    frame: Pose = field(default_factory=identity_pose)
    inertia: LinkInertia | None = None
    massless: bool = False
    axes_of_com: tuple[bool, bool, bool] = _ANYWHERE_AXES  # axes of the link's frame on which its CoM may lie


@dataclass(frozen=True)
class Coordinate:
    """One of the robot's coordinates: unit "rad" or "m", limits in it."""

    name: str
    unit: str
    lower: float = -np.inf
    upper: float = np.inf
    velocity: float = np.inf
    effort: float = np.inf


def assemble(
    name: str,
    links: Sequence[Link],
    coordinates: Sequence[Coordinate],
    *,
    frames: Mapping[str, tuple[str, Pose]] | None = None,
    root: str = BASE,
    tip: str | None = None,
    massless: Massless = (),
    closed_form: str | None = None,
    actuation: Actuation | None = None,
    sources: Sequence[str] = (),
    notes: Sequence[str] = (),
    doubts: Sequence[str] = (),
    file_order: Sequence[str] = (),
) -> RobotModel:
    """Fold fixed links into those that carry them and order the rest depth first.

    Inertias that no body has are doubts, and logged; what needs them (mass matrix, inverse dynamics) is refused where a
    moving link as a whole has no possible one and more than a gram. Gravity never needs them.

    Args:
        links: In any order; a parent that is no link's name must be `root`.
        coordinates: In the order of q; those that move no link may be in `actuation`.
        frames: Further named frames: link they are fixed to, pose in it.
        root: What everything hangs on; it is called "base" too, unless a link or frame is.
        tip: Frame that kinematics mean by default; the last link of the longest chain otherwise.
        file_order: Names of the coordinates as the description lists them, where that may be another order.
    """
    plausibility.check_names("robot", [name])
    where = f'robot "{name}"'
    if len(links) > plausibility.MAX_LINKS:
        raise UnsupportedModelError(f"{where}: {len(links)} links, expected at most {plausibility.MAX_LINKS}")
    plausibility.check_names(f"{where}: link", [link.name for link in links])
    plausibility.check_names(f"{where}: frame", frames or {})
    ordered = depth_first(where, links, root)
    _check_coordinates(where, coordinates)
    for link in ordered:
        _check_link(where, link, [c.name for c in coordinates])
    if actuation is not None:
        check_actuation(where, actuation, len(coordinates))
    moved_by = {name for link in ordered if link.joint != "fixed" for name in link.variable}
    loaded = {c.name for i, c in enumerate(coordinates) if actuation is not None and actuation.moves(i)}
    idle = [c.name for c in coordinates if c.name not in moved_by | loaded]
    if idle and moved_by:  # a robot without any moving joint is refused as such
        raise InputError(f"{where}: coordinates {', '.join(idle)} move no joint")

    folded = fold(ordered, root)
    if not folded.moving:
        raise UnsupportedModelError(f"{where}: no moving joint, expected at least one")
    bodies = list(zip(folded.moving, folded.inertia, strict=True))
    without = [link for link, body in bodies if body.mass == 0.0]
    untold = [
        link.name
        for link, body in bodies
        if body.inertia is None or (body.mass > MIN_DOUBTED_KG and is_negative(body.mass, body.inertia))
    ]
    doubted = [*doubts, *_doubts(ordered, folded, untold)]
    if doubted:
        more = f"; and {len(doubted) - _SHOWN_DOUBTS} more" if len(doubted) > _SHOWN_DOUBTS else ""
        _log.warning("%s: %s%s", where, "; ".join(doubted[:_SHOWN_DOUBTS]), more)

    tree, offset = tree_of(folded), np.array([link.offset for link in folded.moving])
    moved = [[link.variable.get(c.name, 0.0) for c in coordinates] for link in folded.moving]
    all_frames = {BASE: folded.carrier[root]} | _all_frames(where, folded.carrier, frames or {})
    if not is_base(all_frames[BASE]):
        note = f'"{BASE}" is the description\'s own frame; "{root}" is the base frame, whose axes gravity is given in'
        _log.warning("%s: %s", where, note)
        notes = [*notes, note]
    if tip is None:
        depth = {root: 0}
        for link in ordered:
            depth[link.name] = depth[link.parent] + 1
        tip = max(ordered, key=lambda link: depth[link.name]).name
    if tip not in all_frames:
        raise InputError(f'{where}: tip "{tip}" is no frame; frames: {", ".join(all_frames)}')
    return RobotModel(
        name=name,
        joint_names=tuple(c.name for c in coordinates),
        joint_units=tuple(c.unit for c in coordinates),
        link_names=tuple(link.name for link in folded.moving),
        tree=tree,
        coupling=np.array(moved, dtype=float),
        offset=offset,
        lower=np.array([c.lower for c in coordinates]),
        upper=np.array([c.upper for c in coordinates]),
        velocity_limit=np.array([c.velocity for c in coordinates]),
        effort_limit=np.array([c.effort for c in coordinates]),
        frames=all_frames,
        tip=tip,
        missing_inertia=tuple(link.name for link in without if not link.massless),
        missing_tensor=tuple(untold),
        massless=tuple(link.name for link in without if link.massless),
        axes_of_com=np.array(folded.axes_of_com),
        closed_form=closed_form,
        actuation=actuation,
        sources=tuple(sources),
        notes=(*notes, *quarter_turn_notes(tuple(link.name for link in folded.moving), tree, offset)),
        doubts=tuple(doubted),
        file_order=tuple(file_order),
    ).with_massless(massless)


def _doubts(ordered: Sequence[Link], folded: "Folded", untold: Sequence[str]) -> list[str]:
    """Return in words which lengths no arm has, what inertias no body has, and what becomes of these."""
    doubts = []
    for link, pose, body in zip(folded.moving, folded.poses, folded.inertia, strict=True):
        for what, vector in (("its joint", pose.position), ("its centre of mass", body.com)):
            length = float(np.linalg.norm(vector))
            if length > plausibility.LONG_LINK_M:
                doubts.append(f'link "{link.name}": {what} lies {length:.4g} m away; lengths are in m')
    for link in ordered:
        if link.inertia is None or link.inertia.mass == 0.0:
            continue
        tensor = link.inertia.inertia
        fault = "has a mass but no inertia" if tensor is None else unphysical(link.inertia.mass, tensor)
        if fault is None:
            continue
        carrier = folded.carrier[link.name].link
        if carrier < 0:
            effect = "it is fixed to the base and plays no part"
        elif folded.moving[carrier].name in untold:
            effect = "gravity does not need it, masses and torques of motion are refused"
        else:
            effect = "taken as it is"
        doubts.append(f'link "{link.name}": {fault}: {effect}')
    return doubts


@dataclass
class Folded:
    """The moving links with all that is fixed to them, and which of them carries each link."""

    carrier: dict[str, Frame]
    moving: list[Link] = field(default_factory=list)
    parents: list[int] = field(default_factory=list)
    poses: list[Pose] = field(default_factory=list)
    inertia: list[LinkInertia] = field(default_factory=list)
    axes_of_com: list[Flags] = field(default_factory=list)


def fold(ordered: Sequence[Link], root: str) -> Folded:
    """Fold links that are fixed into those that carry them; parents come first."""
    folded = Folded({root: Frame(-1, identity_pose())})
    for link in ordered:
        index, pose = folded.carrier[link.parent]
        here = pose @ link.pose
        if link.joint == "fixed":
            here = here @ link.frame
            folded.carrier[link.name] = Frame(index, here)
            if index >= 0 and link.inertia is not None:
                body, more = folded.inertia[index], link.inertia.moved(here)
                folded.inertia[index] = more if body is NO_INERTIA else body.plus(more)
                folded.axes_of_com[index] |= _axes_seen_from(here, link.axes_of_com)
            continue
        folded.carrier[link.name] = Frame(len(folded.moving), link.frame)
        folded.moving.append(link)
        folded.parents.append(index)
        folded.poses.append(here)
        folded.inertia.append(NO_INERTIA if link.inertia is None else link.inertia.moved(link.frame))
        folded.axes_of_com.append(_axes_seen_from(link.frame, link.axes_of_com))
    return folded


def _axes_seen_from(pose: Pose, axes_of_com: Sequence[bool]) -> Flags:
    """Return on which axes of a parent frame a CoM may lie that lies on some of a frame at `pose`."""
    reached = np.abs(pose.rotation)[:, np.array(axes_of_com, dtype=bool)].sum(axis=1)
    return np.asarray(np.abs(pose.position) + reached > _OFF_AXIS_M)


def tree_of(folded: Folded) -> Tree:
    """Return the tree of the moving links."""
    return Tree(
        parent=np.array(folded.parents, dtype=np.int64),
        prismatic=np.array([link.joint == "prismatic" for link in folded.moving]),
        rotation=np.array([pose.rotation for pose in folded.poses]),
        origin=np.array([pose.position for pose in folded.poses]),
        axis=np.array([unit_vector("axis", link.axis) for link in folded.moving]),
        mass=np.array([body.mass for body in folded.inertia]),
        com=np.array([body.com for body in folded.inertia]),
        inertia=np.array([np.zeros((3, 3)) if b.inertia is None else b.inertia for b in folded.inertia]),
    )


def _all_frames(where: str, carrier: Mapping[str, Frame], further: Mapping[str, tuple[str, Pose]]) -> dict[str, Frame]:
    frames = dict(carrier)
    for name, (link, pose) in further.items():
        if link not in carrier:
            raise InputError(f'{where}: frame "{name}" is fixed to unknown link "{link}"; links: {", ".join(carrier)}')
        if name in frames:
            raise InputError(f'{where}: frame "{name}" has the name of another frame or link')
        as_rotation(f'{where}: frame "{name}": rotation', pose.rotation)
        plausibility.check_length(f'{where}: frame "{name}": position', pose.position)
        frames[name] = Frame(carrier[link].link, carrier[link].pose @ pose)
    return frames


def depth_first(where: str, links: Sequence[Link], root: str) -> list[Link]:
    """Order links from the root on, each with all that it carries before the next; siblings as given."""
    by_name: dict[str, Link] = {}
    carried: dict[str, list[Link]] = {}
    for link in links:
        if link.name == root:
            raise InputError(f'{where}: a link is named "{root}", which is the name of what everything hangs on')
        if link.name in by_name:
            raise InputError(f'{where}: two links are named "{link.name}"')
        by_name[link.name] = link
        carried.setdefault(link.parent, []).append(link)
    for link in links:
        if link.parent != root and link.parent not in by_name:
            raise InputError(
                f'{where}: link "{link.name}" hangs on unknown link "{link.parent}"; '
                f"links: {', '.join([root, *by_name])}"
            )
    ordered, waiting = list[Link](), carried.get(root, [])[::-1]
    while waiting:
        ordered.append(waiting.pop())
        waiting += reversed(carried.get(ordered[-1].name, []))
    if len(ordered) < len(links):
        looped = ", ".join(name for name in by_name if name not in {link.name for link in ordered})
        raise UnsupportedModelError(f"{where}: the parents of links {looped} form a loop")
    return ordered


def _check_coordinates(where: str, coordinates: Sequence[Coordinate]) -> None:
    plausibility.check_names(f"{where}: coordinate", [c.name for c in coordinates])
    plausibility.check_different(f"{where}: coordinate", [c.name for c in coordinates])
    for c in coordinates:
        what = f'{where}: coordinate "{c.name}"'
        if c.unit not in ("rad", "m"):
            raise InputError(f'{what}: unit "{c.unit}", expected "rad" or "m"')
        if not c.lower <= c.upper:  # also when one is NaN
            raise InputError(f"{what}: limits [{c.lower}, {c.upper}], expected the lower one first")
        if not (c.velocity >= 0.0 and c.effort >= 0.0):
            raise InputError(f"{what}: velocity limit {c.velocity}, effort limit {c.effort}: expected zero or more")


def _check_link(where: str, link: Link, coordinates: Sequence[str]) -> None:
    what = f'{where}: link "{link.name}"'
    if link.joint not in get_args(JointKind):
        raise InputError(f'{what}: joint "{link.joint}", expected {" or ".join(get_args(JointKind))}')
    for part, pose in (("joint", link.pose), ("link frame", link.frame)):
        as_rotation(f"{what}: {part}: rotation", pose.rotation)
        plausibility.check_length(f"{what}: {part}: origin", pose.position)
    plausibility.check_within(
        f"{what}: offset", as_array(f"{what}: offset", link.offset, ()), plausibility.MAX_LENGTH_M, "rad or m"
    )
    if link.joint == "fixed" and link.variable:
        raise InputError(f"{what}: is fixed and moves with {', '.join(link.variable)}; expected one of the two")
    if link.joint != "fixed" and not np.abs(as_array(f"{what}: axis", link.axis, (3,))).max() > 1e-9:
        raise InputError(f"{what}: axis must not be zero, got {link.axis}")
    for coordinate, factor in link.variable.items():
        if coordinate not in coordinates:
            raise InputError(
                f'{what}: moves with unknown coordinate "{coordinate}"; coordinates: {", ".join(coordinates) or "none"}'
            )
        if not np.isfinite(factor):
            raise InputError(f'{what}: factor of "{coordinate}" is {factor}, expected a finite number')
        plausibility.check_within(f'{what}: factor of "{coordinate}"', factor, plausibility.MAX_FACTOR, "")
    if link.inertia is not None:
        check_inertia(what, link.inertia)
        for axis, may, value in zip("xyz", link.axes_of_com, link.inertia.com, strict=True):
            if not may and abs(value) > _OFF_AXIS_M:
                raise InputError(
                    f"{what}: centre of mass has {axis} = {value:g} m, and its axes are declared to be "
                    f"{', '.join(a for a, m in zip('xyz', link.axes_of_com, strict=True) if m) or 'none'}"
                )


# what readers of descriptions share


def file_source(path: Path, content: bytes) -> str:
    """Return a line on which file a model comes from, which distinguishes a copy from another version."""
    return f"{path.name}, sha256 {sha256(content).hexdigest()}"


@contextmanager
def naming_the_file(where: str) -> Iterator[None]:
    """Prefix errors about a model's numbers with the file that holds them."""
    try:
        yield
    except InputError as error:
        raise FileFormatError(f"{where}: {error}") from error
    except UnsupportedModelError as error:
        raise UnsupportedModelError(f"{where}: {error}") from error


def left_out(what: str, where: Iterable[str]) -> list[str]:
    """Return one line on something that the model leaves out, or none when there is nothing."""
    names = list(where)
    return [f"left out: {what} ({', '.join(names)})"] if names else []


class Mimic(NamedTuple):
    """A joint's position is multiplier * (the leader's position) + offset; a constant without a leader."""

    leader: str | None
    multiplier: float
    offset: float  # [rad or m]


def resolve_mimics(mimics: Mapping[str, Mimic], joints: Iterable[str]) -> dict[str, Mimic]:
    """Express each joint, q = multiplier * q_leader + offset, by one that is free: no mimic, which leads itself."""
    resolved: dict[str, Mimic] = {}
    for joint in joints:
        chain, here = [joint], mimics.get(joint, Mimic(joint, 1.0, 0.0))
        while here.leader is not None and here.leader in mimics:
            if here.leader in chain:
                raise UnsupportedModelError(
                    f'joint "{joint}" follows itself: {" -> ".join([*chain, here.leader])}; '
                    "expected a chain of mimic joints that ends at one that is free"
                )
            chain.append(here.leader)
            then = mimics[here.leader]
            here = Mimic(then.leader, here.multiplier * then.multiplier, here.multiplier * then.offset + here.offset)
        resolved[joint] = here
    return resolved
