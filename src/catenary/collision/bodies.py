"""Shapes as Coal has them, the library behind Pinocchio, and what stands about a robot: floors, boxes, meshes."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from catenary.arrays import Floats
from catenary.errors import FileFormatError, InputError, imported
from catenary.robots.geometry import Ball, Box, HalfSpace, MeshFile, Shape, TriangleMesh, check_form
from catenary.spatial import Pose

MOST_TRIANGLES = 2_000_000


@cache
def _coal() -> Any:
    why = "collisions are found by Coal, which is not installed (--no-collision-check continues without)"
    return imported("coal", why, "collision")


@dataclass(frozen=True)
class Body:
    """A shape on a link, with a ball about it; a half-space has none: its plane is z = 0 of `pose`."""

    name: str
    link: int  # -1: the base; obstacles stand on it too
    pose: Pose  # in the link's frame
    solid: Any  # Coal's convex form of it
    surface: Any  # Coal's mesh of one that may not be convex; None of others
    centre: Floats  # (3,) [m] of the ball, in the link's frame
    radius: float  # [m] of the ball
    is_obstacle: bool = False

    @property
    def is_plane(self) -> bool:
        """Whether it is a half-space."""
        return not np.isfinite(self.radius)


def body_of(shape: Shape, *, obstacle: bool = False) -> Body:
    """Return a shape as a body."""
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
    if len(vertices) < 3 or not np.isfinite(vertices).all() or surface.num_tris > MOST_TRIANGLES:
        raise FileFormatError(
            f"{where}: {len(vertices)} vertices, {surface.num_tris} triangles: expected finite ones, up to "
            f"{MOST_TRIANGLES:,} triangles"
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
    """Return the distance of two of Coal's forms at their poses [m], negative where they overlap."""
    (request, result), coal = _request(), _coal()
    result.clear()
    return float(coal.distance(a, coal.Transform3s(*at_a), b, coal.Transform3s(*at_b), request, result))


def floor_at(height: float) -> Shape:
    """Return a floor: all that lies below a height [m] in the base frame."""
    if not np.isfinite(height):
        raise InputError(f"floor: height {height}, expected a finite number of metres")
    return Shape("floor", -1, Pose(np.eye(3), np.array([0.0, 0.0, height])), HalfSpace())


def box_at(number: int, numbers: Sequence[float]) -> Shape:
    """Return a box: its centre x, y, z in the base frame and its edges along x, y, z [m]."""
    if len(numbers) != 6 or not np.isfinite(numbers).all():
        raise InputError(
            f"box {number}: expected six numbers, its centre x,y,z and its edges x,y,z in m, got {list(numbers)}"
        )
    form = Box(*(float(v) for v in numbers[3:]))
    check_form(f"box {number}", form)
    return Shape(f"box {number}", -1, Pose(np.eye(3), np.array(numbers[:3], dtype=float)), form)


def mesh_at(path: Path, place: Sequence[float]) -> Shape:
    """Return the mesh of a file whose origin stands at `place` (3,) [m] in the base frame, along its axes."""
    if not path.is_file():
        raise FileFormatError(f"{path}: no such mesh")
    if len(place) != 3 or not np.isfinite(place).all():
        raise InputError(f"{path}: expected its place x,y,z in m, got {list(place)}")
    return Shape(path.name, -1, Pose(np.eye(3), np.array(place, dtype=float)), MeshFile(path))
