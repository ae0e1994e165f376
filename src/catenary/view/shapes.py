"""The shape of each link of an arm: as its file shows it, or tubes from joint to joint, from its kinematics alone."""

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catenary.arrays import Floats, as_array
from catenary.errors import CatenaryError, FileFormatError
from catenary.robots.catalog import robot_names
from catenary.robots.geometry import Ball, Box, Capsule, Cylinder, Form, HalfSpace, MeshFile, Shape, TriangleMesh
from catenary.robots.model import RobotModel
from catenary.robots.shapes import described_geometry

_TUBE_SIDES = 16  # of a tube's cross-section
_CAP_RINGS = 4  # of a hemisphere at its end
_TUBE_RADIUS = 0.032  # radius of a tube, times the arm's length
_HUB_LENGTH = 2.6  # length of a joint's hub, times the tube's radius to either side
_TIP_RADIUS = 0.45  # radius of the last link and the tool, times the tube's
_JOINTS_MEET_WITHIN = 0.01  # times the arm's length: joints nearer than this lie in one point
_ARC_RADIUS = 0.72  # radius of a spherical linkage, times the way from its centre to what slides through it
_ARC_STEPS = 24  # of an arc
_ENDLESS_TRAVEL_M = 0.5  # [m] of a slider without limits
_TRIANGLES = 200_000  # triangles of an arm, beyond which a browser is slow


class Mesh(NamedTuple):
    """Triangles, seen from outside with their corners counter-clockwise."""

    vertices: Floats  # (V, 3) [m]
    faces: NDArray[np.uint32]  # (F, 3) rows of `vertices`


def tube(points: ArrayLike, radius: float) -> Mesh:
    """Return a round tube of a radius [m] along a broken line (P, 3) [m] of distinct points, with hemispherical ends.

    Cross-sections turn as little as may be [Wang et al. 2008, Computation of rotation minimizing frames].
    """
    line = as_array("points", points, (None, 3))
    steps = np.diff(line, axis=0)
    ways = steps / np.linalg.norm(steps, axis=1, keepdims=True)
    along = np.vstack([ways[:1], ways[:-1] + ways[1:], ways[-1:]])
    along = along / np.linalg.norm(along, axis=1, keepdims=True)
    bends = np.linspace(0.0, 0.5 * np.pi, _CAP_RINGS, endpoint=False)[1:]

    def cap(end: int, outward: float, bend: float) -> tuple[Floats, Floats, float]:
        return line[end] + outward * radius * np.sin(bend) * along[end], along[end], radius * np.cos(bend)

    rings = [cap(0, -1.0, bend) for bend in bends[::-1]]
    rings += [(centre, way, radius) for centre, way in zip(line, along, strict=True)]
    rings += [cap(-1, 1.0, bend) for bend in bends]
    side = np.eye(3)[np.argmin(np.abs(along[0]))]
    angles = np.linspace(0.0, 2.0 * np.pi, _TUBE_SIDES, endpoint=False)
    vertices: list[Floats] = []
    for centre, way, size in rings:
        side = side - (side @ way) * way
        side = side / np.linalg.norm(side)
        around = np.outer(np.cos(angles), side) + np.outer(np.sin(angles), np.cross(way, side))
        vertices.append(centre + size * around)
    ends = line[0] - radius * along[0], line[-1] + radius * along[-1]
    return _closed(np.vstack(vertices), ends)


