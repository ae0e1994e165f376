"""Collision scene of a robot and obstacles: body pairs, distances, and continuous collision checking of motions.

Bounding spheres exclude most pairs; Coal computes the distances of the others. Two bodies at a distance d stay a margin
m apart until their points have moved d - m relative to each other. So each pair is checked again when that is possible
at the motion's highest speeds, and no collision is missed in between (conservative advancement: Mirtich 1996,
"Impulse-based dynamic simulation of rigid body systems", section 2.3).
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from catenary.arrays import Floats
from catenary.dynamics.kinematics import Configuration
from catenary.errors import FileFormatError, InputError, imported
from catenary.robots.geometry import Ball, Box, Geometry, HalfSpace, MeshFile, Shape, TriangleMesh, check_form
from catenary.robots.model import RobotModel
from catenary.spatial import Pose

_MAX_TRIANGLES = 2_000_000


@cache
def _coal() -> Any:
    why = "collision checking needs Coal, which is not installed (--no-collision-check continues without)"
    return imported("coal", why, "collision")


@dataclass(frozen=True)
class Body:
    """A shape on a link, with its bounding sphere; a half-space has none: its plane is z = 0 of `pose`."""

    name: str
    link: int  # -1: the base, also for obstacles
    pose: Pose  # in the link's frame
    solid: Any  # convex geometry of Coal
    surface: Any  # Coal's mesh of a shape that may not be convex; None for others
    centre: Floats  # (3,) [m] of the sphere, in the link's frame
    radius: float  # [m] of the sphere
    is_obstacle: bool = False

    @property
    def is_plane(self) -> bool:
        """The body is a half-space."""
        return not np.isfinite(self.radius)


def body_of(shape: Shape, *, obstacle: bool = False) -> Body:
    """Create a body of a shape."""
    coal, form, (rotation, position) = _coal(), shape.form, shape.pose
    solid = surface = None
    if isinstance(form, HalfSpace):
        solid = coal.Halfspace(np.array([0.0, 0.0, 1.0]), 0.0)
        return Body(shape.name, shape.link, shape.pose, solid, None, position, np.inf, obstacle)
    if isinstance(form, MeshFile | TriangleMesh):
        solid, surface = _mesh(shape.name, form)
    else:
        solid = coal.Sphere(form.radius) if isinstance(form, Ball) else getattr(coal, type(form).__name__)(*form)
    solid.computeLocalAABB()
    centre = rotation @ np.asarray(solid.aabb_center) + position
    return Body(shape.name, shape.link, shape.pose, solid, surface, centre, float(solid.aabb_radius), obstacle)


def _mesh(name: str, form: TriangleMesh | MeshFile) -> tuple[Any, Any]:
    """Return a mesh's convex hull, and the mesh itself."""
    coal, where = _coal(), f'"{name}"'
    if isinstance(form, MeshFile):
        where = f"{where}: {form.path}"
        try:
            surface = coal.MeshLoader(coal.NODE_TYPE.BV_OBBRSS).load(str(form.path), np.array(form.scale, dtype=float))
        except (RuntimeError, ValueError) as error:
            raise FileFormatError(f"{where}: cannot be read as a mesh: {str(error).strip()}") from error
    else:
        surface = coal.BVHModelOBBRSS()
        surface.beginModel(len(form.triangles), len(form.vertices))
        surface.addVertices(np.asarray(form.vertices, dtype=float))
        surface.addTriangles(np.asarray(form.triangles, dtype=np.int64))
        surface.endModel()
    vertices = np.array(surface.vertices(), dtype=float).reshape(-1, 3)
    if len(vertices) < 3 or not np.isfinite(vertices).all() or surface.num_tris > _MAX_TRIANGLES:
        raise FileFormatError(
            f"{where}: {len(vertices)} vertices, {surface.num_tris} triangles: expected finite ones, up to "
            f"{_MAX_TRIANGLES:,} triangles"
        )
    try:
        surface.buildConvexHull(True, "Qt")
    except (RuntimeError, ValueError) as error:
        raise FileFormatError(f"{where}: the mesh is flat: it has no convex hull") from error
    return surface.convex, surface


@cache
def _request() -> tuple[Any, Any]:
    return _coal().DistanceRequest(), _coal().DistanceResult()


