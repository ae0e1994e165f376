"""A robot among obstacles: which pairs of bodies are looked at, how far apart they are, how fast that may change."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catenary.arrays import Floats
from catenary.collision.bodies import Body, bodies_of, distances, primitive
from catenary.dynamics.kinematics import Configuration
from catenary.errors import InputError
from catenary.robots.geometry import Capsule, Geometry, HalfSpace, Shape
from catenary.robots.model import RobotModel
from catenary.spatial import Pose

_POINT = 1e-18  # [m2] square of a length of nothing
Index = NDArray[np.int64]
Names = tuple[str, str]


def segment_distance(p0: Floats, p1: Floats, q0: Floats, q1: Floats) -> Floats:
    """Return the distances (...) between segments p0 p1 and q0 q1, ends (..., 3) [m].

    The closest points of the lines, clamped to the segments, one after the other. [Ericson, Real-Time Collision
    Detection, 2005, section 5.1.9]
    """
    d1, d2, r = p1 - p0, q1 - q0, p0 - q0
    a, e, b = _dot(d1, d1), _dot(d2, d2), _dot(d1, d2)
    c, f = _dot(d1, r), _dot(d2, r)
    safe_a, safe_e = np.where(a > _POINT, a, 1.0), np.where(e > _POINT, e, 1.0)
    denominator = a * e - b * b
    lines = denominator > 1e-12 * np.maximum(a * e, _POINT)  # parallel ones: any point of the first will do
    s = np.clip(np.where(lines, (b * f - c * e) / np.where(lines, denominator, 1.0), 0.0), 0.0, 1.0)
    s = np.where(e > _POINT, s, np.clip(-c / safe_a, 0.0, 1.0))
    t = np.where(e > _POINT, (b * s + f) / safe_e, 0.0)
    clamped = np.clip(t, 0.0, 1.0)
    s = np.where(t != clamped, np.clip((b * clamped - c) / safe_a, 0.0, 1.0), s)
    s = np.where(a > _POINT, s, 0.0)
    clamped = np.where(a > _POINT, clamped, np.where(e > _POINT, np.clip(f / safe_e, 0.0, 1.0), 0.0))
    apart = r + s[..., None] * d1 - clamped[..., None] * d2
    return np.asarray(np.sqrt(_dot(apart, apart)))


def _dot(a: Floats, b: Floats) -> Floats:
    return np.asarray(np.einsum("...i,...i->...", a, b))


def reach_of_body(model: RobotModel, body: Body) -> Floats:
    """Return the largest speed (n_tree,) of a body's points for unit speed of each tree joint [m or 1].

    A turning joint moves a point by at most its distance from the axis: no more than the way along the links to it,
    whatever the joints between do; the first piece counts across the axis only. A sliding joint moves all it carries
    by its own speed. Unlimited sliding joints reach without bound.
    """
    tree = model.tree
    reach = np.zeros(len(tree.parent))
    travel = _travel(model)
    chain: list[int] = []
    link = body.link
    while link >= 0:
        chain.append(link)
        link = int(tree.parent[link])
    for place, joint in enumerate(chain):
        if tree.prismatic[joint]:
            reach[joint] = 1.0
            continue
        beyond = chain[:place][::-1]  # joints between this one and the body, the nearest first
        if not beyond:
            ends = (_across(tree.axis[joint], end) for end in (body.start, body.end))
            reach[joint] = max(ends) + body.radius
            continue
        way = _across(tree.axis[joint], tree.origin[beyond[0]]) + travel[beyond[0]]
        way += sum(float(np.linalg.norm(tree.origin[k])) + travel[k] for k in beyond[1:])
        reach[joint] = way + body.extent
    return reach


def _across(axis: Floats, vector: Floats) -> float:
    """Return the length of a vector across an axis."""
    return float(np.linalg.norm(vector - (vector @ axis) * axis))


def _travel(model: RobotModel) -> Floats:
    """Return how far each sliding tree joint is from its zero at most [m]; zero of turning ones."""
    with np.errstate(invalid="ignore"):
        middle = 0.5 * (model.lower + model.upper)
        half = 0.5 * (model.upper - model.lower)
        used = model.coupling != 0.0
        middle, half = (np.where(used, v[None, :], 0.0) for v in (middle, half))
        farthest = np.abs((model.coupling * middle).sum(axis=1) + model.offset)
        farthest = farthest + (np.abs(model.coupling) * half).sum(axis=1)
    farthest = np.where(np.isnan(farthest), np.inf, farthest)
    return np.where(model.tree.prismatic, farthest, 0.0)


@dataclass(frozen=True)
class PlacedBodies:
    """Bodies at N configurations."""

    rotations: Floats  # (N, n_tree + 1, 3, 3) of the links in the base; the last is the base itself
    positions: Floats  # (N, n_tree + 1, 3) [m]

    def pose(self, row: int, body: Body) -> Pose:
        """Return a body's pose in the base."""
        R, p = self.rotations[row, body.link], self.positions[row, body.link]
        return Pose(R @ body.pose.rotation, R @ body.pose.position + p)


