"""Meshes of an arm's links for drawing: those of its file, or tubes from joint to joint by its kinematics."""

from collections import defaultdict
from dataclasses import dataclass
from typing import Any

import numpy as np
import trimesh

from catenary.arrays import Floats
from catenary.errors import CatenaryError, FileFormatError
from catenary.robots.catalog import robot_names
from catenary.robots.geometry import Ball, Box, Capsule, Cylinder, Form, HalfSpace, MeshFile, Shape, TriangleMesh
from catenary.robots.model import RobotModel
from catenary.robots.shapes import described_geometry

_CAPSULE_FACETS = (16, 16)  # around and along a bar
_TUBE_RADIUS = 0.032  # radius of a tube, times the arm's length
_HUB_LENGTH = 2.6  # length of a joint's hub, times the tube's radius to either side
_TIP_RADIUS = 0.45  # radius of the last link and the tool, times the tube's
_JOINTS_MEET_WITHIN = 0.01  # largest distance of coincident joints, times the arm's length
_ARC_RADIUS = 0.72  # radius of a spherical linkage, times the distance from its centre to the slider
_ARC_STEPS = 24  # of an arc
_ARC_ANGLE_RAD = 1e-3  # [rad] smallest angle of an arc
_ENDLESS_TRAVEL_M = 0.5  # [m] of a slider without limits
_TRIANGLES = 200_000  # largest number for an arm, above which browsers are slow


Mesh = Any  # a trimesh.Trimesh


def bar(start: Floats, end: Floats, radius: float) -> Mesh:
    """Return a round bar of a radius [m] between two distinct points (3,) [m], with hemispherical ends."""
    way = end - start
    mesh = trimesh.creation.capsule(np.linalg.norm(way) / radius, 1.0, count=_CAPSULE_FACETS)
    mesh.apply_translation(-mesh.bounds.mean(axis=0)).apply_scale(radius)
    mesh.apply_transform(trimesh.geometry.align_vectors([0.0, 0.0, 1.0], way))  # type: ignore[no-untyped-call]
    return mesh.apply_translation(0.5 * (start + end))


def arc(a: Floats, b: Floats, size: float, radius: float) -> Mesh:
    """Return a bar of a radius [m] bent about the origin at a distance `size` [m], from unit vector a to b (3,)."""
    across = np.cross(a, b)
    if np.linalg.norm(across) < _ARC_ANGLE_RAD:
        return bar(size * a, size * (a + _ARC_ANGLE_RAD * np.cross(a, [0.3, 0.5, 0.7])), radius)
    z = across / np.linalg.norm(across)
    around = np.linspace(0.0, 2.0 * np.pi, _CAPSULE_FACETS[0] + 1)
    circle = np.column_stack([size + radius * np.cos(around), radius * np.sin(around)])
    place = np.eye(4)
    place[:3, :3] = np.column_stack([a, np.cross(z, a), z])
    angle = float(np.arccos(np.clip(a @ b, -1.0, 1.0)))
    return trimesh.creation.revolve(circle, angle=angle, sections=_ARC_STEPS, transform=place)


@dataclass(frozen=True)
class ArmShapes:
    """Meshes of an arm, one fixed to each link's frame, and one to the base."""

    links: tuple[Mesh, ...]  # (n_tree,) in the links' frames
    base: Mesh | None  # in the base frame
    length: float  # [m] of the arm's longest chain: the scale of everything drawn


_Parts = defaultdict[int, list[Mesh]]  # tubes by link; -1 is the base


def arm_shapes(model: RobotModel) -> ArmShapes:
    """Return the shapes of an arm's links: tubes from joint to joint, hubs of revolute joints, rails of prismatic ones.

    If revolute axes and a slider intersect in one point, as at the port of a RAVEN-II, links are arcs about that point.
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
            # a wrist's hubs overlap: thinner ones at the end of the chain
            size = radius * (1.25 if link in model.tree.parent else 2.0 * _TIP_RADIUS)
            parts[link].append(bar(-0.5 * _HUB_LENGTH * size * axis, 0.5 * _HUB_LENGTH * size * axis, size))
    frame = model.frame()
    if np.linalg.norm(frame.pose.position) > _JOINTS_MEET_WITHIN * length:
        parts[frame.link].append(bar(np.zeros(3), frame.pose.position, _TIP_RADIUS * radius))
    links = tuple(trimesh.util.concatenate(parts[link]) if parts[link] else _point(radius) for link in range(n))
    return ArmShapes(links, trimesh.util.concatenate(parts[-1]) if parts[-1] else None, length)


def arm_length(model: RobotModel) -> float:
    """Return the length of a robot's longest chain [m] from joint to joint, with sliders at mid-range."""
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


def _travel(model: RobotModel, link: int) -> tuple[float, float]:  # [rad|m]
    row = model.coupling[link]
    with np.errstate(invalid="ignore"):
        ends = np.array([row * model.lower, row * model.upper])
    ends = np.where(row == 0.0, 0.0, ends)
    low, high = np.minimum(*ends).sum() + model.offset[link], np.maximum(*ends).sum() + model.offset[link]
    if not (np.isfinite(low) and np.isfinite(high)):
        return 0.0, _ENDLESS_TRAVEL_M
    return float(low), float(high)