def distance(a: Any, at_a: Pose, b: Any, at_b: Pose) -> float:
    """Return the distance [m] of two Coal geometries at their poses, negative if they overlap."""
    (request, result), coal = _request(), _coal()
    result.clear()
    return float(coal.distance(a, coal.Transform3s(*at_a), b, coal.Transform3s(*at_b), request, result))


def floor_at(height: float) -> Shape:
    """Return a floor: the half-space below a height [m] in the base frame."""
    if not np.isfinite(height):
        raise InputError(f"floor: height {height}, expected a finite number of metres")
    return Shape("floor", -1, Pose(np.eye(3), np.array([0.0, 0.0, height])), HalfSpace())


def box_at(number: int, numbers: Sequence[float]) -> Shape:
    """Return a box as an obstacle.

    Args:
        number, numbers: For the box's name; centre x, y, z in the base frame and edge lengths along x, y, z [m].
    """
    if len(numbers) != 6 or not np.isfinite(numbers).all():
        raise InputError(
            f"box {number}: expected six numbers, its centre x,y,z and its edges x,y,z in m, got {list(numbers)}"
        )
    form = Box(*(float(v) for v in numbers[3:]))
    check_form(f"box {number}", form)
    return Shape(f"box {number}", -1, Pose(np.eye(3), np.array(numbers[:3], dtype=float)), form)


def mesh_at(path: Path, place: Sequence[float]) -> Shape:
    """Return the mesh of a file as an obstacle.

    Args:
        place: Position x, y, z of its origin in the base frame [m]; its axes are those of the base.
    """
    if not path.is_file():
        raise FileFormatError(f"{path}: no such mesh")
    if len(place) != 3 or not np.isfinite(place).all():
        raise InputError(f"{path}: expected its place x,y,z in m, got {list(place)}")
    return Shape(path.name, -1, Pose(np.eye(3), np.array(place, dtype=float)), MeshFile(path))


POSES = 60  # random poses for the detection of permanent contacts
_LOOK_COUNT = 128  # time steps of a motion below which distances are computed; and samples for the smallest distance
_FINEST_M = 2e-5  # [m] tolerance of the margin
Names = tuple[str, str]


class JointPath(Protocol):
    """A motion with bounds on positions and speeds."""

    @property
    def duration(self) -> float:
        """[s]."""

    def extremes(self) -> tuple[Floats, Floats, Floats]:
        """Return bounds on positions and speeds over the motion: lowest, highest, fastest, (n,) each."""

    def sample(self, times: Floats) -> tuple[Floats, Floats, Floats]:
        """Return q, qd, qdd, each (N, n), at times (N,) [s]."""


@dataclass(frozen=True)
class Clearance:
    """Clearance along a motion."""

    is_kept: bool  # the margin holds at every instant
    pair: Names  # closest pair, at the sampled instants
    time: float  # [s] of the smallest distance
    distance: float  # [m] smallest distance
    instants: int  # number of checked instants


