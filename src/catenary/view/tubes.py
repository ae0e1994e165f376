"""Round tubes as triangles: what arms without pictures of their own are drawn with."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catenary.arrays import Floats, as_array

SIDES = 16  # of a tube's cross-section
CAP_RINGS = 4  # of a hemisphere at its end


class Mesh(NamedTuple):
    """Triangles, seen from outside with their corners counter-clockwise."""

    vertices: Floats  # (V, 3) [m]
    faces: NDArray[np.uint32]  # (F, 3) rows of `vertices`


def tube(points: ArrayLike, radius: float) -> Mesh:
    """Return a round tube along a broken line, with a hemisphere at either end; of two points it is a capsule.

    The cross-sections are turned as little as may be from one to the next [Wang et al. 2008, Computation of rotation
    minimizing frames], so that a tube along an arc is not twisted.

    Args:
        points: (P, 3) of its middle line [m], at least two, no two in a row the same.
        radius: [m].
    """
    line = as_array("points", points, (None, 3))
    steps = np.diff(line, axis=0)
    ways = steps / np.linalg.norm(steps, axis=1, keepdims=True)
    along = np.vstack([ways[:1], ways[:-1] + ways[1:], ways[-1:]])
    along = along / np.linalg.norm(along, axis=1, keepdims=True)
    side = np.eye(3)[np.argmin(np.abs(along[0]))]
    angles = np.linspace(0.0, 2.0 * np.pi, SIDES, endpoint=False)
    rings: list[Floats] = []

    def ring(centre: Floats, way: Floats, across: Floats, size: float) -> None:
        other = np.cross(way, across)
        rings.append(centre + size * (np.outer(np.cos(angles), across) + np.outer(np.sin(angles), other)))

    bends = np.linspace(0.0, 0.5 * np.pi, CAP_RINGS, endpoint=False)[::-1]
    for k, (point, way) in enumerate(zip(line, along, strict=True)):
        side = side - (side @ way) * way
        side = side / np.linalg.norm(side)
        if k == 0:
            for bend in bends[:-1]:
                ring(point - radius * np.sin(bend) * way, way, side, radius * np.cos(bend))
        ring(point, way, side, radius)
        if k == len(line) - 1:
            for bend in bends[::-1][1:]:
                ring(point + radius * np.sin(bend) * way, way, side, radius * np.cos(bend))
    ends = line[0] - radius * along[0], line[-1] + radius * along[-1]
    return _closed(np.vstack(rings), ends)


def _closed(rings: Floats, ends: tuple[Floats, Floats]) -> Mesh:
    """Join rings of SIDES points each, in order, and close the tube by a point at either end."""
    count = len(rings) // SIDES
    here = np.arange(SIDES)
    after = np.roll(here, -1)
    faces = []
    for k in range(count - 1):
        low, high = k * SIDES, (k + 1) * SIDES
        faces += [
            np.column_stack([low + here, low + after, high + after]),
            np.column_stack([low + here, high + after, high + here]),
        ]
    first, last = len(rings), len(rings) + 1
    faces.append(np.column_stack([np.full(SIDES, first), after, here]))
    top = (count - 1) * SIDES
    faces.append(np.column_stack([np.full(SIDES, last), top + here, top + after]))
    return Mesh(np.vstack([rings, *ends]), np.vstack(faces).astype(np.uint32))


def joined(meshes: Sequence[Mesh]) -> Mesh:
    """Return several meshes as one."""
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes[:-1])])
    faces = [mesh.faces + np.uint32(start) for mesh, start in zip(meshes, starts, strict=True)]
    return Mesh(np.vstack([mesh.vertices for mesh in meshes]), np.vstack(faces))


def grown(mesh: Mesh, by: float) -> Mesh:
    """Return a mesh whose surface lies further out [m]: a shell about the one that was."""
    corners = mesh.vertices[mesh.faces]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals = np.zeros_like(mesh.vertices)
    for corner in range(3):
        np.add.at(normals, mesh.faces[:, corner], across)
    size = np.linalg.norm(normals, axis=1, keepdims=True)
    return Mesh(mesh.vertices + by * normals / np.maximum(size, 1e-30), mesh.faces)