def _draw_way(model: RobotModel, parts: _Parts, link: int, child: int, radius: float, tolerance: float) -> None:
    tree = model.tree
    origin = tree.origin[child]
    if tree.prismatic[child]:
        axis = tree.rotation[child] @ tree.axis[child]
        low, high = _travel(model, child)
        if high - low > tolerance:
            parts[link].append(bar(origin + low * axis, origin + high * axis, 0.6 * radius))
    if np.linalg.norm(origin) > tolerance:
        parts[link].append(bar(np.zeros(3), origin, radius))


def _spherical_joints(model: RobotModel, tolerance: float) -> list[int]:
    """Return the first revolute joints of a robot, two or more, whose axes intersect, followed by a slider."""
    tree = model.tree
    joints: list[int] = []
    for i, parent in enumerate(tree.parent):
        chained = parent == i - 1 and (i == 0 or np.linalg.norm(tree.origin[i]) < tolerance)
        if not chained:
            return []
        if tree.prismatic[i]:  # the slider passes through the centre
            return joints if len(joints) >= 2 else []
        joints.append(i)
    return []


def _draw_spherical(model: RobotModel, parts: _Parts, joints: list[int], radius: float) -> None:
    """Draw links as arcs about the intersection of their axes, with hubs on the side of the slider's carriage."""
    tree = model.tree
    slider = joints[-1] + 1
    low, high = _travel(model, slider)
    middle = 0.5 * (low + high)
    size, half = _ARC_RADIUS * abs(middle), _HUB_LENGTH * radius
    # unit vectors to the hubs of joints i and i + 1, in the frame of link i: a rotation does not change its own axis
    toward = np.sign(middle) * (tree.rotation[slider] @ tree.axis[slider])
    parts[joints[-1]].append(bar(size * toward, max(abs(low), abs(high)) * toward, 0.8 * radius))
    for joint in reversed(joints):
        axis = tree.axis[joint]
        hub = axis if axis @ toward > 0.0 else -axis
        parts[joint].append(arc(hub, toward, size, 0.8 * radius))
        parts[joint].append(bar((size - half) * hub, (size + half) * hub, 1.3 * radius))
        toward = tree.rotation[joint] @ hub
    centre = tree.origin[joints[0]]
    parts[-1].append(bar(centre + (size + half) * toward, centre + 1.35 * size * toward, 1.6 * radius))


def _point(radius: float) -> Mesh:
    along = np.array([0.0, 0.0, 0.1 * radius])
    return bar(-along, along, _TIP_RADIUS * radius)


def shapes_of(source: str, model: RobotModel) -> tuple[ArmShapes, str | None]:
    """Return an arm's meshes by its file, or tubes, and the reason why the file's cannot be drawn, if any.

    Args:
        source: Name or file of the robot.
    """
    tubes = arm_shapes(model)
    if source in robot_names():
        return tubes, None  # tables have no shapes
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
    """Return shapes fixed to links as one mesh per link; a link without any is a point at its joint."""
    parts: _Parts = defaultdict(list)
    for shape in shapes:
        mesh = form_mesh(shape.form)
        if mesh is not None:
            place = np.eye(4)
            place[:3, :3], place[:3, 3] = shape.pose
            parts[shape.link].append(mesh.apply_transform(place))
    links = tuple(
        trimesh.util.concatenate(parts[link] or [_point(1e-3 * tubes.length)]) for link in range(len(model.link_names))
    )
    return ArmShapes(links, trimesh.util.concatenate(parts[-1]) if parts[-1] else tubes.base, tubes.length)


def form_mesh(form: Form) -> Mesh | None:
    """Return a form as a triangle mesh; None for a half-space."""
    if isinstance(form, HalfSpace):
        return None
    if isinstance(form, TriangleMesh):
        return trimesh.Trimesh(form.vertices, form.triangles, process=False)
    if isinstance(form, Capsule):
        half = np.array([0.0, 0.0, max(0.5 * form.length, 1e-9)])
        return bar(-half, half, form.radius)
    if isinstance(form, MeshFile):
        return _read(form)
    if isinstance(form, Cylinder):
        return trimesh.creation.cylinder(radius=form.radius, height=form.length, sections=32)
    if isinstance(form, Box):
        return trimesh.creation.box(extents=form)
    return trimesh.creation.icosphere(subdivisions=2).apply_scale(form.radius if isinstance(form, Ball) else form)


def _read(file: MeshFile) -> Any:
    """Return a file's mesh, scaled; the faces of a mirrored one keep their orientation."""
    try:
        mesh: Any = trimesh.load(file.path, force="mesh")
    except Exception as error:  # readers of foreign formats raise any
        raise FileFormatError(f"{file.path}: cannot be read as a mesh: {error}") from error
    if len(mesh.faces) == 0 or not np.isfinite(mesh.vertices).all():
        raise FileFormatError(f"{file.path}: holds no triangles of finite numbers")
    mesh.apply_scale(file.scale)
    return mesh