@dataclass(frozen=True)
class CollisionScene:
    """A robot, what stands about it, and the pairs of bodies that must keep apart."""

    model: RobotModel
    bodies: tuple[Body, ...]
    pairs: Index  # (P, 2) indices of bodies
    origin: str  # where the robot's shapes come from
    assumed: bool
    notes: tuple[str, ...] = ()
    _tools: dict[str, Any] = field(default_factory=dict, compare=False, repr=False)

    def place(self, q: Floats) -> PlacedBodies:
        """Return the links' poses at configurations (N, n)."""
        placed = Configuration(self.model, q)
        return PlacedBodies(placed.rotations, placed.positions)

    def lower_bounds(self, placed: PlacedBodies) -> Floats:
        """Return distances (N, P) [m] that the pairs have at least, by the capsules about them."""
        links, start, end, radius = self._capsules
        R, p = placed.rotations[:, links], placed.positions[:, links]
        a = np.einsum("nbij,bj->nbi", R, start) + p
        b = np.einsum("nbij,bj->nbi", R, end) + p
        first, second = self.pairs[:, 0], self.pairs[:, 1]
        apart = segment_distance(a[:, first], b[:, first], a[:, second], b[:, second])
        apart -= radius[first] + radius[second]
        for k in np.flatnonzero(self._has_plane):
            plane, other = sorted(self.pairs[k], key=lambda body: not self.bodies[body].is_plane)
            apart[:, k] = self._above(placed, int(plane), a[:, other], b[:, other]) - radius[other]
        return apart

    def distance(self, placed: PlacedBodies, row: int, pair: int, enough: float = 0.0) -> float:
        """Return a pair's distance at one configuration by Coal [m], negative where the two overlap.

        Beyond `enough` it may be that of their convex hulls, which is never more than their own.
        """
        a, b = (self.bodies[body] for body in self.pairs[pair])
        hulls = self._measure(self._solid(a), a, self._solid(b), b, placed, row)
        if hulls > enough or (a.surface is None and b.surface is None) or a.is_plane or b.is_plane:
            return hulls
        return self._measure(a.surface or self._solid(a), a, b.surface or self._solid(b), b, placed, row)

    @cached_property
    def is_exact(self) -> NDArray[np.bool_]:
        """Of which pairs (P,) the lower bound is the distance itself: capsules, balls, planes."""
        simple = np.array([body.is_capsule or body.is_plane for body in self.bodies])
        return np.asarray(simple[self.pairs].all(axis=1))

    def names(self, pair: int) -> Names:
        """Return what the two bodies of a pair are called."""
        first, second = (self.bodies[body].name for body in self.pairs[pair])
        return first, second

    @cached_property
    def reach(self) -> Floats:
        """How fast a pair's distance changes at most: (P, n) [m/s] for one unit of each coordinate's speed."""
        tree = np.array([reach_of_body(self.model, body) for body in self.bodies])
        common = np.array([self._ancestors(self.bodies[a]) & self._ancestors(self.bodies[b]) for a, b in self.pairs])
        both = (tree[self.pairs[:, 0]] + tree[self.pairs[:, 1]]) * ~common
        return np.asarray(both @ np.abs(self.model.coupling))

    def _ancestors(self, body: Body) -> NDArray[np.bool_]:
        found = np.zeros(len(self.model.link_names), dtype=bool)
        link = body.link
        while link >= 0:
            found[link] = True
            link = int(self.model.tree.parent[link])
        return found

    @cached_property
    def _capsules(self) -> tuple[Index, Floats, Floats, Floats]:
        return (
            np.array([body.link for body in self.bodies]),
            np.array([body.start for body in self.bodies]),
            np.array([body.end for body in self.bodies]),
            np.array([body.radius for body in self.bodies]),
        )

    @cached_property
    def _has_plane(self) -> NDArray[np.bool_]:
        planes = np.array([body.is_plane for body in self.bodies])
        return np.asarray(planes[self.pairs].any(axis=1))

    def _above(self, placed: PlacedBodies, plane: int, start: Floats, end: Floats) -> Floats:
        """Return how far segments' lower ends (N, 3) are above a plane (N,)."""
        body = self.bodies[plane]
        R, p = placed.rotations[:, body.link], placed.positions[:, body.link]
        normal = R @ body.pose.rotation[:, 2]
        origin = R @ body.pose.position + p
        heights = [np.einsum("ni,ni->n", point - origin, normal) for point in (start, end)]
        return np.asarray(np.minimum(*heights))

    def _solid(self, body: Body) -> Any:
        if body.solid is not None:
            return body.solid
        key = f"{body.name} {id(body)}"
        if key not in self._tools:
            length = float(np.linalg.norm(body.end - body.start))
            self._tools[key] = primitive(HalfSpace() if body.is_plane else Capsule(body.radius, length))
        return self._tools[key]

    def _measure(self, a: Any, body_a: Body, b: Any, body_b: Body, placed: PlacedBodies, row: int) -> float:
        if "distance" not in self._tools:
            self._tools["distance"] = distances()
        return float(self._tools["distance"](a, placed.pose(row, body_a), b, placed.pose(row, body_b)))