@dataclass(frozen=True)
class CollisionScene:
    """A robot, obstacles, and the pairs of bodies that must stay apart."""

    model: RobotModel
    bodies: tuple[Body, ...]
    pairs: NDArray[np.int64]  # (P, 2) indices of bodies
    origin: str  # source of the robot's shapes
    assumed: bool  # shapes are assumed from kinematics

    def names(self, pair: int) -> Names:
        """Return the names of a pair's bodies."""
        first, second = (self.bodies[body].name for body in self.pairs[pair])
        return first, second

    def lower_bounds(self, placed: Configuration) -> Floats:
        """Return lower bounds (N, P) [m] of the pairs' distances, by bounding spheres."""
        links, centres, radii = self._balls
        R, p = placed.rotations[:, links], placed.positions[:, links]
        centres, (first, second) = np.einsum("nbij,bj->nbi", R, centres) + p, self.pairs.T
        with np.errstate(invalid="ignore"):
            apart = np.linalg.norm(centres[:, first] - centres[:, second], axis=2) - radii[first] - radii[second]
        for k in np.flatnonzero(~np.isfinite(apart).all(axis=0)):
            plane, other = sorted(self.pairs[k], key=lambda body: not self.bodies[body].is_plane)
            normal = R[:, plane] @ self.bodies[plane].pose.rotation[:, 2]
            apart[:, k] = np.einsum("ni,ni->n", centres[:, other] - centres[:, plane], normal) - radii[other]
        return np.asarray(apart)

    def distance(self, placed: Configuration, row: int, pair: int, enough: float = 0.0) -> float:
        """Return a pair's distance [m], negative in overlap; beyond `enough` [m] only that of their convex hulls."""
        a, b = (self.bodies[body] for body in self.pairs[pair])
        poses = []
        for body in (a, b):
            R, p = placed.rotations[row, body.link], placed.positions[row, body.link]
            poses.append(Pose(R @ body.pose.rotation, R @ body.pose.position + p))
        hulls = distance(a.solid, poses[0], b.solid, poses[1])
        if hulls > enough or (a.surface is None and b.surface is None) or a.is_plane or b.is_plane:
            return hulls
        return distance(a.surface or a.solid, poses[0], b.surface or b.solid, poses[1])

    @cached_property
    def _balls(self) -> tuple[NDArray[np.int64], Floats, Floats]:
        """Links, centres and radii of the bounding spheres of all bodies."""
        links = np.array([body.link for body in self.bodies])
        return links, np.array([body.centre for body in self.bodies]), np.array([body.radius for body in self.bodies])

    @cached_property
    def reach(self) -> Floats:
        """Bounds on the rates of the pairs' distances (P, n) [m/s] per unit speed of each coordinate."""
        tree = np.array([self._reach_of(body) for body in self.bodies])  # (bodies, n_tree)
        first, second = self.pairs.T
        moves_one_alone = (tree[first] > 0.0) != (tree[second] > 0.0)
        both: Floats = (tree[first] + tree[second]) * moves_one_alone
        return np.asarray(both @ np.abs(self.model.coupling))

    def _reach_of(self, body: Body) -> Floats:
        """Return the largest speed (n_tree,) of a body's points for unit speed of each joint."""
        tree, reach = self.model.tree, np.zeros(len(self.model.tree.parent))
        link = body.link
        way = 0.0 if body.is_plane else float(np.linalg.norm(body.centre)) + body.radius
        while link >= 0:
            reach[link] = 1.0 if tree.prismatic[link] else way
            way += float(np.linalg.norm(tree.origin[link])) + self._travel[link]
            link = int(tree.parent[link])
        return reach

    @cached_property
    def _travel(self) -> Floats:
        """Largest displacement of each prismatic tree joint (n_tree,) [m]; zero for revolute ones."""
        farthest = np.maximum(np.abs(self.model.lower), np.abs(self.model.upper))
        used = self.model.coupling != 0.0
        parts = np.abs(self.model.coupling) * np.where(used, farthest, 0.0)
        return np.where(self.model.tree.prismatic, parts.sum(axis=1) + np.abs(self.model.offset), 0.0)

    def _within(self, q: Floats, margin: float) -> Iterator[tuple[int, int]]:
        """Yield indices of configurations (N, n) and pairs closer than a margin [m], most likely collisions first."""
        placed = Configuration(self.model, q)
        known = self.lower_bounds(placed)
        close = np.argwhere(known < margin)
        for row, pair in close[np.argsort(known[close[:, 0], close[:, 1]])].tolist():
            if self.distance(placed, row, pair, margin) < margin:
                yield row, pair

    def touching(self, q: Floats, margin: float) -> NDArray[np.bool_]:
        """Return a mask (N, P) of the pairs closer than a margin [m] at configurations (N, n)."""
        close = np.zeros((len(q), len(self.pairs)), dtype=bool)
        for row, pair in self._within(q, margin):
            close[row, pair] = True
        return close

    def keeps_apart(self, q: Floats, margin: float) -> bool:
        """Return true if all pairs are at least a margin [m] apart at all configurations (N, n)."""
        return next(self._within(q, margin), None) is None

    def without_constant_contacts(self, q: Floats, margin: float) -> "tuple[CollisionScene, tuple[Names, ...]]":
        """Return the scene without pairs of links within the margin at all configurations (N, n), and their names."""
        always = self.touching(q, margin).all(axis=0)
        always &= ~np.array([any(self.bodies[b].is_obstacle for b in pair) for pair in self.pairs])
        if always.all():
            raise InputError(
                f'robot "{self.model.name}": every pair of its bodies is within {1000 * margin:g} mm in all of '
                f"{len(q)} poses: a smaller margin, or smaller shapes?"
            )
        names = tuple(dict.fromkeys(self.names(int(k)) for k in np.flatnonzero(always)))
        return replace(self, pairs=self.pairs[~always]), names

    def clearance(self, path: JointPath, margin: float) -> Clearance:
        """Check that all pairs stay a margin [m] apart at every instant of a motion, and return the clearance."""
        speeds = np.maximum(self.reach @ path.extremes()[2], 1e-12)
        if not np.isfinite(speeds).all():
            raise InputError(f'robot "{self.model.name}": a prismatic joint has no limits, so speeds are unbounded')
        until, time, instants = np.zeros(len(speeds)), 0.0, 0  # [s] until which pairs are proven collision-free
        while (time := float(until.min())) < path.duration:
            instants += 1
            placed = Configuration(self.model, path.sample(np.array([time]))[0])
            until = np.maximum(until, time + (self.lower_bounds(placed)[0] - margin) / speeds)
            for pair in np.flatnonzero(until < time + path.duration / _LOOK_COUNT).tolist():
                apart = self.distance(placed, 0, pair, margin)
                if apart < margin + _FINEST_M:
                    return Clearance(False, self.names(pair), time, apart, instants)
                until[pair] = max(until[pair], time + (apart - margin) / speeds[pair])
        return self._nearest(path, instants)

    def _nearest(self, path: JointPath, instants: int) -> Clearance:
        times = np.linspace(0.0, path.duration, _LOOK_COUNT + 1)
        placed = Configuration(self.model, path.sample(times)[0])
        known = self.lower_bounds(placed)
        best, where = np.inf, (0, 0)
        for row, pair in np.column_stack(np.unravel_index(np.argsort(known, axis=None), known.shape)).tolist():
            if known[row, pair] >= best:
                break
            apart = self.distance(placed, row, pair, best)
            if apart < best:
                best, where = apart, (row, pair)
        return Clearance(True, self.names(where[1]), float(times[where[0]]), best, instants)


