"""From a list of links, as files describe them, to a RobotModel: fixed links folded in, parents first."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from catenary.arrays import Floats, as_array
from catenary.errors import InputError, UnsupportedModelError
from catenary.robots.model import BASE, Frame, RobotModel, Tree
from catenary.spatial import Pose, as_rotation, identity_pose

JointKind = Literal["revolute", "prismatic", "fixed"]


@dataclass(frozen=True)
class LinkInertia:
    """Mass [kg], centre of mass (3,) [m] and inertia about it (3, 3) [kg m2], in the link's frame."""

    mass: float
    com: Floats
    inertia: Floats

    def moved(self, pose: Pose) -> "LinkInertia":
        """Give the same body seen from the frame that `pose` is expressed in."""
        R = pose.rotation
        return LinkInertia(self.mass, R @ self.com + pose.position, R @ self.inertia @ R.T)

    def plus(self, other: "LinkInertia") -> "LinkInertia":
        """Give both bodies, in one frame, as one (parallel-axis theorem)."""
        mass = self.mass + other.mass
        if mass == 0.0:
            return LinkInertia(0.0, np.zeros(3), self.inertia + other.inertia)
        com = (self.mass * self.com + other.mass * other.com) / mass
        inertia = np.zeros((3, 3))
        for body in (self, other):
            r = body.com - com
            inertia = inertia + body.inertia + body.mass * (r @ r * np.eye(3) - np.outer(r, r))
        return LinkInertia(mass, com, inertia)