def scene_of(
    model: RobotModel, geometry: Geometry, obstacles: Sequence[Shape] = (), *, ignored: Sequence[Names] = ()
) -> CollisionScene:
    """Return a robot among obstacles, with all pairs of its bodies that are not neighbours.

    Bodies of one link, and of a link and the one that carries it, are not compared: their joint holds them together. A
    link without a shape is passed over: what it carries is its carrier's neighbour. The base is not compared with
    obstacles: it stands where it stands. Obstacles are in the base frame; `ignored` are pairs of names of links or
    obstacles that may touch.
    """
    own = bodies_of(geometry.shapes)
    bodies = [*own, *bodies_of(tuple(obstacles), obstacles=True)]
    named = [{body.name, model.base} if body.link < 0 and not body.is_obstacle else {body.name} for body in bodies]
    known = {model.base}.union(*named)
    for name in (name for pair in ignored for name in pair):
        if name not in known:
            raise InputError(f'"{name}": no link with a shape and no obstacle; there are {", ".join(sorted(known))}')
    skipped = {frozenset(pair) for pair in ignored}
    shaped = {body.link for body in own}
    pairs = [
        (i, j)
        for i, a in enumerate(bodies)
        for j, b in enumerate(bodies[:i])
        if not _is_kept_together(model, a, b, shaped)
        and not any(frozenset((x, y)) in skipped for x in named[i] for y in named[j])
    ]
    if not pairs:
        raise InputError(f'robot "{model.name}": no two bodies that could collide')
    return CollisionScene(
        model, tuple(bodies), np.array([(j, i) for i, j in pairs]), geometry.origin, geometry.assumed, geometry.notes
    )


def _is_kept_together(model: RobotModel, a: Body, b: Body, shaped: set[int]) -> bool:
    """Return whether two bodies cannot move against each other, or meet in a joint."""
    if a.link == b.link:
        return True  # obstacles and the base among them
    if a.is_obstacle or b.is_obstacle:
        return False
    return _carrier(model, a.link, shaped) == b.link or _carrier(model, b.link, shaped) == a.link


def _carrier(model: RobotModel, link: int, shaped: set[int]) -> int | None:
    """Return the next link towards the base that has a shape; None of the base itself."""
    if link < 0:
        return None
    link = int(model.tree.parent[link])
    while link >= 0 and link not in shaped:
        link = int(model.tree.parent[link])
    return link
