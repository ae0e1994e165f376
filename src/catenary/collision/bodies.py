"""Shapes in the form that distances are taken in: a capsule about each, and Coal's form of it; floors, boxes, meshes.

The only file that imports Coal, the library behind Pinocchio.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from catenary.arrays import Floats
from catenary.errors import FileFormatError, InputError, MissingPackageError, to_install
from catenary.robots.geometry import (
    Ball,
    Box,
    Capsule,
    Cylinder,
    Ellipsoid,
    HalfSpace,
    MeshFile,
    Shape,
    TriangleMesh,
    check_form,
)
from catenary.spatial import Pose

MOST_TRIANGLES = 2_000_000
ROUNDING = 1e-9  # [m] added to the capsule about vertices


def _coal() -> Any:
    try:
        import coal
    except ImportError as error:
        raise MissingPackageError(
            f"shapes that are no capsules need Coal, which is not installed: {to_install('collision')}; "
            "--no-collision-check continues without"
        ) from error
    return coal


def primitive(form: Box | Cylinder | Ellipsoid | Capsule | HalfSpace) -> Any:
    """Return a simple form as Coal has it."""
    coal = _coal()
    if isinstance(form, HalfSpace):
        return coal.Halfspace(np.array([0.0, 0.0, 1.0]), 0.0)
    return getattr(coal, type(form).__name__)(*form)


def mesh_of(name: str, form: TriangleMesh | MeshFile) -> tuple[Any, Any, Floats]:
    """Return a mesh's convex hull, the mesh itself, and its vertices (V, 3) [m]."""
    coal = _coal()
    if isinstance(form, MeshFile):
        where = f'"{name}": {form.path}'
        scale = np.array(form.scale, dtype=float)
        try:
            surface = coal.MeshLoader(coal.NODE_TYPE.BV_OBBRSS).load(str(form.path), scale)
        except (RuntimeError, ValueError) as error:
            raise FileFormatError(f"{where}: cannot be read as a mesh: {str(error).strip()}") from error
    else:
        where = f'"{name}"'
        surface = _surface(coal, form)
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
    return surface.convex, surface, vertices


def _surface(coal: Any, mesh: TriangleMesh) -> Any:
    surface = coal.BVHModelOBBRSS()
    surface.beginModel(len(mesh.triangles), len(mesh.vertices))
    surface.addVertices(np.asarray(mesh.vertices, dtype=float))
    surface.addTriangles(np.asarray(mesh.triangles, dtype=np.int64))
    surface.endModel()
    return surface


def distances() -> Callable[[Any, Pose, Any, Pose], float]:
    """Return a function of two of Coal's forms and their poses: their distance [m], negative where they overlap."""
    coal = _coal()
    request, result = coal.DistanceRequest(), coal.DistanceResult()

    def distance(a: Any, at_a: Pose, b: Any, at_b: Pose) -> float:
        result.clear()
        return float(coal.distance(a, coal.Transform3s(*at_a), b, coal.Transform3s(*at_b), request, result))

    return distance


@dataclass(frozen=True)
class Body:
    """A shape on a link, with the smallest capsule found about it.

    A half-space has none: its plane is z = 0 of `pose`.
    """

    name: str
    link: int  # -1: the base; obstacles stand on it too
    pose: Pose  # in the link's frame
    start: Floats  # (3,) [m] ends of the capsule's segment in the link's frame
    end: Floats
    radius: float  # [m]
    is_plane: bool = False
    solid: Any = None  # Coal's convex form of it, None where the capsule is the shape itself
    surface: Any = None  # Coal's mesh, of one that may not be convex
    is_obstacle: bool = False

    @property
    def is_capsule(self) -> bool:
        """Whether the capsule is the shape itself."""
        return self.solid is None and not self.is_plane

    @property
    def extent(self) -> float:
        """Distance of its farthest point from the link's origin [m]."""
        return float(max(np.linalg.norm(self.start), np.linalg.norm(self.end))) + self.radius


def bodies_of(shapes: tuple[Shape, ...], *, obstacles: bool = False) -> list[Body]:
    """Return shapes as bodies; Coal is imported for all but balls, capsules and planes."""
    return [_body(shape, obstacle=obstacles) for shape in shapes]


def _body(shape: Shape, *, obstacle: bool) -> Body:
    form, pose = shape.form, shape.pose
    half = np.zeros(3)
    solid = surface = None
    centre = np.zeros(3)
    if isinstance(form, HalfSpace):
        return Body(shape.name, shape.link, pose, half, half, 0.0, is_plane=True, is_obstacle=obstacle)
    if isinstance(form, Ball):
        radius = form.radius
    elif isinstance(form, Capsule):
        half, radius = np.array([0.0, 0.0, 0.5 * form.length]), form.radius
    else:
        if isinstance(form, Cylinder):
            half, radius = np.array([0.0, 0.0, 0.5 * form.length]), form.radius
            solid = primitive(form)
        elif isinstance(form, Box | Ellipsoid):
            sizes = np.array(form, dtype=float) * (0.5 if isinstance(form, Box) else 1.0)
            longest = int(np.argmax(sizes))
            others = np.delete(sizes, longest)
            # a box needs the diagonal of its smaller side, an ellipsoid its second half axis
            radius = float(np.linalg.norm(others)) if isinstance(form, Box) else float(others.max())
            half[longest] = sizes[longest] - (0.0 if isinstance(form, Box) else radius)
            solid = primitive(form)
        else:
            solid, surface, vertices = mesh_of(shape.name, form)
            centre, half, radius = capsule_about(vertices)
    start, end = (pose.rotation @ (centre + sign * half) + pose.position for sign in (-1.0, 1.0))
    return Body(shape.name, shape.link, pose, start, end, radius, solid=solid, surface=surface, is_obstacle=obstacle)


def capsule_about(vertices: Floats) -> tuple[Floats, Floats, float]:
    """Return a capsule about points (V, 3): its centre, half its segment (3,), its radius [m].

    Along their longest principal axis; the segment is the shortest for the radius that they need about it.
    """
    mean = vertices.mean(axis=0)
    axis = np.linalg.svd(vertices - mean, full_matrices=False)[2][0]
    along = (vertices - mean) @ axis
    beside = vertices - mean - along[:, None] * axis
    # the centre of the box about what lies across the axis, which is never far from the smallest circle's
    middle = 0.5 * (beside.max(axis=0) + beside.min(axis=0))
    middle -= (middle @ axis) * axis
    across = np.linalg.norm(beside - middle, axis=1)
    radius = float(across.max())
    cap = np.sqrt(np.maximum(radius**2 - across**2, 0.0))
    low, high = float((along + cap).min()), float((along - cap).max())
    if low > high:  # one ball holds all
        low = high = 0.5 * (low + high)
    return mean + middle + 0.5 * (low + high) * axis, 0.5 * (high - low) * axis, radius + ROUNDING


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