@dataclass(frozen=True)
class Link:
    """One link and the joint that carries it.

    The joint sits at `pose` in the parent's frame and turns about or moves along `axis` by
    sum(variable[name] * q[name]) + offset; `variable` names the robot's coordinates. The link's own frame,
    in which its inertia is given and on which its children hang, is `frame` in the moved joint's frame.
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
    tip: str | None = None,
    massless: Sequence[str] = (),
    closed_form: str | None = None,
    sources: Sequence[str] = (),
    notes: Sequence[str] = (),
) -> RobotModel:
    """Fold fixed links into those that carry them and order the rest parents first.

    Args:
        name: The robot's name.
        links: In any order; a parent that is no link's name must be "base".
        coordinates: In the order of q.
        frames: Further named frames: link they are fixed to, pose in it.
        tip: Frame that kinematics mean by default; the last link of the longest chain otherwise.
        massless: Links to treat as massless though the description gives them no inertia.
        closed_form: Name of the closed-form inverse kinematics that holds.
        sources: Where the numbers come from.
        notes: What the description holds and the model leaves out.

    Raises:
        InputError: Two links of one name, unknown parent or coordinate, bad mass, inertia or axis.
        UnsupportedModelError: A loop of parents, or no moving joint.
    """
    where = f'robot "{name}"'
    ordered = _parents_first(where, links)
    known = {link.name for link in ordered}
    for wanted in massless:
        if wanted not in known:
            raise InputError(f'{where}: massless link "{wanted}" is not a link; links: {", ".join(known)}')
    names = [c.name for c in coordinates]
    if len(set(names)) != len(names):
        raise InputError(f"{where}: coordinate names must differ, got {names}")

    carrier: dict[str, tuple[int, Pose]] = {BASE: (-1, identity_pose())}  # tree link that carries each link
    moving: list[Link] = []
    poses: list[Pose] = []
    parents: list[int] = []
    inertia: list[LinkInertia | None] = []
    declared: list[bool] = []
    for link in ordered:
        _check_link(where, link, names)
        index, pose = carrier[link.parent]
        here = pose @ link.pose
        if link.joint == "fixed":
            here = here @ link.frame
            carrier[link.name] = (index, here)
            if index >= 0 and link.inertia is not None:
                inertia[index] = _sum(inertia[index], link.inertia.moved(here))
            continue
        carrier[link.name] = (len(moving), link.frame)
        moving.append(link)
        poses.append(here)
        parents.append(index)
        inertia.append(None if link.inertia is None else link.inertia.moved(link.frame))
        declared.append(link.massless or link.name in massless)
    if not moving:
        raise UnsupportedModelError(f"{where}: no moving joint, expected at least one")

    has_mass = [body is not None and body.mass > 0.0 for body in inertia]
    body = [b if b is not None else LinkInertia(0.0, np.zeros(3), np.zeros((3, 3))) for b in inertia]
    tree = Tree(
        parent=np.array(parents, dtype=np.int64),
        prismatic=np.array([link.joint == "prismatic" for link in moving]),
        rotation=np.array([pose.rotation for pose in poses]),
        origin=np.array([pose.position for pose in poses]),
        axis=np.array([link.axis / np.linalg.norm(link.axis) for link in moving]),
        mass=np.array([b.mass for b in body]),
        com=np.array([b.com for b in body]),
        inertia=np.array([b.inertia for b in body]),
    )
    coupling = np.zeros((len(moving), len(names)))
    for row, link in enumerate(moving):
        for coordinate, factor in link.variable.items():
            coupling[row, names.index(coordinate)] = factor
    all_frames = {link: Frame(index, pose) for link, (index, pose) in carrier.items()}
    for frame, (link_name, pose) in (frames or {}).items():
        if link_name not in carrier:
            raise InputError(f'{where}: frame "{frame}" is fixed to unknown link "{link_name}"')
        if frame in all_frames:
            raise InputError(f'{where}: frame "{frame}" has the name of another frame or link')
        index, link_pose = carrier[link_name]
        all_frames[frame] = Frame(index, link_pose @ pose)
    tip = tip if tip is not None else _deepest(ordered)
    if tip not in all_frames:
        raise InputError(f'{where}: tip "{tip}" is no frame; frames: {", ".join(all_frames)}')
    return RobotModel(
        name=name,
        joint_names=tuple(names),
        joint_units=tuple(c.unit for c in coordinates),
        link_names=tuple(link.name for link in moving),
        tree=tree,
        coupling=coupling,
        offset=np.array([link.offset for link in moving]),
        lower=np.array([c.lower for c in coordinates]),
        upper=np.array([c.upper for c in coordinates]),
        velocity_limit=np.array([c.velocity for c in coordinates]),
        effort_limit=np.array([c.effort for c in coordinates]),
        frames=all_frames,
        tip=tip,
        missing_inertia=tuple(
            link.name
            for link, mass, none in zip(moving, has_mass, declared, strict=True)
            if not mass and not none
        ),
        massless=tuple(
            link.name
            for link, mass, none in zip(moving, has_mass, declared, strict=True)
            if none and not mass
        ),
        closed_form=closed_form,
        sources=tuple(sources),
        notes=tuple(notes),
    )


def _sum(a: LinkInertia | None, b: LinkInertia) -> LinkInertia:
    return b if a is None else a.plus(b)


def _parents_first(where: str, links: Sequence[Link]) -> list[Link]:
    """Order links so that each comes after its parent, otherwise as given."""
    by_name: dict[str, Link] = {}
    for link in links:
        if link.name in by_name or link.name == BASE:
            raise InputError(f'{where}: two links are named "{link.name}"')
        by_name[link.name] = link
    for link in links:
        if link.parent != BASE and link.parent not in by_name:
            raise InputError(
                f'{where}: link "{link.name}" hangs on unknown link "{link.parent}"; '
                f"links: {', '.join([BASE, *by_name])}"
            )
    ordered: list[Link] = []
    placed = {BASE}
    waiting = list(links)
    while waiting:
        ready = [link for link in waiting if link.parent in placed]
        if not ready:
            loop = ", ".join(link.name for link in waiting)
            raise UnsupportedModelError(f"{where}: the parents of links {loop} form a loop")
        # take one at a time where the given order already works, so that q keeps the file's order
        link = ready[0]
        ordered.append(link)
        placed.add(link.name)
        waiting.remove(link)
    return ordered


def _check_link(where: str, link: Link, coordinates: Sequence[str]) -> None:
    what = f'{where}: link "{link.name}"'
    as_rotation(f"{what}: rotation", link.pose.rotation)
    as_array(f"{what}: origin", link.pose.position, (3,))
    if link.joint != "fixed":
        if not np.linalg.norm(as_array(f"{what}: axis", link.axis, (3,))) > 1e-9:
            raise InputError(f"{what}: axis must not be zero, got {link.axis}")
        for coordinate, factor in link.variable.items():
            if coordinate not in coordinates:
                raise InputError(
                    f'{what}: moves with unknown coordinate "{coordinate}"; coordinates: {", ".join(coordinates)}'
                )
            if not np.isfinite(factor):
                raise InputError(f'{what}: factor of "{coordinate}" is {factor}, expected a finite number')
    if link.inertia is None:
        return
    body = link.inertia
    if not np.isfinite(body.mass) or body.mass < 0.0:
        raise InputError(f"{what}: mass {body.mass} kg, expected a finite number, zero or more")
    as_array(f"{what}: centre of mass", body.com, (3,))
    tensor = as_array(f"{what}: inertia", body.inertia, (3, 3))
    if not np.allclose(tensor, tensor.T, atol=1e-9 * max(1.0, float(np.abs(tensor).max()))):
        raise InputError(f"{what}: inertia must be symmetric, got {tensor.tolist()}")
    smallest = float(np.linalg.eigvalsh(tensor)[0])
    if smallest < -1e-9 * max(1.0, float(np.abs(tensor).max())):
        raise InputError(f"{what}: inertia has a negative principal moment ({smallest:.3g} kg m2)")


def _deepest(ordered: Sequence[Link]) -> str:
    depth = {BASE: 0}
    for link in ordered:
        depth[link.name] = depth[link.parent] + 1
    return max(ordered, key=lambda link: depth[link.name]).name
