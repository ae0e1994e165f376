"""What a robot's own file shows of its links, as meshes: boxes, cylinders, balls, and the meshes that it names."""

from pathlib import Path
from typing import Any

import numpy as np

from catenary.errors import CatenaryError, FileFormatError
from catenary.robots.catalog import robot_names
from catenary.robots.geometry import (
    Ball,
    Box,
    Capsule,
    Cylinder,
    Ellipsoid,
    Form,
    HalfSpace,
    MeshFile,
    Shape,
    TriangleMesh,
)
from catenary.robots.model import RobotModel
from catenary.robots.shapes import described_geometry
from catenary.view.shapes import ArmShapes, arm_length, arm_shapes
from catenary.view.tubes import Mesh, joined, tube

LARGEST = 200_000  # triangles of an arm, beyond which a browser is slow


def shapes_of(source: str, model: RobotModel) -> tuple[ArmShapes, str | None]:
    """Return an arm's shapes as its file describes them, or as tubes from its kinematics, and why the latter.

    Args:
        source: What the robot was loaded from.
        model: The robot.
    """
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
    if faces > LARGEST:
        return tubes, f"drawn as tubes: its meshes have {faces} triangles, more than {LARGEST}"
    return shapes, None


def described_shapes(shapes: tuple[Shape, ...], model: RobotModel, tubes: ArmShapes) -> ArmShapes:
    """Return forms fixed to links as one mesh a link; a link without any is a point at its joint."""
    found: dict[int, list[Mesh]] = {}
    for shape in shapes:
        mesh = form_mesh(shape.form)
        if mesh is not None:
            vertices = mesh.vertices @ shape.pose.rotation.T + shape.pose.position
            found.setdefault(shape.link, []).append(Mesh(vertices, mesh.faces))
    length = arm_length(model)
    speck = tube([[0.0, 0.0, -1e-3 * length], [0.0, 0.0, 1e-3 * length]], 1e-3 * length)
    links = tuple(joined(found.get(link, [speck])) for link in range(len(model.link_names)))
    base = joined(found[-1]) if -1 in found else tubes.base
    return ArmShapes(links, base, length)


def form_mesh(form: Form) -> Mesh | None:
    """Return a form as triangles; None of a floor or wall, which is no link."""
    import trimesh

    if isinstance(form, HalfSpace):
        return None
    if isinstance(form, TriangleMesh):
        return Mesh(np.asarray(form.vertices), form.triangles.astype(np.uint32))
    if isinstance(form, MeshFile):
        return _read(form.path, form.scale)
    if isinstance(form, Capsule):
        half = np.array([0.0, 0.0, max(0.5 * form.length, 1e-9)])
        return tube([-half, half], form.radius)
    if isinstance(form, Cylinder):
        return _mesh(trimesh.creation.cylinder(radius=form.radius, height=form.length, sections=32))
    if isinstance(form, Box):
        return _mesh(trimesh.creation.box(extents=(form.x, form.y, form.z)))
    ball = trimesh.creation.icosphere(subdivisions=2)
    size = np.full(3, form.radius) if isinstance(form, Ball) else np.array(_axes(form))
    return Mesh(np.asarray(ball.vertices) * size, np.asarray(ball.faces, dtype=np.uint32))


def _axes(form: Ellipsoid) -> tuple[float, float, float]:
    return form.x, form.y, form.z


def _read(path: Path, scale: tuple[float, float, float]) -> Mesh:
    import trimesh

    try:
        mesh = _mesh(trimesh.load(path, force="mesh"))
    except Exception as error:  # whatever a reader of a foreign format raises
        raise FileFormatError(f"{path}: cannot be read as a mesh: {error}") from error
    if len(mesh.faces) == 0 or not np.isfinite(mesh.vertices).all():
        raise FileFormatError(f"{path}: holds no triangles of finite numbers")
    factors = np.array(scale)
    faces = mesh.faces[:, ::-1] if np.prod(factors) < 0.0 else mesh.faces
    return Mesh(mesh.vertices * factors, np.ascontiguousarray(faces))


def _mesh(mesh: Any) -> Mesh:
    return Mesh(np.asarray(mesh.vertices, dtype=float), np.asarray(mesh.faces, dtype=np.uint32))