def _closed(rings: Floats, ends: tuple[Floats, Floats]) -> Mesh:
    """Join rings of as many points each, in order, and close the tube by a point at either end."""
    here = np.arange(_TUBE_SIDES)
    after = np.roll(here, -1)
    low = (
        _TUBE_SIDES * np.arange(len(rings) // _TUBE_SIDES - 1)[:, None]
    )  # rows of the rings that have another one above
    first, last, top = len(rings), len(rings) + 1, len(rings) - _TUBE_SIDES
    triangles = [
        (low + here, low + after, low + _TUBE_SIDES + after),
        (low + here, low + _TUBE_SIDES + after, low + _TUBE_SIDES + here),
        (np.full(_TUBE_SIDES, first), after, here),
        (np.full(_TUBE_SIDES, last), top + here, top + after),
    ]
    faces = np.vstack([np.column_stack([corner.ravel() for corner in corners]) for corners in triangles])
    return Mesh(np.vstack([rings, *ends]), faces.astype(np.uint32))


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


@dataclass(frozen=True)
class ArmShapes:
    """An arm to be drawn: a mesh fixed to each link's frame, and one to the base."""

    links: tuple[Mesh, ...]  # (n_tree,) in the links' frames
    base: Mesh | None  # in the base frame
    length: float  # [m] of the arm from end to end of its chain: how large everything about it is drawn


_Parts = defaultdict[int, list[Mesh]]  # tubes by link; -1 is the base


def arm_shapes(model: RobotModel) -> ArmShapes:
    """Return the shapes of an arm's links: tubes from joint to joint, hubs of revolute joints, rails of prismatic ones.

    Where revolute axes and a slider meet in one point, as at the port of a RAVEN-II, links are arcs about that point.
    """
    length = arm_length(model)
    radius = _TUBE_RADIUS * length
    parts: _Parts = defaultdict(list)
    spherical = _spherical_joints(model, _JOINTS_MEET_WITHIN * length)
    if spherical:
        _draw_spherical(model, parts, spherical, radius)
    n = len(model.link_names)
    for link in range(-1, n):
        for child in np.flatnonzero(model.tree.parent == link).tolist():
            if child not in spherical:
                _draw_way(model, parts, link, child, radius, _JOINTS_MEET_WITHIN * length)
    for link in range(n):
        if link not in spherical and not model.tree.prismatic[link]:
            axis = model.tree.axis[link]
            # a wrist's hubs lie in one another: thinner ones at the end of the chain
            size = radius * (1.25 if link in model.tree.parent else 2.0 * _TIP_RADIUS)
            parts[link].append(tube(np.outer([-_HUB_LENGTH / 2.0, _HUB_LENGTH / 2.0], axis) * size, size))
    frame = model.frame()
    if np.linalg.norm(frame.pose.position) > _JOINTS_MEET_WITHIN * length:
        parts[frame.link].append(tube([np.zeros(3), frame.pose.position], _TIP_RADIUS * radius))
    links = tuple(joined(parts[link]) if parts[link] else _point(radius) for link in range(n))
    return ArmShapes(links, joined(parts[-1]) if parts[-1] else None, length)


def arm_length(model: RobotModel) -> float:
    """Return the length of the longest chain of a robot [m]: ways from joint to joint, sliders half out."""
    tree = model.tree
    reach = np.zeros(len(tree.parent))
    for i, parent in enumerate(tree.parent):
        low, high = _travel(model, i)
        slide = 0.5 * (low + high) if tree.prismatic[i] else 0.0
        step = float(np.linalg.norm(tree.origin[i] + slide * (tree.rotation[i] @ tree.axis[i])))
        reach[i] = step + (reach[parent] if parent >= 0 else 0.0)
    frame = model.frame()
    tip = float(np.linalg.norm(frame.pose.position)) + (reach[frame.link] if frame.link >= 0 else 0.0)
    return max(tip, float(reach.max(initial=0.0)), 1e-3)


def _travel(model: RobotModel, link: int) -> tuple[float, float]:
    """Return between which tree coordinates a joint moves [rad|m]."""
    row = model.coupling[link]
    with np.errstate(invalid="ignore"):
        ends = np.array([row * model.lower, row * model.upper])
    ends = np.where(row == 0.0, 0.0, ends)
    low, high = np.minimum(*ends).sum() + model.offset[link], np.maximum(*ends).sum() + model.offset[link]
    if not (np.isfinite(low) and np.isfinite(high)):
        return 0.0, _ENDLESS_TRAVEL_M
    return float(low), float(high)


def _draw_way(model: RobotModel, parts: _Parts, link: int, child: int, radius: float, near: float) -> None:
    """Draw what a link has between its own joint and that of a child."""
    tree = model.tree
    origin = tree.origin[child]
    if tree.prismatic[child]:
        axis = tree.rotation[child] @ tree.axis[child]
        low, high = _travel(model, child)
        if high - low > near:
            parts[link].append(tube(origin + np.outer([low, high], axis), 0.6 * radius))
    if np.linalg.norm(origin) > near:
        parts[link].append(tube([np.zeros(3), origin], radius))


def _spherical_joints(model: RobotModel, near: float) -> list[int]:
    """Return the revolute joints that meet in one point with a slider after them, the first two or more of a robot."""
    tree = model.tree
    found: list[int] = []
    for i, parent in enumerate(tree.parent):
        chained = parent == i - 1 and (i == 0 or np.linalg.norm(tree.origin[i]) < near)
        if not chained:
            return []
        if tree.prismatic[i]:  # what slides runs through the centre
            return found if len(found) >= 2 else []
        found.append(i)
    return []


def _draw_spherical(model: RobotModel, parts: _Parts, joints: list[int], radius: float) -> None:
    """Draw links as arcs about the point in which their axes meet, at hubs on the side of the slider's carriage."""
    tree = model.tree
    slider = joints[-1] + 1
    low, high = _travel(model, slider)
    middle = 0.5 * (low + high)
    size = _ARC_RADIUS * abs(middle)
    # unit vectors to the hubs of joint i and i + 1, both in the frame of link i: axes turn nothing about themselves
    toward = np.sign(middle) * (tree.rotation[slider] @ tree.axis[slider])
    parts[joints[-1]].append(tube([size * toward, max(abs(low), abs(high)) * toward], 0.8 * radius))
    for joint in reversed(joints):
        axis = tree.axis[joint]
        hub = axis if axis @ toward > 0.0 else -axis
        parts[joint].append(tube(size * _arc(hub, toward), 0.8 * radius))
        parts[joint].append(
            tube(np.outer([size - _HUB_LENGTH * radius, size + _HUB_LENGTH * radius], hub), 1.3 * radius)
        )
        toward = tree.rotation[joint] @ hub
    centre = tree.origin[joints[0]]
    foot = centre + 1.35 * size * toward
    parts[-1].append(tube([centre + (size + _HUB_LENGTH * radius) * toward, foot], 1.6 * radius))


def _arc(a: Floats, b: Floats) -> Floats:
    """Return unit vectors (N, 3) from one to another, along the great circle."""
    angle = float(np.arccos(np.clip(a @ b, -1.0, 1.0)))
    share = np.linspace(0.0, 1.0, _ARC_STEPS)[:, None]
    if angle < 1e-3:
        return np.vstack([a, a + 1e-3 * np.cross(a, [0.3, 0.5, 0.7])])
    return np.asarray((np.sin((1.0 - share) * angle) * a + np.sin(share * angle) * b) / np.sin(angle))


def _point(radius: float) -> Mesh:
    """Return what a link without any extent is drawn as."""
    return tube([[0.0, 0.0, -0.1 * radius], [0.0, 0.0, 0.1 * radius]], _TIP_RADIUS * radius)


def shapes_of(source: str, model: RobotModel) -> tuple[ArmShapes, str | None]:
    """Return an arm's shapes as its file, `source`, describes them, or as tubes, and why the latter."""
    tubes = arm_shapes(model)
    if source in robot_names():
        return tubes, None  # tables describe no looks
    try:
        described = described_geometry(source, model, kind="visual")
        if described is None:
            return tubes, None
        shapes = described_shapes(described.shapes, model, tubes)
    except (CatenaryError, OSError) as error:
        return tubes, f"drawn as tubes: {error}"
    faces = sum(len(mesh.faces) for mesh in shapes.links)
    if faces > _TRIANGLES:
        return tubes, f"drawn as tubes: its meshes have {faces} triangles, more than {_TRIANGLES}"
    return shapes, None


def described_shapes(shapes: tuple[Shape, ...], model: RobotModel, tubes: ArmShapes) -> ArmShapes:
    """Return forms fixed to links as one mesh a link; a link without any is a point at its joint."""
    found: _Parts = defaultdict(list)
    for shape in shapes:
        mesh = form_mesh(shape.form)
        if mesh is not None:
            vertices = mesh.vertices @ shape.pose.rotation.T + shape.pose.position
            found[shape.link].append(Mesh(vertices, mesh.faces))
    links = tuple(joined(found[link] or [_point(1e-3 * tubes.length)]) for link in range(len(model.link_names)))
    return ArmShapes(links, joined(found[-1]) if found[-1] else tubes.base, tubes.length)


def form_mesh(form: Form) -> Mesh | None:
    """Return a form as triangles; None of a floor or wall, which is no link."""
    import trimesh

    if isinstance(form, HalfSpace):
        return None
    if isinstance(form, TriangleMesh):
        return Mesh(np.asarray(form.vertices), form.triangles.astype(np.uint32))
    if isinstance(form, Capsule):
        half = np.array([0.0, 0.0, max(0.5 * form.length, 1e-9)])
        return tube([-half, half], form.radius)
    if isinstance(form, MeshFile):
        mesh = _read(form)
    elif isinstance(form, Cylinder):
        mesh = trimesh.creation.cylinder(radius=form.radius, height=form.length, sections=32)
    elif isinstance(form, Box):
        mesh = trimesh.creation.box(extents=form)
    else:
        mesh = trimesh.creation.icosphere(subdivisions=2)
        mesh.apply_scale(form.radius if isinstance(form, Ball) else form)
    return Mesh(np.asarray(mesh.vertices, dtype=float), np.asarray(mesh.faces, dtype=np.uint32))


def _read(file: MeshFile) -> Any:
    """Return a file's mesh, of the size that is asked for; a mirrored one is turned inside out again."""
    import trimesh

    try:
        mesh: Any = trimesh.load(file.path, force="mesh")
    except Exception as error:  # whatever a reader of a foreign format raises
        raise FileFormatError(f"{file.path}: cannot be read as a mesh: {error}") from error
    if len(mesh.faces) == 0 or not np.isfinite(mesh.vertices).all():
        raise FileFormatError(f"{file.path}: holds no triangles of finite numbers")
    mesh.apply_scale(file.scale)
    return mesh
