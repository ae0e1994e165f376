"""Distances by Coal, the library behind Pinocchio: the only file that imports it."""

from collections.abc import Callable
from typing import Any

import numpy as np

from catenary.arrays import Floats
from catenary.errors import FileFormatError, MissingPackageError
from catenary.robots.geometry import Box, Cylinder, Ellipsoid, MeshFile, TriangleMesh
from catenary.spatial import Pose

MOST_TRIANGLES = 2_000_000


def _coal() -> Any:
    try:
        import coal
    except ImportError as error:
        raise MissingPackageError(
            "shapes that are no capsules need Coal, which is not installed: pip install catenary[collision]; "
            "--no-collision-check goes on without"
        ) from error
    return coal


def primitive(form: Box | Cylinder | Ellipsoid) -> Any:
    """Return a simple form as Coal has it."""
    coal = _coal()
    kind = {Box: coal.Box, Cylinder: coal.Cylinder, Ellipsoid: coal.Ellipsoid}[type(form)]
    return kind(*form)


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


def capsule(radius: float, length: float) -> Any:
    """Return a capsule along z as Coal has it."""
    return _coal().Capsule(radius, length)


def half_space() -> Any:
    """Return all that lies below z = 0 as Coal has it."""
    return _coal().Halfspace(np.array([0.0, 0.0, 1.0]), 0.0)
