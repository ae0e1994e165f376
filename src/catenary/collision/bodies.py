"""Shapes in the form that distances are taken in: a capsule about each, and the shape itself."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from catenary.arrays import Floats
from catenary.robots.geometry import Ball, Box, Capsule, Cylinder, Ellipsoid, HalfSpace, Shape
from catenary.spatial import Pose

ROUNDING = 1e-9  # [m] added to the capsule about vertices


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
        from catenary.collision.coal_shapes import mesh_of, primitive

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
    return Body(
        shape.name, shape.link, pose, start, end, radius, solid=solid, surface=surface, is_obstacle=obstacle
    )


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
