"""The shapes of a robot's links: constant data beside the model, for whoever asks what touches what."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from catenary.arrays import Floats
from catenary.errors import InputError
from catenary.robots.model import RobotModel
from catenary.robots.plausibility import MAX_LENGTH_M
from catenary.spatial import Pose

# [m] length up to which a segment has no direction: squares of shorter ones lose their digits
_A_POINT = 1e-12


class Ball(NamedTuple):
    """A ball about the shape's origin."""

    radius: float  # [m]


class Capsule(NamedTuple):
    """All points within `radius` of a segment along z, centred at the origin."""

    radius: float  # [m]
    length: float  # [m] of the segment, without the caps


class Cylinder(NamedTuple):
    """A cylinder along z, centred at the origin."""

    radius: float  # [m]
    length: float  # [m]


class Box(NamedTuple):
    """A box along the axes, centred at the origin."""

    x: float  # [m] whole edges
    y: float
    z: float


class Ellipsoid(NamedTuple):
    """An ellipsoid along the axes, centred at the origin."""

    x: float  # [m] half axes
    y: float
    z: float


class HalfSpace(NamedTuple):
    """All that lies below the plane z = 0: a floor, a wall."""


@dataclass(frozen=True)
class TriangleMesh:
    """A surface of triangles."""

    vertices: Floats  # (V, 3) [m]
    triangles: NDArray[np.int64]  # (T, 3) indices of vertices


class MeshFile(NamedTuple):
    """A surface in a file, which is read when distances are computed."""

    path: Path
    scale: tuple[float, float, float] = (1.0, 1.0, 1.0)


Form = Ball | Capsule | Cylinder | Box | Ellipsoid | HalfSpace | TriangleMesh | MeshFile


@dataclass(frozen=True)
class Shape:
    """A form fixed to a link."""

    name: str  # of the link in the description
    link: int  # index into the tree; -1 is the base
    pose: Pose  # of the form in that link's frame
    form: Form


@dataclass(frozen=True)
class Geometry:
    """Shapes of a robot's links."""

    robot: str
    shapes: tuple[Shape, ...]
    origin: str  # where the shapes come from, in words
    assumed: bool = False  # by us, or by the robot's file, and not measured
    notes: tuple[str, ...] = field(default_factory=tuple)


def shape_on(where: str, model: RobotModel, frame: str, name: str, pose: Pose, form: Form) -> Shape:
    """Return a form fixed to a frame of a robot."""
    check_form(f'{where}: shape of "{name}"', form)
    carrier = model.frame(frame)
    return Shape(name, carrier.link, carrier.pose @ pose, form)


def check_form(what: str, form: Form) -> None:
    """Refuse a shape whose sizes are not positive, or beyond any robot's (a kilometre).

    Args:
        what, form: The shape, which opens every message, and its form and sizes [m].

    Raises:
        InputError: A size out of range, a mesh without triangles, or a vertex that is not finite.
    """
    if isinstance(form, TriangleMesh):
        if len(form.vertices) < 3 or len(form.triangles) < 1:
            raise InputError(f"{what}: a mesh without triangles")
        if not np.isfinite(form.vertices).all():
            raise InputError(f"{what}: a vertex of the mesh is not finite")
        return
    if isinstance(form, Capsule) and not 0.0 <= form.length <= MAX_LENGTH_M:
        raise InputError(f"{what}: length {form.length:g} m, expected zero to {MAX_LENGTH_M:g} m")
    sizes = form.scale if isinstance(form, MeshFile) else form[:1] if isinstance(form, Capsule) else form
    for size in np.abs(sizes) if isinstance(form, MeshFile) else sizes:
        if not 0.0 < size <= MAX_LENGTH_M:
            raise InputError(f"{what}: size {size:g}, expected above zero and at most {MAX_LENGTH_M:g}")


def capsule_between(start: Floats, end: Floats, radius: float) -> tuple[Pose, Capsule]:
    """Return the capsule about a segment between two points (3,) [m], and where it stands."""
    along = np.asarray(end, dtype=float) - start
    length = float(np.linalg.norm(along))
    z = along / length if length > _A_POINT else np.array([0.0, 0.0, 1.0])
    x = np.cross(z, np.eye(3)[int(np.argmin(np.abs(z)))])
    x /= np.linalg.norm(x)
    rotation = np.column_stack([x, np.cross(z, x), z])
    return Pose(rotation, 0.5 * (np.asarray(start, dtype=float) + end)), Capsule(radius, length)


def links_without_shape(model: RobotModel, shapes: Iterable[Shape]) -> tuple[str, ...]:
    """Return the moving links that have a mass and no shape, by name."""
    shaped = {shape.link for shape in shapes}
    return tuple(
        name
        for i, name in enumerate(model.link_names)
        if i not in shaped and name not in model.massless and name not in model.missing_inertia
    )


def distance_to_segment(point: Floats, start: Floats, end: Floats) -> float:
    """Return the distance of a point from a segment [m].

    Args:
        point: (3,) [m].
        start, end: Ends of the segment (3,) [m].
    """
    along = end - start
    square = float(along @ along)
    share = 0.0 if square == 0.0 else float(np.clip((point - start) @ along / square, 0.0, 1.0))
    return float(np.linalg.norm(point - start - share * along))