def scene_of(
    model: RobotModel, geometry: Geometry, obstacles: Sequence[Shape] = (), *, ignored: Sequence[Names] = ()
) -> CollisionScene:
    """Create a collision scene of all pairs of bodies that are not neighbours.

    Neighbours are bodies of one link, and of a link and its parent, skipping links without a shape. The base is not
    checked against obstacles.

    Args:
        obstacles: Shapes in the base frame.
        ignored: Pairs of names that may touch.
    """
    bodies = [body_of(shape) for shape in geometry.shapes]
    shaped = {body.link for body in bodies}
    bodies += [body_of(shape, obstacle=True) for shape in obstacles]
    named = [{body.name, model.base} if body.link < 0 and not body.is_obstacle else {body.name} for body in bodies]
    known = {model.base}.union(*named)
    for name in (name for pair in ignored for name in pair):
        if name not in known:
            raise InputError(f'"{name}": no link with a shape and no obstacle; there are {", ".join(sorted(known))}')
    skipped = {frozenset(pair) for pair in ignored}
    pairs = [
        (j, i)
        for i, a in enumerate(bodies)
        for j, b in enumerate(bodies[:i])
        if not _is_kept_together(model, a, b, shaped)
        and not any(frozenset((x, y)) in skipped for x in named[i] for y in named[j])
    ]
    if not pairs:
        raise InputError(f'robot "{model.name}": no two bodies that could collide')
    return CollisionScene(model, tuple(bodies), np.array(pairs), geometry.origin, geometry.assumed)


def _is_kept_together(model: RobotModel, a: Body, b: Body, shaped: set[int]) -> bool:
    """Return true for two bodies without relative motion, or connected by a joint."""
    if a.link == b.link:
        return True  # obstacles and the base among them
    if a.is_obstacle or b.is_obstacle:
        return False
    return _carrier(model, a.link, shaped) == b.link or _carrier(model, b.link, shaped) == a.link


def _carrier(model: RobotModel, link: int, shaped: set[int]) -> int | None:
    """Return the next link towards the base that has a shape; None for the base itself."""
    if link < 0:
        return None
    link = int(model.tree.parent[link])
    while link >= 0 and link not in shaped:
        link = int(model.tree.parent[link])
    return link
